#pragma once

#include <palpate/Settings.h>

#include "Queries/PairTraversal.h"
#include "Queries/RayHits.h"
#include "Bodies/Body.h"
#include "Octree/PointQueries.h"
#include "Math/TriangleIntersection.h"
#include "Core/CountedVector.h"

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

namespace palpate {

/// What a search needs of a mesh besides its octree.
struct BodyVertices {
  CountedVector<Eigen::Vector3d> positions;  ///< L, in the world
  CountedVector<std::uint32_t> triangleOf;   ///< per vertex: its lowest triangle, or kNoElement
  CountedVector<std::uint32_t> parts;        ///< a vertex of each connected part of the surface
  CountedVector<std::uint32_t> partOf;       ///< per vertex: the vertex that stands for its part
  Eigen::AlignedBox3d box;                   ///< of the vertices that are in triangles

  void assign(const Body&);
  double magnitude() const;  ///< L: the largest coordinate
  /// The vertex that is furthest along a direction.
  Eigen::Vector3d furthest(const Eigen::Vector3d& direction) const;
};

/// 1/L: a power of two that brings coordinates up to a magnitude to about 1, so that no product of
/// lengths leaves the range of double.
double unitOf(double magnitude);

struct BodyPairScratch {
  BodyVertices a, b;
  std::unique_ptr<PairScratch> pairs;
  PointQueryStack stack;
  std::vector<RayHits::Met> met;
};

/// What a translation moves.
enum class Moved : std::uint8_t {
  Positions,  ///< in the world, also of a placed body: to fl(position + shift)
  Body        ///< as the caller would: a placed body's translation, to fl(translation + shift)
};

/// Two closed meshes with triangles, and exact tests of both where a is moved by a translation.
class BodyPair {
 public:
  BodyPair(const Body& a, const Body& b, Engine, BodyPairScratch&, Moved = Moved::Body);

  const Body& geometry(bool ofA) const { return ofA ? m_a : m_b; }
  const BodyVertices& vertices(bool ofA) const { return ofA ? m_scratch.a : m_scratch.b; }
  Engine engine() const { return m_engine; }
  double magnitude() const { return m_magnitude; }  ///< L: the largest coordinate
  void countExactDecisions(std::size_t count) const { m_scratch.stack.exactDecisions += count; }

  Corners cornersOfA(std::uint32_t element, const Eigen::Vector3d& shift) const;
  Corners cornersOfB(std::uint32_t element) const;
  /// Two triangles that have a common point.
  struct IntersectingTriangles {
    std::uint32_t elementA, elementB;
    Corners a, b;  ///< a moved
    TriangleIntersection found;
  };
  /// Calls f for all that intersect, in any order, until it returns false.
  void forEachIntersecting(const Eigen::Vector3d& shift,
                           const std::function<bool(const IntersectingTriangles&)>& f) const;

  /// Whether a vertex is inside the other body, a not moved; not if it is on the surface.
  bool isInside(bool ofA, std::uint32_t vertex) const;
  /// The winding number of a body about a point, a not moved; 0 on the surface.
  int windingNumberOf(bool ofA, const Eigen::Vector3d& p) const;
  struct PartVertex {
    bool ofA;
    std::uint32_t vertex;
  };
  /// Whether a point is inside b, or inside a that is moved. Exact.
  bool isInB(const Eigen::Vector3d& p) const;
  bool isInMovedA(const Eigen::Vector3d& p, const Eigen::Vector3d& shift) const;
  /// Where a vertex is, a moved.
  Eigen::Vector3d position(const PartVertex& at, const Eigen::Vector3d& shift) const {
    return at.ofA ? moved(at.vertex, shift) : m_scratch.b.positions[at.vertex];
  }
  /// Where a vertex, on its way along a direction from `begin` to `end`, passes the other body's
  /// surface last. Both are L, from where it is. Asks no deadline.
  struct Exit {
    double distance;  ///< L, from where it is
    std::uint32_t element;
  };
  std::optional<Exit> lastExitOf(const PartVertex&, const Eigen::Vector3d& direction, double begin,
                                 double end) const;

 private:
  Eigen::Vector3d moved(std::uint32_t vertexOfA, const Eigen::Vector3d& shift) const;

  const Body &m_a, &m_b;
  const Engine m_engine;
  const bool m_movesTransform;
  BodyPairScratch& m_scratch;
  double m_magnitude;
};

}  // namespace palpate
