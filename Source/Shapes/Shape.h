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

/// The point of a vertex, an edge or a triangle that is nearest to a shape, or deepest inside it.
struct NearestToShape {
  Eigen::Vector3d weights;  ///< of the feature's vertices; never negative
  Eigen::Vector3d normal;   ///< unit, from the shape towards the feature
  double distance;          ///< L, negative inside
  bool inInterior;          ///< strictly: not at an end or on an edge of the feature
  bool exact = false;       ///< exact arithmetic decided, as floating point could not
};

/// A feature's nearest point at a time of the step.
struct ShapeImpact {
  double time;
  NearestToShape nearest;
};

/// Signed distance between two shapes. If they overlap, it is negative, and its magnitude is the
/// length of the shortest translation that separates them.
struct ShapePairDistance {
  Eigen::Vector3d pointA, pointB;  ///< L, on the surfaces
  Eigen::Vector3d normal;          ///< unit, from b towards a
  double distance;                 ///< L: pointA - pointB = distance * normal

  ShapePairDistance exchanged() const { return {pointB, pointA, -normal, distance}; }
};

/// The matrix with its columns made orthonormal to the precision of double.
Eigen::Matrix3d orthonormal(const Eigen::Matrix3d& rotation);

struct ShapePairScratch;

/// An analytical shape in the world.
///
/// The signed distance to a convex shape is convex, so that a feature has one least distance. If
/// several of its points share it, a point on the feature's boundary is chosen if there is one,
/// else the middle.
class Shape {
 public:
  Shape(const AnalyticalGeometry&, const Pose&);
  /// Places the shape elsewhere. A box or a hull must be the constructor's; another shape must have
  /// the type of the constructor's.
  void place(const AnalyticalGeometry&, const Pose&);
  /// Moves the shape by a translation, L.
  void translate(const Eigen::Vector3d& shift);
  /// Places a cylinder at a time of a step: a right cylinder between its end centres, which move
  /// linearly.
  void placeBetween(const Shape& before, const Shape& now, double time);

  PointShapeDistance signedDistance(const Eigen::Vector3d& x) const;
  NearestToShape nearestOfEdge(const Eigen::Vector3d& p, const Eigen::Vector3d& q) const;
  /// None if a point of the triangle's boundary is as near.
  std::optional<NearestToShape> nearestInTriangle(const Eigen::Vector3d& a,
                                                  const Eigen::Vector3d& b,
                                                  const Eigen::Vector3d& c) const;
  /// Signed distance from another shape, b. At most one of the two may be a plane. Exchanged shapes
  /// give the same bits, exchanged.
  ///
  /// A plane uses the other shape's furthest point, a sphere the distance of a point, and two
  /// capsules the distance of edges. All other pairs use the Minkowski difference, the body of all
  /// differences a - b. The distance is that of the origin from this body, less the radii. A
  /// polytope grows within the body: it repeatedly takes the body's furthest point along the
  /// outward normal where the origin is nearest to the polytope's surface. The origin's distance to
  /// the polytope and its height over the last furthest point bound the result from both sides. The
  /// search ends when the bounds differ by at most kShapePairGap.
  ///
  /// Source   Gilbert, Johnson, Keerthi (1988) for shapes that are apart; van den Bergen (2001) for
  ///          shapes that overlap. Difference: one polytope for both, of all points so far, whose
  ///          triangles are kept by exact predicates.
  ShapePairDistance distanceFrom(const Shape& b, ShapePairScratch&) const;
  /// A strict weak order of all shapes. If neither of two shapes precedes the other, their measures
  /// are the same.
  bool precedes(const Shape&) const;
  /// The furthest point along a direction, relative to origin(). A capsule's radius is not
  /// included. If several points are furthest, the result is their middle. tie: L, heights that
  /// differ by at most this count as equal.
  Eigen::Vector3d support(const Eigen::Vector3d& direction, double tie) const;
  const Eigen::Vector3d& origin() const { return m_p0; }
  bool isPlane() const { return m_type < Type::Capsule; }
  bool isCylinder() const { return m_type == Type::Cylinder; }
  /// Whether distanceFrom() uses the Minkowski difference. The distance is then known to within
  /// kShapePairGap of the larger shape.
  bool needsMinkowskiDifference(const Shape& b) const;
  double size() const;  ///< L: the largest extent; infinite for a plane
  bool isTwoSided() const { return m_type == Type::TwoSidedPlane; }

  // Within a step the corners of a shape move linearly: a hull's corners, or a capsule's two ends,
  // which coincide for a sphere. ShapeStep is for planes and cylinders.

  bool hasCorners() const { return m_type == Type::Capsule || m_type == Type::Hull; }
  /// A cylinder's corners are its end centres.
  std::span<const Eigen::Vector3d> corners() const { return m_corners; }
  const Eigen::Matrix3d& axes() const { return m_axes; }  ///< a plane's normal is the last column
  /// Signed distance of a point from a cylinder that has this cylinder's radius and another axis.
  /// The point is relative to the centre.
  PointShapeDistance distanceFromCylinder(const Eigen::Vector3d& fromCentre,
                                          const Eigen::Vector3d& axis) const;
  /// A hull's faces, by corners. A capsule's axis counts as the triangle {p, q, q}.
  std::span<const Triangle> faces() const { return m_faces; }
  std::span<const Segment> edges() const { return m_edges; }
  double radius() const { return isCylinder() ? m_sizes[0] : m_radius; }  ///< L
  Eigen::AlignedBox3d bounds() const;  ///< L; infinite for a plane
  /// L: about the largest magnitude of its coordinates and measures.
  double magnitude() const { return m_magnitude; }

 private:
  ShapePairDistance planeDistance(const Shape& body) const;
  ShapePairDistance axisDistance(const Shape& body) const;
  ShapePairDistance planarDistance(const Shape&, const Eigen::Vector3d& flat) const;
  ShapePairDistance minkowskiDistance(const Shape&, ShapePairScratch&) const;

  enum class Type { Plane, TwoSidedPlane, Capsule, Cylinder, Hull };
  /// A vector's radial and axial components, which determine the distance to a cylinder.
  struct Components {
    std::array<double, 2> lengths;  ///< never negative
    std::array<Eigen::Vector3d, 2> directions;
  };
  /// tie: L, a point at most this far below the middle counts as above it.
  Components componentsOf(const Eigen::Vector3d& v, double tie) const;
  void placeCorners();
  Eigen::Vector3d inBody(const Eigen::Vector3d& x) const;
  /// An outward direction for a point on a capsule's axis, where every direction across the axis
  /// leads out. It is near the given one.
  Eigen::Vector3d directionFromAxis(const Eigen::Vector3d& normal) const;
  /// tie: L, if two faces are equally near within this, the first one counts.
  PointShapeDistance atBody(const Eigen::Vector3d& u, double tie) const;
  /// The same for a cylinder with other sizes.
  PointShapeDistance atBody(const Eigen::Vector3d& u, double tie,
                            const std::array<double, 2>& sizes) const;
  /// Where an element has its least distance in its interior: of surfaces that are equally near
  /// inside, that most nearly parallel to the element counts. All in the body's frame.
  PointShapeDistance leastAtBody(const Eigen::Vector3d& u,
                                 std::span<const Eigen::Vector3d> sides) const;
  /// A weight on an edge, and by how much it may be off.
  struct Turn {
    double at, error;
  };
  Turn turnBesideAxis(const Eigen::Vector3d& from, const Eigen::Vector3d& along) const;
  Eigen::Vector3d nearestOfPlane(const Eigen::Vector3d& normal, double height,
                                 double& supportHeight) const;
  std::optional<NearestToShape> nearestToHull(const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                                              const Eigen::Vector3d& c) const;
  std::optional<NearestToShape> nearestToAxis(const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                                              const Eigen::Vector3d& c) const;

  Type m_type = Type::Plane;
  Eigen::Vector3d m_p0, m_p1;  ///< a capsule's axis; others: both the body's origin
  double m_radius = 0;         ///< of a capsule
  double m_axisSquare = 0;     ///< L²: its squared length; negative beyond double's range
  Eigen::Matrix3d m_axes = Eigen::Matrix3d::Identity();  ///< of the body
  std::array<double, 2> m_sizes{};                       ///< of a cylinder: radius, half its height
  std::vector<Eigen::Vector3d> m_span;                   ///< spanOf() a hull's points
  std::vector<Eigen::Vector3d> m_corners;
  std::vector<Triangle> m_faces;
  std::vector<Segment> m_edges;
  std::shared_ptr<const Polytope> m_hull;  ///< in its body's frame
  double m_magnitude;
};

/// Scratch for pairs of shapes, which keeps its peak capacity: a polytope inside the Minkowski
/// difference, the points of a that its points came from, and a shape at a time of the step.
struct ShapePairScratch {
  Polytope polytope;
  Buffer<Eigen::Vector3d> pointsOfA;
  std::optional<Shape> shapeAtTime;
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

/// Describes what is invalid in a shape's measures; empty if they are valid. element: the index of
/// a hull's invalid point.
std::string faultOf(const AnalyticalGeometry&, std::optional<std::size_t>& element);
/// The same for a transform, whose matrix must be a rotation within kRoughRotation.
std::string faultOf(const Pose&);

}  // namespace palpate
