#pragma once

#include <gmpxx.h>

#include <Eigen/Core>

#include <array>
#include <cstddef>

/// Whether triangles intersect, in whole numbers of any size and without a filter. It shares no
/// code with Source/.
namespace palpate::intersection {

using Integer = mpz_class;
using Vector = std::array<Integer, 3>;
using Corners = std::array<Vector, 3>;

inline Vector operator-(const Vector& l, const Vector& r) {
  return {l[0] - r[0], l[1] - r[1], l[2] - r[2]};
}
inline Vector operator+(const Vector& l, const Vector& r) {
  return {l[0] + r[0], l[1] + r[1], l[2] + r[2]};
}
inline Vector operator*(const Integer& s, const Vector& a) {
  return {s * a[0], s * a[1], s * a[2]};
}
inline Integer dot(const Vector& l, const Vector& r) {
  return l[0] * r[0] + l[1] * r[1] + l[2] * r[2];
}
inline Vector cross(const Vector& l, const Vector& r) {
  return {l[1] * r[2] - l[2] * r[1], l[2] * r[0] - l[0] * r[2], l[0] * r[1] - l[1] * r[0]};
}
inline bool isZero(const Vector& a) { return a[0] == 0 && a[1] == 0 && a[2] == 0; }

inline bool pointOnSegment(const Vector& p, const Vector& a, const Vector& b) {
  return isZero(cross(b - a, p - a)) && dot(p - a, p - b) <= 0;
}

inline bool segmentsIntersect(const Vector& p, const Vector& q, const Vector& r, const Vector& s) {
  const Vector u = q - p, v = s - r, w = r - p, normal = cross(u, v);
  if (isZero(normal))
    return pointOnSegment(p, r, s) || pointOnSegment(q, r, s) || pointOnSegment(r, p, q) ||
           pointOnSegment(s, p, q);
  const Integer along = dot(cross(w, v), normal), other = dot(cross(w, u), normal),
                most = dot(normal, normal);
  return dot(w, normal) == 0 && along >= 0 && along <= most && other >= 0 && other <= most;
}

/// For the point at `p` / `scale` in the triangle's plane; scale > 0.
inline bool holds(const Corners& t, const Vector& normal, const Vector& p, const Integer& scale) {
  for (int i = 0; i < 3; ++i)
    if (dot(cross(t[(i + 1) % 3] - t[i], p - scale * t[i]), normal) < 0) return false;
  return true;
}

inline bool segmentMeetsTriangle(const Vector& p, const Vector& q, const Corners& t) {
  const Vector normal = cross(t[1] - t[0], t[2] - t[0]);
  const Integer above = dot(normal, p - t[0]), below = dot(normal, q - t[0]);
  const bool hasArea = !isZero(normal);
  if (hasArea && above * below > 0) return false;
  if (hasArea && (above != 0 || below != 0)) {
    const Integer ofP = abs(below), ofQ = abs(above);
    return holds(t, normal, ofP * p + ofQ * q, ofP + ofQ);
  }
  if (hasArea && (holds(t, normal, p, 1) || holds(t, normal, q, 1))) return true;
  for (int i = 0; i < 3; ++i)
    if (segmentsIntersect(p, q, t[i], t[(i + 1) % 3])) return true;
  return false;
}

/// For finite positions: three corners of one triangle, then of the other.
inline bool trianglesIntersect(const std::array<Eigen::Vector3d, 6>& positions) {
  Integer scale = 1;
  for (const Eigen::Vector3d& p : positions)
    for (const double x : p) scale = lcm(scale, mpq_class(x).get_den());
  std::array<Corners, 2> t;
  for (std::size_t i = 0; i < 6; ++i)
    for (int k = 0; k < 3; ++k)
      t[i / 3][i % 3][k] = mpq_class(scale * mpq_class(positions[i][k])).get_num();
  for (int i = 0; i < 3; ++i)
    if (segmentMeetsTriangle(t[0][i], t[0][(i + 1) % 3], t[1]) ||
        segmentMeetsTriangle(t[1][i], t[1][(i + 1) % 3], t[0]))
      return true;
  return false;
}

}  // namespace palpate::intersection
