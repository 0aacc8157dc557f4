#include "Common/Lockstep.h"

#include <palpate/Capture.h>
#include <palpate/StepGuard.h>

#include "CollisionDetection/OctreeBasedCDImplementation.h"
#include "Common/Answers.h"
#include "Common/TemporaryFolder.h"

#include <algorithm>
#include <atomic>
#include <cmath>

namespace palpate::testing {

namespace {

/// Thrown by predicates of the troubled object.
struct Interruption {};

/// An explicit instantiation may name private members: tests reach the clock so.
template <auto member>
struct LockstepReach {
  friend auto& insideOf(OctreeBasedCD& collisions) { return *(collisions.*member); }
};
auto& insideOf(OctreeBasedCD&);
template struct LockstepReach<&OctreeBasedCD::m_implementation>;

/// A clock on which each look takes a microsecond: a budget of n allows n looks. The detection is
/// cancelled in the look with the number cancelAt; 0: it is not.
class LooksOfTroubled {
 public:
  LooksOfTroubled(OctreeBasedCD& collisions, std::int64_t cancelAt) : m_collisions(collisions) {
    insideOf(collisions).timed.clock = [this, cancelAt] {
      const std::int64_t look = m_looks.fetch_add(1) + 1;
      if (look == cancelAt) m_collisions.cancelDetection();
      return Deadline::Time(std::chrono::microseconds(look));
    };
  }
  ~LooksOfTroubled() { insideOf(m_collisions).timed.clock = {}; }

 private:
  OctreeBasedCD& m_collisions;
  std::atomic<std::int64_t> m_looks{0};
};

/// Results of one call, one for each object. To take one allocates nothing, so that an allocation
/// that fails is one of the call.
template <class Result>
class Results {
 public:
  explicit Results(const std::vector<Lockstep::Member>& members)
      : m_first(&members.front()), m_all(members.size()) {}
  void take(const Lockstep::Member& member, Result&& result) noexcept {
    m_all[static_cast<std::size_t>(&member - m_first)] = std::move(result);
  }
  /// That of the first object, to which those of all that took part are equal.
  const Result& same(const char* what) const {
    for (const std::optional<Result>& result : m_all)
      EXPECT_TRUE(!result || result == m_all.front()) << what;
    return *m_all.front();
  }

 private:
  const Lockstep::Member* m_first;
  std::vector<std::optional<Result>> m_all;
};

}  // namespace

void Lockstep::add(std::string name, Life life, const Settings& settings, std::string path) {
  m_members.push_back({std::move(name), life, OctreeBasedCD(settings), std::move(path)});
}

std::optional<GeometryId> Lockstep::add(const ModelBody& body) {
  std::string text;
  const TestGeometry& g = body.geometry;
  const auto withRadii = [&](const char* name, const auto&... arguments) {
    return g.radii.size() == 1 ? call(name, arguments..., g.radii[0])
                               : call(name, arguments..., g.radii);
  };
  if (body.shape)
    text = call("addAnalyticalGeometry", *body.shape);
  else if (body.isField())
    text = "c.addDistanceField(field)";
  else if (!body.tetrahedra.empty())
    text = call("addTetrahedralMesh", g.positions, body.tetrahedra);
  else if (g.type == GeometryType::Triangles)
    text = call("addTriangleMesh", g.positions, g.triangles);
  else if (g.type == GeometryType::Lines)
    text = withRadii("addLineMesh", g.positions, g.segments);
  else
    text = withRadii("addPointSet", g.positions);
  Results<GeometryId> ids(m_members);
  if (!each(Who::All, text, [&](Member& m) { ids.take(m, addBody(m.object, body)); })) return {};
  const GeometryId id = ids.same("ids of a new geometry");
  if (body.field && !body.isField()) {
    EXPECT_TRUE(each(Who::All, "c.attachDistanceField(" + textOf(id) + ", field)",
                     [&](Member& m) { m.object.attachDistanceField(id, body.field); }));
  }
  if (body.leaves) {
    EXPECT_TRUE(each(Who::All, call("attachSurfaceProxy", id, *body.leaves),
                     [&](Member& m) { m.object.attachSurfaceProxy(id, body.leaves); }));
  }
  EXPECT_FALSE(m_model.bodies.contains(id)) << "an id was given out twice";
  ModelBody& own = m_model.bodies[id] = body;
  if (!body.tetrahedra.empty()) readSurface(id);
  own.before = own.now = own.geometry.positions;
  return id;
}

void Lockstep::readSurface(GeometryId id) {
  ModelBody& body = m_model.bodies.at(id);
  const TetrahedralSurface surface = first().surface(id);
  const auto removed = first().removedElements(id);
  body.removed.assign(removed.begin(), removed.end());
  body.tetrahedronOf.assign(surface.tetrahedra.begin(), surface.tetrahedra.end());
  body.geometry.triangles.clear();
  for (const std::uint32_t i : idsWithout(surface.triangles.size(), body.removed))
    body.geometry.triangles.push_back(surface.triangles[i]);
}

void Lockstep::remove(GeometryId id) {
  each(Who::All, call("removeGeometry", id), [&](Member& m) { m.object.removeGeometry(id); });
  m_model.removeGeometry(id);
}

bool Lockstep::setPositions(GeometryId id, const Positions& now) {
  if (!each(Who::Running, call("setPositions", id, now),
            [&](Member& m) { m.object.setPositions(id, now); }))
    return false;
  ModelBody& own = body(id);
  own.now = now;
  if (own.isNew && !own.bodyGiven) own.before = now;
  return true;
}

bool Lockstep::setPositions(GeometryId id, const Positions& before, const Positions& now) {
  if (!each(Who::Running, call("setPositions", id, before, now),
            [&](Member& m) { m.object.setPositions(id, before, now); }))
    return false;
  ModelBody& own = body(id);
  own.before = before;
  own.now = now;
  own.bodyGiven = true;
  return true;
}

bool Lockstep::setSomePositions(GeometryId id, std::size_t first, const Positions& now) {
  if (!each(Who::Running, call("setPositions", id, first, now),
            [&](Member& m) { m.object.setPositions(id, first, now); }))
    return false;
  ModelBody& own = body(id);
  std::ranges::copy(now, own.now.begin() + static_cast<std::ptrdiff_t>(first));
  if (own.isNew && !own.bodyGiven) own.before = own.now;
  return true;
}

bool Lockstep::setTransform(GeometryId id, const Pose& now) {
  if (!each(whoIsPlaced(id), call("setTransform", id, now),
            [&](Member& m) { m.object.setTransform(id, now); }))
    return false;
  ModelBody& own = body(id);
  own.pose = now;
  own.placed = true;
  if (own.isNew && !own.transformGiven) own.poseBefore = now;
  return true;
}

bool Lockstep::setTransform(GeometryId id, const Pose& before, const Pose& now) {
  if (!each(whoIsPlaced(id), call("setTransform", id, before, now),
            [&](Member& m) { m.object.setTransform(id, before, now); }))
    return false;
  ModelBody& own = body(id);
  own.poseBefore = before;
  own.pose = now;
  own.placed = own.transformGiven = true;
  return true;
}

void Lockstep::takeTopology(GeometryId id, const TestGeometry& geometry) {
  ModelBody& own = body(id);
  own.geometry = geometry;
  own.before = own.now = geometry.positions;
  own.isNew = true;
  own.bodyGiven = false;
  own.disabled.clear();
  own.tags.clear();
  own.removed.clear();
  own.removedTetrahedra.clear();
  if (!own.transformGiven) own.poseBefore = own.pose;
}

bool Lockstep::setTriangles(GeometryId id, const TestGeometry& next) {
  if (!each(Who::All, call("setTriangles", id, next.positions, next.triangles),
            [&](Member& m) { m.object.setTriangles(id, next.positions, next.triangles); }))
    return false;
  takeTopology(id, next);
  return true;
}

bool Lockstep::setTetrahedra(GeometryId id, const Positions& positions,
                             const std::vector<Tetrahedron>& tetrahedra) {
  if (!each(Who::All, call("setTetrahedra", id, positions, tetrahedra),
            [&](Member& m) { m.object.setTetrahedra(id, positions, tetrahedra); }))
    return false;
  TestGeometry next;
  next.positions = positions;
  takeTopology(id, next);
  body(id).tetrahedra = tetrahedra;
  readSurface(id);
  return true;
}

namespace {

void addIds(Ids& all, const Ids& more) {
  all.insert(all.end(), more.begin(), more.end());
  std::ranges::sort(all);
}

/// A cut's vertices are at rest in the step.
void addVertices(ModelBody& body, const Positions& positions, const Positions& rest) {
  const Positions& atRest = rest.empty() ? positions : rest;
  const auto append = [](Positions& to, const Positions& from) {
    to.insert(to.end(), from.begin(), from.end());
  };
  append(body.geometry.positions, atRest);
  append(body.before, positions);
  append(body.now, positions);
}

}  // namespace

bool Lockstep::cut(GeometryId id, const Ids& removed, const std::vector<Triangle>& added,
                   const Positions& positions, const Positions& rest) {
  Results<Ids> ids(m_members);
  if (!each(Who::All, call("replaceTriangles", id, removed, added, positions, rest),
            [&](Member& m) {
              ids.take(m, m.object.replaceTriangles(id, removed, added, positions, rest));
            }))
    return false;
  ModelBody& own = body(id);
  const auto total = static_cast<std::uint32_t>(own.elements());
  Ids truth(added.size());
  for (std::uint32_t i = 0; i < truth.size(); ++i) truth[i] = total + i;
  EXPECT_EQ(ids.same("ids of added triangles"), truth);
  std::vector<Triangle> left;
  const Ids before = own.ids();
  for (std::size_t i = 0; i < before.size(); ++i)
    if (std::ranges::find(removed, before[i]) == removed.end())
      left.push_back(own.geometry.triangles[i]);
  left.insert(left.end(), added.begin(), added.end());
  own.geometry.triangles = left;
  addVertices(own, positions, rest);
  addIds(own.removed, removed);
  if (!own.tags.empty()) own.tags.resize(own.elements(), 0);
  EXPECT_TRUE(std::ranges::equal(first().removedElements(id), own.removed));
  EXPECT_TRUE(std::ranges::equal(first().tags(id), own.tags));
  return true;
}

bool Lockstep::cut(GeometryId id, const Ids& removed, const std::vector<Tetrahedron>& added,
                   const Positions& positions, const Positions& rest) {
  Results<Ids> ids(m_members);
  if (!each(Who::All, call("replaceTetrahedra", id, removed, added, positions, rest),
            [&](Member& m) {
              ids.take(m, m.object.replaceTetrahedra(id, removed, added, positions, rest));
            }))
    return false;
  ids.same("ids of added tetrahedra");
  ModelBody& own = body(id);
  own.tetrahedra.insert(own.tetrahedra.end(), added.begin(), added.end());
  addIds(own.removedTetrahedra, removed);
  addVertices(own, positions, rest);
  if (!own.tags.empty()) own.tags.resize(own.tetrahedra.size(), 0);
  readSurface(id);
  EXPECT_TRUE(std::ranges::equal(first().tags(id), own.tags));
  return true;
}

bool Lockstep::setFilter(GeometryId id, const CollisionFilter& filter) {
  if (!each(Who::All, call("setCollisionFilter", id, filter),
            [&](Member& m) { m.object.setCollisionFilter(id, filter); }))
    return false;
  body(id).filter = filter;
  return true;
}

bool Lockstep::setDisabled(GeometryId id, const Ids& disabled) {
  if (!each(Who::All, call("setDisabledElements", id, disabled),
            [&](Member& m) { m.object.setDisabledElements(id, disabled); }))
    return false;
  body(id).disabled = disabled;
  return true;
}

bool Lockstep::setTags(GeometryId id, const Ids& tags) {
  if (!each(Who::All, call("setTags", id, tags), [&](Member& m) { m.object.setTags(id, tags); }))
    return false;
  body(id).tags = tags;
  return true;
}

bool Lockstep::addPair(GeometryId a, GeometryId b, const PairSettings& settings) {
  if (!each(Who::All, call("addCollisionPair", a, b, settings),
            [&](Member& m) { m.object.addCollisionPair(a, b, settings); }))
    return false;
  m_model.pairs.push_back({a, b, settings});
  return true;
}

bool Lockstep::setPair(GeometryId a, GeometryId b, const PairSettings& settings) {
  if (!each(Who::All, call("setPairSettings", a, b, settings),
            [&](Member& m) { m.object.setPairSettings(a, b, settings); }))
    return false;
  m_model.find(a, b)->settings = settings;
  return true;
}

void Lockstep::removePair(GeometryId a, GeometryId b) {
  each(Who::All, call("removeCollisionPair", a, b),
       [&](Member& m) { m.object.removeCollisionPair(a, b); });
  std::erase_if(m_model.pairs, [&](const ModelPair& pair) {
    return (pair.a == a && pair.b == b) || (pair.a == b && pair.b == a);
  });
}

bool Lockstep::setPredicate(GeometryId a, GeometryId b, int number) {
  const std::string text = "c.setContactPredicate(" + argumentsText(a, b) + ", predicateOf(" +
                           std::to_string(number) + "))";
  if (!each(Who::All, text, [&](Member& m) {
        ContactPredicate predicate = predicateOf(number);
        if (predicate && m.life == Life::Troubled)
          predicate = [throws = m.predicateThrows, number](const ContactFeatures& features) {
            if (*throws) throw Interruption();
            return predicateOf(number)(features);
          };
        m.object.setContactPredicate(a, b, std::move(predicate));
      }))
    return false;
  m_model.find(a, b)->predicate = number;
  return true;
}

bool Lockstep::setSides(GeometryId a, GeometryId b, const std::vector<Crossing>& sides) {
  return each(Who::All, call("setRememberedSides", a, b, sides),
              [&](Member& m) { m.object.setRememberedSides(a, b, sides); });
}

bool Lockstep::setUserData(GeometryId a, GeometryId b, const ContactKey& key,
                           std::uint64_t userData) {
  const std::string text = "c.setUserData(" + argumentsText(a, b) + ", {" +
                           argumentsText(key.kind, key.ids) + "}, " + textOf(userData) + ")";
  return each(Who::All, text, [&](Member& m) { m.object.setUserData(a, b, key, userData); });
}

std::optional<std::size_t> Lockstep::hold(GeometryId fixed, const Ids& fixedVertices,
                                          const std::vector<GuardedVertex>& group) {
  std::string text = "hold(c, " + argumentsText(fixed, fixedVertices) + ", {";
  for (const GuardedVertex& v : group) text += "{" + argumentsText(v.geometry, v.vertex) + "}, ";
  std::vector<std::optional<StepGuard>> guards(m_members.size());
  if (!each(Who::Running, text + "})", [&](Member& m) {
        std::optional<StepGuard>& guard = guards[static_cast<std::size_t>(&m - m_members.data())];
        guard.emplace(m.object);
        guard->setFixedVertices(fixed, fixedVertices);
        if (!group.empty()) guard->addRigidGroup(group);
        guard->hold();
      }))
    return {};
  const auto held = guards.front()->held();
  for (std::size_t i = 0; i < m_members.size(); ++i) {
    if (!guards[i]) continue;
    EXPECT_TRUE(std::ranges::equal(guards[i]->held(), held)) << "held, " << m_members[i].name;
    for (const auto& [id, own] : m_model.bodies) {
      EXPECT_TRUE(std::ranges::equal(m_members[i].object.positions(id), first().positions(id)))
          << "positions that a guard set, " << m_members[i].name;
      EXPECT_TRUE(m_members[i].object.transform(id) == first().transform(id))
          << "pose that a guard set, " << m_members[i].name;
    }
  }
  for (auto& [id, own] : m_model.bodies) {
    const auto now = first().positions(id);
    if (own.hasVertices()) own.now.assign(now.begin(), now.end());
    if (own.placed) own.pose = first().transform(id);
  }
  return held.size();
}

bool Lockstep::watch(const VertexPath& thread, const VertexPath& loop, bool areParts) {
  const std::string text =
      "watch(" +
      argumentsText(thread.geometry, thread.vertices, loop.geometry, loop.vertices, areParts) + ")";
  return each(Who::All, text, [&](Member& m) {
    if (!m.topology) m.topology.emplace(m.object);
    if (areParts)
      m.topology->addParts(thread, loop);
    else
      m.topology->add(thread, loop);
  });
}

void Lockstep::track(GeometryId vertices, GeometryId body) {
  for (Member& m : m_members)
    if (!m.tracker) m.tracker.emplace(vertices, body);
}

void Lockstep::forgetTracker() {
  for (Member& m : m_members) m.tracker.reset();
}

void Lockstep::detect(Member& member, bool withoutTime, bool atEnd) {
  OctreeBasedCD& object = member.object;
  if (withoutTime) {
    object.detectCollision(std::chrono::microseconds(0));
    return;
  }
  if (member.life == Life::Troubled && m_trouble() % 2) {
    const std::uint64_t most = m_trouble() % 2 ? 10 : 1000, budget = m_trouble() % most;
    const bool isCancelled = m_trouble() % 3 == 0;
    const auto looks = static_cast<std::int64_t>(budget);
    const LooksOfTroubled clock(object, isCancelled ? looks : 0);
    const bool isComplete = object.detectCollision(isCancelled ? std::chrono::hours(1)
                                                               : std::chrono::microseconds(looks));
    m_endedEarly += !isComplete;
    member.endedEarly = member.endedEarly || !isComplete;
    if (!atEnd) return;
  }
  if (member.life == Life::Troubled && m_trouble() % 4 == 0) {
    *member.predicateThrows = true;
    try {
      object.detectCollision();
    } catch (const Interruption&) {
      ++m_troubles;
    } catch (...) {
      *member.predicateThrows = false;
      throw;
    }
    *member.predicateThrows = false;
  }
  object.detectCollision();
}

bool Lockstep::detectEverywhere(Who who, bool withoutTime) {
  m_isDetected = true;
  return each(
      who, withoutTime ? "c.detectCollision(std::chrono::microseconds(0))" : "c.detectCollision()",
      [&](Member& m) { detect(m, withoutTime, who == Who::All); });
}

/// A proxy refuses bodies whose positions changed, in the detection.
void Lockstep::detect(Who who, bool withoutTime) {
  if (detectEverywhere(who, withoutTime)) return;
  const std::vector<ModelPair> pairs = m_model.pairs;
  for (const ModelPair& pair : pairs)
    if (pair.settings.method == Method::Proxy) removePair(pair.a, pair.b);
  EXPECT_TRUE(detectEverywhere(who, withoutTime)) << "a detection was refused";
}

void Lockstep::commitPositions() {
  for (Member& m : m_members) {
    if (m.life != Life::Committed) continue;
    for (const auto& [id, own] : m_model.bodies) {
      if (own.hasVertices() && own.bodyGiven)
        m.object.setPositions(id, own.before, own.now);
      else if (own.hasVertices() && !own.isRigid())
        m.object.setPositions(id, own.now);
      if (own.placed && own.transformGiven)
        m.object.setTransform(id, own.poseBefore, own.pose);
      else if (own.placed)
        m.object.setTransform(id, own.pose);
    }
  }
}

void Lockstep::detectAtEnd(bool withoutTime) {
  commitPositions();
  detect(Who::All, withoutTime);
}

namespace {

/// Which pair a detection begins with, and thus which exceeds the budget, depends on earlier
/// budgets.
void expectSameUnfinished(std::vector<UnfinishedPair> l, std::vector<UnfinishedPair> r) {
  for (auto* each : {&l, &r})
    for (UnfinishedPair& pair : *each) pair.exceedsBudget = false;
  EXPECT_TRUE(l == r) << "unfinished pairs";
}

}  // namespace

void Lockstep::expectSame() {
  if (m_calls) *m_calls << "  show(c);\n";
  for (const Member& m : m_members) {
    if (&m == &m_members.front()) continue;
    SCOPED_TRACE(m.name);
    EXPECT_EQ(m.object.octree().validate(), std::vector<std::string>{});
    for (const AuditFailure& failure : m.object.auditFailures())
      ADD_FAILURE() << "audit: " << toString(failure.fault) << " in " << toString(failure.list)
                    << " of pair " << textOf(failure.a) << ", " << textOf(failure.b);
    const bool knowsTheSame =
        m.life != Life::Committed && !m.endedEarly && m.object.settings().engine == Engine::Octree;
    for (const ModelPair& pair : m_model.pairs) {
      SCOPED_TRACE(::testing::Message() << "pair " << textOf(pair.a) << ", " << textOf(pair.b)
                                        << ", " << textOf(pair.settings));
      testing::expectSame(m.object.collisionData(pair.a, pair.b), data(pair),
                          knowsTheSame ? Knowledge::Same : Knowledge::Other);
    }
    // What follows from boxes depends on how octrees came about.
    const bool isFromBoxes = !first().statistics().unfinishedPairs.empty() ||
                             first().statistics().freeMotionUnfinished ||
                             m.object.statistics().freeMotionUnfinished;
    for (const auto& [id, own] : m_model.bodies)
      EXPECT_TRUE(isFromBoxes ||
                  std::ranges::equal(m.object.freeMotion(id), first().freeMotion(id)))
          << "free motion of " << textOf(id);
    expectSameUnfinished(m.object.statistics().unfinishedPairs,
                         first().statistics().unfinishedPairs);
  }
}

void Lockstep::updateTopologies() {
  const Member& front = m_members.front();
  for (Member& m : m_members) {
    if (!m.topology) continue;
    m.topology->update();
    EXPECT_TRUE(std::ranges::equal(m.topology->events(), front.topology->events()))
        << "events of threads, " << m.name;
  }
}

void Lockstep::updateTrackers(Who who) {
  const auto update = [](Member& m) -> std::vector<TrackedVertex> {
    try {
      const auto found = m.tracker->update(m.object.queries());
      return {found.begin(), found.end()};
    } catch (const Error&) {
      return {};
    }
  };
  std::optional<std::vector<TrackedVertex>> first;
  for (Member& m : m_members) {
    if (!m.tracker || !isAmong(m, who)) continue;
    const std::vector<TrackedVertex> found = update(m);
    if (!first) first = found;
    EXPECT_TRUE(found == *first) << "tracked penetrations, " << m.name;
  }
}

void Lockstep::advance() {
  each(Who::All, "c.advance()", [](Member& m) { m.object.advance(); });
  m_model.advance();
  m_isDetected = false;
}

void Lockstep::restore() {
  const bool isSelfContained =
      std::ranges::none_of(m_model.pairs, [](const ModelPair& p) { return p.predicate != 0; }) &&
      std::ranges::none_of(m_model.bodies, [](const auto& b) { return b.second.field != nullptr; });
  for (Member& m : m_members) {
    if (m.life != Life::Restored) continue;
    forgetTracker();  // has a state of its own
    const std::vector<std::byte> state = m.object.save();
    if (isSelfContained && m_trouble() % 2) {
      std::optional<std::vector<std::byte>> topology;
      if (m.topology) topology = m.topology->save();
      OctreeBasedCD other(m.object.settings());
      other.restore(state);
      m.object = std::move(other);
      if (topology) {
        m.topology.emplace(m.object);
        m.topology->restore(*topology);
      }
    } else {
      for (const auto& [id, own] : m_model.bodies) {
        if (!own.hasVertices() || own.isRigid() || m_trouble() % 2) continue;
        Positions now = own.now;
        for (Vector3d& p : now) p = p * 1.25;
        m.object.setPositions(id, now);
        if (m_trouble() % 4 == 0 && !own.ids().empty())
          m.object.setDisabledElements(id, Ids{own.ids().front()});
        if (m_trouble() % 4 == 0 && own.isMesh() && own.tetrahedra.empty() && !own.ids().empty())
          m.object.replaceTriangles(id, Ids{own.ids().front()}, {}, {});
      }
      try {
        if (m_trouble() % 2) m.object.detectCollision();
        if (m_trouble() % 2) m.object.advance();
      } catch (const Error&) {  // a proxy of a body that moved
      }
      m.object.restore(state);
    }
    EXPECT_TRUE(m.object.save() == state) << "state after restore()";
  }
}

void Lockstep::writeTraces() const {
  const TemporaryFolder folder;
  for (const Member& m : m_members) {
    if (m.object.settings().traceFrames == 0) continue;
    m.object.writeTrace(folder.path / "trace.json");
    const std::string text = contentOf(folder.path / "trace.json");
    EXPECT_TRUE(text.starts_with('{') && text.find('}', text.size() - 2) != text.npos &&
                text.find("detectCollision") != text.npos)
        << "the trace of " << m.name << " is: " << text.substr(0, 200);
  }
}

bool Lockstep::keepsCandidates(const ModelPair& pair) const {
  return std::ranges::any_of(m_members, [&](const Member& m) {
    auto& inside = insideOf(const_cast<OctreeBasedCD&>(m.object));
    return inside.pairs.find(pair.a, pair.b)->memory.kept.answers();
  });
}

}  // namespace palpate::testing
