#include "Common/Answers.h"
#include "Common/QueryCalls.h"
#include "Common/History.h"
#include "Common/Renamed.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace palpate::testing {

namespace {

constexpr std::size_t kMostBodies = 6, kMostPairs = 6;
constexpr int kTypes = 8;  ///< see randomGeometry() and add()
/// Of lengths in histories that a fuzzer decides: the exponents of the unit, and of sizes and
/// coordinates in units.
constexpr int kMostExponent = 300, kMostSpread = 0;

Settings settingsOfLife(Random& random, OctreeBounds bounds) {
  const OctreeUpdate update = random() % 3 ? OctreeUpdate::Auto : OctreeUpdate::Rebuild;
  Settings settings = settingsOf(Engine::Octree, random() % 4 == 0 ? 2 : 1, update);
  settings.octree.maxElementsPerLeaf = random() % 2 ? 32 : 2;
  settings.octree.bounds = bounds;
  return settings;
}

std::uint32_t hashOf(const ContactFeatures& features) {
  return features.a[0] * 2654435761u ^ features.b[0] * 40503u ^ features.a[1] ^ features.b[1] * 7u ^
         static_cast<std::uint32_t>(features.kind) ^ features.tagA * 5u ^ features.tagB * 3u;
}

/// The results of a query as words, or the error that it threw.
template <class F>
std::vector<std::uint64_t> wordsOf(F&& query) {
  std::vector<std::uint64_t> words;
  try {
    query(words);
  } catch (const Error& error) {
    words = {~std::uint64_t{0}, static_cast<std::uint64_t>(error.code())};
  }
  return words;
}

void append(std::vector<std::uint64_t>& words, const InsideVertex& v) {
  Row row{v.vertex, v.triangle, v.decided};
  testing::append(row, v.weights);
  testing::append(row, v.direction);
  testing::append(row, v.depth);
  words.insert(words.end(), row.begin(), row.end());
}

}  // namespace

std::size_t RandomHistory::Body::elements() const {
  if (shape) return 0;
  return geometry.type == GeometryType::Points  ? geometry.positions.size()
         : geometry.type == GeometryType::Lines ? geometry.segments.size()
                                                : geometry.triangles.size() + removed.size();
}

std::vector<std::uint32_t> RandomHistory::Body::ids() const {
  return idsWithout(elements(), removed);
}

std::vector<std::uint32_t> RandomHistory::Body::placesOf(
    const std::vector<std::uint32_t>& elements) const {
  const std::vector<std::uint32_t> all = ids();
  std::vector<std::uint32_t> places;
  for (const std::uint32_t id : elements)
    if (const auto found = std::lower_bound(all.begin(), all.end(), id);
        found != all.end() && *found == id)
      places.push_back(static_cast<std::uint32_t>(found - all.begin()));
  return places;
}

RandomHistory::RandomHistory(Random random, OctreeBounds bounds)
    : m_random(random),
      m_collisions(settingsOfLife(m_random, bounds)),
      m_committed(settingsOf(Engine::Octree)) {}

RandomHistory::RandomHistory(std::uint64_t seed)
    : RandomHistory(Random(seed), static_cast<OctreeBounds>(seed % 3)) {}

RandomHistory::RandomHistory(std::span<const std::uint8_t> decisions)
    : RandomHistory(Random(decisions.subspan(std::min<std::size_t>(decisions.size(), 2))),
                    static_cast<OctreeBounds>(decisions.empty() ? 0 : decisions[0] % 3)) {
  if (decisions.size() > 1 && decisions[1] >= 128)
    m_unit = std::ldexp(1.0, (decisions[1] - 192) * kMostExponent / 64);
}

template <class F>
bool RandomHistory::accepts(F&& call) {
  try {
    call();
  } catch (const Error&) {
    return false;
  }
  return true;
}

GeometryId RandomHistory::anyBody() {
  auto body = m_bodies.begin();
  std::advance(body, m_random() % m_bodies.size());
  return body->first;
}

Eigen::Matrix3d RandomHistory::randomTurn() {
  return Eigen::AngleAxisd(uniform(m_random, -0.5, 0.5), randomPoint(m_random, 0.1, 1).normalized())
      .toRotationMatrix();
}

Positions RandomHistory::randomMotion(const Positions& from) {
  constexpr std::array<double, 5> kSizes{0.0, 1e-3, 0.02, 0.1, 0.5};
  const double size = m_unit * kSizes[m_random() % 5], drift = m_unit * kSizes[m_random() % 4];
  const Vector3d by = randomPoint(m_random, -drift, drift);
  Positions to = moved(m_random, from, size);
  for (Vector3d& p : to) p += by;
  return to;
}

TestGeometry RandomHistory::randomGeometry(int type) {
  switch (type) {
    case 0:
    case 1:
      return testGeometry(soup(m_random, m_random() % 12, uniform(m_random, 0.05, 0.4)));
    case 2:
      return testGeometry(
          sphere(3, 4, randomPoint(m_random, 0.3, 0.7), uniform(m_random, 0.1, 0.5)));
    case 3:
      return testGeometry(sheet(2, uniform(m_random, 0.3, 0.7), 0));
    case 4: {
      const TestGeometry line = thread(m_random, 2 + m_random() % 8, 0.3, 0.02, m_random() % 2);
      return m_random() % 3 ? line : tapered(m_random, line, 0.05);
    }
    default: {
      const TestGeometry points = particles(m_random, 1 + m_random() % 12, 0.05);
      return m_random() % 3 ? points : tapered(m_random, points, 0.1);
    }
  }
}

/// In L. A fuzzer may make a geometry smaller than others, and move a coordinate far away.
TestGeometry RandomHistory::stretched(TestGeometry geometry) {
  const int decision = m_random.isDecided() ? static_cast<int>(m_random() % 256) : 0;
  const double size =
      m_unit * (decision < 192 ? 1.0 : std::ldexp(1.0, (192 - decision) * kMostSpread / 64));
  for (Vector3d& p : geometry.positions) p *= size;
  for (double& radius : geometry.radii) radius *= size;
  if (decision % 8 == 7 && !geometry.positions.empty()) {
    Vector3d& p = geometry.positions[m_random() % geometry.positions.size()];
    const auto axis = static_cast<int>(m_random() % 3);
    const int exponent = (static_cast<int>(m_random() % 256) - 128) * kMostSpread / 128;
    p[axis] = m_unit * std::ldexp(uniform(m_random, -1, 1), exponent);
  }
  return geometry;
}

Solid RandomHistory::randomSolid() {
  Solid solid = cells(1, m_random);
  const double size = uniform(m_random, 0.2, 0.8);
  const Vector3d at = randomPoint(m_random, 0, 0.5);
  for (Vector3d& p : solid.positions) p = m_unit * (size * p + at);
  return solid;
}

GeometryId RandomHistory::addTo(OctreeBasedCD& collisions, const Body& body) {
  if (body.shape) return collisions.addAnalyticalGeometry(*body.shape);
  if (!body.tetrahedra.empty())
    return collisions.addTetrahedralMesh(body.geometry.positions, body.tetrahedra);
  return body.geometry.addTo(collisions);
}

void RandomHistory::add() {
  if (m_bodies.size() >= kMostBodies) return;
  Body body;
  const int type = static_cast<int>(m_random() % kTypes);
  if (type == 6) {
    const Solid solid = randomSolid();
    body.geometry.positions = solid.positions;
    body.tetrahedra = solid.tetrahedra;
  } else if (type == 7) {
    const std::array<AnalyticalGeometry, 5> shapes{
        Sphere{{0.1 * m_unit, 0, 0}, 0.2 * m_unit},
        Capsule{{0, 0, 0}, m_unit * Vector3d(0.3, 0.3, 0.3), 0.05 * m_unit},
        Box{{0, 0, 0}, m_unit * Vector3d(0.2, 0.1, 0.3)},
        Plane{m_unit * Vector3d(0.5, 0.5, 0.5), {1, 2, 3}},
        ConvexHull{stretched(testGeometry(soup(m_random, 2, 0.3))).positions}};
    body.shape = shapes[m_random() % 5];
  } else {
    body.geometry = stretched(randomGeometry(type));
  }
  const GeometryId id = addTo(m_collisions, body);
  ASSERT_EQ(addTo(m_committed, body), id);
  ASSERT_FALSE(m_bodies.contains(id)) << "an id was given out twice";
  if (!body.tetrahedra.empty()) {
    const auto surface = m_collisions.surface(id).triangles;
    body.geometry.triangles.assign(surface.begin(), surface.end());
  }
  body.before = body.now = body.geometry.positions;
  m_bodies.emplace(id, std::move(body));
}

void RandomHistory::remove(GeometryId id) {
  for (OctreeBasedCD* each : {&m_collisions, &m_committed}) each->removeGeometry(id);
  m_bodies.erase(id);
  std::erase_if(m_pairs, [=](const Pair& pair) { return pair.a == id || pair.b == id; });
  if (m_tracked && (m_tracked->vertices == id || m_tracked->body == id)) m_tracked.reset();
}

void RandomHistory::setPositions(GeometryId id) {
  Body& body = m_bodies.at(id);
  const Positions now = randomMotion(m_random() % 4 ? body.now : body.geometry.positions);
  if (m_random() % 4 == 0) {
    const Positions before = m_random() % 3 ? randomMotion(body.before) : body.before;
    if (!accepts([&] { m_collisions.setPositions(id, before, now); })) return;
    body.before = before;
    body.bodyGiven = true;
  } else if (!accepts([&] { m_collisions.setPositions(id, now); })) {
    return;
  }
  body.now = now;
  if (body.isNew && !body.bodyGiven) body.before = body.now;
}

void RandomHistory::setTransform(GeometryId id) {
  Body& body = m_bodies.at(id);
  const Eigen::Matrix3d rotation =
      m_random() % 4 ? Eigen::Matrix3d(randomTurn() * body.rotation) : Eigen::Matrix3d::Identity();
  const Vector3d translation = body.translation + m_unit * randomPoint(m_random, -0.1, 0.1);
  if (m_random() % 4 == 0) {
    const Eigen::Matrix3d rotationBefore = randomTurn() * body.rotationBefore;
    const Vector3d translationBefore =
        body.translationBefore + m_unit * randomPoint(m_random, -0.1, 0.1);
    if (!accepts([&] {
          m_collisions.setTransform(id, {rotationBefore, translationBefore},
                                    {rotation, translation});
        }))
      return;
    body.rotationBefore = rotationBefore;
    body.translationBefore = translationBefore;
    body.transformGiven = true;
  } else if (!accepts([&] { m_collisions.setTransform(id, {rotation, translation}); })) {
    return;
  }
  body.rotation = rotation;
  body.translation = translation;
  body.placed = true;
  if (!body.isNew || body.transformGiven) return;
  body.rotationBefore = rotation;
  body.translationBefore = translation;
}

void RandomHistory::setTopology(GeometryId id) {
  Body& body = m_bodies.at(id);
  Body next = body;
  if (body.tetrahedra.empty()) {
    next.geometry = stretched(randomGeometry(static_cast<int>(m_random() % 4)));
    for (OctreeBasedCD* each : {&m_collisions, &m_committed})
      if (!accepts(
              [&] { each->setTriangles(id, next.geometry.positions, next.geometry.triangles); }))
        return;
  } else {
    const Solid solid = randomSolid();
    next.geometry.positions = solid.positions;
    next.tetrahedra = solid.tetrahedra;
    for (OctreeBasedCD* each : {&m_collisions, &m_committed})
      each->setTetrahedra(id, solid.positions, solid.tetrahedra);
    const auto surface = m_collisions.surface(id).triangles;
    next.geometry.triangles.assign(surface.begin(), surface.end());
  }
  next.before = next.now = next.geometry.positions;
  next.isNew = true;
  next.bodyGiven = false;
  next.disabled.clear();
  next.tags.clear();
  next.removed.clear();
  if (!next.transformGiven) {
    next.rotationBefore = next.rotation;
    next.translationBefore = next.translation;
  }
  body = std::move(next);
}

/// Splits some triangles, opens slits, and adds and removes triangles.
void RandomHistory::cut(GeometryId id) {
  Body& body = m_bodies.at(id);
  TestGeometry& mesh = body.geometry;
  const std::vector<std::uint32_t> ids = body.ids();
  const auto first = static_cast<std::uint32_t>(mesh.positions.size());
  std::vector<std::uint32_t> removed;
  std::vector<Triangle> added, left;
  Positions positions, rest;
  const auto addVertex = [&](const Vector3d& now, const Vector3d& atRest) {
    positions.push_back(now + m_unit * randomPoint(m_random, -0.02, 0.02));
    rest.push_back(atRest + m_unit * randomPoint(m_random, -0.02, 0.02));
    return first + static_cast<std::uint32_t>(positions.size()) - 1;
  };
  const std::uint64_t every = m_random() % 2 ? 6 : 40;  // large cuts, and small ones
  for (std::size_t i = 0; i < ids.size(); ++i) {
    const auto [a, b, c] = mesh.triangles[i];
    if (m_random() % every) {
      left.push_back(mesh.triangles[i]);
      continue;
    }
    removed.push_back(ids[i]);
    if (m_random() % 4 == 0) continue;
    const std::uint32_t middle =
        addVertex((body.now[a] + body.now[b] + body.now[c]) / 3,
                  (mesh.positions[a] + mesh.positions[b] + mesh.positions[c]) / 3);
    const std::uint32_t other = m_random() % 2 ? middle : addVertex(body.now[a], mesh.positions[a]);
    added.insert(added.end(), {{a, b, middle}, {b, c, middle}, {c, a, other}});
  }
  if (m_random() % 4 == 0 && first > 0) {
    const auto any = [&] { return static_cast<std::uint32_t>(m_random() % first); };
    added.push_back({any(), any(), any()});
  }
  if (ids.size() + added.size() > 60) return;
  std::shuffle(removed.begin(), removed.end(), m_random);
  if (m_random() % 2) rest.clear();
  const auto total = static_cast<std::uint32_t>(body.elements());
  for (OctreeBasedCD* each : {&m_collisions, &m_committed}) {
    const auto found = each->replaceTriangles(id, removed, added, positions, rest);
    ASSERT_EQ(found.size(), added.size());
    for (std::uint32_t i = 0; i < found.size(); ++i) EXPECT_EQ(found[i], total + i);
  }
  left.insert(left.end(), added.begin(), added.end());
  mesh.triangles = left;
  if (rest.empty()) rest = positions;
  mesh.positions.insert(mesh.positions.end(), rest.begin(), rest.end());
  body.before.insert(body.before.end(), positions.begin(), positions.end());
  body.now.insert(body.now.end(), positions.begin(), positions.end());
  body.removed.insert(body.removed.end(), removed.begin(), removed.end());
  std::sort(body.removed.begin(), body.removed.end());
  if (!body.tags.empty()) body.tags.resize(body.elements(), 0);
  EXPECT_TRUE(std::ranges::equal(m_collisions.removedElements(id), body.removed));
  EXPECT_TRUE(std::ranges::equal(m_collisions.tags(id), body.tags));
}

void RandomHistory::setFilter(GeometryId id) {
  CollisionFilter filter;
  if (m_random() % 3 == 0) filter.groups = 1 + m_random() % 3;
  if (m_random() % 3 == 0) filter.mask = 1 + m_random() % 3;
  if (m_random() % 2) filter.sidedness = Sidedness::Outer;
  if (accepts([&] { m_collisions.setCollisionFilter(id, filter); }))
    m_bodies.at(id).filter = filter;
}

void RandomHistory::setDisabled(GeometryId id) {
  Body& body = m_bodies.at(id);
  std::vector<std::uint32_t> disabled;
  for (std::uint32_t i = 0; i < body.elements(); ++i)
    if (m_random() % 4 == 0) disabled.push_back(i);
  for (OctreeBasedCD* each : {&m_collisions, &m_committed})
    if (!accepts([&] { each->setDisabledElements(id, disabled); })) return;
  body.disabled = disabled;
}

void RandomHistory::setTags(GeometryId id) {
  Body& body = m_bodies.at(id);
  std::vector<std::uint32_t> tags;
  if (m_random() % 4)
    for (std::size_t i = 0; i < body.elements(); ++i)
      tags.push_back(static_cast<std::uint32_t>(m_random() % 4));
  if (accepts([&] { m_collisions.setTags(id, tags); })) body.tags = tags;
}

PairSettings RandomHistory::randomSettings() {
  constexpr std::array<Method, 5> kMethods{Method::Auto, Method::Auto, Method::Intersection,
                                           Method::Proximity, Method::Continuous};
  PairSettings settings;
  settings.method = kMethods[m_random() % 5];
  settings.thickness = m_random() % 2 ? m_unit * uniform(m_random, 0.001, 0.1) : 0.0;
  settings.contacts = m_random() % 2 ? Contacts::Distinct : Contacts::All;
  if (settings.method == Method::Continuous && m_random() % 4 == 0)
    settings.continuous.earliestTimeOnly = true;
  if (m_random() % 8 == 0) settings.restDistance = 0.2 * m_unit;
  settings.trackContacts =
      settings.contacts == Contacts::Distinct && !settings.continuous.earliestTimeOnly;
  if (m_random() % 4 == 0) {
    settings.continuous.timeTolerance = 1e-3;
    settings.freeMotionReach = 0.3 * m_unit;
  }
  return settings;
}

ContactPredicate RandomHistory::predicateOf(int number, std::vector<std::uint32_t> ofA,
                                            std::vector<std::uint32_t> ofB) {
  if (number == 0) return {};
  return [number, ofA, ofB](ContactFeatures features) {
    using Kind = ContactFeatures::Kind;
    if (features.kind == Kind::TriangleVertex && !ofA.empty()) features.a.fill(ofA[features.a[0]]);
    if (features.kind == Kind::VertexTriangle && !ofB.empty()) features.b.fill(ofB[features.b[0]]);
    return hashOf(features) % 5 != static_cast<std::uint32_t>(number);
  };
}

void RandomHistory::addOrChangePair() {
  const GeometryId a = anyBody(), b = anyBody();
  const PairSettings settings = randomSettings();
  const auto pair = std::find_if(m_pairs.begin(), m_pairs.end(), [&](const Pair& p) {
    return (p.a == a && p.b == b) || (p.a == b && p.b == a);
  });
  if (pair == m_pairs.end()) {
    if (m_pairs.size() < kMostPairs &&
        accepts([&] { m_collisions.addCollisionPair(a, b, settings); }))
      m_pairs.push_back({a, b, settings});
    return;
  }
  const auto action = m_random() % 4;
  if (action == 0) {
    m_collisions.removeCollisionPair(a, b);
    m_pairs.erase(pair);
  } else if (action == 1) {
    const int number = static_cast<int>(m_random() % 5);
    if (accepts([&] { m_collisions.setContactPredicate(pair->a, pair->b, predicateOf(number)); }))
      pair->predicate = number;
  } else if (accepts([&] { m_collisions.setPairSettings(a, b, settings); })) {
    pair->settings = settings;
  }
}

/// Calls that change nothing.
void RandomHistory::query() {
  const GeometryId a = anyBody(), b = anyBody();
  switch (m_random() % 8) {
    case 0:
      return m_collisions.update();
    case 1:
    case 2:
      return m_collisions.detectCollision();
    case 3: {
      std::size_t count = 0;
      m_collisions.forEachCandidate(
          [&](const CollisionPair&, auto batch) { count += batch.size(); });
      return;
    }
    case 4:
      accepts([&] { testing::insideVertices(m_collisions, a, b); });
      return;
    case 5:
      accepts([&] {
        testing::insideVertices(m_collisions, a, b, {.rule = InsideRule::WindingNumber});
      });
      return;
    case 6:
      accepts([&] { testing::embeddedVertices(m_collisions, a, b); });
      return;
    default:
      if (!m_tracked) m_tracked.emplace(a, b);
      accepts([&] { m_tracked->running.update(m_collisions.queries()); });
  }
}

void RandomHistory::act() {
  const auto action = m_random() % 18;
  if (m_bodies.size() < 2 || action == 0) return add();
  const GeometryId id = anyBody();
  Body& body = m_bodies.at(id);
  if (action == 1 && m_bodies.size() > 3 && m_random() % 2) return remove(id);
  if (action == 2) {
    if (body.isMesh()) setTopology(id);
    return;
  }
  if (action == 16) {
    if (body.isMesh() && body.tetrahedra.empty()) cut(id);
    return;
  }
  if (action == 17) return setTags(id);
  if (action == 3) return setFilter(id);
  if (action == 4) return setDisabled(id);
  if (action < 8) return addOrChangePair();
  if (action < 10) return query();
  if (action < 12 || body.shape) return setTransform(id);
  setPositions(id);
}

/// Both ends of the step, for a geometry that is new in the object.
void RandomHistory::setEnds(OctreeBasedCD& collisions, GeometryId id, const Body& body) {
  if (!body.shape) collisions.setPositions(id, body.before, body.now);
  if (body.placed)
    collisions.setTransform(id, {body.rotationBefore, body.translationBefore},
                            {body.rotation, body.translation});
}

OctreeBasedCD RandomHistory::fresh(Engine engine, std::map<GeometryId, GeometryId>& ids) const {
  OctreeBasedCD collisions(settingsOf(engine));
  for (const auto& [id, body] : m_bodies) {
    const GeometryId own = addTo(collisions, body);
    ids.emplace(id, own);
    setEnds(collisions, own, body);
    collisions.setCollisionFilter(own, body.filter);
    collisions.setDisabledElements(own, body.placesOf(body.disabled));
    std::vector<std::uint32_t> tags;
    if (!body.tags.empty() && body.tetrahedra.empty())
      for (const std::uint32_t i : body.ids()) tags.push_back(body.tags[i]);
    collisions.setTags(own, body.tetrahedra.empty() ? tags : body.tags);
  }
  for (const Pair& pair : m_pairs) {
    collisions.addCollisionPair(ids.at(pair.a), ids.at(pair.b), pair.settings);
    if (pair.predicate)
      collisions.setContactPredicate(
          ids.at(pair.a), ids.at(pair.b),
          predicateOf(pair.predicate, m_bodies.at(pair.a).ids(), m_bodies.at(pair.b).ids()));
  }
  return collisions;
}

/// Whether two geometries neither intersect nor touch when the step begins, by brute force.
bool RandomHistory::startsApart(const Pair& pair) const {
  OctreeBasedCD collisions(settingsOf(Engine::BruteForce));
  const auto add = [&](GeometryId id) {
    const Body& body = m_bodies.at(id);
    const GeometryId own = addTo(collisions, body);
    collisions.setPositions(own, body.before, body.before);
    if (body.placed && pair.a != pair.b)
      collisions.setTransform(own, {body.rotationBefore, body.translationBefore});
    collisions.setDisabledElements(own, body.placesOf(body.disabled));
    return own;
  };
  const GeometryId a = add(pair.a), b = pair.a == pair.b ? a : add(pair.b);
  const bool areMeshes = m_bodies.at(pair.a).isMesh() && m_bodies.at(pair.b).isMesh();
  PairSettings settings{.method = Method::Intersection};
  if (!areMeshes)  // features that are near at rest have no radius
    settings = {.method = Method::Proximity, .restDistance = pair.settings.restDistance};
  collisions.addCollisionPair(a, b, settings);
  collisions.detectCollision();
  return areMeshes ? collisions.collisionData(a, b).intersectingTriangles().empty()
                   : collisions.statistics().contacts == 0;
}

void RandomHistory::compareContacts(const OctreeBasedCD& other,
                                    const std::map<GeometryId, GeometryId>& ids,
                                    bool isBruteForce) {
  for (const Pair& pair : m_pairs) {
    const CollisionData& found = m_collisions.collisionData(pair.a, pair.b);
    const CollisionData& truth = other.collisionData(ids.at(pair.a), ids.at(pair.b));
    const auto ofA = m_bodies.at(pair.a).ids(), ofB = m_bodies.at(pair.b).ids();
    SCOPED_TRACE(::testing::Message() << "pair (" << static_cast<unsigned>(pair.a) << ", "
                                      << static_cast<unsigned>(pair.b) << "), method "
                                      << static_cast<int>(pair.settings.method) << ", thickness "
                                      << pair.settings.thickness << ", predicate " << pair.predicate
                                      << (isBruteForce ? ", brute force" : ""));
    EXPECT_EQ(found.hash(), renamed(truth, ofA, ofB).hash());
    for (int kind = 0; kind < 5; ++kind)
      EXPECT_TRUE(std::ranges::equal(found.tags(static_cast<ContactKind>(kind)),
                                     truth.tags(static_cast<ContactKind>(kind))));
    EXPECT_EQ(found.earliestTimeOfImpact(), truth.earliestTimeOfImpact());
    const Validity &v = found.validity(), &t = truth.validity();
    EXPECT_EQ(v.method, t.method);
    EXPECT_EQ(v.reason, t.reason);
    EXPECT_EQ(v.atEnd, t.atEnd);
    EXPECT_EQ(v.atImpact, t.atImpact);
    EXPECT_NEAR(v.displacement, t.displacement, 1e-12 * m_unit);
    EXPECT_EQ(v.displacementLimit, t.displacementLimit);
    if (std::isinf(t.arcDeviation))
      EXPECT_EQ(v.arcDeviation, t.arcDeviation);
    else
      EXPECT_NEAR(v.arcDeviation, t.arcDeviation, 1e-12 * m_unit);
    // A new object always knows startedApart. One with a history may not know it, but is never
    // wrong.
    if (!isBruteForce) {  // without boxes, Intersection does not know distances
      EXPECT_LE(v.trusted, t.trusted);
    }
    if (v.startedApart && !t.startedApart) {
      EXPECT_TRUE(startsApart(pair));
    }
  }
  for (const auto& [id, body] : m_bodies)
    EXPECT_TRUE(std::ranges::equal(m_collisions.freeMotion(id), other.freeMotion(ids.at(id))))
        << "free motion of geometry " << static_cast<unsigned>(id);
}

void RandomHistory::compareCandidates(OctreeBasedCD& bruteForce,
                                      const std::map<GeometryId, GeometryId>& ids) {
  for (const Pair& pair : m_pairs) {
    if (m_bodies.at(pair.a).shape || m_bodies.at(pair.b).shape) continue;
    const auto found = m_collisions.candidatePairs(pair.a, pair.b);
    auto truth = bruteForce.candidatePairs(ids.at(pair.a), ids.at(pair.b));
    const auto ofA = m_bodies.at(pair.a).ids(), ofB = m_bodies.at(pair.b).ids();
    for (auto& [a, b] : truth) a = ofA[a], b = ofB[b];
    EXPECT_TRUE(std::includes(found.begin(), found.end(), truth.begin(), truth.end()));
    EXPECT_EQ(std::adjacent_find(found.begin(), found.end()), found.end());
  }
}

void RandomHistory::compareQueries(OctreeBasedCD& other,
                                   const std::map<GeometryId, GeometryId>& ids) {
  const GeometryId a = anyBody(), b = anyBody();
  const Vector3d point = m_unit * randomPoint(m_random, 0, 1);
  const auto ask = [&](OctreeBasedCD& collisions, GeometryId vertices, GeometryId body,
                       const std::vector<std::uint32_t>& elements) {
    std::vector<std::uint64_t> all;
    for (const InsideRule rule : {InsideRule::Closed, InsideRule::WindingNumber}) {
      const auto words = wordsOf([&](auto& out) {
        for (InsideVertex v : testing::insideVertices(collisions, vertices, body, {.rule = rule})) {
          if (!elements.empty()) v.triangle = elements[v.triangle];
          append(out, v);
        }
      });
      all.insert(all.end(), words.begin(), words.end());
    }
    const auto words = wordsOf([&](auto& out) {
      for (const EmbeddedVertex& v : testing::embeddedVertices(collisions, vertices, body)) {
        out.push_back(v.vertex);
        out.push_back(v.at.tetrahedron);
        for (const double weight : v.at.weights)
          out.push_back(std::bit_cast<std::uint64_t>(weight));
      }
      const auto at = collisions.queries().findTetrahedron(body, point);
      out.push_back(at ? at->tetrahedron : ~0u);
    });
    all.insert(all.end(), words.begin(), words.end());
    const auto nearest = wordsOf([&](auto& out) {
      const SpatialQueries queries = collisions.queries();
      const auto elementOf = [&](std::uint32_t element) {
        return elements.empty() || element == kNoElement ? element : elements[element];
      };
      const auto at = queries.closestPoint(body, point);
      out.push_back(at ? elementOf(at->element) : ~0u);
      const auto hit = queries.firstHit(body, {point, {1, 2, 3}});
      out.push_back(hit ? elementOf(hit->element) : ~0u);
      std::vector<std::uint32_t> within;
      queries.elementsWithin(body, point, 0.3 * m_unit, within);
      for (const std::uint32_t element : within) out.push_back(elementOf(element));
    });
    all.insert(all.end(), nearest.begin(), nearest.end());
    return all;
  };
  EXPECT_EQ(ask(m_collisions, a, b, {}), ask(other, ids.at(a), ids.at(b), m_bodies.at(b).ids()));
}

void RandomHistory::expectSameEnds(const OctreeBasedCD& other) const {
  const CollisionProblem running = m_collisions.problem(), truth = other.problem();
  ASSERT_EQ(running.geometries.size(), m_bodies.size());
  ASSERT_EQ(truth.geometries.size(), m_bodies.size());
  for (std::size_t i = 0; i < m_bodies.size(); ++i) {
    EXPECT_EQ(running.geometries[i].before, truth.geometries[i].before);
    EXPECT_EQ(running.geometries[i].now, truth.geometries[i].now);
  }
}

/// Ends the step.
void RandomHistory::compareWhatLasts() {
  for (const auto& [id, body] : m_bodies) {
    if (!body.shape && body.bodyGiven)
      m_committed.setPositions(id, body.before, body.now);
    else if (!body.shape)
      m_committed.setPositions(id, body.now);
    if (body.placed && body.transformGiven)
      m_committed.setTransform(id, {body.rotationBefore, body.translationBefore},
                               {body.rotation, body.translation});
    else if (body.placed)
      m_committed.setTransform(id, {body.rotation, body.translation});
  }
  expectSameEnds(m_committed);
  if (!m_tracked) return;
  const auto track = [&](PenetrationTracker& tracker, OctreeBasedCD& collisions) {
    return wordsOf([&](auto& out) {
      for (const TrackedVertex& v : tracker.update(collisions.queries())) {
        append(out, v.penetration);
        append(out, v.nearest);
        out.push_back(static_cast<std::uint64_t>(v.change));
      }
    });
  };
  EXPECT_EQ(track(m_tracked->running, m_collisions), track(m_tracked->committed, m_committed));
}

void RandomHistory::endStep() {
  for (OctreeBasedCD* each : {&m_collisions, &m_committed}) each->advance();
  for (auto& [id, body] : m_bodies) {
    body.before = body.now;
    body.rotationBefore = body.rotation;
    body.translationBefore = body.translation;
    body.isNew = body.bodyGiven = body.transformGiven = false;
  }
  if (m_random() % 4 == 0) m_tracked.reset();
}

void RandomHistory::actAndDetect() {
  for (auto count = m_random() % 8; count > 0; --count) act();
  m_collisions.detectCollision();
}

void RandomHistory::replay() {
  m_tracked.reset();  // a tracker has its own state
  const Random random = m_random;
  const std::map<GeometryId, Body> bodies = m_bodies;
  const std::vector<Pair> pairs = m_pairs;
  const std::vector<std::byte> state = m_collisions.save(), committed = m_committed.save();
  actAndDetect();
  const Answers truth(m_collisions);
  m_tracked.reset();
  m_random = random;
  m_bodies = bodies;
  m_pairs = pairs;
  if (m_bodies.size() % 2) m_collisions = OctreeBasedCD(m_collisions.settings());
  m_collisions.restore(state);
  EXPECT_TRUE(m_collisions.save() == state);
  m_committed.restore(committed);
  actAndDetect();
  expectSame(Answers(m_collisions), truth);
}

void RandomHistory::frame() {
  // A restored object has its own predicates, which the frame may have changed.
  const bool hasPredicate =
      std::any_of(m_pairs.begin(), m_pairs.end(), [](const Pair& pair) { return pair.predicate; });
  if (m_random() % 4 == 0 && !hasPredicate)
    replay();
  else
    actAndDetect();
  m_contacts += m_collisions.statistics().contacts;
  EXPECT_EQ(m_collisions.octree().validate(), std::vector<std::string>{});
  if (!m_bodies.empty()) {
    std::map<GeometryId, GeometryId> ids, bruteIds;
    OctreeBasedCD octree = fresh(Engine::Octree, ids),
                  bruteForce = fresh(Engine::BruteForce, bruteIds);
    octree.detectCollision();
    bruteForce.detectCollision();
    expectSameEnds(octree);
    compareContacts(octree, ids, false);
    compareContacts(bruteForce, bruteIds, true);
    compareCandidates(bruteForce, bruteIds);
    const bool byBruteForce = m_random() % 2;
    compareQueries(byBruteForce ? bruteForce : octree, byBruteForce ? bruteIds : ids);
  }
  compareWhatLasts();
  endStep();
}

}  // namespace palpate::testing
