#include <palpate/ConstraintRows.h>
#include <palpate/OctreeBasedCD.h>

#include "Common/ContactRows.h"
#include "Common/PairRun.h"
#include "Common/RandomMeshes.h"
#include "Common/Sanitized.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

// Closed bodies that overlap when the simulation begins: a solver separates them by Auto's
// contacts. Of a blunt tool a little way in a coarse sheet or slab, walls are far from the sheet's
// vertices, and are not where the vertices leave it.
namespace palpate::testing {
namespace {

using Eigen::Vector3d;

struct Overlap {
  Mesh a, b;
};

std::vector<Overlap> overlaps() {
  std::vector<Overlap> all;
  const Mesh unit = boxMesh({0, 0, 0}, {1, 1, 1}), ball = sphere(8, 10, {0, 0, 0}, 1.0);
  for (const double share : {0.1, 0.3, 0.6}) {
    all.push_back({unit, boxMesh({1 - share, 0, 0}, {2 - share, 1, 1})});
    all.push_back({unit, boxMesh({1 - share, 0.05, 0.03}, {2 - share, 1.05, 1.03})});
    all.push_back({ball, sphere(9, 12, {2 - 2 * share, 0.02, 0.01}, 1.0)});
    all.push_back({boxMesh({-1, -1, -0.02}, {1, 1, 0.02}),
                   boxMesh({-0.99, -0.01, -2 + 2 * share}, {1.03, 0.03, 2 * share})});
  }
  all.push_back({sphere(5, 6, {0.6, 0.55, 0.5}, 0.2), unit});
  return all;
}

class Simulation {
 public:
  Simulation(const Overlap& bodies, bool isRigid)
      : m_sizeA(bodies.a.positions.size()), m_isRigid(isRigid), m_x(bodies.a.positions) {
    m_x.insert(m_x.end(), bodies.b.positions.begin(), bodies.b.positions.end());
    for (const bool ofA : {true, false}) {
      const Mesh& mesh = ofA ? bodies.a : bodies.b;
      (ofA ? m_a : m_b) = addMesh(m_collisions, mesh);
    }
    m_collisions.addCollisionPair(m_a, m_b, {.thickness = 0.05});
  }
  bool intersect() {
    set();
    return m_collisions.queries().penetration(m_a, m_b).intersecting;
  }
  void step() {
    set();
    m_collisions.detectCollision();
    std::vector<ConstraintRow> rows;
    const std::vector<Vector3d> a = side(true), b = side(false);
    appendRows(m_collisions.collisionData(m_a, m_b), {0, a, a},
               {static_cast<std::uint32_t>(m_sizeA), b, b}, rows);
    std::vector<double> forces(rows.size(), 0.0);
    for (int round = 0; round < 50; ++round)
      for (std::size_t i = 0; i < rows.size(); ++i) solve(rows[i], forces[i]);
    set();
    m_collisions.advance();
  }

 private:
  std::vector<Vector3d> side(bool ofA) const {
    const auto middle = m_x.begin() + static_cast<std::ptrdiff_t>(m_sizeA);
    return ofA ? std::vector<Vector3d>(m_x.begin(), middle)
               : std::vector<Vector3d>(middle, m_x.end());
  }
  void set() {
    m_collisions.setPositions(m_a, side(true));
    m_collisions.setPositions(m_b, side(false));
  }
  void solve(const ConstraintRow& row, double& force) {
    double mass = 0;
    for (const double w : row.weights) mass += w * w;
    if (m_isRigid) mass = 2;
    const double change = std::max(-force, (0.025 - row.gap(m_x)) / mass);
    force += change;
    if (!m_isRigid) {
      for (std::size_t i = 0; i < 4; ++i)
        m_x[row.vertices[i]] += change * row.weights[i] * row.normal;
      return;
    }
    double ofA = 0;  // the weights of a body sum to 1 or to -1
    for (std::size_t i = 0; i < 4; ++i)
      if (row.vertices[i] < m_sizeA) ofA += row.weights[i];
    for (std::size_t v = 0; v < m_x.size(); ++v)
      m_x[v] += (v < m_sizeA ? change : -change) * ofA * row.normal;
  }

  OctreeBasedCD m_collisions;
  GeometryId m_a{}, m_b{};
  const std::size_t m_sizeA;
  const bool m_isRigid;
  std::vector<Vector3d> m_x;
};

TEST(BodyContacts, ASolverSeparatesBodiesThatOverlapAtTheStart) {
  for (const Overlap& bodies : overlaps())
    for (const bool isRigid : {false, true}) {
      Simulation simulation(bodies, isRigid);
      EXPECT_TRUE(simulation.intersect());
      for (int step = 0; step < 20; ++step) simulation.step();
      EXPECT_FALSE(simulation.intersect()) << &bodies - overlaps().data() << isRigid;
    }
}

/// Whether the directions are within 60 degrees of the mean of the first `ofVertices`.
bool agree(const std::vector<Vector3d>& directions, std::size_t ofVertices) {
  Vector3d sum = Vector3d::Zero();
  for (std::size_t i = 0; i < ofVertices; ++i) sum += directions[i];
  return std::all_of(directions.begin(), directions.end(),
                     [&](const Vector3d& d) { return d.dot(sum) >= 0.5 * sum.norm(); });
}

TEST(BodyContacts, HaveOneDirectionOrAgree) {
  int ofBodies = 0;
  for (const Overlap& bodies : overlaps()) {
    OctreeBasedCD collisions;
    const GeometryId a = addMesh(collisions, bodies.a), b = addMesh(collisions, bodies.b);
    collisions.addCollisionPair(a, b, {.thickness = 0.05});
    collisions.detectCollision();
    const CollisionData& data = collisions.collisionData(a, b);
    const Penetration p = collisions.queries().penetration(a, b);
    std::vector<Vector3d> pushes;
    for (const auto& c : data.vertexTriangle()) pushes.push_back(c.normal);
    for (const auto& c : data.triangleVertex()) pushes.push_back(-c.normal);
    const std::size_t ofVertices = pushes.size();
    for (const auto& c : data.edgeEdge()) pushes.push_back(c.normal);
    ASSERT_FALSE(pushes.empty());
    const bool haveOneDirection = std::all_of(pushes.begin(), pushes.end(),
                                              [&](const Vector3d& d) { return d == p.direction; });
    if (haveOneDirection) {
      EXPECT_NEAR(-leastDistance(data, 0.0), p.depth, 1e-9);
    }
    EXPECT_TRUE(haveOneDirection || agree(pushes, ofVertices));
    ofBodies += haveOneDirection;
  }
  EXPECT_GE(ofBodies, 6);
}

/// The feature that leaves last has a contact, wherever rounding puts its exit: turned bodies
/// and turned positions, which differ by rounding, have contacts of the same depth.
TEST(BodyContacts, TheDeepestFeatureHasAContact) {
  Random random(41);
  const Mesh unit = boxMesh({-1, -1, -1}, {1, 1, 1});
  int deep = 0;
  for (int repeat = 0; repeat < casesOf(400); ++repeat) {
    const double far = std::exp2(uniform(random, -3, 13));
    const Vector3d at = randomPoint(random, -far, far), by = randomPoint(random, -1.3, 1.3);
    const auto turnedAt = [&](const Vector3d& place) {
      const Vector3d axis = randomPoint(random, -1, 1).normalized();
      return Eigen::Translation3d(place) * Eigen::AngleAxisd(uniform(random, 0, 3), axis);
    };
    const Eigen::Isometry3d poses[] = {turnedAt(at), turnedAt(at + by)};
    double ofTurned = 0, ofMoved = 0;
    for (const bool areTurned : {true, false}) {
      OctreeBasedCD collisions;
      GeometryId ids[2];
      for (int i = 0; i < 2; ++i) {
        std::vector<Vector3d> positions = unit.positions;
        if (!areTurned)
          for (Vector3d& p : positions) p = poses[i] * p;
        ids[i] = collisions.addTriangleMesh(positions, unit.triangles);
        if (areTurned) collisions.setTransform(ids[i], {poses[i].linear(), poses[i].translation()});
      }
      collisions.addCollisionPair(ids[0], ids[1], {.thickness = 0.05});
      collisions.detectCollision();
      (areTurned ? ofTurned : ofMoved) =
          leastDistance(collisions.collisionData(ids[0], ids[1]), 0.0);
    }
    EXPECT_NEAR(ofTurned, ofMoved, 1e-12 * far + 1e-9) << repeat;
    deep += ofMoved < -0.1;
  }
  EXPECT_GE(deep, leastOf(399));
}

TEST(BodyContacts, ShallowVerticesAndOpenMeshesKeepLocalNormals) {
  // The tip of a body is 0.01 behind a face.
  Mesh tip = sphere(3, 4, {0.45, 0.55, 1.19}, 0.2);
  for (const bool isOpen : {false, true}) {
    Mesh unit = boxMesh({0, 0, 0}, {1, 1, 1});
    if (isOpen) unit.triangles.erase(unit.triangles.begin()), tip.positions.back()[2] -= 0.2;
    OctreeBasedCD collisions;
    const GeometryId a = addMesh(collisions, tip), b = addMesh(collisions, unit);
    collisions.addCollisionPair(a, b, {.thickness = 0.05});
    collisions.detectCollision();
    bool found = false;
    for (const auto& c : collisions.collisionData(a, b).vertexTriangle())
      found |= c.distance < 0 && c.normal == Vector3d::UnitZ();
    EXPECT_TRUE(found);
  }
}

/// Two closed bodies whose edges touch, so that rounding decides whether they overlap. One slides
/// along the other.
TEST(BodyContacts, EdgesThatTouchHaveAContactThatSeparates) {
  const std::vector<Triangle> triangles{{0, 1, 2}, {1, 0, 3}, {0, 2, 3}, {2, 1, 3}};
  const std::vector<Vector3d> lower{{-1, 0, 0}, {1, 0, 0}, {0, 0.8, -1}, {0, -0.8, -1}},
      upper{{0.1, 1, 0}, {0.1, -1, 0}, {0.9, 0, 1}, {-0.7, 0, 1}};
  Random random(8);
  std::size_t starts = 0;
  for (int run = 0; run < 600; ++run) {
    if (isLeftOut(run)) continue;
    const Eigen::Quaterniond turn =
        Eigen::Quaterniond(Eigen::Vector4d{uniform(random, -1, 1), uniform(random, -1, 1),
                                           uniform(random, -1, 1), uniform(random, 0.1, 1)})
            .normalized();
    const Vector3d place = randomPoint(random, -20, 20);
    std::vector<Vector3d> a, before, now;
    for (const Vector3d& p : lower) a.push_back(turn * p + place);
    for (const Vector3d& p : upper) before.push_back(turn * p + place);
    for (const Vector3d& p : upper)
      now.push_back(turn * (p + (run % 3 == 0 ? Vector3d(0, 0, 0) : Vector3d(0.01, 0.02, 0))) +
                    place);
    OctreeBasedCD collisions;
    const GeometryId idA = collisions.addTriangleMesh(a, triangles),
                     idB = collisions.addTriangleMesh(before, triangles);
    collisions.addCollisionPair(idA, idB, {.thickness = 0.02});
    collisions.setPositions(idB, before, now);
    collisions.detectCollision();
    const CollisionData& data = collisions.collisionData(idA, idB);
    starts += !data.validity().startedApart;
    EXPECT_GE(data.edgeEdge().size(), 1u) << run;
    // The normal points from b, which is above, to a.
    for (const EdgeEdgeContact& c : data.edgeEdge())
      EXPECT_LT(c.normal.dot(turn * Vector3d::UnitZ()), -0.9) << run;
  }
  EXPECT_GE(starts, leastOf(100));
}

/// All lengths in mm. The tool is 6 wide; its end is at z = -depth, and the surface at z = 0.
struct BluntScene {
  Mesh tool, surface;
  std::string name;
};

std::vector<BluntScene> bluntScenes(double depth, bool closed) {
  std::vector<BluntScene> all;
  for (const int cells : {3, 5, 9, 20}) {
    Mesh surface = closed ? dividedBox({-15, -15, -6}, {15, 15, 0}, cells)
                          : sheet(static_cast<std::uint32_t>(cells), 0, 0);
    if (!closed)
      for (Vector3d& p : surface.positions) p = {30 * p.x() - 15, 30 * p.y() - 15, 0};
    for (const int parts : {1, 2, 4})
      all.push_back({dividedBox({-2.9, -3.2, -depth}, {3.1, 2.8, 12}, parts), surface,
                     std::to_string(cells) + " cells, " + std::to_string(parts) + " parts" +
                         (closed ? ", closed" : "")});
  }
  return all;
}

/// Calls f(contact, how far it pushes the tool up).
template <class F>
void forEachOf(const CollisionData& data, F&& f) {
  for (const auto& c : data.vertexTriangle()) f(c, c.normal.z());
  for (const auto& c : data.triangleVertex()) f(c, -c.normal.z());
  for (const auto& c : data.edgeEdge()) f(c, c.normal.z());
}

TEST(BluntTool, HasContactsAsDeepAsItIs) {
  constexpr double kDepth = 0.01;
  std::size_t number = 0;
  for (const bool closed : {false, true})
    for (const double thickness : {0.0, 0.1})
      for (const Contacts contacts : {Contacts::Distinct, Contacts::All})
        for (const BluntScene& scene : bluntScenes(kDepth, closed)) {
          if (testing::isLeftOut(number++)) continue;
          SCOPED_TRACE(scene.name + ", " + std::to_string(thickness) + ", " + toString(contacts));
          const PairSettings pair{.thickness = thickness, .contacts = contacts};
          PairRun run(settingsOf(Engine::Octree), scene.tool, scene.surface, pair, false);
          run.detect();
          int below = 0;
          forEachOf(run.data(), [&](const auto& c, double up) {
            EXPECT_GE(up, -1e-9);
            below += c.distance < 0.0;
            // Of all features that are near, some are as far beside each other.
            if (c.distance >= 0.0 || contacts == Contacts::All) return;
            EXPECT_GE(c.distance, -kDepth - 1e-12);
            EXPECT_GE(up, 1.0 - 1e-9);
          });
          EXPECT_GE(below, 4);
        }
}

/// Where the step begins in intersection as well as where it ends out of it.
TEST(BluntTool, IsLetOutOfASheet) {
  for (const bool closed : {false, true})
    for (const BluntScene& scene : bluntScenes(0.01, closed)) {
      SCOPED_TRACE(scene.name);
      PairRun run(testing::settingsOf(Engine::Octree), scene.tool, scene.surface,
                  {.thickness = 0.1}, false);
      std::vector<Vector3d> up = scene.tool.positions;
      for (Vector3d& p : up) p.z() += 0.03;
      run.step(scene.tool.positions, up, scene.surface.positions, scene.surface.positions);
      forEachOf(run.data(), [](const auto&, double towards) { EXPECT_GE(towards, -1e-9); });
    }
}

}  // namespace
}  // namespace palpate::testing
