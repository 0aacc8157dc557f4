#include <palpate/ConstraintRows.h>

#include "Common/PairRun.h"
#include "Common/Sanitized.h"
#include "Common/StepBodies.h"
#include "Common/DegenerateCases.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <limits>
#include <map>
#include <string>
#include <vector>

// The law of contacts: with the positions at a contact's timeOfImpact, the weighted sum of the
// positions of its stencil is (distance + radii) * normal. For a ShapeContact this sum is point -
// pointOnShape. It holds for every method and every geometry type.

namespace palpate::testing {
namespace {

using Wide = long double;
using WideVector = Eigen::Matrix<Wide, 3, 1>;

/// A geometry's vertices in the world, as a solver has them.
struct Side {
  Positions before, now;
  std::vector<double> radii;  ///< one for all, or one per vertex

  WideVector at(std::uint32_t vertex, double time) const {
    const Wide t = time;
    if (time == 0) return before[vertex].cast<Wide>();
    if (time == 1) return now[vertex].cast<Wide>();
    return (1 - t) * before[vertex].cast<Wide>() + t * now[vertex].cast<Wide>();
  }
  double radius(std::uint32_t vertex) const {
    return radii.empty() ? 0.0 : radii.size() == 1 ? radii[0] : radii[vertex];
  }
};

/// How many contacts were tested, by their type.
using Seen = std::map<std::string, std::size_t>;

class Law {
 public:
  Law(const CollisionData& data, const Side& a, const Side& b, const PairSettings& settings,
      Seen& seen, bool hasCylinder = false)
      : m_data(data),
        m_a(a),
        m_b(b),
        m_asked(settings.method),
        m_method(data.validity().method),
        m_timeTolerance(settings.continuous.timeTolerance),
        m_distinct(settings.contacts == Contacts::Distinct),
        m_seen(seen),
        m_hasCylinder(hasCylinder) {}

  void expect() {
    for (const auto& c : m_data.vertexTriangle()) expectVertexTriangle(c, m_a, m_b);
    for (const auto& c : m_data.triangleVertex()) expectVertexTriangle(c, m_b, m_a);
    for (const auto& c : m_data.edgeEdge()) expectEdges(c);
    for (const auto& c : m_data.shape()) expectShape(c, m_a.now.empty() ? m_b : m_a);
    for (const auto& c : m_data.shapeShape()) expectShapes(c);
    const bool any = !m_data.vertexTriangle().empty() || !m_data.triangleVertex().empty() ||
                     !m_data.edgeEdge().empty() || !m_data.shape().empty() ||
                     !m_data.shapeShape().empty();
    if (looksAtEnd()) {
      EXPECT_EQ(m_data.earliestTimeOfImpact(), any ? 1.0 : kInfinity);
    }
  }

 private:
  static constexpr double kInfinity = std::numeric_limits<double>::infinity();

  bool looksAtEnd() const {
    return m_asked == Method::Proximity || m_asked == Method::Intersection;
  }

  /// L: the allowed error of the weighted sum. Distances and weights are within a few units in the
  /// last place of the largest coordinate difference. Times of Continuous are early by up to the
  /// tolerance.
  Wide error(const Stencil& stencil, const std::array<const Side*, 4>& sides, double time) const {
    const WideVector first = sides[0]->at(stencil.vertices[0], time);
    Wide largest = 0, motion = 0;
    const auto moved = [&](int i) -> WideVector {
      return sides[i]->at(stencil.vertices[i], 1) - sides[i]->at(stencil.vertices[i], 0);
    };
    for (int i = 1; i < 4; ++i) {
      largest = std::max(largest,
                         (sides[i]->at(stencil.vertices[i], time) - first).cwiseAbs().maxCoeff());
      motion = std::max(motion, (moved(i) - moved(0)).norm());
    }
    return 0x1p-47L * (largest + radiiOf(stencil, sides)) +
           (time < 1 ? Wide(m_timeTolerance) * motion : Wide(0)) +
           16 * Wide(std::numeric_limits<double>::denorm_min());
  }

  static Wide radiiOf(const Stencil& stencil, const std::array<const Side*, 4>& sides) {
    Wide radii = 0;
    for (int i = 0; i < 4; ++i)
      radii += std::abs(stencil.weights[i]) * sides[i]->radius(stencil.vertices[i]);
    return radii;
  }

  template <class Contact>
  void expectSum(const Contact& c, const std::array<const Side*, 4>& sides) {
    const Stencil s = stencil(c);
    expectTime(c.timeOfImpact);
    EXPECT_NEAR(c.normal.norm(), 1.0, 1e-15);
    WideVector sum = WideVector::Zero();
    const WideVector origin = sides[0]->at(s.vertices[0], c.timeOfImpact);
    for (int i = 0; i < 4; ++i)
      sum += Wide(s.weights[i]) * (sides[i]->at(s.vertices[i], c.timeOfImpact) - origin);
    const Wide length = c.distance + radiiOf(s, sides);
    EXPECT_LE((sum - length * c.normal.template cast<Wide>()).norm(),
              error(s, sides, c.timeOfImpact))
        << "distance " << c.distance << " at " << c.timeOfImpact << ", normal "
        << c.normal.transpose() << ", sum " << sum.template cast<double>().transpose();
  }

  void expectTime(double time) {
    if (looksAtEnd()) {
      ++m_seen["at the step's end"];
      EXPECT_EQ(time, 1.0);
    } else {
      ++m_seen["within the step"];
      EXPECT_GE(time, 0.0);
      EXPECT_LE(time, 1.0);
    }
  }

  static WideVector cross(const WideVector& u, const WideVector& v) {
    const Wide x = u.norm(), y = v.norm();
    if (x == 0 || y == 0) return WideVector::Zero();
    return (u / x).cross(v / y);
  }

  void expectVertexTriangle(const VertexTriangleContact& c, const Side& vertices,
                            const Side& triangles) {
    expectSum(c, {&vertices, &triangles, &triangles, &triangles});
    expectFeature(c);
    const auto at = [&](int i) { return triangles.at(c.vertices[i], c.timeOfImpact); };
    const WideVector u = at(1) - at(0), v = at(2) - at(0), winding = cross(u, v);
    const Wide sine = winding.norm();
    const WideVector normal = c.normal.cast<Wide>();
    const bool slim = !(sine > 1e-6L);  // plain arithmetic cannot find the winding normal
    if (m_method == Method::Intersection || isOfIntersection(c)) {
      ++m_seen["vertex of Intersection"];
      if (slim) return;
      if (c.distance == 0) return expectTouch(c, normal, winding);
      EXPECT_GT(normal.dot(winding), 0);
      const WideVector from = vertices.at(c.vertex, c.timeOfImpact) - at(0);
      const Wide height = winding.dot(from) / sine;
      if (std::abs(height) > 1e-9L * from.norm()) {
        EXPECT_EQ(c.distance < 0, height < 0);
      }
      if (c.weights.minCoeff() > 0) {
        EXPECT_NEAR(normal.dot(winding) / sine, 1, 1e-12L);
      }
      ++m_seen[c.distance < 0 ? "behind" : "in front"];
    } else if (c.distance == 0 && !hasRadii() && m_method == Method::Proximity && !slim) {
      expectTouch(c, normal, winding);
    }
  }

  /// A vertex that touches the triangle's interior has the normal of the triangle's plane, on
  /// either side.
  void expectTouch(const VertexTriangleContact& c, const WideVector& normal,
                   const WideVector& winding) {
    ++m_seen["touching"];
    if (c.feature == TriangleFeature::Face) {
      EXPECT_NEAR(std::abs(normal.dot(winding)) / winding.norm(), 1, 1e-12L);
    }
  }

  /// Auto, in a step that starts in intersection. Impacts, and with Contacts::All other contacts,
  /// may have been turned.
  bool isOfIntersection(const VertexTriangleContact& c) const {
    return c.distance < 0 && !hasRadii() && c.timeOfImpact == 1.0 && m_distinct;
  }
  bool hasRadii() const { return m_a.radius(0) > 0 || m_b.radius(0) > 0; }

  /// The closest point is a sum of exactly the vertices of the named feature.
  void expectFeature(const VertexTriangleContact& c) {
    const int feature = static_cast<int>(c.feature);
    std::map<std::uint32_t, double> weights;
    for (int i = 0; i < 3; ++i) weights[c.vertices[i]] += c.weights[i];
    for (const auto& [vertex, weight] : weights) {
      bool isOfFeature = c.feature == TriangleFeature::Face;
      if (feature < 3) isOfFeature = vertex == c.vertices[feature];
      if (feature >= 3 && feature < 6)
        isOfFeature = vertex == c.vertices[feature - 3] || vertex == c.vertices[(feature - 2) % 3];
      expectWeight(weight, isOfFeature);
    }
    if (c.vertices[1] == c.vertices[2]) {
      EXPECT_TRUE(feature <= 1 || c.feature == TriangleFeature::EdgeAB);
      ++m_seen["of a segment"];
    }
    if (c.vertices[0] == c.vertices[1] && c.vertices[1] == c.vertices[2]) {
      EXPECT_EQ(c.feature, TriangleFeature::CornerA);
    }
    ++m_seen[feature < 3 ? "at a corner" : feature < 6 ? "at an edge" : "at a face"];
  }
  void expectFeature(EdgeFeature feature, double weight) {
    expectWeight(1 - weight, feature != EdgeFeature::End);
    expectWeight(weight, feature != EdgeFeature::Start);
    ++m_seen[feature == EdgeFeature::Interior ? "within an edge" : "at an edge's end"];
  }
  static void expectWeight(double weight, bool isOfFeature) {
    EXPECT_EQ(weight != 0.0, isOfFeature);
  }

  void expectEdges(const EdgeEdgeContact& c) {
    expectSum(c, {&m_a, &m_a, &m_b, &m_b});
    expectFeature(c.featureA, c.weightA);
    expectFeature(c.featureB, c.weightB);
    ++m_seen["edges"];
    if (c.distance != 0 || hasRadii()) return;
    const auto direction = [&](const Side& side, const std::array<std::uint32_t, 2>& edge) {
      return WideVector(side.at(edge[1], c.timeOfImpact) - side.at(edge[0], c.timeOfImpact));
    };
    const WideVector normal = cross(direction(m_a, c.edgeA), direction(m_b, c.edgeB));
    const bool interior =
        c.featureA == EdgeFeature::Interior && c.featureB == EdgeFeature::Interior;
    if (interior && normal.norm() > 1e-6L) {
      EXPECT_NEAR(std::abs(normal.dot(c.normal.cast<Wide>())) / normal.norm(), 1, 1e-12L);
    }
  }

  void expectShape(const ShapeContact& c, const Side& side) {
    ++m_seen["shape"];
    expectTime(c.timeOfImpact);
    EXPECT_NEAR(c.normal.norm(), 1.0, 1e-15);
    WideVector point = WideVector::Zero();
    Wide radius = 0, size = 1;
    for (int i = 0; i < 3; ++i) {
      const WideVector x = side.at(c.vertices[i], c.timeOfImpact);
      point += Wide(c.weights[i]) * x;
      radius += Wide(c.weights[i]) * side.radius(c.vertices[i]);
      size += x.norm();
    }
    EXPECT_LE((point - c.point.cast<Wide>()).norm(), 0x1p-48L * size);
    EXPECT_LE((c.point.cast<Wide>() - c.pointOnShape.cast<Wide>() -
               (c.distance + radius) * c.normal.cast<Wide>())
                  .norm(),
              0x1p-48L * size);
  }

  void expectShapes(const ShapeShapeContact& c) {
    ++m_seen["two shapes"];
    expectTime(c.timeOfImpact);
    EXPECT_NEAR(c.normal.norm(), 1.0, 1e-15);
    // Contacts with overlapping cylinders are within 1e-3 of the size (Docs/Shapes.md).
    const double error = m_hasCylinder && c.distance < 0 ? 1e-3 : 0x1p-48;
    EXPECT_LE((c.pointA - c.pointB - c.distance * c.normal).norm(),
              error * (1 + c.pointA.norm() + c.pointB.norm()));
  }

  const CollisionData& m_data;
  const Side &m_a, &m_b;
  const Method m_asked, m_method;
  const double m_timeTolerance;
  bool m_distinct;
  Seen& m_seen;
  const bool m_hasCylinder;
};

Side sideOf(const StepBody& body) { return {body.before, body.now, body.radii}; }

std::vector<PairSettings> everySetting(double thickness) {
  std::vector<PairSettings> all{{Method::Intersection, 0.0}, {Method::Auto, 0.0}};
  for (const Contacts contacts : {Contacts::Distinct, Contacts::All}) {
    all.push_back({Method::Proximity, thickness, contacts});
    all.push_back({Method::Continuous, 0.0, contacts});
    all.push_back({Method::Continuous, thickness, contacts});
    all.push_back({Method::Auto, thickness, contacts});
    all.push_back({.method = Method::Auto,
                   .thickness = thickness,
                   .contacts = contacts,
                   .automatic = {.motionTolerance = 4 * thickness}});
    all.push_back({.method = Method::Auto,
                   .thickness = thickness,
                   .contacts = contacts,
                   .automatic = {.motionTolerance = 0.0}});
  }
  all.push_back(
      {.method = Method::Continuous, .thickness = 0.0, .continuous = {.timeTolerance = 1e-2}});
  all.push_back({.method = Method::Continuous,
                 .thickness = thickness,
                 .continuous = {.timeTolerance = 1e-2}});
  return all;
}

/// Steps that start in intersection, as random triangles do.
TEST(ContactLaw, HoldsForEveryMethodAndGeometry) {
  std::map<std::pair<Method, Method>, Seen> byMethod;  // asked, and answered
  std::size_t number = 0;
  for (const double motion : {0.0, 0.01, 0.2}) {
    Random random(181);
    const std::vector<StepBody> all = bodiesOfEveryType(random, motion);
    for (std::size_t i = 0; i < all.size(); ++i)
      for (std::size_t j = i; j < all.size(); ++j) {
        const StepBody &first = all[i], &second = all[j];
        for (const bool turned : {false, true}) {
          if (turned && i == j) continue;
          const StepBody &a = turned ? second : first, &b = turned ? first : second;
          for (const PairSettings& settings : everySetting(0.05)) {
            if (isLeftOut(number++)) continue;
            OctreeBasedCD collisions;
            const GeometryId idA = a.add(collisions), idB = i == j ? idA : b.add(collisions);
            try {
              collisions.addCollisionPair(idA, idB, settings);
              a.move(collisions, idA);
              if (i != j) b.move(collisions, idB);
            } catch (const Error& error) {
              EXPECT_EQ(error.code(), ErrorCode::UnsupportedMethod);
              continue;
            }
            collisions.detectCollision();
            const CollisionData& data = collisions.collisionData(idA, idB);
            const Method method = data.validity().method;
            SCOPED_TRACE(a.name + " with " + b.name + ", asked " + toString(settings.method) +
                         ", answered " + toString(method) + ", thickness " +
                         std::to_string(settings.thickness) + ", motion " + std::to_string(motion));
            Law(data, sideOf(a), sideOf(b), settings, byMethod[{settings.method, method}],
                a.name == "cylinder" || b.name == "cylinder")
                .expect();
            if (HasFatalFailure() || HasNonfatalFailure()) return;
          }
        }
      }
  }
  // Each method had contacts of each type that it supports.
  const auto count = [&](Method asked, Method answered, const char* what) {
    return byMethod[{asked, answered}][what];
  };
  EXPECT_GE(count(Method::Intersection, Method::Intersection, "behind"), leastOf(100));
  // Where no end of a crossing edge is behind. A vertex is in front only where no edge has crossed.
  EXPECT_GE(count(Method::Intersection, Method::Intersection, "edges"), leastOf(10));
  EXPECT_GE(count(Method::Intersection, Method::Intersection, "in front"), leastOf(1));
  for (const Method method : {Method::Proximity, Method::Continuous}) {
    EXPECT_GE(count(method, method, "edges"), leastOf(1000));
    EXPECT_GE(count(method, method, "shape"), leastOf(1000));
    EXPECT_GE(count(method, method, "two shapes"), leastOf(50));
    for (const char* what : {"at a corner", "at an edge", "at a face", "of a segment"})
      EXPECT_GE(count(method, method, what), leastOf(100)) << what;
    for (const char* what : {"within an edge", "at an edge's end"})
      EXPECT_GE(count(method, method, what), leastOf(100)) << what;
  }
  for (const Method method : {Method::Proximity, Method::Continuous, Method::Auto})
    EXPECT_GE(count(Method::Auto, method, "edges"), leastOf(100)) << static_cast<int>(method);
  EXPECT_GE(count(Method::Auto, Method::Intersection, "behind"), leastOf(30));
  EXPECT_GE(count(Method::Auto, Method::Continuous, "behind"), leastOf(10));
  EXPECT_GE(count(Method::Auto, Method::Auto, "behind"), leastOf(10));
}

/// There and back, so that octrees are refitted.
void stepThereAndBack(PairRun& run, const DegenerateCase& input, bool back) {
  const auto aBefore = input.aBefore(), bBefore = input.bBefore();
  if (back)
    run.step(input.a.positions, aBefore, input.b.positions, bBefore);
  else
    run.step(aBefore, input.a.positions, bBefore, input.b.positions);
}

/// Degenerate meshes, coordinates near the ends of the range of double, and self-collision. The
/// contacts match brute force bit for bit, with octrees that are refitted and rebuilt.
TEST(ContactLaw, HoldsForDegenerateMeshes) {
  Seen seen;
  std::map<std::string, std::size_t> met;
  std::size_t number = 0;
  for (const DegenerateCase& input : degenerateCases()) {
    const Side a{input.aBefore(), input.a.positions, {}}, b{input.bBefore(), input.b.positions, {}};
    for (const MethodCase& method : methodCases(input.thickness)) {
      if (isLeftOut(number++)) continue;
      SCOPED_TRACE(input.name + ", " + method.name);
      PairRun truth(settingsOf(Engine::BruteForce), input.a, input.b, method.settings,
                    !input.large);
      stepThereAndBack(truth, input, false);
      truth.expectWellFormed(input.a, input.b);
      for (const CollisionPair& pair : truth.detection().pairs())
        Law(truth.detection().collisionData(pair.a, pair.b), pair.a == truth.a() ? a : b,
            pair.b == truth.a() ? a : b, method.settings, seen)
            .expect();
      const std::vector<Rows> there = truth.answers();
      met[method.name] += there.front().anything();
      stepThereAndBack(truth, input, true);
      for (const Settings& octree :
           {settingsOf(Engine::Octree), settingsOf(Engine::Octree, 2, OctreeUpdate::Rebuild)}) {
        SCOPED_TRACE(nameOf(octree));
        PairRun run(octree, input.a, input.b, method.settings, !input.large);
        stepThereAndBack(run, input, false);
        expectSame(run.answers(), there);
        run.detect();  // without new positions both stay
        expectSame(run.answers(), there);
        stepThereAndBack(run, input, true);
        expectSame(run.answers(), truth.answers());
      }
      if (HasFatalFailure() || HasNonfatalFailure()) return;
    }
  }
  for (const auto& [method, count] : met) EXPECT_GE(count, leastOf(20)) << method;
  EXPECT_GE(seen["touching"], leastOf(1000));
  EXPECT_GE(seen["edges"], leastOf(1000));
}

/// Counts that follow from the definitions of some cases, so that both engines cannot be wrong
/// alike: triangles that intersect, contacts of Intersection, of Proximity, and those of vertices.
TEST(ContactLaw, DegenerateCasesMatchTheDefinition) {
  struct Range {
    std::size_t least = 0, most = ~std::size_t{0};
  };
  const std::map<std::string, std::array<Range, 4>> definitions{
      {"vertex exactly on face", {{{3, 3}, {1, 1}, {}, {}}}},
      {"vertex exactly on vertex", {{{}, {6}, {}, {1, 1}}}},  // both vertices, and edges of both
      {"one closed mesh inside another", {{{}, {0, 0}, {0, 0}, {}}}},
      {"one closed mesh inside another, reached", {{{}, {0, 0}, {1}, {}}}},
      {"empty mesh", {{{}, {0, 0}, {0, 0}, {}}}},
      {"two empty meshes", {{{}, {0, 0}, {0, 0}, {}}}},
      {"one triangle twice named", {{{24 * 24, 24 * 24}, {}, {3, 3}, {3, 3}}}}};
  std::size_t found = 0;
  for (const DegenerateCase& input : degenerateCases()) {
    if (!definitions.contains(input.name)) continue;
    SCOPED_TRACE(input.name);
    ++found;
    const auto rowsOf = [&](const PairSettings& settings) {
      PairRun run(settingsOf(Engine::Octree), input.a, input.b, settings, false);
      stepThereAndBack(run, input, false);
      return run.answers().front();
    };
    const Rows intersection = rowsOf({Method::Intersection, 0, Contacts::All}),
               distinct = rowsOf({Method::Proximity, input.thickness, Contacts::Distinct});
    const std::array counts{intersection.intersectingTriangles.size(), intersection.contacts(),
                            distinct.contacts(), distinct.vertexTriangle.size()};
    for (std::size_t i = 0; i < counts.size(); ++i) {
      EXPECT_GE(counts[i], definitions.at(input.name)[i].least) << i;
      EXPECT_LE(counts[i], definitions.at(input.name)[i].most) << i;
    }
  }
  EXPECT_EQ(found, definitions.size());
}

}  // namespace
}  // namespace palpate::testing
