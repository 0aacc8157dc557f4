// Bullet 3: a btDbvt in floats, its volumes refitted bottom-up as in Bullet's soft bodies.
// collideTV gives the triangles whose boxes meet a box, collideKDOP those that meet six planes,
// rayTestInternal those that meet a ray; ours tests the triangles.
#include "BroadPhase.h"
#include "SpatialEngine.h"
#include "TriangleGeometry.h"

#include <BulletCollision/BroadphaseCollision/btDbvt.h>

namespace palpate::benchmark {
namespace {

using Float3 = Vector<float>;

template <class F>
struct Visitor : btDbvt::ICollide {
  explicit Visitor(F& f) : visit(f) {}
  void Process(const btDbvtNode* leaf) { visit(static_cast<std::uint32_t>(leaf->dataAsInt)); }
  F& visit;
};

class BulletQueries : public SpatialEngine {
 public:
  std::string name() const override { return "Bullet 3.24 btDbvt, refit"; }

  void prepare(const std::vector<Triangle>& triangles,
               const std::vector<Eigen::Vector3d>& positions) override {
    m_triangles = triangles;
    for (std::size_t t = 0; t < triangles.size(); ++t)
      m_tree.insert(volumeOf(triangles[t], positions.data()), nullptr)->dataAsInt =
          static_cast<int>(t);
    m_tree.optimizeTopDown();
    update(positions);
  }

  void update(const std::vector<Eigen::Vector3d>& positions) override {
    m_positions.resize(positions.size());
    for (std::size_t i = 0; i < positions.size(); ++i) m_positions[i] = positions[i].cast<float>();
    refit(m_tree.m_root, positions.data());
  }

  bool answers(SpatialQuery query) const override {
    return query == SpatialQuery::FirstHit || query == SpatialQuery::Ball ||
           query == SpatialQuery::Capsule || query == SpatialQuery::Box;
  }

  void ask(SpatialQuery query, std::span<const SpatialCase> cases, const ShapeSizes& sizes,
           SpatialAnswers& out) override {
    for (const SpatialCase& c : cases) {
      if (query == SpatialQuery::FirstHit)
        firstHit(c, out);
      else if (query == SpatialQuery::Ball)
        ball(c, static_cast<float>(sizes.ball), out);
      else if (query == SpatialQuery::Capsule)
        capsule(c, sizes, out);
      else
        box(c, sizes, out);
      if (query != SpatialQuery::FirstHit) out.endCase();
    }
  }

 private:
  static btDbvtVolume volumeOf(const Triangle& t, const Eigen::Vector3d* positions) {
    const DoubleBox box = boxOf(t, positions, 0);
    return btDbvtVolume::FromMM(
        {roundDown(box.min.x()), roundDown(box.min.y()), roundDown(box.min.z())},
        {roundUp(box.max.x()), roundUp(box.max.y()), roundUp(box.max.z())});
  }

  void refit(btDbvtNode* node, const Eigen::Vector3d* positions) {
    if (node->isleaf()) {
      node->volume = volumeOf(m_triangles[static_cast<std::size_t>(node->dataAsInt)], positions);
      return;
    }
    refit(node->childs[0], positions);
    refit(node->childs[1], positions);
    Merge(node->childs[0]->volume, node->childs[1]->volume, node->volume);
  }

  const Float3& corner(std::uint32_t triangle, std::size_t i) const {
    return m_positions[m_triangles[triangle][i]];
  }

  void firstHit(const SpatialCase& c, SpatialAnswers& out) {
    const Float3 o = c.point.cast<float>(), d = c.direction.cast<float>();
    float nearest = 1e18f;
    std::uint32_t hit = ~0u;
    const auto visit = [&](std::uint32_t t) {
      const float at = lineHit<float>(o, d, corner(t, 0), corner(t, 1), corner(t, 2));
      if (at >= 0 && at < nearest) nearest = at, hit = t;
    };
    const btVector3 from(o[0], o[1], o[2]), inverse(1 / d[0], 1 / d[1], 1 / d[2]);
    unsigned signs[3] = {inverse[0] < 0, inverse[1] < 0, inverse[2] < 0};
    Visitor visitor(visit);
    m_tree.rayTestInternal(m_tree.m_root, from, from + btVector3(d[0], d[1], d[2]) * 1e18f, inverse,
                           signs, 1e18f, {0, 0, 0}, {0, 0, 0}, m_stack, visitor);
    out.add(hit == ~0u ? std::numeric_limits<double>::infinity() : nearest, hit);
  }

  void ball(const SpatialCase& c, float radius, SpatialAnswers& out) {
    const Float3 p = c.point.cast<float>();
    const auto visit = [&](std::uint32_t t) {
      if (closestOnTriangle<float>(p, corner(t, 0), corner(t, 1), corner(t, 2)).distanceSquared <=
          radius * radius)
        out.elements.push_back(t);
    };
    Visitor visitor(visit);
    m_tree.collideTV(m_tree.m_root, btDbvtVolume::FromCR({p[0], p[1], p[2]}, radius), visitor);
  }

  /// Candidates by the six planes of an oriented box.
  template <class F>
  void inPlanes(const SpatialCase& c, const Eigen::Vector3d& half, const F& visit) {
    btVector3 normals[6];
    btScalar offsets[6];
    for (int i = 0; i < 6; ++i) {
      const Float3 n = ((i % 2 ? 1 : -1) * c.rotation.col(i / 2)).cast<float>();
      normals[i] = {n[0], n[1], n[2]};
      offsets[i] = static_cast<float>(half[i / 2]) - n.dot(c.point.cast<float>());
    }
    Visitor visitor(visit);
    btDbvt::collideKDOP(m_tree.m_root, normals, offsets, 6, visitor);
  }

  void capsule(const SpatialCase& c, const ShapeSizes& sizes, SpatialAnswers& out) {
    const Float3 p = c.point.cast<float>(),
                 half = (c.rotation.col(0) * sizes.capsuleLength / 2).cast<float>();
    const Float3 p0 = p - half, p1 = p + half;
    const auto radius = static_cast<float>(sizes.capsuleRadius);
    const Eigen::Vector3d reach(sizes.capsuleLength / 2 + radius, radius, radius);
    inPlanes(c, reach, [&](std::uint32_t t) {
      if (segmentTriangleDistanceSquared<float>(p0, p1, corner(t, 0), corner(t, 1), corner(t, 2)) <=
          radius * radius)
        out.elements.push_back(t);
    });
  }

  void box(const SpatialCase& c, const ShapeSizes& sizes, SpatialAnswers& out) {
    const Float3 p = c.point.cast<float>(), half = sizes.boxHalf.cast<float>();
    const Eigen::Matrix3f toBox = c.rotation.transpose().cast<float>();
    inPlanes(c, sizes.boxHalf, [&](std::uint32_t t) {
      if (boxGap<float>(half, toBox * (corner(t, 0) - p), toBox * (corner(t, 1) - p),
                        toBox * (corner(t, 2) - p), 0) <= 0)
        out.elements.push_back(t);
    });
  }

  std::vector<Triangle> m_triangles;
  std::vector<Float3> m_positions;
  btDbvt m_tree;
  btAlignedObjectArray<const btDbvtNode*> m_stack;
};

}  // namespace

std::unique_ptr<SpatialEngine> makeBulletQueries() { return std::make_unique<BulletQueries>(); }

}  // namespace palpate::benchmark
