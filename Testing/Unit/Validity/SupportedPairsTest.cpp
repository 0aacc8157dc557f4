#include "Validity/Support.h"

#include "Common/Sanitized.h"
#include "Common/StepBodies.h"
#include "Common/SupportedMethods.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

// The table of support: what it has is accepted, and every row answers as brute force does, with
// any number of threads. A new row gets these tests.

namespace palpate::testing {
namespace {

class SupportedPairsOf : public ::testing::TestWithParam<std::size_t> {};

TEST_P(SupportedPairsOf, AnswerAsBruteForceWithAnyNumberOfThreads) {
  const SupportedPairs& row = kSupport[GetParam()];
  // A surface proxy takes a tenth of a second to build, so that fewer cases of it run.
  const std::size_t step = row.kind == PairKind::Proxy ? 7 : 1;
  std::size_t number = 0, contacts = 0;
  for (const double motion : {0.0, 0.05}) {
    Random random(91);
    std::vector<StepBody> all = bodiesOfEveryType(random, motion);
    for (StepBody& body : bodiesWithField(Vector3d::Constant(-motion)))
      all.push_back(std::move(body));
    for (const StepBody& a : all)
      for (const StepBody& b : all) {
        if (!answers(row, a, b)) continue;
        for (int i = 0; i < 2; ++i, ++number) {
          if (number % step != 0 || isLeftOut(number / step)) continue;
          SCOPED_TRACE(a.name + " with " + b.name + ", motion " + std::to_string(motion) +
                       ", case " + std::to_string(number));
          const CollisionData truth = expectEveryEngine(a, b, caseOf(row, number));
          contacts += Rows(truth).contacts() + truth.shape().size() + truth.shapeShape().size() +
                      (truth.earliestTimeOfImpact() <= 1);
          if (HasFailure()) return;
        }
      }
  }
  EXPECT_GT(contacts, leastOf(50));
}

INSTANTIATE_TEST_SUITE_P(EveryRow, SupportedPairsOf,
                         ::testing::Range(std::size_t{0}, std::size(kSupport)),
                         [](const auto& row) {
                           return std::string(toString(kSupport[row.param].method)) +
                                  std::to_string(row.param);
                         });

/// Every method and every two types of geometries without a field, with tetrahedral meshes at last.
TEST(SupportedPairs, AreThoseThatTheCodeAccepts) {
  const Positions some{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  const std::vector<GeometryType> types{GeometryType::Triangles, GeometryType::Lines,
                                        GeometryType::Points, GeometryType::Shape,
                                        GeometryType::Triangles};
  const std::vector<AnalyticalGeometry> shapes{
      Sphere{},
      Capsule{},
      Plane{},
      Box{{0, 0, 0}, {1, 1, 1}},
      Cylinder{{0, 0, 0}, {0, 0, 1}, 1},
      ConvexHull{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}}};
  const auto add = [&](OctreeBasedCD& detection, std::size_t type,
                       const AnalyticalGeometry& shape) {
    if (type == 4) return detection.addTetrahedralMesh(some, std::vector<Tetrahedron>{});
    if (type == 3) return detection.addAnalyticalGeometry(shape);
    return TestGeometry{types[type], some, {{0, 1, 2}}, {{0, 1}}}.addTo(detection);
  };
  const auto accepts = [&](Method method, std::size_t a, std::size_t b, bool itself,
                           const AnalyticalGeometry& shape) {
    OctreeBasedCD detection;
    const GeometryId first = add(detection, a, shape), second = add(detection, b, Sphere{});
    try {
      PairSettings settings{method, 1.0};
      if (method == Method::Proxy) settings.allowedError = 1.0;
      detection.addCollisionPair(first, itself ? first : second, settings);
      return true;
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::UnsupportedMethod);
      return false;
    }
  };
  for (const Method method :
       {Method::Intersection, Method::Proximity, Method::Continuous, Method::Proxy, Method::Auto})
    for (std::size_t a = 0; a < types.size(); ++a)
      for (std::size_t b = 0; b < types.size(); ++b)
        for (const AnalyticalGeometry& shape : shapes) {
          SCOPED_TRACE(std::string(toString(method)) + std::to_string(10 * a + b));
          for (const bool itself : {false, true}) {
            if (itself && a != b) continue;
            EXPECT_EQ(accepts(method, a, b, itself, shape),
                      supportOf(method, types[a], types[b], itself) != nullptr);
          }
          if (types[a] != GeometryType::Shape) break;
        }
}

}  // namespace
}  // namespace palpate::testing
