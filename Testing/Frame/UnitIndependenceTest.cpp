#include <palpate/FeaturePairs.h>

#include "Common/PairRun.h"
#include "Common/DegenerateCases.h"
#include "Frame/Placement.h"

#include <gtest/gtest.h>

#include <cmath>

// Contacts do not depend on the unit of length, on where the scene is, or on how its elements are
// numbered.

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

}  // namespace
}  // namespace palpate
