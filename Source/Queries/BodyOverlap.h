#pragma once

#include "Queries/BodyPair.h"

#include <Eigen/Core>

#include <array>
#include <cstdint>

namespace palpate {

/// What OverlapTest knows of one body.
struct OverlapSide {
  CountedVector<std::uint8_t> sides;     ///< per triangle: on which sides its body is; 0: not known
  CountedVector<std::uint8_t> vertices;  ///< per vertex: whether it is on the other surface
  /// Per triangle: whether it has an area in common with the other surface.
  CountedVector<std::uint8_t> triangles;
};
struct OverlapScratch {
  OverlapSide a, b;
  CountedVector<std::uint32_t> edges;  ///< around a line
};

/// Whether the insides of two bodies have a common point, where a is moved by a translation.
///
/// Law      an overlap is bounded by pieces of both surfaces. Either a piece of one is inside the
///          other body, or pieces of both lie in each other with both bodies on one side. Where a
///          piece inside the other body ends, one of these holds:
///          (1) two triangles cross in a segment that runs inside both.
///          (2) an edge lies in a triangle, and its own triangle is on the side of the body.
///          (3) edges lie in each other, and a triangle at one is in the body between two
///          triangles at the other.
///          Else a whole part of a surface is inside, but for points and edges that touch.
///          These decisions are exact, and linear in the pairs of triangles that have a common
///          point. Triangles with their body on neither side, as those of a body that was pressed
///          flat, bound no inside and do not count. On which sides a body is, is tested beside the
///          middle of a triangle, kBesideTriangle of the largest coordinate away.
class OverlapTest {
 public:
  enum class Result : std::uint8_t {
    Apart,
    Piercing,  ///< surfaces prove the overlap where they meet
    Inside     ///< a part of a surface is inside the other body
  };
  OverlapTest(const BodyPair&, OverlapScratch&);
  /// intersecting: if given, receives the pairs of triangles that have a common point, by elements.
  Result find(const Eigen::Vector3d& shift,
              CountedVector<BodyPair::IntersectingTriangles>* intersecting = nullptr);

 private:
  using Both = BodyPair::IntersectingTriangles;

  OverlapSide& sideOf(bool ofA) { return ofA ? m_scratch.a : m_scratch.b; }
  unsigned sidesOf(bool ofA, std::uint32_t element);
  bool pierce(const Both&);
  bool isBetween(bool ofA, std::uint32_t edge, const Eigen::Vector3d& start,
                 const Eigen::Vector3d& end, const Eigen::Vector3d& at, const Eigen::Vector3d& p);
  bool isAnyPartInside(bool ofA);
  bool hasInside(std::uint32_t part, bool ofA);

  const BodyPair& m_pair;
  OverlapScratch& m_scratch;
  Eigen::Vector3d m_shift = Eigen::Vector3d::Zero();
  SignCounts m_counts;
};

/// Whether a mesh is convex: its faces are seen from one point inside each on one side, and no
/// vertex is in front of a neighbouring face by more than kExitSlack of the largest coordinate.
bool isConvex(const BodyPair&, bool ofA);

}  // namespace palpate
