#pragma once

#include <palpate/Types.h>

#include "Mesh/Revision.h"
#include "Core/Assert.h"
#include "Core/CountedVector.h"

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

namespace palpate {

/// Whether poses are equal, also in the signs of zeros, which can reach positions.
inline bool haveSameBits(const Pose& l, const Pose& r) {
  return std::memcmp(l.rotation.data(), r.rotation.data(), sizeof l.rotation) == 0 &&
         std::memcmp(l.translation.data(), r.translation.data(), sizeof l.translation) == 0;
}

/// Consecutive vertices.
struct VertexRange {
  std::size_t begin = 0, end = 0;
  std::size_t size() const { return end - begin; }
  bool overlaps(const VertexRange& other) const { return other.begin < end && begin < other.end; }
  void add(const VertexRange& other) {  ///< becomes the range of both and what lies between
    if (other.size() == 0) return;
    *this =
        size() == 0 ? other : VertexRange{std::min(begin, other.begin), std::max(end, other.end)};
  }
};

/// In which vertices positions differ from those that they were made from.
class PositionChanges {
 public:
  /// All other vertices are as in the body of that revision. None: that is not known.
  std::optional<VertexRange> since(Revision earlier) const {
    for (const Change& change : m_changes)
      if (change.changed.size() > 0 && change.since == earlier) return change.changed;
    return {};
  }
  /// These vertices differ from `last`.
  void add(Revision last, const VertexRange& changed) {
    for (Change& change : m_changes)
      if (change.changed.size() > 0) change.changed.add(changed);
    m_changes[m_next] = {last, changed};
    m_next = (m_next + 1) % m_changes.size();
  }

 private:
  struct Change {
    Revision since;
    VertexRange changed;
  };
  std::array<Change, 8> m_changes{};  ///< any number will do
  std::size_t m_next = 0;
};

/// The positions of a geometry's vertices at one end of a step. A rigid body's positions are stored
/// in its own frame, shared by both ends, and are transformed to the world when they are read.
///
/// Two ends of one geometry with equal revisions have the same positions.
class Positions {
 public:
  using Body = std::shared_ptr<const CountedVector<Eigen::Vector3d>>;

  Positions() : Positions(std::make_shared<const CountedVector<Eigen::Vector3d>>()) {}
  Positions(const std::vector<Eigen::Vector3d>& world)
      : Positions(
            std::make_shared<const CountedVector<Eigen::Vector3d>>(world.begin(), world.end())) {}
  explicit Positions(Body body) { setBody(std::move(body)); }

  std::size_t size() const { return m_body->size(); }
  /// In the world.
  Eigen::Vector3d operator[](std::size_t vertex) const {
    PALPATE_ASSERT(vertex < m_body->size());
    return m_placed ? m_transform(m_data[vertex]) : m_data[vertex];
  }
  std::vector<Eigen::Vector3d> all() const {
    std::vector<Eigen::Vector3d> world(size());
    for (std::size_t v = 0; v < size(); ++v) world[v] = (*this)[v];
    return world;
  }

  /// In the body's frame, which is the world unless isPlaced().
  std::span<const Eigen::Vector3d> body() const { return *m_body; }
  bool hasSameBody(const Positions& other) const { return m_body == other.m_body; }
  const Body& sharedBody() const { return m_body; }
  void findData() noexcept { m_data = m_body->data(); }  ///< call after the body has moved
  /// The body is a copy of the one now.
  void moveBody(Body copy) noexcept {
    m_body = std::move(copy);
    findData();
  }
  /// bounds: of the positions.
  void setBody(Body body, const Eigen::AlignedBox3d& bounds, Revision revision) noexcept {
    PALPATE_ASSERT(body != nullptr && bounds.isEmpty() == body->empty());
    m_body = std::move(body);
    m_data = m_body->data();
    m_bounds = bounds;
    m_bodyRevision = revision;
    m_changes = {};
  }
  /// The same for positions that differ from those now in some vertices only.
  void changeBody(Body body, const Eigen::AlignedBox3d& bounds, const VertexRange& changed,
                  Revision revision) noexcept {
    PositionChanges changes = m_changes;
    changes.add(m_bodyRevision, changed);
    setBody(std::move(body), bounds, revision);
    m_changes = changes;
  }
  void setBody(Body body, Revision revision = {}) noexcept {
    Eigen::AlignedBox3d bounds;
    for (const Eigen::Vector3d& p : *body) bounds.extend(p);
    setBody(std::move(body), bounds, revision);
  }
  void setBodyOf(const Positions& other) noexcept {
    setBody(other.m_body, other.m_bounds, other.m_bodyRevision);
    m_changes = other.m_changes;
  }
  /// The vertices in which body() may differ from the one of an earlier revision, if that is known.
  std::optional<VertexRange> changesSince(Revision earlier) const {
    return earlier == m_bodyRevision ? VertexRange() : m_changes.since(earlier);
  }
  const Eigen::AlignedBox3d& bounds() const { return m_bounds; }  ///< of body()
  bool isPlaced() const { return m_placed; }
  const Pose& transform() const { return m_transform; }
  void place(const Pose& transform, Revision revision) noexcept {
    PALPATE_ASSERT(transform.rotation.allFinite() && transform.translation.allFinite());
    m_transform = transform;
    m_placed = true;
    m_transformRevision = revision;
  }
  void placeAs(const Positions& other) noexcept {
    m_transform = other.m_transform;
    m_placed = other.m_placed;
    m_transformRevision = other.m_transformRevision;
  }

  Revision bodyRevision() const { return m_bodyRevision; }
  PositionsState state() const { return {m_bodyRevision, m_transformRevision}; }
  bool isSameAs(const Positions& other) const {
    return hasSameBody(other) && m_transformRevision == other.m_transformRevision;
  }

 private:
  Body m_body;
  const Eigen::Vector3d* m_data;
  Eigen::AlignedBox3d m_bounds;
  Pose m_transform;
  bool m_placed = false;
  Revision m_bodyRevision, m_transformRevision;
  PositionChanges m_changes;
};

}  // namespace palpate
