#include "Queries/TranslationSweep.h"

#include "Mesh/Corners.h"
#include "Math/ClosestPoint.h"
#include "Math/Tolerances.h"
#include "Core/Assert.h"
#include "Core/Stopping.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <bit>
#include <cmath>
#include <functional>
#include <limits>
#include <tuple>
#include <utility>

namespace palpate {

using Eigen::Vector3d;

namespace {

constexpr double kNever = std::numeric_limits<double>::infinity();
/// A vertex moves at most so many insets.
constexpr double kMostInsets = 16.0;
/// Mean extent of triangles along an axis, as a share of the body's. If it is larger, the places of
/// triangles along the axis do not tell which ones are near. Any value near a half will do.
constexpr double kWideTriangles = 0.5;
constexpr double kRaySlack = kExitSlack;  ///< in units: more than the rounding of a ray

/// The translations along a direction at which two triangles cross, and where they touch last.
class CrossingInterval {
 public:
  /// inner: the triangle a for the question whether they cross. least: intervals that end before it
  /// do not count.
  CrossingInterval(const Corners& a, const Corners& inner, const Corners& b,
                   const Vector3d& direction, double least)
      : m_a(a), m_inner(inner), m_b(b), m_direction(direction), m_least(least) {}

  /// Returns whether they cross.
  bool find() {
    const auto side = [](const Corners& p, std::size_t i) {
      return Vector3d(p[(i + 1) % 3] - p[i]);
    };
    if (!clip(side(m_b, 0).cross(side(m_b, 1)), 0) || !clip(side(m_a, 0).cross(side(m_a, 1)), 0))
      return false;
    for (std::size_t i = 0; i < 3; ++i)
      for (std::size_t j = 0; j < 3; ++j) {
        const Vector3d e = side(m_a, i), f = side(m_b, j);
        if (!clip(e.cross(f), kAlongPlane * kAlongPlane * e.squaredNorm() * f.squaredNorm()))
          return false;
      }
    return true;
  }
  double enter() const { return m_enter; }
  double lastTouch() const { return m_lastTouch; }
  const Vector3d& normal() const { return m_normal; }  ///< of any length
  std::size_t axes() const { return m_axes; }          ///< that were tested

 private:
  struct Range {
    double lower, upper;
  };
  static Range rangeOf(const Corners& p, const Vector3d& n) {
    const double x = n.dot(p[0]), y = n.dot(p[1]), z = n.dot(p[2]);
    return {std::min(x, std::min(y, z)), std::max(x, std::max(y, z))};
  }
  /// Leaves out where the planes across n separate. least: shorter normals, squared, are none.
  bool clip(const Vector3d& n, double least) {
    ++m_axes;
    const double square = n.squaredNorm(), slope = n.dot(m_direction);
    if (!(square > least)) return true;
    const Range inner = rangeOf(m_inner, n), b = rangeOf(m_b, n);
    if (!(slope * slope > kAlongPlane * kAlongPlane * square))
      return inner.upper > b.lower && inner.lower < b.upper;
    const Range a = rangeOf(m_a, n);
    const bool rises = slope > 0;
    m_enter = std::max(m_enter, (rises ? b.lower - inner.upper : b.upper - inner.lower) / slope);
    m_leave = std::min(m_leave, (rises ? b.upper - inner.lower : b.lower - inner.upper) / slope);
    const double touch = (rises ? b.upper - a.lower : b.lower - a.upper) / slope;
    if (touch < m_lastTouch) {
      m_lastTouch = touch;
      m_normal = rises ? n : Vector3d(-n);
    }
    return m_enter < m_leave && m_lastTouch >= m_least;
  }

  const Corners &m_a, &m_inner, &m_b;
  const Vector3d& m_direction;
  const double m_least;
  double m_enter = -kNever, m_leave = kNever, m_lastTouch = kNever;
  Vector3d m_normal = Vector3d::Zero();
  std::size_t m_axes = 0;
};

bool entersLater(const SweepScratch::Task& l, const SweepScratch::Task& r) {
  return l.enter > r.enter;
}

void enclose(SweepScratch::Box& box, const SweepScratch::Box& other) {
  for (std::size_t k = 0; k < 4; ++k) {
    box.lower[k] = std::min(box.lower[k], other.lower[k]);
    box.upper[k] = std::max(box.upper[k], other.upper[k]);
  }
}
double sizeOf(const SweepScratch::Box& box) {
  return (box.upper[0] - box.lower[0]) + (box.upper[1] - box.lower[1]) +
         (box.upper[2] - box.lower[2]);
}

}  // namespace

TranslationSweep::TranslationSweep(const BodyPair& pair, const Vector3d& axis,
                                   SweepScratch& scratch)
    : m_pair(pair),
      m_scratch(scratch),
      m_axis(axis),
      m_unit(unitOf(pair.magnitude())),
      m_inset(kInset * pair.magnitude() * m_unit) {
  load(true, scratch.a);
  load(false, scratch.b);
  makeInset();
  makeBoxes(scratch.a, true);
  makeBoxes(scratch.b, false);
}

/// The order depends on positions and numbers only, unlike that of an octree that was refitted: it
/// decides which of equally late contacts is the last.
void TranslationSweep::load(bool ofA, Side& side) {
  constexpr double kCells = 1023;
  const MeshTopology& topology = m_pair.geometry(ofA).mesh.topology;
  const BodyVertices& own = m_pair.vertices(ofA);
  const Vector3d lower = own.box.min();
  const double size = own.box.sizes().maxCoeff(), scale = size > 0 ? kCells / size : 0.0;
  const auto spread = [](std::uint32_t x) {  // ten bits, two apart
    x = (x | x << 16) & 0x030000ffu;
    x = (x | x << 8) & 0x0300f00fu;
    x = (x | x << 4) & 0x030c30c3u;
    return (x | x << 2) & 0x09249249u;
  };
  TimeCheck check(256);
  side.order.clear();
  Vector3d extents = Vector3d::Zero();
  std::size_t count = 0;
  topology.forEachElement([&](std::uint32_t element) {
    check();
    const auto [p, q, r] = cornersOf(topology.elements[element], own.positions);
    extents += p.cwiseMax(q).cwiseMax(r) - p.cwiseMin(q).cwiseMin(r);
    ++count;
  });
  // Of plates, for instance, only the order across them tells which triangles are near each other.
  const auto isDivided = [&](int k) {
    return extents[k] < kWideTriangles * static_cast<double>(count) * own.box.sizes()[k];
  };
  const std::array<bool, 3> divides{isDivided(0), isDivided(1), isDivided(2)};
  topology.forEachElement([&](std::uint32_t element) {
    check();
    const auto [p, q, r] = cornersOf(topology.elements[element], own.positions);
    if (!hasArea(p, q, r)) return;  // its edges are those of other triangles
    const Vector3d cell = scale * ((p / 3.0 + q / 3.0 + r / 3.0) - lower);
    const auto at = [&](int k) {
      return divides[static_cast<std::size_t>(k)]
                 ? spread(static_cast<std::uint32_t>(std::clamp(cell[k], 0.0, kCells)))
                 : 0u;
    };
    side.order.push_back({at(0) | at(1) << 1 | at(2) << 2, element});
  });
  sortInTime(side.order.begin(), side.order.end(), std::less());
  side.corners.clear();
  for (const auto& [place, element] : side.order) {
    const Corners p = cornersOf(topology.elements[element], own.positions);
    side.corners.push_back({m_unit * p[0], m_unit * p[1], m_unit * p[2]});
  }
}

/// Moves each vertex of a so that its faces move inward by m_inset, at most by kMostInsets of it.
void TranslationSweep::makeInset() {
  constexpr double kWide = 0.25;
  constexpr int kTurns = 8;
  const MeshTopology& topology = m_pair.geometry(true).mesh.topology;
  const BodyVertices& own = m_pair.vertices(true);
  auto& normals = m_scratch.normals;
  auto& vertices = m_scratch.vertices;
  normals.assign(topology.elements.size(), Vector3d::Zero());
  TimeCheck check(256);
  const Vector3d centre = m_unit * own.box.center();
  double volume = 0;
  for (std::size_t i = 0; i < m_scratch.a.corners.size(); ++i) {
    check();
    const auto& [p, q, r] = m_scratch.a.corners[i];
    const Vector3d across = (q - p).cross(r - p);
    volume += across.dot(p - centre);
    const double length = across.norm();
    if (length > 0) normals[m_scratch.a.order[i].second] = across / length;
  }
  const double outward = volume < 0 ? -1.0 : 1.0;
  vertices.resize(own.positions.size());
  for (std::uint32_t v = 0; v < vertices.size(); ++v) {
    check();
    vertices[v] = m_unit * own.positions[v];
    const auto around = topology.vertexTriangles[v];
    Vector3d way = Vector3d::Zero();
    for (const std::uint32_t t : around) way += normals[t];
    // Turns towards the faces along which it leads least.
    double least = 0;
    for (int turn = 0;; ++turn) {
      const double length = way.norm();
      if (length > 0) way /= length;
      least = 1;
      std::uint32_t worst = kNoElement;
      for (const std::uint32_t t : around) {
        if (normals[t].isZero(0.0) || !(normals[t].dot(way) < least)) continue;
        least = normals[t].dot(way);
        worst = t;
      }
      if (least > kWide || worst == kNoElement || turn == kTurns) break;
      way += normals[worst];
    }
    vertices[v] -= outward * m_inset / std::max(least, 1.0 / kMostInsets) * way;
  }
  m_scratch.inset.resize(m_scratch.a.corners.size());
  for (std::size_t i = 0; i < m_scratch.inset.size(); ++i)
    m_scratch.inset[i] = cornersOf(topology.elements[m_scratch.a.order[i].second], vertices);
}

void TranslationSweep::extend(Box& box, const Vector3d& p) const {
  const std::array<double, 4> heights{p[0], p[1], p[2], m_axis.dot(p)};
  for (std::size_t k = 0; k < 4; ++k) {
    box.lower[k] = std::min(box.lower[k], heights[k]);
    box.upper[k] = std::max(box.upper[k], heights[k]);
  }
}

void TranslationSweep::makeBoxes(Side& side, bool withInset) {
  side.leaves = std::bit_ceil(std::max<std::size_t>(1, (side.corners.size() + kLeaf - 1) / kLeaf));
  const Box empty{{kNever, kNever, kNever, kNever}, {-kNever, -kNever, -kNever, -kNever}};
  side.boxes.assign(2 * side.leaves, empty);
  side.own.assign(side.corners.size(), empty);
  for (std::size_t i = 0; i < side.corners.size(); ++i) {
    Box& box = side.own[i];
    for (std::size_t k = 0; k < 3; ++k) {
      const Vector3d& p = side.corners[i][k];
      extend(box, p);
      if (!withInset) continue;
      extend(box, m_scratch.inset[i][k]);
      extend(box, p + p - m_scratch.inset[i][k]);
    }
    enclose(side.boxes[side.leaves + i / kLeaf], box);
  }
  for (std::size_t node = side.leaves - 1; node > 0; --node)
    for (const std::size_t child : {2 * node, 2 * node + 1})
      enclose(side.boxes[node], side.boxes[child]);
}

/// Rounding is monotone: a box in another one gives an interval in that of the other one.
TranslationSweep::Task TranslationSweep::taskOf(const Box& a, const Box& b) const {
  Task task{-kNever, kNever, 0, 0, false};
  for (std::size_t k = 0; k < 4; ++k) {
    const double low = b.lower[k] - a.upper[k], high = b.upper[k] - a.lower[k];
    const double inverse = m_inverse[k];
    if (inverse == 0.0) {
      if (!(low <= 0 && high >= 0)) task.leave = -kNever;
      continue;
    }
    task.enter = std::max(task.enter, (inverse > 0 ? low : high) * inverse);
    task.leave = std::min(task.leave, (inverse > 0 ? high : low) * inverse);
  }
  return task;
}

void TranslationSweep::start(const Vector3d& direction, double from, bool closed) {
  m_direction = direction;
  m_isClosed = closed;
  const std::array<double, 4> slopes{direction[0], direction[1], direction[2],
                                     m_axis.dot(direction)};
  for (std::size_t k = 0; k < 4; ++k) {
    const double along = slopes[k];
    m_inverse[k] = std::abs(along) > kAlongPlane ? 1.0 / along : 0.0;
  }
  m_t = m_unit * from;
  m_last = {};
  m_scratch.now.clear();
  m_scratch.later.clear();
  m_end = m_t;
  const Side &a = m_scratch.a, &b = m_scratch.b;
  Task root = taskOf(a.boxes[1], b.boxes[1]);
  root.a = root.b = 1;
  enter(root);
}

/// Keeps what meets at the present translation for this round, and the rest for later.
void TranslationSweep::enter(const Task& task) {
  if (!(task.enter <= task.leave) || !(task.leave > m_t)) return;
  if (task.enter <= m_t) {
    if (task.leave > m_end) m_scratch.now.push_back(task);
    return;
  }
  m_scratch.later.push_back(task);
  std::push_heap(m_scratch.later.begin(), m_scratch.later.end(), entersLater);
}

bool TranslationSweep::advance(const Limits& limits, bool isInside) {
  auto& later = m_scratch.later;
  TimeCheck check(1);
  const double limit = m_unit * limits.end;
  m_limit = limits.wantsLast ? kNever : limit;
  if (isBlocked()) return false;
  for (;;) {
    m_end = m_t;
    m_next = {};
    while (!m_scratch.now.empty()) {
      check();
      if (m_operations > limits.operations || m_end > m_limit) return false;
      run();
    }
    if (m_end > m_t) {
      m_t = m_end;
      m_last = m_next;
      isInside = false;
    } else if (!isInside) {
      return true;
    } else {
      if (later.empty()) return false;
      m_t = std::max(m_t, later.front().enter);
      m_end = m_t;
    }
    if (!(m_t < limit)) return false;
    while (!later.empty() && later.front().enter <= m_t) {
      std::pop_heap(later.begin(), later.end(), entersLater);
      if (later.back().leave > m_t) m_scratch.now.push_back(later.back());
      later.pop_back();
    }
    std::sort(m_scratch.now.begin(), m_scratch.now.end(), [](const Task& l, const Task& r) {
      return std::tie(l.leave, l.a, l.b) < std::tie(r.leave, r.a, r.b);
    });
  }
}

TranslationSweep::Contact TranslationSweep::touchingAt(const Vector3d& direction, double t) {
  start(direction, t, true);
  m_findsTouch = true;
  m_touch = -kNever;
  m_limit = kNever;
  while (!m_scratch.now.empty()) run();
  m_findsTouch = false;
  return m_last;
}

/// Whether known triangles cross from t() to beyond the limit.
bool TranslationSweep::isBlocked() {
  if (m_limit == kNever) return false;
  m_end = m_t;
  for (std::size_t i = 0; i < std::min(m_blockerCount, m_blockers.size()); ++i) {
    const auto& [a, b] = m_blockers[i];
    Task task = taskOf(m_scratch.a.own[a], m_scratch.b.own[b]);
    task.a = a;
    task.b = b;
    if (task.enter <= m_t && task.leave > m_limit) testTriangles(task);
    if (m_end > m_limit) return true;
  }
  return false;
}

/// Runs the tasks of this round, those that leave last first.
void TranslationSweep::run() {
  auto& now = m_scratch.now;
  const Task task = now.back();
  now.pop_back();
  if (!(task.leave > m_end)) return;
  if (task.areTriangles) return testTriangles(task);
  const Side &a = m_scratch.a, &b = m_scratch.b;
  const bool isLeafA = task.a >= a.leaves, isLeafB = task.b >= b.leaves;
  if (isLeafA && isLeafB) return runTriangles(task);
  const bool dividesA = isLeafB || (!isLeafA && sizeOf(a.boxes[task.a]) >= sizeOf(b.boxes[task.b]));
  std::array<Task, 2> parts;
  for (std::uint32_t i = 0; i < 2; ++i) {
    const std::uint32_t nodeA = dividesA ? 2 * task.a + i : task.a,
                        nodeB = dividesA ? task.b : 2 * task.b + i;
    parts[i] = taskOf(a.boxes[nodeA], b.boxes[nodeB]);
    parts[i].a = nodeA;
    parts[i].b = nodeB;
  }
  m_operations += 2;
  if (parts[0].leave > parts[1].leave) std::swap(parts[0], parts[1]);
  enter(parts[0]);
  enter(parts[1]);
}

void TranslationSweep::runTriangles(const Task& task) {
  const Side &a = m_scratch.a, &b = m_scratch.b;
  const auto rangeOf = [](const Side& side, std::uint32_t node) {
    const std::size_t begin = (node - side.leaves) * kLeaf;
    return std::pair(std::min(begin, side.corners.size()),
                     std::min(begin + kLeaf, side.corners.size()));
  };
  const auto [beginA, endA] = rangeOf(a, task.a);
  const auto [beginB, endB] = rangeOf(b, task.b);
  for (std::size_t i = beginA; i < endA; ++i)
    for (std::size_t j = beginB; j < endB; ++j) {
      Task both = taskOf(a.own[i], b.own[j]);
      ++m_operations;
      both.a = static_cast<std::uint32_t>(i);
      both.b = static_cast<std::uint32_t>(j);
      both.areTriangles = true;
      enter(both);
    }
}

void TranslationSweep::testTriangles(const Task& task) {
  const Corners &a = m_scratch.a.corners[task.a], &inset = m_scratch.inset[task.a];
  Corners outset;
  if (m_isClosed)
    for (std::size_t k = 0; k < 3; ++k) outset[k] = a[k] + a[k] - inset[k];
  CrossingInterval crossing(a, m_isClosed ? outset : inset, m_scratch.b.corners[task.b],
                            m_direction, m_isClosed ? m_end - kMostInsets * m_inset : m_end);
  const bool cross = crossing.find();
  m_operations += crossing.axes();
  if (!cross) return;
  const double end = std::min(crossing.lastTouch(), task.leave);
  if (crossing.enter() > m_t) return enter({crossing.enter(), end, task.a, task.b, true});
  const auto contact = [&] {
    return Contact{m_scratch.a.order[task.a].second, m_scratch.b.order[task.b].second,
                   crossing.normal().normalized()};
  };
  if (m_findsTouch) {
    if (!(end > m_touch && end <= m_t + kMostInsets * m_inset)) return;
    m_touch = end;
    m_last = contact();
    return;
  }
  if (!(end > m_end)) return;
  m_end = end;
  const std::pair both(task.a, task.b);
  if (end > m_limit && std::find(m_blockers.begin(), m_blockers.end(), both) == m_blockers.end())
    m_blockers[m_blockerCount++ % m_blockers.size()] = both;
  m_next = contact();
}

/// Edges are widened by kExitWeight, so that nothing passes between triangles.
namespace {

/// Where a ray meets boxes first.
class RayToBox {
 public:
  RayToBox(const Vector3d& start, const Vector3d& along) : m_start(start) {
    for (std::size_t k = 0; k < 3; ++k) {
      const double slope = along[static_cast<Eigen::Index>(k)];
      m_inverse[k] = std::abs(slope) > kAlongPlane ? 1.0 / slope : 0.0;
    }
  }
  /// At `end` at the latest, else never.
  double operator()(const auto& box, double end) const {
    if (box.lower[0] > box.upper[0]) return kNever;  // no triangles
    double first = 0, last = end;
    for (std::size_t k = 0; k < 3; ++k) {
      const double start = m_start[static_cast<Eigen::Index>(k)];
      const double low = box.lower[k] - kRaySlack - start, high = box.upper[k] + kRaySlack - start;
      if (m_inverse[k] == 0.0) {
        if (low > 0 || high < 0) return kNever;
        continue;
      }
      const double atLow = low * m_inverse[k], atHigh = high * m_inverse[k];
      first = std::max(first, std::min(atLow, atHigh));
      last = std::min(last, std::max(atLow, atHigh));
    }
    return first <= last ? first : kNever;
  }

 private:
  Vector3d m_start;
  std::array<double, 3> m_inverse{};  ///< of the components; 0: along the planes
};

}  // namespace

std::optional<TranslationSweep::Hit> TranslationSweep::firstHit(bool ofA, std::uint32_t vertex,
                                                                const Vector3d& direction,
                                                                double end) const {
  const Side& side = ofA ? m_scratch.b : m_scratch.a;
  const Vector3d p = m_unit * m_pair.vertices(ofA).positions[vertex],
                 along = ofA ? direction : Vector3d(-direction);
  const RayToBox entryAt(p, along);
  double t = end * m_unit;
  std::uint32_t element = kNoElement;
  const auto entryOf = [&](const Box& box) { return entryAt(box, t); };
  const auto test = [&](std::size_t i) {
    const auto& [a, b, c] = side.corners[i];
    const Vector3d u = b - a, v = c - a, normal = u.cross(v), from = p - a;
    const double slope = normal.dot(along);
    if (slope == 0) return;
    const double at = -normal.dot(from) / slope;
    if (!(at >= 0 && at < t)) return;
    const Vector3d across = along.cross(from);
    const double x = v.dot(across) / slope, y = -u.dot(across) / slope;
    if (!(x >= -kExitWeight && y >= -kExitWeight && x + y <= 1 + kExitWeight)) return;
    t = at;
    element = side.order[i].second;
  };
  struct Entry {
    std::uint32_t node;
    double at;
  };
  std::array<Entry, 64> stack;
  std::size_t size = 0;
  stack[size++] = {1, entryOf(side.boxes[1])};
  while (size > 0) {
    const auto [node, at] = stack[--size];
    if (!(at <= t)) continue;
    if (node < side.leaves) {
      Entry near{2 * node, entryOf(side.boxes[2 * node])},
          far{2 * node + 1, entryOf(side.boxes[2 * node + 1])};
      if (far.at < near.at) std::swap(near, far);
      if (far.at < kNever) stack[size++] = far;
      if (near.at < kNever) stack[size++] = near;
      continue;
    }
    const std::size_t begin = (node - side.leaves) * kLeaf;
    for (std::size_t i = begin; i < std::min(begin + kLeaf, side.corners.size()); ++i) test(i);
  }
  if (element == kNoElement) return {};
  return Hit{t / m_unit, element};
}

bool TranslationSweep::isInsetInside() const {
  const Vector3d shift = t() * m_direction;
  const auto& parts = m_pair.vertices(true).parts;
  return std::any_of(parts.begin(), parts.end(), [&](std::uint32_t v) {
    return m_pair.isInB(m_scratch.vertices[v] / m_unit + shift);
  });
}

}  // namespace palpate
