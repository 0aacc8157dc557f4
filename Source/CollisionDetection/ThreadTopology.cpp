#include <palpate/ThreadTopology.h>

#include <palpate/OctreeBasedCD.h>

#include "CollisionDetection/StepSource.h"
#include "Tracking/LoopPassages.h"
#include "Bodies/InputChecks.h"
#include "Fields/Description.h"
#include "Fields/Topology.h"
#include "Core/Archive.h"

#include <algorithm>
#include <cstdlib>
#include <optional>
#include <string>
#include <utility>

namespace palpate {

struct ThreadWatch {
  VertexPath thread, loop;  ///< or two parts of threads
  bool isOfParts = false;
  std::uint64_t added = 0;                      ///< the step of add()
  std::vector<Segment> threadEdges, loopEdges;  ///< whose loss is that of the paths
  int count = 0, countBefore = 0;  ///< after the last update(); at the start of its step
  bool isLost = false, wasLost = false;
  /// Of parts: their positions after the last update(); at the start of its step.
  std::vector<Eigen::Vector3d> end{}, start{};
};

namespace {

using Cause = ThreadEvent::Cause;

constexpr std::array<std::uint32_t, 2> kNone{kNoElement, kNoElement};

bool hasEdge(const MeshTopology& topology, const Segment& ends) {
  const std::uint32_t edge =
      topology.edgeOf({std::min(ends[0], ends[1]), std::max(ends[0], ends[1])});
  return edge != kNoEdge && !topology.edgeTriangles[edge].empty();
}

/// The edges of a path that exist, from each vertex to the next one. isClosed: and back to the
/// first.
std::vector<Segment> edgesOf(const MeshTopology& topology, const VertexPath& path, bool isClosed) {
  std::vector<Segment> edges;
  const std::size_t size = path.vertices.size();
  for (std::size_t i = 0; i + (isClosed ? 0 : 1) < size; ++i) {
    const Segment ends{path.vertices[i], path.vertices[(i + 1) % size]};
    if (hasEdge(topology, ends)) edges.push_back(ends);
  }
  return edges;
}

/// Why a path is no longer there, if it is not.
std::optional<Cause> lossOf(const VertexPath& path, const std::vector<Segment>& edges,
                            const Geometry* geometry) {
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
  if (loss == Cause::Cut) return loss;
  for (const auto& [p, q] : edges)
    if (const std::uint32_t edge = topology.edgeOf({std::min(p, q), std::max(p, q)});
        edge == kNoEdge)
      add(Cause::Cut);
    else if (topology.edgeTriangles[edge].empty())
      add(Cause::Disabled);
  return loss;
}

void check(const Geometry& geometry, const VertexPath& path, bool isLoop) {
  const Body& body = geometry.body;
  const char* const what = isLoop ? "the loop" : "the thread";
  const MeshTopology& topology = body.mesh.topology;
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
  if (isLoop) {
    for (const std::uint32_t v : path.vertices)
      if (!topology.isUsed[v] || topology.vertexTriangles[v].empty())
        refuse(ErrorCode::InvalidSettings,
               " names vertex " + std::to_string(v) + ", which no enabled element has", v);
    return;
  }
  for (std::size_t i = 0; i + 1 < path.vertices.size(); ++i)
    if (const std::uint32_t p = path.vertices[i], q = path.vertices[i + 1];
        !hasEdge(topology, {p, q}))
      refuse(ErrorCode::InvalidSettings,
             " has no edge from vertex " + std::to_string(p) + " to " + std::to_string(q) +
                 " in an enabled element",
             p);
}

void copyVertices(const Geometry& geometry, const VertexPath& path,
                  std::vector<PathVertex>& vertices) {
  vertices.clear();
  const TriangleMesh& mesh = geometry.body.mesh;
  const std::uint64_t first = std::uint64_t{static_cast<std::uint32_t>(geometry.body.id)} << 32;
  for (const std::uint32_t v : path.vertices)
    vertices.push_back({first | v, {mesh.before[v], mesh.now[v]}});
}

constexpr std::string_view kTopologyTitle = "palpate-threads";
constexpr std::uint32_t kTopologyVersion = 2;

/// Whether the edges are some of those between consecutive vertices, in their order.
bool areEdgesOf(const VertexPath& path, const std::vector<Segment>& edges) {
  const std::vector<std::uint32_t>& v = path.vertices;
  std::size_t i = 0;
  for (const Segment& edge : edges) {
    while (i < v.size() && edge != Segment{v[i], v[(i + 1) % v.size()]}) ++i;
    if (i++ >= v.size()) return false;
  }
  return true;
}

template <class File>
void describeWatch(File& file, ThreadWatch& watch) {
  description::fieldOf(file, watch.isOfParts);
  file.integer(watch.added);
  for (VertexPath* path : {&watch.thread, &watch.loop}) {
    file.integer(path->geometry);
    description::itemsOf(file, path->vertices, sizeof(std::uint32_t),
                         [&](std::uint32_t& vertex) { file.integer(vertex); });
    if constexpr (File::kReads)
      file.need(path->vertices.size() >= (path == &watch.loop && !watch.isOfParts ? 3 : 2),
                "a path is too short");
  }
  for (auto* edges : {&watch.threadEdges, &watch.loopEdges})
    description::itemsOf(file, *edges, sizeof(Segment),
                         [&](Segment& edge) { description::fieldOf(file, edge); });
  for (auto* positions : {&watch.end, &watch.start})
    description::itemsOf(file, *positions, sizeof(Eigen::Vector3d),
                         [&](Eigen::Vector3d& p) { description::fieldOf(file, p); });
  if constexpr (File::kReads) {
    file.need(
        areEdgesOf(watch.thread, watch.threadEdges) && areEdgesOf(watch.loop, watch.loopEdges),
        "an edge is not of its path");
    const std::size_t size =
        watch.isOfParts ? watch.thread.vertices.size() + watch.loop.vertices.size() : 0;
    file.need(watch.end.size() == size && watch.start.size() == size,
              "a part has not one position for each vertex");
  }
  for (int* count : {&watch.count, &watch.countBefore}) {
    file.integer(*count);
    if constexpr (File::kReads)
      file.need(std::abs(std::int64_t{*count}) < 1 << 28, "a count is out of range");
  }
  for (bool* flag : {&watch.isLost, &watch.wasLost}) description::fieldOf(file, *flag);
}

}  // namespace

struct ThreadTopology::Implementation {
  std::shared_ptr<StepSource> source;
  std::vector<ThreadWatch> watches;
  std::vector<ThreadEvent> events;
  std::size_t eventsBefore = 0;       ///< number of events before the step of the last update()
  std::optional<std::uint64_t> step;  ///< of the last update()

  // Scratch of update(), which remembers its peak.
  std::vector<PathVertex> thread, loop;
  std::vector<LoopPassage> passages;
  std::vector<ThreadEvent> nextEvents;
  std::vector<int> nextCounts;
  std::vector<bool> nextLost;

  template <class File>
  void describe(File& file) {
    description::itemsOf(file, watches, 32,
                         [&](ThreadWatch& watch) { describeWatch(file, watch); });
    description::valueOf(file, events);
    file.integer(eventsBefore);
    description::optionalOf(file, step, [&](std::uint64_t& number) { file.integer(number); });
    if constexpr (File::kReads)
      file.need(eventsBefore <= events.size() &&
                    std::all_of(events.begin(), events.end(),
                                [&](const ThreadEvent& e) { return e.index < watches.size(); }),
                "an event names a thread that does not exist");
  }
  const ThreadWatch& at(std::size_t index) const {
    if (index >= watches.size())
      throw Error(ErrorCode::IndexOutOfRange, "ThreadTopology: index " + std::to_string(index) +
                                                  " is out of range; add() was "
                                                  "called " +
                                                  std::to_string(watches.size()) + " times");
    return watches[index];
  }
  void copy(const ThreadWatch& watch) {
    const GeometryTable& geometries = source->geometries();
    copyVertices(geometries.at(watch.thread.geometry), watch.thread, thread);
    copyVertices(geometries.at(watch.loop.geometry), watch.loop, loop);
  }
  /// Calls f for each copied vertex.
  template <class F>
  void forEachVertex(F&& f) const {
    for (const std::vector<PathVertex>* path : {&thread, &loop})
      for (const PathVertex& vertex : *path) f(vertex);
  }
  bool startsAt(const std::vector<Eigen::Vector3d>& positions) const {
    std::size_t i = 0;
    bool isEqual = true;
    forEachVertex([&](const PathVertex& vertex) { isEqual &= vertex.at[0] == positions[i++]; });
    return isEqual;
  }
  std::size_t add(const VertexPath& thread, const VertexPath& loop, bool isOfParts);
  /// Appends the events of a step that starts with this count, and of parts at these positions.
  /// Returns the count at its end.
  int follow(std::size_t index, int count, const std::vector<Eigen::Vector3d>& start,
             std::uint64_t now);
};

std::size_t ThreadTopology::Implementation::add(const VertexPath& ofThread,
                                                const VertexPath& ofLoop, bool isOfParts) {
  const GeometryTable& geometries = source->geometries();
  check(geometries.at(ofThread.geometry), ofThread, false);
  check(geometries.at(ofLoop.geometry), ofLoop, !isOfParts);
  if (ofThread.geometry == ofLoop.geometry)
    for (const std::uint32_t v : ofLoop.vertices)
      if (std::find(ofThread.vertices.begin(), ofThread.vertices.end(), v) !=
          ofThread.vertices.end())
        throw Error(ErrorCode::IndexOutOfRange,
                    nameOf(geometries.at(ofLoop.geometry).body) + ": vertex " + std::to_string(v) +
                        (isOfParts ? " is in both threads" : " is in the thread and in the loop"),
                    ofLoop.geometry, v);
  const auto edges = [&](const VertexPath& path, bool isClosed) {
    return edgesOf(geometries.at(path.geometry).body.mesh.topology, path, isClosed);
  };
  ThreadWatch watch{ofThread,
                    ofLoop,
                    isOfParts,
                    geometries.stepNumber(),
                    edges(ofThread, false),
                    edges(ofLoop, !isOfParts)};
  copy(watch);
  if (isOfParts) {
    forEachVertex([&](const PathVertex& vertex) { watch.end.push_back(vertex.at[0]); });
    watch.start = watch.end;
  } else {
    watch.count = watch.countBefore = countPassages(thread, loop, 0);
  }
  watches.push_back(std::move(watch));
  return watches.size() - 1;
}

int ThreadTopology::Implementation::follow(std::size_t index, int count,
                                           const std::vector<Eigen::Vector3d>& start,
                                           std::uint64_t now) {
  const ThreadWatch& watch = watches[index];
  const GeometryTable& geometries = source->geometries();
  const std::optional<Cause> losses[] = {
      lossOf(watch.thread, watch.threadEdges, geometries.find(watch.thread.geometry)),
      lossOf(watch.loop, watch.loopEdges, geometries.find(watch.loop.geometry))};
  if (losses[0] || losses[1]) {
    const bool isCut = losses[0] == Cause::Cut || losses[1] == Cause::Cut;
    nextEvents.push_back(
        {index, now, isCut ? Cause::Cut : Cause::Disabled, -count, kNone, kNone, 0.0});
    nextLost[index] = true;
    return 0;
  }
  copy(watch);
  passages.clear();
  // The step of add() may get another start after the call.
  const bool knowsStart = watch.added != now;
  int end = count;
  if (watch.isOfParts) {
    if (knowsStart && !startsAt(start))
      nextEvents.push_back({index, now, Cause::Set, 0, kNone, kNone, 0.0});
    appendEdgePassages(thread, loop, passages);
    for (const LoopPassage& passage : passages) end += passage.change;
  } else {
    const int atStart = countPassages(thread, loop, 0);
    if (knowsStart && atStart != count)
      nextEvents.push_back({index, now, Cause::Set, atStart - count, kNone, kNone, 0.0});
    count = atStart;
    end = countPassages(thread, loop, 1);
    appendPassages(thread, loop, passages);
    int sum = 0;
    for (const LoopPassage& passage : passages) sum += passage.change;
    if (sum != end - count) {
      // Vertices passed exactly through edges. The first passage stands for all.
      if (passages.empty()) passages.push_back({0.0, 0, {0, 0}, {0, 0}, true});
      passages.resize(1);
      passages[0].change = end - count;
    }
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
  return all().add(thread, loop, false);
}
std::size_t ThreadTopology::addParts(const VertexPath& first, const VertexPath& second) {
  return all().add(first, second, true);
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
    const ThreadWatch& watch = own.watches[i];
    own.nextLost[i] = isRepeated ? watch.wasLost : watch.isLost;
    if (!own.nextLost[i])
      own.nextCounts[i] = own.follow(i, isRepeated ? watch.countBefore : watch.count,
                                     isRepeated ? watch.start : watch.end, now);
  }
  own.events.reserve(kept + own.nextEvents.size());
  // Nothing below throws.
  own.events.erase(own.events.begin() + static_cast<std::ptrdiff_t>(kept), own.events.end());
  own.events.insert(own.events.end(), own.nextEvents.begin(), own.nextEvents.end());
  own.eventsBefore = kept;
  for (std::size_t i = 0; i < size; ++i) {
    ThreadWatch& watch = own.watches[i];
    if (!isRepeated) {
      watch.countBefore = watch.count, watch.wasLost = watch.isLost;
      watch.start.swap(watch.end);
    }
    watch.count = own.nextCounts[i], watch.isLost = own.nextLost[i];
    if (watch.end.empty() || watch.isLost) continue;
    own.copy(watch);
    std::size_t k = 0;
    own.forEachVertex([&](const PathVertex& vertex) { watch.end[k++] = vertex.at[1]; });
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

std::vector<std::byte> ThreadTopology::save() const {
  ArchiveWriter file(kTopologyTitle, kTopologyVersion);
  all().describe(file);
  return file.bytes();
}

void ThreadTopology::restore(std::span<const std::byte> state) {
  ArchiveReader file(state, "the saved state of threads", kTopologyTitle, kTopologyVersion);
  Implementation restored;
  restored.source = all().source;
  restored.describe(file);
  file.expectEnd();
  *m_implementation = std::move(restored);
}

}  // namespace palpate
