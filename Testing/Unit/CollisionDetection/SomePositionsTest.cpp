#include "Common/PairRun.h"
#include "Common/TestGeometry.h"

#include <palpate/Error.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <limits>
#include <span>

// Positions that are set for some vertices only have the answers of positions set for all.

namespace palpate {
namespace {

using namespace testing;

std::size_t below(Random& random, std::size_t count) { return random() % count; }

/// One object to which changed vertices are given, and one to which all are.
class SomeAndAll {
 public:
  SomeAndAll(const std::vector<TestGeometry>& bodies, Method method, int threads) {
    PairSettings settings;
    settings.method = method;
    settings.thickness = 0.01;
    for (OctreeBasedCD& object : m_objects) {
      object = OctreeBasedCD(settingsOf(Engine::Octree, threads));
      m_ids.clear();
      for (const TestGeometry& body : bodies) m_ids.push_back(body.addTo(object));
      object.addCollisionPair(m_ids[0], m_ids[1], settings);
      object.addCollisionPair(m_ids[0], m_ids[0], settings);
    }
    for (const TestGeometry& body : bodies) m_positions.push_back(body.positions);
  }
  /// Moves consecutive vertices.
  void moveSome(Random& random, std::size_t body, double length) {
    Positions& all = m_positions[body];
    const std::size_t first = below(random, all.size()),
                      count = below(random, std::min<std::size_t>(all.size() - first, 40)) + 1;
    const Vector3d together = randomPoint(random, -length, length);
    for (std::size_t v = first; v < first + count; ++v)
      all[v] += together + randomPoint(random, -0.2 * length, 0.2 * length);
    m_objects[0].setPositions(m_ids[body], static_cast<std::uint32_t>(first),
                              std::span(all).subspan(first, count));
    m_objects[1].setPositions(m_ids[body], all);
  }
  void moveAll(Random& random, std::size_t body, double length) {
    for (Vector3d& p : m_positions[body]) p += randomPoint(random, -length, length);
    forBoth([&](OctreeBasedCD& object) { object.setPositions(m_ids[body], m_positions[body]); });
  }
  void setBothEnds(std::size_t body) {
    const Positions before(m_objects[1].positions(m_ids[body]).begin(),
                           m_objects[1].positions(m_ids[body]).end());
    forBoth([&](OctreeBasedCD& object) {
      object.setPositions(m_ids[body], before, m_positions[body]);
    });
  }
  template <class F>
  void forBoth(F&& f) {
    for (OctreeBasedCD& object : m_objects) f(object);
  }
  void detect() {
    forBoth([](OctreeBasedCD& object) { object.detectCollision(); });
    const OctreeBasedCD &some = m_objects[0], &all = m_objects[1];
    for (const CollisionPair& pair : all.pairs()) {
      const CollisionData &found = some.collisionData(pair.a, pair.b),
                          &truth = all.collisionData(pair.a, pair.b);
      expectSameContacts(found, truth);
      EXPECT_EQ(found.hash(), truth.hash());
      EXPECT_EQ(found.validity().method, truth.validity().method);
      EXPECT_EQ(found.validity().displacement, truth.validity().displacement);
      EXPECT_EQ(found.validity().trusted, truth.validity().trusted);
    }
    m_contacts += all.statistics().contacts;
    for (std::size_t body = 0; body < m_ids.size(); ++body) {
      EXPECT_EQ(some.bounds(m_ids[body]).min(), all.bounds(m_ids[body]).min());
      EXPECT_EQ(some.bounds(m_ids[body]).max(), all.bounds(m_ids[body]).max());
      EXPECT_TRUE(std::ranges::equal(some.positions(m_ids[body]), all.positions(m_ids[body])));
    }
  }
  OctreeBasedCD& some() { return m_objects[0]; }
  GeometryId id(std::size_t body) const { return m_ids[body]; }
  std::size_t size(std::size_t body) const { return m_positions[body].size(); }
  std::size_t contacts() const { return m_contacts; }

 private:
  std::array<OctreeBasedCD, 2> m_objects;
  std::vector<GeometryId> m_ids;
  std::vector<Positions> m_positions;
  std::size_t m_contacts = 0;
};

class SomePositions : public ::testing::TestWithParam<Method> {};

TEST_P(SomePositions, HaveTheAnswersOfAllPositions) {
  for (const int threads : {1, 2}) {
    Random random(31);
    SomeAndAll both({testGeometry(sheet(24, 0.5, 0.0)), testGeometry(sheet(24, 0.51, 1.0))},
                    GetParam(), threads);
    for (int frame = 0; frame < casesOf(160, 60); ++frame) {
      SCOPED_TRACE("frame " + std::to_string(frame));
      if (frame % 5 != 3) both.forBoth([](OctreeBasedCD& object) { object.advance(); });
      const double length = frame % 20 < 10 ? 1e-4 : 0.01;
      for (std::size_t part = 0; part < below(random, 3); ++part) both.moveSome(random, 0, length);
      if (frame % 6 == 2) both.moveSome(random, 1, length);
      if (frame % 17 == 5) both.moveAll(random, 0, 1e-3);
      if (frame % 23 == 7) both.setBothEnds(0);
      if (frame % 29 == 8)
        both.forBoth([&](OctreeBasedCD& object) {
          object.setTransform(both.id(1), {Eigen::Matrix3d::Identity(), {0.0, 0.001, 0.0}});
        });
      if (frame % 13 == 6) {
        const Vector3d bad(0.0, std::numeric_limits<double>::quiet_NaN(), 0.0);
        EXPECT_THROW(both.some().setPositions(both.id(0), 5, std::span(&bad, 1)), Error);
      }
      both.detect();
      if (frame % 8 == 1) {
        EXPECT_EQ(both.some().octree().validate(), std::vector<std::string>{});
      }
      if (HasFailure()) return;
    }
    EXPECT_GT(both.contacts(), 0u);
  }
}

INSTANTIATE_TEST_SUITE_P(Methods, SomePositions,
                         ::testing::Values(Method::Proximity, Method::Continuous, Method::Auto,
                                           Method::Intersection),
                         [](const auto& method) { return toString(method.param); });

TEST(SomePositionsOfABody, AreRefusedBeyondItsVertices) {
  OctreeBasedCD object;
  const Mesh mesh = sheet(2, 0.0, 0.0);
  const GeometryId id = object.addTriangleMesh(mesh.positions, mesh.triangles),
                   ball = object.addAnalyticalGeometry(Sphere{.radius = 1.0});
  const auto messageOf = [&](GeometryId geometry, long long first, std::size_t count) {
    try {
      object.setPositions(geometry, first, std::vector<Vector3d>(count, Vector3d(7.0, 7.0, 7.0)));
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::WrongPositionCount);
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_EQ(messageOf(id, 7, 3),
            "geometry 0: 3 positions given from vertex 7 on, but it has 9 vertices");
  EXPECT_EQ(messageOf(id, 4294967295, 1),
            "geometry 0: 1 positions given from vertex 4294967295 on, but it has 9 vertices");
  EXPECT_EQ(messageOf(id, -1, 1),
            "geometry 0: 1 positions given from vertex -1 on, but it has 9 vertices");
  EXPECT_NE(messageOf(ball, 0, 0).find("is a shape"), std::string::npos);
  EXPECT_EQ(messageOf(id, 9, 0), "");
  EXPECT_TRUE(std::ranges::equal(object.positions(id), mesh.positions));
}

TEST(SomePositionsOfABody, ThatAreNotFiniteAreNamedByTheirVertex) {
  OctreeBasedCD object;
  const Mesh mesh = sheet(2, 0.0, 0.0);
  const GeometryId id = object.addTriangleMesh(mesh.positions, mesh.triangles);
  const std::array<Vector3d, 2> given{Vector3d(1.0, 2.0, 3.0),
                                      Vector3d(0.0, std::numeric_limits<double>::infinity(), 0.0)};
  try {
    object.setPositions(id, 4, given);
    ADD_FAILURE() << "no error";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("vertex 5: position is"), std::string::npos);
    EXPECT_EQ(error.element(), 5u);
  }
  EXPECT_TRUE(std::ranges::equal(object.positions(id), mesh.positions));
}

/// In the step in which a geometry is added, the start follows.
TEST(SomePositionsOfABody, SetBothEndsWhileItIsNew) {
  OctreeBasedCD object;
  const Mesh mesh = sheet(8, 0.5, 0.0);
  const GeometryId a = object.addTriangleMesh(mesh.positions, mesh.triangles),
                   b = object.addTriangleMesh(mesh.positions, mesh.triangles);
  object.addCollisionPair(a, b, {.method = Method::Continuous});
  object.setPositions(a, 3, std::array{Vector3d(0.3, 0.3, 9.0)});
  object.detectCollision();
  EXPECT_EQ(object.collisionData(a, b).validity().displacement, 0.0);
}

}  // namespace
}  // namespace palpate
