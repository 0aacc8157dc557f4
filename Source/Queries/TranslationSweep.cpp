#include "Queries/TranslationSweep.h"

#include "Mesh/Corners.h"
#include "Math/Tolerances.h"
#include "Core/Assert.h"
#include "Core/Stopping.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>
#include <utility>

namespace palpate {

using Eigen::Vector3d;

namespace {

constexpr double kNever = std::numeric_limits<double>::infinity();

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

}  // namespace

TranslationSweep::TranslationSweep(const BodyPair& pair, const Vector3d& axis,
                                   SweepScratch& scratch)
    : m_pair(pair),
      m_scratch(scratch),
      m_frame(frameOf(pair)),
      m_axis(m_frame.axes * axis),
      m_unit(m_frame.unit),
      m_inset(kInset * pair.magnitude() * m_unit) {
  const MeshTopology& topology = pair.geometry(true).mesh.topology;
  scratch.a.load(topology, pair.vertices(true), m_frame);
  scratch.b.load(pair.geometry(false).mesh.topology, pair.vertices(false), m_frame);
  scratch.inset.make(scratch.a, topology, pair.vertices(true), m_frame, m_inset);
  scratch.a.makeBoxes(m_axis, &scratch.inset, false);
  scratch.b.makeBoxes(m_axis, nullptr, false);
}

/// Rounding is monotone: a box in another one gives an interval in that of the other one.
TranslationSweep::Task TranslationSweep::taskOf(const SweepTree::Box& a,
                                                const SweepTree::Box& b) const {
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
  m_direction = m_frame.axes * direction;
  if (closed && !m_isClosed) m_scratch.a.makeBoxes(m_axis, &m_scratch.inset, true);
  m_isClosed = closed;
  const std::array<double, 4> slopes{m_direction[0], m_direction[1], m_direction[2],
                                     m_axis.dot(m_direction)};
  for (std::size_t k = 0; k < 4; ++k) {
    const double along = slopes[k];
    m_inverse[k] = std::abs(along) > kAlongPlane ? 1.0 / along : 0.0;
  }
  m_t = m_unit * from;
  m_last = {};
  m_scratch.now.clear();
  m_scratch.later.clear();
  m_end = m_t;
  const SweepTree &a = m_scratch.a, &b = m_scratch.b;
  Task root = taskOf(a.boxes[1], b.boxes[1]);
  root.a = root.b = 1;
  enter(root);
}

/// Keeps what meets at the present translation for this round, and the rest for later.
void TranslationSweep::enter(const Task& task) {
  if (!(task.enter <= task.leave) || !(task.leave > m_t + kSameTouch)) return;
  if (task.enter <= m_t) {
    if (task.leave > m_end + kSameTouch) m_scratch.now.push_back(task);
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
      if (later.back().leave > m_t + kSameTouch) m_scratch.now.push_back(later.back());
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
  if (!(task.leave > m_end + kSameTouch)) return;
  if (task.areTriangles) return testTriangles(task);
  const SweepTree &a = m_scratch.a, &b = m_scratch.b;
  const bool isLeafA = task.a >= a.leaves, isLeafB = task.b >= b.leaves;
  if (isLeafA && isLeafB) return runTriangles(task);
  const bool dividesA = isLeafB || (!isLeafA && a.boxes[task.a].size() >= b.boxes[task.b].size());
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
  const SweepTree &a = m_scratch.a, &b = m_scratch.b;
  const auto [beginA, endA] = a.trianglesOf(task.a);
  const auto [beginB, endB] = b.trianglesOf(task.b);
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
  const Corners &a = m_scratch.a.corners[task.a], &inset = m_scratch.inset.triangles[task.a];
  Corners outset;
  if (m_isClosed)
    for (std::size_t k = 0; k < 3; ++k) outset[k] = a[k] + a[k] - inset[k];
  CrossingInterval crossing(a, m_isClosed ? outset : inset, m_scratch.b.corners[task.b],
                            m_direction, m_isClosed ? m_end - SweepInset::kMost * m_inset : m_end);
  const bool cross = crossing.find();
  m_operations += crossing.axes();
  if (!cross) return;
  const double end = std::min(crossing.lastTouch(), task.leave);
  if (crossing.enter() > m_t) return enter({crossing.enter(), end, task.a, task.b, true});
  const auto contact = [&] {
    return Contact{m_scratch.a.order[task.a].element, m_scratch.b.order[task.b].element,
                   (m_frame.axes.transpose() * crossing.normal()).normalized()};
  };
  if (m_findsTouch) {
    if (!(end > m_touch && end <= m_t + SweepInset::kMost * m_inset)) return;
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

std::optional<TranslationSweep::Hit> TranslationSweep::firstHit(bool ofA, std::uint32_t vertex,
                                                                const Vector3d& direction,
                                                                double end) const {
  const Vector3d p = m_frame(m_pair.vertices(ofA).positions[vertex]),
                 along = m_frame.axes * (ofA ? direction : Vector3d(-direction));
  auto hit = (ofA ? m_scratch.b : m_scratch.a).firstHit(p, along, end * m_unit);
  if (hit) hit->t /= m_unit;
  return hit;
}

bool TranslationSweep::isInsetInside() const {
  const auto back = m_frame.axes.transpose();
  const Vector3d shift = t() * (back * m_direction);
  const auto& parts = m_pair.vertices(true).parts;
  return std::any_of(parts.begin(), parts.end(), [&](std::uint32_t v) {
    return m_pair.isInB(back * m_scratch.inset.vertices[v] / m_unit + shift);
  });
}

}  // namespace palpate
