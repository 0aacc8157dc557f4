#include "Shapes/Polytope.h"

#include "Shapes/ShapeLengths.h"
#include "Math/Foot.h"
#include "Exact/Compensated.h"
#include "Exact/Predicates.h"
#include "Core/Assert.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

namespace palpate {

namespace {

using Eigen::Vector3d;
constexpr std::uint32_t kNone = 0xffffffffu;

int volumeSign(const Vector3d& a, const Vector3d& b, const Vector3d& c, const Vector3d& d) {
  SignCounts counts;
  return orient3d(a, b, c, d, counts);
}

bool spanPlane(const Vector3d& a, const Vector3d& b, const Vector3d& c) {
  SignCounts counts;
  return orient2d(0, a, b, c, counts) != 0 || orient2d(1, a, b, c, counts) != 0 ||
         orient2d(2, a, b, c, counts) != 0;
}

/// The point of greatest measure among those that are `independent`; null if there is none.
template <class Independent, class Measure>
const Vector3d* furthest(std::span<const Vector3d> points, Independent&& independent,
                         Measure&& measure) {
  const Vector3d* best = nullptr;
  double most = 0;
  for (const Vector3d& p : points) {
    const double value = measure(p);
    if ((best && !(value > most)) || !independent(p)) continue;
    best = &p;
    most = value;
  }
  return best;
}

/// Up to this many points are added in their own order.
constexpr std::size_t kPointsInOrder = 32;

/// 0, 1, ... in an order that looks random and is the same on every machine: Fisher and Yates, with
/// the numbers of SplitMix64 (Steele, Lea, Flood 2014).
std::vector<std::uint32_t> shuffled(std::uint32_t count) {
  std::vector<std::uint32_t> order(count);
  std::iota(order.begin(), order.end(), 0u);
  std::uint64_t state = 0;
  for (std::uint32_t i = count; i > 1; --i) {
    std::uint64_t z = state += 0x9e3779b97f4a7c15u;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    z ^= z >> 31;
    std::swap(order[i - 1], order[(z >> 32) * i >> 32]);
  }
  return order;
}

}  // namespace

std::vector<Vector3d> spanOf(std::span<const Vector3d> points) {
  PALPATE_ASSERT(!points.empty());
  const auto before = [](const Vector3d& p, const Vector3d& q) {
    return std::lexicographical_compare(p.begin(), p.end(), q.begin(), q.end());
  };
  const auto ends = std::minmax_element(points.begin(), points.end(), before);
  const Vector3d &a = *ends.first, &b = *ends.second, along = b - a;
  std::vector<Vector3d> span{a};
  if (a == b) return span;
  span.push_back(b);
  const Vector3d* third = furthest(
      points, [&](const Vector3d& p) { return spanPlane(a, b, p); },
      [&](const Vector3d& p) { return along.cross(p - a).squaredNorm(); });
  if (!third) return span;
  span.push_back(*third);
  const Vector3d across = along.cross(*third - a);
  if (const Vector3d* fourth = furthest(
          points, [&](const Vector3d& p) { return volumeSign(a, b, *third, p) != 0; },
          [&](const Vector3d& p) { return std::abs(across.dot(p - a)); }))
    span.push_back(*fourth);
  return span;
}

Polytope::Polytope(std::span<const Vector3d> points) {
  std::vector<Vector3d> four = spanOf(points);
  PALPATE_ASSERT(four.size() >= 3);
  const bool flat = four.size() == 3;
  if (flat) {  // adds a point beside the plane, which is removed at the end
    const Vector3d across = (four[1] - four[0]).cross(four[2] - four[0]).cwiseAbs();
    SignCounts counts;
    int axis = 0;
    across.maxCoeff(&axis);
    for (int k = 0; orient2d(axis, four[0], four[1], four[2], counts) == 0; ++k) axis = k;
    four.push_back(four[0]);
    four[3][axis] +=
        std::max({std::abs(four[0][axis]), largest(four[1] - four[0]), largest(four[2] - four[0])});
  }
  start(four);
  addAll(points);
  if (flat)
    reduceToPlate(3);
  else
    compact();
  PALPATE_ASSERT(flat || m_faces.size() + 4 == 2 * m_points.size());  // no hole: Euler's formula
}

void Polytope::start(std::span<const Vector3d> four) {
  PALPATE_ASSERT(four.size() == 4 && volumeSign(four[0], four[1], four[2], four[3]) != 0);
  m_points.assign(four.begin(), four.end());
  m_faces.clear();
  m_planes.clear();
  m_free.clear();
  m_isVisible.clear();
  m_next.assign(4, 0);
  const bool turned = volumeSign(four[0], four[1], four[2], four[3]) > 0;
  const std::uint32_t b = turned ? 2 : 1, c = turned ? 1 : 2;
  newFace({0, b, c}, {1, 2, 3});
  newFace({0, 3, b}, {3, 2, 0});
  newFace({b, 3, c}, {1, 3, 0});
  newFace({c, 3, 0}, {2, 1, 0});
}

std::uint32_t Polytope::newFace(const Triangle& corners, const Triangle& neighbours) {
  PALPATE_ASSERT(corners[0] != corners[1] && corners[1] != corners[2] && corners[2] != corners[0]);
  auto face = static_cast<std::uint32_t>(m_faces.size());
  if (m_free.empty()) {
    m_faces.emplace_back();
    m_planes.emplace_back();
    m_isVisible.push_back(0);
  } else {
    face = m_free.back();
    m_free.pop_back();
  }
  const Vector3d &a = m_points[corners[0]], &b = m_points[corners[1]], &c = m_points[corners[2]];
  const Vector3d normal = unitCross(a, b, a, c, &m_decisions.undecided);
  m_faces[face] = {corners, neighbours};
  m_planes[face] = {normal, dot(normal, a), face};
  m_isVisible[face] = 0;
  return face;
}

bool Polytope::add(const Vector3d& p) {
  m_visible.clear();
  for (std::uint32_t f = 0; f < m_faces.size(); ++f) {
    m_isVisible[f] = m_planes[f].face != kNone && isVisibleFrom(p, f);
    if (m_isVisible[f]) m_visible.push_back(f);
  }
  if (m_visible.empty()) return false;
  addVisible(p);
  removeVisible();
  return true;
}

/// Adds p, and faces from p to the horizon: the border of the region that is visible from p.
void Polytope::addVisible(const Vector3d& p) {
  m_points.push_back(p);
  m_next.resize(m_points.size());
  m_newFaces.clear();
  std::uint32_t last = kNone;
  for (const std::uint32_t f : m_visible) last = addHorizonFaces(f, last);
  PALPATE_ASSERT(m_newFaces.size() >= 3);
  // Links the new faces around the horizon. m_next: the new face that starts at a corner of the
  // horizon.
  for (std::uint32_t f = last, next = kNone; next != last; f = next) {
    next = m_next[m_faces[f].corners[1]];
    m_faces[f].neighbours[1] = next;
    m_faces[next].neighbours[2] = f;
  }
}

void Polytope::removeVisible() {
  for (const std::uint32_t f : m_visible) {
    m_planes[f] = {Vector3d::Zero(), std::numeric_limits<double>::infinity(), kNone};
    m_isVisible[f] = 0;
    m_free.push_back(f);
  }
}

/// The points that are still to be added, and the faces that are visible from them (the conflict
/// lists of Clarkson and Shor).
///
/// A new face shares an edge of the horizon with two old faces, one on either side of the horizon.
/// If the new face is visible from a point, one of these two was: the plane of the new face is
/// between theirs through a common line, so that a point in front of it is in front of one of them.
/// If a removed face was visible from an outside point, a new face is. The region that is visible
/// from the point is connected, so either all of that region is removed, or both faces at an edge
/// of the horizon were visible.
struct Polytope::Conflicts {
  /// Per face: points from which it is visible.
  std::vector<std::vector<std::uint32_t>> pointsOfFace;
  std::vector<std::uint32_t> visibleFace;  ///< per point: a visible face; kNone: it is inside
  std::vector<std::uint32_t> tested;       ///< per point: faces made before its last test

  explicit Conflicts(std::size_t points) : visibleFace(points, kNone), tested(points, 0) {}
  void add(std::uint32_t point, std::uint32_t face) {
    pointsOfFace[face].push_back(point);
    visibleFace[point] = face;
  }
};

void Polytope::addAll(std::span<const Vector3d> points) {
  if (points.size() <= kPointsInOrder) {
    for (const Vector3d& p : points) add(p);
    return;
  }
  const auto count = static_cast<std::uint32_t>(points.size());
  Conflicts conflicts(count);
  conflicts.pointsOfFace.resize(m_faces.size());
  for (std::uint32_t f = 0; f < m_faces.size(); ++f) {
    const OrientedPlane plane(corner(f, 0), corner(f, 1), corner(f, 2));
    for (std::uint32_t i = 0; i < count; ++i)
      if (plane.side(points[i], m_decisions) > 0) conflicts.add(i, f);
  }
  std::uint32_t made = 0;  // faces
  const auto test = [&](std::uint32_t point, const OrientedPlane& plane, std::uint32_t face) {
    if (conflicts.tested[point] == made) return;
    conflicts.tested[point] = made;
    if (plane.side(points[point], m_decisions) > 0) conflicts.add(point, face);
  };
  for (const std::uint32_t i : shuffled(count)) {
    if (conflicts.visibleFace[i] == kNone) continue;
    m_visible.assign(1, conflicts.visibleFace[i]);
    m_isVisible[conflicts.visibleFace[i]] = 1;
    for (std::size_t k = 0; k < m_visible.size(); ++k)
      for (const std::uint32_t other : m_faces[m_visible[k]].neighbours)
        if (!m_isVisible[other] && isVisibleFrom(points[i], other))
          m_isVisible[other] = 1, m_visible.push_back(other);
    addVisible(points[i]);
    for (const std::uint32_t f : m_visible)
      for (const std::uint32_t point : conflicts.pointsOfFace[f])
        conflicts.visibleFace[point] = kNone;
    conflicts.pointsOfFace.resize(m_faces.size());
    for (const auto& [face, removed] : m_newFaces) {
      const OrientedPlane plane(corner(face, 0), corner(face, 1), corner(face, 2));
      ++made;
      for (const std::uint32_t from : {removed, m_faces[face].neighbours[0]})
        for (const std::uint32_t point : conflicts.pointsOfFace[from]) test(point, plane, face);
    }
    for (const std::uint32_t f : m_visible) conflicts.pointsOfFace[f].clear();
    removeVisible();
  }
}

/// Makes new faces from the last point to those edges of a visible face that are on the horizon.
/// Returns the last new face.
std::uint32_t Polytope::addHorizonFaces(std::uint32_t face, std::uint32_t last) {
  const auto p = static_cast<std::uint32_t>(m_points.size() - 1);
  for (std::size_t i = 0; i < 3; ++i) {
    const Face old = m_faces[face];
    const std::uint32_t u = old.corners[i], v = old.corners[(i + 1) % 3],
                        behind = old.neighbours[i];
    if (m_isVisible[behind]) continue;
    const std::uint32_t added = newFace({u, v, p}, {behind, kNone, kNone});
    m_next[u] = added;
    m_newFaces.push_back({added, face});
    for (std::size_t k = 0; k < 3; ++k)
      if (m_faces[behind].corners[k] == v && m_faces[behind].corners[(k + 1) % 3] == u)
        m_faces[behind].neighbours[k] = added;
    last = added;
  }
  return last;
}

/// Removes the entries of removed faces and of points that are not corners. Returns the faces' new
/// numbers.
std::vector<std::uint32_t> Polytope::compact() {
  Buffer<Face> faces;
  Buffer<Plane> planes;
  std::vector<std::uint32_t> newFaceNumber(m_faces.size(), kNone),
      newPointNumber(m_points.size(), kNone);
  std::vector<Vector3d> points;
  for (std::uint32_t f = 0; f < m_faces.size(); ++f) {
    if (m_planes[f].face == kNone) continue;
    newFaceNumber[f] = static_cast<std::uint32_t>(faces.size());
    faces.push_back(m_faces[f]);
    planes.push_back(m_planes[f]);
    planes.back().face = newFaceNumber[f];
  }
  for (Face& face : faces)
    for (std::size_t i = 0; i < 3; ++i) {
      face.neighbours[i] = newFaceNumber[face.neighbours[i]];
      std::uint32_t& place = newPointNumber[face.corners[i]];
      if (place == kNone) {
        place = static_cast<std::uint32_t>(points.size());
        points.push_back(m_points[face.corners[i]]);
      }
      face.corners[i] = place;
    }
  m_faces.swap(faces);
  m_planes.swap(planes);
  m_points.swap(points);
  return newFaceNumber;
}

/// Reduces the hull with an apex beside the plane to a plate: its base, from both sides.
void Polytope::reduceToPlate(std::uint32_t apex) {
  const auto isBase = [&](std::uint32_t f) {
    const auto& [a, b, c] = m_faces[f].corners;
    return m_planes[f].face != kNone && a != apex && b != apex && c != apex;
  };
  const auto count = static_cast<std::uint32_t>(m_faces.size());
  std::vector<std::uint32_t> back(count, kNone);
  m_free.clear();
  for (std::uint32_t f = 0; f < count; ++f) {
    if (!isBase(f)) continue;
    const auto [a, b, c] = m_faces[f].corners;
    back[f] = newFace({a, c, b}, {});
  }
  Buffer<Plane> border;
  for (std::uint32_t f = 0; f < count; ++f) {
    if (!isBase(f)) continue;
    for (std::size_t i = 0; i < 3; ++i) {
      std::uint32_t& neighbour = m_faces[f].neighbours[i];
      std::uint32_t& behind = m_faces[back[f]].neighbours[2 - i];
      if (isBase(neighbour)) {
        behind = back[neighbour];
        continue;
      }
      neighbour = back[f];
      behind = f;
      const Vector3d &u = corner(f, static_cast<int>(i)),
                     &v = corner(f, static_cast<int>(i + 1) % 3);
      const Vector3d out = directionOf(v - u).cross(m_planes[f].normal).normalized();
      border.push_back({out, dot(out, u), f});
    }
  }
  for (std::uint32_t f = 0; f < count; ++f)
    if (!isBase(f)) m_planes[f].face = kNone;
  const std::vector<std::uint32_t> newFaceNumber = compact();
  for (Plane& plane : border) plane.face = newFaceNumber[plane.face];
  m_planes.insert(m_planes.end(), border.begin(), border.end());
}

}  // namespace palpate
