#include <palpate/OctreeBasedCD.h>

#include "Common/PairRun.h"
#include "Common/Sanitized.h"
#include "Common/ShapeTruth.h"
#include "Common/StepBodies.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <vector>

// Method::Continuous of two shapes, against bounds on their distance along the step. Points of both
// shapes bound it from above, a separating direction from below.

namespace palpate::testing {
namespace {

/// A shape at both ends of a step. The points that define it move linearly.
struct MovingShape {
  AnalyticalGeometry geometry;
  std::array<PlacedShape, 2> ends;

  MovingShape(const AnalyticalGeometry& shape, const Matrix3d& turnBefore, const Vector3d& before,
              const Matrix3d& turn, const Vector3d& now)
      : geometry(shape), ends{{{shape, turnBefore, before}, {shape, turn, now}}} {}
  MovingShape(const AnalyticalGeometry& shape, const Vector3d& before, const Vector3d& now)
      : MovingShape(shape, Matrix3d::Identity(), before, Matrix3d::Identity(), now) {}

  bool isPlane() const { return std::holds_alternative<Plane>(geometry); }
  Vector3d at(const Vector3d& p, double t) const {
    const auto end = [&](const PlacedShape& e) -> Vector3d {
      return e.rotation * p + e.translation;
    };
    return (1 - t) * end(ends[0]) + t * end(ends[1]);
  }
  /// The furthest point along a unit direction; for a plane, any of its points.
  Vector3d furthest(const Vector3d& m, double t) const {
    if (const auto* plane = std::get_if<Plane>(&geometry)) return at(plane->point, t);
    if (const auto* cylinder = std::get_if<Cylinder>(&geometry)) {
      const Vector3d p = at(cylinder->p0, t), q = at(cylinder->p1, t), axis = (q - p).normalized();
      const Vector3d across = axis.cross(m).cross(axis);
      return (m.dot(p) > m.dot(q) ? p : q) +
             (across.norm() > 1e-12 ? cylinder->radius : 0) * across.normalized();
    }
    double radius = 0;
    std::array<std::vector<Vector3d>, 2> corners{cornersOf(ends[0], radius),
                                                 cornersOf(ends[1], radius)};
    Vector3d best = Vector3d::Zero();
    double most = -std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < corners[0].size(); ++i) {
      const Vector3d p = (1 - t) * corners[0][i] + t * corners[1][i];
      if (m.dot(p) > most) most = m.dot(p), best = p;
    }
    return best + radius * m;
  }
  Vector3d normalAt(double t) const {
    const auto& plane = std::get<Plane>(geometry);
    const Vector3d along = plane.normal.unitOrthogonal(), across = plane.normal.cross(along),
                   origin = at(plane.point, t);
    return (at(plane.point + along, t) - origin)
        .cross(at(plane.point + across, t) - origin)
        .normalized();
  }
  /// L: a bound on the motion of every point.
  double motion() const {
    double most = 0;
    for (const Vector3d& p : {Vector3d(1, 1, 1), Vector3d(-1, -1, -1), Vector3d(1, -1, 1),
                              Vector3d(-1, 1, 1), Vector3d(1, 1, -1), Vector3d(0, 0, 0)})
      most = std::max(most, (at(p, 1) - at(p, 0)).norm());
    return 2 * most;
  }
};

struct Bounds {
  double lower, upper;
};

/// Bounds on the distance at a time. They are refined until both are on one side of `enough`, or
/// near each other.
///
/// Source   pairwise Frank and Wolfe steps: Lacoste-Julien, Jaggi, On the global linear convergence
/// of Frank-Wolfe optimization variants (2015).
Bounds distanceAt(const MovingShape& a, const MovingShape& b, double t, double enough) {
  if (b.isPlane()) return distanceAt(b, a, t, enough);
  if (const auto* plane = std::get_if<Plane>(&a.geometry)) {
    const Vector3d n = a.normalAt(t), origin = a.at(plane->point, t);
    double height = n.dot(b.furthest(-n, t) - origin);
    if (plane->twoSided) height = std::max(height, n.dot(origin - b.furthest(n, t)));
    return {height, height};
  }
  struct Atom {
    Vector3d point;
    double weight;
  };
  const auto difference = [&](const Vector3d& m) -> Vector3d {
    return a.furthest(m, t) - b.furthest(-m, t);
  };
  std::vector<Atom> atoms{{difference(Vector3d::UnitX()), 1.0}};
  Vector3d v = atoms[0].point;
  Bounds bounds{-std::numeric_limits<double>::infinity(), v.norm()};
  for (int i = 0; i < 400; ++i) {
    bounds.upper = std::min(bounds.upper, v.norm());
    if (!(v.norm() > 1e-12)) return {0, 0};
    const Vector3d towards = difference(-v.normalized());
    bounds.lower = std::max(bounds.lower, v.normalized().dot(towards));
    if (bounds.lower > enough || bounds.upper <= enough || bounds.upper - bounds.lower < 1e-10)
      break;
    const auto away = std::max_element(
        atoms.begin(), atoms.end(),
        [&](const Atom& l, const Atom& r) { return v.dot(l.point) < v.dot(r.point); });
    const Vector3d step = towards - away->point;
    const double most = away->weight,
                 length = std::clamp(-v.dot(step) / step.squaredNorm(), 0.0, most);
    away->weight -= length;
    if (length == most) atoms.erase(away);
    const auto known =
        std::find_if(atoms.begin(), atoms.end(), [&](const Atom& k) { return k.point == towards; });
    if (known != atoms.end())
      known->weight += length;
    else
      atoms.push_back({towards, length});
    v = Vector3d::Zero();
    for (const Atom& atom : atoms) v += atom.weight * atom.point;
  }
  return bounds;
}

PairSettings continuousPair(double thickness, double timeTolerance = 1e-6) {
  PairSettings pair{Method::Continuous, thickness};
  pair.continuous.timeTolerance = timeTolerance;
  return pair;
}

CollisionData answer(const MovingShape& a, const MovingShape& b, const PairSettings& pair,
                     Engine engine = Engine::Octree) {
  const auto asBody = [](const MovingShape& shape) {
    const auto& [before, now] = shape.ends;
    return shapeOf("shape", shape.geometry, {before.rotation, before.translation},
                   {now.rotation, now.translation});
  };
  const CollisionData data = stepOf(settingsOf(engine), asBody(a), asBody(b), pair);
  EXPECT_LE(data.shapeShape().size(), 1u);
  return data;
}

std::optional<ShapeShapeContact> contactOf(const CollisionData& data) {
  if (data.shapeShape().empty()) return {};
  return data.shapeShape()[0];
}

/// Expects that a contact within the step has its stated distance, between points of both shapes.
void expectContact(const MovingShape& a, const MovingShape& b, const ShapeShapeContact& c,
                   const PairSettings& pair) {
  const double motion = a.motion() + b.motion(),
               early = pair.continuous.timeTolerance * motion + 1e-12;
  EXPECT_NEAR(c.normal.norm(), 1, 1e-13);
  EXPECT_LE((c.pointA - c.pointB - c.distance * c.normal).norm(), 1e-12);
  EXPECT_LE(c.distance, pair.thickness + early);
  EXPECT_GE(c.distance, pair.thickness - 1e-12);
  const double t = c.timeOfImpact, slack = 1e-7;
  for (const auto& [tool, point, out] :
       {std::tuple{&a, c.pointA, Vector3d(-c.normal)}, std::tuple{&b, c.pointB, c.normal}}) {
    if (const auto* plane = std::get_if<Plane>(&tool->geometry)) {
      EXPECT_NEAR(tool->normalAt(t).dot(point - tool->at(plane->point, t)), 0, 1e-12);
      EXPECT_NEAR(
          plane->twoSided ? tool->normalAt(t).cross(out).norm() : (tool->normalAt(t) - out).norm(),
          0, 1e-12);
      continue;
    }
    // It is the furthest of its shape along the normal.
    EXPECT_NEAR(out.dot(tool->furthest(out, t) - point), 0, slack);
    Random random(1);
    for (int i = 0; i < 40; ++i) {
      const Vector3d m = randomPoint(random, -1, 1).normalized();
      EXPECT_LE(m.dot(point - tool->furthest(m, t)), 1e-12) << "the point is outside";
    }
  }
}

struct PairTally {
  int none = 0, before = 0, within = 0;
};

void expectTrueContacts(const MovingShape& a, const MovingShape& b, const PairSettings& pair,
                        PairTally& tally) {
  const CollisionData data = answer(a, b, pair);
  const auto c = contactOf(data);
  ++(!c ? tally.none : c->timeOfImpact > 0 ? tally.within : tally.before);
  const double time = c ? c->timeOfImpact : 1.0;
  if (c && time > 0) expectContact(a, b, *c, pair);
  if (c && time == 0) {
    EXPECT_LE(distanceAt(a, b, 0, pair.thickness + 1e-9).lower,
              pair.thickness + pair.continuous.timeTolerance * (a.motion() + b.motion()) + 1e-9);
  }
  constexpr int kSamples = 25;
  for (int i = 0; i <= kSamples && time > 0; ++i) {
    // Samples are spread evenly over the step up to then, and denser towards it.
    for (const double t : {time * i / kSamples, time * (1 - std::exp2(-0.8 * i))})
      EXPECT_GT(distanceAt(a, b, t, pair.thickness - 1e-9).upper, pair.thickness - 1e-9)
          << "nearer before, at " << t << " of " << time;
  }
  const auto back = contactOf(answer(b, a, pair));
  ASSERT_EQ(back.has_value(), c.has_value());
  if (c) {
    EXPECT_EQ(back->timeOfImpact, c->timeOfImpact);
    EXPECT_EQ(back->distance, c->distance);
    EXPECT_EQ(back->normal, -c->normal);
    EXPECT_EQ(back->pointA, c->pointB);
    EXPECT_EQ(back->pointB, c->pointA);
  }
  EXPECT_EQ(answer(a, b, pair, Engine::BruteForce).hash(), data.hash());
  PairSettings earliest = pair;
  earliest.continuous.earliestTimeOnly = true;
  for (const Engine engine : {Engine::Octree, Engine::BruteForce}) {
    const CollisionData only = answer(a, b, earliest, engine);
    EXPECT_TRUE(only.shapeShape().empty());
    EXPECT_EQ(only.earliestTimeOfImpact(), data.earliestTimeOfImpact());
    EXPECT_EQ(only.earliestTimeOfImpact(), c ? time : std::numeric_limits<double>::infinity());
  }
}

TEST(ShapePairSteps, TimesAreNeverLateAndEarlyByTheToleranceAtMost) {
  Random random(1);
  PairTally tally;
  std::size_t number = 0;
  for (int run = 0; run < 6; ++run) {
    const std::vector<AnalyticalGeometry> all = shapesOfEveryKind(random);
    for (std::size_t i = 0; i < all.size(); ++i)
      for (std::size_t j = 0; j <= i; ++j) {
        if (std::holds_alternative<Plane>(all[i]) && std::holds_alternative<Plane>(all[j]))
          continue;
        if (isLeftOut(number++)) continue;
        SCOPED_TRACE("run " + std::to_string(run) + ", kinds " + std::to_string(i) + " and " +
                     std::to_string(j));
        const auto toolOf = [&](const AnalyticalGeometry& shape, double from) {
          const Matrix3d turn = randomTurn(random);
          const Vector3d at = from * randomPoint(random, -1, 1).normalized();
          Vector3d past = -uniform(random, 0, 2) * at;
          past += 0.2 * randomPoint(random, -1, 1);
          const double angle = run % 2 ? uniform(random, 0, 2.8) : 0.0;
          const Matrix3d further =
              run % 2 ? Matrix3d(Eigen::AngleAxisd(angle, randomPoint(random, -1, 1).normalized())
                                     .toRotationMatrix() *
                                 turn)
                      : turn;
          return MovingShape(shape, turn, at, further, past);
        };
        const double from = run == 5 ? 0.1 : 0.8;
        const MovingShape first = toolOf(all[i], from), second = toolOf(all[j], from);
        expectTrueContacts(first, second,
                           continuousPair(run % 3 ? 0.03 : 0.0, run == 4 ? 1e-3 : 1e-6), tally);
      }
  }
  const auto least = static_cast<int>(leastOf(100));
  EXPECT_GT(tally.none, least);
  EXPECT_GT(tally.before, least);
  EXPECT_GT(tally.within, least);
}

/// Shapes that are parallel, in one plane or on one line, on a grid.
TEST(ShapePairSteps, DegenerateShapesHaveCorrectTimes) {
  Random random(2);
  const std::vector<AnalyticalGeometry> all = degenerateShapes();
  PairTally tally;
  const Matrix3d turns[] = {Matrix3d::Identity(),
                            Eigen::AngleAxisd(EIGEN_PI / 2, Vector3d::UnitZ()).toRotationMatrix(),
                            Eigen::DiagonalMatrix<double, 3>(1, -1, -1) * Matrix3d::Identity()};
  for (std::size_t i = 0; i < all.size(); ++i)
    for (std::size_t j = 0; j <= i; ++j)
      for (int run = 0; run < 4; ++run) {
        if (std::holds_alternative<Plane>(all[i]) && std::holds_alternative<Plane>(all[j]))
          continue;
        const auto grid = [&](int size) {
          return static_cast<double>(random() % (2 * size + 1)) - size;
        };
        const double x = grid(4), y = grid(4), z = run < 2 ? 0 : grid(4);
        const double u = grid(4), v = grid(4), w = run < 2 ? 0 : grid(4);
        SCOPED_TRACE("kinds " + std::to_string(i) + " and " + std::to_string(j) + ", run " +
                     std::to_string(run));
        // After half of a half turn, a plane has no extent and a cylinder no length.
        const Matrix3d& turn = turns[run == 3 ? random() % 2 : 0];
        expectTrueContacts(MovingShape(all[i], {0, 0, 0}, {0, 0, 0}),
                           MovingShape(all[j], Matrix3d::Identity(), {x, y, z}, turn, {u, v, w}),
                           continuousPair(run % 2 ? 0.5 : 0), tally);
      }
  EXPECT_GT(tally.none, 30);
  EXPECT_GT(tally.before, 30);
  EXPECT_GT(tally.within, 30);
}

TEST(ShapePairSteps, MatchHandComputedValues) {
  const Vector3d zero = Vector3d::Zero(), up = Vector3d::UnitZ();
  const MovingShape ball(Sphere{{0, 0, 0}, 1}, zero, zero), floor(Plane{}, zero, zero),
      table(Box{{0, 0, -1}, {5, 5, 1}}, zero, zero),
      sheet(Plane{{0, 0, 0}, {0, 0, 1}, true}, up, -up);
  const auto falling = [&](const AnalyticalGeometry& shape, double from, double to) {
    return MovingShape(shape, from * up, to * up);
  };
  struct Row {
    MovingShape a, b;
    double thickness, time;
    Vector3d normal;
  };
  for (const auto& [a, b, thickness, time, normal] : {
           Row{falling(Sphere{zero, 1}, 500, -500), ball, 0, 0.498, up},  // fast, and out again
           Row{falling(Sphere{zero, 1}, 500, -500), ball, 0.25, 0.49775, up},
           Row{falling(Box{zero, {1, 1, 1}}, 5, -5), floor, 0, 0.4, up},
           Row{falling(Box{zero, {1, 1, 1}}, 5, -5), table, 0, 0.4, up},
           Row{falling(Cylinder{-up, up, 0.5}, 5, -5), floor, 0, 0.4, up},
           Row{falling(Cylinder{-up, up, 0.5}, 5, -5), table, 0, 0.4, up},
           Row{falling(Cylinder{{-1, 0, 0}, {1, 0, 0}, 1}, 5, -5), floor, 0, 0.4, up},
           Row{falling(Cylinder{{-1, 0, 0}, {1, 0, 0}, 1}, 5, -5), table, 0, 0.4, up},
           Row{falling(Sphere{zero, 0.5}, -3, 3), sheet, 0, 3.5 / 8, -up},  // from below
       }) {
    SCOPED_TRACE(std::to_string(a.geometry.index()) + " on " + std::to_string(b.geometry.index()));
    const auto c = contactOf(answer(a, b, continuousPair(thickness)));
    ASSERT_TRUE(c);
    EXPECT_LE(c->timeOfImpact, time);
    EXPECT_NEAR(c->timeOfImpact, time, 1e-6);
    EXPECT_NEAR((c->normal - normal).norm(), 0, 1e-12);
    EXPECT_NEAR(c->distance, thickness, 1e-3);
  }
  // Past each other at a little more, and a little less, than the thickness.
  for (const double gap : {1e-5, -1e-5}) {
    const MovingShape past(Sphere{zero, 1}, {-9, 0, 2.5 + gap}, {9, 0, 2.5 + gap});
    EXPECT_EQ(answer(past, ball, continuousPair(0.5)).shapeShape().size(), gap < 0) << gap;
  }
  // Within the thickness at the start: a contact at time 0, with all fields of Proximity.
  const auto start = contactOf(answer(MovingShape(Box{zero, {1, 1, 1}}, {0.25, 0, 1.5}, {0, 0, 9}),
                                      ball, continuousPair(0.125)));
  ASSERT_TRUE(start);
  EXPECT_EQ(start->timeOfImpact, 0);
  EXPECT_NEAR(start->distance, -0.5, 1e-13);
}

}  // namespace
}  // namespace palpate::testing
