#include "Tracking/LoopPassages.h"

#include "Math/ImpactQuery.h"
#include "Exact/PerturbedSide.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <initializer_list>

namespace palpate {

namespace {

using AlignedBox = Eigen::AlignedBox3d;

constexpr double kTimeTolerance = 0x1p-40;

template <class Vertices>
AlignedBox boxOf(const Vertices& vertices, std::initializer_list<int> ends) {
  AlignedBox box;
  for (const PathVertex& vertex : vertices)
    for (const int end : ends) box.extend(vertex.at[static_cast<std::size_t>(end)]);
  return box;
}

/// 1 if the edge passes through the triangle to the side of its winding normal, -1 to the other
/// side, 0 if it does not.
int passageOf(const NumberedPoint& p, const NumberedPoint& q, const NumberedPoint& a,
              const NumberedPoint& b, const NumberedPoint& c) {
  const int side = perturbedSide(a, b, c, q);
  if (perturbedSide(a, b, c, p) == side) return 0;
  const int turn = perturbedSide(p, q, a, b);
  return perturbedSide(p, q, b, c) == turn && perturbedSide(p, q, c, a) == turn ? side : 0;
}

template <class F>
void forEachPassage(ImpactQuery::Kind kind, const PathVertex& a, const PathVertex& b,
                    const PathVertex& c, const PathVertex& d, F&& f) {
  const auto step = [](const PathVertex& v) { return ImpactQuery::Step{v.at[0], v.at[1]}; };
  const Passages passages =
      findPassages({kind, {step(a), step(b), step(c), step(d)}}, kTimeTolerance);
  for (int i = 0; i < passages.count; ++i) f(passages.all[static_cast<std::size_t>(i)]);
}

/// The passages of the thread's edges through the first sides of a polygon.
void appendOfEdges(std::span<const PathVertex> thread, std::span<const PathVertex> polygon,
                   std::size_t sides, std::vector<LoopPassage>& passages) {
  const AlignedBox all = boxOf(polygon, {0, 1});
  for (std::size_t i = 0; i + 1 < thread.size(); ++i) {
    const AlignedBox edge = boxOf(thread.subspan(i, 2), {0, 1});
    if (!edge.intersects(all)) continue;
    for (std::size_t k = 0; k < sides; ++k) {
      const std::size_t next = k + 1 < polygon.size() ? k + 1 : 0;
      AlignedBox side;
      for (const PathVertex& v : {polygon[k], polygon[next]}) side.extend(v.at[0]).extend(v.at[1]);
      if (!side.intersects(edge)) continue;
      // Forward: through a side into the loop, if the edge points to the side of the normal.
      forEachPassage(ImpactQuery::Kind::EdgeEdge, thread[i], thread[i + 1], polygon[k],
                     polygon[next], [&](const Passages::Passage& passage) {
                       passages.push_back(
                           {passage.time, passage.forward ? 1 : -1, {i, i + 1}, {k, next}, false});
                     });
    }
  }
}

void sortByTime(std::span<LoopPassage> passages) {
  std::stable_sort(passages.begin(), passages.end(),
                   [](const LoopPassage& l, const LoopPassage& r) { return l.time < r.time; });
}

}  // namespace

int countPassages(std::span<const PathVertex> thread, std::span<const PathVertex> loop, int end) {
  const auto point = [&](const PathVertex& v) {
    return NumberedPoint{v.number, v.at[static_cast<std::size_t>(end)]};
  };
  const AlignedBox surface = boxOf(loop, {end});
  int count = 0;
  for (std::size_t i = 0; i + 1 < thread.size(); ++i) {
    const AlignedBox edge = boxOf(thread.subspan(i, 2), {end});
    if (!edge.intersects(surface)) continue;
    const NumberedPoint p = point(thread[i]), q = point(thread[i + 1]), a = point(loop[0]);
    for (std::size_t k = 1; k + 1 < loop.size(); ++k) {
      AlignedBox triangle = boxOf(loop.subspan(k, 2), {end});
      if (triangle.extend(a.position).intersects(edge))
        count += passageOf(p, q, a, point(loop[k]), point(loop[k + 1]));
    }
  }
  return count;
}

void appendPassages(std::span<const PathVertex> thread, std::span<const PathVertex> loop,
                    std::vector<LoopPassage>& passages) {
  const std::size_t first = passages.size();
  const AlignedBox surface = boxOf(loop, {0, 1});
  appendOfEdges(thread, loop, loop.size(), passages);
  const bool isClosed = thread.front().number == thread.back().number;
  for (const std::size_t place : {std::size_t{0}, thread.size() - 1}) {
    if (isClosed || !boxOf(thread.subspan(place, 1), {0, 1}).intersects(surface)) continue;
    const int direction = place == 0 ? -1 : 1;
    for (std::size_t k = 1; k + 1 < loop.size(); ++k)
      forEachPassage(ImpactQuery::Kind::VertexTriangle, thread[place], loop[0], loop[k],
                     loop[k + 1], [&](const Passages::Passage& passage) {
                       passages.push_back({passage.time,
                                           passage.forward ? direction : -direction,
                                           {place, place},
                                           {0, 0},
                                           true});
                     });
  }
  sortByTime(std::span(passages).subspan(first));
}

void appendEdgePassages(std::span<const PathVertex> thread, std::span<const PathVertex> other,
                        std::vector<LoopPassage>& passages) {
  const std::size_t first = passages.size();
  appendOfEdges(thread, other, other.size() - 1, passages);
  sortByTime(std::span(passages).subspan(first));
}

}  // namespace palpate
