#include "SpatialEngine.h"

#include <palpate/OctreeBasedCD.h>

#include <limits>

namespace palpate::benchmark {
namespace {

class PalpateQueries : public SpatialEngine {
 public:
  explicit PalpateQueries(bool isPointSet) : m_isPointSet(isPointSet) {}

  std::string name() const override { return "Palpate"; }

  void prepare(const std::vector<Triangle>& triangles,
               const std::vector<Eigen::Vector3d>& positions) override {
    Settings settings;
    settings.threads = 1;
    m_collisions = std::make_unique<OctreeBasedCD>(settings);
    m_mesh = m_isPointSet ? m_collisions->addPointSet(positions)
                          : m_collisions->addTriangleMesh(positions, triangles);
    m_collisions->update();
  }

  void update(const std::vector<Eigen::Vector3d>& positions) override {
    m_collisions->advance();
    m_collisions->setPositions(m_mesh, positions);
    m_collisions->update();
  }

  bool answers(SpatialQuery) const override { return true; }

  void ask(SpatialQuery query, std::span<const SpatialCase> cases, const ShapeSizes& sizes,
           SpatialAnswers& out) override {
    const SpatialQueries queries = m_collisions->queries();
    constexpr double kNone = std::numeric_limits<double>::infinity();
    const auto all = [&](auto&& answer) {
      for (const SpatialCase& c : cases) answer(c);
    };
    const auto list = [&](const AnalyticalGeometry& shape) {
      all([&](const SpatialCase& c) {
        queries.overlapping(m_mesh, shape, {c.rotation, c.point}, m_elements);
        addElements(out);
      });
    };
    switch (query) {
      case SpatialQuery::Closest:
        return all([&](const SpatialCase& c) {
          const auto found = queries.closestPoint(m_mesh, c.point);
          out.add(found->distance, found->element);
        });
      case SpatialQuery::SignedDistance:
        return all([&](const SpatialCase& c) {
          const SignedDistance found = queries.signedDistance(m_mesh, c.point);
          out.add(found.distance, found.nearest.element);
        });
      case SpatialQuery::Contains:
        return all(
            [&](const SpatialCase& c) { out.values.push_back(queries.contains(m_mesh, c.point)); });
      case SpatialQuery::FirstHit:
        return all([&](const SpatialCase& c) {
          const auto hit = queries.firstHit(m_mesh, {c.point, c.direction});
          out.add(hit ? hit->t : kNone, hit ? hit->element : kNoElement);
        });
      case SpatialQuery::AllHits:
        return all([&](const SpatialCase& c) {
          queries.allHits(m_mesh, {c.point, c.direction}, m_hits);
          for (const RayHit& hit : m_hits) out.elements.push_back(hit.element);
          out.endCase();
        });
      case SpatialQuery::EightNearest:
        return all([&](const SpatialCase& c) {
          queries.nearestElements(m_mesh, c.point, 8, m_points);
          for (const SurfacePoint& p : m_points) out.add(p.distance, p.element);
        });
      case SpatialQuery::Ball:
        return all([&](const SpatialCase& c) {
          queries.elementsWithin(m_mesh, c.point, sizes.ball, m_elements);
          addElements(out);
        });
      case SpatialQuery::Capsule: {
        const Eigen::Vector3d end(sizes.capsuleLength / 2, 0, 0);
        return list(Capsule{-end, end, sizes.capsuleRadius});
      }
      case SpatialQuery::Box:
        return list(Box{Eigen::Vector3d::Zero(), sizes.boxHalf});
    }
  }

  void askTogether(SpatialQuery query, std::span<const SpatialCase> cases, const ShapeSizes& sizes,
                   SpatialAnswers& out) override {
    const SpatialQueries queries = m_collisions->queries();
    m_together.clear();
    m_rays.clear();
    for (const SpatialCase& c : cases) {
      m_together.push_back(c.point);
      m_rays.push_back({c.point, c.direction});
    }
    switch (query) {
      case SpatialQuery::Closest:
        m_points.resize(cases.size());
        queries.closestPoints(m_mesh, m_together, m_points);
        for (const SurfacePoint& found : m_points) out.add(found.distance, found.element);
        return;
      case SpatialQuery::SignedDistance:
        m_distances.resize(cases.size());
        queries.signedDistances(m_mesh, m_together, m_distances);
        for (const SignedDistance& found : m_distances)
          out.add(found.distance, found.nearest.element);
        return;
      case SpatialQuery::FirstHit:
        m_hits.resize(cases.size());
        queries.firstHits(m_mesh, m_rays, m_hits);
        for (const RayHit& hit : m_hits) out.add(hit.t, hit.element);
        return;
      case SpatialQuery::AllHits:
        queries.allHits(m_mesh, m_rays, m_hits, m_begins);
        for (std::size_t i = 0; i < cases.size(); ++i) {
          for (std::size_t h = m_begins[i]; h < m_begins[i + 1]; ++h)
            out.elements.push_back(m_hits[h].element);
          out.endCase();
        }
        return;
      default:
        return ask(query, cases, sizes, out);
    }
  }

 private:
  void addElements(SpatialAnswers& out) const {
    out.elements.insert(out.elements.end(), m_elements.begin(), m_elements.end());
    out.endCase();
  }

  bool m_isPointSet;
  std::unique_ptr<OctreeBasedCD> m_collisions;
  GeometryId m_mesh{};
  std::vector<Eigen::Vector3d> m_together;
  std::vector<Ray> m_rays;
  std::vector<SurfacePoint> m_points;
  std::vector<SignedDistance> m_distances;
  std::vector<RayHit> m_hits;
  std::vector<std::size_t> m_begins;
  std::vector<std::uint32_t> m_elements;
};

}  // namespace

std::unique_ptr<SpatialEngine> makePalpateQueries(bool isPointSet) {
  return std::make_unique<PalpateQueries>(isPointSet);
}

}  // namespace palpate::benchmark
