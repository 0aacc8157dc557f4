#include "Common/DegenerateCases.h"
#include "Common/ExpectRefused.h"
#include "Common/Solids.h"
#include "Common/TestGeometry.h"
#include "Unit/Math/ImpactOracle.h"

#include <iterator>
#include <tuple>

// PairSettings::reportCrossings: exactly the passages that rational arithmetic finds for every two
// features. What touches at borders is decided for all features around them.

namespace palpate {
namespace {

using namespace testing;

using CrossingRow = std::tuple<ContactKind, std::array<std::uint32_t, 4>, bool>;

struct CrossingStep {
  const TestGeometry &a, &b;
  Positions nowA, nowB;
  bool self() const { return &a == &b; }
};

/// In the order of CollisionData::crossings().
std::vector<CrossingRow> crossingTruth(const CrossingStep& step) {
  std::vector<CrossingRow> all;
  const auto add = [&](const ContactKey& key, bool edges, const auto& first, const auto& second,
                       bool swapped) {
    impact::Positions p;
    std::size_t i = 0;
    const auto put = [&](const auto& vertices, bool ofB) {
      ofB = ofB && !step.self();
      for (const std::uint32_t v : vertices) {
        p[i] = (ofB ? step.b : step.a).positions[v];
        p[4 + i++] = (ofB ? step.nowB : step.nowA)[v];
      }
    };
    put(first, swapped);
    put(second, !swapped);
    for (const auto& passage : impact::Query(edges, p).passages())
      all.push_back({key.kind, key.ids, passage.forward});
  };
  const auto vertices = [&](bool swapped) {
    const TestGeometry &own = swapped ? step.b : step.a, &other = swapped ? step.a : step.b;
    std::set<std::uint32_t> used;
    for (const Triangle& t : own.elements()) used.insert(t.begin(), t.end());
    for (const std::uint32_t v : used)
      for (std::uint32_t t = 0; t < other.triangles.size(); ++t) {
        const Triangle& corners = other.triangles[t];
        if (step.self() && std::find(corners.begin(), corners.end(), v) != corners.end()) continue;
        const ContactKey key =
            swapped ? ContactKey{ContactKind::TriangleVertex, {t, v, kNoElement, kNoElement}}
                    : ContactKey{ContactKind::VertexTriangle, {v, t, kNoElement, kNoElement}};
        add(key, false, std::array{v}, corners, swapped);
      }
  };
  vertices(false);
  if (!step.self()) vertices(true);
  for (const Segment& e : step.a.edges())
    for (const Segment& f : step.b.edges()) {
      if (step.self() && (f <= e || std::set{e[0], e[1], f[0], f[1]}.size() < 4)) continue;
      add({ContactKind::EdgeEdge, {e[0], e[1], f[0], f[1]}}, true, e, f, false);
    }
  // Several passages of two features have ascending times: a stable order keeps them.
  std::stable_sort(all.begin(), all.end(), [](const CrossingRow& l, const CrossingRow& r) {
    return std::tie(std::get<0>(l), std::get<1>(l)) < std::tie(std::get<0>(r), std::get<1>(r));
  });
  return all;
}

/// Returns how many there are.
std::size_t expectCrossings(const CrossingStep& step, double thickness,
                            Method method = Method::Continuous) {
  OctreeBasedCD collisions;
  const GeometryId a = step.a.addTo(collisions), b = step.self() ? a : step.b.addTo(collisions);
  collisions.addCollisionPair(a, b,
                              {.method = method, .thickness = thickness, .reportCrossings = true});
  collisions.setPositions(a, step.a.positions, step.nowA);
  if (!step.self()) collisions.setPositions(b, step.b.positions, step.nowB);
  collisions.detectCollision();
  std::vector<CrossingRow> found;
  for (const Crossing& c : collisions.collisionData(a, b).crossings())
    found.push_back({c.kind, c.ids, c.forward});
  const std::vector<CrossingRow> truth = crossingTruth(step);
  EXPECT_EQ(found, truth);
  return truth.size();
}

TEST(Crossings, AreThoseOfRationalArithmetic) {
  Random random(8);
  const TestGeometry soupA = testGeometry(soup(random, 40, 0.3)),
                     soupB = testGeometry(soup(random, 40, 0.3)),
                     line = thread(random, 40, 0.3, 0.0, false),
                     points = particles(random, 60, 0.0);
  const Pairs pairs{{&soupA, &soupB}, {&soupA, &soupA}, {&soupA, &line},
                    {&line, &soupA},  {&line, &line},   {&points, &soupA}};
  std::size_t passages = 0, number = 0;
  for (const double motion : {0.05, 0.5})
    for (const double thickness : {0.0, 0.02})
      for (const auto& [a, b] : pairs) {
        if (isLeftOut(number++, 5)) continue;
        const CrossingStep step{*a, *b, moved(random, a->positions, motion),
                                moved(random, b->positions, motion)};
        passages += expectCrossings(step, thickness);
        expectCrossings(step, thickness, Method::Auto);
      }
  EXPECT_GE(passages, leastOf(500, 80));
}

/// All positions have small whole coordinates: features pass through borders, and planes hold
/// vertices at the step's ends.
TEST(Crossings, AreThoseOfRationalArithmeticOnAGrid) {
  Random random(2);
  const auto grid = [&](std::size_t count) {
    Positions all(count);
    for (Vector3d& p : all)
      for (int k = 0; k < 3; ++k) p[k] = static_cast<double>(random() % 4);
    return all;
  };
  std::size_t passages = 0;
  for (int i = 0; i < casesOf(12, 3); ++i) {
    TestGeometry a = testGeometry(soup(random, 12, 1)), b = testGeometry(soup(random, 12, 1));
    a.positions = grid(a.positions.size());
    b.positions = grid(b.positions.size());
    passages += expectCrossings({a, b, grid(a.positions.size()), grid(b.positions.size())}, 0.0);
    passages += expectCrossings({a, a, grid(a.positions.size()), {}}, 0.0);
  }
  EXPECT_GE(passages, leastOf(1000, 200));
}

/// Unit cubes of a grid, and the surface of their union.
struct CubeSolid {
  static constexpr int kSize = 5;
  std::array<bool, kSize * kSize * kSize> filled{};
  Mesh surface;

  bool contains(const std::array<int, 3>& cube) const {
    std::size_t place = 0;
    for (const int x : cube) {
      if (x < 0 || x >= kSize) return false;
      place = place * kSize + static_cast<std::size_t>(x);
    }
    return filled[place];
  }
  /// Strictly: what is on the surface is outside.
  bool isInside(const Vector3d& p) const {
    for (int lower = 0; lower < 8; ++lower) {
      std::array<int, 3> cube;
      for (int k = 0; k < 3; ++k) {
        const double whole = std::floor(p[k]);
        cube[static_cast<std::size_t>(k)] =
            static_cast<int>(whole) - (whole == p[k] && (lower >> k & 1) != 0);
      }
      if (!contains(cube)) return false;
    }
    return true;
  }
  /// Whether each edge has two triangles; else the solid is no closed surface.
  bool isClosed() const {
    std::set<std::array<std::uint32_t, 2>> edges;
    for (const Triangle& t : surface.triangles)
      for (std::size_t i = 0; i < 3; ++i)
        if (!edges.insert({t[i], t[(i + 1) % 3]}).second) return false;
    return true;
  }
};

/// A random path of cubes: stairs, saddles, L shapes and holes.
CubeSolid cubeSolid(Random& random) {
  CubeSolid solid;
  std::array<int, 3> at{2, 2, 2};
  for (std::size_t cubes = 2 + random() % 10; cubes > 0; --cubes) {
    solid.filled[static_cast<std::size_t>((at[0] * CubeSolid::kSize + at[1]) * CubeSolid::kSize +
                                          at[2])] = true;
    int& x = at[random() % 3];
    x = std::clamp(x + (random() % 2 != 0 ? 1 : -1), 0, CubeSolid::kSize - 1);
  }
  solid.surface = surfaceMeshOf(
      cells(CubeSolid::kSize, random, [&](const auto& cube) { return solid.contains(cube); }));
  return solid;
}

/// When the straight way from p to q enters and leaves the solid. Sliding along it is outside.
std::vector<std::pair<double, bool>> changesOf(const CubeSolid& solid, const Vector3d& p,
                                               const Vector3d& q) {
  std::set<double> times{0.0, 1.0};
  for (int k = 0; k < 3; ++k)
    for (int plane = 0; plane <= CubeSolid::kSize; ++plane)
      if (const double time = (plane - p[k]) / (q[k] - p[k]); time > 0.0 && time < 1.0)
        times.insert(time);
  std::vector<std::pair<double, bool>> changes;
  bool isInside = solid.isInside(p);
  const auto take = [&](double time, bool isInsideNow) {
    if (isInsideNow != isInside) changes.push_back({time, isInsideNow});
    isInside = isInsideNow;
  };
  for (auto next = std::next(times.begin()); next != times.end(); ++next) {
    const double time = *std::prev(next);
    // Equal times may differ by rounding.
    if (*next - time > 1e-9) take(time, solid.isInside(p + 0.5 * (time + *next) * (q - p)));
  }
  take(1.0, solid.isInside(q));
  return changes;
}

/// Points and a closed surface on a grid, of which some triangles have no area. The solid is
/// sheared, moved and deformed.
TEST(Crossings, OfAPointAreTheChangesOfInsideAndOutside) {
  Random random(4);
  const auto whole = [&](int most) {
    return Vector3d(Vector3d::NullaryExpr(
        [&] { return static_cast<double>(random() % (2u * most + 1)) - most; }));
  };
  std::size_t changeCount = 0, touchCount = 0;
  for (int run = 0; run < casesOf(100, 30);) {
    CubeSolid solid = cubeSolid(random);
    if (!solid.isClosed()) continue;
    for (int flat = run % 2 == 0 ? 0 : 40; flat > 0; --flat)
      addFlatTriangles(random, solid.surface);
    std::shuffle(solid.surface.triangles.begin(), solid.surface.triangles.end(), random);
    const bool deforms = run++ % 4 == 3;
    Eigen::Matrix3d shape = Eigen::Matrix3d::Identity();
    if (run % 3 == 1) shape << 2, 1, 0, -1, 2, 1, 0, 1, 3;
    if (deforms) shape = 4 * Eigen::Matrix3d::Identity();
    Positions places(80);
    for (Vector3d& p : places) {
      const Vector3d middle = Vector3d::Constant(random() % 2 != 0 ? 3.0 : 2.5);
      p = 0.5 * whole(6) + middle;
    }
    Vector3d origin = Vector3d::Zero();
    const auto placed = [&](const Positions& positions) {
      Positions all;
      for (const Vector3d& p : positions) all.push_back(shape * p + origin);
      return all;
    };
    OctreeBasedCD collisions;
    const GeometryId body = collisions.addTriangleMesh(placed(solid.surface.positions),
                                                       solid.surface.triangles),
                     points = collisions.addPointSet(placed(places));
    collisions.addCollisionPair(points, body,
                                {.method = Method::Continuous, .reportCrossings = true});
    collisions.advance();
    for (int step = 0; step < 5; ++step) {
      Positions next = places;
      for (Vector3d& p : next)
        p = (p + (step == 0 ? 1.0 : 0.5) * whole(step == 0 ? 4 : 1)).cwiseMax(-1.0).cwiseMin(6.0);
      origin += whole(2);
      if (deforms)
        for (int k = 0; k < 3; ++k) shape.col(k) = 4 * Vector3d::Unit(k) + whole(1);
      collisions.setPositions(body, placed(solid.surface.positions));
      collisions.setPositions(points, placed(next));
      collisions.detectCollision();
      std::vector<std::vector<Crossing>> found(places.size());
      for (const Crossing& crossing : collisions.collisionData(points, body).crossings())
        found[crossing.ids[0]].push_back(crossing);
      for (std::size_t i = 0; i < places.size(); ++i) {
        std::stable_sort(found[i].begin(), found[i].end(),
                         [](const Crossing& l, const Crossing& r) { return l.time < r.time; });
        int sum = 0;
        for (const Crossing& crossing : found[i]) sum += crossing.forward ? -1 : 1;
        ASSERT_EQ(sum, solid.isInside(next[i]) - solid.isInside(places[i]))
            << places[i].transpose() << " to " << next[i].transpose();
        if (deforms) continue;
        const auto changes = changesOf(solid, places[i], next[i]);
        ASSERT_EQ(found[i].size(), changes.size())
            << places[i].transpose() << " to " << next[i].transpose();
        for (std::size_t k = 0; k < changes.size(); ++k) {
          EXPECT_NEAR(found[i][k].time, changes[k].first, 1e-5);
          EXPECT_EQ(found[i][k].forward, !changes[k].second);
          touchCount += changes[k].first == 0.0 || changes[k].first == 1.0;
        }
        changeCount += changes.size();
      }
      places = next;
      collisions.advance();
    }
  }
  EXPECT_GE(changeCount, leastOf(600, 150));
  EXPECT_GE(touchCount, leastOf(100, 25));
}

/// Whether cubes at a distance, of this size and of size 4 at the origin, overlap on a straight
/// way.
bool overlapOnTheWay(double size, const Vector3d& p, const Vector3d& q) {
  double first = 0.0, last = 1.0;
  for (int k = 0; k < 3; ++k)
    for (const double side : {1.0, -1.0}) {
      // Where start + slope t < 0 the cubes overlap along the axis, on this side.
      const double start = side > 0 ? p[k] - 4.0 : -p[k] - size, slope = side * (q[k] - p[k]);
      if (slope == 0.0 && start >= 0.0) return false;
      if (slope > 0.0) last = std::min(last, -start / slope);
      if (slope < 0.0) first = std::max(first, -start / slope);
    }
  return first < last - 1e-12;
}

/// A cube, or a thread in it, slides over the sides, edges and corners of another cube.
TEST(Crossings, BodiesThatOnlyTouchHaveNone) {
  Random random(6);
  const auto whole = [&](int least, int most) {
    return least + static_cast<int>(random() % static_cast<unsigned>(most - least + 1));
  };
  const auto wholePoint = [&](int least, int most) {
    Vector3d point;
    for (double& x : point) x = whole(least, most);
    return point;
  };
  std::size_t touching = 0;
  for (int run = 0; run < casesOf(90, 18); ++run) {
    const double size = 2.0 * whole(1, 3);
    const auto cubeOf = [&](double edge) {
      return testGeometry(dividedBox({0, 0, 0}, {edge, edge, edge}, whole(1, 2)));
    };
    TestGeometry table = cubeOf(4.0), body = cubeOf(size);
    if (run % 3 == 2) {
      body = {GeometryType::Lines, {}, {}, {}, {0.0}};
      for (std::uint32_t i = 0; i < 4; ++i) {
        body.positions.push_back(size * wholePoint(0, 1));
        if (i > 0) body.segments.push_back({i - 1, i});
      }
    }
    Eigen::Matrix3d shape = Eigen::Matrix3d::Identity();
    if (run % 3 == 1) shape << 1, 2, 0, 0, 1, -1, 1, 0, 1;
    if (shape.determinant() < 0) shape = -shape;
    const Positions positions = body.positions;
    const auto place = [&](const Vector3d& at) {
      for (std::size_t i = 0; i < positions.size(); ++i)
        body.positions[i] = shape * (positions[i] + at);
    };
    for (Vector3d& p : table.positions) p = shape * p;
    Vector3d at = wholePoint(-4, 4);
    at.z() = 4;
    place(at);
    OctreeBasedCD collisions;
    GeometryId a = body.addTo(collisions), b = table.addTo(collisions);
    const GeometryId moving = a;
    if (run % 2 != 0) std::swap(a, b);
    collisions.addCollisionPair(a, b, {.method = Method::Continuous, .reportCrossings = true});
    collisions.advance();
    for (int step = 0; step < 40; ++step) {
      Vector3d next = at + wholePoint(-3, 3);
      if (random() % 3 != 0) {  // along a side
        const int axis = whole(0, 2);
        next[axis] = at[axis];
      }
      next = next.cwiseMax(-size - 1.0).cwiseMin(5.0);
      if (overlapOnTheWay(size, at, next)) continue;
      at = next;
      place(at);
      collisions.setPositions(moving, body.positions);
      collisions.detectCollision();
      const CollisionData& data = collisions.collisionData(a, b);
      touching += !data.vertexTriangle().empty() || !data.edgeEdge().empty();
      ASSERT_TRUE(data.crossings().empty()) << "run " << run << ", at " << at.transpose();
      collisions.advance();
    }
  }
  EXPECT_GE(touching, leastOf(300, 40));
}

TEST(Crossings, NeedContactsOverTheStep) {
  OctreeBasedCD collisions;
  const Mesh cube = testing::cube(0, 1);
  const GeometryId a = addMesh(collisions, cube), b = addMesh(collisions, cube),
                   ball = collisions.addAnalyticalGeometry(Sphere{{0, 0, 0}, 1});
  const auto refuse = [&](GeometryId second, const PairSettings& settings) {
    testing::expectRefused(
        ErrorCode::UnsupportedMethod, "pair (0, ",
        [&] { collisions.addCollisionPair(a, second, settings); }, a);
  };
  for (const Method method : {Method::Proximity, Method::Intersection})
    refuse(b, {.method = method, .thickness = 0.1, .reportCrossings = true});
  for (const Method method : {Method::Auto, Method::Continuous})
    refuse(ball, {.method = method, .thickness = 0.1, .reportCrossings = true});
  refuse(b, {.method = Method::Continuous,
             .reportCrossings = true,
             .continuous = {.earliestTimeOnly = true}});
  const GeometryId line = collisions.addLineMesh(cube.positions, std::vector<Segment>{{0, 1}},
                                                 std::vector<double>{0, 1, 0, 0, 0, 0, 0, 0});
  for (const bool crossings : {true, false})
    testing::expectRefused(
        ErrorCode::UnsupportedMethod, "need one radius for all vertices",
        [&] {
          collisions.addCollisionPair(
              line, a,
              {.thickness = 0.1, .reportCrossings = crossings, .rememberSides = !crossings});
        },
        line);
}

}  // namespace
}  // namespace palpate
