#include "Math/MeetingAfter.h"

#include "Unit/Math/TrianglePairs.h"

#include "Math/ClosestPoint.h"
#include "Math/StableLength.h"

#include <gtest/gtest.h>

namespace palpate::test {
namespace {

using Eigen::Vector3d;
using Kind = ImpactQuery::Kind;

/// From the second feature to the first, at their closest points.
Vector3d differenceAt(const ImpactQuery& query, double time) {
  const auto at = [&](std::size_t i) -> Vector3d {
    return (1.0 - time) * query.vertices[i].before + time * query.vertices[i].now;
  };
  return query.kind == Kind::VertexTriangle
             ? finiteVertexTriangleDistance(at(0), at(1), at(2), at(3)).difference
             : finiteEdgeEdgeDistance(at(0), at(1), at(2), at(3)).difference;
}
bool mayMeet(const ImpactQuery& query, double time, double radii) {
  const Vector3d difference = differenceAt(query, time);
  return mayMeetAfter(query, time, stableUnit(difference), difference.norm(), radii);
}

/// Law: false is certain. Of random steps, some end without and some with a meeting.
TEST(MeetingAfter, FeaturesThatMeetAreNotCalledApart) {
  Random random(7);
  for (const Kind kind : {Kind::VertexTriangle, Kind::EdgeEdge}) {
    int apart = 0, meet = 0;
    for (int repeat = 0; repeat < 20000; ++repeat) {
      ImpactQuery query{kind, {}};
      for (ImpactQuery::Step& step : query.vertices) {
        step.before = random.inCube();
        step.now = step.before + 0.7 * random.inCube();
      }
      const double time = 0.1 * random.below(9), radii = 0.02 * random.below(3);
      double least = 1.0;
      for (int i = 0; i <= 64; ++i)
        least = std::min(least, differenceAt(query, time + (1.0 - time) * i / 64).norm());
      if (mayMeet(query, time, radii)) {
        ++meet;
      } else {
        ++apart;
        ASSERT_GT(least, radii) << repeat;
      }
    }
    EXPECT_GT(apart, 5000);
    EXPECT_GT(meet, 500);
  }
}

ImpactQuery vertexOverTriangle(const Vector3d& before, const Vector3d& now) {
  const Vector3d a(0, 0, 0), b(1, 0, 0), c(0, 1, 0);
  return {Kind::VertexTriangle, {{{before, now}, {a, a}, {b, b}, {c, c}}}};
}

TEST(MeetingAfter, KnowsPassagesAndSlides) {
  const Vector3d above(0.2, 0.2, 0.1);
  EXPECT_TRUE(mayMeet(vertexOverTriangle(above, {0.2, 0.2, -0.1}), 0.0, 0.0)) << "passes";
  EXPECT_TRUE(mayMeet(vertexOverTriangle({0.2, 0.2, 0}, above), 0.0, 0.0)) << "touches at first";
  EXPECT_FALSE(mayMeet(vertexOverTriangle(above, {0.4, 0.2, 0.1}), 0.0, 0.0)) << "slides";
  EXPECT_FALSE(mayMeet(vertexOverTriangle(above, {-2, 0.2, -0.1}), 0.0, 0.0)) << "past the edge";
  EXPECT_TRUE(mayMeet(vertexOverTriangle(above, {0.2, 0.2, 0.01}), 0.0, 0.02)) << "within radii";
}

}  // namespace
}  // namespace palpate::test
