#include "Common/History.h"
#include "Common/QueryCalls.h"
#include "Common/Replayed.h"
#include "Common/TemporaryFolder.h"
#include "Math/ClosestPoint.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

// With what the answers of a random history are compared.

namespace palpate::testing {

namespace {

void append(std::vector<std::uint64_t>& words, const InsideVertex& v) {
  Row row{v.vertex, v.triangle, v.decided};
  testing::append(row, v.weights);
  testing::append(row, v.direction);
  testing::append(row, v.depth);
  words.insert(words.end(), row.begin(), row.end());
}

/// A crossing whose elements have these ids.
Crossing renamedCrossing(Crossing crossing, const Ids& ofA, const Ids& ofB) {
  if (crossing.kind == ContactKind::VertexTriangle) crossing.ids[1] = ofB[crossing.ids[1]];
  if (crossing.kind == ContactKind::TriangleVertex) crossing.ids[0] = ofA[crossing.ids[0]];
  return crossing;
}

}  // namespace

/// Whether two geometries neither intersect nor touch when the step begins, by brute force.
bool RandomHistory::startsApart(const ModelPair& pair) const {
  Model start;
  for (const GeometryId id : {pair.a, pair.b}) {
    ModelBody body = m_lockstep.model().bodies.at(id);
    body.now = body.before;
    body.pose = body.poseBefore;
    body.placed = body.placed && pair.a != pair.b;
    body.filter = {};
    body.field.reset();
    body.leaves.reset();
    start.bodies.emplace(id, std::move(body));
  }
  const bool areMeshes = start.bodies.at(pair.a).isMesh() && start.bodies.at(pair.b).isMesh();
  PairSettings settings{.method = Method::Intersection};
  if (!areMeshes)  // features that are near at rest have no radius
    settings = {.method = Method::Proximity, .restDistance = pair.settings.restDistance};
  start.pairs.push_back({pair.a, pair.b, settings});
  NewObject made = newObject(start, settingsOf(Engine::BruteForce));
  made.object.detectCollision();
  return areMeshes ? made.object.collisionData(made.ids.at(pair.a), made.ids.at(pair.b))
                         .intersectingTriangles()
                         .empty()
                   : made.object.statistics().contacts == 0;
}

namespace {

/// The answer of a new object for a pair, with the model's ids.
CollisionData renamedAnswer(const Model& model, const ModelPair& pair, const NewObject& made) {
  const CollisionData& data = made.object.collisionData(made.ids.at(pair.a), made.ids.at(pair.b));
  const ModelBody &a = model.bodies.at(pair.a), &b = model.bodies.at(pair.b);
  if (a.isRigid() && b.isRigid()) return data;  // without cuts
  const bool areOfB = !data.shape().empty() && a.isRigid() && b.hasVertices();
  return renamed(data, areOfB ? Ids{} : a.ids(), b.ids());
}

std::vector<Crossing> renamedSides(std::span<const Crossing> sides, const Ids& ofA,
                                   const Ids& ofB) {
  std::vector<Crossing> all;
  for (const Crossing& side : sides) all.push_back(renamedCrossing(side, ofA, ofB));
  return all;
}

/// By id, the place of each element.
Ids placesById(const ModelBody& body) {
  Ids places(body.elements(), kNoElement);
  const Ids ids = body.ids();
  for (std::uint32_t i = 0; i < ids.size(); ++i) places[ids[i]] = i;
  return places;
}

}  // namespace

/// A new object does not know from which passages features have not returned.
void RandomHistory::giveSides(NewObject& made) const {
  const Model& model = m_lockstep.model();
  for (const ModelPair& pair : model.pairs)
    if (pair.settings.rememberSides)
      made.object.setRememberedSides(
          made.ids.at(pair.a), made.ids.at(pair.b),
          renamedSides(m_lockstep.data(pair).rememberedSides(), placesById(model.bodies.at(pair.a)),
                       placesById(model.bodies.at(pair.b))));
}

void RandomHistory::compareContacts(const NewObject& made, bool isBruteForce) {
  const Model& model = m_lockstep.model();
  for (const ModelPair& pair : model.pairs) {
    const CollisionData& found = m_lockstep.data(pair);
    const CollisionData& truth =
        made.object.collisionData(made.ids.at(pair.a), made.ids.at(pair.b));
    SCOPED_TRACE(::testing::Message()
                 << "new object" << (isBruteForce ? ", brute force" : "") << ", pair "
                 << textOf(pair.a) << ", " << textOf(pair.b) << ", " << textOf(pair.settings)
                 << ", predicate " << pair.predicate);
    EXPECT_EQ(found.hash(), renamedAnswer(model, pair, made).hash());
    const auto same = [](const auto& x, const auto& y) { return std::ranges::equal(x, y); };
    for (int kind = 0; kind < 5; ++kind)
      EXPECT_TRUE(same(found.tags(static_cast<ContactKind>(kind)),
                       truth.tags(static_cast<ContactKind>(kind))));
    const Ids ofA = model.bodies.at(pair.a).ids(), ofB = model.bodies.at(pair.b).ids();
    EXPECT_TRUE(same(found.crossings(), renamedSides(truth.crossings(), ofA, ofB)));
    EXPECT_TRUE(same(found.rememberedSides(), renamedSides(truth.rememberedSides(), ofA, ofB)));
    EXPECT_TRUE(same(found.smoothVertexTriangle(), truth.smoothVertexTriangle()));
    EXPECT_TRUE(same(found.smoothTriangleVertex(), truth.smoothTriangleVertex()));
    EXPECT_TRUE(same(found.smoothEdgeEdge(), truth.smoothEdgeEdge()));
    EXPECT_TRUE(same(found.smoothShape(), truth.smoothShape()));
    EXPECT_EQ(found.earliestTimeOfImpact(), truth.earliestTimeOfImpact());
    EXPECT_EQ(found.errorBound(), truth.errorBound());
    const Validity &v = found.validity(), &t = truth.validity();
    EXPECT_EQ(v.method, t.method);
    EXPECT_EQ(v.reason, t.reason);
    EXPECT_EQ(v.atEnd, t.atEnd);
    EXPECT_EQ(v.atImpact, t.atImpact);
    EXPECT_NEAR(v.displacement, t.displacement, 1e-12 * m_draw.unit());
    EXPECT_EQ(v.displacementLimit, t.displacementLimit);
    if (std::isinf(t.arcDeviation))
      EXPECT_EQ(v.arcDeviation, t.arcDeviation);
    else
      EXPECT_NEAR(v.arcDeviation, t.arcDeviation, 1e-12 * m_draw.unit());
    // A new object always knows startedApart. One with a history may not know it, but is never
    // wrong.
    if (!isBruteForce) {  // without boxes, Intersection does not know distances
      EXPECT_LE(v.trusted, t.trusted);
    }
    const bool isOfField = model.bodies.at(pair.a).isField() || model.bodies.at(pair.b).isField();
    if (v.startedApart && !t.startedApart && !isOfField) {
      EXPECT_TRUE(startsApart(pair));
    }
  }
  for (const auto& [id, body] : model.bodies)
    EXPECT_TRUE(std::ranges::equal(m_lockstep.first().freeMotion(id),
                                   made.object.freeMotion(made.ids.at(id))))
        << "free motion of geometry " << textOf(id);
}

void RandomHistory::compareCandidates(NewObject& bruteForce) {
  const Model& model = m_lockstep.model();
  for (const ModelPair& pair : model.pairs) {
    const auto candidates = [&](OctreeBasedCD& collisions, GeometryId a, GeometryId b) {
      try {
        return collisions.candidatePairs(a, b);
      } catch (const Error& error) {
        EXPECT_EQ(error.code(), ErrorCode::NotAvailable);
        return std::vector<ElementPair>{};
      }
    };
    const auto found = candidates(m_lockstep.first(), pair.a, pair.b);
    auto truth =
        candidates(bruteForce.object, bruteForce.ids.at(pair.a), bruteForce.ids.at(pair.b));
    const Ids ofA = model.bodies.at(pair.a).ids(), ofB = model.bodies.at(pair.b).ids();
    for (auto& [a, b] : truth) a = ofA[a], b = ofB[b];
    EXPECT_TRUE(std::ranges::includes(found, truth)) << "a candidate is missing";
    EXPECT_EQ(std::ranges::adjacent_find(found), found.end()) << "a candidate is there twice";
  }
}

void RandomHistory::compareQueries(NewObject& other) {
  const GeometryId a = anyBody(), b = anyBody();
  const Vector3d point = m_draw.inSpace(m_draw.unit() * randomPoint(m_random, 0, 1));
  const auto ask = [&](OctreeBasedCD& collisions, GeometryId vertices, GeometryId body,
                       const Ids& elements) {
    std::map<std::string, std::vector<std::uint64_t>> all;
    const auto elementOf = [&](std::uint32_t element) {
      return elements.empty() || element == kNoElement ? element : elements[element];
    };
    const auto take = [&](const char* name, auto&& query) { all[name] = wordsOf(query); };
    for (const InsideRule rule : {InsideRule::Closed, InsideRule::WindingNumber})
      take(rule == InsideRule::Closed ? "vertices inside" : "vertices inside by winding numbers",
           [&](auto& out) {
             for (InsideVertex v :
                  testing::insideVertices(collisions, vertices, body, {.rule = rule})) {
               v.triangle = elementOf(v.triangle);
               append(out, v);
             }
           });
    take("embedding", [&](auto& out) {
      for (const EmbeddedVertex& v : testing::embeddedVertices(collisions, vertices, body)) {
        out.push_back(v.vertex);
        out.push_back(v.at.tetrahedron);
        for (const double weight : v.at.weights)
          out.push_back(std::bit_cast<std::uint64_t>(weight));
      }
      const auto at = collisions.queries().findTetrahedron(body, point);
      out.push_back(at ? at->tetrahedron : ~0u);
    });
    take("nearest elements", [&](auto& out) {
      const SpatialQueries queries = collisions.queries();
      const auto at = queries.closestPoint(body, point);
      out.push_back(at ? elementOf(at->element) : ~0u);
      const auto hit = queries.firstHit(body, {point, {1, 2, 3}});
      out.push_back(hit ? elementOf(hit->element) : ~0u);
      Ids within;
      queries.elementsWithin(body, point, 0.3 * m_draw.unit(), within);
      for (const std::uint32_t element : within) out.push_back(elementOf(element));
    });
    take("distance", [&](auto& out) {
      const GeometryDistance d = collisions.queries().distance(vertices, body);
      out.push_back(std::bit_cast<std::uint64_t>(d.distance));
      out.push_back(elementOf(d.b.element));
    });
    take("penetration", [&](auto& out) {
      const Penetration p = collisions.queries().penetration(vertices, body);
      out.push_back(p.intersecting);
      out.push_back(std::bit_cast<std::uint64_t>(p.depth));
    });
    return all;
  };
  const ModelBody &vertices = m_lockstep.body(a), &body = m_lockstep.body(b);
  if (!vertices.removedTetrahedra.empty() || !body.removedTetrahedra.empty()) return;
  const auto found = ask(m_lockstep.first(), a, b, {}),
             truth = ask(other.object, other.ids.at(a), other.ids.at(b), body.ids());
  for (const auto& [name, words] : found)
    EXPECT_EQ(words, truth.at(name)) << name << ", " << textOf(a) << " and " << textOf(b);
}

/// Bodies whose positions are in the world have the contacts of placed ones.
void RandomHistory::compareInWorld() {
  NewObject made = newObject(m_lockstep.model(), settingsOf(Engine::Octree), true);
  giveSides(made);
  made.object.detectCollision();
  for (const ModelPair& pair : m_lockstep.model().pairs)
    EXPECT_EQ(m_lockstep.data(pair).hash(), renamedAnswer(m_lockstep.model(), pair, made).hash())
        << "positions in the world, pair " << textOf(pair.a) << ", " << textOf(pair.b) << ", "
        << textOf(pair.settings);
}

namespace {

/// By a file, if it fits one.
CollisionProblem capturedProblem(const OctreeBasedCD& collisions) {
  const CollisionProblem problem = collisions.problem();
  if (!fitsFile(problem)) return problem;
  const TemporaryFolder folder;
  const std::filesystem::path path = folder.path / "frame.capture";
  capture(collisions, path);
  return readCapture(path);
}

}  // namespace

/// A capture is the frame.
void RandomHistory::compareCapture() {
  const CollisionProblem problem = capturedProblem(m_lockstep.first());
  OctreeBasedCD again = setUp(problem);
  again.detectCollision();
  m_features.insert(Feature::Captured);
  for (std::size_t i = 0; i < problem.pairs.size(); ++i) {
    const ModelPair& pair = m_lockstep.model().pairs[i];
    if (pair.predicate) continue;
    const auto [a, b] = std::pair(problem.pairs[i].a, problem.pairs[i].b);
    EXPECT_EQ(again.collisionData(GeometryId{a}, GeometryId{b}).hash(),
              m_lockstep.data(pair).hash())
        << "capture, pair " << textOf(pair.a) << ", " << textOf(pair.b) << ", "
        << textOf(pair.settings);
  }
}

void RandomHistory::compareWithNewObjects() {
  if (m_lockstep.model().bodies.empty()) return;
  NewObject octree = newObject(m_lockstep.model(), settingsOf(Engine::Octree));
  giveSides(octree);
  octree.object.detectCollision();
  compareContacts(octree, false);
  const bool byBruteForce = m_random() % 2,
             withBruteForce = !m_draw.areLarge() || m_random() % 16 == 0;
  if (withBruteForce) {
    NewObject brute = newObject(m_lockstep.model(), settingsOf(Engine::BruteForce));
    giveSides(brute);
    brute.object.detectCollision();
    compareContacts(brute, true);
    compareCandidates(brute);
    if (byBruteForce) compareQueries(brute);
  }
  if (!byBruteForce) compareQueries(octree);
  compareCrossings();
  if (m_random() % 4 == 0) compareInWorld();
  if (m_random() % 8 == 0) compareCapture();
}

namespace {

using BoxSides = std::vector<std::array<bool, 6>>;

/// On which sides of its box each vertex lies.
BoxSides boxSides(const Positions& positions) {
  Eigen::AlignedBox3d box;
  for (const Vector3d& p : positions) box.extend(p);
  BoxSides all;
  for (const Vector3d& p : positions) {
    std::array<bool, 6> sides{};
    for (std::size_t k = 0; k < 3; ++k) {
      const auto axis = static_cast<Eigen::Index>(k);
      sides[k] = p[axis] == box.min()[axis], sides[3 + k] = p[axis] == box.max()[axis];
    }
    all.push_back(sides);
  }
  return all;
}

/// Whether each triangle has an area at both ends of the step, or during none of it. A point that
/// slides over others may have a passage.
bool keepAreas(const std::vector<Triangle>& triangles, const Positions& before,
               const Positions& now) {
  return std::ranges::all_of(triangles, [&](const Triangle& t) {
    const bool atStart = hasArea(before[t[0]], before[t[1]], before[t[2]]),
               atEnd = hasArea(now[t[0]], now[t[1]], now[t[2]]);
    if (atStart || atEnd) return atStart && atEnd;
    const auto side = [&](const Positions& p, std::size_t i) -> Vector3d {
      return p[t[i]] - p[t[0]];
    };
    return (side(before, 1).cross(side(now, 2)) + side(now, 1).cross(side(before, 2))).isZero(0.0);
  });
}

/// Whether each triangle is on a side of its box and faces away from it.
bool faceOutward(const std::vector<Triangle>& triangles, const Positions& p,
                 const BoxSides& sides) {
  return std::ranges::all_of(triangles, [&](const Triangle& t) {
    const Vector3d normal = (p[t[1]] - p[t[0]]).cross(p[t[2]] - p[t[0]]);
    for (std::size_t side = 0; side < 6; ++side)
      if (sides[t[0]][side] && sides[t[1]][side] && sides[t[2]][side] &&
          (side < 3 ? -1.0 : 1.0) * normal[static_cast<Eigen::Index>(side % 3)] >= 0.0)
        return true;
    return false;
  });
}

/// Whether a body is the surface of a box at both ends of the step, so that a point is in it once
/// or not at all.
bool isBoxInStep(const ModelBody& body) {
  const std::vector<Triangle>& triangles = body.geometry.triangles;
  if (!body.isMesh() || !body.removed.empty() || !body.tetrahedra.empty() ||
      !body.disabled.empty() || triangles.empty() || !findMeshDefects(triangles).closed())
    return false;
  const BoxSides sides = boxSides(body.geometry.positions);
  const auto isOnOpposite = [](const std::array<bool, 6>& s) {
    return (s[0] && s[3]) || (s[1] && s[4]) || (s[2] && s[5]);
  };
  return std::ranges::none_of(sides, isOnOpposite) && boxSides(body.before) == sides &&
         boxSides(body.now) == sides && faceOutward(triangles, body.before, sides) &&
         faceOutward(triangles, body.now, sides) &&
         keepAreas(triangles, body.beforeInWorld(), body.nowInWorld());
}

}  // namespace

/// Along the path of a vertex, the crossings of a box sum to the change of inside and outside.
void RandomHistory::compareCrossings() {
  const Model& model = m_lockstep.model();
  Model start = model;
  for (auto& [id, body] : start.bodies) body.now = body.before, body.pose = body.poseBefore;
  start.pairs.clear();
  std::optional<NewObject> before, now;
  for (const ModelPair& pair : model.pairs) {
    const CollisionFilter &f = model.bodies.at(pair.a).filter, &g = model.bodies.at(pair.b).filter;
    const bool meet = (f.mask & g.groups) != 0 && (g.mask & f.groups) != 0;
    if (!pair.settings.reportCrossings || pair.predicate || pair.a == pair.b || !meet) continue;
    for (const bool swapped : {false, true}) {
      const GeometryId own = swapped ? pair.b : pair.a, box = swapped ? pair.a : pair.b;
      const ModelBody& vertices = model.bodies.at(own);
      if (!isBoxInStep(model.bodies.at(box)) || !vertices.hasVertices() ||
          !vertices.disabled.empty() || model.bodies.at(box).isRigid())
        continue;
      std::map<std::uint32_t, int> sums;
      for (const Triangle& t : vertices.geometry.elements())
        for (const std::uint32_t v : t) sums[v] = 0;
      for (const Crossing& crossing : m_lockstep.data(pair).crossings())
        if (crossing.kind == (swapped ? ContactKind::TriangleVertex : ContactKind::VertexTriangle))
          sums.at(crossing.ids[swapped ? 1 : 0]) += crossing.forward ? -1 : 1;
      if (!before) before = newObject(start, settingsOf(Engine::Octree), true);
      if (!now) now = newObject(model, settingsOf(Engine::Octree), true);
      const SpatialQueries atStart = before->object.queries(), atEnd = now->object.queries();
      const Positions from = vertices.beforeInWorld(), to = vertices.nowInWorld();
      for (const auto& [v, sum] : sums) {
        const bool wasIn = atStart.contains(before->ids.at(box), from[v]),
                   isIn = atEnd.contains(now->ids.at(box), to[v]);
        EXPECT_EQ(sum, isIn - wasIn) << "crossings of vertex " << v << " of " << textOf(own)
                                     << " and the box " << textOf(box);
        ++m_vertexPaths;
      }
    }
  }
}

}  // namespace palpate::testing
