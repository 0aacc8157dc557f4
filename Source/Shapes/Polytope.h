#pragma once

#include <palpate/Types.h>

#include "Math/ClosestPoint.h"
#include "Exact/Predicates.h"
#include "Core/Buffer.h"

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace palpate {

/// Signed distance from the surface of a convex body; negative inside.
struct PointShapeDistance {
  double distance;         ///< L
  Eigen::Vector3d normal;  ///< unit; the direction in which the distance grows fastest
};

/// L: how much the sides of an element rise along a normal. 0: they are perpendicular to it.
double riseOf(std::span<const Eigen::Vector3d> sides, const Eigen::Vector3d& normal);

/// The fewest of the points that span the same affine space as all of them: one point, the two ends
/// of a line, three points of a plane, or four points with a volume. The decisions are exact.
std::vector<Eigen::Vector3d> spanOf(std::span<const Eigen::Vector3d> points);

/// A convex body as triangles: the convex hull of its points. A face is visible from a point that
/// is strictly in front of the face's plane. This is decided exactly, so that rounding makes no
/// hole and no fold, and none of the points lies outside.
///
/// Ties     heights that differ by at most `tie`, L, count as equal. Among planes that are equally
///          near, the first one counts.
/// Source   the beneath-beyond method: Preparata, Shamos, Computational Geometry (1985), 3.4.2. For
///          many points with conflict lists: Clarkson, Shor, Applications of random sampling in
///          computational geometry II (1989).
class Polytope {
 public:
  struct OnFace {
    VertexTriangleDistance from;  ///< distance between the given point and the face
    std::uint32_t face;
  };

  /// The hull of points that span a plane or more. The hull of points in one plane is a plate,
  /// whose triangles exist in both windings.
  /// Cost     n log n expected for n points in any order. More than 32 points are added in a
  ///          shuffled order, which is the same in every run. Up to 32 points are added in their
  ///          own order.
  explicit Polytope(std::span<const Eigen::Vector3d> points);
  Polytope() = default;

  /// Restarts as the hull of four points, which must have a volume.
  void start(std::span<const Eigen::Vector3d> four);
  /// Grows the hull to contain p. Returns false if the hull already contains p.
  bool add(const Eigen::Vector3d& p);

  /// A hull made by the constructor has corners only. A hull that add() grew also keeps points that
  /// are no longer corners.
  const std::vector<Eigen::Vector3d>& points() const { return m_points; }
  /// Decisions left to exact arithmetic over the object's lifetime; start() does not reset them.
  std::size_t exactDecisions() const { return m_decisions.undecided; }
  std::size_t faceCount() const { return m_faces.size(); }
  const Triangle& corners(std::uint32_t face) const { return m_faces[face].corners; }
  /// Whether a face is part of the hull. A hull that grows keeps the entries of removed faces until
  /// it reuses them.
  bool hasFace(std::uint32_t face) const { return m_planes[face].face == face; }

  PointShapeDistance signedDistance(const Eigen::Vector3d& x, double tie) const;
  /// The same where an element has its least distance: of planes that are equally near a point
  /// inside, the one most nearly parallel to the element counts. sides: an edge, or two sides of a
  /// triangle.
  PointShapeDistance leastDistance(const Eigen::Vector3d& x, std::span<const Eigen::Vector3d> sides,
                                   double tie) const;
  /// The face nearest to x. For x inside, only the faces in the plane that signedDistance()
  /// measures from are considered.
  OnFace nearest(const Eigen::Vector3d& x, double tie) const;
  /// For a point inside: among the faces whose planes are at most `slack` further away than the
  /// nearest plane, the face nearest to x. If sliver faces lie in almost equal planes, nearest()
  /// may return a face far from the foot of x on its plane.
  OnFace nearestFaceWithin(const Eigen::Vector3d& x, double slack) const;
  const Eigen::Vector3d& normal(std::uint32_t face) const;  ///< unit, outward
  /// The mean of the points that are furthest along a direction.
  Eigen::Vector3d support(const Eigen::Vector3d& direction, double tie) const;
  /// The t in [0, 1] at which the signed distance of p + t (q - p) is least. If several t share the
  /// least distance, the result is an end of the edge if that is one of them, else their middle.
  double leastOnEdge(const Eigen::Vector3d& p, const Eigen::Vector3d& q, double tie) const;
  /// Weights of the triangle's point at which the signed distance is least. The triangle's plane
  /// must cut the hull. None if a point of the boundary is as deep, or if the triangle is outside.
  std::optional<Eigen::Vector3d> leastInTriangle(const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                                                 const Eigen::Vector3d& c, double tie) const;

 private:
  struct Face {
    Triangle corners;
    std::array<std::uint32_t, 3> neighbours;  ///< neighbour i shares corners i and i + 1
  };
  /// The plane normal . x = offset. A removed face has an infinite offset, so that its plane is
  /// never the highest.
  struct Plane {
    Eigen::Vector3d normal;
    double offset;
    std::uint32_t face;
    double height(const Eigen::Vector3d& x) const { return normal.dot(x) - offset; }
  };

  const Eigen::Vector3d& corner(std::uint32_t face, int i) const {
    return m_points[m_faces[face].corners[static_cast<std::size_t>(i)]];
  }
  struct Conflicts;
  bool isVisibleFrom(const Eigen::Vector3d& p, std::uint32_t face) {
    return orient3d(corner(face, 0), corner(face, 1), corner(face, 2), p, m_decisions) > 0;
  }
  void addAll(std::span<const Eigen::Vector3d> points);
  void addVisible(const Eigen::Vector3d& p);
  void removeVisible();
  std::uint32_t newFace(const Triangle& corners, const Triangle& neighbours);
  std::uint32_t addHorizonFaces(std::uint32_t face, std::uint32_t last);
  std::vector<std::uint32_t> compact();
  void reduceToPlate(std::uint32_t apex);
  std::uint32_t highestPlane(const Eigen::Vector3d& x, double tie) const;
  OnFace onFace(const Eigen::Vector3d& x, std::uint32_t face) const;
  OnFace walkToNearest(const Eigen::Vector3d& x, std::uint32_t face, double tie) const;
  template <class F>
  void forEachAround(const OnFace&, F&& f) const;
  struct Tangent;
  struct Minimum;
  template <class At>
  static Minimum minimize(double tie, At&& at);
  Minimum minimizeOnSegment(const Eigen::Vector3d& p, const Eigen::Vector3d& q, double tie) const;
  double sublevelMiddle(const Eigen::Vector3d& p, const Eigen::Vector3d& q, double t,
                        double height) const;

  std::vector<Eigen::Vector3d> m_points;
  Buffer<Face> m_faces;
  Buffer<Plane> m_planes;  ///< one for each face, then those of a plate's border
  Buffer<std::uint32_t> m_free, m_visible, m_next;  ///< scratch of add()
  /// A new face, and the removed face whose edge on the horizon it took.
  struct NewFace {
    std::uint32_t face, removed;
  };
  Buffer<NewFace> m_newFaces;  ///< scratch of add()
  SignCounts m_decisions;
  Buffer<std::uint8_t> m_isVisible;  ///< per face: from the point that is being added
};

}  // namespace palpate
