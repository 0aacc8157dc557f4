#include "Contestant.h"

#include <palpate/OctreeBasedCD.h>

#include <chrono>

namespace palpate::accuracy {

namespace {

class PalpateRun : public Run {
 public:
  PalpateRun(const scenes::Scene& scene, const Positions& start, const Settings& settings,
             const PairSettings& pairSettings, int substeps)
      : m_detection(settings),
        m_pairs(scene.pairs),
        m_claims(scene.pairs.size()),
        m_last(start),
        m_substeps(substeps),
        m_method(pairSettings.method),
        m_distinct(pairSettings.contacts == Contacts::Distinct) {
    for (std::size_t m = 0; m < start.size(); ++m)
      m_ids.push_back(m_detection.addTriangleMesh(start[m], scene.meshes[m].triangles));
    for (const auto& [a, b] : m_pairs)
      m_detection.addCollisionPair(m_ids[a], m_ids[b], pairSettings);
    m_detection.detectCollision();
    m_detection.advance();
  }

  double step(const Positions& now) override {
    double milliseconds = 0;
    Claims none;
    none.ofTriangles = m_method == Method::Intersection;
    none.distinct = m_distinct && (m_method == Method::Auto || m_method == Method::Continuous);
    m_claims.assign(m_pairs.size(), none);
    for (int i = 1; i <= m_substeps; ++i) {
      const double t = static_cast<double>(i) / m_substeps;
      const Positions& positions = i == m_substeps ? now : between(now, t);
      const auto start = std::chrono::steady_clock::now();
      for (std::size_t m = 0; m < m_ids.size(); ++m)
        m_detection.setPositions(m_ids[m], positions[m]);
      m_detection.detectCollision();
      milliseconds +=
          std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start)
              .count();
      for (std::size_t p = 0; p < m_pairs.size(); ++p)
        addClaims(m_detection.collisionData(m_ids[m_pairs[p].first], m_ids[m_pairs[p].second]),
                  static_cast<double>(i - 1) / m_substeps, t, m_claims[p]);
      m_detection.advance();
    }
    m_last = now;
    return milliseconds;
  }

  Claims claims(std::size_t pair) const override { return m_claims[pair]; }

 private:
  const Positions& between(const Positions& now, double t) {
    m_between = now;
    for (std::size_t m = 0; m < now.size(); ++m)
      for (std::size_t v = 0; v < now[m].size(); ++v)
        m_between[m][v] = (1 - t) * m_last[m][v] + t * now[m][v];
    return m_between;
  }

  OctreeBasedCD m_detection;
  std::vector<GeometryId> m_ids;
  std::vector<std::pair<std::size_t, std::size_t>> m_pairs;
  std::vector<Claims> m_claims;
  Positions m_last, m_between;
  int m_substeps;
  Method m_method;
  bool m_distinct;
};

/// The settings besides the pair's method.
struct Choice {
  double thickness = 0;  ///< mean edges
  Contacts contacts = Contacts::All;
  int substeps = 1;
  double timeTolerance = PairSettings().continuous.timeTolerance;
  OctreeSettings octree{};
  Engine engine = Engine::Octree;
};

Contestant contestant(std::string family, std::string setting, Method method,
                      const Choice& choice) {
  return {std::move(family), std::move(setting), choice.engine == Engine::BruteForce,
          [=](const scenes::Scene& scene, const Positions& start) -> std::unique_ptr<Run> {
            const Settings settings{.octree = choice.octree, .engine = choice.engine, .threads = 1};
            const double edge = 20 * scene.thickness;
            return std::make_unique<PalpateRun>(
                scene, start, settings,
                PairSettings{.method = method,
                             .thickness = choice.thickness * edge,
                             .contacts = choice.contacts,
                             .continuous = {.timeTolerance = choice.timeTolerance}},
                choice.substeps);
          }};
}

}  // namespace

std::vector<Contestant> contestants() {
  constexpr auto kIntersection = Method::Intersection;
  constexpr auto kProximity = Method::Proximity;
  constexpr auto kContinuous = Method::Continuous;
  constexpr auto kAuto = Method::Auto;
  std::vector<Contestant> all{
      contestant("Intersection", "once a frame", kIntersection, {}),
      contestant("Proximity", "1/20 edge", kProximity, {.thickness = 0.05}),
      contestant("Proximity: distinct", "1/20 edge", kProximity,
                 {.thickness = 0.05, .contacts = Contacts::Distinct}),
      contestant("Proximity", "1/5 edge", kProximity, {.thickness = 0.2}),
      contestant("Proximity", "4/5 edge", kProximity, {.thickness = 0.8}),
      contestant("Proximity in substeps", "1/20 edge; 2 substeps", kProximity,
                 {.thickness = 0.05, .substeps = 2}),
      contestant("Proximity in substeps", "1/20 edge; 4 substeps", kProximity,
                 {.thickness = 0.05, .substeps = 4}),
      contestant("Proximity in substeps", "1/20 edge; 8 substeps", kProximity,
                 {.thickness = 0.05, .substeps = 8}),
      contestant("Proximity in substeps", "1/20 edge; 16 substeps", kProximity,
                 {.thickness = 0.05, .substeps = 16}),
      contestant("Continuous", "exact", kContinuous, {}),
      contestant("Continuous: time tolerance", "1/20 edge kept; 1e-2", kContinuous,
                 {.thickness = 0.05, .timeTolerance = 1e-2}),
      contestant("Continuous: time tolerance", "1/20 edge kept; 1e-4", kContinuous,
                 {.thickness = 0.05, .timeTolerance = 1e-4}),
      contestant("Continuous: time tolerance", "1/20 edge kept; 1e-10", kContinuous,
                 {.thickness = 0.05, .timeTolerance = 1e-10}),
      contestant("Continuous", "1/20 edge kept", kContinuous, {.thickness = 0.05}),
      contestant("Auto", "1/20 edge", kAuto, {.thickness = 0.05}),
      contestant("Auto: distinct", "1/20 edge", kAuto,
                 {.thickness = 0.05, .contacts = Contacts::Distinct}),
      contestant("Auto", "touching", kAuto, {}),
      contestant("Continuous: octree", "1 triangle a leaf", kContinuous,
                 {.octree = {.maxElementsPerLeaf = 1}}),
      contestant("Continuous: octree", "4 triangles a leaf", kContinuous,
                 {.octree = {.maxElementsPerLeaf = 4}}),
      contestant("Continuous: octree", "64 triangles a leaf", kContinuous,
                 {.octree = {.maxElementsPerLeaf = 64}}),
      contestant("Continuous: octree", "depth 3", kContinuous, {.octree = {.maxDepth = 3}}),
      contestant("Continuous: octree", "rebuilt each frame", kContinuous,
                 {.octree = {.update = OctreeUpdate::Rebuild}}),
      contestant("Brute force", "Intersection", kIntersection, {.engine = Engine::BruteForce}),
      contestant("Brute force", "Proximity 1/5 edge", kProximity,
                 {.thickness = 0.2, .engine = Engine::BruteForce}),
      contestant("Brute force", "Continuous", kContinuous, {.engine = Engine::BruteForce}),
  };
#ifdef PALPATE_HAS_FCL
  all.push_back(fclCollide());
#endif
  return all;
}

}  // namespace palpate::accuracy
