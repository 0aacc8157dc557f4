#pragma once

#include <palpate/AnalyticalGeometry.h>

#include "Shapes/Polytope.h"
#include "Mesh/Positions.h"

#include <Eigen/Geometry>

#include <array>
#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <type_traits>
#include <variant>
#include <vector>

namespace palpate {

/// Where a vertex, an edge or a triangle comes nearest to a shape, or is deepest inside.
struct NearestToShape {
  Eigen::Vector3d weights;  ///< of its vertices; never negative
  Eigen::Vector3d normal;   ///< unit, from the shape towards it
  double distance;          ///< L, negative inside
  bool inInterior;          ///< strictly: not on an end, not on an edge
  bool exact = false;       ///< floating point left it to exact arithmetic
};

/// The same at a time of the step.
struct ShapeImpact {
  double time;
  NearestToShape nearest;
};

/// How far two shapes are apart; negative: as far as the shortest way to part them.
struct ShapePairDistance {
  Eigen::Vector3d pointA, pointB;  ///< L, on the surfaces
  Eigen::Vector3d normal;          ///< unit, from b towards a
  double distance;                 ///< L: pointA - pointB = distance * normal

  ShapePairDistance exchanged() const { return {pointB, pointA, -normal, distance}; }
};

struct ShapePairScratch;

/// An analytical shape in the world.
///
/// The signed distance to a convex shape is convex, so that an element has one least distance.
/// Where several of its points share it, one on its boundary is taken if there is one, else the
/// middle.
class Shape {
 public:
  Shape(const AnalyticalGeometry&, const RigidTransform&);
  /// The same shape elsewhere.
  void place(const AnalyticalGeometry&, const RigidTransform&);
  /// A cylinder at a time of a step: a right one between its ends, which move linearly.
  void placeBetween(const Shape& before, const Shape& now, double time);

  SignedDistance at(const Eigen::Vector3d& x) const;
  NearestToShape nearestOfEdge(const Eigen::Vector3d& p, const Eigen::Vector3d& q) const;
  /// None where a point of the triangle's boundary is as near.
  std::optional<NearestToShape> nearestInTriangle(const Eigen::Vector3d& a,
                                                  const Eigen::Vector3d& b,
                                                  const Eigen::Vector3d& c) const;
  /// From another shape, b; not both planes. Exchanged shapes give the same bits, exchanged.
  ///
  /// Planes by the other's furthest point, spheres by the distance of a point, two capsules by that
  /// of edges; all others by how far the origin is from the body of all differences a - b, less the
  /// radii. Within that a polytope grows from its furthest points along the direction in which the
  /// origin is nearest to leave it. The origin's distance to the polytope and its height over the
  /// last furthest point are bounds on either side; they meet within kShapePairGap.
  ///
  /// Source   Gilbert, Johnson, Keerthi (1988) and van den Bergen (2001) where shapes are apart and
  ///          where they overlap. Difference: one polytope for both, of all points so far, whose
  ///          triangles are kept by exact predicates.
  ShapePairDistance distanceFrom(const Shape& b, ShapePairScratch&) const;
  /// In some order of all shapes; of two of which neither precedes the other the measures are the
  /// same.
  bool precedes(const Shape&) const;
  /// The middle of what of a body but for a capsule's radius is furthest along a direction, from
  /// its origin. tie: L, a difference of heights that is none.
  Eigen::Vector3d support(const Eigen::Vector3d& direction, double tie) const;
  const Eigen::Vector3d& origin() const { return m_p0; }
  bool isPlane() const { return m_kind < Kind::Capsule; }
  bool isCylinder() const { return m_kind == Kind::Cylinder; }
  /// Whether the distance from another is that of the body of all differences, which is known to
  /// kShapePairGap of the larger one.
  bool needsDifferences(const Shape& b) const;
  double size() const;  ///< L: of the largest measure; infinite for a plane
  bool isTwoSided() const { return m_kind == Kind::TwoSidedPlane; }

  // Within a step what a shape is made of moves linearly: a capsule's two ends, which of a sphere
  // are one, or a hull's corners. Of planes and cylinders: ShapeStep.

  bool hasCorners() const { return m_kind == Kind::Capsule || m_kind == Kind::Hull; }
  std::span<const Eigen::Vector3d> corners() const { return m_corners; }  ///< or a cylinder's ends
  const Eigen::Matrix3d& axes() const { return m_axes; }  ///< of a plane, the normal last
  /// With this one's radius and another axis, from its centre.
  SignedDistance ofCylinder(const Eigen::Vector3d& fromCentre, const Eigen::Vector3d& axis) const;
  /// Of a hull, or a capsule's axis, by corners: {p, q, q}.
  std::span<const Triangle> faces() const { return m_faces; }
  std::span<const Segment> edges() const { return m_edges; }
  double radius() const { return isCylinder() ? m_sizes[0] : m_radius; }  ///< L
  Eigen::AlignedBox3d bounds() const;  ///< L; infinite for a plane
  /// L: about the largest magnitude of its coordinates and measures.
  double magnitude() const { return m_magnitude; }

 private:
  ShapePairDistance planeFrom(const Shape& body) const;
  ShapePairDistance axisFrom(const Shape& body) const;
  ShapePairDistance flatFrom(const Shape&, const Eigen::Vector3d& flat) const;
  ShapePairDistance grownFrom(const Shape&, ShapePairScratch&) const;

  enum class Kind { Plane, TwoSidedPlane, Capsule, Cylinder, Hull };
  /// A vector by what the distance to a cylinder is made of: radius and height.
  struct Parts {
    std::array<double, 2> lengths;  ///< never negative
    std::array<Eigen::Vector3d, 2> directions;
  };
  /// tie: lengths on either side of the middle that count as above it.
  Parts partsOf(const Eigen::Vector3d& v, double tie) const;
  void placeCorners();
  Eigen::Vector3d inBody(const Eigen::Vector3d& x) const;
  /// At a capsule's axis, where every direction across it leads out: one near to the given one.
  Eigen::Vector3d fromAxis(const Eigen::Vector3d& normal) const;
  /// tie: L, of two faces that are equally near the first counts.
  SignedDistance atBody(const Eigen::Vector3d& u, double tie) const;
  /// The same of a cylinder with other sizes.
  SignedDistance atBody(const Eigen::Vector3d& u, double tie,
                        const std::array<double, 2>& sizes) const;
  Eigen::Vector3d nearestOfPlane(const Eigen::Vector3d& normal, double height) const;
  std::optional<NearestToShape> nearestToHull(const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                                              const Eigen::Vector3d& c) const;
  std::optional<NearestToShape> nearestToAxis(const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                                              const Eigen::Vector3d& c) const;

  Kind m_kind = Kind::Plane;
  Eigen::Vector3d m_p0, m_p1;  ///< a capsule's axis; others: both the body's origin
  double m_radius = 0;         ///< of a capsule
  double m_axisSquare = 0;     ///< L²: of its length; negative where that leaves double's range
  Eigen::Matrix3d m_axes = Eigen::Matrix3d::Identity();  ///< of the body
  std::array<double, 2> m_sizes{};                       ///< of a cylinder's parts
  std::vector<Eigen::Vector3d> m_span;                   ///< of a hull's points
  std::vector<Eigen::Vector3d> m_corners;
  std::vector<Triangle> m_faces;
  std::vector<Segment> m_edges;
  std::shared_ptr<const Polytope> m_hull;  ///< in its body's frame
  double m_magnitude;
};

/// Scratch, which remembers its peak: a body inside that of all a - b, and the points of a; and a
/// shape at a time of the step.
struct ShapePairScratch {
  Polytope grown;
  Buffer<Eigen::Vector3d> ofA;
  std::optional<Shape> then;
};

/// Calls f(name, field) for each field of a shape: vectors, doubles, flags and lists of vectors.
template <class Geometry, class F>
void forEachField(Geometry& geometry, F&& f) {
  std::visit(
      [&](auto& shape) {
        using Type = std::decay_t<decltype(shape)>;
        if constexpr (std::is_same_v<Type, Plane>) {
          f("point", shape.point), f("normal", shape.normal), f("twoSided", shape.twoSided);
        } else if constexpr (std::is_same_v<Type, Box>) {
          f("centre", shape.centre), f("halfExtents", shape.halfExtents);
        } else if constexpr (std::is_same_v<Type, ConvexHull>) {
          f("points", shape.points);
        } else {
          if constexpr (std::is_same_v<Type, Sphere>)
            f("centre", shape.centre);
          else
            f("p0", shape.p0), f("p1", shape.p1);
          f("radius", shape.radius);
        }
      },
      geometry);
}

/// What is wrong with a shape's measures; empty if nothing is. element: the point of a hull.
std::string faultOf(const AnalyticalGeometry&, std::optional<std::size_t>& element);
/// Of a transform: its matrix must be a rotation within 1e-9.
std::string faultOf(const RigidTransform&);

}  // namespace palpate
