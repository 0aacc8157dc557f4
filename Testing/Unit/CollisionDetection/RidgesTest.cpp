#include <palpate/ConstraintRows.h>

#include "Common/TestGeometry.h"

#include <limits>
#include <string>

// Contacts::Distinct where a straight body lies across an edge of a bent surface: a solver that
// meets all rows keeps the body away from the edge.

namespace palpate::testing {
namespace {

constexpr double kRadius = 0.25, kThickness = 0.2, kGap = 0.1;

/// Two triangles at an edge, each of which falls away from it by an angle.
struct Roof {
  Positions positions;
  std::vector<Triangle> triangles{{0, 1, 2}, {1, 0, 3}};

  Roof(double left, double right)
      : positions{{0, -2, 0},
                  {0, 2, 0},
                  {-2 * std::cos(left), 0.3, -2 * std::sin(left)},
                  {2 * std::cos(right), -0.2, -2 * std::sin(right)}} {}
};

double leastGap(const Positions& line, const Roof& roof) {
  OctreeBasedCD collisions(settingsOf(Engine::BruteForce));
  const GeometryId a = collisions.addLineMesh(line, std::vector<Segment>{{0, 1}}, kRadius),
                   b = collisions.addTriangleMesh(roof.positions, roof.triangles);
  return collisions.queries().distance(a, b).distance;
}

/// Moves the two ends until no row has a smaller gap than kGap.
void meet(const std::vector<ConstraintRow>& rows, const Roof& roof, Positions& line) {
  Positions all = line;
  all.insert(all.end(), roof.positions.begin(), roof.positions.end());
  for (int iteration = 0; iteration < 400; ++iteration)
    for (const ConstraintRow& row : rows) {
      double mass = 0;
      for (int i = 0; i < 4; ++i)
        if (row.vertices[i] < 2) mass += row.weights[i] * row.weights[i];
      const double missing = kGap - row.gap(all);
      if (missing <= 0 || mass == 0) continue;
      for (int i = 0; i < 4; ++i)
        if (row.vertices[i] < 2)
          all[row.vertices[i]] += missing / mass * row.weights[i] * row.normal;
    }
  line.assign(all.begin(), all.begin() + 2);
}

struct Outcome {
  std::size_t edges;  ///< contacts of two edges
  double gap;
};
Outcome outcomeOf(const Roof& roof, const Positions& before, Positions now,
                  const PairSettings& settings) {
  OctreeBasedCD collisions;
  const GeometryId mesh = collisions.addTriangleMesh(roof.positions, roof.triangles),
                   line = collisions.addLineMesh(before, std::vector<Segment>{{0, 1}}, kRadius);
  collisions.addCollisionPair(mesh, line, settings);
  collisions.setPositions(line, before, now);
  collisions.detectCollision();
  const CollisionData& data = collisions.collisionData(mesh, line);
  EXPECT_TRUE(data.validity().trusted);
  std::vector<ConstraintRow> rows;
  appendRows(data, {2, roof.positions, roof.positions}, {0, before, now}, rows);
  meet(rows, roof, now);
  return {data.edgeEdge().size(), leastGap(now, roof)};
}

TEST(Ridges, AreKeptAwayFromByMetRows) {
  Random random(1);
  int excluded = 0;
  for (int run = 0; run < casesOf(400); ++run) {
    const double bend = 0.025 * (run % 5), turn = uniform(random, -0.02, 0.02);
    const Roof roof(bend + turn, bend - turn);
    // As steep as one of the faces, or almost so: that face is nearer than the edge.
    const double slope = (run % 2 ? bend + turn : turn - bend) + uniform(random, -0.01, 0.01),
                 height = kRadius + uniform(random, 0.8, 1.0) * kGap,
                 y = uniform(random, -0.4, 0.4);
    const Positions now{{-1, -y, height - slope}, {0.9, y, height + 0.9 * slope}};
    Positions before = now;
    for (Vector3d& p : before) p[2] += uniform(random, 0.01, 0.05);
    for (const Method method : {Method::Proximity, Method::Continuous, Method::Auto}) {
      PairSettings settings{method, kThickness};
      const Outcome distinct = outcomeOf(roof, before, now, settings);
      settings.contacts = Contacts::All;
      const Outcome all = outcomeOf(roof, before, now, settings);
      const std::string name = std::to_string(run) + ' ' + std::to_string(int(method));
      EXPECT_GE(distinct.gap, kGap - kThickness / 128) << name;
      EXPECT_GE(all.gap, kGap - kThickness / 128) << name;
      EXPECT_EQ(distinct.edges > 0, bend > 0) << name;
      excluded += bend == 0 && all.edges > 0;
    }
  }
  EXPECT_GE(excluded, 100 / kShareOfCases);  // on flat surfaces
}

}  // namespace
}  // namespace palpate::testing
