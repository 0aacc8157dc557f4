#pragma once

#include <palpate/OctreeBasedCD.h>

#include "Common/ContactRows.h"
#include "Common/RandomMeshes.h"
#include "Common/Sanitized.h"

#include <string>
#include <vector>

namespace palpate::testing {

inline Settings settingsOf(Engine engine, int threads = 1,
                           OctreeUpdate update = OctreeUpdate::Auto) {
  Settings settings;
  settings.engine = engine;
  settings.threads = threads;
  settings.octree.update = update;
  return settings;
}

/// Octrees with 1, 2 and 8 threads, refitted or always rebuilt. With sanitizers, one of each
/// update.
inline std::vector<Settings> octreeSettings() {
  if (kShareOfCases > 1)
    return {settingsOf(Engine::Octree, 8), settingsOf(Engine::Octree, 2, OctreeUpdate::Rebuild)};
  std::vector<Settings> all;
  for (const OctreeUpdate update : {OctreeUpdate::Auto, OctreeUpdate::Rebuild})
    for (const int threads : {1, 2, 8}) all.push_back(settingsOf(Engine::Octree, threads, update));
  return all;
}

inline std::string nameOf(const Settings& settings) {
  return std::to_string(settings.threads) + " threads, " +
         (settings.octree.update == OctreeUpdate::Auto ? "Auto" : "Rebuild");
}

/// Engine: OctreeBasedCD, or FCL behind the same calls. Any mesh with positions and triangles.
template <class Engine, class AnyMesh>
GeometryId addMesh(Engine& engine, const AnyMesh& mesh) {
  return engine.addTriangleMesh(mesh.positions, mesh.triangles);
}

/// Two meshes in one engine: against each other and, unless they are large, each with itself.
class PairRun {
 public:
  PairRun(const Settings& settings, const Mesh& a, const Mesh& b, const PairSettings& pair,
          bool withThemselves = true)
      : m_detection(settings), m_a(addMesh(m_detection, a)), m_b(addMesh(m_detection, b)) {
    m_detection.addCollisionPair(m_a, m_b, pair);
    if (!withThemselves) return;
    m_detection.addCollisionPair(m_a, m_a, pair);
    m_detection.addCollisionPair(m_b, m_b, pair);
  }

  /// One frame of a step between the given positions.
  void step(const std::vector<Eigen::Vector3d>& aBefore, const std::vector<Eigen::Vector3d>& aNow,
            const std::vector<Eigen::Vector3d>& bBefore, const std::vector<Eigen::Vector3d>& bNow) {
    m_detection.setPositions(m_a, aBefore, aNow);
    m_detection.setPositions(m_b, bBefore, bNow);
    detect();
  }
  void detect() {
    m_detection.detectCollision();
    EXPECT_EQ(m_detection.octree().validate(), std::vector<std::string>{});
  }

  OctreeBasedCD& detection() { return m_detection; }
  const OctreeBasedCD& detection() const { return m_detection; }
  const CollisionData& data() const { return m_detection.collisionData(m_a, m_b); }
  GeometryId a() const { return m_a; }
  GeometryId b() const { return m_b; }

  /// Contacts of (a, b), then of each mesh with itself.
  std::vector<Rows> answers() const {
    std::vector<Rows> rows;
    for (const CollisionPair& pair : m_detection.pairs())
      rows.emplace_back(m_detection.collisionData(pair.a, pair.b));
    return rows;
  }
  void expectWellFormed(const Mesh& a, const Mesh& b) const {
    for (const CollisionPair& pair : m_detection.pairs())
      testing::expectWellFormed(m_detection.collisionData(pair.a, pair.b), pair.a == m_a ? a : b,
                                pair.b == m_a ? a : b, pair.settings);
  }

 private:
  OctreeBasedCD m_detection;
  GeometryId m_a, m_b;
};

inline void expectSame(const std::vector<Rows>& found, const std::vector<Rows>& truth) {
  ASSERT_EQ(found.size(), truth.size());
  for (std::size_t i = 0; i < found.size(); ++i) {
    SCOPED_TRACE("pair " + std::to_string(i));
    expectSameRows(found[i], truth[i]);
  }
}

}  // namespace palpate::testing
