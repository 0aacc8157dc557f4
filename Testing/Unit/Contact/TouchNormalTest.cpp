#include <palpate/ConstraintRows.h>
#include <palpate/OctreeBasedCD.h>

#include "Math/ClosestPoint.h"
#include "Common/DegenerateCases.h"
#include "Common/RandomMeshes.h"
#include "Common/Sanitized.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace palpate {
namespace {

using Eigen::Vector3d;
using testing::dividedBox, testing::Mesh;

/// A flat square of n x n squares in the plane z = 0, wound up.
Mesh plate(int n, double halfSide) {
  return testing::moved(testing::flat(n, 0), {-halfSide, -halfSide, 0}, 2 * halfSide);
}

struct Case {
  const char* name;
  Mesh a, b;
  Vector3d apart;  ///< unit: the direction in which a leaves b
};

/// Bodies that touch in a face, in part of one, or in an edge of a corner; moved apart by the gap.
std::vector<Case> restingBodies(double gap) {
  const Vector3d x = Vector3d::UnitX(), y = Vector3d::UnitY(), z = Vector3d::UnitZ();
  const Mesh unit = dividedBox({0, 0, 0}, {1, 1, 1});
  const auto box = [&](Vector3d lower, Vector3d upper, const Vector3d& apart, int n = 1) {
    return dividedBox(lower + gap * apart, upper + gap * apart, n);
  };
  return {{"on a table", box({-.5, -.5, 0}, {.5, .5, 1}, z), plate(1, 2), z},
          {"on a table that is wound down", box({-.5, -.5, 0}, {.5, .5, 1}, z),
           testing::insideOut(plate(1, 2)), z},
          {"on a fine table", box({-.5, -.5, 0}, {.5, .5, 1}, z, 3), plate(8, 2), z},
          {"common face across x", box({1, 0, 0}, {2, 1, 1}, x), unit, x},
          {"common face across y", box({0, 1, 0}, {1, 2, 1}, y), unit, y},
          {"common face across z", box({0, 0, 1}, {1, 1, 2}, z), unit, z},
          {"common face of small triangles", box({0, 0, 1}, {1, 1, 2}, z, 4),
           dividedBox({0, 0, 0}, {1, 1, 1}, 4), z},
          {"half of a face", box({.5, 0, 1}, {1.5, 1, 2}, z), unit, z},
          {"inside a face", box({.25, .25, 1}, {.75, .75, 2}, z), unit, z}};
}

struct TouchAnswer {
  std::vector<ConstraintRow> rows;
  Validity validity;
  bool intersects;
};
TouchAnswer touchAnswerOf(const Case& bodies, const PairSettings& settings) {
  OctreeBasedCD collisions(Settings{.threads = 1});
  const GeometryId a = collisions.addTriangleMesh(bodies.a.positions, bodies.a.triangles),
                   b = collisions.addTriangleMesh(bodies.b.positions, bodies.b.triangles);
  collisions.addCollisionPair(a, b, settings);
  collisions.detectCollision();
  const CollisionData& data = collisions.collisionData(a, b);
  TouchAnswer answer{{}, data.validity(), !data.intersectingTriangles().empty()};
  const auto first = static_cast<std::uint32_t>(bodies.a.positions.size());
  appendRows(data, {0, bodies.a.positions, bodies.a.positions},
             {first, bodies.b.positions, bodies.b.positions}, answer.rows);
  return answer;
}

/// How far a row moves a along `apart`, for a unit of force: 1 if it only separates.
double separation(const ConstraintRow& row, const Case& bodies) {
  double weight = 0;
  for (std::size_t i = 0; i < 4; ++i)
    if (row.vertices[i] < bodies.a.positions.size()) weight += row.weights[i];
  return weight * row.normal.dot(bodies.apart);
}

std::vector<PairSettings> everyMethod() {
  std::vector<PairSettings> all;
  for (const Contacts contacts : {Contacts::Distinct, Contacts::All})
    for (const Method method : {Method::Auto, Method::Proximity, Method::Continuous})
      all.push_back({.method = method, .thickness = 0.05, .contacts = contacts});
  return all;
}

/// Law: bodies that touch without piercing have the contacts that they have a little apart, and
/// each separates them.
TEST(TouchNormal, RestingBodiesAreOnlyPushedApart) {
  const std::vector<Case> touching = restingBodies(0), apart = restingBodies(1e-12);
  for (const PairSettings& settings : everyMethod())
    for (std::size_t i = 0; i < touching.size(); ++i) {
      SCOPED_TRACE(std::string(touching[i].name) + ", method " +
                   std::to_string(static_cast<int>(settings.method)) + ", contacts " +
                   std::to_string(static_cast<int>(settings.contacts)));
      const auto& [rows, validity, intersects] = touchAnswerOf(touching[i], settings);
      EXPECT_FALSE(validity.startedApart);
      EXPECT_FALSE(validity.trusted);
      EXPECT_EQ(rows.size(), touchAnswerOf(apart[i], settings).rows.size());
      EXPECT_FALSE(rows.empty());
      // Which side an open surface has is not known to contacts between its edges and a face.
      const double least = i == 1 && settings.contacts == Contacts::All ? -2 : 1 - 1e-12;
      for (const ConstraintRow& row : rows) EXPECT_GE(separation(row, touching[i]), least);
    }
}

/// A cone from its tip at 0 to a circle in the plane z = height, of n triangles; wound outward.
Mesh cone(std::uint32_t n, double radius, double height) {
  Mesh mesh{{{0, 0, 0}}, {}};
  for (std::uint32_t i = 0; i < n; ++i) {
    const double angle = 2 * 3.14159265358979323846 * i / n;
    mesh.positions.push_back({radius * std::cos(angle), radius * std::sin(angle), height});
    const std::uint32_t p = i + 1, q = (i + 1) % n + 1;
    mesh.triangles.push_back(height > 0 ? Triangle{0, q, p} : Triangle{0, p, q});
  }
  return mesh;
}

/// Law: where two tips meet, each row separates all triangles of both, however many there are.
TEST(TouchNormal, TipsInManyTrianglesAreSeparated) {
  for (const std::uint32_t n : {5u, 16u, 17u, 40u, 200u}) {
    SCOPED_TRACE(n);
    const Case tips{"tips", cone(n, 3.0, 1.0), cone(n, 0.2, -1.0), Vector3d::UnitZ()};
    for (const Method method : {Method::Auto, Method::Proximity}) {
      SCOPED_TRACE(static_cast<int>(method));
      const auto rows = touchAnswerOf(tips, {.method = method, .thickness = 0.01}).rows;
      EXPECT_FALSE(rows.empty());
      for (const ConstraintRow& row : rows) {
        const Vector3d up = row.normal * (separation(row, tips) < 0 ? -1 : 1);
        for (const Vector3d& p : tips.a.positions) EXPECT_GE(up.dot(p), -1e-12);
        for (const Vector3d& p : tips.b.positions) EXPECT_LE(up.dot(p), 1e-12);
        EXPECT_GT(separation(row, tips), 0);
      }
    }
  }
}

/// Law: bodies that overlap by an aligned translation are in intersection, although their triangles
/// only touch.
TEST(TouchNormal, AlignedOverlapIsNoRest) {
  for (const double overlap : {0.1, 0.3, 0.7}) {
    const Case bodies{"", dividedBox({1 - overlap, 0, 0}, {2 - overlap, 1, 1}),
                      dividedBox({0, 0, 0}, {1, 1, 1}), Vector3d::UnitX()};
    const TouchAnswer answer = touchAnswerOf(bodies, {.thickness = 0.01});
    EXPECT_FALSE(answer.validity.startedApart);
    EXPECT_TRUE(answer.intersects) << overlap;
  }
}

/// The contacts of a step with one moving geometry, against where the features came from. wrong:
/// those that push on; across: the first ones of a step that do not hold back, but for two
/// vertices, whose triangles no direction in their plane may separate. Later ones may slide.
struct Sides {
  int contacts = 0, wrong = 0, across = 0;
};

template <class Add>
void countSides(const std::array<std::vector<Vector3d>, 2>& before,
                const std::array<std::vector<Vector3d>, 2>& now, Method method, Add&& add,
                Sides& sides) {
  OctreeBasedCD collisions(Settings{.threads = 1});
  const GeometryId a = add(collisions, before[0]), b = add(collisions, before[1]);
  collisions.addCollisionPair(a, b, {.method = method});
  collisions.setPositions(a, before[0], now[0]);
  collisions.setPositions(b, before[1], now[1]);
  collisions.detectCollision();
  const CollisionData& data = collisions.collisionData(a, b);
  const auto count = [&](const auto& contact, const std::array<std::size_t, 4>& of) {
    const Stencil s = stencil(contact);
    Vector3d motion = Vector3d::Zero();
    for (std::size_t i = 0; i < 4; ++i)
      motion += s.weights[i] * (now[of[i]][s.vertices[i]] - before[of[i]][s.vertices[i]]);
    const double approach = -motion.dot(contact.normal) / motion.norm();
    ++sides.contacts;
    sides.wrong += approach < -1e-6;
    const bool areVertices = std::count_if(s.weights.begin(), s.weights.end(), [](double weight) {
                               return std::abs(weight) > 1e-9;
                             }) == 2;
    const bool isFirst = contact.timeOfImpact <= data.earliestTimeOfImpact() + 1e-5;
    sides.across += isFirst && !areVertices && std::abs(approach) <= 1e-6;
  };
  for (const auto& c : data.vertexTriangle()) count(c, {0, 1, 1, 1});
  for (const auto& c : data.triangleVertex()) count(c, {1, 0, 0, 0});
  for (const auto& c : data.edgeEdge()) count(c, {0, 0, 1, 1});
}

GeometryId addLine(OctreeBasedCD& collisions, const std::vector<Vector3d>& positions) {
  return collisions.addLineMesh(positions, std::vector<Segment>{{0, 1}});
}
GeometryId addTriangle(OctreeBasedCD& collisions, const std::vector<Vector3d>& positions) {
  return collisions.addTriangleMesh(positions, std::vector<Triangle>{{0, 1, 2}});
}

/// Positions on a lattice, so that edges stay exactly parallel and motion stays in one plane.
class TouchSides : public ::testing::TestWithParam<Method> {
 protected:
  int between(int low, int high) {
    return low + static_cast<int>(m_random() % static_cast<unsigned>(high - low + 1));
  }
  Vector3d vector(int most) {
    return {static_cast<double>(between(-most, most)), static_cast<double>(between(-most, most)),
            static_cast<double>(between(-most, most))};
  }
  static std::vector<Vector3d> moved(std::vector<Vector3d> positions, const Vector3d& by) {
    for (Vector3d& p : positions) p += by;
    return positions;
  }
  void expectOnTheirSides(const Sides& sides, int contacts) const {
    EXPECT_GT(sides.contacts, contacts);
    EXPECT_EQ(sides.wrong, 0);
    EXPECT_EQ(sides.across, 0);
  }

 private:
  testing::Random m_random{5};
};

/// Law: where edges are parallel throughout the step, the first normals are on the side from which
/// they came.
TEST_P(TouchSides, OfParallelEdgesAreWhereTheyCameFrom) {
  Sides lines, triangles;
  for (int i = 0; i < testing::casesOf(1000); ++i) {
    const Vector3d u = vector(8), at = vector(4), w = vector(9);
    if (w.cross(u).isZero()) continue;
    std::vector<Vector3d> a{at, at + u};
    std::vector<Vector3d> b = moved(a, 0.25 * between(-3, 3) * u - w);
    countSides({a, b}, {a, moved(b, 2 * w)}, GetParam(), addLine, lines);
    const Vector3d across = w - w.dot(u) / u.squaredNorm() * u;
    const auto rounded = [](const Vector3d& p) { return Vector3d(p.array().round()); };
    a.push_back(rounded(at + across + 0.1 * between(-9, 9) * u.cross(across)));
    b.push_back(rounded(b[0] - across + 0.1 * between(-9, 9) * u.cross(across)));
    countSides({a, b}, {a, moved(b, 2 * w)}, GetParam(), addTriangle, triangles);
  }
  expectOnTheirSides(lines, 800 / testing::kShareOfCases);
  expectOnTheirSides(triangles, 2000 / testing::kShareOfCases);
}

/// Law: motion within one plane first has normals in that plane. Features that leave a surface
/// slide along it.
TEST_P(TouchSides, OfMotionInOnePlaneAreInThePlane) {
  Sides sides;
  for (int i = 0; i < testing::casesOf(1000); ++i) {
    const Vector3d e = vector(4), f = vector(4);
    if (e.cross(f).isZero()) continue;
    const auto at = [&](double centre) {
      const double alongE = centre + between(-4, 4), alongF = between(-4, 4);
      return Vector3d(alongE * e + alongF * f);
    };
    const std::vector<Vector3d> a{at(-10), at(-10), at(-10)}, b{at(10), at(10), at(10)};
    if (!hasArea(a[0], a[1], a[2]) || !hasArea(b[0], b[1], b[2])) continue;
    countSides({a, b}, {a, moved(b, -24 * e + between(-3, 3) * f)}, GetParam(), addTriangle, sides);
  }
  expectOnTheirSides(sides, 2000 / testing::kShareOfCases);
}

/// Collinear segments that meet end to end, and ends that meet.
TEST_P(TouchSides, OfEndsThatMeetAreWhereTheyCameFrom) {
  Sides sides;
  for (int i = 0; i < 500; ++i) {
    const Vector3d u = vector(8), w = vector(9), v = vector(9);
    if (u.isZero() || v.isZero() || w.cross(u).isZero()) continue;
    const std::vector<Vector3d> a{Vector3d::Zero(), u}, behind{2 * u, 3 * u},
        end = moved({u, u + v}, -w);
    countSides({a, behind}, {a, moved(behind, -1.5 * u)}, GetParam(), addLine, sides);
    countSides({a, end}, {a, moved(end, 2 * w)}, GetParam(), addLine, sides);
  }
  expectOnTheirSides(sides, 800);
}

INSTANTIATE_TEST_SUITE_P(Methods, TouchSides, ::testing::Values(Method::Continuous, Method::Auto));

}  // namespace
}  // namespace palpate
