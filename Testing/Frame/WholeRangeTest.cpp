#include "Common/ContactRows.h"
#include "Common/PairRun.h"
#include "Common/Sanitized.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

// Random scenes from the whole range of lengths, octrees against brute force: sizes from the
// smallest double to kLargestMeasure, alike or mixed, and every method.

namespace palpate::testing {
namespace {

constexpr double kLeastExponent = -1074, kMostExponent = 996.5;

using Positions = std::vector<Eigen::Vector3d>;

class RangeScene {
 public:
  explicit RangeScene(std::uint64_t seed) : m_random(seed), m_base(length()) {}

  /// Random geometries, motion and pairs. The same for each engine.
  void addTo(OctreeBasedCD& collisions) {
    const auto kinds = m_random() % 5;
    std::vector<GeometryId> ids;
    for (int i = 0; i < 3; ++i) {
      const double size = m_random() % 3 ? m_base : length();
      const auto count = 1 + m_random() % 12, kind = kinds == 4 ? m_random() % 4 : kinds;
      const Positions now = cloud(count, size, kind);
      ids.push_back(add(collisions, now, size));
      if (m_random() % 2)
        move(collisions, ids.back(), now, m_random() % 2 ? 1e-3 * size : length());
    }
    for (std::size_t a = 0; a < ids.size(); ++a)
      for (std::size_t b = a; b < ids.size(); ++b) addPair(collisions, ids[a], ids[b]);
  }

 private:
  double within(double low, double high) { return uniform(m_random, low, high); }
  /// Log-uniform over the whole range.
  double length() { return std::exp2(within(kLeastExponent, kMostExponent)); }
  /// Zero, `size`, or any length, or uniform up to `size`.
  double coordinate(double size) {
    const auto kind = m_random() % 6;
    if (kind > 2) return within(-size, size);
    if (kind == 0) return 0.0;
    const bool isPositive = m_random() % 2;
    return (isPositive ? 1 : -1) * (kind == 1 ? size : length());
  }
  Eigen::Vector3d point(double size) { return size * randomPoint(m_random, -1, 1); }
  static Eigen::Vector3d clamped(const Eigen::Vector3d& p) {
    return p.cwiseMin(kLargestMeasure).cwiseMax(-kLargestMeasure);
  }

  /// kind: 0 of one size, 1 of any sizes, 2 far from the origin, 3 with coordinates of any sizes.
  Positions cloud(std::size_t count, double size, std::uint64_t kind) {
    const double far = kind == 2 ? length() : 0.0;
    const Eigen::Vector3d centre{coordinate(far), coordinate(far), coordinate(far)};
    Positions positions;
    for (std::size_t i = 0; i < count; ++i) {
      if (kind == 3)
        positions.push_back({coordinate(size), coordinate(size), coordinate(size)});
      else
        positions.push_back(clamped((kind == 2 ? centre : Eigen::Vector3d(0, 0, 0)) +
                                    point(kind == 1 ? length() : size)));
    }
    return positions;
  }

  GeometryId add(OctreeBasedCD& collisions, const Positions& positions, double size) {
    const auto vertex = [&] { return static_cast<std::uint32_t>(m_random() % positions.size()); };
    const auto type = m_random() % 3;
    const std::size_t count = 1 + m_random() % 10;
    const double radius = m_random() % 2 ? 0.0 : std::abs(coordinate(size));
    if (type == 0) return collisions.addPointSet(positions, radius);
    std::vector<Triangle> triangles;
    std::vector<Segment> segments;
    for (std::size_t i = 0; i < count; ++i) {
      triangles.push_back({vertex(), vertex(), vertex()});
      if (triangles[i][0] != triangles[i][1])
        segments.push_back({triangles[i][0], triangles[i][1]});
    }
    return type == 1 ? collisions.addLineMesh(positions, segments, radius)
                     : collisions.addTriangleMesh(positions, triangles);
  }

  void move(OctreeBasedCD& collisions, GeometryId id, Positions before, double by) {
    const Positions now = before;
    for (Eigen::Vector3d& p : before) p = clamped(p + point(by));
    collisions.setPositions(id, before, now);
  }

  void addPair(OctreeBasedCD& collisions, GeometryId a, GeometryId b) {
    constexpr std::array kMethods{Method::Auto, Method::Intersection, Method::Proximity,
                                  Method::Continuous};
    PairSettings settings;
    settings.method = kMethods[m_random() % 4];
    settings.thickness = m_random() % 4 ? m_base * within(0, 1) : length();
    if (m_random() % 4 == 0 && settings.method != Method::Proximity) settings.thickness = 0;
    settings.contacts = m_random() % 2 ? Contacts::All : Contacts::Distinct;
    try {
      collisions.addCollisionPair(a, b, settings);
    } catch (const Error& error) {  // not for these geometry types
      EXPECT_TRUE(error.code() == ErrorCode::UnsupportedMethod ||
                  error.code() == ErrorCode::InvalidSettings);
    }
  }

  Random m_random;
  double m_base;
};

void expectGoodNumbers(const CollisionData& data) {
  forEachContact(data, [](const auto& c) {
    EXPECT_NEAR(c.normal.norm(), 1, 1e-14);
    EXPECT_TRUE(std::isfinite(c.distance));
    EXPECT_TRUE(c.timeOfImpact >= 0 && c.timeOfImpact <= 1);
  });
}

/// Returns the number of contacts.
std::size_t compare(std::uint64_t seed) {
  OctreeBasedCD octree(settingsOf(Engine::Octree)), oracle(settingsOf(Engine::BruteForce));
  for (OctreeBasedCD* each : {&octree, &oracle}) {
    RangeScene(seed).addTo(*each);
    each->detectCollision();
  }
  EXPECT_EQ(octree.octree().validate(), std::vector<std::string>{});
  std::size_t contacts = 0;
  for (const CollisionPair& pair : oracle.pairs()) {
    const CollisionData& found = octree.collisionData(pair.a, pair.b);
    const CollisionData& truth = oracle.collisionData(pair.a, pair.b);
    EXPECT_EQ(found.hash(), truth.hash()) << "method " << static_cast<int>(pair.settings.method);
    const auto candidates = octree.candidatePairs(pair.a, pair.b),
               least = oracle.candidatePairs(pair.a, pair.b);
    EXPECT_TRUE(std::includes(candidates.begin(), candidates.end(), least.begin(), least.end()));
    expectGoodNumbers(truth);
    contacts += Rows(truth).contacts();
  }
  return contacts;
}

TEST(WholeRange, MatchesBruteForce) {
  std::size_t contacts = 0;
  const int count = casesOf(2000, 500);
  for (int seed = 0; seed < count && !::testing::Test::HasFailure(); ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    contacts += compare(static_cast<std::uint64_t>(seed));
  }
  EXPECT_GT(contacts, static_cast<std::size_t>(count));
}

/// Triangles at distances 2^-900 to 2^900, each as large as a hundredth of its distance. Boxes
/// cannot tell most of them apart, but few features are tested: those of a triangle and its copy.
TEST(WholeRange, FeaturesThatAreTestedFollowTheAnswer) {
  constexpr std::uint32_t kCount = 1000;
  Random random(6);
  Mesh mesh;
  for (std::uint32_t i = 0; i < kCount; ++i) {
    const double distance = std::exp2(900 - 1800.0 * i / kCount);
    const Eigen::Vector3d at(distance, 0, 0);
    mesh.positions.push_back(at);
    for (int corner = 1; corner < 3; ++corner)
      mesh.positions.push_back(at + 0.01 * distance * randomPoint(random, -1, 1));
    mesh.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
  }
  for (const Method method : {Method::Intersection, Method::Continuous}) {
    OctreeBasedCD collisions(settingsOf(Engine::Octree));
    const GeometryId a = addMesh(collisions, mesh), b = addMesh(collisions, mesh);
    collisions.addCollisionPair(a, b, {.method = method});
    collisions.addCollisionPair(a, a, {.method = method});
    collisions.detectCollision();
    EXPECT_LE(collisions.statistics().featurePairs, 15u * kCount);
    EXPECT_GE(collisions.statistics().contacts, kCount);
    EXPECT_EQ(collisions.collisionData(a, a).vertexTriangle().size(), 0u);
  }
}

}  // namespace
}  // namespace palpate::testing
