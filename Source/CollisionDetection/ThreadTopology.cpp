#include <palpate/ThreadTopology.h>

#include <palpate/OctreeBasedCD.h>

#include "CollisionDetection/StepSource.h"
#include "Tracking/LoopPassages.h"
#include "Bodies/InputChecks.h"

#include <algorithm>
#include <optional>
#include <string>
#include <utility>

namespace palpate {

namespace {

using Cause = ThreadEvent::Cause;

struct Watch {
  VertexPath thread, loop;
  int count = 0, countBefore = 0;  ///< after the last update(); at the start of its step
  bool isLost = false, wasLost = false;
};

constexpr std::array<std::uint32_t, 2> kNone{kNoElement, kNoElement};

/// Calls f for the vertices of each edge of a thread.
template <class F>
void forEachEdge(const VertexPath& thread, F&& f) {
  for (std::size_t i = 0; i + 1 < thread.vertices.size(); ++i)
    f(thread.vertices[i], thread.vertices[i + 1]);
}

std::uint32_t edgeOf(const MeshTopology& topology, std::uint32_t p, std::uint32_t q) {
  return topology.edgeOf({std::min(p, q), std::max(p, q)});
}

/// Why the path is no longer there, if it is not.
std::optional<Cause> lossOf(const VertexPath& path, const Geometry* geometry, bool isLoop) {
  if (!geometry) return Cause::Cut;
  const MeshTopology& topology = geometry->body.mesh.topology;
  std::optional<Cause> loss;
  const auto add = [&](Cause cause) {
    if (loss != Cause::Cut) loss = cause;
  };
  for (const std::uint32_t v : path.vertices)
    if (v >= topology.vertexCount || !topology.isUsed[v])
      add(Cause::Cut);
    else if (topology.vertexTriangles[v].empty())
      add(Cause::Disabled);
  if (isLoop || loss == Cause::Cut) return loss;
  forEachEdge(path, [&](std::uint32_t p, std::uint32_t q) {
    const std::uint32_t edge = edgeOf(topology, p, q);
    if (edge == kNoEdge)
      add(Cause::Cut);
    else if (topology.edgeTriangles[edge].empty())
      add(Cause::Disabled);
  });
  return loss;
}

void check(const Geometry& geometry, const VertexPath& path, bool isLoop) {
  const Body& body = geometry.body;
  const char* const what = isLoop ? "the loop" : "the thread";
  const auto refuse = [&](ErrorCode code, const std::string& reason,
                          std::optional<std::uint32_t> vertex = {}) {
    throw Error(code, nameOf(body) + ": " + what + reason, body.id, vertex);
  };
  if (body.shape || body.isField()) refuse(ErrorCode::UnsupportedMethod, " needs vertices");
  if (path.vertices.size() < (isLoop ? 3 : 2))
    refuse(ErrorCode::InvalidSettings, " has " + std::to_string(path.vertices.size()) +
                                           " vertices; it needs " + (isLoop ? "3" : "2"));
  for (const std::uint32_t v : path.vertices) checkVertex(body, v, body.mesh.now.size());
  std::vector<std::uint32_t> sorted = path.vertices;
  if (!isLoop && sorted.size() > 3 && sorted.front() == sorted.back()) sorted.pop_back();
  std::sort(sorted.begin(), sorted.end());
  if (const auto twice = std::adjacent_find(sorted.begin(), sorted.end()); twice != sorted.end())
    refuse(ErrorCode::IndexOutOfRange, " names vertex " + std::to_string(*twice) + " twice",
           *twice);
  if (isLoop) return;
  const MeshTopology& topology = body.mesh.topology;
  forEachEdge(path, [&](std::uint32_t p, std::uint32_t q) {
    const std::uint32_t edge = edgeOf(topology, p, q);
    if (edge == kNoEdge || topology.edgeTriangles[edge].empty())
      refuse(ErrorCode::InvalidSettings,
             " has no edge from vertex " + std::to_string(p) + " to " + std::to_string(q) +
                 " in an enabled element",
             p);
  });
}

void copyVertices(const Geometry& geometry, const VertexPath& path,
                  std::vector<PathVertex>& vertices) {
  vertices.clear();
  const TriangleMesh& mesh = geometry.body.mesh;
  const std::uint64_t first = std::uint64_t{static_cast<std::uint32_t>(geometry.body.id)} << 32;
  for (const std::uint32_t v : path.vertices)
    vertices.push_back({first | v, {mesh.before[v], mesh.now[v]}});
}

}  // namespace

struct ThreadTopology::Implementation {
  std::shared_ptr<StepSource> source;
  std::vector<Watch> watches;
  std::vector<ThreadEvent> events;
  std::size_t eventsBefore = 0;       ///< number of events before the step of the last update()
  std::optional<std::uint64_t> step;  ///< of the last update()

  // Scratch of update(), which remembers its peak.
  std::vector<PathVertex> thread, loop;
  std::vector<LoopPassage> passages;
  std::vector<ThreadEvent> nextEvents;
  std::vector<int> nextCounts;
  std::vector<bool> nextLost;

  const Watch& at(std::size_t index) const {
    if (index >= watches.size())
      throw Error(ErrorCode::IndexOutOfRange, "ThreadTopology: index " + std::to_string(index) +
                                                  " is out of range; add() was "
                                                  "called " +
                                                  std::to_string(watches.size()) + " times");
    return watches[index];
  }
  void copy(const Watch& watch) {
    const GeometryTable& geometries = source->geometries();
    copyVertices(geometries.at(watch.thread.geometry), watch.thread, thread);
    copyVertices(geometries.at(watch.loop.geometry), watch.loop, loop);
  }
  /// Appends the events of a step that starts with this count, and returns the count at its end.
  int follow(std::size_t index, int count, std::uint64_t now);
};

int ThreadTopology::Implementation::follow(std::size_t index, int count, std::uint64_t now) {
  const Watch& watch = watches[index];
  const GeometryTable& geometries = source->geometries();
  const std::optional<Cause> losses[] = {
      lossOf(watch.thread, geometries.find(watch.thread.geometry), false),
      lossOf(watch.loop, geometries.find(watch.loop.geometry), true)};
  if (losses[0] || losses[1]) {
    const bool isCut = losses[0] == Cause::Cut || losses[1] == Cause::Cut;
    nextEvents.push_back(
        {index, now, isCut ? Cause::Cut : Cause::Disabled, -count, kNone, kNone, 0.0});
    nextLost[index] = true;
    return 0;
  }
  copy(watch);
  if (const int start = countPassages(thread, loop, 0); start != count) {
    nextEvents.push_back({index, now, Cause::Set, start - count, kNone, kNone, 0.0});
    count = start;
  }
  const int end = countPassages(thread, loop, 1);
  passages.clear();
  appendPassages(thread, loop, passages);
  int sum = 0;
  for (const LoopPassage& passage : passages) sum += passage.change;
  if (sum != end - count) {
    // Vertices passed exactly through edges. The first passage stands for all.
    if (passages.empty()) passages.push_back({0.0, 0, {0, 0}, {0, 0}, true});
    passages.resize(1);
    passages[0].change = end - count;
  }
  const auto vertices = [](const VertexPath& path, const std::array<std::size_t, 2>& places) {
    return std::array{path.vertices[places[0]], path.vertices[places[1]]};
  };
  for (const LoopPassage& passage : passages)
    nextEvents.push_back({index, now, passage.ofEnd ? Cause::EndPassed : Cause::Passed,
                          passage.change, vertices(watch.thread, passage.ofThread),
                          passage.ofEnd ? kNone : vertices(watch.loop, passage.ofLoop),
                          passage.time});
  return end;
}

ThreadTopology::Implementation& ThreadTopology::all() const {
  if (!m_implementation) throw Error(ErrorCode::InvalidCall, "this ThreadTopology was moved from");
  return *m_implementation;
}

ThreadTopology::ThreadTopology(OctreeBasedCD& detection)
    : m_implementation(std::make_unique<Implementation>()) {
  m_implementation->source = detection.stepSource();
}
ThreadTopology::ThreadTopology(ThreadTopology&&) noexcept = default;
ThreadTopology& ThreadTopology::operator=(ThreadTopology&&) noexcept = default;
ThreadTopology::~ThreadTopology() = default;

std::size_t ThreadTopology::add(const VertexPath& thread, const VertexPath& loop) {
  Implementation& own = all();
  const GeometryTable& geometries = own.source->geometries();
  check(geometries.at(thread.geometry), thread, false);
  check(geometries.at(loop.geometry), loop, true);
  if (thread.geometry == loop.geometry)
    for (const std::uint32_t v : loop.vertices)
      if (std::find(thread.vertices.begin(), thread.vertices.end(), v) != thread.vertices.end())
        throw Error(ErrorCode::IndexOutOfRange,
                    nameOf(geometries.at(loop.geometry).body) + ": vertex " + std::to_string(v) +
                        " is in the thread and in the loop",
                    loop.geometry, v);
  Watch watch{thread, loop};
  own.copy(watch);
  watch.count = watch.countBefore = countPassages(own.thread, own.loop, 0);
  own.watches.push_back(std::move(watch));
  return own.watches.size() - 1;
}

void ThreadTopology::update() {
  Implementation& own = all();
  const std::uint64_t now = own.source->geometries().stepNumber();
  const bool isRepeated = own.step == now;
  const std::size_t size = own.watches.size(),
                    kept = isRepeated ? own.eventsBefore : own.events.size();
  own.nextEvents.clear();
  own.nextCounts.assign(size, 0);
  own.nextLost.assign(size, false);
  for (std::size_t i = 0; i < size; ++i) {
    const Watch& watch = own.watches[i];
    own.nextLost[i] = isRepeated ? watch.wasLost : watch.isLost;
    if (!own.nextLost[i])
      own.nextCounts[i] = own.follow(i, isRepeated ? watch.countBefore : watch.count, now);
  }
  own.events.reserve(kept + own.nextEvents.size());
  // Nothing below throws.
  own.events.erase(own.events.begin() + static_cast<std::ptrdiff_t>(kept), own.events.end());
  own.events.insert(own.events.end(), own.nextEvents.begin(), own.nextEvents.end());
  own.eventsBefore = kept;
  for (std::size_t i = 0; i < size; ++i) {
    Watch& watch = own.watches[i];
    if (!isRepeated) watch.countBefore = watch.count, watch.wasLost = watch.isLost;
    watch.count = own.nextCounts[i], watch.isLost = own.nextLost[i];
  }
  own.step = now;
}

int ThreadTopology::count(std::size_t index) const { return all().at(index).count; }
bool ThreadTopology::isLost(std::size_t index) const { return all().at(index).isLost; }
std::span<const ThreadEvent> ThreadTopology::events() const { return all().events; }

void ThreadTopology::clear() {
  Implementation& own = all();
  own.events.clear();
  own.eventsBefore = 0;
}

}  // namespace palpate
