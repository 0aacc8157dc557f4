#pragma once

#include "Meshes.h"

#include <palpate/DistanceField.h>
#include <palpate/OctreeBasedCD.h>
#include <palpate/SpatialQueries.h>

#include <Eigen/Core>

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace palpate::accuracy {

/// A closed or open body at rest, and a mesh or particles near it. Only their vertices are
/// compared.
struct RigidScene {
  const scenes::SceneMesh& body;
  const scenes::SceneMesh& tool;  ///< particles if it has no triangles
  double thickness;               ///< L: vertices within it, or inside the body, are contacts
  double band;                    ///< L: of distance fields, at least; it exceeds their errors
};

/// A method for vertices against a rigid body.
struct RigidContestant {
  std::string family, setting;
  Method method;
  double error = 0;  ///< L: the error bound of a distance field, the allowed error of a proxy
};

/// The contact that a method reports for a vertex; of several the nearest.
struct VertexClaim {
  std::uint32_t vertex;
  Eigen::Vector3d normal;  ///< unit, out of the body
  double distance;         ///< L; negative: depth
  bool isDoubtful;         ///< validity() says that the error bound does not hold
};

/// A method at work on a scene.
class RigidRun {
 public:
  RigidRun(const RigidScene&, const RigidContestant&);

  /// One step. Returns milliseconds of wall time, from positions to contacts.
  double step(std::span<const Eigen::Vector3d> now);
  /// What the last step reported, in the order of the vertices.
  std::vector<VertexClaim> claims() const;
  /// L: the error that the last answer states. 0: none.
  double errorBound() const { return data().errorBound(); }
  /// L: vertices deeper than this may be missing. Proximity examines surfaces only, and is trusted
  /// even so (law 5 of Validity); a proxy's last answer says so.
  double depth() const;
  Method method() const { return m_method; }
  /// Whether distances from the body have a sign at the point.
  bool knowsSide(const Eigen::Vector3d& point) const {
    return m_field ? m_field->signIsReliable(point) : m_isClosed;
  }
  bool isTrusted() const { return data().validity().trusted; }
  /// The time that the method needed before its first frame.
  double buildMilliseconds() const { return m_buildMilliseconds; }

 private:
  const CollisionData& data() const { return m_detection.collisionData(m_tool, m_body); }

  OctreeBasedCD m_detection{Settings{.threads = 1}};
  GeometryId m_tool{}, m_body{};
  Method m_method;
  double m_thickness;                            ///< L
  bool m_isClosed;                               ///< the body
  std::shared_ptr<const DistanceField> m_field;  ///< Method::DistanceField
  double m_buildMilliseconds = 0;
};

/// Errors of a method over all steps that were added.
struct RigidScore {
  std::size_t within = 0;        ///< vertices that are contacts
  std::size_t missing = 0;       ///< of these, not reported, although nearer by the stated error
  std::size_t claims = 0;        ///< reported
  std::size_t extra = 0;         ///< of these, not contacts by more than the stated error
  std::size_t wrongSide = 0;     ///< reported with a normal that points into the body
  std::size_t doubtful = 0;      ///< reported, and validity() doubts them
  std::size_t beyondStated = 0;  ///< reported, with an error beyond the stated one
  std::size_t silent = 0;      ///< errors beyond the stated bound of which validity() says nothing
  double distanceWorst = 0;    ///< L
  double distanceSquares = 0;  ///< L²
  double normalWorst = 0;      ///< degrees
  double statedWorst = 0;      ///< L: the largest error that an answer states

  /// truth: of every vertex, the exact signed distance from the body and its nearest point.
  void add(const RigidScene&, const RigidRun&, std::span<const Eigen::Vector3d> now,
           std::span<const SignedDistance> truth);
  double distanceRms() const;
};

/// The exact distances of points from a body. Inside a body that is not closed is where its
/// generalised winding number is at least 1/2 in magnitude.
class RigidTruth {
 public:
  explicit RigidTruth(const scenes::SceneMesh& body);
  std::vector<SignedDistance> of(std::span<const Eigen::Vector3d> points);

 private:
  OctreeBasedCD m_detection{Settings{.threads = 1}};
  GeometryId m_body{};
  InsideSettings m_inside;
};

}  // namespace palpate::accuracy
