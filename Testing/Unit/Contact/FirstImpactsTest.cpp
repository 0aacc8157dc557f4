#include <palpate/OctreeBasedCD.h>

#include "Common/ContactRows.h"
#include "Common/DegenerateCases.h"
#include "Common/PairRun.h"
#include "Common/RandomMeshes.h"
#include "Common/RidgeTruth.h"
#include "Common/Sanitized.h"
#include "Common/TestGeometry.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <set>
#include <span>
#include <tuple>
#include <utility>
#include <vector>

// Contacts::Distinct of Method::Continuous against its definition, written here over sets of
// vertices and applied to the contacts that Contacts::All reports.

namespace palpate::testing {
namespace {

using VertexSet = std::set<std::uint32_t>;
using FeaturePair = std::pair<VertexSet, VertexSet>;

VertexSet closestVerticesOf(const VertexTriangleContact& c) {
  VertexSet vertices;
  for (int i = 0; i < 3; ++i)
    if (c.weights[i] != 0.0) vertices.insert(c.vertices[i]);
  return vertices;
}

VertexSet closestVerticesOf(const std::array<std::uint32_t, 2>& edge, double weight) {
  VertexSet vertices;
  if (weight != 1.0) vertices.insert(edge[0]);
  if (weight != 0.0) vertices.insert(edge[1]);
  return vertices;
}

/// One of the two geometries of a step.
struct Moving {
  const TestGeometry& geometry;
  const Positions& now;

  std::vector<VertexSet> elements() const {
    std::vector<VertexSet> all;
    for (const auto& [a, b, c] : geometry.triangles) all.push_back({a, b, c});
    for (const auto& [p, q] : geometry.segments) all.push_back({p, q});
    return all;
  }
  Vector3d at(std::uint32_t v, double time) const {
    return (1 - time) * geometry.positions[v] + time * now[v];
  }
  /// Whether a direction from a feature leads into an element that contains it.
  bool leadsInto(const VertexSet& feature, const VertexSet& element, const Vector3d& direction,
                 double time) const {
    const Vector3d p = at(*feature.begin(), time), along = at(*feature.rbegin(), time) - p;
    return std::any_of(element.begin(), element.end(), [&](std::uint32_t v) {
      if (feature.contains(v)) return false;
      const Vector3d way = at(v, time) - p;
      Vector3d inwards = way;
      if (feature.size() == 2) inwards -= inwards.dot(along.normalized()) * along.normalized();
      return direction.dot(inwards) > 1e-12 * way.lpNorm<1>();
    });
  }
  double radius() const { return geometry.radii.empty() ? 0.0 : geometry.radii.front(); }
};

/// An impact by sets of vertices of the pair's first and second geometry.
struct Impact {
  FeaturePair elements, closest;
  std::uint32_t triangle;  ///< the triangle with a closest point in its interior, or none
  Vector3d normal;         ///< from the second geometry to the first
  double time, distance;
  std::array<Vector3d, 2> points;  ///< closest ones, of either geometry, at the step's end
  int list;
  std::size_t index;

  bool isBefore(const Impact& other) const {
    return std::tie(time, list, index) < std::tie(other.time, other.list, other.index);
  }
  bool hasFeaturesOf(const Impact& other, bool self) const {
    if (triangle != other.triangle) return false;
    const FeaturePair swapped{closest.second, closest.first};
    return closest == other.closest || (self && swapped == other.closest);
  }
};

std::vector<Impact> impactsOf(const CollisionData& data, const std::array<Moving, 2>& pair) {
  std::vector<Impact> all;
  const auto addOfVertices = [&](std::span<const VertexTriangleContact> contacts, bool swapped) {
    for (std::size_t i = 0; i < contacts.size(); ++i) {
      const VertexTriangleContact& c = contacts[i];
      const VertexSet vertex{c.vertex}, corners(c.vertices.begin(), c.vertices.end()),
          nearest = closestVerticesOf(c);
      Impact& impact = all.emplace_back(Impact{{vertex, corners},
                                               {vertex, nearest},
                                               nearest.size() == 3 ? c.triangle : kNoElement,
                                               c.normal,
                                               c.timeOfImpact,
                                               c.distance,
                                               {pair[swapped].now[c.vertex], Vector3d::Zero()},
                                               swapped,
                                               i});
      for (int k = 0; k < 3; ++k)
        impact.points[1] += c.weights[k] * pair[!swapped].now[c.vertices[k]];
      if (!swapped) continue;
      for (FeaturePair* sets : {&impact.elements, &impact.closest})
        std::swap(sets->first, sets->second);
      std::swap(impact.points[0], impact.points[1]);
      impact.normal = -impact.normal;
    }
  };
  addOfVertices(data.vertexTriangle(), false);
  addOfVertices(data.triangleVertex(), true);
  const auto onEdge = [](const Positions& x, const Segment& edge, double weight) -> Vector3d {
    return (1 - weight) * x[edge[0]] + weight * x[edge[1]];
  };
  for (std::size_t i = 0; i < data.edgeEdge().size(); ++i) {
    const EdgeEdgeContact& c = data.edgeEdge()[i];
    all.push_back(
        {{{c.edgeA[0], c.edgeA[1]}, {c.edgeB[0], c.edgeB[1]}},
         {closestVerticesOf(c.edgeA, c.weightA), closestVerticesOf(c.edgeB, c.weightB)},
         kNoElement,
         c.normal,
         c.timeOfImpact,
         c.distance,
         {onEdge(pair[0].now, c.edgeA, c.weightA), onEdge(pair[1].now, c.edgeB, c.weightB)},
         2,
         i});
  }
  return all;
}

/// The geometry whose element another impact may hold, and the other one.
struct Sides {
  const Moving &own, &other;
  bool ownIsSecond;

  const VertexSet& ofOwn(const FeaturePair& f) const { return ownIsSecond ? f.second : f.first; }
  const VertexSet& ofOther(const FeaturePair& f) const { return ownIsSecond ? f.first : f.second; }
  /// From the other geometry.
  Vector3d upOf(const Impact& c) const { return ownIsSecond ? Vector3d(-c.normal) : c.normal; }

  bool isExcluded(const Impact& c) const {
    const VertexSet& feature = ofOther(c.closest);
    if (feature.size() > 2) return false;
    // A vertex is tested against elements, an edge of a line against the triangles at an edge.
    if (ofOwn(c.elements).size() == 2 && other.geometry.triangles.empty()) return false;
    const std::vector<VertexSet> elements = other.elements();
    return std::any_of(elements.begin(), elements.end(), [&](const VertexSet& element) {
      return std::includes(element.begin(), element.end(), feature.begin(), feature.end()) &&
             other.leadsInto(feature, element, upOf(c), c.time);
    });
  }

  /// Whether all vertices of an impact's element are of another one's, as a vertex is one of a
  /// triangle with it.
  bool isPartOf(const Impact& s, const VertexSet& whole) const {
    const VertexSet& part = ofOwn(s.elements);
    return std::includes(whole.begin(), whole.end(), part.begin(), part.end());
  }
  double heightOf(const Impact& s, const Vector3d& up) const {
    return up.dot(s.points[!ownIsSecond]) + other.radius();
  }
  double gapOf(const Impact& s, const Vector3d& up) const {
    return up.dot(s.points[ownIsSecond]) - own.radius() - heightOf(s, up);
  }
  bool haveFaces() const {
    return !own.geometry.triangles.empty() && !other.geometry.triangles.empty();
  }
  /// Whether the other geometry's closest point is on a ridge or a border, as seen from the held
  /// element.
  bool isOnRidge(const Impact& c, const PairSettings& pair) const {
    const VertexSet& held = ofOwn(c.elements);
    double length = 0;
    for (const std::uint32_t p : held)
      for (const std::uint32_t q : held)
        length = std::max(length, (own.now[p] - own.now[q]).norm());
    return RidgeTruth{other.now, other.geometry.triangles, length, pair.thickness}.isOnRidge(
        ofOther(c.closest), upOf(c));
  }
};

/// An impact that is not excluded, seen from a side whose element it holds.
struct Holder {
  const Impact& impact;
  Sides sides;

  Vector3d up() const { return sides.upOf(impact); }
  double height() const { return sides.heightOf(impact, up()); }
};

/// Whether s keeps c away, together with others on its plane. sides: those of c.
bool standsFor(const Holder& s, const Impact& c, const Sides& sides,
               const std::vector<Holder>& holders, const PairSettings& pair) {
  const VertexSet &held = sides.ofOwn(c.elements), &others = sides.ofOther(c.elements);
  const bool isInTime =
      s.sides.ofOther(s.impact.closest).size() == 3 || s.sides.ofOwn(s.impact.closest).size() == 3
          ? s.impact.time <= c.time + pair.continuous.timeTolerance
          : std::tie(s.impact.time, s.impact.distance) < std::tie(c.time, c.distance);
  if (!isInTime || !s.sides.isPartOf(s.impact, held)) return false;
  const Vector3d up = s.up();
  const double height = s.height(), near = pair.thickness / 128 + 1e-12;
  const bool isOfVertex = held.size() == 1;
  const VertexSet& own = s.sides.ofOwn(s.impact.elements);
  const bool isOfClosestVertex = own.size() == 1 && own == sides.ofOwn(c.closest);
  if (!isOfVertex && !isOfClosestVertex && sides.isOnRidge(c, pair)) return false;
  double gap = s.sides.gapOf(s.impact, up);
  for (const Holder& h : holders)
    if (h.sides.isPartOf(h.impact, held) && (h.up() - up).norm() < 1e-12 &&
        std::abs(h.height() - height) <= 2 * near)
      gap = std::min(gap, h.sides.gapOf(h.impact, up));
  return std::all_of(others.begin(), others.end(),
                     [&](std::uint32_t v) {
                       const double above =
                           up.dot(sides.other.now[v]) + sides.other.radius() - height;
                       return std::abs(above) <= near;
                     }) &&
         std::all_of(held.begin(), held.end(), [&](std::uint32_t v) {
           return isOfVertex ||
                  up.dot(sides.own.now[v]) - sides.own.radius() >= height + gap - near;
         });
}

/// All but excluded impacts that others stand for.
std::vector<Impact> includedOf(const CollisionData& all, const std::array<Moving, 2>& pair,
                               const PairSettings& settings) {
  const std::vector<Impact> impacts = impactsOf(all, pair);
  const std::array views{Sides{pair[0], pair[1], false}, Sides{pair[1], pair[0], true}};
  const bool haveFaces = views[0].haveFaces(), self = &pair[0].geometry == &pair[1].geometry;
  // Both sides of two meshes with faces, the vertex of a vertex and an element, or the edge of a
  // line near a triangle mesh.
  const auto heldSidesOf = [&](std::size_t i) -> std::vector<std::size_t> {
    if (haveFaces) return {0, 1};
    return {impacts[i].list == 1 || (impacts[i].list == 2 && !pair[0].geometry.triangles.empty())};
  };
  std::array<std::vector<Holder>, 2> holders;
  std::vector<char> isExcluded;
  for (std::size_t i = 0; i < impacts.size(); ++i) {
    const auto sides = heldSidesOf(i);
    isExcluded.push_back(impacts[i].triangle == kNoElement &&
                         std::ranges::any_of(sides, [&](std::size_t side) {
                           return views[side].isExcluded(impacts[i]);
                         }));
    if (isExcluded[i]) continue;
    for (const std::size_t side : sides)
      holders[self ? 0 : side].push_back({impacts[i], views[side]});
  }
  std::vector<Impact> included;
  for (std::size_t i = 0; i < impacts.size(); ++i) {
    const auto sides = heldSidesOf(i);
    if (!isExcluded[i] || std::ranges::none_of(sides, [&](std::size_t side) {
          const auto& others = holders[self ? 0 : side];
          return std::ranges::any_of(others, [&](const Holder& s) {
            return standsFor(s, impacts[i], views[side], others, settings);
          });
        }))
      included.push_back(impacts[i]);
  }
  return included;
}

/// The definition: it compares every impact with every other.
Rows reduced(const CollisionData& all, bool self, const std::vector<Impact>& impacts) {
  const Rows rows(all);
  Rows kept;
  kept.earliestTimeOfImpact = rows.earliestTimeOfImpact;
  for (const Impact& impact : impacts) {
    if (std::any_of(impacts.begin(), impacts.end(), [&](const Impact& other) {
          return other.isBefore(impact) && other.hasFeaturesOf(impact, self);
        }))
      continue;
    const auto member = impact.list == 0   ? &Rows::vertexTriangle
                        : impact.list == 1 ? &Rows::triangleVertex
                                           : &Rows::edgeEdge;
    (kept.*member).push_back((rows.*member)[impact.index]);
  }
  return kept;
}

/// Compares one step of a pair with the definition. Returns how many contacts Distinct drops.
std::size_t expectFirstImpacts(const TestGeometry& a, const TestGeometry& b, PairSettings pair,
                               const Positions& nowA, const Positions& nowB) {
  pair.contacts = Contacts::All;
  const CollisionData all = answer(settingsOf(Engine::Octree), a, b, pair, nowA, nowB);
  const Rows expected =
      reduced(all, &a == &b, includedOf(all, {Moving{a, nowA}, Moving{b, nowB}}, pair));
  pair.contacts = Contacts::Distinct;
  const CollisionData distinct = answer(settingsOf(Engine::Octree), a, b, pair, nowA, nowB);
  expectSameRows(Rows(distinct), expected);
  EXPECT_EQ(distinct.validity().trusted, all.validity().trusted);
  EXPECT_EQ(distinct.validity().startedApart, all.validity().startedApart);
  EXPECT_EQ(distinct.validity().atImpact, expected.contacts());
  return Rows(all).contacts() - expected.contacts();
}

TEST(FirstImpacts, MatchTheDefinitionForEveryPairOfGeometryTypes) {
  Random random(1);
  const TestGeometry organ = testGeometry(sphere(6, 8, {0.5, 0.5, 0.5}, 0.35)),
                     cloth = testGeometry(sheet(7, 0.4, 1.0));
  const TestGeometry line = thread(random, 60, 0.12, 0.01, false),
                     loop = thread(random, 40, 0.15, 0, true);
  const TestGeometry smoke = particles(random, 60, 0.02), dust = particles(random, 80, 0);
  std::size_t dropped = 0, number = 0;
  for (const auto& [a, b] : Pairs{{&organ, &cloth},
                                  {&cloth, &organ},
                                  {&organ, &organ},
                                  {&cloth, &cloth},
                                  {&organ, &line},
                                  {&line, &organ},
                                  {&line, &loop},
                                  {&loop, &line},
                                  {&line, &line},
                                  {&loop, &loop},
                                  {&organ, &smoke},
                                  {&smoke, &organ},
                                  {&line, &smoke},
                                  {&dust, &loop},
                                  {&dust, &smoke},
                                  {&smoke, &smoke}})
    for (const double thickness : {0.0, 0.05, 0.15}) {
      if (isLeftOut(number++)) continue;
      PairSettings pair{Method::Continuous, thickness};
      const Positions nowA = moved(random, a->positions, 0.06),
                      nowB = moved(random, b->positions, 0.06);
      dropped += expectFirstImpacts(*a, *b, pair, nowA, nowB);
      if (a == b && a != &smoke) {
        pair.restDistance = 0.2;
        dropped += expectFirstImpacts(*a, *b, pair, nowA, nowB);
      }
      if (HasFailure()) return;
    }
  EXPECT_GE(dropped, leastOf(1000));
}

/// Lines and points that slide over a flat mesh have no contacts with its inner edges.
TEST(FirstImpacts, OfLinesAndPointsOnAFlatFloorHaveItsNormal) {
  Random random(2);
  std::size_t contacts = 0, dropped = 0;
  for (int run = 0; run < casesOf(8); ++run) {
    TestGeometry floor = testGeometry(sheet(9, 0, 0));
    const double angle = uniform(random, 0, 3);
    const Eigen::Matrix3d turn =
        Eigen::AngleAxisd(angle, randomPoint(random, -1, 1).normalized()).toRotationMatrix();
    for (Vector3d& p : floor.positions) p = turn * Vector3d(p[0], p[1], 0);
    for (const double radius : {0.0, 0.03})
      for (const bool isLine : {true, false}) {
        TestGeometry tool =
            isLine ? thread(random, 20, 0.05, radius, false) : particles(random, 20, radius);
        Positions now;
        const double low = radius + uniform(random, 0.01, 0.03);
        for (Vector3d& p : tool.positions) {
          p = Vector3d(0.2 + 0.6 * p[0], 0.2 + 0.6 * p[1], low + 0.02 * p[2]);
          now.push_back(turn * (p + Vector3d(0.06, 0.04, uniform(random, -0.03, 0))));
          p = turn * p;
        }
        for (const double thickness : {0.01, 0.04}) {
          const PairSettings pair{Method::Continuous, thickness};
          dropped += expectFirstImpacts(floor, tool, pair, floor.positions, now);
          dropped += expectFirstImpacts(tool, floor, pair, now, floor.positions);
          const CollisionData data =
              answer(settingsOf(Engine::Octree), floor, tool, pair, floor.positions, now);
          contacts += data.triangleVertex().size();
          const auto isTilted = [&](const auto& c) {
            return c.normal.cross(turn.col(2)).norm() > 1e-9;
          };
          EXPECT_EQ(std::ranges::count_if(data.triangleVertex(), isTilted), 0);
          EXPECT_EQ(std::ranges::count_if(data.edgeEdge(), isTilted), 0);
        }
      }
  }
  EXPECT_GE(contacts, leastOf(500));
  EXPECT_GE(dropped, leastOf(1000));
}

/// With equal positions and equal times, all contacts are tied.
TEST(FirstImpacts, TiesAreBrokenByOrder) {
  const TestGeometry below = testGeometry(flat(4, 0)), above = testGeometry(flat(4, 1));
  const Positions landed = flat(4, -0.5).positions;
  std::size_t dropped = 0, number = 0;
  for (const double thickness : {0.0625, 0.0, 0.3}) {
    if (isLeftOut(number++)) continue;
    dropped +=
        expectFirstImpacts(above, below, {Method::Continuous, thickness}, landed, below.positions);
    dropped +=
        expectFirstImpacts(below, above, {Method::Continuous, thickness}, below.positions, landed);
  }
  EXPECT_GE(dropped, leastOf(1000));
}

/// A refused contact does not represent other contacts.
TEST(FirstImpacts, FilteredContactsSuppressNoOthers) {
  Random random(3);
  const Mesh organ = sphere(8, 10, {0.5, 0.5, 0.55}, 0.35), cloth = sheet(9, 0, 0);
  Positions pressed = organ.positions;
  for (Vector3d& p : pressed) p[2] -= 0.5;
  const auto answerOf = [&](Contacts contacts) {
    PairRun run(settingsOf(Engine::Octree), organ, cloth, {Method::Continuous, 0.1, contacts},
                false);
    run.detection().setContactPredicate(run.a(), run.b(), [](const ContactFeatures& features) {
      return (features.a[0] * 7 + features.b[0] * 3) % 4 != 0;
    });
    run.detection().setCollisionFilter(run.b(), {1, 0xffffffff, Sidedness::Outer});
    run.step(organ.positions, pressed, cloth.positions, cloth.positions);
    return run.data();
  };
  const CollisionData all = answerOf(Contacts::All);
  const TestGeometry a = testGeometry(organ), b = testGeometry(cloth);
  const Rows expected = reduced(
      all, false,
      includedOf(all, {Moving{a, pressed}, Moving{b, b.positions}}, {Method::Continuous, 0.1}));
  EXPECT_LT(expected.contacts() + 50, Rows(all).contacts());
  EXPECT_GT(expected.contacts(), 50u);
  expectSameRows(Rows(answerOf(Contacts::Distinct)), expected);
}

/// Regular grids that fall onto each other touch where weights are 0 up to rounding.
TEST(FirstImpacts, OfAlignedGridsAreThoseOfTheDefinition) {
  Random random(18);
  std::size_t dropped = 0;
  for (std::uint32_t n = 2; n < 4; ++n)
    for (int run = 0; run < casesOf(40); ++run) {
      const TestGeometry floor = testGeometry(sheet(n, 0.0, 0.0));
      TestGeometry above = floor;
      const double along = uniform(random, -0.3, 0.3), time = uniform(random, 0.2, 0.8);
      for (Vector3d& p : above.positions) p += Vector3d(along, 0, time);
      Positions now = above.positions;
      for (Vector3d& p : now) p.z() -= 1;
      dropped += expectFirstImpacts(floor, above, {Method::Continuous}, floor.positions, now);
    }
  EXPECT_GE(dropped, leastOf(100));
}

}  // namespace
}  // namespace palpate::testing
