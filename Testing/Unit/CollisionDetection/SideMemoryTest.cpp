#include "Common/DegenerateCases.h"
#include "Common/ExpectRefused.h"
#include "Common/TestGeometry.h"
#include "Unit/Math/ImpactOracle.h"

#include <palpate/Capture.h>
#include <palpate/ConstraintRows.h>

#include <map>
#include <numeric>

// PairSettings::rememberSides: after a solver let features pass, contacts lead back to where they
// came from, as the history of all exact crossings has it.

namespace palpate {
namespace {

using namespace testing;

constexpr double kRound = 1e-5;  // of the step: times of crossings and contacts this near are equal

PairSettings remembering(double thickness, Contacts contacts = Contacts::Distinct) {
  return {.method = Method::Continuous,
          .thickness = thickness,
          .contacts = contacts,
          .rememberSides = true};
}

struct Passage {
  double time;
  bool forward;
};

/// The passages of two features in a step, by rational arithmetic.
std::vector<Passage> passagesOf(bool edges, const impact::Positions& p) {
  Eigen::AlignedBox3d boxes[2];
  for (std::size_t i = 0; i < 4; ++i) boxes[i >= (edges ? 2 : 1)].extend(p[i]).extend(p[4 + i]);
  if (!boxes[0].intersects(boxes[1])) return {};
  std::vector<Passage> all;
  for (const auto& passage : impact::Query(edges, p).passages()) {
    impact::Real time = passage.time;
    while (!time.p.empty() && time.high - time.low > kRound / 16) time.refine();
    all.push_back({impact::Rational((time.low + time.high) / 2).get_d(), passage.forward});
  }
  return all;
}

/// Two geometries that move in steps.
struct Motion {
  TestGeometry a, b;
  Positions nowA, nowB;

  impact::Positions of(const std::vector<std::uint32_t>& ofA,
                       const std::vector<std::uint32_t>& ofB) const {
    impact::Positions p;
    std::size_t i = 0;
    for (const std::uint32_t v : ofA) p[i] = a.positions[v], p[4 + i++] = nowA[v];
    for (const std::uint32_t v : ofB) p[i] = b.positions[v], p[4 + i++] = nowB[v];
    return p;
  }
  void advance() { a.positions = nowA, b.positions = nowB; }
};

/// How often each vertex of a has passed through the surface b to the front, less to the back.
class VertexHistory {
 public:
  explicit VertexHistory(const Motion& motion) : m_count(motion.a.positions.size()) {}
  void read(const Motion& motion) {
    m_passages.clear();
    for (std::uint32_t v = 0; v < m_count.size(); ++v)
      for (const auto& [i, j, k] : motion.b.triangles)
        for (const Passage& passage : passagesOf(false, motion.of({v}, {i, j, k})))
          m_passages[v].push_back(passage);
  }
  int atStart(std::uint32_t v) const { return m_count[v]; }
  bool passes(std::uint32_t v) const { return m_passages.contains(v); }
  /// None where a passage is as near as times are round.
  std::optional<int> at(std::uint32_t v, double time) const {
    int count = m_count[v];
    if (const auto found = m_passages.find(v); found != m_passages.end() && time > 0.0)
      for (const Passage& passage : found->second) {
        if (std::abs(passage.time - time) < kRound) return {};
        if (passage.time < time) count += passage.forward ? 1 : -1;
      }
    return count;
  }
  void advance() {
    for (const auto& [v, passages] : m_passages)
      for (const Passage& passage : passages) m_count[v] += passage.forward ? 1 : -1;
  }

 private:
  std::vector<int> m_count;
  std::map<std::uint32_t, std::vector<Passage>> m_passages;
};

template <class Contact>
void expectLaw(const Motion& motion, const Contact& contact, std::size_t ofA) {
  const Stencil s = stencil(contact);
  Vector3d sum = Vector3d::Zero();
  double radii = 0.0;
  for (std::size_t i = 0; i < 4; ++i) {
    const TestGeometry& geometry = i < ofA ? motion.a : motion.b;
    const Positions& now = i < ofA ? motion.nowA : motion.nowB;
    const std::uint32_t v = s.vertices[i];
    const double t = contact.timeOfImpact;
    sum += s.weights[i] * ((1 - t) * geometry.positions[v] + t * now[v]);
    radii += std::abs(s.weights[i]) * geometry.radii[0];
  }
  EXPECT_LT((sum - (contact.distance + radii) * contact.normal).norm(), 1e-5);
  EXPECT_NEAR(contact.normal.norm(), 1.0, 1e-12);
}

/// An object with a Motion whose first step was at rest. self: its first geometry with itself.
class SideRun {
 public:
  SideRun(const Motion& motion, const PairSettings& pair, bool self = false) {
    m_a = motion.a.addTo(m_collisions), m_b = self ? m_a : motion.b.addTo(m_collisions);
    m_collisions.addCollisionPair(m_a, m_b, pair);
    m_collisions.advance();
  }
  const CollisionData& detect(const Motion& motion) {
    m_collisions.setPositions(m_a, motion.nowA);
    if (m_a != m_b) m_collisions.setPositions(m_b, motion.nowB);
    m_collisions.detectCollision();
    return m_collisions.collisionData(m_a, m_b);
  }
  void advance() { m_collisions.advance(); }

 private:
  OctreeBasedCD m_collisions;
  GeometryId m_a, m_b;
};

/// A wavy membrane that quivers, and points or lines above it that a bad solver pushes through.
struct Membrane : Motion {
  explicit Membrane(Random& random, TestGeometry above) : Motion{std::move(above), {}, {}, {}} {
    b = testGeometry(sheet(8, 0.5, uniform(random, 0, 6)));
    for (Vector3d& p : b.positions) p += randomPoint(random, -0.02, 0.02);
    rest = b.positions;
    nowB = b.positions;
    for (Vector3d& p : a.positions) p[2] = uniform(random, 0.62, 0.7);
    nowA = a.positions;
  }
  void move(Random& random, double motion) {
    for (Vector3d& p : nowA) {
      p += motion *
           Vector3d{uniform(random, -0.3, 0.3), uniform(random, -0.3, 0.3), uniform(random, -1, 1)};
      for (int k = 0; k < 2; ++k) p[k] = std::clamp(p[k], 0.25, 0.75);
      p[2] = std::clamp(p[2], 0.3, 0.7);
    }
    for (std::size_t v = 0; v < nowB.size(); ++v)
      nowB[v] = rest[v] + randomPoint(random, -0.01, 0.01);
  }
  Positions rest;
};

/// Whether an edge of a crosses a triangle of b when the step begins.
bool pierces(const Motion& motion, const Segment& edge) {
  const Vector3d &p = motion.a.positions[edge[0]], &q = motion.a.positions[edge[1]];
  const auto isAhead = [](const Vector3d& a, const Vector3d& b, const Vector3d& c,
                          const Vector3d& d) { return (b - a).cross(c - a).dot(d - a) > 0; };
  return std::ranges::any_of(motion.b.triangles, [&](const Triangle& t) {
    const Vector3d &a = motion.b.positions[t[0]], &b = motion.b.positions[t[1]],
                   &c = motion.b.positions[t[2]];
    const bool side = isAhead(p, q, a, b);
    return isAhead(a, b, c, p) != isAhead(a, b, c, q) && isAhead(p, q, b, c) == side &&
           isAhead(p, q, c, a) == side;
  });
}

struct SideCounts {
  std::size_t vertices = 0, passed = 0, returned = 0, edgesAbove = 0, edgesBelow = 0;
};

/// Each contact of a vertex leads to the side that its history has.
void expectSidesOfVertices(const Motion& scene, const VertexHistory& history,
                           const CollisionData& data, SideCounts& counts) {
  const double radius = scene.a.radii[0];
  std::set<std::uint32_t> ledBack, remembered, passed;
  for (const auto& contact : data.vertexTriangle()) {
    expectLaw(scene, contact, 1);
    const std::optional<int> count = history.at(contact.vertex, contact.timeOfImpact);
    if (!count || contact.distance + radius == 0.0) continue;
    EXPECT_TRUE(*count == 0 || *count == -1);
    EXPECT_EQ(contact.distance + radius < 0.0, *count != 0)
        << "vertex " << contact.vertex << ", triangle " << contact.triangle << ", time "
        << contact.timeOfImpact;
    ++counts.vertices;
    if (*count != 0) ledBack.insert(contact.vertex);
  }
  if (!scene.a.segments.empty()) return;
  for (const Crossing& side : data.rememberedSides()) remembered.insert(side.ids[0]);
  for (std::uint32_t v = 0; v < scene.nowA.size(); ++v) {
    if (history.atStart(v) != 0) passed.insert(v);
    counts.returned += history.atStart(v) != 0 && history.at(v, 2.0) == 0;
  }
  EXPECT_EQ(remembered, passed);
  EXPECT_TRUE(std::ranges::includes(ledBack, passed));
  counts.passed += passed.size();
}

/// An edge is on the side of its ends if it does not pierce the membrane, and passes no edge of it
/// in this step.
void expectSidesOfEdges(const Motion& scene, const VertexHistory& history,
                        const CollisionData& data, SideCounts& counts) {
  std::set<Segment> passing;
  for (const Segment& e : scene.a.edges())
    for (const Segment& f : scene.b.edges())
      if (!passagesOf(true, scene.of({e[0], e[1]}, {f[0], f[1]})).empty()) passing.insert(e);
  for (const auto& contact : data.edgeEdge()) {
    expectLaw(scene, contact, 2);
    const auto [p, q] = contact.edgeA;
    if (passing.contains(contact.edgeA) || history.passes(p) || history.passes(q) ||
        history.atStart(p) != history.atStart(q) || pierces(scene, contact.edgeA))
      continue;
    EXPECT_EQ(contact.distance + scene.a.radii[0] < 0.0, history.atStart(p) != 0)
        << p << " " << q << ", " << contact.edgeB[0] << " " << contact.edgeB[1] << " at "
        << contact.timeOfImpact;
    ++(history.atStart(p) != 0 ? counts.edgesBelow : counts.edgesAbove);
  }
}

/// Points, and a thread that goes up and down as a whole, over a membrane.
TEST(SideMemory, OverAMembraneIsThatOfTheHistoryOfCrossings) {
  Random random(11);
  TestGeometry line{GeometryType::Lines, {}, {}, {}, {0.005}};
  for (std::uint32_t i = 0; i < 7; ++i) {
    line.positions.push_back({0.28 + 0.07 * i, 0.5, 0.65});
    if (i > 0) line.segments.push_back({i - 1, i});
  }
  struct Above {
    TestGeometry geometry;
    Contacts contacts;
  };
  SideCounts counts;
  for (const auto& [geometry, contacts] :
       {Above{particles(random, 12, 0.0), Contacts::Distinct},
        Above{particles(random, 12, 0.01), Contacts::All}, Above{line, Contacts::Distinct}})
    for (const double motion : {0.03, 0.22}) {
      const bool isThread = geometry.type == GeometryType::Lines;
      Membrane scene(random, geometry);
      VertexHistory history(scene);
      SideRun run(scene, remembering(0.04, contacts));
      for (int step = 0; step < 30 / kShareOfCases; ++step) {
        SCOPED_TRACE("step " + std::to_string(step));
        scene.move(random, isThread ? 0.3 * motion : motion);
        if (isThread)
          for (Vector3d& p : scene.nowA) p[2] += motion * (step / 5 % 2 ? 0.5 : -0.5);
        const CollisionData& data = run.detect(scene);
        history.read(scene);
        expectSidesOfVertices(scene, history, data, counts);
        if (isThread) expectSidesOfEdges(scene, history, data, counts);
        history.advance();
        run.advance();
        scene.advance();
      }
    }
  EXPECT_GE(counts.vertices, leastOf(700));
  EXPECT_GE(counts.passed, leastOf(100));
  EXPECT_GE(counts.returned, leastOf(35));
  EXPECT_GE(counts.edgesAbove, leastOf(10));
  EXPECT_GE(counts.edgesBelow, leastOf(10));
}

/// Two threads that cross once, as seen from above, with their vertices in any order. self: they
/// are one geometry.
struct CrossedThreads : Motion {
  CrossedThreads(Random& random, std::uint32_t segments, double radius, bool self) {
    a = b = {GeometryType::Lines, {}, {}, {}, {radius}};
    const auto add = [&](TestGeometry& line, int axis, double z) {
      const auto first = static_cast<std::uint32_t>(line.positions.size());
      std::vector<std::uint32_t> names(segments + 1);
      std::iota(names.begin(), names.end(), first);
      std::shuffle(names.begin(), names.end(), random);
      line.positions.resize(first + segments + 1);
      for (std::uint32_t i = 0; i <= segments; ++i) {
        Vector3d p(0.5, 0.5, z);
        p[axis] = double(i) / segments;
        line.positions[names[i]] = p + randomPoint(random, -0.01, 0.01);
        if (i > 0) line.segments.push_back({names[i - 1], names[i]});
      }
    };
    add(a, 0, 0.1);
    upper = a.segments;
    add(self ? a : b, 1, 0.0);
    lower.assign((self ? a : b).segments.end() - segments, (self ? a : b).segments.end());
    isSelf = self;
    nowA = a.positions, nowB = b.positions;
  }
  void move(Random& random, double motion, double up) {
    for (Positions* now : {&nowA, &nowB})
      for (Vector3d& p : *now) p += randomPoint(random, -motion, motion);
    std::set<std::uint32_t> raised;
    for (const auto& [p, q] : upper) raised.insert({p, q});
    for (const std::uint32_t v : raised) nowA[v][2] += up;
  }
  /// forward: the upper thread comes above the lower one.
  std::vector<Passage> passages() const {
    std::vector<Passage> all;
    for (const auto& [p, q] : upper)
      for (const auto& [r, s] : lower)
        for (const Passage& passage :
             passagesOf(true, isSelf ? of({p, q, r, s}, {}) : of({p, q}, {r, s})))
          all.push_back(passage);
    return all;
  }
  std::vector<Segment> upper, lower;  ///< along the threads
  bool isSelf = false;
};

TEST(SideMemory, OfThreadsIsThatOfTheHistoryOfCrossings) {
  Random random(3);
  std::size_t checked = 0, wrong = 0, number = 0;
  for (const bool self : {false, true})
    for (const double radius : {0.0, 0.01})
      for (const std::uint32_t segments : {3u, 8u}) {
        if (isLeftOut(number++)) continue;
        CrossedThreads scene(random, segments, radius, self);
        PairSettings pair = remembering(0.04);
        if (self) pair.restDistance = 0.6;
        SideRun run(scene, pair, self);
        int count = 0;
        for (int step = 0; step < 40; ++step) {
          SCOPED_TRACE("step " + std::to_string(step));
          scene.move(random, 0.004, (step / 4 % 2 ? 1 : -1) * uniform(random, 0.0, 0.06));
          const CollisionData& data = run.detect(scene);
          const std::vector<Passage> passages = scene.passages();
          for (const EdgeEdgeContact& contact : data.edgeEdge()) {
            expectLaw(scene, contact, self ? 4 : 2);
            int before = count;
            bool isClose = false;
            for (const Passage& passage : passages) {
              isClose |= std::abs(passage.time - contact.timeOfImpact) < kRound;
              if (contact.timeOfImpact > 0 && passage.time < contact.timeOfImpact)
                before += passage.forward ? 1 : -1;
            }
            if (isClose || contact.distance + 2 * radius == 0) continue;
            EXPECT_EQ(contact.distance + 2 * radius < 0, before != 0)
                << contact.edgeA[0] << " " << contact.edgeA[1] << ", " << contact.edgeB[0] << " "
                << contact.edgeB[1] << " at " << contact.timeOfImpact;
            ++checked;
          }
          EXPECT_EQ(data.rememberedSides().size(), count != 0 ? 1u : 0u);
          wrong += count != 0;
          for (const Passage& passage : passages) count += passage.forward ? 1 : -1;
          run.advance();
          scene.advance();
        }
      }
  EXPECT_GE(checked, leastOf(200));
  EXPECT_GE(wrong, leastOf(50));
}

/// A sheet in the plane z = 0, and one point.
class OnePoint : public ::testing::Test {
 protected:
  OnePoint() {
    for (Vector3d& p : sheetPositions) p[2] = 0.0;
    m_sheet = m_collisions.addTriangleMesh(sheetPositions, mesh.triangles);
    m_tip = m_collisions.addPointSet(Positions{{0.43, 0.47, 0.1}});
    m_collisions.addCollisionPair(m_tip, m_sheet, remembering(0.02));
  }
  void moveTo(const Vector3d& p) { m_collisions.setPositions(m_tip, Positions{p}); }
  const CollisionData& detectAt(const Vector3d& p) {
    moveTo(p);
    m_collisions.detectCollision();
    return data();
  }
  const CollisionData& stepTo(const Vector3d& p) {
    detectAt(p);
    m_collisions.advance();
    return data();
  }
  const CollisionData& data() const { return m_collisions.collisionData(m_tip, m_sheet); }
  /// How many sides the next step begins with.
  std::size_t remembered() const { return m_collisions.problem().pairs.at(0).sides.size(); }
  void pass() {
    stepTo({0.43, 0.47, 0.1});
    stepTo({0.43, 0.47, -0.1});
    ASSERT_EQ(remembered(), 1u);
  }

  const Mesh mesh = sheet(6, 0.0, 0.0);
  Positions sheetPositions = mesh.positions;
  OctreeBasedCD m_collisions;
  GeometryId m_sheet, m_tip;
};

TEST_F(OnePoint, IsLedBackFromAnyDepthAndPlace) {
  pass();
  for (const Vector3d& p : Positions{{0.43, 0.47, -0.3}, {0.8, 0.2, -0.01}, {0.2, 0.7, -0.4}}) {
    const CollisionData& led = stepTo(p);
    ASSERT_EQ(led.vertexTriangle().size(), 1u);
    EXPECT_EQ(led.vertexTriangle()[0].normal, Vector3d(0, 0, 1));
    EXPECT_LT(led.vertexTriangle()[0].distance, 0);
    EXPECT_EQ(led.vertexTriangle()[0].timeOfImpact, 0);
    EXPECT_EQ(led.validity().atImpact, 1u);
  }
  EXPECT_EQ(stepTo({0.2, 0.7, 0.01}).vertexTriangle()[0].distance, -0.4);
  EXPECT_EQ(remembered(), 0u);
  EXPECT_GT(stepTo({0.2, 0.7, 0.01}).vertexTriangle()[0].distance, 0);
}

/// A solver that meets a third of each row brings back what it let pass.
TEST_F(OnePoint, ComesBackByItsRows) {
  pass();
  Vector3d tip(0.43, 0.47, -0.3);
  for (int step = 0; step < 20 && remembered() > 0; ++step) {
    const CollisionData& data = stepTo(tip);
    for (const auto& contact : data.vertexTriangle())
      tip += (0.02 - contact.distance) / 3 * contact.normal;
  }
  EXPECT_EQ(remembered(), 0u);
  EXPECT_GT(tip.z(), 0.0);
}

/// The nearest wall is another one, but the point leaves through the wall through which it came.
TEST(SideMemory, InAClosedBodyLeadsBackTheWayThatAPointCame) {
  for (const Mesh& body : {dividedBox({-1, -1, -1}, {1, 1, 1}, 1),
                           dividedBox({-1, -1, -1}, {1, 1, 1}, 7), sphere(13, 16, {0, 0, 0}, 1)})
    for (const double aside : {0.0, 0.02, 0.3}) {
      OctreeBasedCD collisions;
      const GeometryId wall = collisions.addTriangleMesh(body.positions, body.triangles);
      const Positions way = [&] {  // through the top, down to the bottom, and up again
        Positions all{{0.11, 0.07, 1.1}};
        for (const double z : {0.8, 0.5, 0.2, -0.1, -0.4, -0.7, -0.8})
          all.emplace_back(0.11 + aside * (0.8 - z) / 1.6, 0.07, z);
        for (std::size_t i = all.size() - 1; i-- > 0;) all.push_back(all[i]);
        return all;
      }();
      const GeometryId tip = collisions.addPointSet(Positions{way[0]});
      collisions.addCollisionPair(tip, wall, remembering(0.02));
      for (std::size_t i = 1; i < way.size(); ++i) {
        collisions.advance();
        collisions.setPositions(tip, Positions{way[i]});
        collisions.detectCollision();
        const CollisionData& data = collisions.collisionData(tip, wall);
        const std::size_t sides = data.rememberedSides().size();
        EXPECT_EQ(sides, i == 1 ? 0u : 1u) << i << ' ' << aside;
        if (sides == 0) continue;
        ASSERT_EQ(data.vertexTriangle().size(), 1u) << i << ' ' << aside;
        // Far aside, below a round wall, the way out is oblique.
        EXPECT_GT(data.vertexTriangle()[0].normal.z(), aside < 0.1 ? 0.7 : 0.0)
            << i << ' ' << aside;
        EXPECT_LT(data.vertexTriangle()[0].distance, 0.0);
      }
      collisions.advance();
      collisions.detectCollision();
      EXPECT_TRUE(collisions.collisionData(tip, wall).rememberedSides().empty()) << aside;
    }
}

/// Points jump about boxes and plates: through both walls at once, in again through another wall,
/// on a lattice and elsewhere. What they remember is whether they are in or out, as they were not
/// at first; so nothing leads a point into a body in which it was not.
TEST(SideMemory, OfABoxIsTheChangeOfInAndOut) {
  std::size_t remembered = 0, outAgain = 0;
  for (int walk = 0; walk < 60; ++walk) {
    Random random(walk);
    const bool onLattice = walk % 3 == 0;
    const Mesh body = dividedBox({-3, -3, walk % 2 == 0 ? -4 : -0.5}, {3, 3, 0}, 1 + walk % 4);
    const auto anywhere = [&] {
      Vector3d p = randomPoint(random, -6, 6);
      return onLattice ? Vector3d(p.array().round()) : p;
    };
    Positions points(6);
    std::ranges::generate(points, anywhere);
    OctreeBasedCD collisions;
    const GeometryId set = collisions.addPointSet(points),
                     box = collisions.addTriangleMesh(body.positions, body.triangles);
    PairSettings settings = remembering(0.2);
    settings.method = walk % 5 == 0 ? Method::Auto : Method::Continuous;
    collisions.addCollisionPair(set, box, settings);
    const auto areIn = [&] {
      std::vector<int> in;
      for (const Vector3d& p : points) in.push_back(collisions.queries().contains(box, p));
      return in;
    };
    const std::vector<int> first = areIn();
    for (int step = 0; step < 20; ++step) {
      const std::vector<int> in = areIn();
      collisions.advance();
      for (Vector3d& p : points)
        p = walk % 4 == 0 ? Vector3d(p + randomPoint(random, -2, 2)) : anywhere();
      collisions.setPositions(set, points);
      collisions.detectCollision();
      std::vector<int> sum(points.size());
      for (const Crossing& side : collisions.collisionData(set, box).rememberedSides()) {
        sum[side.ids[0]] += side.forward ? 1 : -1;
        ++remembered;
      }
      for (std::size_t i = 0; i < points.size(); ++i) {
        EXPECT_EQ(sum[i], first[i] - in[i]) << walk << ' ' << step << ' ' << i;
        outAgain += step > 0 && first[i] + in[i] == 0;
      }
    }
  }
  EXPECT_GT(remembered, 1000u);
  EXPECT_GT(outAgain, 1000u);
}

/// A needle in a plate that is as thin as the thickness: its far wall does not lead it out.
TEST(SideMemory, InAPlateNoRowLeadsThroughTheFarWall) {
  const Mesh plate = dividedBox({-3, -3, -0.2}, {3, 3, 0}, 4);
  for (const Method method : {Method::Auto, Method::Continuous})
    for (const double depth : {0.05, 0.1, 0.15, 0.19})
      for (const double motion : {0.0, 0.001}) {
        OctreeBasedCD collisions;
        const auto needle = [](double tip) {
          return Positions{{0.53, 0.97, tip}, {0.53, 0.97, tip + 4}};
        };
        const GeometryId line = collisions.addLineMesh(needle(0.5), std::vector<Segment>{{0, 1}}),
                         body = collisions.addTriangleMesh(plate.positions, plate.triangles);
        PairSettings settings = remembering(0.2);
        settings.method = method;
        collisions.addCollisionPair(line, body, settings);
        collisions.advance();
        collisions.setPositions(line, needle(-depth));
        collisions.detectCollision();
        collisions.advance();
        collisions.setPositions(line, needle(motion - depth));
        collisions.detectCollision();
        std::vector<ConstraintRow> rows;
        collisions.collisionData(line, body).appendRows(rows, 0, 2);
        EXPECT_GE(rows.size(), 2u);
        for (const ConstraintRow& row : rows) EXPECT_EQ(row.normal, Vector3d(0, 0, 1));
      }
}

TEST_F(OnePoint, ABudgetWithoutTimeForgetsNothing) {
  const auto stepWithoutTime = [&](const Vector3d& p) {
    moveTo(p);
    EXPECT_FALSE(m_collisions.detectCollision(std::chrono::microseconds(0)));
    m_collisions.advance();
  };
  stepTo({0.43, 0.47, 0.1});
  stepWithoutTime({0.43, 0.47, -0.1});
  EXPECT_EQ(remembered(), 1u);
  stepWithoutTime({0.43, 0.47, -0.2});
  EXPECT_EQ(remembered(), 1u);
  EXPECT_EQ(stepTo({0.43, 0.47, -0.2}).vertexTriangle()[0].normal, Vector3d(0, 0, 1));
  stepWithoutTime({0.43, 0.47, 0.1});
  EXPECT_EQ(remembered(), 0u);
}

TEST_F(OnePoint, ACutElsewhereLeavesTheMemoryAndOneOfTheTriangleEndsIt) {
  pass();
  const std::uint32_t triangle = m_collisions.problem().pairs.at(0).sides.at(0).ids.at(1);
  const auto cut = [&](std::uint32_t removed) {
    m_collisions.replaceTriangles(m_sheet, std::vector<std::uint32_t>{removed}, {}, {});
    stepTo({0.43, 0.47, -0.1});
    return remembered();
  };
  EXPECT_EQ(cut(triangle == 0 ? 71 : 0), 1u);
  const std::vector<Crossing> side{m_collisions.problem().pairs.at(0).sides};
  EXPECT_EQ(cut(triangle), 0u);
  testing::expectRefused(ErrorCode::IndexOutOfRange, "triangle " + std::to_string(triangle),
                         [&] { m_collisions.setRememberedSides(m_tip, m_sheet, side); });
}

TEST_F(OnePoint, MemoryEnds) {
  const auto expectEnd = [&](auto&& change) {
    m_collisions.setRememberedSides(m_tip, m_sheet, {});
    m_collisions.setPositions(m_tip, Positions{{0.43, 0.47, 0.1}}, Positions{{0.43, 0.47, 0.1}});
    pass();
    change();
    m_collisions.detectCollision();
    EXPECT_TRUE(data().rememberedSides().empty());
    m_collisions.advance();
    EXPECT_EQ(remembered(), 0u);
  };
  // Around the border.
  expectEnd([&] { stepTo({1.2, 0.5, -0.1}); });
  // Put above the surface.
  expectEnd([&] {
    m_collisions.setPositions(m_tip, Positions{{0.5, 0.5, 0.3}}, Positions{{0.5, 0.5, 0.3}});
  });
  expectEnd([&] { m_collisions.setRememberedSides(m_tip, m_sheet, {}); });
  expectEnd([&] {
    m_collisions.setContactPredicate(m_tip, m_sheet, [](const ContactFeatures&) { return false; });
  });
  m_collisions.setContactPredicate(m_tip, m_sheet, {});
  expectEnd([&] {
    m_collisions.setCollisionFilter(m_tip, {.groups = 0});
    m_collisions.detectCollision();
    m_collisions.advance();
    m_collisions.setCollisionFilter(m_tip, {});
  });
  expectEnd([&] {
    m_collisions.setPairSettings(m_tip, m_sheet, {.method = Method::Continuous});
    m_collisions.detectCollision();
    m_collisions.advance();
    m_collisions.setPairSettings(m_tip, m_sheet, remembering(0.02));
  });
  expectEnd([&] {
    std::vector<std::uint32_t> all(mesh.triangles.size());
    std::iota(all.begin(), all.end(), 0u);
    m_collisions.setDisabledElements(m_sheet, all);
  });
  m_collisions.setDisabledElements(m_sheet, {});
  expectEnd([&] {
    // A cut of the triangle, and of no other.
    std::vector<Triangle> rest = mesh.triangles;
    rest.erase(rest.begin() + m_collisions.problem().pairs[0].sides[0].ids[1]);
    m_collisions.setTriangles(m_sheet, sheetPositions, rest);
  });
}

TEST_F(OnePoint, ADetectionWithoutTheSettingOrThePairEndsNothingWithinItsStep) {
  pass();
  m_collisions.setPairSettings(m_tip, m_sheet, {.method = Method::Continuous});
  m_collisions.detectCollision();
  EXPECT_TRUE(data().rememberedSides().empty());
  EXPECT_EQ(remembered(), 0u);
  m_collisions.setPairSettings(m_tip, m_sheet, remembering(0.02));
  m_collisions.setCollisionFilter(m_tip, {.groups = 0});
  m_collisions.detectCollision();
  m_collisions.setCollisionFilter(m_tip, {});
  m_collisions.detectCollision();
  EXPECT_EQ(data().rememberedSides().size(), 1u);
  m_collisions.advance();
  EXPECT_EQ(remembered(), 1u);
  // The end of the step counts, whether a detection saw the setting there or not.
  m_collisions.setPairSettings(m_tip, m_sheet, {.method = Method::Continuous});
  m_collisions.advance();
  m_collisions.setPairSettings(m_tip, m_sheet, remembering(0.02));
  EXPECT_EQ(remembered(), 0u);
}

TEST_F(OnePoint, AnAnswerWithoutTheSettingLasts) {
  pass();
  m_collisions.setPairSettings(m_tip, m_sheet, {.method = Method::Continuous});
  stepTo({0.43, 0.47, -0.1});
  for (int step = 0; step < 3; ++step) {
    EXPECT_TRUE(m_collisions.detectCollision(std::chrono::microseconds(0))) << "step " << step;
    EXPECT_EQ(data().validity().reason, MethodReason::Requested);
    m_collisions.advance();
    m_collisions.setPairSettings(m_tip, m_sheet, remembering(0.02));
    EXPECT_EQ(remembered(), 0u);
    m_collisions.setPairSettings(m_tip, m_sheet, {.method = Method::Continuous});
    m_collisions.detectCollision();
    m_collisions.advance();
  }
}

TEST_F(OnePoint, MemoryLastsThroughATopologyThatKeepsTheVertices) {
  pass();
  std::vector<Triangle> turned(mesh.triangles.rbegin(), mesh.triangles.rend());
  m_collisions.setTriangles(m_sheet, sheetPositions, turned);
  EXPECT_EQ(stepTo({0.43, 0.47, -0.1}).vertexTriangle()[0].normal, Vector3d(0, 0, 1));
  EXPECT_EQ(remembered(), 1u);
}

/// Two lines that have passed through each other, and one line with itself.
TEST(SideMemory, TakesEdgesInAnyOrder) {
  const Positions before{{0, 0, 0}, {1, 0, 0}, {0.5, -1, 0.1}, {0.5, 1, 0.1}};
  Positions now = before;
  now[2].z() = now[3].z() = -0.1;
  for (const bool self : {false, true}) {
    OctreeBasedCD collisions;
    const auto part = [&](const Positions& of, std::size_t first) {
      return self ? of : Positions(of.begin() + first, of.begin() + first + 2);
    };
    using Segments = std::vector<Segment>;
    const GeometryId a =
        collisions.addLineMesh(part(before, 0), self ? Segments{{0, 1}, {2, 3}} : Segments{{0, 1}});
    const GeometryId b = self ? a : collisions.addLineMesh(part(before, 2), Segments{{0, 1}});
    collisions.addCollisionPair(a, b, remembering(0.0));
    collisions.setPositions(b, part(before, 2), part(now, 2));
    collisions.detectCollision();
    collisions.advance();
    const auto remembered = [&] { return collisions.problem().pairs.at(0).sides; };
    const std::vector<Crossing> sides = remembered();
    ASSERT_EQ(sides.size(), 1u);
    for (int order = 0; order < (self ? 8 : 4); ++order) {
      Crossing side = sides[0];
      auto& [p, q, r, s] = side.ids;
      if (order & 1) std::swap(p, q), side.forward = !side.forward;
      if (order & 2) std::swap(r, s), side.forward = !side.forward;
      if (order & 4) std::swap(p, r), std::swap(q, s);
      collisions.setRememberedSides(a, b, {});
      EXPECT_TRUE(remembered().empty());
      collisions.setRememberedSides(a, b, std::vector{side});
      EXPECT_EQ(remembered(), sides) << order;
    }
  }
}

TEST_F(OnePoint, RefusesSidesOfNoFeaturesAndOtherMethods) {
  constexpr std::uint32_t kNone = kNoElement;
  const auto refuse = [&](ContactKind kind, const std::array<std::uint32_t, 4>& ids,
                          const std::string& text, GeometryId id) {
    expectRefused(
        ErrorCode::IndexOutOfRange, "pair (1, 0): remembered side 1 " + text,
        [&] {
          const std::vector<Crossing> sides{{ContactKind::VertexTriangle, {0, 3, kNone, kNone}},
                                            {kind, ids}};
          m_collisions.setRememberedSides(m_tip, m_sheet, sides);
        },
        id);
    EXPECT_EQ(remembered(), 1u);
  };
  pass();
  refuse(ContactKind::VertexTriangle, {1, 0, kNone, kNone}, "names vertex 1", m_tip);
  refuse(ContactKind::VertexTriangle, {0, 72, kNone, kNone}, "names triangle 72", m_sheet);
  refuse(ContactKind::TriangleVertex, {0, 0, kNone, kNone}, "names triangle 0", m_tip);
  refuse(ContactKind::EdgeEdge, {0, 1, 0, 1}, "names edge 0 1", m_tip);
  refuse(ContactKind::Shape, {0, 1, 0, 1}, "is of the kind Shape", m_tip);
  m_collisions.setPairSettings(m_tip, m_sheet, {.method = Method::Continuous});
  expectRefused(
      ErrorCode::NotAvailable, "pair (1, 0): PairSettings::rememberSides is not set",
      [&] { m_collisions.setRememberedSides(m_tip, m_sheet, {}); }, m_tip);
  const GeometryId ball = m_collisions.addAnalyticalGeometry(Sphere{{0, 0, 3}, 1});
  const auto refusePair = [&](GeometryId b, PairSettings settings) {
    settings.rememberSides = true;
    expectRefused(
        ErrorCode::UnsupportedMethod, "rememberSides is for Method::Auto and Continuous",
        [&] { m_collisions.addCollisionPair(m_sheet, b, settings); }, m_sheet);
  };
  refusePair(m_sheet, {.method = Method::Proximity, .thickness = 0.1});
  refusePair(m_sheet, {.method = Method::Continuous, .continuous = {.earliestTimeOnly = true}});
  for (const Method method : {Method::Auto, Method::Continuous})
    refusePair(ball, {.method = method, .thickness = 0.1});
}

/// A cube above a flat membrane, after the first step.
struct CubeAndMembrane {
  OctreeBasedCD collisions;
  Mesh cube = dividedBox({0.42, 0.41, 0.1}, {0.61, 0.6, 0.2}, 3);
  GeometryId body, tissue;

  CubeAndMembrane() {
    Mesh membrane = sheet(16, 0.0, 0.0);
    for (Vector3d& p : membrane.positions) p[2] = 0.0;
    body = addMesh(collisions, cube);
    tissue = addMesh(collisions, membrane);
    collisions.addCollisionPair(body, tissue, remembering(0.03, Contacts::All));
    collisions.detectCollision();
    collisions.advance();
  }
  void move(double z) {
    for (Vector3d& p : cube.positions) p[2] += z;
    collisions.setPositions(body, cube.positions);
  }
  const CollisionData& data() const { return collisions.collisionData(body, tissue); }
};

/// A body that passed as a whole: every contact leads it back, also of edges that passed none.
TEST(SideMemory, OfABodyThatPassedLeadsItBack) {
  CubeAndMembrane scene;
  const auto shift = [&](double z) {
    scene.move(z);
    scene.collisions.detectCollision();
    scene.collisions.advance();
  };
  shift(-0.15);  // the lower half has passed
  shift(-0.06);  // all of it
  shift(0.005);
  const CollisionData& data = scene.data();
  std::size_t vertices = 0;
  for (const auto& contact : data.vertexTriangle()) vertices += contact.normal[2] == 1.0;
  EXPECT_EQ(vertices, data.vertexTriangle().size());
  EXPECT_EQ(vertices, scene.cube.positions.size());
  EXPECT_FALSE(data.edgeEdge().empty());
  for (const auto& contact : data.edgeEdge()) EXPECT_GE(contact.normal[2], -1e-12);
  for (const auto& contact : data.triangleVertex()) EXPECT_LE(contact.normal[2], 1e-12);
}

/// A body jumps through a membrane and back. The vertices of the membrane pass into it and out of
/// it in one step; they are where they were if the body is, which its own vertices remember.
TEST(SideMemory, OfABodyThatJumpedIsThatOfItsOwnVertices) {
  CubeAndMembrane scene;
  const auto sidesAfter = [&](double shift) {
    scene.move(shift);
    scene.collisions.advance();
    scene.collisions.detectCollision();
    return scene.data().rememberedSides();
  };
  const auto sides = sidesAfter(-0.35);
  EXPECT_EQ(sides.size(), scene.cube.positions.size());
  for (const Crossing& side : sides) EXPECT_EQ(side.kind, ContactKind::VertexTriangle);
  EXPECT_TRUE(sidesAfter(0.35).empty());
}

/// An end of a thread passes a membrane, the thread then passes the membrane's fold, and the end
/// comes back. The thread is led back over the fold, in a membrane of any fineness.
TEST(SideMemory, AnEdgeStaysHookedWhereItsEndReturned) {
  for (const std::uint32_t cells : {2u, 6u, 20u})
    for (const bool swapped : {false, true}) {
      Mesh membrane = sheet(cells, 0, 0);
      for (Vector3d& p : membrane.positions) p = {12 * p[0] - 6, 12 * p[1] - 6, 0};
      Positions thread{{-4, 0.1, 0.4}, {4, 0.1, 0.4}};
      OctreeBasedCD collisions;
      const GeometryId tissue = addMesh(collisions, membrane),
                       suture = collisions.addLineMesh(thread, std::vector<Segment>{{0, 1}}),
                       a = swapped ? tissue : suture, b = swapped ? suture : tissue;
      collisions.addCollisionPair(a, b, remembering(0.3));
      collisions.advance();
      const auto step = [&](const Vector3d& p, const Vector3d& q, double fold) {
        thread = {p, q};
        for (Vector3d& v : membrane.positions) v[2] = fold * (1.0 - std::abs(v[0]) / 6.0);
        collisions.setPositions(suture, thread);
        collisions.setPositions(tissue, membrane.positions);
        collisions.detectCollision();
        collisions.advance();
      };
      const auto edgesLedBack = [&] {
        const CollisionData& data = collisions.collisionData(a, b);
        std::size_t count = 0;
        for (const EdgeEdgeContact& contact : data.edgeEdge())
          if (contact.timeOfImpact == 0.0 && contact.distance < 0.0) {
            EXPECT_GT((swapped ? -1 : 1) * contact.normal[2], 0.5);
            ++count;
          }
        return count;
      };
      step({-4, 0.1, -6}, {4, 0.1, 0.4}, 0.0);
      step({-4, 0.1, -6}, {4, 0.1, 0.4}, 1.0);
      step({-5, 0.1, 0.6}, {5, 0.1, 0.6}, 1.0);
      EXPECT_EQ(edgesLedBack(), 0u);
      step({-5, 0.1, 0.6}, {5, 0.1, 0.6}, 0.7);
      EXPECT_GT(edgesLedBack(), 0u) << cells;
      step({-5, 0.1, 0.8}, {5, 0.1, 0.8}, 0.7);
      step({-5, 0.1, 0.8}, {5, 0.1, 0.8}, 0.7);
      EXPECT_TRUE(collisions.collisionData(a, b).rememberedSides().empty()) << cells;
      // Without a fold nothing is hooked.
      step({-4, 0.1, -6}, {4, 0.1, 0.4}, 0.0);
      step({-5, 0.1, 0.6}, {5, 0.1, 0.6}, 0.0);
      step({-5, 0.1, 0.6}, {5, 0.1, 0.6}, 0.0);
      EXPECT_TRUE(collisions.collisionData(a, b).rememberedSides().empty()) << cells;
    }
}

}  // namespace
}  // namespace palpate
