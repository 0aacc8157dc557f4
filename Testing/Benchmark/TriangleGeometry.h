#pragma once

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>

/// What a user of the baselines writes beside them, in any floating-point type: tests of one
/// triangle. The truth of the benchmark is the same in long double.
namespace palpate::benchmark {

template <class S>
using Vector = Eigen::Matrix<S, 3, 1>;

/// Barycentric weights of the closest point, and which feature holds it: bit i says that the weight
/// of corner i is not zero.
template <class S>
struct ClosestOnTriangle {
  Vector<S> weights;
  S distanceSquared;
  int feature;
};

template <class S>
ClosestOnTriangle<S> closestOnTriangle(const Vector<S>& p, const Vector<S>& a, const Vector<S>& b,
                                       const Vector<S>& c) {
  const Vector<S> ab = b - a, ac = c - a, ap = p - a;
  const auto result = [&](S u, S v, S w, int feature) {
    const Vector<S> offset = ap - v * ab - w * ac;
    return ClosestOnTriangle<S>{{u, v, w}, offset.squaredNorm(), feature};
  };
  const S d1 = ab.dot(ap), d2 = ac.dot(ap);
  if (d1 <= 0 && d2 <= 0) return result(1, 0, 0, 1);
  const Vector<S> bp = p - b;
  const S d3 = ab.dot(bp), d4 = ac.dot(bp);
  if (d3 >= 0 && d4 <= d3) return result(0, 1, 0, 2);
  const S vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) {
    const S v = d1 / (d1 - d3);
    return result(1 - v, v, 0, 3);
  }
  const Vector<S> cp = p - c;
  const S d5 = ab.dot(cp), d6 = ac.dot(cp);
  if (d6 >= 0 && d5 <= d6) return result(0, 0, 1, 4);
  const S vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) {
    const S w = d2 / (d2 - d6);
    return result(1 - w, 0, w, 5);
  }
  const S va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 >= d3 && d5 >= d6) {
    const S w = (d4 - d3) / ((d4 - d3) + (d5 - d6));
    return result(0, 1 - w, w, 6);
  }
  const S scale = 1 / (va + vb + vc), v = vb * scale, w = vc * scale;
  return result(1 - v - w, v, w, 7);
}

template <class S>
S segmentsDistanceSquared(const Vector<S>& p0, const Vector<S>& p1, const Vector<S>& q0,
                          const Vector<S>& q1) {
  const Vector<S> d = p1 - p0, e = q1 - q0, r = p0 - q0;
  const S dd = d.squaredNorm(), ee = e.squaredNorm(), de = d.dot(e), dr = d.dot(r), er = e.dot(r);
  const S determinant = dd * ee - de * de;
  S s = determinant > 0 ? std::clamp<S>((de * er - dr * ee) / determinant, 0, 1) : 0;
  S t = (de * s + er) / ee;
  if (t < 0 || t > 1) {
    t = std::clamp<S>(t, 0, 1);
    s = std::clamp<S>((de * t - dr) / dd, 0, 1);
  }
  return (r + s * d - t * e).squaredNorm();
}

/// t where the line origin + t direction meets the triangle, or -1 if it passes beside it.
template <class S>
S lineHit(const Vector<S>& origin, const Vector<S>& direction, const Vector<S>& a,
          const Vector<S>& b, const Vector<S>& c) {
  const Vector<S> ab = b - a, ac = c - a, h = direction.cross(ac), from = origin - a;
  const S determinant = ab.dot(h);
  if (determinant == 0) return -1;
  const S u = from.dot(h) / determinant;
  if (u < 0 || u > 1) return -1;
  const Vector<S> q = from.cross(ab);
  const S v = direction.dot(q) / determinant;
  if (v < 0 || u + v > 1) return -1;
  return ac.dot(q) / determinant;
}

template <class S>
S segmentTriangleDistanceSquared(const Vector<S>& p0, const Vector<S>& p1, const Vector<S>& a,
                                 const Vector<S>& b, const Vector<S>& c) {
  const S t = lineHit<S>(p0, p1 - p0, a, b, c);
  if (t >= 0 && t <= 1) return 0;
  return std::min(
      {closestOnTriangle<S>(p0, a, b, c).distanceSquared,
       closestOnTriangle<S>(p1, a, b, c).distanceSquared, segmentsDistanceSquared<S>(p0, p1, a, b),
       segmentsDistanceSquared<S>(p0, p1, b, c), segmentsDistanceSquared<S>(p0, p1, c, a)});
}

/// The width of the widest gap along the axes that can separate a triangle from a box around the
/// origin, times the axis's length; positive if they are apart. Ends at a gap beyond `enough`.
template <class S>
S boxGap(const Vector<S>& half, const Vector<S>& a, const Vector<S>& b, const Vector<S>& c,
         S enough) {
  S widest =
      ((a.cwiseMin(b).cwiseMin(c) - half).cwiseMax(-half - a.cwiseMax(b).cwiseMax(c))).maxCoeff();
  if (widest > enough) return widest;
  const Vector<S> edges[] = {b - a, c - b, a - c};
  const auto gap = [&](const Vector<S>& axis) {
    const S length = axis.norm();
    if (length == 0) return;
    const S pa = axis.dot(a), pb = axis.dot(b), pc = axis.dot(c);
    const S reach = axis.cwiseAbs().dot(half);
    widest = std::max(
        widest, std::max(std::min({pa, pb, pc}) - reach, -reach - std::max({pa, pb, pc})) / length);
  };
  gap(edges[0].cross(edges[1]));
  for (const Vector<S>& edge : edges) {
    if (widest > enough) return widest;
    gap({0, -edge[2], edge[1]});
    gap({edge[2], 0, -edge[0]});
    gap({-edge[1], edge[0], 0});
  }
  return widest;
}

}  // namespace palpate::benchmark
