#pragma once

#include <palpate/CountedVector.h>

#include "Mesh/Revision.h"
#include "Core/Assert.h"

#include <Eigen/Core>

#include <cstddef>
#include <cstring>
#include <memory>
#include <span>
#include <utility>
#include <vector>

namespace palpate {

/// A rotation and then a translation.
struct RigidTransform {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  /// Rounded as it is written: ((r0 x + r1 y) + r2 z) + t. Everything that places a body in the
  /// world uses this, so that all of it has the same rounding.
  Eigen::Vector3d operator()(const Eigen::Vector3d& p) const {
    const auto row = [&](int k) {
      return rotation(k, 0) * p[0] + rotation(k, 1) * p[1] + rotation(k, 2) * p[2] + translation[k];
    };
    return {row(0), row(1), row(2)};
  }
  /// Also of zeros, whose signs can reach positions.
  bool hasBitsOf(const RigidTransform& other) const {
    return std::memcmp(rotation.data(), other.rotation.data(), sizeof rotation) == 0 &&
           std::memcmp(translation.data(), other.translation.data(), sizeof translation) == 0;
  }
  friend bool operator==(const RigidTransform& l, const RigidTransform& r) {
    return l.rotation == r.rotation && l.translation == r.translation;
  }
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
  void setBody(Body body, Revision revision = {}) noexcept {
    PALPATE_ASSERT(body != nullptr);
    m_body = std::move(body);
    m_data = m_body->data();
    m_bodyRevision = revision;
  }
  void setBodyOf(const Positions& other) noexcept { setBody(other.m_body, other.m_bodyRevision); }
  bool isPlaced() const { return m_placed; }
  const RigidTransform& transform() const { return m_transform; }
  void place(const RigidTransform& transform, Revision revision) noexcept {
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
  RigidTransform m_transform;
  bool m_placed = false;
  Revision m_bodyRevision, m_transformRevision;
};

}  // namespace palpate
