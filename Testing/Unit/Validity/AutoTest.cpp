#include "Common/PairRun.h"

#include <set>

// Method::Auto: octrees match brute force, and it finds all that Method::Continuous finds.

namespace palpate {
namespace {

using namespace testing;
using Eigen::Vector3d;

constexpr double kThickness = 0.02;

/// Two meshes and their positions at both ends of a step.
struct Case {
  Mesh a, b;
  std::vector<Vector3d> aNow, bNow;
};

std::vector<Vector3d> shaken(Random& random, const std::vector<Vector3d>& positions, double by,
                             double fastShare, double fast) {
  std::vector<Vector3d> moved;
  for (const Vector3d& p : positions) {
    const bool isFast = uniform(random, 0, 1) < fastShare;
    moved.push_back(p + randomPoint(random, -1, 1) * (isFast ? fast : by));
  }
  return moved;
}

/// Soups, a ball over a sheet, two sheets. All vertices move by `slow`, some by `fast`.
Case randomCase(Random& random, double slow, double fastShare, double fast) {
  Case c;
  switch (random() % 3) {
    case 0:
      c.a = soup(random, 25, 0.2);
      c.b = soup(random, 25, 0.2);
      break;
    case 1:
      c.a = sphere(5, 7, {0.5, 0.5, 0.3 + uniform(random, -0.02, 0.08)}, 0.25);
      c.b = sheet(5, 0, 1.0);
      break;
    default:
      c.a = sheet(4, uniform(random, 0.0, 0.05), 0.5);
      c.b = sheet(5, 0, 0.5);
  }
  const Vector3d common = randomPoint(random, -0.3, 0.3);  // in which all share
  c.aNow = shaken(random, c.a.positions, slow, fastShare, fast);
  c.bNow = shaken(random, c.b.positions, slow, fastShare, fast);
  for (auto* now : {&c.aNow, &c.bNow})
    for (Vector3d& p : *now) p += common;
  return c;
}

struct Motion {
  const char* name;
  double slow, fastShare, fast;
};
constexpr Motion kMotions[]{{"still", 0, 0, 0},
                            {"slow", 0.001, 0, 0},
                            {"at the tolerance", 0.003, 0, 0},
                            {"mixed", 0.0005, 0.1, 0.2},
                            {"fast", 0.1, 0, 0}};

/// Feature ids of all contacts, by list.
std::set<std::array<std::uint32_t, 5>> idsOf(const CollisionData& data) {
  std::set<std::array<std::uint32_t, 5>> ids;
  for (const auto& c : data.vertexTriangle()) ids.insert({0, c.vertex, c.triangle, 0, 0});
  for (const auto& c : data.triangleVertex()) ids.insert({1, c.vertex, c.triangle, 0, 0});
  for (const auto& c : data.edgeEdge())
    ids.insert({2, c.edgeA[0], c.edgeA[1], c.edgeB[0], c.edgeB[1]});
  return ids;
}

/// Squares of motions have no normal double there.
TEST(Auto, HasTheSameContactsAtATinyScale) {
  constexpr double kScale = 0x1p-480;
  Random random(14);
  std::size_t found = 0, mixed = 0;
  for (int i = 0; i < casesOf(60); ++i) {
    Case c = randomCase(random, 0.0005, 0.03, 0.1);
    const auto detect = [&](double thickness) {
      const PairSettings settings{.method = Method::Auto,
                                  .thickness = thickness,
                                  .automatic = {.motionTolerance = 2 * thickness}};
      PairRun run(settingsOf(Engine::Octree), c.a, c.b, settings, false);
      run.step(c.a.positions, c.aNow, c.b.positions, c.bNow);
      mixed += run.data().validity().reason == MethodReason::Mixed;
      return idsOf(run.data());
    };
    const auto ids = detect(kThickness);
    for (auto* positions : {&c.a.positions, &c.aNow, &c.b.positions, &c.bNow})
      for (Vector3d& p : *positions) p *= kScale;
    EXPECT_EQ(detect(kThickness * kScale), ids) << i;
    found += ids.size();
  }
  EXPECT_GT(found, 1000u / kShareOfCases);
  EXPECT_GT(mixed, 40u / kShareOfCases);
}

void stepOf(PairRun& run, const Case& c) { run.step(c.a.positions, c.aNow, c.b.positions, c.bNow); }

/// Each contact of Continuous is present, or a contact of the same vertex (of one vertex of each
/// edge) represents it.
void expectRepresented(const CollisionData& found, const CollisionData& truth) {
  std::set<std::uint32_t> ofA, ofB;
  for (const auto& contact : found.vertexTriangle()) {
    ofA.insert(contact.vertex);
    ofB.insert(contact.vertices.begin(), contact.vertices.end());
  }
  for (const auto& contact : found.triangleVertex()) {
    ofB.insert(contact.vertex);
    ofA.insert(contact.vertices.begin(), contact.vertices.end());
  }
  for (const auto& contact : found.edgeEdge()) {
    ofA.insert(contact.edgeA.begin(), contact.edgeA.end());
    ofB.insert(contact.edgeB.begin(), contact.edgeB.end());
  }
  const auto any = [](const auto& set, const auto& vertices) {
    return std::ranges::any_of(vertices, [&](std::uint32_t v) { return set.contains(v); });
  };
  for (const auto& contact : truth.vertexTriangle())
    EXPECT_TRUE(any(ofA, std::array{contact.vertex}) && any(ofB, contact.vertices));
  for (const auto& contact : truth.triangleVertex())
    EXPECT_TRUE(any(ofA, contact.vertices) && any(ofB, std::array{contact.vertex}));
  for (const auto& contact : truth.edgeEdge())
    EXPECT_TRUE(any(ofA, contact.edgeA) && any(ofB, contact.edgeB));
}

TEST(Auto, FindsEverythingThatContinuousFinds) {
  Random random(12);
  std::size_t found = 0, represented = 0;
  for (int i = 0; i < casesOf(1500); ++i) {
    const Motion& motion = kMotions[i % std::size(kMotions)];
    SCOPED_TRACE(std::string(motion.name) + ", case " + std::to_string(i));
    const double slow = motion.slow * uniform(random, 0, 2),
                 fast = motion.fast * uniform(random, 0, 1);
    const Case c = randomCase(random, slow, motion.fastShare, fast);
    const double thickness = i % 4 == 0 ? 0.0 : kThickness,
                 tolerance = uniform(random, -1, 1) * 0.01,
                 most = thickness + (tolerance < 0 ? thickness / 2 : tolerance) + 1e-6;
    PairRun truth(settingsOf(Engine::Octree), c.a, c.b,
                  {Method::Continuous, thickness, Contacts::All}),
        run(settingsOf(Engine::Octree), c.a, c.b,
            {.method = Method::Auto,
             .thickness = thickness,
             .contacts = Contacts::All,
             .automatic = {.motionTolerance = tolerance}}),
        distinct(settingsOf(Engine::Octree), c.a, c.b, {Method::Auto, thickness}, false);
    for (PairRun* each : {&truth, &run, &distinct}) stepOf(*each, c);
    for (const CollisionPair& pair : run.detection().pairs()) {
      const CollisionData& data = run.detection().collisionData(pair.a, pair.b);
      const auto expected = idsOf(truth.detection().collisionData(pair.a, pair.b)),
                 answer = idsOf(data);
      found += expected.size();
      EXPECT_TRUE(std::ranges::includes(answer, expected));
      if (!data.validity().startedApart) continue;  // Intersection's contacts are of more features
      for (const auto& contact : data.vertexTriangle()) EXPECT_LE(contact.distance, most);
      for (const auto& contact : data.edgeEdge()) EXPECT_LE(contact.distance, most);
    }
    // Else contacts that stand for others may be of vertices behind, and not be reported.
    if (thickness > 0.0 && distinct.data().validity().startedApart) {
      expectRepresented(distinct.data(), truth.data());
      represented += idsOf(truth.data()).size();
    }
    if (HasFailure()) return;
  }
  EXPECT_GT(found, 20000u / kShareOfCases);
  EXPECT_GT(represented, 7000u / kShareOfCases);
}

}  // namespace
}  // namespace palpate
