#include "Common/ExpectRefused.h"
#include "Common/QueryCalls.h"
#include "Common/Solids.h"
#include "Common/TestGeometry.h"

#include <palpate/OctreeBasedCD.h>
#include <palpate/PenetrationTracker.h>

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <map>

namespace palpate::testing {
namespace {

using Corners = std::array<Vector3d, 3>;

/// A body that moves and deforms, and points in and around it.
struct Story {
  std::vector<Triangle> triangles;
  std::vector<Positions> body, points;  ///< by frame, in the world
};

Corners at(const Story& story, std::size_t frame, const Triangle& t) {
  const Positions& p = story.body[frame];
  return {p[t[0]], p[t[1]], p[t[2]]};
}

Vector3d weighted(const Corners& c, const Vector3d& w) {
  return w[0] * c[0] + w[1] * c[1] + w[2] * c[2];
}

/// The transform of a triangle's edge and normal from one frame to the next.
Eigen::Matrix3d turn(const Corners& before, const Corners& now) {
  const auto axes = [](const Corners& c) {
    Eigen::Matrix3d m;
    m.col(0) = (c[1] - c[0]).normalized();
    m.col(2) = m.col(0).cross(c[2] - c[0]).normalized();
    m.col(1) = m.col(2).cross(m.col(0));
    return m;
  };
  return axes(now) * axes(before).transpose();
}

/// The distance along a ray at which the surface is first hit, by each triangle's plane. met:
/// certainly.
double firstMet(const Story& story, std::size_t frame, const Vector3d& p, const Vector3d& u,
                bool certainly) {
  double first = std::numeric_limits<double>::infinity();
  const double slack = certainly ? -1e-9 : 1e-9;
  for (const Triangle& triangle : story.triangles) {
    const auto [a, b, c] = at(story, frame, triangle);
    Eigen::Matrix3d m;
    m << a - b, a - c, u;
    const Vector3d x = m.fullPivLu().solve(a - p);
    if (!(std::abs(m.determinant()) > 1e-12)) continue;
    if (x[0] >= -slack && x[1] >= -slack && x[0] + x[1] <= 1 + slack && x[2] > 0)
      first = std::min(first, x[2]);
  }
  return first;
}

struct Tally {
  std::map<DirectionChange, std::size_t> changes;
  double largestTurn = 0;  ///< beyond the body's motion, but not reported
};

using Answers = std::vector<std::vector<TrackedVertex>>;

Answers answers(const Settings& settings, const Story& story) {
  OctreeBasedCD detection(settings);
  const GeometryId body = detection.addTriangleMesh(story.body[0], story.triangles),
                   points = detection.addPointSet(story.points[0]);
  PenetrationTracker tracker(points, body);
  Answers all;
  for (std::size_t frame = 0; frame < story.body.size(); ++frame) {
    detection.setPositions(body, story.body[frame]);
    detection.setPositions(points, story.points[frame]);
    const std::vector<InsideVertex> truth = testing::insideVertices(detection, points, body);
    const auto found = tracker.update(detection.queries());
    all.emplace_back(found.begin(), found.end());
    EXPECT_EQ(found.size(), truth.size());
    for (std::size_t i = 0; i < found.size(); ++i) EXPECT_EQ(found[i].nearest, truth[i]);
    if (frame % 3 == 0) detection.detectCollision();         // which is nothing to it
    const auto again = tracker.update(detection.queries());  // of the same step
    EXPECT_TRUE(std::equal(again.begin(), again.end(), all.back().begin(), all.back().end()));
    detection.advance();
  }
  return all;
}

/// Compares every change with the definition and the guarantee: turns beyond the body's motion are
/// reported, and nothing else is.
Tally expectDefined(const Story& story, const Answers& all) {
  constexpr double kSlack = 1e-9;
  Tally tally;
  for (std::size_t frame = 0; frame < all.size(); ++frame) {
    std::map<std::uint32_t, TrackedVertex> last;
    if (frame > 0)
      for (const TrackedVertex& f : all[frame - 1]) last.emplace(f.penetration.vertex, f);
    for (const TrackedVertex& f : all[frame]) {
      const Vector3d p = story.points[frame][f.penetration.vertex];
      ++tally.changes[f.change];
      EXPECT_EQ(f.penetration.vertex, f.nearest.vertex);
      EXPECT_LE(f.penetration.depth,
                TrackedVertex::kMaxDepthRatio * f.nearest.depth * (1 + kSlack));
      EXPECT_GE(f.penetration.depth, f.nearest.depth * (1 - kSlack));
      EXPECT_NEAR(f.penetration.direction.norm(), 1, 1e-12);
      EXPECT_EQ(f.penetration.vertices, story.triangles[f.penetration.triangle]);
      const Vector3d exit =
          weighted(at(story, frame, f.penetration.vertices), f.penetration.weights);
      EXPECT_LT((p + f.penetration.depth * f.penetration.direction - exit).norm(), 1e-9);
      const auto before = last.find(f.penetration.vertex);
      EXPECT_EQ(f.change == DirectionChange::Entered, before == last.end());
      if (f.change != DirectionChange::Kept) {
        EXPECT_EQ(f.penetration, f.nearest);
      }
      if (before == last.end()) continue;
      const InsideVertex& old = before->second.penetration;
      const Corners then = at(story, frame - 1, old.vertices), now = at(story, frame, old.vertices);
      const Eigen::Matrix3d turned = turn(then, now);
      const Vector3d direction = turned * old.direction,
                     moved = (p - weighted(now, old.weights)) -
                             turned * (story.points[frame - 1][f.penetration.vertex] -
                                       weighted(then, old.weights));
      const double explained = moved.norm() / std::sqrt(old.depth * f.nearest.depth);
      const double excess = (f.penetration.direction - direction).norm() - explained,
                   nearestExcess = (f.nearest.direction - direction).norm() - explained;
      if (f.change == DirectionChange::Jumped) {
        EXPECT_GE(excess, TrackedVertex::kMaxTurn - kSlack);
        EXPECT_GT(firstMet(story, frame, p, direction, true),
                  TrackedVertex::kMaxDepthRatio * f.nearest.depth * (1 - kSlack));
      } else {
        EXPECT_LE(excess, TrackedVertex::kMaxTurn + kSlack);
        tally.largestTurn = std::max(tally.largestTurn, excess);
      }
      if (f.change == DirectionChange::Kept) {
        EXPECT_GE(nearestExcess, TrackedVertex::kMaxTurn - kSlack);
        EXPECT_LT((f.penetration.direction - direction).norm(), 1e-9);
        EXPECT_GT(f.penetration.depth * (1 + kSlack), firstMet(story, frame, p, direction, false));
        EXPECT_LT(f.penetration.depth * (1 - kSlack), firstMet(story, frame, p, direction, true));
      }
    }
  }
  return tally;
}

/// Bodies with sharp edges, notches and a hollow, round ones, and two slabs with a crack between.
std::vector<Mesh> bodies(Random& random) {
  Mesh slabs = surfaceMeshOf(cells(3, random, [](const auto& c) { return c[2] != 1; }));
  for (Vector3d& p : slabs.positions) p.z() -= p.z() > 1.5 ? 0.9 : 0.0;
  return {slabs, surfaceMeshOf(cells(2, random)),
          surfaceMeshOf(cells(3, random, [](const auto& c) { return c[2] == 0 || c[0] == 0; })),
          surfaceMeshOf(cells(3, random,
                              [](const auto& c) {
                                return c != std::array{1, 1, 1};
                              })),
          sphere(8, 12, {1.5, 1.5, 1.5}, 1.4)};
}

/// Points that move through a body at rest, and points at rest in a body that turns and deforms.
TEST(PenetrationTracker, ReportsLargeChanges) {
  for (const bool isAtRest : {true, false}) {
    Random random(isAtRest ? 1 : 2);
    std::map<DirectionChange, std::size_t> changes;
    for (const Mesh& mesh : bodies(random)) {
      Story story{mesh.triangles, {}, {}};
      Positions points, steps;
      for (int i = 0; i < 80; ++i) {
        points.push_back(randomPoint(random, -0.5, 3));
        steps.push_back(randomPoint(random, -1, 1) * (i % 2 ? 0.02 : 0.1));
      }
      const Vector3d axis = randomPoint(random, -1, 1).normalized(), middle(1.5, 1.5, 1.5);
      for (int frame = 0; frame < 60; ++frame) {
        Positions body = mesh.positions;
        const Eigen::Matrix3d rotation = Eigen::AngleAxisd(0.03 * frame, axis).toRotationMatrix();
        for (std::size_t i = 0; isAtRest && i < points.size(); ++i)
          points[i] += steps[i] + randomPoint(random, -0.003, 0.003);
        for (Vector3d& p : body) {
          if (isAtRest) break;
          p.z() *= 1 + 0.2 * std::sin(0.2 * frame + p.x());
          p = rotation * (p - middle) + middle + Vector3d(0.02 * frame, 0, 0);
        }
        story.body.push_back(body);
        story.points.push_back(points);
      }
      const Answers all = answers(settingsOf(Engine::Octree), story);
      for (const auto& [change, count] : expectDefined(story, all).changes)
        changes[change] += count;
      if (isAtRest) continue;
      for (const Settings& settings :
           {settingsOf(Engine::BruteForce), settingsOf(Engine::Octree, 2, OctreeUpdate::Rebuild)})
        EXPECT_EQ(answers(settings, story), all);
    }
    EXPECT_GT(changes[DirectionChange::Entered], 100u);
    EXPECT_GT(changes[DirectionChange::None], 2000u);
    EXPECT_GT(changes[DirectionChange::Kept], 50u);
    EXPECT_GT(changes[DirectionChange::Jumped], 10u);
  }
}

/// A block pushed slowly through a slab, trembling. The penetration direction leads back until that
/// is twice as far as ahead, then ahead. It changes once for each vertex.
TEST(PenetrationTracker, PushedBodyChangesSidesOnce) {
  Random random(3);
  const Mesh slab = surfaceMeshOf(cells(1, random)), block = surfaceMeshOf(cells(2, random));
  Story story{slab.triangles, {}, {}};
  for (int frame = 0; frame < 400; ++frame) {
    Positions body = slab.positions, points = block.positions;
    for (Vector3d& p : body) p = Vector3d(40 * p.x() - 20, 40 * p.y() - 20, p.z());
    for (Vector3d& p : points)
      p = 0.05 * p + Vector3d(1, 2, -0.15 + 0.003 * frame) + randomPoint(random, -0.004, 0.004);
    story.body.push_back(body);
    story.points.push_back(points);
  }
  const Answers all = answers(settingsOf(Engine::Octree), story);
  const Tally tally = expectDefined(story, all);
  EXPECT_LT(tally.largestTurn, 1e-9);
  std::map<std::uint32_t, std::size_t> jumps;
  for (std::size_t frame = 0; frame < all.size(); ++frame)
    for (const TrackedVertex& f : all[frame]) {
      const bool on = f.penetration.direction.z() > 0;
      EXPECT_NEAR(std::abs(f.penetration.direction.z()), 1, 1e-12);
      jumps[f.penetration.vertex] += f.change == DirectionChange::Jumped;
      EXPECT_EQ(on, jumps[f.penetration.vertex] == 1);
      if (f.change == DirectionChange::Jumped) {
        EXPECT_NEAR(story.points[frame][f.penetration.vertex].z(), 2.0 / 3.0, 0.01);
      }
    }
  EXPECT_EQ(jumps.size(), 27u);
  for (const auto& [vertex, count] : jumps) EXPECT_EQ(count, 1u);
}

/// Each tracker by itself and for one object. It restarts with new topology and vertices that come
/// back, and a call that throws leaves it unchanged.
TEST(PenetrationTracker, KeepsItsOwnState) {
  const Mesh mesh = sphere(6, 8, {0, 0, 0}, 1);
  const Positions points{{0.5, 0, 0}, {0, 0, 5}};
  OctreeBasedCD first, second;
  GeometryId body{}, probes{}, others{};
  for (OctreeBasedCD* each : {&first, &second}) {
    body = each->addTriangleMesh(mesh.positions, mesh.triangles);
    probes = each->addPointSet(points);
    others = each->addPointSet(points);
  }
  PenetrationTracker tracker(probes, body), other(others, body), itself(body, body);
  const auto change = [](PenetrationTracker& of, OctreeBasedCD& object) {
    const auto found = of.update(object.queries());
    EXPECT_EQ(found.size(), 1u);
    object.advance();
    return found.front().change;
  };
  using enum DirectionChange;
  EXPECT_EQ(change(tracker, first), Entered);
  EXPECT_EQ(change(tracker, first), None);
  EXPECT_EQ(change(other, first), Entered);
  EXPECT_EQ(change(tracker, first), None);
  first.setTriangles(body, mesh.positions, mesh.triangles);
  EXPECT_EQ(change(tracker, first), Entered);
  first.setPositions(probes, Positions{{5, 0, 0}, {0, 0, 5}});
  EXPECT_TRUE(tracker.update(first.queries()).empty());
  first.advance();
  first.setPositions(probes, points);
  EXPECT_EQ(change(tracker, first), Entered);
  first.removeGeometry(others);
  EXPECT_EQ(change(tracker, first), None);
  EXPECT_THROW(other.update(first.queries()), Error);
  EXPECT_THROW(itself.update(first.queries()), Error);
  EXPECT_EQ(change(tracker, second), Entered);
  const SpatialQueries old = second.queries();
  second.advance();
  EXPECT_THROW(tracker.update(old), Error);
  PenetrationTracker moved = std::move(tracker);
  EXPECT_EQ(change(moved, second), None);
  expectRefused(ErrorCode::InvalidCall, "moved from", [&] { tracker.update(second.queries()); });
}

}  // namespace
}  // namespace palpate::testing
