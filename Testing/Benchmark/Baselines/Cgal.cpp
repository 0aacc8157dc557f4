// CGAL 5.5: box_intersection_d on pointers to boxes (its manual: for boxes larger than a pointer),
// closed boxes, the default cutoff; Parallel_tag with more than one thread.
#include "BroadPhase.h"

#include <CGAL/Box_intersection_d/Box_with_info_d.h>
#include <CGAL/box_intersection_d.h>
#include <CGAL/AABB_face_graph_triangle_primitive.h>
#include <CGAL/AABB_traits.h>
#include <CGAL/AABB_tree.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Side_of_triangle_mesh.h>
#include <CGAL/Surface_mesh.h>

#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <chrono>

namespace palpate::benchmark {
namespace {

using Box =
    CGAL::Box_intersection_d::Box_with_info_d<double, 3, std::uint32_t,
                                              CGAL::Box_intersection_d::ID_FROM_BOX_ADDRESS>;

class Cgal : public BroadPhase {
 public:
  std::string name() const override { return "CGAL 5.5 box_intersection_d"; }
  bool rebuilds() const override { return true; }

  void prepare(const Task& task, const Positions&) override {
    m_task = task;
    m_arena.terminate();
    m_arena.initialize(task.threads);
    m_lists.prepare(task.pairs.size(), task.threads);
    m_boxes.resize(task.meshes.size());
    m_order.resize(task.pairs.size());
  }

  void update(const Positions& positions) override {
    m_arena.execute([&] {
      tbb::parallel_for(std::size_t(0), m_boxes.size(),
                        [&](std::size_t i) { fillBoxes(i, positions[i].data()); });
    });
  }

  void collide() override {
    m_lists.clear();
    m_arena.execute([&] {
      tbb::parallel_for(std::size_t(0), m_task.pairs.size(), [&](std::size_t pair) {
        m_task.threads == 1 ? collide<CGAL::Sequential_tag>(pair)
                            : collide<CGAL::Parallel_tag>(pair);
      });
    });
  }

  std::vector<ElementPair> candidates(std::size_t pair) const override {
    return m_lists.sorted(pair);
  }

 private:
  void fillBoxes(std::size_t mesh, const Eigen::Vector3d* positions) {
    const std::vector<Triangle>& triangles = m_task.meshes[mesh];
    m_boxes[mesh].resize(triangles.size());
    for (std::size_t i = 0; i < triangles.size(); ++i) {
      DoubleBox box = boxOf(triangles[i], positions, m_task.thickness / 2);
      m_boxes[mesh][i] = Box(box.min.data(), box.max.data(), static_cast<std::uint32_t>(i));
    }
  }

  // The algorithm reorders what it is given, so every pair has pointers of its own.
  static void point(std::vector<const Box*>& order, const std::vector<Box>& boxes) {
    order.resize(boxes.size());
    for (std::size_t i = 0; i < boxes.size(); ++i) order[i] = &boxes[i];
  }

  template <class Tag>
  void collide(std::size_t pair) {
    const auto [a, b] = m_task.pairs[pair];
    auto& [orderA, orderB] = m_order[pair];
    point(orderA, m_boxes[a]);
    auto list = [ this, pair ]() -> auto& {
      return m_lists.of(pair,
                        static_cast<std::size_t>(tbb::this_task_arena::current_thread_index()));
    };
    if (a != b) {
      point(orderB, m_boxes[b]);
      CGAL::box_intersection_d<Tag>(orderA.begin(), orderA.end(), orderB.begin(), orderB.end(),
                                    [&](const Box* s, const Box* t) {
                                      list().push_back({s->info(), t->info()});
                                    });
      return;
    }
    const std::vector<Triangle>& triangles = m_task.meshes[a];
    CGAL::box_self_intersection_d<Tag>(
        orderA.begin(), orderA.end(), [&](const Box* s, const Box* t) {
          if (!shareVertex(triangles[s->info()], triangles[t->info()]))
            list().push_back({std::min(s->info(), t->info()), std::max(s->info(), t->info())});
        });
  }

  Task m_task;
  std::vector<std::vector<Box>> m_boxes;
  std::vector<std::array<std::vector<const Box*>, 2>> m_order;
  PairLists m_lists;
  tbb::task_arena m_arena;
};

}  // namespace

InsideAnswer insideByCgal(const std::vector<Eigen::Vector3d>& positions,
                          const std::vector<Triangle>& triangles,
                          const std::vector<Eigen::Vector3d>& points) {
  using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
  using Mesh = CGAL::Surface_mesh<Kernel::Point_3>;
  using Tree =
      CGAL::AABB_tree<CGAL::AABB_traits<Kernel, CGAL::AABB_face_graph_triangle_primitive<Mesh>>>;
  Mesh mesh;
  std::vector<Mesh::Vertex_index> vertices;
  for (const Eigen::Vector3d& p : positions)
    vertices.push_back(mesh.add_vertex({p[0], p[1], p[2]}));
  for (const auto& [a, b, c] : triangles) mesh.add_face(vertices[a], vertices[b], vertices[c]);
  Tree tree(faces(mesh).begin(), faces(mesh).end(), mesh);
  tree.build();
  tree.accelerate_distance_queries();
  const CGAL::Side_of_triangle_mesh<Mesh, Kernel> side(tree);
  side(Kernel::Point_3(0, 0, 0));
  InsideAnswer answer;
  const auto start = std::chrono::steady_clock::now();
  for (const Eigen::Vector3d& point : points) {
    const Kernel::Point_3 p(point[0], point[1], point[2]);
    if (side(p) != CGAL::ON_BOUNDED_SIDE) continue;
    ++answer.inside;
    answer.depth += std::sqrt(CGAL::squared_distance(p, tree.closest_point_and_primitive(p).first));
  }
  answer.milliseconds =
      std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
  return answer;
}

std::unique_ptr<BroadPhase> makeCgal() { return std::make_unique<Cgal>(); }

}  // namespace palpate::benchmark
