#include "Contact/DistinctShapeContacts.h"

#include <palpate/ConstraintRows.h>
#include <palpate/OctreeBasedCD.h>

#include "Common/DistinctTruth.h"
#include "Common/Sanitized.h"
#include "Common/ShapeTruth.h"
#include "Common/StepBodies.h"
#include "Common/TestGeometry.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <vector>

// Contacts::Distinct of meshes with shapes, against Contacts::All: All has the least distance of
// each vertex, edge and triangle, wherever it is.

namespace palpate::testing {
namespace {

/// n x n squares of the size `edge` around the origin, whose heights a function gives.
template <class Height>
Mesh floorOf(Random& random, int n, double edge, bool irregular, Height&& height) {
  Mesh mesh;
  for (int i = 0; i <= n; ++i)
    for (int j = 0; j <= n; ++j) {
      const bool moves = irregular && i % n != 0 && j % n != 0;
      const double x = (i - 0.5 * n + (moves ? uniform(random, -0.3, 0.3) : 0)) * edge,
                   y = (j - 0.5 * n + (moves ? uniform(random, -0.3, 0.3) : 0)) * edge;
      mesh.positions.push_back({x, y, height(x, y)});
      if (i == n || j == n) continue;
      const auto a = static_cast<std::uint32_t>(i * (n + 1) + j),
                 b = a + static_cast<std::uint32_t>(n) + 1;
      if (irregular && uniform(random, 0, 1) < 0.5) {
        mesh.triangles.push_back({a, b, a + 1});
        mesh.triangles.push_back({a + 1, b, b + 1});
      } else {
        mesh.triangles.push_back({a, b, b + 1});
        mesh.triangles.push_back({a, b + 1, a + 1});
      }
    }
  return mesh;
}
Mesh flatFloor(Random& random, bool irregular, const Matrix3d& turn) {
  Mesh mesh = floorOf(random, 24, 0.25, irregular, [](double, double) { return 0.0; });
  for (Vector3d& p : mesh.positions) p = turn * p;
  return mesh;
}

std::vector<ShapeContact> contactsOf(const Mesh& body, const AnalyticalGeometry& shape,
                                     const PairSettings& settings, const Pose& from,
                                     const Pose& to) {
  const CollisionData data =
      stepOf(settingsOf(Engine::Octree), bodyOf("mesh", testGeometry(body), body.positions),
             shapeOf("shape", shape, from, to), settings);
  return {data.shape().begin(), data.shape().end()};
}

/// One of each type but planes, about as large as 1.
std::vector<AnalyticalGeometry> bodies(Random& random) {
  ConvexHull hull;
  for (int i = 0; i < 20; ++i) hull.points.push_back(randomPoint(random, -1, 1).normalized());
  return {Sphere{Vector3d::Zero(), 1.0},
          Capsule{{-0.8, 0.1, 0}, {0.7, 0.3, 0.2}, 0.4},
          Box{Vector3d::Zero(), {0.8, 0.6, 0.5}},
          Cylinder{{-0.7, 0.1, 0}, {0.7, 0, 0.1}, 0.5},
          hull,
          Sphere{Vector3d::Zero(), 0.0},
          Capsule{{-0.8, 0.1, 0}, {0.7, 0.3, 0.2}, 0.0}};
}

/// How far a shape reaches below its origin, along the last axis of the floor.
double depthOf(const AnalyticalGeometry& shape, const Matrix3d& turn, const Vector3d& up) {
  return reachOf({shape, turn, Vector3d::Zero()}, -up);
}

/// Sine of the angle between a contact's normal and the floor's that is more than rounding, or more
/// than that of a body that lies on the floor.
double tiltOf(const AnalyticalGeometry& shape) {
  return std::holds_alternative<Sphere>(shape) ? 1e-9 : 0x1p-10 + 1e-9;
}

TEST(DistinctShapeContacts, OfAFlatFloorHaveItsNormal) {
  Random random(1);
  std::size_t contacts = 0, impacts = 0, tilted = 0;
  for (const bool irregular : {false, true})
    for (int run = 0; run < 40; ++run) {
      if (isLeftOut(run, 5)) continue;
      const Matrix3d floorTurn = randomTurn(random);
      const Mesh floor = flatFloor(random, irregular, floorTurn);
      const Vector3d up = floorTurn.col(2);
      for (const AnalyticalGeometry& shape : bodies(random))
        for (const Method method : {Method::Proximity, Method::Continuous}) {
          // Every third shape lies as the floor does.
          const Matrix3d turn = run % 3 == 0 ? floorTurn : Matrix3d(randomTurn(random));
          // Deep inside a body with faces that lies askew, normals are those of its nearest faces.
          const bool isRound = shape.index() < 2 && reachOf({shape}, Vector3d::UnitZ()) > 0.3;
          const double height = depthOf(shape, turn, up) + (isRound ? uniform(random, -0.3, 0.06)
                                                                    : uniform(random, 0.02, 0.06));
          const Vector3d at = floorTurn *
                              Vector3d{uniform(random, -1, 1), uniform(random, -1, 1), height},
                         to = at + floorTurn * Vector3d(0.1, 0.05,
                                                        uniform(random, isRound ? -0.1 : -0.02, 0));
          PairSettings settings{method, 0.05};
          const auto distinct = contactsOf(floor, shape, settings, {turn, at}, {turn, to});
          settings.contacts = Contacts::All;
          const auto all = contactsOf(floor, shape, settings, {turn, at}, {turn, to});
          EXPECT_EQ(distinct.empty(), all.empty());
          const auto isTilted = [&](const ShapeContact& c) {
            return c.element != ShapeElement::Face && c.normal.cross(up).norm() > tiltOf(shape);
          };
          for (const ShapeContact& c : distinct) {
            EXPECT_FALSE(isTilted(c)) << shape.index() << ' ' << int(c.element) << ' ' << c.distance
                                      << ' ' << c.normal.cross(up).norm();
            ++contacts;
            impacts += method == Method::Continuous && c.timeOfImpact > 0;
          }
          tilted += std::count_if(all.begin(), all.end(), isTilted);
        }
    }
  EXPECT_GE(contacts, leastOf(1000, 200));
  EXPECT_GE(impacts, leastOf(50, 10));
  EXPECT_GE(tilted, 10 * leastOf(1000, 200));
}

std::set<std::uint32_t> sorted(const Triangle& vertices) {
  return {vertices.begin(), vertices.end()};
}

/// The definition, on flat and other meshes, with motion and without.
TEST(DistinctShapeContacts, MatchTheDefinition) {
  Random random(2);
  Mesh soups = soup(random, 200, 0.4);
  for (Vector3d& p : soups.positions) p = 2 * (p - Vector3d::Constant(0.5));
  const std::vector<Mesh> meshes{
      floorOf(random, 16, 0.2, true, [](double, double) { return 0.0; }),
      floorOf(random, 16, 0.2, false, [](double x, double) { return -std::abs(x); }),
      floorOf(random, 16, 0.2, false, [](double, double y) { return 0.3 * std::abs(y); }),
      floorOf(random, 16, 0.2, true, [&](double, double) { return uniform(random, 0, 0.002); }),
      floorOf(random, 16, 0.2, true, [](double x, double y) { return 0.2 * x * x - 0.1 * y * y; }),
      sphere(10, 14, {0, 0, -1}, 1.0),
      soups};
  std::size_t kept = 0, dropped = 0;
  for (const Mesh& mesh : meshes)
    for (int run = 0; run < 24; ++run)
      for (const AnalyticalGeometry& shape : bodies(random)) {
        if (isLeftOut(run, 5)) continue;
        const Matrix3d turn = run % 3 == 0 ? Matrix3d::Identity() : randomTurn(random);
        const bool steps = run % 2 == 0, turns = run % 4 == 0, bends = run % 8 == 0;
        const Vector3d at{uniform(random, -0.5, 0.5), uniform(random, -0.5, 0.5),
                          depthOf(shape, turn, Vector3d::UnitZ()) + uniform(random, -0.2, 0.1)};
        PlacedShape before{shape, turn, at}, now = before;
        Positions moved = mesh.positions;
        if (steps) now.translation += randomPoint(random, -0.15, 0.15);
        if (turns)
          now.rotation = Eigen::AngleAxisd(0.05, Vector3d::UnitX()).toRotationMatrix() * turn;
        for (Vector3d& p : moved)
          if (bends) p += randomPoint(random, -0.01, 0.01);
        const double thickness = run % 5 == 0 ? 0.3 : 0.1;
        PairSettings settings{steps ? Method::Continuous : Method::Proximity, thickness};
        const auto answerOf = [&](Contacts contacts) {
          settings.contacts = contacts;
          return stepOf(settingsOf(Engine::Octree), bodyOf("mesh", testGeometry(mesh), moved),
                        shapeOf("shape", shape, {before.rotation, before.translation},
                                {now.rotation, now.translation}),
                        settings);
        };
        const CollisionData all = answerOf(Contacts::All), distinct = answerOf(Contacts::Distinct);
        std::vector<ConstraintRow> rows;
        appendRows(all, {0, mesh.positions, moved}, {}, rows,
                   {{before.rotation, before.translation}, {now.rotation, now.translation}});
        std::vector<ShapeContact> candidates;
        std::vector<double> gaps;
        for (std::size_t i = 0; i < rows.size(); ++i) {
          const ShapeContact& c = all.shape()[i];
          // Contacts::All of Proximity also has elements with a vertex or an edge that is as near.
          // If that is in another place, the shape lies along the element, and rounding decides.
          bool isOnBoundary = false, isAlong = false;
          for (const ShapeContact& part : all.shape()) {
            if (part.element >= c.element || part.distance > c.distance + 1e-13 ||
                !std::ranges::includes(sorted(c.vertices), sorted(part.vertices)))
              continue;
            const bool isThere = (part.pointOnShape - c.pointOnShape).norm() <= 1e-7;
            (isThere ? isOnBoundary : isAlong) = true;
          }
          const bool isReported = std::ranges::find(distinct.shape(), c) != distinct.shape().end();
          if (!steps && (isOnBoundary || (isAlong && !isReported))) continue;
          candidates.push_back(c);
          gaps.push_back(rows[i].gap(moved));
        }
        const DistinctTruth truth{
            mesh.positions, moved, mesh.triangles, 0.0,
            before,         now,   thickness,      settings.continuous.timeTolerance};
        const std::vector<char> stays = truth.kept(candidates, gaps);
        std::vector<ShapeContact> expected;
        for (std::size_t i = 0; i < stays.size(); ++i) {
          if (stays[i]) expected.push_back(candidates[i]);
          (stays[i] ? kept : dropped) += 1;
        }
        EXPECT_TRUE(std::ranges::equal(distinct.shape(), expected))
            << "shape " << shape.index() << ", run " << run << ": " << distinct.shape().size()
            << " of " << candidates.size() << ", expected " << expected.size();
        EXPECT_EQ(distinct.shape().empty(), all.shape().empty());
      }
  EXPECT_GE(kept, leastOf(1000));
  EXPECT_GE(dropped, leastOf(1000));
}

/// An upright prism over a regular polygon, with its lower rim first, at z = 0.
Mesh prism(std::uint32_t n) {
  Mesh mesh;
  for (const double height : {0.0, 20.0})
    for (std::uint32_t i = 0; i < n; ++i) {
      const double angle = 2 * M_PI * i / n;
      mesh.positions.push_back({10 * std::cos(angle), 10 * std::sin(angle), height});
    }
  for (std::uint32_t i = 0; i < n; ++i) {
    const std::uint32_t j = (i + 1) % n;
    mesh.triangles.push_back({i, j, n + j});
    mesh.triangles.push_back({i, n + j, n + i});
    if (i == 0 || j == 0) continue;
    mesh.triangles.push_back({0, j, i});
    mesh.triangles.push_back({n, n + i, n + j});
  }
  return mesh;
}

/// A wall at the rim, seen along the floor, is on one side or on the other by rounding.
TEST(DistinctShapeContacts, OfARimOnAFlatSideStayWhateverTheTilt) {
  Random random(9);
  ConvexHull hull;
  for (int i = 0; i < 8; ++i)
    hull.points.push_back({i & 1 ? 100. : -100., i & 2 ? 100. : -100., i & 4 ? 0. : -20.});
  const std::vector<AnalyticalGeometry> tables{Box{{0, 0, -10}, {100, 100, 10}},
                                               Cylinder{{0, 0, -20}, {0, 0, 0}, 100}, hull};
  const PairSettings settings{Method::Proximity, 0.5};
  for (const std::uint32_t n : {4u, 6u, 8u, 32u}) {
    const Mesh body = prism(n);
    for (const AnalyticalGeometry& table : tables)
      for (const double tilt : {0.0, 1e-9, 1e-6, 1e-4})
        for (int run = 0; run < casesOf(40); ++run) {
          const double angle = uniform(random, -tilt, tilt), x = uniform(random, -1, 1);
          const Vector3d axis = Vector3d(x, uniform(random, -1, 1), 0).normalized();
          const Matrix3d turn = (Eigen::AngleAxisd(angle, axis) *
                                 Eigen::AngleAxisd(uniform(random, -3, 3), Vector3d::UnitZ()))
                                    .toRotationMatrix();
          const Vector3d at(0.3, 0.1, -0.05);
          std::set<std::uint32_t> corners;
          for (const ShapeContact& c : contactsOf(body, table, settings, {turn, at}, {turn, at}))
            if (c.element == ShapeElement::Vertex) corners.insert(c.id);
          EXPECT_EQ(corners.size(), n) << "table " << table.index() << ", tilt " << angle;
        }
  }
}

/// A cylinder that turns over a regular grid comes near whole triangles at their corners.
TEST(DistinctShapeContacts, OfACylinderThatTurnsOverAFlatFloorHaveItsNormal) {
  Random random(6);
  const Mesh floor = floorOf(random, 20, 1.0, false, [](double, double) { return 0.0; });
  const Cylinder cylinder{{-2, 0, 0}, {2, 0, 0}, 1.0};
  std::size_t contacts = 0;
  for (const Method method : {Method::Continuous, Method::Auto})
    for (const double gap : {0.1, 0.001})
      for (const double start : {0.0, 0.1, 0.37, 0.9})
        for (const double turn : {0.05, 0.1, 0.3})
          for (const double thickness : {0.2, 0.5}) {
            const auto turnBy = [](double angle) -> Matrix3d {
              return Eigen::AngleAxisd(angle, Vector3d::UnitZ()).toRotationMatrix();
            };
            const Vector3d at(0.25, 0.125, 1 + gap);
            for (const ShapeContact& c :
                 contactsOf(floor, cylinder, {method, thickness}, {turnBy(start), at},
                            {turnBy(start + turn), at})) {
              ++contacts;
              EXPECT_LE(c.normal.cross(Vector3d::UnitZ()).norm(), tiltOf(cylinder));
            }
          }
  EXPECT_GT(contacts, 300u);
}

/// A body that stands in a floor, or touches it: several of its surfaces may be equally near to an
/// edge or a triangle. The one that lies along it counts, and no contact leads to a side.
TEST(DistinctShapeContacts, OfABodyThatStandsInAFloorLeadOut) {
  Random random(8);
  std::size_t contacts = 0;
  for (int run = 0; run < casesOf(60); ++run) {
    const Matrix3d floorTurn = run % 3 == 0 ? Matrix3d::Identity() : Matrix3d(randomTurn(random));
    const Vector3d up = floorTurn.col(2);
    Mesh floor = run % 2 ? floorOf(random, 24, 0.3, false, [](double, double) { return 0.0; })
                         : floorOf(random, 1, 7.2, false, [](double, double) { return 0.0; });
    for (Vector3d& p : floor.positions) p = floorTurn * p;
    const Vector3d axis{uniform(random, -1, 1), uniform(random, -1, 1), 0};
    for (const double tilt : {0.0, 1e-9, 0.02}) {
      const Matrix3d turn = floorTurn *
                            Eigen::AngleAxisd(tilt, axis.normalized()).toRotationMatrix() *
                            Eigen::AngleAxisd(uniform(random, 0, 6), Vector3d::UnitZ());
      for (const AnalyticalGeometry& shape : std::vector<AnalyticalGeometry>{
               Box{{0, 0, 0}, {1, 0.7, 0.5}}, Cylinder{{0, 0, -0.5}, {0, 0, 0.5}, 0.7},
               Cylinder{{-1, 0, 0}, {1, 0, 0}, 0.4},
               ConvexHull{{{1, 0, -0.4}, {-1, 0, -0.4}, {0, 1, -0.4}, {0, -1, -0.4}, {0, 0, 1}}}})
        for (const double depth : {0.0, 1e-14, 1e-9, 1e-3, 0.05}) {
          const Vector3d at = floorTurn * Vector3d{uniform(random, -1, 1), uniform(random, -1, 1),
                                                   depthOf(shape, turn, up) - depth};
          bool separates = false;
          for (const ShapeContact& c :
               contactsOf(floor, shape, {Method::Proximity, 0.02}, {turn, at}, {turn, at})) {
            const bool leadsOut = c.normal.dot(up) < -0.998;
            EXPECT_TRUE(leadsOut) << shape.index() << ' ' << tilt << ' ' << depth;
            separates = separates || leadsOut;
            ++contacts;
          }
          EXPECT_TRUE(separates) << shape.index() << ' ' << tilt << ' ' << depth;
        }
    }
  }
  EXPECT_GE(contacts, leastOf(20000));
}

}  // namespace
}  // namespace palpate::testing
