// CGAL 5.5: AABB_tree over triangles, rebuilt for each frame, with its search tree for distances.
// Two kernels: plain doubles, and exact predicates with inexact constructions. Balls and boxes
// along the axes are queries of the tree; the box of a capsule or an oriented box gives candidates,
// and ours tests the triangles.
#include "SpatialEngine.h"
#include "TriangleGeometry.h"

#include <CGAL/AABB_face_graph_triangle_primitive.h>
#include <CGAL/AABB_traits.h>
#include <CGAL/AABB_tree.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Side_of_triangle_mesh.h>
#include <CGAL/Simple_cartesian.h>
#include <CGAL/Surface_mesh.h>

#include <boost/iterator/function_output_iterator.hpp>

#include <limits>
#include <optional>

namespace palpate::benchmark {
namespace {

template <class Kernel>
class CgalQueries : public SpatialEngine {
  using Point = typename Kernel::Point_3;
  using Mesh = CGAL::Surface_mesh<Point>;
  using Face = typename Mesh::Face_index;
  using Primitive = CGAL::AABB_face_graph_triangle_primitive<Mesh, CGAL::Default, CGAL::Tag_true,
                                                             CGAL::Tag_true>;  // keeps triangles
  using Tree = CGAL::AABB_tree<CGAL::AABB_traits<Kernel, Primitive>>;
  using Side = CGAL::Side_of_triangle_mesh<Mesh, Kernel, CGAL::Default, Tree>;
  static constexpr bool kExact =
      std::is_same_v<Kernel, CGAL::Exact_predicates_inexact_constructions_kernel>;

 public:
  std::string name() const override {
    return kExact ? "CGAL 5.5 AABB_tree, exact predicates" : "CGAL 5.5 AABB_tree, doubles";
  }

  void prepare(const std::vector<Triangle>& triangles,
               const std::vector<Eigen::Vector3d>& positions) override {
    m_indices = triangles;
    for (const Eigen::Vector3d& p : positions) m_mesh.add_vertex(point(p));
    using Vertex = typename Mesh::Vertex_index;
    for (const auto& [a, b, c] : triangles) m_mesh.add_face(Vertex(a), Vertex(b), Vertex(c));
    update(positions);
  }

  void update(const std::vector<Eigen::Vector3d>& positions) override {
    m_side.reset();
    m_positions = positions;
    for (const auto vertex : vertices(m_mesh)) m_mesh.point(vertex) = point(positions[vertex]);
    m_tree.rebuild(faces(m_mesh).begin(), faces(m_mesh).end(), m_mesh);
    m_tree.build();
    m_tree.accelerate_distance_queries();
    m_side.emplace(m_tree);
  }

  bool answers(SpatialQuery query) const override {
    return query != SpatialQuery::EightNearest && query != SpatialQuery::AllHits &&
           (kExact || query != SpatialQuery::Contains) &&
           (kExact || query != SpatialQuery::SignedDistance);
  }

  void ask(SpatialQuery query, std::span<const SpatialCase> cases, const ShapeSizes& sizes,
           SpatialAnswers& out) override {
    for (const SpatialCase& c : cases) {
      const Point p = point(c.point);
      switch (query) {
        case SpatialQuery::Closest:
        case SpatialQuery::SignedDistance: {
          const auto [closest, primitive] = m_tree.closest_point_and_primitive(p);
          double distance = std::sqrt(CGAL::to_double(CGAL::squared_distance(p, closest)));
          if (query == SpatialQuery::SignedDistance && isInside(p)) distance = -distance;
          out.add(distance, primitive);
          break;
        }
        case SpatialQuery::Contains:
          out.values.push_back(isInside(p));
          break;
        case SpatialQuery::FirstHit: {
          const auto& d = c.direction;
          const typename Kernel::Ray_3 ray(p, typename Kernel::Vector_3(d[0], d[1], d[2]));
          const auto hit = m_tree.first_intersection(ray);
          const Point* at = hit ? boost::get<Point>(&hit->first) : nullptr;
          out.add(at ? std::sqrt(CGAL::squared_distance(p, *at))
                     : std::numeric_limits<double>::infinity(),
                  hit ? std::uint32_t(hit->second) : ~0u);
          break;
        }
        case SpatialQuery::Ball: {
          candidates(bounds(c.point, Eigen::Vector3d::Constant(sizes.ball)), [&](std::uint32_t t) {
            if (closestOnTriangle<double>(c.point, corner(t, 0), corner(t, 1), corner(t, 2))
                    .distanceSquared <= sizes.ball * sizes.ball)
              out.elements.push_back(t);
          });
          out.endCase();
          break;
        }
        case SpatialQuery::Capsule: {
          const Eigen::Vector3d half = c.rotation.col(0) * sizes.capsuleLength / 2;
          const Eigen::Vector3d reach =
              half.cwiseAbs() + Eigen::Vector3d::Constant(sizes.capsuleRadius);
          const Eigen::Vector3d p0 = c.point - half, p1 = c.point + half;
          candidates(bounds(c.point, reach), [&](std::uint32_t t) {
            if (segmentTriangleDistanceSquared<double>(p0, p1, corner(t, 0), corner(t, 1),
                                                       corner(t, 2)) <=
                sizes.capsuleRadius * sizes.capsuleRadius)
              out.elements.push_back(t);
          });
          out.endCase();
          break;
        }
        case SpatialQuery::Box: {
          const Eigen::Matrix3d toBox = c.rotation.transpose();
          candidates(bounds(c.point, c.rotation.cwiseAbs() * sizes.boxHalf), [&](std::uint32_t t) {
            if (boxGap<double>(sizes.boxHalf, toBox * (corner(t, 0) - c.point),
                               toBox * (corner(t, 1) - c.point), toBox * (corner(t, 2) - c.point),
                               0) <= 0)
              out.elements.push_back(t);
          });
          out.endCase();
          break;
        }
        case SpatialQuery::EightNearest:
        case SpatialQuery::AllHits:
          break;
      }
    }
  }

 private:
  static Point point(const Eigen::Vector3d& p) { return {p[0], p[1], p[2]}; }
  static typename Kernel::Iso_cuboid_3 bounds(const Eigen::Vector3d& centre,
                                              const Eigen::Vector3d& half) {
    return {point(centre - half), point(centre + half)};
  }
  const Eigen::Vector3d& corner(std::uint32_t triangle, std::size_t i) const {
    return m_positions[m_indices[triangle][i]];
  }
  bool isInside(const Point& p) const { return (*m_side)(p) == CGAL::ON_BOUNDED_SIDE; }

  template <class Query, class F>
  void candidates(const Query& query, F&& f) const {
    m_tree.all_intersected_primitives(
        query, boost::make_function_output_iterator([&](Face face) { f(face); }));
  }

  std::vector<Triangle> m_indices;
  std::vector<Eigen::Vector3d> m_positions;
  Mesh m_mesh;
  Tree m_tree;
  std::optional<Side> m_side;
};

}  // namespace

std::unique_ptr<SpatialEngine> makeCgalQueries(bool exactPredicates) {
  if (exactPredicates)
    return std::make_unique<CgalQueries<CGAL::Exact_predicates_inexact_constructions_kernel>>();
  return std::make_unique<CgalQueries<CGAL::Simple_cartesian<double>>>();
}

}  // namespace palpate::benchmark
