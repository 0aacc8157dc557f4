#include <palpate/FeaturePairs.h>

#include "Common/DegenerateCases.h"
#include "Common/PairRun.h"
#include "Common/Sanitized.h"
#include "Frame/ExactContacts.h"
#include "Frame/Placement.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <memory>
#include <string>

// Contacts do not depend on the unit of length, on where the scene is, or on how its elements are
// numbered. Where a transformation rounds positions, for example from metres to millimetres, they
// are the same, except where the exact result for the rounded positions differs.

namespace palpate {
namespace {

using namespace testing;
using Eigen::Vector3d;

/// To multiples of 2^-20, so that sums with larger multiples are exact.
void toGrid(std::vector<Vector3d>& positions) {
  for (Vector3d& p : positions)
    for (double& x : p) x = std::round(x * 0x1p20) * 0x1p-20;
}

StepScene gridScene(const std::string& name, const Mesh& a, const Mesh& b, double thickness) {
  StepScene scene = stepScene(name, a, b, thickness);
  for (auto* positions : {&scene.a.positions, &scene.b.positions, &scene.aBefore, &scene.bBefore})
    toGrid(*positions);
  return scene;
}

std::vector<StepScene> scenesToScale() {
  Random random(12);
  const Mesh first = soup(random, 40, 0.3), second = soup(random, 40, 0.3);
  const StepScene touching = latticeScene(random);
  return {gridScene("soups", first, second, 0x1p-5),
          gridScene("sheets", sheet(8, 0, 0), sheet(7, 0.02, 1), 0x1p-6),
          gridScene("bodies", sphere(6, 9, {0.5, 0.5, 0.5}, 0.4),
                    sphere(5, 8, {0.6, 0.55, 1.1}, 0.3), 0x1p-5),
          touching};
}

/// Exact in double for positions of toGrid().
std::vector<Transformation> exactTransformations() {
  const Vector3d far(0x1p28, -0x1.8p27, 0x1p20);
  return {{.name = "larger", .scale = 0x1p10},
          {.name = "smaller", .scale = 0x1p-10},
          {.name = "much larger", .scale = 0x1p90},
          {.name = "much smaller", .scale = 0x1p-90},
          {.name = "beyond squares", .scale = 0x1p900},
          {.name = "below squares", .scale = 0x1p-900},
          {.name = "the end of the range", .scale = 0x1p995},
          // Positions keep all their bits down to 2^-1054; coordinates of contacts do not.
          {.name = "among denormals", .scale = 0x1p-1050},
          {.name = "moved", .translation = far},
          {.name = "corners", .corners = true},
          {.name = "triangles", .triangles = true},
          {.name = "vertices", .vertices = true},
          {.name = "geometries", .swapped = true},
          {.name = "mirrored in x", .mirror = {-1, 1, 1}},
          {.name = "mirrored in y", .mirror = {1, -1, 1}},
          {.name = "turned by a half", .mirror = {-1, -1, 1}},
          {.name = "all at once",
           .scale = 0x1p7,
           .mirror = {1, 1, -1},
           .translation = far,
           .corners = true,
           .triangles = true,
           .vertices = true,
           .swapped = true}};
}

class UnitIndependence : public ::testing::TestWithParam<MethodCase> {
 protected:
  static const PairSettings& settings() { return GetParam().settings; }
  static bool continuous() { return settings().method == Method::Continuous; }
  static bool distinct() {
    return settings().method == Method::Proximity && settings().contacts == Contacts::Distinct;
  }

  /// Whether the sign of a contact's normal follows from its winding or numbering.
  static bool hasNoSide(const PlainContact& c) {
    if (c.distance == 0) return true;
    return settings().method == Method::Intersection && c.ids[0] != PlainContact::EdgeEdge;
  }

  static bool meetInTheirInteriors(const PlainContact& c) {
    const auto inside = [&](int i) { return c.weights[i] > 0 && c.weights[i] < 1; };
    if (c.ids[0] == PlainContact::VertexVertex) return false;
    return inside(0) && inside(1) && (c.ids[0] == PlainContact::EdgeEdge || inside(2));
  }

  /// unit: the smallest difference of doubles, in the scene's own lengths.
  static void expectSame(const PlainContact& found, const PlainContact& truth,
                         const Transformation& how) {
    const double unit = 0x1p-1074 / how.scale;
    SCOPED_TRACE("contact " + std::to_string(truth.ids[0]) + ": " + std::to_string(truth.ids[1]) +
                 " " + std::to_string(truth.ids[2]) + " " + std::to_string(truth.ids[3]) + " " +
                 std::to_string(truth.ids[4]));
    if (continuous()) {
      // A time may be early by up to the tolerance, by an amount that depends on the search.
      EXPECT_NEAR(found.time, truth.time, TimeOfImpactSettings{}.timeTolerance);
      // Where positions at that time have few bits, rounding decides which features meet.
      if (unit > 0x1p-45) return;
      // At an edge or a corner that time decides which features meet.
      if (!meetInTheirInteriors(truth)) return;
      // Windings tell on which side of a surface that is touched the other one is.
      if (truth.time == 0 && !how.keepsWinding()) return;
      // The plane turns a little in that time. Features that never left it have no side.
      const bool turned = hasNoSide(truth) && found.normal.dot(truth.normal) < 0;
      const Vector3d expected = turned ? Vector3d(-truth.normal) : truth.normal;
      EXPECT_LT((found.normal - expected).norm(), 1e-3);
      return;
    }
    EXPECT_EQ(found.time, truth.time);
    // Intersection's distance is negative behind the triangle by its winding, so it changes sign.
    const bool turned = hasNoSide(truth) && found.normal.dot(truth.normal) < 0;
    const double distance = turned ? -truth.distance : truth.distance;
    EXPECT_NEAR(found.distance, distance, 0x1p-53 * std::abs(distance) < unit ? unit : 0);
    for (int i = 0; i < 3; ++i) EXPECT_NEAR(found.weights[i], truth.weights[i], 0x1p-52);
    // Distinct at distance zero: the winding normal of whichever triangle is named.
    if (distinct() && truth.distance == 0) return;
    if (truth.distance == 0 && !how.keepsWinding()) return;
    EXPECT_EQ(found.normal, turned ? Vector3d(-truth.normal) : truth.normal);
  }
};

TEST_P(UnitIndependence, ExactTransformationsChangeNothing) {
  for (const StepScene& scene : scenesToScale()) {
    SCOPED_TRACE(scene.name);
    const Placement own(scene, {});
    const PairRun truth = own.run(settings());
    EXPECT_TRUE(truth.answers().front().anything());
    for (Transformation how : exactTransformations()) {
      how.keepsTriangles = GetParam().settings.method == Method::Intersection;
      SCOPED_TRACE(how.name);
      const Placement placement(scene, how);
      const PairRun run = placement.run(settings());
      EXPECT_NEAR(run.data().earliestTimeOfImpact(), truth.data().earliestTimeOfImpact(),
                  continuous() ? TimeOfImpactSettings{}.timeTolerance : 0);
      EXPECT_EQ(placement.intersectingTriangles(run), own.intersectingTriangles(truth));
      for (const bool self : {false, true}) {
        auto found = placement.contacts(run, self, settings().contacts);
        auto expected = own.contacts(truth, self, settings().contacts);
        if (distinct() && (how.swapped || how.vertices)) {
          // By definition one side only is tested: the first mesh's vertices, or the lower vertex.
          for (auto* contacts : {&found, &expected})
            std::erase_if(*contacts, [](const PlainContact& c) {
              return c.ids[0] == PlainContact::VertexVertex;
            });
        }
        ASSERT_EQ(found.size(), expected.size()) << "self: " << self;
        for (std::size_t i = 0; i < found.size(); ++i) {
          ASSERT_EQ(found[i].ids, expected[i].ids) << "self: " << self;
          expectSame(found[i], expected[i], how);
          if (HasFailure()) break;
        }
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(EveryMethod, UnitIndependence, ::testing::ValuesIn(methodCases(1.0)),
                         [](const auto& method) { return method.param.name; });

using Answer = ExactContacts::Answer;

std::vector<StepScene> scenesOfSteps() {
  Random random(13);
  const Mesh first = soup(random, 30, 0.3), second = soup(random, 30, 0.3);
  const StepScene touching = latticeScene(random);
  return {stepScene("soups", first, second, 0.03),
          stepScene("sheets", sheet(8, 0, 0), sheet(7, 0.02, 1), 0.015),
          stepScene("bodies", sphere(6, 9, {0.5, 0.5, 0.5}, 0.4),
                    sphere(5, 8, {0.6, 0.55, 1.1}, 0.3), 0.03),
          touching};
}

/// Scenes are about 1 in size.
std::vector<Transformation> transformations() {
  const Vector3d direction(0.7, -1, 0.3);
  return {{.name = "metres to millimetres", .scale = 1e3},
          {.name = "millimetres to metres", .scale = 1e-3},
          {.name = "inches", .scale = 25.4, .mirror = {-1, 1, 1}},
          {.name = "moved by 1e4", .translation = 1e4 * direction},
          {.name = "moved by 1e6", .translation = 1e6 * direction},
          {.name = "moved by 1e6, in millimetres, renumbered",
           .scale = 1e3,
           .translation = 1e9 * direction,
           .corners = true,
           .triangles = true,
           .vertices = true,
           .swapped = true}};
}

class InexactTransformations : public ::testing::TestWithParam<MethodCase> {
 protected:
  /// The contacts of scenes at both places, and the counts of their comparison.
  std::size_t m_same = 0, m_different = 0;

  static bool distinct() {
    return GetParam().settings.method == Method::Proximity &&
           GetParam().settings.contacts == Contacts::Distinct;
  }
  static ExactContacts exactly(const StepScene& scene, bool self) {
    PairSettings settings = GetParam().settings;
    settings.thickness *= scene.thickness;
    return {scene, settings, self};
  }
  /// exactly() of the first call: it takes a second, and most comparisons ask for nothing.
  class Lazily {
   public:
    Lazily(const StepScene& scene, bool self) : m_scene(scene), m_self(self) {}
    const ExactContacts& operator()() const {
      if (!m_contacts) m_contacts = std::make_unique<ExactContacts>(exactly(m_scene, m_self));
      return *m_contacts;
    }

   private:
    const StepScene& m_scene;
    const bool m_self;
    mutable std::unique_ptr<ExactContacts> m_contacts;
  };
  static void expectTrue(bool found, Answer answer) {
    EXPECT_TRUE(answer == Answer::Either || found == (answer == Answer::Yes));
  }

  static std::vector<PlainContact> contacts(const Placement& placement, const PairRun& run,
                                            bool self, bool renumbered) {
    auto all = placement.contacts(run, self, GetParam().settings.contacts);
    // By definition one side only is tested: the first mesh's vertices, or the lower vertex.
    if (distinct() && renumbered)
      std::erase_if(all, [](const auto& c) { return c.ids[0] == PlainContact::VertexVertex; });
    return all;
  }

  /// A contact that one placement has and the other lacks must differ in exact arithmetic, too.
  template <class Item, class Check>
  void compare(const std::vector<Item>& own, const std::vector<Item>& other, Check&& check) {
    std::vector<Item> lost, gained;
    std::set_difference(own.begin(), own.end(), other.begin(), other.end(),
                        std::back_inserter(lost));
    std::set_difference(other.begin(), other.end(), own.begin(), own.end(),
                        std::back_inserter(gained));
    m_same += own.size() - lost.size();
    m_different += lost.size() + gained.size();
    const std::size_t step = shareOfCases(127);
    for (std::size_t i = 0; i < lost.size(); i += step) check(lost[i], true);
    for (std::size_t i = 0; i < gained.size(); i += step) check(gained[i], false);
  }

  void compare(const StepScene& scene, Transformation how) {
    how.keepsTriangles = GetParam().settings.method == Method::Intersection;
    const Placement own(scene, {}), other(scene, how);
    const PairRun run = own.run(GetParam().settings), otherRun = other.run(GetParam().settings);
    const StepScene there = placed(scene, how);
    const bool renumbered = how.swapped || how.vertices;
    for (const bool self : {false, true}) {
      const Lazily here(scene, self), thereExactly(there, self);
      compare(contacts(own, run, self, renumbered), contacts(other, otherRun, self, renumbered),
              [&](const PlainContact& c, bool wasFound) {
                SCOPED_TRACE(std::to_string(c.ids[0]) + ": " + std::to_string(c.ids[1]) + " " +
                             std::to_string(c.ids[2]) + " " + std::to_string(c.ids[3]) + " " +
                             std::to_string(c.ids[4]) + ", self: " + std::to_string(self));
                expectTrue(wasFound, here().has(c.ids));
                expectTrue(!wasFound, thereExactly().has(c.ids));
              });
    }
    const Lazily here(scene, false), thereExactly(there, false);
    compare(own.intersectingTriangles(run), other.intersectingTriangles(otherRun),
            [&](const ElementPair& pair, bool wasFound) {
              EXPECT_EQ(here().intersect(pair), wasFound);
              EXPECT_EQ(thereExactly().intersect(pair), !wasFound);
            });
    // Early by up to the tolerance, and early or late by the rounding error over the motion.
    if (GetParam().settings.method == Method::Continuous && scene.name != "lattice") {
      EXPECT_NEAR(otherRun.data().earliestTimeOfImpact(), run.data().earliestTimeOfImpact(), 2e-6);
    }
  }
};

TEST_P(InexactTransformations, ChangeContactsByRoundingOnly) {
  for (const StepScene& scene : scenesOfSteps())
    for (const Transformation& how : transformations()) {
      SCOPED_TRACE(scene.name + ", " + how.name);
      compare(scene, how);
    }
  RecordProperty("same", std::to_string(m_same));
  RecordProperty("different", std::to_string(m_different));
  std::printf("%zu contacts alike, %zu on one side only\n", m_same, m_different);
  if (GetParam().settings.continuous.earliestTimeOnly) return;
  EXPECT_GT(m_same, 1000u);
  // On the lattice everything touches. A minimum distance holds within a tolerance above rounding.
  EXPECT_EQ(m_different > 0u,
            GetParam().settings.method != Method::Continuous || GetParam().settings.thickness == 0);
}

/// Tests the exact reference above: on a sample of all features, reported or not.
TEST_P(InexactTransformations, ExactContactsMatchReportedOnes) {
  if (distinct() || GetParam().settings.continuous.earliestTimeOnly) return;
  std::size_t yes = 0, no = 0;
  for (const StepScene& scene : scenesOfSteps()) {
    if (scene.name != "lattice" && scene.name != "soups") continue;
    SCOPED_TRACE(scene.name);
    const Placement own(scene, {});
    const PairRun run = own.run(GetParam().settings);
    for (const bool self : {false, true}) {
      const ExactContacts exact = exactly(scene, self);
      const auto found = contacts(own, run, self, false);
      const auto check = [&](const PlainContact& c) {
        const bool isFound = std::binary_search(found.begin(), found.end(), c);
        expectTrue(isFound, exact.has(c.ids));
        ++(isFound ? yes : no);
      };
      const bool sampled = GetParam().name == "ContinuousWithThickness";  // many samples each
      for (std::size_t i = 0; i < found.size(); i += sampled ? 40 : 2) check(found[i]);
      const Mesh &a = scene.a, &b = self ? scene.a : scene.b;
      Random random(5);
      const auto below = [&](std::size_t n) { return static_cast<std::uint32_t>(random() % n); };
      for (int i = 0; i < 60; ++i) {
        const Triangle &s = a.triangles[below(a.triangles.size())],
                       &t = b.triangles[below(b.triangles.size())];
        const std::uint32_t corner = below(3), side = below(3);
        const Segment p{std::min(s[corner], s[(corner + 1) % 3]),
                        std::max(s[corner], s[(corner + 1) % 3])},
            q{std::min(t[side], t[(side + 1) % 3]), std::max(t[side], t[(side + 1) % 3])};
        const auto triangle = static_cast<std::uint32_t>(&t - b.triangles.data());
        const auto common = [&](std::uint32_t v, auto&& of) {
          return self && std::find(of.begin(), of.end(), v) != of.end();
        };
        PlainContact c;
        c.ids = {PlainContact::VertexTriangle, s[corner], triangle};
        if (!common(s[corner], t)) check(c);
        c.ids = {PlainContact::EdgeEdge, p[0], p[1], q[0], q[1]};
        if (!common(p[0], q) && !common(p[1], q) && !(self && q < p)) check(c);
      }
    }
  }
  EXPECT_GT(yes, 100u);
  EXPECT_GT(no, 50u);
}

INSTANTIATE_TEST_SUITE_P(EveryMethod, InexactTransformations, ::testing::ValuesIn(methodCases(1.0)),
                         [](const auto& method) { return method.param.name; });

}  // namespace
}  // namespace palpate
