#include "Octree/Octree.h"

#include <palpate/Error.h>

#include "Octree/Fit.h"
#include "Octree/OctreeBuilder.h"
#include "Core/Assert.h"

#include <algorithm>
#include <numeric>

namespace palpate {

namespace {

/// Groups whose boxes one task writes to their nodes.
constexpr std::size_t kGroupsPerTask = 1024;

double halfArea(const FloatBox& box) {
  if (box.empty()) return 0.0;
  const double x = double{box.upper[0]} - box.lower[0], y = double{box.upper[1]} - box.lower[1],
               z = double{box.upper[2]} - box.lower[2];
  return x * y + y * z + z * x;
}

}  // namespace

Octree::Octree() = default;
Octree::~Octree() = default;

void Octree::reset(std::size_t size, std::span<const std::uint32_t> without) {
  m_stage = Stage::Empty;
  m_dops.directions = 3;
  ++m_layout;
  m_order.clear();
  m_nodes.groups.clear();
  m_nodes.groupNodes.clear();
  m_nodes.pool.start(0);
  m_boxes.resize(size);
  m_order.reserve(withSpare(size + BoxArrays::kPadding));  // read in whole vectors
  m_order.resize(size);
  if (without.empty()) return std::iota(m_order.begin(), m_order.end(), 0u);
  auto next = without.begin();
  std::uint32_t id = 0;
  for (std::uint32_t& element : m_order) {
    for (; next != without.end() && *next == id; ++next) ++id;
    element = id++;
  }
}

void Octree::copy(const Octree& other) {
  PALPATE_ASSERT(other.isBuilt() || other.size() == 0);
  const bool isSameLayout = isBuilt() && m_layout == other.m_layout;
  m_stage = Stage::Empty;
  const auto copyBuffer = [](auto& to, const auto& from) {
    resizeSparingly(to, from.size());
    std::copy(from.begin(), from.end(), to.begin());
  };
  if (!isSameLayout) {
    m_order.clear();
    m_order.reserve(other.size() + BoxArrays::kPadding);  // read in whole vectors
    m_order.assign(other.m_order.begin(), other.m_order.end());
    copyBuffer(m_nodes.parents, other.m_nodes.parents);
    m_nodes.rootCube = other.m_nodes.rootCube;
    m_nodes.pool.start(other.m_nodes.pool.used());
  }
  for (int k = 0; k < 3; ++k) {
    copyBuffer(m_boxes.lower[k], other.m_boxes.lower[k]);
    copyBuffer(m_boxes.upper[k], other.m_boxes.upper[k]);
  }
  std::copy_n(other.blocks(), other.m_nodes.pool.used(), m_nodes.pool.data());
  m_layout = other.m_layout;
  m_stage = other.m_stage;
}

void Octree::releaseMemory() {
  m_builder.reset();
  if (m_dops.directions == 3) m_dops = {};
  m_boxes.releaseMemory();
  for (auto* buffer : {&m_nodes.parents, &m_nodes.groups, &m_nodes.groupNodes, &m_nodes.partBlocks})
    releaseSpare(*buffer);
  releaseSpare(m_groupBoxes);
  m_nodes.pool.releaseMemory();
}

void Octree::build(const FloatBox& bounds, double bulk, const OctreeSettings& settings,
                   std::span<std::uint64_t> keys, const Threads& threads) {
  PALPATE_ASSERT(size() > 0 && keys.size() == size());
  m_stage = Stage::Empty;
  m_dops.directions = 3;
  ++m_layout;
  try {
    if (!m_builder) m_builder = std::make_unique<OctreeBuilder>();
    m_builder->build(m_boxes, bounds, bulk, settings, keys, m_order, m_nodes, threads);
    resizeSparingly(m_groupBoxes, m_nodes.groupNodes.size());
  } catch (...) {
    m_order.clear();
    throw;
  }
  PALPATE_ASSERT(m_nodes.groups.size() == m_nodes.groupNodes.size() + 1 &&
                 m_nodes.groups.front() == 0 && m_nodes.groups.back() == size());
  m_isUnmeasured = true;
  m_stage = Stage::LaidOut;
}

CountedVector<Octree::Move> Octree::replace(std::span<const std::uint32_t> places,
                                            std::span<const Joining> joining, bool keepsBoxes) {
  PALPATE_ASSERT(isBuilt() && !(places.empty() && joining.empty()));
  PALPATE_ASSERT(size() + joining.size() > places.size());
  m_stage = Stage::Empty;
  m_dops.directions = 3;
  ++m_layout;
  auto replaced = m_nodes.replace(static_cast<std::uint32_t>(size()), places, joining);
  const auto newSize = static_cast<std::uint32_t>(size() - places.size() + joining.size());
  const std::size_t most = std::max<std::size_t>(size(), newSize) + BoxArrays::kPadding;
  const auto moveIn = [&](auto& buffer) {
    if (buffer.capacity() < most) buffer.reserve(withSpare(most));
    buffer.resize(most);
    move(buffer.data(), replaced.first);
  };
  moveIn(m_order);
  m_order.resize(newSize);
  for (std::size_t i = 0; i < joining.size(); ++i) m_order[replaced.second[i]] = joining[i].element;
  for (int k = 0; k < 3 && keepsBoxes; ++k) moveIn(m_boxes.lower[k]), moveIn(m_boxes.upper[k]);
  m_boxes.resize(newSize);

  m_stage = keepsBoxes ? Stage::Built : Stage::LaidOut;
  return std::move(replaced.first);
}

void Octree::fit(const Threads& threads) {
  PALPATE_ASSERT(m_stage != Stage::Empty);
  m_stage = Stage::LaidOut;
  m_dops.directions = 3;
  OctreeNodes& nodes = m_nodes;
  m_groupAreas.resize((nodes.groupNodes.size() + kGroupsPerTask - 1) / kGroupsPerTask);
  threads.forChunks(nodes.groupNodes.size(), kGroupsPerTask,
                    [&](std::size_t chunk, std::size_t from, std::size_t to) {
                      double areas = 0;
                      for (std::size_t g = from; g < to; ++g) {
                        const OctreeNode node = nodes.groupNodes[g];
                        nodes.pool[blockOf(node)].setBox(slotOf(node), m_groupBoxes[g]);
                        areas += halfArea(m_groupBoxes[g]);
                      }
                      m_groupAreas[chunk] = areas;
                    });
  // In each part, children come after their parents, and all other parts come after the top.
  PALPATE_ASSERT(nodes.partBlocks.size() >= 2 && nodes.partBlocks.back() == nodes.pool.used());
  const std::size_t parts = nodes.partBlocks.size() - 1;
  threads.forEach(parts - 1, [&](std::size_t task) {
    fitBlocks(nodes.pool.data(), nodes.parents.data(), nodes.partBlocks[task + 1],
              nodes.partBlocks[task + 2]);
  });
  fitBlocks(nodes.pool.data(), nodes.parents.data(), 1, nodes.partBlocks[1]);
  m_stage = Stage::Built;
}

void Octree::refit(std::size_t first, std::size_t last) {
  PALPATE_ASSERT(isBuilt());
  m_dops.directions = 3;
  m_nodes.refit(first, last, m_groupBoxes);
}

void Octree::addAreas() {
  m_groupAreas.assign(1, 0.0);
  for (std::size_t g = 0; g < m_nodes.groupNodes.size(); ++g)
    m_groupAreas[0] += halfArea(m_groupBoxes[g]);
}

OctreeDops& Octree::startDops(int directions) {
  PALPATE_ASSERT(isBuilt());
  m_dops.directions = 3;
  for (int k = 3; k < directions; ++k)
    for (Buffer<float>* bounds : {&m_dops.lower[k], &m_dops.upper[k]})
      resizeSparingly(*bounds, size() + BoxArrays::kPadding);
  resizeSparingly(m_dops.blocks, m_nodes.pool.used() * static_cast<std::size_t>(directions - 3));
  return m_dops;
}

void Octree::fitDops(int directions) {
  PALPATE_ASSERT(isBuilt() && m_dops.directions == 3);
  m_dops.fit(m_nodes, directions);
}

void Octree::throwNotBuilt() {
  throw Error(ErrorCode::NotAvailable, "the octree was not built, or its last update failed");
}

void Octree::measureLooseness() {
  // All groups count, because a few that have become large cost most. For the elements, a sample is
  // enough.
  const Buffer<std::uint32_t>& groups = m_nodes.groups;
  const std::size_t count = m_nodes.groupNodes.size(),
                    stride = std::max<std::size_t>(8, count / 256);
  double areas = 0, elements = 0x1p-30 * halfArea(box(0));  // points have no area
  for (const double part : m_groupAreas) areas += part;
  for (std::size_t g = 0; g < count; g += stride)
    for (std::size_t i = groups[g]; i < groups[g + 1]; ++i) elements += halfArea(m_boxes[i]);
  m_looseness = elements > 0 ? areas / elements : 1.0;
  // Refitting does not tighten a tree. If looseness falls, the sample missed the elements that
  // caused it.
  m_leastLooseness = m_isUnmeasured ? m_looseness : std::min(m_leastLooseness, m_looseness);
  m_isUnmeasured = false;
}

std::size_t Octree::bytes() const {
  const auto of = [](const auto& buffer) { return buffer.capacity() * sizeof(buffer[0]); };
  std::size_t bytes =
      of(m_order) + of(m_nodes.groups) + of(m_nodes.groupNodes) + of(m_nodes.parents) +
      of(m_nodes.partBlocks) + of(m_groupBoxes) + of(m_groupAreas) + m_dops.bytes() +
      m_nodes.pool.allocated() * sizeof(OctreeBlock) + (m_builder ? m_builder->bytes() : 0);
  for (int k = 0; k < 3; ++k) bytes += of(m_boxes.lower[k]) + of(m_boxes.upper[k]);
  return bytes;
}

}  // namespace palpate
