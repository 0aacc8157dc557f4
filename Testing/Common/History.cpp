#include "Common/History.h"
#include "Common/QueryCalls.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

namespace palpate::testing {

namespace {

using Who = Lockstep::Who;

constexpr std::size_t kMostBodies = 6, kMostPairs = 6, kMostElements = 60;
constexpr int kTypes = 8;           ///< see add()
constexpr int kMostExponent = 300;  ///< of the unit in histories that a fuzzer decides

std::uint64_t mixed(std::uint64_t seed, std::uint64_t number) {
  std::uint64_t value = (seed + 1) * 0x9e3779b97f4a7c15u + number;
  value = (value ^ value >> 30) * 0xbf58476d1ce4e5b9u;
  return value ^ value >> 29;
}

/// A mesh with a distance field of it.
struct FieldBody {
  explicit FieldBody(Mesh body)
      : mesh(std::move(body)),
        field(std::make_shared<const DistanceField>(DistanceField::build(
            {mesh.positions, mesh.triangles}, {.errorBound = 0.03, .band = 0.2, .threads = 1}))) {}
  Mesh mesh;
  std::shared_ptr<const DistanceField> field;
};
const FieldBody& fieldBody(std::size_t number) {
  static const std::array<FieldBody, 2> all{
      FieldBody(sphere(4, 6, {0.5, 0.5, 0.5}, 0.3)),
      FieldBody(boxMesh({0.25, 0.25, 0.25}, {0.75, 0.75, 0.5}))};
  return all[number % all.size()];
}

/// Of an object with octrees: any members, but few features in an audit.
Settings drawnSettings(Random& random, OctreeBounds bounds) {
  Settings settings = settingsOf(Engine::Octree);
  settings.octree.bounds = bounds;
  DrawnSettings(random, 4, {0, 0, 0, 0})(settings);
  settings.engine = Engine::Octree;
  settings.threads = 1;
  settings.audit.features = settings.audit.features > 7 ? 7 : settings.audit.features;
  return settings;
}

}  // namespace

void FeaturePairsTable::print(std::ostream& out) const {
  const auto& names = kEnumerators<Feature>;
  const auto count = [&](Feature a, Feature b) {
    const auto found = m_counts.find({a, b});
    return found == m_counts.end() ? 0 : found->second;
  };
  for (std::size_t i = 0; i < names.size(); ++i) {
    const auto a = static_cast<Feature>(i);
    out << names[i] << ": " << count(a, a) << " frames; never with";
    for (std::size_t j = 0; j < names.size(); ++j)
      if (const auto b = static_cast<Feature>(j); count(a, b) == 0) out << ' ' << names[j];
    out << '\n';
  }
}

RandomHistory::RandomHistory(Random random, std::uint64_t seed, Space space, BodySize size,
                             double unit)
    : m_random(random), m_seed(seed), m_draw(m_random, space, size, unit), m_lockstep(seed) {
  const Settings plain = drawnSettings(m_random, static_cast<OctreeBounds>(seed % 3));
  Settings other = drawnSettings(m_random, static_cast<OctreeBounds>((seed + 1) % 3));
  other.octree.keepsPairs = !plain.octree.keepsPairs;
  other.octree.update =
      plain.octree.update == OctreeUpdate::Auto ? OctreeUpdate::Rebuild : OctreeUpdate::Auto;
  other.threads = m_random() % 4 ? 1 : 2;
  // The draws do not depend on the processor.
  const std::vector<std::string> paths = simdPaths();
  const auto path = [&](std::uint64_t number) { return paths[mixed(seed, number) % paths.size()]; };
  m_lockstep.add("plain", Life::Plain, plain);
  m_lockstep.add("other settings", Life::Plain, other, path(1));
  if (size == BodySize::Small)
    m_lockstep.add("brute force", Life::Plain, settingsOf(Engine::BruteForce));
  m_lockstep.add("restored", Life::Restored, settingsOf(Engine::Octree), path(2));
  m_lockstep.add("troubled", Life::Troubled, settingsOf(Engine::Octree));
  m_lockstep.add("committed", Life::Committed, settingsOf(Engine::Octree));
}

namespace {

Space spaceOf(std::uint64_t seed) {
  return seed % 2 ? static_cast<Space>(seed / 2 % countEnumerators<Space>()) : Space::Unit;
}

double unitOf(std::span<const std::uint8_t> decisions) {
  return decisions.size() > 1 && decisions[1] >= 128
             ? std::ldexp(1.0, (decisions[1] - 192) * kMostExponent / 64)
             : 1.0;
}

}  // namespace

RandomHistory::RandomHistory(std::uint64_t seed, BodySize size)
    : RandomHistory(Random(seed), seed, spaceOf(seed), size,
                    spaceOf(seed) == Space::Tiny ? 0x1p-300 : 1.0) {}

RandomHistory::RandomHistory(std::span<const std::uint8_t> decisions)
    : RandomHistory(Random(decisions.subspan(std::min<std::size_t>(decisions.size(), 2))),
                    decisions.empty() ? 0 : decisions[0], Space::Unit, BodySize::Small,
                    unitOf(decisions)) {}

std::string RandomHistory::description() const {
  return "seed " + std::to_string(m_seed) + ", space " +
         std::string(kEnumerators<Space>[static_cast<std::size_t>(m_draw.space())]) +
         (m_draw.areLarge() ? ", large" : "") + ", octree settings " +
         textOf(m_lockstep.first().settings().octree);
}

bool RandomHistory::decide() {
  const std::size_t number = m_decisions++;
  if (!m_random.isDecided()) m_random = Random(mixed(m_seed, number));
  m_lockstep.drawTroubles(m_random());
  return !m_leftOut.contains(number);
}

GeometryId RandomHistory::anyBody() {
  auto body = m_lockstep.model().bodies.begin();
  std::advance(body, m_random() % m_lockstep.model().bodies.size());
  return body->first;
}

const ModelPair* RandomHistory::anyPair() {
  const std::vector<ModelPair>& pairs = m_lockstep.model().pairs;
  return pairs.empty() ? nullptr : &pairs[m_random() % pairs.size()];
}

void RandomHistory::add() {
  if (m_lockstep.model().bodies.size() >= kMostBodies / (m_draw.areLarge() ? 2 : 1)) return;
  ModelBody body;
  const bool mayHaveField = m_draw.unit() == 1.0 && m_draw.space() != Space::Far;
  const auto kind = m_random() % 24;
  const int type = static_cast<int>(m_random() % kTypes);
  // New objects make leaves again in each frame, which takes long.
  if (mayHaveField && (kind < 3 || (kind == 3 && m_seed % 32 == 22))) {
    const FieldBody& rigid = fieldBody(kind == 3 ? 1 : m_random());  // leaves of few triangles
    if (kind == 0) {
      body.geometry.type = GeometryType::Field;
    } else {
      body.geometry = testGeometry(rigid.mesh);
    }
    if (kind < 3)
      body.field = rigid.field;
    else
      body.leaves = SurfaceProxySettings{.reach = 0.1, .errorBound = 0.1};
  } else if (type == 6) {
    const Solid solid = m_draw.solid();
    body.geometry.positions = solid.positions;
    body.tetrahedra = solid.tetrahedra;
  } else if (type == 7) {
    body.shape = m_draw.shape();
  } else {
    body.geometry = m_draw.geometry(type);
  }
  m_lockstep.add(body);
}

void RandomHistory::setPositions(GeometryId id) {
  const ModelBody& body = m_lockstep.body(id);
  const bool fromRest = m_random() % (m_draw.areLarge() ? 32 : 4) == 0;
  const Positions now = m_draw.motion(fromRest ? body.geometry.positions : body.now);
  if (m_random() % 4) {
    m_lockstep.setPositions(id, now);
    return;
  }
  const Positions before = m_random() % 3 ? m_draw.motion(body.before) : body.before;
  if (m_lockstep.setPositions(id, before, now)) m_features.insert(Feature::BothEnds);
}

void RandomHistory::setSomePositions(GeometryId id) {
  const Positions& now = m_lockstep.body(id).now;
  if (now.empty()) return;
  const std::size_t first = m_random() % now.size(),
                    count = m_random() % std::min<std::size_t>(8, now.size() - first + 1);
  const auto begin = now.begin() + static_cast<std::ptrdiff_t>(first);
  if (m_lockstep.setSomePositions(
          id, first, m_draw.motion({begin, begin + static_cast<std::ptrdiff_t>(count)})))
    m_features.insert(Feature::SomePositions);
}

void RandomHistory::setTransform(GeometryId id) {
  const ModelBody& body = m_lockstep.body(id);
  const Pose now = m_draw.pose(body.pose);
  if (m_random() % 4)
    m_lockstep.setTransform(id, now);
  else
    m_lockstep.setTransform(id, m_draw.pose(body.poseBefore), now);
}

void RandomHistory::setTopology(GeometryId id) {
  bool isNew = false;
  if (m_lockstep.body(id).tetrahedra.empty()) {
    const int type = static_cast<int>(m_random() % 4);
    isNew = m_lockstep.setTriangles(id, m_draw.geometry(type));
  } else {
    const Solid solid = m_draw.solid();
    isNew = m_lockstep.setTetrahedra(id, solid.positions, solid.tetrahedra);
  }
  if (isNew) m_features.insert(Feature::NewTopology);
}

void RandomHistory::cut(GeometryId id) {
  if (m_lockstep.body(id).tetrahedra.empty())
    cutTriangles(id);
  else
    cutTetrahedra(id);
}

/// Splits some triangles, opens slits, and adds and removes triangles.
void RandomHistory::cutTriangles(GeometryId id) {
  const ModelBody& body = m_lockstep.body(id);
  const TestGeometry& mesh = body.geometry;
  const Ids ids = body.ids();
  const auto first = static_cast<std::uint32_t>(mesh.positions.size());
  Ids removed;
  std::vector<Triangle> added;
  Positions positions, rest;
  const auto addVertex = [&](const Vector3d& now, const Vector3d& atRest) {
    positions.push_back(m_draw.inSpace(now + m_draw.unit() * randomPoint(m_random, -0.02, 0.02)));
    rest.push_back(m_draw.inSpace(atRest + m_draw.unit() * randomPoint(m_random, -0.02, 0.02)));
    return first + static_cast<std::uint32_t>(positions.size()) - 1;
  };
  // Large cuts, and small ones.
  const std::uint64_t every = m_draw.areLarge() ? 200 : m_random() % 2 ? 6 : 40;
  for (std::size_t i = 0; i < ids.size(); ++i) {
    const auto [a, b, c] = mesh.triangles[i];
    if (m_random() % every) continue;
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
  if (!m_draw.areLarge() && ids.size() + added.size() > kMostElements) return;
  std::shuffle(removed.begin(), removed.end(), m_random);
  if (m_random() % 2) rest.clear();
  if (m_lockstep.cut(id, removed, added, positions, rest)) m_features.insert(Feature::Cut);
}

/// Removes some tetrahedra and splits others at their middle.
void RandomHistory::cutTetrahedra(GeometryId id) {
  const ModelBody& body = m_lockstep.body(id);
  const auto first = static_cast<std::uint32_t>(body.geometry.positions.size());
  Ids removed;
  std::vector<Tetrahedron> added;
  Positions positions, rest;
  const Ids ids = idsWithout(body.tetrahedra.size(), body.removedTetrahedra);
  for (const std::uint32_t i : ids) {
    if (m_random() % 6 || ids.size() + added.size() > kMostElements) continue;
    removed.push_back(i);
    if (m_random() % 3 == 0) continue;
    const Tetrahedron& corners = body.tetrahedra[i];
    Vector3d now = Vector3d::Zero(), atRest = now;
    for (const std::uint32_t v : corners)
      now += body.now[v] / 4, atRest += body.geometry.positions[v] / 4;
    positions.push_back(m_draw.inSpace(now));
    rest.push_back(m_draw.inSpace(atRest));
    for (std::size_t k = 0; k < 4; ++k) {
      Tetrahedron part = corners;
      part[k] = first + static_cast<std::uint32_t>(positions.size()) - 1;
      added.push_back(part);
    }
  }
  if (m_random() % 2) rest.clear();
  if (m_lockstep.cut(id, removed, added, positions, rest))
    m_features.insert(Feature::TetrahedraCut);
}

void RandomHistory::setFilter(GeometryId id) {
  CollisionFilter filter;
  DrawnSettings(m_random, 3, m_draw.lengths())(filter);
  m_lockstep.setFilter(id, filter);
}

void RandomHistory::setDisabled(GeometryId id) {
  Ids disabled;
  const std::uint64_t every = m_random() % 2 ? 4 : 16;
  for (std::uint32_t i = 0; i < m_lockstep.body(id).elements(); ++i)
    if (m_random() % every == 0) disabled.push_back(i);
  m_lockstep.setDisabled(id, disabled);
}

void RandomHistory::setTags(GeometryId id) {
  Ids tags;
  if (m_random() % 4)
    for (std::size_t i = 0; i < m_lockstep.body(id).tagCount(); ++i)
      tags.push_back(static_cast<std::uint32_t>(m_random() % 4));
  m_lockstep.setTags(id, tags);
}

PairSettings RandomHistory::randomSettings() {
  if (m_draw.areLarge() && m_random() % 2) {  // of which candidates are kept
    PairSettings settings{.method = Method::Proximity, .thickness = m_draw.lengths()[2]};
    DrawnSettings(m_random, 6, m_draw.lengths())(settings);
    return settings;
  }
  constexpr std::array<Method, 7> kMethods{
      Method::Auto,      Method::Auto,       Method::Continuous, Method::Intersection,
      Method::Proximity, Method::Continuous, Method::Proximity};
  PairSettings settings;
  settings.method = kMethods[m_random() % 7];
  settings.thickness = m_random() % 2 ? m_draw.lengths()[m_random() % 4] : 0.0;
  settings.contacts = m_random() % 2 ? Contacts::Distinct : Contacts::All;
  settings.trackContacts = m_random() % 2;
  settings.smoothNormals = m_random() % 4 == 0;
  if (settings.method == Method::Continuous || settings.method == Method::Auto) {
    settings.reportCrossings = m_random() % 3 == 0;
    settings.rememberSides = m_random() % 3 == 0;
  }
  if (m_random() % 4 == 0) settings.continuous.timeTolerance = 1e-3;
  if (m_random() % 4 == 0) settings.freeMotionReach = m_draw.lengths()[m_random() % 4];
  if (m_random() % 3 == 0) DrawnSettings(m_random, 8, m_draw.lengths())(settings);
  if (settings.method == Method::Continuous && m_random() % 8 == 0) {
    settings.continuous.earliestTimeOnly = true;
    settings.trackContacts = settings.reportCrossings = settings.rememberSides =
        settings.smoothNormals = false;
  }
  if (settings.method == Method::Proxy) settings.allowedError = m_draw.length(0.125);
  return settings;
}

void RandomHistory::addOrChangePair() {
  const GeometryId a = anyBody(), b = anyBody();
  if (const ModelPair* pair =
          m_lockstep.model().pairs.empty() || m_random() % 2 ? nullptr : anyPair())
    return changePair(*pair);
  if (m_lockstep.model().pairs.size() >= kMostPairs) return;
  for (int attempt = 0; attempt < 3; ++attempt) {
    PairSettings settings = randomSettings();
    if (a == b && m_random() % 2) settings.restDistance = m_draw.length(0.2);
    if (m_lockstep.addPair(a, b, settings)) return;
  }
}

void RandomHistory::changePair(const ModelPair& pair) {
  const auto [a, b, settings, predicate] = pair;
  switch (m_random() % 4) {
    case 0:
      if (!m_draw.areLarge() || m_random() % 4 == 0) m_lockstep.removePair(a, b);
      return;
    case 1: {
      const int number = static_cast<int>(m_random() % 5);
      m_lockstep.setPredicate(a, b, number);
      return;
    }
    default:
      m_lockstep.setPair(a, b, randomSettings());
  }
}

void RandomHistory::setSides() {
  const ModelPair* const pair = anyPair();
  if (!pair || !pair->settings.rememberSides) return;
  std::vector<Crossing> sides;
  try {
    for (const Crossing& side : m_lockstep.data(*pair).rememberedSides())
      if (m_random() % 3) sides.push_back(side);
  } catch (const Error&) {  // the pair was not detected yet
  }
  const Ids ofB = m_lockstep.body(pair->b).ids();
  const std::size_t vertices = m_lockstep.body(pair->a).geometry.positions.size();
  if (m_random() % 2 && vertices > 0 && !ofB.empty() && pair->a != pair->b) {
    Crossing side;
    side.ids = {static_cast<std::uint32_t>(m_random() % vertices), ofB[m_random() % ofB.size()],
                kNoElement, kNoElement};
    side.forward = m_random() % 2;
    sides.push_back(side);
  }
  if (m_lockstep.setSides(pair->a, pair->b, sides)) m_features.insert(Feature::GivenSides);
}

/// After the last detection of the step.
void RandomHistory::setUserData() {
  const ModelPair* const pair = anyPair();
  if (!pair) return;
  const CollisionData& data = m_lockstep.data(*pair);
  for (const auto list : {data.trackedVertexTriangle(), data.trackedEdgeEdge(),
                          data.trackedTriangleVertex(), data.trackedShape()})
    if (!list.empty()) {
      const ContactKey key = list[m_random() % list.size()].key;
      if (m_lockstep.setUserData(pair->a, pair->b, key, m_random() % 1000))
        m_features.insert(Feature::UserData);
      return;
    }
}

void RandomHistory::hold() {
  const GeometryId fixed = anyBody(), grouped = anyBody();
  Ids vertices;
  std::vector<GuardedVertex> group;
  const std::size_t ofFixed = m_lockstep.body(fixed).now.size(),
                    ofGrouped = m_lockstep.body(grouped).now.size();
  for (std::uint32_t v = 0; v < ofFixed; ++v)
    if (m_random() % 16 == 0) vertices.push_back(v);
  if (m_random() % 2)
    for (std::uint32_t v = 0; v < ofGrouped; ++v)
      if (m_random() % 4 == 0) group.push_back({grouped, v});
  if (const auto held = m_lockstep.hold(fixed, vertices, group)) {
    if (*held > 0) m_features.insert(Feature::Guard);
    expectNothingTouches();
  }
}

/// Features without radii do not touch within the step, unless they touched when it began.
void RandomHistory::expectNothingTouches() {
  if (m_draw.space() != Space::Unit) return;
  Model guarded = m_lockstep.model();
  std::erase_if(guarded.pairs, [&](const ModelPair& pair) {
    const auto isCertain = [&](GeometryId id) {
      const ModelBody& body = guarded.bodies.at(id);
      return body.hasVertices() && body.filter.sidedness == Sidedness::Both &&
             std::ranges::all_of(body.geometry.radii, [](double r) { return r == 0.0; });
    };
    return !isCertain(pair.a) || !isCertain(pair.b);
  });
  // Continuous takes one radius for all vertices.
  for (const ModelPair& pair : guarded.pairs)
    for (const GeometryId id : {pair.a, pair.b}) guarded.bodies.at(id).geometry.radii = {0.0};
  for (ModelPair& pair : guarded.pairs)
    pair.settings = {.method = Method::Continuous,
                     .contacts = Contacts::All,
                     .restDistance = pair.settings.restDistance,
                     .continuous = {.timeTolerance = 1.0}};
  NewObject held = newObject(guarded, settingsOf(Engine::Octree));
  held.object.detectCollision();
  for (const ModelPair& pair : guarded.pairs) {
    const CollisionData& data = held.object.collisionData(held.ids.at(pair.a), held.ids.at(pair.b));
    EXPECT_EQ(data.vertexTriangle().size() + data.triangleVertex().size() + data.edgeEdge().size(),
              0u)
        << "features touch after StepGuard::hold()";
  }
}

/// Watches a thread through a triangle, or beside another thread.
void RandomHistory::watch() {
  const GeometryId a = anyBody(), b = anyBody();
  const ModelBody &thread = m_lockstep.body(a), &other = m_lockstep.body(b);
  if (a == b || thread.geometry.type != GeometryType::Lines || !thread.hasVertices()) return;
  const auto path = [](GeometryId id, std::size_t count) {
    Ids vertices(count);
    std::iota(vertices.begin(), vertices.end(), 0u);
    return VertexPath{id, vertices};
  };
  const std::size_t length = std::min<std::size_t>(thread.now.size(), 6);
  if (other.hasVertices() && other.geometry.type == GeometryType::Lines) {
    m_lockstep.watch(path(a, length), path(b, 2), true);
  } else if (other.isMesh() && !other.geometry.triangles.empty()) {
    const Triangle& loop = other.geometry.triangles[m_random() % other.geometry.triangles.size()];
    m_lockstep.watch(path(a, length), {b, {loop.begin(), loop.end()}}, false);
  }
}

namespace {

/// Positions and nearest points of a snapshot.
std::vector<std::uint64_t> wordsOfSnapshot(const Snapshot& snapshot, std::size_t geometries,
                                           double unit) {
  std::vector<std::uint64_t> words;
  for (std::uint32_t i = 0; i < geometries; ++i) {
    const GeometryId id{i};
    if (!snapshot.has(id)) continue;
    Row row;
    for (const Vector3d& p : snapshot.positions(id)) testing::append(row, p);
    for (const Vector3d& p : snapshot.positionsBefore(id)) testing::append(row, p);
    const auto nearest = wordsOf([&](auto& out) {
      const auto at = snapshot.queries().closestPoint(id, unit * Vector3d(0.5, 0.4, 0.6));
      out.push_back(at ? at->element : ~0u);
    });
    words.insert(words.end(), row.begin(), row.end());
    words.insert(words.end(), nearest.begin(), nearest.end());
  }
  return words;
}

constexpr std::size_t kFirstGeometries = 64;  ///< of which snapshots are compared

}  // namespace

void RandomHistory::publish() {
  m_lockstep.each(Who::Running, "c.publish()", [](Lockstep::Member& m) { m.object.publish(); });
  m_snapshot = m_lockstep.first().latestSnapshot();
  m_snapshotWords = wordsOfSnapshot(*m_snapshot, kFirstGeometries, m_draw.unit());
}

/// A snapshot never changes.
void RandomHistory::compareSnapshot() {
  if (!m_snapshot) return;
  m_features.insert(Feature::Snapshot);
  EXPECT_EQ(wordsOfSnapshot(*m_snapshot, kFirstGeometries, m_draw.unit()), m_snapshotWords);
  if (m_random() % 4 == 0) m_snapshot.reset();
}

/// Calls that change no answer.
void RandomHistory::query() {
  const GeometryId a = anyBody(), b = anyBody();
  const auto each = [&](const char* text, auto&& f) {
    m_lockstep.each(Who::Running, text, [&](Lockstep::Member& m) { f(m.object); });
  };
  switch (m_random() % 10) {
    case 0:
      return each("c.update()", [](OctreeBasedCD& c) { c.update(); });
    case 1:
    case 2:
      return m_lockstep.detect();
    case 3:
      return each("c.forEachCandidate([](auto&&...) {})", [](OctreeBasedCD& c) {
        std::size_t count = 0;
        c.forEachCandidate([&](const CollisionPair&, auto batch) { count += batch.size(); });
      });
    case 4:
      return each("insideVertices(c)", [&](OctreeBasedCD& c) { testing::insideVertices(c, a, b); });
    case 5:
      return each("insideVertices(c)", [&](OctreeBasedCD& c) {
        testing::insideVertices(c, a, b, {.rule = InsideRule::WindingNumber});
      });
    case 6:
      return each("embeddedVertices(c)",
                  [&](OctreeBasedCD& c) { testing::embeddedVertices(c, a, b); });
    case 7:
      return each("c.releaseMemory()", [](OctreeBasedCD& c) { c.releaseMemory(); });
    case 8:
      m_lockstep.each(Who::All, "c.setName(" + textOf(a) + ", \"organ\")",
                      [&](Lockstep::Member& m) { m.object.setName(a, "organ"); });
      return;
    default:
      m_lockstep.track(a, b);
      m_lockstep.updateTrackers(Who::Running);
  }
}

void RandomHistory::act() {
  if (m_lockstep.model().bodies.size() < 2 || m_random() % 18 == 0) return add();
  const GeometryId id = anyBody();
  const ModelBody& body = m_lockstep.body(id);
  if (m_draw.areLarge() && m_random() % 4) {  // slow motion, so that candidates are kept
    if (m_lockstep.model().pairs.empty()) return addOrChangePair();
    if (body.hasVertices()) setPositions(id);
    return;
  }
  const bool isRare = m_draw.areLarge() && m_random() % 4;
  switch (m_random() % 32) {
    case 0:
      if (m_lockstep.model().bodies.size() > 3 && !isRare) m_lockstep.remove(id);
      return;
    case 1:
      if (body.isMesh() && !isRare) setTopology(id);
      return;
    case 2:
    case 3:
      if (body.isMesh()) cut(id);
      return;
    case 4:
      return setFilter(id);
    case 5:
      return setDisabled(id);
    case 6:
      return setTags(id);
    case 7:
    case 8:
    case 9:
    case 10:
    case 11:
      return addOrChangePair();
    case 12:
    case 13:
    case 14:
    case 15:
      return query();
    case 16:
      return setSides();
    case 17:
      return hold();
    case 18:
      return watch();
    case 19:
      return publish();
    case 20:
    case 21:
    case 22:
      if (!isRare) setTransform(id);
      return;
    case 23:
      return body.hasVertices() ? setSomePositions(id) : setTransform(id);
    default:
      return body.hasVertices() ? setPositions(id) : setTransform(id);
  }
}

void RandomHistory::noteFeatures() {
  const Model& model = m_lockstep.model();
  const auto note = [&](bool is, Feature feature) {
    if (is) m_features.insert(feature);
  };
  for (const auto& [id, body] : model.bodies) {
    note(!body.disabled.empty(), Feature::Disabled);
    note(!body.tags.empty(), Feature::Tags);
    note(body.placed, Feature::Placed);
  }
  for (const ModelPair& pair : model.pairs) {
    const CollisionData& data = m_lockstep.data(pair);
    const PairSettings& s = pair.settings;
    if (data.hash() == CollisionData().hash() && data.rememberedSides().empty() &&
        data.crossings().empty())
      continue;
    for (const GeometryId id : {pair.a, pair.b}) {
      const ModelBody& body = model.bodies.at(id);
      note(body.isMesh(), body.tetrahedra.empty() ? Feature::Triangles : Feature::Tetrahedra);
      note(body.hasVertices() && body.geometry.type == GeometryType::Lines, Feature::Lines);
      note(body.hasVertices() && body.geometry.type == GeometryType::Points, Feature::Points);
      note(body.shape.has_value(), Feature::Shapes);
      note(body.isField(), Feature::Fields);
      note(body.field && !body.isField(), Feature::AttachedFields);
      note(body.leaves.has_value() || s.method == Method::Proxy, Feature::Proxies);
      note(body.filter.groups != 1 || ~body.filter.mask != 0, Feature::Groups);
      note(body.filter.sidedness == Sidedness::Outer, Feature::Sidedness);
    }
    note(pair.a == pair.b, Feature::SelfCollision);
    note(s.trackContacts, Feature::Tracking);
    note(!data.crossings().empty(), Feature::Crossings);
    note(!data.rememberedSides().empty(), Feature::Sides);
    note(s.smoothNormals, Feature::SmoothNormals);
    note(s.freeMotionReach > 0, Feature::FreeMotion);
    note(s.restDistance > 0, Feature::RestDistance);
    note(s.continuous.earliestTimeOnly, Feature::EarliestTime);
    note(pair.predicate != 0, Feature::Predicate);
    note(m_lockstep.keepsCandidates(pair), Feature::KeptCandidates);
  }
  note(m_draw.space() != Space::Unit && m_draw.space() != Space::Tiny &&
           m_draw.space() != Space::Far,
       Feature::Coincident);
  note(m_draw.areLarge(), Feature::Large);
  note(m_lockstep.first().settings().audit.features > 0, Feature::Audit);
  note(m_lockstep.first().settings().executor != nullptr, Feature::Executor);
  note(m_lockstep.watches(), Feature::Threads);
  note(m_lockstep.tracks(), Feature::PenetrationTracker);
}

void RandomHistory::frame() {
  m_features.clear();
  const std::size_t troubles = m_lockstep.troubles(), endedEarly = m_lockstep.endedEarly();
  if (!m_random.isDecided()) m_random = Random(mixed(~m_seed, m_frames));
  ++m_frames;
  for (auto count = m_random() % 8; count > 0; --count)
    if (decide()) act();
  if (!decide()) return;
  const bool withoutTime = m_random() % 16 == 0 && !m_lockstep.isDetected();
  if (m_random() % 4 == 0) {
    m_lockstep.restore();
    m_features.insert(Feature::Restored);
  }
  m_lockstep.detectAtEnd(withoutTime);
  m_contacts += m_lockstep.first().statistics().contacts;
  m_lockstep.expectSame();
  if (withoutTime)
    m_features.insert(Feature::OutOfTime);
  else
    compareWithNewObjects();
  setUserData();
  m_lockstep.updateTopologies();
  m_lockstep.updateTrackers(Who::All);
  compareSnapshot();
  if (m_frames % 16 == 0) m_lockstep.writeTraces();
  noteFeatures();
  if (m_random() % 4 == 0) m_lockstep.forgetTracker();
  if (m_lockstep.troubles() > troubles) m_features.insert(Feature::FailedCall);
  if (m_lockstep.endedEarly() > endedEarly) m_features.insert(Feature::EndedEarly);
  m_lockstep.advance();
}

}  // namespace palpate::testing
