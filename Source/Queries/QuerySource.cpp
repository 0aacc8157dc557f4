#include "Queries/QuerySource.h"

#include <palpate/Error.h>

#include "Queries/Containment.h"
#include "Queries/Embedding.h"
#include "Mesh/Rotation.h"
#include "Math/Range.h"
#include "Core/Assert.h"
#include "Core/Text.h"

#include <algorithm>
#include <atomic>
#include <bit>
#include <string>
#include <utility>

namespace palpate {

namespace {

std::uint64_t nextSourceId() {
  static std::atomic<std::uint64_t> last = 0;
  return ++last;
}

}  // namespace

SpatialQueries::Source::Pool::Pool(std::shared_ptr<MemoryBudget> budget)
    : m_id(nextSourceId()), m_budget(std::move(budget)) {}

SpatialQueries::Source::Pool::~Pool() { delete m_spare.load(); }

std::unique_ptr<SpatialQueries::Source::Scratch> SpatialQueries::Source::Pool::take() {
  if (Scratch* const spare = m_spare.exchange(nullptr)) return std::unique_ptr<Scratch>(spare);
  {
    const std::lock_guard lock(m_mutex);
    if (!m_free.empty()) {
      auto scratch = std::move(m_free.back());
      m_free.pop_back();
      return scratch;
    }
  }
  return std::make_unique<Scratch>();
}

void SpatialQueries::Source::Pool::giveBack(std::unique_ptr<Scratch> scratch) {
  PALPATE_ASSERT(scratch);
  Scratch* none = nullptr;
  if (m_spare.compare_exchange_strong(none, scratch.get())) {
    scratch.release();
    return;
  }
  const std::lock_guard lock(m_mutex);
  try {
    m_free.push_back(std::move(scratch));
  } catch (...) {  // no memory to keep it: the next call makes another
  }
}

void SpatialQueries::Source::Pool::release() {
  delete m_spare.exchange(nullptr);
  const std::lock_guard lock(m_mutex);
  m_free.clear();
}

namespace {

/// Sorts different numbers: as the bits of a field if they lie close together.
void sort(std::vector<std::uint32_t>& numbers, std::vector<std::uint64_t>& bits) {
  if (numbers.empty()) return;
  const auto [least, most] = std::minmax_element(numbers.begin(), numbers.end());
  const std::size_t first = *least / 64, words = *most / 64 - first + 1;
  if (words > 8 * numbers.size()) {
    std::sort(numbers.begin(), numbers.end());
    return;
  }
  bits.assign(words, 0);
  for (const std::uint32_t i : numbers) bits[i / 64 - first] |= std::uint64_t{1} << i % 64;
  std::size_t count = 0;
  for (std::size_t w = 0; w < words; ++w)
    for (std::uint64_t word = bits[w]; word; word &= word - 1)
      numbers[count++] = static_cast<std::uint32_t>((first + w) * 64) +
                         static_cast<std::uint32_t>(std::countr_zero(word));
  PALPATE_ASSERT(count == numbers.size());
}

}  // namespace

void SpatialQueries::Source::Scratch::giveSorted(std::vector<std::uint32_t>& out) {
  sort(elements, bits);
  out.reserve(elements.size());  // nothing below throws
  out.assign(elements.begin(), elements.end());
}

void SpatialQueries::Source::prepareInside(const Body& body, const InsideSettings& settings) {
  checkSettings(body, settings);
  PreparedState& prepared = body.prepared->preparedFor[settings.rule == InsideRule::WindingNumber];
  const std::uint64_t now = state(), updates = body.tree.updates();
  if (prepared.isCurrent(now, updates)) return;
  const std::lock_guard lock(body.prepared->mutex);
  const MemoryScope memory(budget(), MemoryStage::Queries);
  checkInside(body, settings.rule);
  if (settings.rule == InsideRule::WindingNumber && body.tree.octree().size() > 0)
    body.prepared->windingNumbers.update(body, Workers(*this));
  else if (settings.rule == InsideRule::Closed && body.solid)
    updateTetrahedra(body, octreeSettings(), Workers(*this));
  prepared.commit(now, updates);
}

bool SpatialQueries::Source::prepareIfClosed(const Body& body) {
  const std::lock_guard lock(body.prepared->mutex);
  const MemoryScope memory(budget(), MemoryStage::Queries);
  if (!isClosed(body)) return false;
  if (body.solid) updateTetrahedra(body, octreeSettings(), Workers(*this));
  return true;
}

void SpatialQueries::Source::prepareTetrahedra(const Body& solid) {
  const std::lock_guard lock(solid.prepared->mutex);
  const MemoryScope memory(budget(), MemoryStage::Queries);
  updateTetrahedra(solid, octreeSettings(), Workers(*this));
}

void checkVertices(const Body& vertices, GeometryId body) {
  if (vertices.id == body)
    throw Error(
        ErrorCode::InvalidSettings,
        nameOf(vertices) + " is both the body and the owner of the vertices; these must differ",
        body);
  if (vertices.shape)
    throw Error(ErrorCode::UnsupportedMethod,
                nameOf(vertices) + " is a shape, which has no vertices", vertices.id);
}

SpatialQueries::SpatialQueries(std::shared_ptr<Source> source)
    : m_source(std::move(source)), m_state(m_source->state()) {}

SpatialQueries::Source& SpatialQueries::valid() const {
  if (!m_source) throw Error(ErrorCode::InvalidCall, "this SpatialQueries object was moved from");
  if (m_state == 0 || m_source->state() != m_state)
    throw Error(
        ErrorCode::InvalidCall,
        "this SpatialQueries object is outdated: positions, transforms, topology or geometries "
        "changed, advance() was called, or the OctreeBasedCD or Snapshot was destroyed; call "
        "queries() again");
  return *m_source;
}

void checkLength(double length, const char* name, bool finite) {
  if (!(length >= 0) || (finite && !isWithinRange(length)))
    throw Error(ErrorCode::InvalidSettings, std::string(name) + " is " + textOf(length) +
                                                "; it must be " +
                                                (finite ? kLengthRule : "a number of at least 0"));
}

void checkHasElements(const Body& geometry) {
  if (geometry.shape)
    throw Error(ErrorCode::UnsupportedMethod, nameOf(geometry) + " is a shape: it has no elements",
                geometry.id);
}

Pose checkedPose(const Pose& pose, const char* what) {
  if (const std::string fault = faultOf(pose); !fault.empty())
    throw Error(ErrorCode::InvalidTransform, std::string(what) + ": " + fault);
  return withExactRotation(pose);
}

void checkPoint(const Eigen::Vector3d& point, std::optional<std::size_t> index) {
  if (!isWithinRange(point))
    throw Error(ErrorCode::NonFinitePosition,
                (index ? "point " + std::to_string(*index) : "the query's point") + " is " +
                    textOf(point) + "; it must be " + kRangeRule);
}

void checkPoints(std::span<const Eigen::Vector3d> points) {
  for (std::size_t i = 0; i < points.size(); ++i) checkPoint(points[i], i);
}

void checkSizes(std::size_t asked, std::size_t room, const char* name) {
  if (asked != room)
    throw Error(ErrorCode::InvalidSettings, std::to_string(asked) + " " + name + ", but room for " +
                                                std::to_string(room) + " answers");
}

}  // namespace palpate
