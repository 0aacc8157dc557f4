#include <palpate/StepGuard.h>

#include <palpate/TimeOfImpact.h>

#include "Common/Solids.h"
#include "Common/TestGeometry.h"

#include <cmath>
#include <limits>

namespace palpate::testing {
namespace {

/// Geometries with their pairs, and a step.
struct Guarding {
  std::vector<TestGeometry> bodies{};
  std::vector<std::array<std::size_t, 2>> pairs{};
  std::vector<Positions> before{}, now{};

  void add(TestGeometry body) {
    before.push_back(body.positions);
    now.push_back(body.positions);
    bodies.push_back(std::move(body));
  }
  /// The ids are the indices of the bodies.
  StepGuard guard(const Settings& settings) const {
    StepGuard guard(settings);
    for (const TestGeometry& body : bodies) {
      if (body.type == GeometryType::Triangles)
        guard.addTriangleMesh(body.positions, body.triangles);
      else if (body.type == GeometryType::Lines)
        guard.addLineMesh(body.positions, body.segments);
      else
        guard.addPointSet(body.positions);
    }
    for (const auto& [a, b] : pairs) guard.addCollisionPair(idOf(a), idOf(b));
    return guard;
  }
  static GeometryId idOf(std::size_t body) { return GeometryId{static_cast<std::uint32_t>(body)}; }
  std::vector<GuardedStep> steps(std::vector<Positions>& ends) const {
    std::vector<GuardedStep> all;
    for (std::size_t i = 0; i < bodies.size(); ++i) all.push_back({idOf(i), before[i], ends[i]});
    return all;
  }
};

/// Whether vertices of a touch triangles of b, or, with edges, edges those of b. Computed from the
/// definition.
std::size_t countTouches(const Guarding& all, std::size_t a, std::size_t b, bool edges,
                         const std::vector<Positions>& now) {
  const TimeOfImpactSettings coarse{.timeTolerance = 1.0};
  std::size_t touches = 0;
  const auto start = [&](std::size_t body, std::uint32_t v) { return all.before[body][v]; };
  const auto end = [&](std::size_t body, std::uint32_t v) { return now[body][v]; };
  if (!edges) {
    for (std::uint32_t v = 0; v < now[a].size(); ++v)
      for (const auto& [i, j, k] : all.bodies[b].triangles) {
        if (a == b && (v == i || v == j || v == k)) continue;
        touches += vertexTriangleTimeOfImpact(start(a, v), start(b, i), start(b, j), start(b, k),
                                              end(a, v), end(b, i), end(b, j), end(b, k), coarse)
                       .has_value();
      }
    return touches;
  }
  for (const auto& [p, q] : all.bodies[a].edges())
    for (const auto& [i, j] : all.bodies[b].edges()) {
      if (a == b && (p == i || p == j || q == i || q == j)) continue;
      touches += edgeEdgeTimeOfImpact(start(a, p), start(a, q), start(b, i), start(b, j), end(a, p),
                                      end(a, q), end(b, i), end(b, j), coarse)
                     .has_value();
    }
  return touches;
}

std::size_t countTouches(const Guarding& all, const std::vector<Positions>& now) {
  std::size_t touches = 0;
  for (const auto& [a, b] : all.pairs)
    touches += countTouches(all, a, b, false, now) + countTouches(all, b, a, false, now) +
               countTouches(all, a, b, true, now);
  return touches;
}

Guarding everything(Random& random) {
  Guarding all;
  all.add(testGeometry(sphere(6, 8, {0.53, 0.46, 0.51}, 0.3)));
  all.add(testGeometry(sheet(6, 0.5, 0.3)));
  all.add(testGeometry(soup(random, 30, 0.1)));
  TestGeometry line = thread(random, 40, 0.1, 0.0, false);
  // The walk ends at the cube's faces, and segments that lie in one plane may touch at the start.
  line.positions = moved(random, line.positions, 0.01);
  all.add(line);
  all.add(particles(random, 40, 0.0));
  for (std::size_t a = 0; a < all.bodies.size(); ++a)
    for (std::size_t b = a; b < all.bodies.size(); ++b) all.pairs.push_back({a, b});
  return all;
}

std::vector<GuardedVertex> changed(const std::vector<Positions>& given,
                                   const std::vector<Positions>& now) {
  std::vector<GuardedVertex> vertices;
  for (std::size_t body = 0; body < given.size(); ++body)
    for (std::uint32_t v = 0; v < given[body].size(); ++v)
      if (given[body][v] != now[body][v]) vertices.push_back({Guarding::idOf(body), v});
  return vertices;
}

TEST(StepGuard, NoImpactRemainsBetweenGeometriesOfAllTypes) {
  Random random(181);
  for (const double most : {0.02, 0.1, 0.4}) {
    Guarding all = everything(random);
    std::vector<StepGuard> guards;
    for (const Settings& settings : {settingsOf(Engine::Octree, 1), settingsOf(Engine::Octree, 8),
                                     settingsOf(Engine::BruteForce, 1)})
      guards.push_back(all.guard(settings));
    for (int step = 0; step < 3; ++step) {
      std::vector<Positions> given = all.before;
      for (Positions& positions : given) positions = moved(random, positions, most);
      if (step == 2) given[0] = all.before[0];  // at rest where it was held, and not set
      EXPECT_GT(countTouches(all, given), 0u);
      std::vector<std::vector<Positions>> ends(guards.size(), given);
      for (std::size_t i = 0; i < guards.size(); ++i) {
        std::vector<GuardedStep> steps = all.steps(ends[i]);
        if (step == 2) steps.erase(steps.begin());
        if (i == 1) std::reverse(steps.begin(), steps.end());
        const std::size_t held = guards[i].hold(steps);
        EXPECT_EQ(held, guards[i].held().size());
        EXPECT_LE(guards[i].rounds(), held + 1);
        const auto vertices = changed(given, ends[i]);
        EXPECT_TRUE(std::ranges::equal(guards[i].held(), vertices));
        for (const auto& [body, v] : vertices) {
          const auto index = static_cast<std::size_t>(body);
          EXPECT_EQ(ends[i][index][v], all.before[index][v]);
        }
        EXPECT_EQ(ends[i], ends[0]) << "guard " << i;
      }
      EXPECT_GT(guards[0].held().size(), 0u);
      EXPECT_EQ(countTouches(all, ends[0]), 0u) << "moved " << most << ", step " << step;
      all.before = ends[0];
    }
  }
}

TEST(StepGuard, NoImpactRemainsOnSurfacesOfTetrahedralMeshes) {
  Random random(182);
  Solid cube = cells(2, random, [](const std::array<int, 3>&) { return true; });
  const Positions points{{0.9, 0.8, 2.5}};
  StepGuard guard;
  const GeometryId solid = guard.addTetrahedralMesh(cube.positions, cube.tetrahedra),
                   drops = guard.addPointSet(points);
  guard.addCollisionPair(solid, drops);
  Positions raised = cube.positions, fallen{{0.9, 0.8, 1.5}};
  for (Vector3d& p : raised) p.z() += 0.25;
  const Positions given = raised;
  EXPECT_GT(guard.hold(std::array{GuardedStep{solid, cube.positions, raised},
                                  GuardedStep{drops, points, fallen}}),
            1u);
  EXPECT_EQ(fallen, points);
  for (std::size_t v = 0; v < given.size(); ++v) {
    if (cube.positions[v] != Vector3d(1, 1, 1)) continue;
    EXPECT_EQ(raised[v], given[v]) << "no vertex of the surface";
  }
  // After a cut that leaves one tetrahedron, the point may fall through the removed part.
  guard.setTetrahedra(solid, raised, std::array<Tetrahedron, 1>{cube.tetrahedra.front()});
  Positions away{{0.9, 0.8, 2.25}};
  EXPECT_EQ(guard.hold(std::array{GuardedStep{drops, points, away}}), 0u);
  EXPECT_EQ(away[0].z(), 2.25);
}

TEST(StepGuard, RigidGroupsMoveBackAsAWhole) {
  Random random(183);
  for (int scene = 0; scene < 5; ++scene) {
    Guarding all = everything(random);
    StepGuard guard = all.guard(settingsOf(Engine::Octree));
    guard.addRigidGroup(GeometryId{1});
    // Two groups that share a vertex are one group, over two geometries.
    const std::vector<GuardedVertex> one{{GeometryId{3}, 0}, {GeometryId{3}, 7}},
        other{{GeometryId{3}, 7}, {GeometryId{4}, 2}, {GeometryId{4}, 30}};
    guard.addRigidGroup(one);
    guard.addRigidGroup(other);
    std::vector<Positions> now = all.before;
    for (Positions& positions : now) positions = moved(random, positions, 0.2);
    const std::vector<Positions> given = now;
    guard.hold(all.steps(now));
    EXPECT_EQ(countTouches(all, now), 0u);
    const auto isHeld = [&](std::size_t body, std::uint32_t v) {
      return now[body][v] != given[body][v];
    };
    for (std::uint32_t v = 1; v < now[1].size(); ++v) EXPECT_EQ(isHeld(1, v), isHeld(1, 0));
    EXPECT_EQ(isHeld(3, 0), isHeld(3, 7));
    EXPECT_EQ(isHeld(3, 0), isHeld(4, 2));
    EXPECT_EQ(isHeld(3, 0), isHeld(4, 30));
    EXPECT_TRUE(isHeld(1, 0)) << "a sheet through a sphere";
  }
}

/// Particles on a line. All but the last move further than the next one.
Guarding chain(std::uint32_t count) {
  Guarding all;
  TestGeometry points{GeometryType::Points, {}, {}, {}, {0.0}};
  for (std::uint32_t i = 0; i < count; ++i) points.positions.emplace_back(0, 0, i);
  all.add(points);
  all.pairs.push_back({0, 0});
  for (std::uint32_t i = 0; i + 1 < count; ++i) all.now[0][i].z() += 1.5;
  return all;
}

TEST(StepGuard, NeedsAtMostOneRoundMoreThanVertices) {
  Guarding all = chain(20);
  StepGuard guard = all.guard(settingsOf(Engine::Octree));
  EXPECT_EQ(guard.hold(all.steps(all.now)), 19u);
  EXPECT_EQ(guard.rounds(), 20u) << "the bound is attained";
  EXPECT_EQ(all.now, all.before);
}

/// A vertex above a triangle that contains the origin.
Guarding vertexOverTriangle(double end) {
  Guarding all;
  all.add({GeometryType::Triangles, {{-1, -1, 0}, {2, -1, 0}, {-1, 2, 0}}, {{0, 1, 2}}, {}, {}});
  all.add({GeometryType::Points, {{0.1, 0.1, 1}}, {}, {}, {0.0}});
  all.pairs.push_back({0, 1});
  all.now[1][0].z() = end;
  return all;
}

TEST(StepGuard, TouchIsDecidedExactly) {
  const double tiny = std::numeric_limits<double>::denorm_min();
  for (const double end : {0.0, -0.0, -tiny, tiny, 0x1p-60}) {
    Guarding all = vertexOverTriangle(end);
    StepGuard guard = all.guard(settingsOf(Engine::Octree));
    EXPECT_EQ(guard.hold(all.steps(all.now)), end <= 0 ? 1u : 0u) << end;
    EXPECT_EQ(all.now[1][0].z(), end <= 0 ? 1 : end);
  }
  // The next step starts without a touch, a denormal distance from the triangle.
  Guarding all = vertexOverTriangle(tiny);
  StepGuard guard = all.guard(settingsOf(Engine::Octree));
  guard.hold(all.steps(all.now));
  all.before = all.now;
  all.now[1][0].z() = 0;
  EXPECT_EQ(guard.hold(all.steps(all.now)), 1u);
  EXPECT_EQ(all.now[1][0].z(), tiny);
}

/// Expects hold() to throw this error, to name the geometry and the vertex, and to change no
/// position.
void expectImpactRemains(StepGuard& guard, Guarding& all, const std::string& sentence) {
  const std::vector<Positions> given = all.now;
  try {
    guard.hold(all.steps(all.now));
    ADD_FAILURE() << "nothing was thrown";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::ImpactRemains);
    EXPECT_EQ(error.what(), sentence);
    EXPECT_EQ(error.geometry(), GeometryId{1});
    EXPECT_EQ(error.element(), 0u);
  }
  EXPECT_EQ(all.now, given);
}

TEST(StepGuard, StepsThatStartWithATouchAreRefused) {
  for (const double end : {0.0, 1.0, -1.0}) {
    Guarding all = vertexOverTriangle(end);
    all.before[1][0].z() = 0;
    StepGuard guard = all.guard(settingsOf(Engine::Octree));
    expectImpactRemains(guard, all,
                        "geometry 1, vertex 0, and geometry 0, triangle 0 touched before the step");
    guard.setDisabledElements(GeometryId{0}, std::array{0u});
    EXPECT_EQ(guard.hold(all.steps(all.now)), 0u) << "a disabled triangle is not there";
    EXPECT_EQ(all.now[1][0].z(), end);
  }
  // Errors name edges by their vertices.
  Guarding edges;
  edges.add({GeometryType::Lines, {{-1, 0, 0}, {1, 0, 0}}, {}, {{0, 1}}, {}});
  edges.add({GeometryType::Lines, {{0, -1, 0}, {0, 1, 0}}, {}, {{0, 1}}, {}});
  edges.pairs.push_back({1, 0});
  StepGuard guard = edges.guard(settingsOf(Engine::Octree));
  expectImpactRemains(
      guard, edges, "geometry 1, edge (0, 1), and geometry 0, edge (0, 1) touched before the step");
}

TEST(StepGuard, FixedVerticesStayAndOthersMoveBack) {
  const std::string fixed =
      "geometry 1, vertex 0, and geometry 0, triangle 0 touch within the step, and all their "
      "vertices that move are fixed";
  Guarding all = vertexOverTriangle(-1);
  StepGuard guard = all.guard(settingsOf(Engine::Octree));
  guard.setFixedVertices(GeometryId{1}, std::array{0u});
  expectImpactRemains(guard, all, fixed);
  // The triangle moves and could go back, but this does not separate them.
  for (Vector3d& p : all.now[0]) p.z() = -0.5;
  expectImpactRemains(guard, all, fixed);
  // A triangle that moves into a vertex at rest goes back; as part of a fixed group it cannot.
  all.now[1] = all.before[1];
  for (Vector3d& p : all.now[0]) p.z() = 2;
  const std::vector<Positions> given = all.now;
  EXPECT_EQ(guard.hold(all.steps(all.now)), 3u);
  EXPECT_EQ(all.now, all.before);
  all.now = given;
  guard.addRigidGroup(std::array{GuardedVertex{GeometryId{0}, 0}, GuardedVertex{GeometryId{0}, 1},
                                 GuardedVertex{GeometryId{0}, 2}, GuardedVertex{GeometryId{1}, 0}});
  expectImpactRemains(guard, all, fixed);
  guard.setFixedVertices(GeometryId{1}, {});
  EXPECT_EQ(guard.hold(all.steps(all.now)), 3u);
}

template <class Call>
void expectError(ErrorCode code, Call&& call) {
  try {
    call();
    ADD_FAILURE() << "nothing was thrown";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), code) << error.what();
  }
}

TEST(StepGuard, BadInputIsRefusedAndChangesNothing) {
  Random random(184);
  Guarding all = everything(random);
  StepGuard guard = all.guard(settingsOf(Engine::Octree)),
            unfailed = all.guard(settingsOf(Engine::Octree));
  const auto step = [&](std::vector<Positions>& now) {
    now = all.before;
    for (Positions& positions : now) positions = moved(random, positions, 0.1);
  };
  std::vector<Positions> now;
  step(now);
  std::vector<Positions> same = now;
  guard.hold(all.steps(now));
  unfailed.hold(all.steps(same));
  all.before = now;

  const std::vector<GuardedVertex> held(guard.held().begin(), guard.held().end());
  const std::size_t rounds = guard.rounds();
  std::vector<Positions> given;
  step(given);
  const auto expectRefused = [&](ErrorCode code, auto&& spoil) {
    std::vector<Positions> ends = given;
    std::vector<GuardedStep> steps = all.steps(ends);
    spoil(steps);
    const std::vector<Positions> spoilt = ends;
    expectError(code, [&] { guard.hold(steps); });
    for (std::size_t i = 0; i < ends.size(); ++i)
      for (std::size_t v = 0; v < ends[i].size(); ++v)
        EXPECT_TRUE(ends[i][v] == spoilt[i][v] || ends[i][v].hasNaN());
    EXPECT_TRUE(std::ranges::equal(guard.held(), held));
    EXPECT_EQ(guard.rounds(), rounds);
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  expectRefused(ErrorCode::UnknownGeometry,
                [](auto& steps) { steps.back().geometry = GeometryId{9}; });
  expectRefused(ErrorCode::InvalidSettings, [](auto& steps) { steps.push_back(steps.front()); });
  expectRefused(ErrorCode::WrongPositionCount,
                [](auto& steps) { steps[2].before = steps[2].before.first(3); });
  expectRefused(ErrorCode::WrongPositionCount,
                [](auto& steps) { steps[2].now = steps[2].now.first(3); });
  expectRefused(ErrorCode::NonFinitePosition, [&](auto& steps) { steps[4].now[5].y() = nan; });
  // Vertices of others have gone back. Then particle 0 is before the step where particle 1 is.
  Positions together = all.before[4];
  together[0] = together[1];
  expectRefused(ErrorCode::ImpactRemains, [&](auto& steps) { steps[4].before = together; });

  expectError(ErrorCode::UnknownGeometry,
              [&] { guard.addCollisionPair(GeometryId{0}, GeometryId{9}); });
  expectError(ErrorCode::DuplicatePair,
              [&] { guard.addCollisionPair(GeometryId{1}, GeometryId{0}); });
  expectError(ErrorCode::UnknownGeometry, [&] { guard.addRigidGroup(GeometryId{9}); });
  expectError(ErrorCode::IndexOutOfRange, [&] {
    guard.addRigidGroup(
        std::array{GuardedVertex{GeometryId{0}, 0}, GuardedVertex{GeometryId{4}, 40}});
  });
  expectError(ErrorCode::IndexOutOfRange, [&] {
    guard.setFixedVertices(GeometryId{4}, std::array{0u, 40u});
  });
  expectError(ErrorCode::IndexOutOfRange, [&] {
    guard.addTriangleMesh(all.before[4], std::array<Triangle, 1>{{{0, 1, 40}}});
  });
  expectError(ErrorCode::UnsupportedMethod,
              [&] { guard.setTriangles(GeometryId{4}, all.before[4], {}); });

  // A geometry that is not set is where the last successful hold() left it, not where a failed one
  // began or ended.
  for (StepGuard* each : {&guard, &unfailed}) {
    std::vector<Positions> ends = given;
    std::vector<GuardedStep> steps = all.steps(ends);
    steps.erase(steps.begin() + 2);
    steps.erase(steps.begin());
    each->hold(steps);
    (each == &guard ? now : same) = ends;
  }
  EXPECT_EQ(now, same);

  StepGuard other = std::move(guard);
  expectError(ErrorCode::InvalidCall, [&] { guard.hold({}); });
  expectError(ErrorCode::InvalidCall, [&] { guard.held(); });
  EXPECT_EQ(other.hold({}), 0u);
}

TEST(StepGuard, GeometriesAndPairsCanBeAddedAndRemoved) {
  Guarding all = vertexOverTriangle(-1);
  StepGuard guard = all.guard(settingsOf(Engine::Octree));
  const std::vector<Positions> given = all.now;
  guard.removeCollisionPair(GeometryId{0}, GeometryId{1});
  EXPECT_EQ(guard.hold(all.steps(all.now)), 0u);
  guard.addCollisionPair(GeometryId{0}, GeometryId{1});
  EXPECT_EQ(guard.hold(all.steps(all.now)), 1u);
  // A cut moves the triangle and a fourth vertex away. The later vertices are free again.
  all.now = given;
  const Positions cut{{5, 0, 0}, {6, 0, 0}, {5, 1, 0}, {6, 1, 0}};
  guard.setFixedVertices(GeometryId{0}, std::array{0u, 2u});
  guard.addRigidGroup(GeometryId{0});
  guard.setTriangles(GeometryId{0}, cut, std::array<Triangle, 1>{{{0, 1, 3}}});
  EXPECT_EQ(guard.hold(std::array{GuardedStep{GeometryId{1}, all.before[1], all.now[1]}}), 0u);
  guard.setTriangles(GeometryId{0}, std::span(cut).first(3), std::array<Triangle, 1>{{{0, 1, 2}}});
  guard.removeGeometry(GeometryId{0});
  EXPECT_EQ(guard.hold(std::array{GuardedStep{GeometryId{1}, all.before[1], all.now[1]}}), 0u);
  expectError(ErrorCode::UnknownGeometry, [&] { guard.hold(all.steps(all.now)); });
}

}  // namespace
}  // namespace palpate::testing
