#pragma once

#include <palpate/Types.h>

#include "Core/Buffer.h"
#include "Math/ClosestPoint.h"
#include "Exact/Predicates.h"

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace palpate {

/// From a convex body's surface: negative inside.
struct SignedDistance {
  double distance;         ///< L
  Eigen::Vector3d normal;  ///< unit: the distance grows fastest along it
};

/// As many of the points as it takes to span what they all do: one, the two ends of a line, three
/// in a plane, or four. Exact.
std::vector<Eigen::Vector3d> spanOf(std::span<const Eigen::Vector3d> points);

/// A convex body as triangles: the hull of its points. Which point sees which triangle is decided
/// exactly, so that no rounding makes a hole or a fold, and none of the points lies outside.
///
/// Ties     `tie`, L, is a height that counts as none: of two planes that are equally near the
///          first counts.
/// Source   the beneath-beyond method: Preparata, Shamos, Computational Geometry (1985), 3.4.2. Of
///          many points with conflict lists: Clarkson, Shor, Applications of random sampling in
///          computational geometry II (1989).
class Polytope {
 public:
  struct OnFace {
    VertexTriangleDistance from;  ///< as of a vertex against the face
    std::uint32_t face;
  };

  /// The hull of points that span a plane or more. Of a plane: a plate, whose triangles are there
  /// in both windings.
  /// Cost     n log n expected for n points in any order. They are added in an order that looks
  ///          random but is always the same, so that the hull is the same in every run; up to
  ///          32 of them are added in their own order.
  explicit Polytope(std::span<const Eigen::Vector3d> points);
  Polytope() = default;

  /// The hull of four points that have a volume.
  void start(std::span<const Eigen::Vector3d> four);
  /// Grows to hold p; false if it does already.
  bool add(const Eigen::Vector3d& p);

  /// Of a hull that is not to grow: all of them are its own.
  const std::vector<Eigen::Vector3d>& points() const { return m_points; }
  /// Left to exact arithmetic by start() and add(), ever.
  std::size_t exactDecisions() const { return m_decisions.undecided; }
  std::size_t faceCount() const { return m_faces.size(); }
  const Triangle& corners(std::uint32_t face) const { return m_faces[face].corners; }
  /// Of one that grows: what is left of a face that is no more has corners, too.
  bool hasFace(std::uint32_t face) const { return m_planes[face].face == face; }

  SignedDistance at(const Eigen::Vector3d& x, double tie) const;
  /// The face that is nearest to x; inside, of those in the plane of at().
  OnFace nearest(const Eigen::Vector3d& x, double tie) const;
  /// For a point inside: of the faces whose planes are at most `slack` further away than the
  /// nearest plane, the one that is nearest itself. Of a body with almost equal planes, whose faces
  /// are slivers, nearest() may give a face far from the foot on its plane.
  OnFace nearestFaceWithin(const Eigen::Vector3d& x, double slack) const;
  const Eigen::Vector3d& normal(std::uint32_t face) const;  ///< unit, outward
  /// The middle of its points that are furthest along a direction.
  Eigen::Vector3d support(const Eigen::Vector3d& direction, double tie) const;
  /// Where on p + t (q - p), t in [0, 1], the signed distance is least: at an end if it is so
  /// there, else amid all such t.
  double leastOnEdge(const Eigen::Vector3d& p, const Eigen::Vector3d& q, double tie) const;
  /// Weights of the point of a triangle whose plane cuts the hull where the signed distance is
  /// least; none if it is as small on the boundary, or if the triangle is outside.
  std::optional<Eigen::Vector3d> leastInTriangle(const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                                                 const Eigen::Vector3d& c, double tie) const;

 private:
  struct Face {
    Triangle corners;
    std::array<std::uint32_t, 3> neighbours;  ///< across corners i and i + 1
  };
  /// normal . x = offset; of a face that is no more it is below everything.
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
  bool sees(const Eigen::Vector3d& p, std::uint32_t face) {
    return orient3d(corner(face, 0), corner(face, 1), corner(face, 2), p, m_decisions) > 0;
  }
  void addAll(std::span<const Eigen::Vector3d> points);
  void addVisible(const Eigen::Vector3d& p);
  void removeVisible();
  std::uint32_t newFace(const Triangle& corners, const Triangle& neighbours);
  std::uint32_t cut(std::uint32_t face, std::uint32_t last);
  std::vector<std::uint32_t> keepHull();
  void keepPlate(std::uint32_t apex);
  std::uint32_t highest(const Eigen::Vector3d& x, double tie) const;
  OnFace onFace(const Eigen::Vector3d& x, std::uint32_t face) const;
  OnFace walk(const Eigen::Vector3d& x, std::uint32_t face, double tie) const;
  template <class F>
  void forEachAround(const OnFace&, F&& f) const;
  struct Tangent;
  struct Valley;
  template <class At>
  static Valley valleyOf(double tie, At&& at);
  Valley valley(const Eigen::Vector3d& p, const Eigen::Vector3d& q, double tie) const;
  double flatMiddle(const Eigen::Vector3d& p, const Eigen::Vector3d& q, double t,
                    double height) const;

  std::vector<Eigen::Vector3d> m_points;
  Buffer<Face> m_faces;
  Buffer<Plane> m_planes;                           ///< of the faces, and of a plate's border
  Buffer<std::uint32_t> m_free, m_visible, m_next;  ///< scratch of add()
  /// A new face, and the face that was seen across its edge on the border.
  struct Fresh {
    std::uint32_t face, seen;
  };
  Buffer<Fresh> m_fresh;  ///< scratch of add()
  SignCounts m_decisions;
  Buffer<std::uint8_t> m_sees;  ///< per face: the point that is being added
};

}  // namespace palpate
