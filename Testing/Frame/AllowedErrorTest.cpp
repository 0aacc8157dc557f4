// Method::Auto with an attached distance field or proxy, beside exact methods.
#include <palpate/Capture.h>
#include <palpate/DistanceField.h>
#include <palpate/OctreeBasedCD.h>

#include "Common/ExpectRefused.h"
#include "Common/FailingAllocation.h"
#include "Common/PairRun.h"
#include "Common/FieldMeshes.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <optional>

namespace palpate::testing {
namespace {

using Eigen::AngleAxisd;
using Eigen::Matrix3d;
using Eigen::Vector3d;
using Points = std::vector<Vector3d>;
using Field = std::shared_ptr<const DistanceField>;

constexpr double kErrorBound = 0.02, kBand = 0.4, kThickness = 0.1;

struct Body {
  Mesh mesh;
  Field field;
};

Body bodyOf(Mesh mesh) {
  const auto build = [&] {
    return DistanceField::build({mesh.positions, mesh.triangles},
                                {.errorBound = kErrorBound, .band = kBand, .threads = 1});
  };
  Field field = std::make_shared<const DistanceField>(build());
  return {std::move(mesh), std::move(field)};
}

/// A ring around the last axis, from 0.7 to 1.3; closed, and with a gap of a quarter.
const Body& ring(bool isOpen) {
  static const Body closed = bodyOf(torusMesh(24, 12)),
                    open = bodyOf([] {
                      Mesh mesh = torusMesh(24, 12);
                      mesh.triangles.resize(mesh.triangles.size() / 4 * 3);
                      return mesh;
                    }());
  return isOpen ? open : closed;
}

enum class Kind { Fine, Coarse, Lines, Particles, Radii };
constexpr std::array kKinds{Kind::Fine, Kind::Coarse, Kind::Lines, Kind::Particles, Kind::Radii};
bool isMesh(Kind kind) { return kind == Kind::Fine || kind == Kind::Coarse; }

/// A ball, or lines and points on it.
constexpr double kBallRadius = 0.3, kRadius = 0.02;
Mesh ball(Kind kind) {
  if (kind == Kind::Fine) return sphere(12, 16, Vector3d::Zero(), kBallRadius);
  return sphere(5, 7, Vector3d::Zero(), kBallRadius);
}

/// One end of a step.
struct End {
  Points other;
  Matrix3d rotation = Matrix3d::Identity();
  Vector3d translation = Vector3d::Zero();
};

/// A geometry beside a body that has a field or the leaves of a proxy.
struct AttachedScene {
  template <class AddOther, class Attach>
  AttachedScene(const Settings& settings, const Mesh& mesh, const End& start,
                const PairSettings& pair, AddOther&& addOther, Attach&& attach)
      : detection(settings), other(addOther(detection)), body(addMesh(detection, mesh)) {
    attach(detection, body);
    detection.setTransform(body, {start.rotation, start.translation});
    detection.addCollisionPair(other, body, pair);
    detection.advance();
  }
  const CollisionData& step(const End& before, const End& now) {
    detection.setPositions(other, before.other, now.other);
    detection.setTransform(body, {before.rotation, before.translation},
                           {now.rotation, now.translation});
    detection.detectCollision();
    detection.advance();
    return data();
  }
  const CollisionData& data() const { return detection.collisionData(other, body); }

  OctreeBasedCD detection;
  GeometryId other, body;
};

AttachedScene sceneWithField(Kind kind, const Body& body, const End& start,
                             const PairSettings& pair, const Settings& settings) {
  const auto addOther = [&](OctreeBasedCD& detection) {
    const Points& at = start.other;
    std::vector<Segment> segments;
    for (std::uint32_t v = 0; v + 1 < at.size(); ++v) segments.push_back({v, v + 1});
    std::vector<double> radii;
    for (std::size_t v = 0; v < at.size(); ++v) radii.push_back(0.005 * (v % 5));
    if (isMesh(kind)) return detection.addTriangleMesh(at, ball(kind).triangles);
    if (kind == Kind::Particles) return detection.addPointSet(at, kRadius);
    return kind == Kind::Lines ? detection.addLineMesh(at, segments, kRadius)
                               : detection.addLineMesh(at, segments, radii);
  };
  return {settings, body.mesh, start, pair, addOther, [&](OctreeBasedCD& detection, GeometryId id) {
            detection.attachDistanceField(id, body.field);
          }};
}

Matrix3d turnBy(Random& random, double by) {
  const double angle = uniform(random, -by, by);
  return AngleAxisd(angle, randomPoint(random, -1, 1).normalized()).toRotationMatrix();
}

/// A ball that comes near the ring and goes away again. The ring turns, and both are carried along.
class Walk {
 public:
  Walk(std::uint64_t seed, Kind kind) : m_random(seed), m_ball(ball(kind).positions) {
    m_gap = uniform(m_random, 0, 0.2);
    m_place = uniform(m_random, -3, 3);
    m_turn = turnBy(m_random, 3);
    m_now.rotation = turnBy(m_random, 3);
    m_now.translation = randomPoint(m_random, -2, 2);
    place();
  }

  const End& now() const { return m_now; }
  const End& before() const { return m_before; }

  /// Makes the next step. before() is now and then off the last end, as after a solver.
  void step() {
    m_before = m_now;
    const std::uint64_t kind = m_random() % 16;
    if (kind == 0) {  // at rest
    } else if (kind < 10) {
      const double size = kind < 4 ? 0.002 : kind < 7 ? 0.01 : 0.03;
      m_gap += uniform(m_random, -size, size);
      m_place += uniform(m_random, -size, size);
      m_turn = turnBy(m_random, size) * m_turn;
      if (kind % 2) m_now.rotation = turnBy(m_random, size) * m_now.rotation;
    } else if (kind < 12) {  // about the distance at the end
      const double motion = std::clamp(m_gap - uniform(m_random, 0, 2 * kErrorBound), 0.0, 0.2);
      m_place += motion / 1.6;
    } else if (kind < 14) {  // fast
      m_gap = uniform(m_random, -0.1, 0.4);
      m_place += uniform(m_random, -1, 1);
    } else {  // towards the distance of contacts
      m_gap = uniform(m_random, 0.03, 0.15);
    }
    m_now.translation += randomPoint(m_random, -1, 1);  // common
    if (kind == 0) m_now.translation = m_before.translation;
    place();
    if (kind == 0) return;
    if (m_random() % 6 == 0)
      for (Vector3d& p : m_before.other) p += randomPoint(m_random, -0.003, 0.003);
  }

 private:
  void place() {
    const Matrix3d around = AngleAxisd(m_place, Vector3d::UnitZ()).toRotationMatrix();
    const Vector3d centre = (1.3 + kBallRadius + m_gap) * Vector3d::UnitX();
    m_now.other.clear();
    for (const Vector3d& p : m_ball)
      m_now.other.push_back(m_now.rotation * (around * (m_turn * p + centre)) + m_now.translation);
  }

  Random m_random;
  Points m_ball;
  double m_gap, m_place;
  Matrix3d m_turn;
  End m_before, m_now;
};

std::size_t impactsOf(const CollisionData& data) {
  std::size_t impacts = data.intersectingTriangles().size();
  forEachContact(data, [&](const auto& c) { impacts += c.timeOfImpact < 1.0; });
  return impacts;
}

PairSettings pairOf(double allowedError, Contacts contacts = Contacts::Distinct) {
  PairSettings pair{.thickness = kThickness, .contacts = contacts};
  pair.allowedError = allowedError;
  return pair;
}

/// The contacts of a step that the field answered, beside exact distances at its end.
void expectWithinError(const CollisionData& data, const SpatialQueries& queries, GeometryId body,
                       const End& now, bool isClosed) {
  const auto exactAt = [&](const Vector3d& x) {
    return isClosed ? queries.signedDistance(body, x).distance
                    : queries.closestPoint(body, x)->distance;
  };
  EXPECT_EQ(data.errorBound(), kErrorBound);
  const double thickness = data.validity().effectiveThickness;
  EXPECT_GE(thickness, kThickness + data.validity().displacement);
  std::vector<bool> isContact(now.other.size(), false);
  for (const ShapeContact& c : data.shape()) {
    if (c.element == ShapeElement::Vertex) isContact[c.id] = true;
    const double value = (c.point - c.pointOnShape).norm();
    if (data.validity().displacement > 0.0) {
      EXPECT_NEAR(value, std::abs(exactAt(c.point)), kErrorBound * (1 + 1e-9));
      EXPECT_GT(c.distance, data.validity().displacement);
    }
    EXPECT_LE(c.distance, thickness);
  }
  if (data.validity().displacement == 0.0) return;  // FieldContactsTest has these
  for (std::size_t v = 0; v < now.other.size(); ++v) {
    const double exact = exactAt(now.other[v]);
    if (exact < thickness - kErrorBound - 1e-9) {
      EXPECT_TRUE(isContact[v]) << v;
    }
    if (exact > thickness + kRadius + kErrorBound + 1e-9) {
      EXPECT_FALSE(isContact[v]) << v;
    }
  }
}

}  // namespace

/// Steps that the field does not answer have the bits of the exact answer. In those that it does
/// answer nothing touches, and what comes within the thickness is a contact.
TEST(AllowedError, FieldsMissNoImpactAndTrianglesAnswerTheOtherSteps) {
  std::map<MethodReason, std::size_t> byField, exactly;
  std::size_t contacts = 0, impacts = 0, nearby = 0;
  for (std::uint64_t seed = 0; seed < static_cast<std::uint64_t>(casesOf(12, 3)); ++seed)
    for (const Kind kind : kKinds)
      for (const bool isOpen : {false, true}) {
        const Body& body = ring(isOpen);
        const Contacts filter = seed % 3 == 2 ? Contacts::All : Contacts::Distinct;
        Walk walk(100 * seed + static_cast<std::uint64_t>(kind), kind);
        const auto sceneOf = [&](const PairSettings& pair) {
          return sceneWithField(kind, body, walk.now(), pair, settingsOf(Engine::Octree));
        };
        AttachedScene allowed = sceneOf(pairOf(kErrorBound, filter)),
                      exact = sceneOf(pairOf(0, filter));
        PairSettings touches{Method::Continuous, 0.0, Contacts::All};
        if (kind == Kind::Radii) touches = {Method::Proximity, 1e-9, Contacts::All};
        AttachedScene touching = sceneOf(touches);
        for (int i = 0; i < casesOf(40); ++i) {
          SCOPED_TRACE("seed " + std::to_string(seed) + ", kind " +
                       std::to_string(static_cast<int>(kind)) + (isOpen ? ", open" : "") +
                       ", step " + std::to_string(i));
          walk.step();
          const CollisionData& answer = allowed.step(walk.before(), walk.now());
          const CollisionData& truth = exact.step(walk.before(), walk.now());
          const CollisionData& touched = touching.step(walk.before(), walk.now());
          const Validity& validity = answer.validity();
          impacts += impactsOf(truth) > 0;
          if (validity.reason != MethodReason::AllowedError) {
            EXPECT_EQ(answer.hash(), truth.hash());
            EXPECT_EQ(validity, truth.validity());
            ++exactly[validity.reason];
            nearby += !truth.vertexTriangle().empty() && truth.validity().displacement < 0.02;
            continue;
          }
          ++byField[truth.validity().reason];
          EXPECT_EQ(validity.method, Method::DistanceField);
          EXPECT_FALSE(validity.trusted);
          EXPECT_EQ(validity.displacement, truth.validity().displacement);
          EXPECT_EQ(validity.displacementLimit > 0, true);
          contacts += answer.shape().size();
          expectWithinError(answer, exact.detection.queries(), exact.body, walk.now(), !isOpen);
          if (validity.displacement == 0.0) continue;
          EXPECT_TRUE(touched.vertexTriangle().empty() && touched.edgeEdge().empty() &&
                      touched.triangleVertex().empty());
          if (isMesh(kind)) {
            EXPECT_TRUE(validity.startedApart);
            EXPECT_EQ(truth.validity().startedApart, true);
            EXPECT_TRUE(truth.validity().reason != MethodReason::Slow || impactsOf(truth) == 0u);
          }
          if (HasFailure()) return;
        }
      }
  EXPECT_GE(byField[MethodReason::Still], leastOf(20, 5));
  EXPECT_GE(byField[MethodReason::Slow], leastOf(200, 40));
  EXPECT_GE(byField[MethodReason::Cheapest], leastOf(100, 20));
  EXPECT_GE(byField[MethodReason::NoAlternative], leastOf(400, 80));
  EXPECT_GE(exactly[MethodReason::Slow], leastOf(100, 20));
  EXPECT_GE(exactly[MethodReason::Fast], leastOf(100, 20));
  EXPECT_GE(exactly[MethodReason::NoAlternative], leastOf(200, 40));
  EXPECT_GE(contacts, leastOf(5000, 1000));
  EXPECT_GE(impacts, leastOf(300, 60));
  EXPECT_GE(nearby, leastOf(100, 20));
}

/// Exact methods answer what a field does not know: filters by side, and inside.
TEST(AllowedError, FieldsDoNotAnswerInsideNorOneSidedGeometries) {
  const Body box = bodyOf(boxMesh({-1, -1, -1}, {1, 1, 1}));
  const Mesh small = sphere(8, 10, Vector3d::Zero(), 0.3);
  const auto reasonAt = [&](double x, bool isOneSided) {
    OctreeBasedCD detection(settingsOf(Engine::Octree));
    Points before = small.positions, now = small.positions;
    for (Vector3d& p : before) p.x() += x;
    for (Vector3d& p : now) p.x() += x + 1e-3;
    const GeometryId other = addMesh(detection, small), body = addMesh(detection, box.mesh);
    detection.attachDistanceField(body, box.field);
    if (isOneSided) detection.setCollisionFilter(other, {.sidedness = Sidedness::Outer});
    detection.addCollisionPair(other, body, pairOf(kErrorBound));
    detection.setPositions(other, before, now);
    detection.detectCollision();
    return detection.collisionData(other, body).validity().reason;
  };
  EXPECT_EQ(reasonAt(1.36, false), MethodReason::AllowedError);
  EXPECT_EQ(reasonAt(1.36, true), MethodReason::Slow);
  EXPECT_EQ(reasonAt(0, false), MethodReason::Slow);
  EXPECT_EQ(reasonAt(5, false), MethodReason::AllowedError);
}

namespace {

constexpr double kParticle = 0.01, kProxyError = 0.01, kNear = 0.04;

/// Particles around a ring. Most rest on it or slide over it, others fly, and some cross it.
class Cloud {
 public:
  Cloud(std::uint64_t seed, bool isOpen) : m_random(seed), m_mesh(ring(isOpen).mesh) {
    m_now.rotation = turnBy(m_random, 3);
    m_now.translation = randomPoint(m_random, -2, 2);
    for (int i = 0; i < 400; ++i) m_offsets.push_back(offset(i));
    place();
  }
  const End& before() const { return m_before; }
  const End& now() const { return m_now; }

  void step() {
    m_before = m_now;
    const std::uint64_t kind = m_random() % 5;
    if (kind == 0) return;  // at rest
    if (kind > 2) m_now.rotation = turnBy(m_random, kind == 3 ? 1e-3 : 0.2) * m_now.rotation;
    m_now.translation += randomPoint(m_random, -0.5, 0.5);
    for (std::size_t i = 0; i < m_offsets.size(); ++i) {
      const std::uint64_t motion = m_random() % 8;
      if (motion < 4) m_offsets[i] += randomPoint(m_random, -1, 1) * 0.002;
      if (motion == 5) m_offsets[i] += randomPoint(m_random, -1, 1) * 0.02;
      if (motion == 6) m_offsets[i] = offset(i);
    }
    place();
  }

 private:
  /// From a triangle's centre, in the body's frame.
  Vector3d offset(std::size_t i) {
    const auto& [a, b, c] = m_mesh.triangles[(7 * i) % m_mesh.triangles.size()];
    const Vector3d &p = m_mesh.positions[a], u = m_mesh.positions[b] - p,
                   v = m_mesh.positions[c] - p;
    const Vector3d along = u.cross(v).normalized() * uniform(m_random, -0.04, 0.12);
    return along + randomPoint(m_random, -1, 1) * 0.02;
  }
  void place() {
    m_now.other.clear();
    for (std::size_t i = 0; i < m_offsets.size(); ++i) {
      const auto& [a, b, c] = m_mesh.triangles[(7 * i) % m_mesh.triangles.size()];
      const Vector3d centre =
          (m_mesh.positions[a] + m_mesh.positions[b] + m_mesh.positions[c]) / 3.0;
      m_now.other.push_back(m_now.rotation * (centre + m_offsets[i]) + m_now.translation);
    }
  }

  Random m_random;
  const Mesh& m_mesh;
  Points m_offsets;
  End m_before, m_now;
};

/// Particles with one radius, or with radii of their own.
AttachedScene sceneWithProxy(const Cloud& cloud, bool isOpen, bool hasRadii,
                             const PairSettings& pair, const Settings& settings) {
  const auto addOther = [&](OctreeBasedCD& detection) {
    std::vector<double> radii(cloud.now().other.size(), kParticle);
    radii[3] = 0.5 * kParticle;
    return hasRadii ? detection.addPointSet(cloud.now().other, radii)
                    : detection.addPointSet(cloud.now().other, kParticle);
  };
  return {settings,
          ring(isOpen).mesh,
          cloud.now(),
          pair,
          addOther,
          [](OctreeBasedCD& detection, GeometryId id) {
            detection.attachSurfaceProxy(
                id, SurfaceProxySettings{
                        .reach = 0.1, .errorBound = kProxyError, .widestNormalCone = 0.6});
          }};
}

PairSettings pairOfCloud(double allowedError) {
  PairSettings pair{.thickness = kNear};
  pair.allowedError = allowedError;
  return pair;
}

}  // namespace

/// Particles that touch the body in the step have the contacts of the exact answer. What comes
/// within the thickness is a contact. Contacts at the step's end are within the error.
TEST(AllowedError, ProxiesMissNoImpact) {
  std::size_t byProxy = 0, exactly = 0, touched = 0;
  for (std::uint64_t seed = 0; seed < static_cast<std::uint64_t>(casesOf(4)); ++seed) {
    const bool isOpen = seed % 2 == 1, hasRadii = seed % 4 > 1;
    Cloud cloud(seed, isOpen);
    const auto sceneOf = [&](const PairSettings& pair, bool withRadii) {
      return sceneWithProxy(cloud, isOpen, withRadii, pair, settingsOf(Engine::Octree));
    };
    AttachedScene allowed = sceneOf(pairOfCloud(kProxyError), hasRadii),
                  exact = sceneOf(pairOfCloud(0), hasRadii),
                  touching = sceneOf({Method::Continuous, 0.0, Contacts::All}, false),
                  approaching = sceneOf(
                      {Method::Continuous, kNear - 1.1 * kProxyError, Contacts::All}, false);
    for (int i = 0; i < casesOf(30); ++i) {
      SCOPED_TRACE("seed " + std::to_string(seed) + ", step " + std::to_string(i));
      cloud.step();
      const CollisionData& answer = allowed.step(cloud.before(), cloud.now());
      const CollisionData& truth = exact.step(cloud.before(), cloud.now());
      const Validity& validity = answer.validity();
      ASSERT_EQ(validity.reason, MethodReason::AllowedError);
      EXPECT_EQ(validity.method, Method::Proxy);
      EXPECT_FALSE(validity.trusted);
      EXPECT_EQ(validity.displacement, truth.validity().displacement);
      EXPECT_EQ(validity.atEnd + validity.atImpact, answer.shape().size());
      EXPECT_TRUE(answer.vertexTriangle().empty());
      EXPECT_LE(answer.errorBound(), kProxyError * (1 + 1e-6) + 1e-8);
      EXPECT_GE(validity.effectiveThickness, kNear);
      const double error = answer.errorBound() + 1e-12;
      const std::size_t count = cloud.now().other.size();
      std::vector<std::vector<ShapeContact>> found(count);
      std::vector<std::vector<VertexTriangleContact>> expected(count);
      for (const ShapeContact& c : answer.shape()) found[c.id].push_back(c);
      for (const VertexTriangleContact& c : truth.vertexTriangle()) expected[c.vertex].push_back(c);
      const auto equals = [](const ShapeContact& c, const VertexTriangleContact& e) {
        return c.distance == e.distance && c.timeOfImpact == e.timeOfImpact && c.normal == e.normal;
      };
      const SpatialQueries queries = allowed.detection.queries();
      const auto exactAt = [&](std::uint32_t v) {
        const Vector3d& p = cloud.now().other[v];
        return isOpen ? queries.closestPoint(allowed.body, p)->distance
                      : queries.signedDistance(allowed.body, p).distance;
      };
      for (std::uint32_t v = 0; v < count; ++v) {
        const bool isExact =
            !found[v].empty() && found[v].size() == expected[v].size() &&
            std::equal(found[v].begin(), found[v].end(), expected[v].begin(), equals);
        exactly += isExact;
        if (isExact) continue;
        const double distance = exactAt(v),
                     radius = hasRadii && v == 3 ? 0.5 * kParticle : kParticle;
        if (found[v].empty()) {
          EXPECT_GE(std::abs(distance), kNear + radius - error) << "particle " << v;
          continue;
        }
        ++byProxy;
        ASSERT_EQ(found[v].size(), 1u);
        const ShapeContact& c = found[v].front();
        EXPECT_EQ(c.timeOfImpact, 1.0);
        EXPECT_NEAR(c.distance + radius, distance, error) << v;
        EXPECT_LE(c.distance, validity.effectiveThickness);
        EXPECT_LT((c.point - c.pointOnShape - (c.distance + radius) * c.normal).norm(), 1e-12);
      }
      if (validity.displacement == 0.0) continue;
      for (const VertexTriangleContact& c :
           touching.step(cloud.before(), cloud.now()).vertexTriangle()) {
        ++touched;
        const std::uint32_t v = c.vertex;
        if (hasRadii) continue;
        ASSERT_EQ(found[v].size(), expected[v].size()) << v;
        for (std::size_t k = 0; k < found[v].size(); ++k) {
          EXPECT_TRUE(equals(found[v][k], expected[v][k])) << v;
          EXPECT_EQ(found[v][k].id, v);
        }
      }
      for (const VertexTriangleContact& c :
           approaching.step(cloud.before(), cloud.now()).vertexTriangle())
        EXPECT_TRUE(hasRadii || !found[c.vertex].empty()) << c.vertex;
      if (HasFailure()) return;
    }
  }
  EXPECT_GE(byProxy, leastOf(10000));
  EXPECT_GE(exactly, leastOf(1000));
  EXPECT_GE(touched, leastOf(500));
}

TEST(AllowedError, SteadyFramesAllocateNothing) {
  const auto expectNone = [](int frames, auto&& step) {
    for (int frame = 0; frame < 2 * frames; ++frame) {
      if (frame == frames) FailingAllocation::arm(0);
      step(frame);
    }
    FailingAllocation::disarm();
#ifndef PALPATE_VALIDATE  // validation itself allocates
    EXPECT_EQ(FailingAllocation::count(), 0u);
#endif
  };
  const Cloud start(5, false);
  std::vector<Cloud> steps(6, start);
  for (std::size_t i = 0; i < 6; ++i)
    for (std::size_t k = 0; k <= i; ++k) steps[i].step();
  for (const int threads : {1, 2}) {
    const End at = Walk(3, Kind::Fine).now();
    AttachedScene scene = sceneWithField(Kind::Fine, ring(false), at, pairOf(kErrorBound),
                                         settingsOf(Engine::Octree, threads));
    std::size_t byField = 0, exactly = 0;
    End before = at, now = at;
    // The ball comes near enough to touch, and goes away again.
    const Vector3d towards = (at.translation - at.other[at.other.size() / 2]).normalized();
    expectNone(60, [&](int frame) {
      std::swap(before, now);
      for (std::size_t v = 0; v < now.other.size(); ++v)
        now.other[v] = at.other[v] + (0.02 * ((frame % 15) - 3)) * towards;
      const Validity& validity = scene.step(before, now).validity();
      (validity.reason == MethodReason::AllowedError ? byField : exactly) += 1;
    });
    EXPECT_GT(std::min(byField, exactly), 8u);

    AttachedScene smoke = sceneWithProxy(start, false, false, pairOfCloud(kProxyError),
                                         settingsOf(Engine::Octree, threads));
    expectNone(12, [&](int frame) {
      const Cloud& cloud = steps[static_cast<std::size_t>(frame) % 6];
      EXPECT_GT(smoke.step(cloud.before(), cloud.now()).shape().size(), 0u);
    });
  }
}

TEST(AllowedError, ProxiesAnswerWhereTheyAreAttachedAndAllowed) {
  Cloud cloud(6, false);
  AttachedScene scene =
      sceneWithProxy(cloud, false, false, pairOfCloud(kProxyError), settingsOf(Engine::Octree));
  OctreeBasedCD& detection = scene.detection;
  const auto methodNow = [&] {
    detection.detectCollision();
    return scene.data().validity().method;
  };
  EXPECT_EQ(methodNow(), Method::Proxy);
  const std::uint64_t hash = scene.data().hash();
  OctreeBasedCD again = setUp(detection.problem());
  again.detectCollision();
  EXPECT_EQ(again.collisionData(GeometryId{0}, GeometryId{1}).hash(), hash);
  expectRefused(ErrorCode::NotAvailable, "has the leaves of a proxy, which a capture cannot hold",
                [&] { capture(detection, "proxy.capture"); });
  PairSettings wide = pairOfCloud(kProxyError);
  wide.thickness = 0.1;  // with the radius, more than the leaves reach
  for (const auto& [pair, method] :
       {std::pair(pairOfCloud(0.5 * kProxyError), Method::Proximity),
        std::pair(wide, Method::Proximity), std::pair(pairOfCloud(kProxyError), Method::Proxy)}) {
    detection.setPairSettings(scene.other, scene.body, pair);
    EXPECT_EQ(methodNow(), method);
  }
  EXPECT_EQ(scene.data().hash(), hash);
  const Mesh& mesh = ring(false).mesh;
  expectRefused(ErrorCode::UnsupportedMethod, "has the leaves of a proxy attached",
                [&] { detection.setPositions(scene.body, mesh.positions); });
  detection.setContactPredicate(scene.other, scene.body,
                                [](const ContactFeatures&) { return true; });
  EXPECT_EQ(methodNow(), Method::Proximity);
  detection.setContactPredicate(scene.other, scene.body, nullptr);
  detection.attachSurfaceProxy(scene.body, std::nullopt);
  EXPECT_EQ(methodNow(), Method::Proximity);
  detection.setPositions(scene.body, mesh.positions);
  const auto refuse = [&](GeometryId id, const SurfaceProxySettings& settings, ErrorCode code,
                          const char* words) {
    expectRefused(code, words, [&] { detection.attachSurfaceProxy(id, settings); });
  };
  refuse(scene.other, {0.1, 0.01}, ErrorCode::UnsupportedMethod, "is a point set");
  refuse(scene.body, {0.0, 0.01}, ErrorCode::InvalidSettings, "reach is 0");
  refuse(scene.body, {0.1, -1.0}, ErrorCode::InvalidSettings, "errorBound is -1");
  refuse(scene.body, {0.1, 0.01, 2.0}, ErrorCode::InvalidSettings, "widestNormalCone is 2");
}

}  // namespace palpate::testing
