#include "CollisionDetection/GeometryStep.h"

#include <palpate/Error.h>

#include "CollisionDetection/GeometryChecks.h"
#include "Bodies/InputChecks.h"
#include "Mesh/Rotation.h"
#include "Math/StableLength.h"
#include "Math/Tolerances.h"
#include "Core/Assert.h"
#include "Core/Buffer.h"

#include <algorithm>
#include <cstring>
#include <string>
#include <utility>

namespace palpate {

// Placed coordinates, at most (sqrt(3) + 1) kLargestMeasure, are in the range of the narrow phase.
static_assert(2.74 * kLargestMeasure < kLargestPlaced);

void GeometryStep::start(TriangleMesh& mesh, Positions::Body body) noexcept {
  m_isNew = true;
  m_bodyGiven = false;
  m_sets = {};
  mesh.now.setBody(std::move(body), m_revisions.next());
  mesh.before.setBodyOf(mesh.now);
  if (!m_transformGiven) mesh.before.placeAs(mesh.now);
  m_detected = mesh.before;
}

void GeometryStep::startShape(const Shape& shape) { m_spare = m_spareBefore = shape; }

void GeometryStep::setBody(TriangleMesh& mesh, Positions& end,
                           const PositionBodies::Checked& checked) noexcept {
  const Positions::Body& body = checked.positions;
  // The ends often share one body; it is compared only once.
  const Positions* last = nullptr;
  for (const Positions* other : {&std::as_const(end), &std::as_const(mesh.now),
                                 &std::as_const(m_detected), &std::as_const(mesh.before)}) {
    if (last && other->hasSameBody(*last)) continue;
    last = other;
    if (other->size() == body->size() &&
        (body->empty() || std::memcmp(other->body().data(), body->data(),
                                      body->size() * sizeof(Eigen::Vector3d)) == 0)) {
      checked.memory->revision = other->bodyRevision();
      return end.setBodyOf(*other);
    }
  }
  end.setBody(body, checked.bounds, m_revisions.next());
  checked.memory->revision = end.bodyRevision();
}

void GeometryStep::reserveCut(TriangleMesh& mesh, std::size_t count, std::size_t gone) {
  reserveAmortized(m_cuts.gone, m_cuts.gone.size() + gone);
  m_cuts.positions.reserve(m_cuts.positions.size() + ends(mesh).size());
  if (count > 0) m_bodies.reserve(ends(mesh), count);
}

void GeometryStep::cut(TriangleMesh& mesh, std::span<const Eigen::Vector3d> newVertices,
                       const ElementsState& before, std::size_t count, const ElementsState& after,
                       std::span<const std::pair<std::uint32_t, Triangle>> gone) noexcept {
  if (m_cuts.after != before) {
    m_cuts.before = before;
    m_cuts.firstAdded = static_cast<std::uint32_t>(count);
    m_cuts.positions.clear();
    m_cuts.gone.clear();
  }
  insertSorted(m_cuts.gone, gone);
  m_cuts.after = after;
  if (!newVertices.empty()) append(mesh, newVertices);
}

void GeometryStep::append(TriangleMesh& mesh, std::span<const Eigen::Vector3d> positions) noexcept {
  Eigen::AlignedBox3d added;
  for (const Eigen::Vector3d& p : positions) added.extend(p);
  std::array<Positions*, 3> all = ends(mesh);
  for (auto end = all.begin(); end != all.end(); ++end) {
    const auto same = std::find_if(
        all.begin(), end, [&](const Positions* other) { return other->hasSameBody(**end); });
    if (same != end) {
      (*end)->setBodyOf(**same);
      continue;
    }
    PositionBodies::Memory* const own = m_bodies.find((*end)->sharedBody());
    PALPATE_ASSERT(own);
    PositionBodies::Memory& memory = *own;
    memory.positions->insert(memory.positions->end(), positions.begin(), positions.end());
    memory.revision = m_revisions.next();
    m_cuts.append((*end)->bodyRevision(), *memory.revision);
    (*end)->setBody(memory.positions, (*end)->bounds().merged(added), *memory.revision);
  }
}

void GeometryStep::setSomePositions(const GeometryLabel& label, TriangleMesh& mesh,
                                    std::size_t first, std::span<const Eigen::Vector3d> now,
                                    const Threads& threads) {
  const VertexRange changed{first, first + now.size()};
  const std::span<const Eigen::Vector3d> last = mesh.now.body();
  PALPATE_ASSERT(!now.empty() && changed.end <= last.size());
  PositionBodies::Memory& memory = m_bodies.copyOf(mesh.now);
  Eigen::Vector3d* const all = memory.positions->data();
  const Eigen::AlignedBox3d part =
      checkPositions(label, now, all + first, "", threads, nullptr, nullptr, first);
  // Nothing below throws. Positions that equal those of another end take its revision.
  for (const Positions* other :
       {&std::as_const(mesh.now), &std::as_const(m_detected), &std::as_const(mesh.before)}) {
    if (other->size() != last.size()) continue;
    VertexRange different =
        mesh.now.changesSince(other->bodyRevision()).value_or(VertexRange{0, last.size()});
    different.add(changed);
    if (std::memcmp(other->body().data() + different.begin, all + different.begin,
                    different.size() * sizeof(Eigen::Vector3d)) != 0)
      continue;
    memory.revision = other->bodyRevision();
    mesh.now.setBodyOf(*other);
    if (m_isNew && !m_bodyGiven) mesh.before.setBodyOf(mesh.now);
    return;
  }
  Eigen::AlignedBox3d bounds = mesh.now.bounds(), old;
  for (std::size_t v = changed.begin; v < changed.end; ++v) old.extend(last[v]);
  // A side that an old position touched may be further in now, unless a new one reaches it.
  const auto stays = [](const auto& side, const auto& before, const auto& after) {
    return (before < side || after >= side).all();
  };
  if (stays(bounds.max().array(), old.max().array(), part.max().array()) &&
      stays(-bounds.min().array(), -old.min().array(), -part.min().array())) {
    bounds.extend(part);
  } else {
    bounds.setEmpty();
    for (std::size_t v = 0; v < last.size(); ++v) bounds.extend(all[v]);
  }
  mesh.now.changeBody(memory.positions, bounds, changed, m_revisions.next());
  memory.revision = mesh.now.bodyRevision();
  if (m_isNew && !m_bodyGiven) mesh.before.setBodyOf(mesh.now);
}

void GeometryStep::setPositions(const GeometryLabel& label, TriangleMesh& mesh,
                                std::optional<std::span<const Eigen::Vector3d>> before,
                                std::span<const Eigen::Vector3d> now, const Threads& threads,
                                std::optional<MotionRange>* moved) {
  const bool isPlaced = mesh.now.isPlaced() || mesh.before.isPlaced();
  const auto start =
      before ? m_bodies.checked(label, *before, " before", threads) : PositionBodies::Checked();
  const bool followsNow = m_isNew && !m_bodyGiven && !before;
  const bool measures = moved && !isPlaced && !followsNow && !now.empty();
  const Eigen::Vector3d* const from =
      !measures ? nullptr : (before ? *start.positions : mesh.before.body()).data();
  MotionRange motion;
  const auto end = m_bodies.checked(label, now, before ? " now" : "", threads, from, &motion);
  // Nothing below throws.
  if (before) {
    m_bodyGiven = true;
    setBody(mesh, mesh.before, start);
  }
  const Positions last = mesh.now;
  setBody(mesh, mesh.now, end);
  if (followsNow) mesh.before.setBodyOf(mesh.now);
  if (measures) *moved = motion;
  noteSet(mesh, last, before.has_value());
}

/// L: about the longest way of a vertex; of a placed body that of its middle.
static double motionOf(const Positions& before, const Positions& now) {
  if (before.isSameAs(now) || before.size() != now.size()) return 0.0;
  if (!before.isPlaced() && !now.isPlaced()) return largestMotion(motionRange(before, now), {});
  const auto middle = [](const Positions& end) {
    const Eigen::AlignedBox3d& box = end.bounds();
    Eigen::Vector3d centre = Eigen::Vector3d::Zero();
    if (!box.isEmpty()) centre = box.center();
    return end.isPlaced() ? end.transform()(centre) : centre;
  };
  return stableLength(middle(now) - middle(before));
}

/// Positions now were set, and were `last` before. begins: with those at the step's start.
void GeometryStep::noteSet(const TriangleMesh& mesh, const Positions& last, bool begins) noexcept {
  if (begins || m_isNew) {
    m_sets = {};
  } else if (m_sets.isSet) {
    if (m_sets.count == 0) m_sets.begin(motionOf(mesh.before, last));
    if (m_sets.count > 0) m_sets.add(motionOf(last, mesh.now), motionOf(mesh.before, mesh.now));
  }
  m_sets.isSet = true;
  m_sets.isDetected = false;
}

void GeometryStep::place(TriangleMesh& mesh, Positions& end, const Pose& transform) noexcept {
  for (const Positions* other : {&std::as_const(end), &std::as_const(mesh.now),
                                 &std::as_const(m_detected), &std::as_const(mesh.before)})
    if (other->isPlaced() && haveSameBits(other->transform(), transform))
      return end.placeAs(*other);
  end.place(transform, m_revisions.next());
}

void GeometryStep::setTransform(const GeometryLabel& label, TriangleMesh& mesh, PlacedShape* shape,
                                const std::optional<Pose>& givenBefore, const Pose& givenNow) {
  const auto checked = [&](const Pose& transform, const char* which) {
    if (const std::string fault = faultOf(transform); !fault.empty())
      throw Error(ErrorCode::InvalidTransform, nameOf(label) + ": " + which + fault, label.id);
    return withExactRotation(transform);
  };
  std::optional<Pose> before;
  if (givenBefore) before = checked(*givenBefore, "before: ");
  const Pose now = checked(givenNow, before ? "now: " : "");
  const bool followsNow = m_isNew && !m_transformGiven && !before;
  if (shape) {
    m_spare->place(shape->analytical, now);
    if (before) m_spareBefore->place(shape->analytical, *before);
    if (followsNow) m_spareBefore->place(shape->analytical, now);
  }
  // Nothing below throws.
  const Positions last = mesh.now;
  if (before) {
    m_transformGiven = true;
    place(mesh, mesh.before, *before);
  }
  place(mesh, mesh.now, now);
  if (followsNow) mesh.before.placeAs(mesh.now);
  noteSet(mesh, last, before.has_value());
  if (!shape) return;
  std::swap(shape->now, *m_spare);
  if (before || followsNow) std::swap(shape->before, *m_spareBefore);
}

void GeometryStep::restoreNow(TriangleMesh& mesh, PlacedShape* shape,
                              const Positions& now) noexcept {
  mesh.now = now;
  if (shape) shape->now.place(shape->analytical, now.transform());  // into its own memory
}

GeometryStep::State GeometryStep::state(const TriangleMesh& mesh) const {
  return {mesh.now, mesh.before, m_detected, m_isNew, m_bodyGiven, m_transformGiven, m_sets};
}

void GeometryStep::restore(TriangleMesh& mesh, PlacedShape* shape, const State& state) noexcept {
  mesh.now = state.now;
  mesh.before = state.before;
  m_detected = state.detected;
  m_isNew = state.isNew;
  m_bodyGiven = state.bodyGiven;
  m_transformGiven = state.transformGiven;
  m_sets = state.sets;
  if (!shape) return;
  shape->now.place(shape->analytical, mesh.now.transform());  // into its own memory
  shape->before.place(shape->analytical, mesh.before.transform());
}

void GeometryStep::advance(TriangleMesh& mesh, PlacedShape* shape) noexcept {
  // Both are placements of one shape, so that the assignment reuses the memory.
  if (shape && !mesh.before.isSameAs(mesh.now)) shape->before = shape->now;
  mesh.before = mesh.now;
  m_isNew = m_bodyGiven = m_transformGiven = false;
  m_sets = {};
}

}  // namespace palpate
