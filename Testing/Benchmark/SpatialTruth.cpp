#include "SpatialTruth.h"

#include "TriangleGeometry.h"

#include <limits>

namespace palpate::benchmark {
namespace {

using Real = long double;
using Real3 = Vector<Real>;
constexpr Real kNone = std::numeric_limits<Real>::infinity();

struct Body {
  const std::vector<Triangle>& triangles;
  const std::vector<Eigen::Vector3d>& positions;

  Real3 at(std::uint32_t vertex) const { return positions[vertex].cast<Real>(); }
  /// The value of f(a, b, c) for each triangle.
  template <class F>
  std::vector<Real> each(F&& f) const {
    std::vector<Real> values;
    for (const Triangle& t : triangles) values.push_back(f(at(t[0]), at(t[1]), at(t[2])));
    return values;
  }
};

std::vector<Real> distancesTo(const Body& body, const Real3& p) {
  return body.each([&](const Real3& a, const Real3& b, const Real3& c) {
    return std::sqrt(closestOnTriangle<Real>(p, a, b, c).distanceSquared);
  });
}

/// By the solid angles of the triangles (van Oosterom, Strackee 1983).
bool isInside(const Body& body, const Real3& p) {
  Real sum = 0;
  for (const Real half : body.each([&](Real3 a, Real3 b, Real3 c) {
         a -= p, b -= p, c -= p;
         const Real la = a.norm(), lb = b.norm(), lc = c.norm();
         return std::atan2(a.dot(b.cross(c)),
                           la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
       }))
    sum += half;
  return std::abs(sum) > 3;  // 2 pi inside, 0 outside
}

class Check {
 public:
  Check(Real tolerance, SpatialErrors& errors) : m_tolerance(tolerance), m_errors(errors) {}

  /// One nearest element: its value, and the true values of all elements. sign: -1 or 1.
  void nearest(double value, std::uint32_t element, const std::vector<Real>& truth, Real best,
               Real sign = 1) {
    ++m_errors.of;
    const bool none = best == kNone;
    if (none || element >= truth.size()) {
      m_errors.wrong += none != (element >= truth.size());
      return;
    }
    m_errors.widest = std::max(m_errors.widest, static_cast<double>(std::abs(value - sign * best)));
    m_errors.wrong += !(truth[element] <= best + m_tolerance);
  }

  /// The elements whose value is at most the limit.
  void list(std::span<const std::uint32_t> found, const std::vector<Real>& truth, Real limit) {
    std::vector<char> in(truth.size());
    for (const std::uint32_t element : found) {
      m_errors.wrong += in[element] != 0 || truth[element] > limit + m_tolerance;
      in[element] = 1;
    }
    for (std::size_t i = 0; i < truth.size(); ++i) {
      const bool should = truth[i] < limit - m_tolerance;
      m_errors.of += should;
      m_errors.wrong += should && !in[i];
    }
  }

 private:
  Real m_tolerance;
  SpatialErrors& m_errors;
};

}  // namespace

SpatialErrors errorsOf(SpatialQuery query, std::span<const SpatialCase> cases,
                       const ShapeSizes& sizes, const SpatialAnswers& answers,
                       const std::vector<Triangle>& triangles,
                       const std::vector<Eigen::Vector3d>& positions, double tolerance) {
  const Body body{triangles, positions};
  SpatialErrors errors;
  Check check(tolerance, errors);
  for (std::size_t i = 0; i < cases.size(); ++i) {
    const SpatialCase& asked = cases[i];
    const Real3 p = asked.point.cast<Real>();
    const auto found = [&] {
      const std::size_t first = i ? answers.ends[i - 1] : 0;
      return std::span(answers.elements).subspan(first, answers.ends[i] - first);
    };
    switch (query) {
      case SpatialQuery::Closest:
      case SpatialQuery::SignedDistance: {
        const auto truth = distancesTo(body, p);
        const bool inside = query == SpatialQuery::SignedDistance && isInside(body, p);
        check.nearest(answers.values[i], answers.elements[i], truth,
                      *std::min_element(truth.begin(), truth.end()), inside ? -1 : 1);
        break;
      }
      case SpatialQuery::Contains:
        ++errors.of;
        errors.wrong += (answers.values[i] != 0) != isInside(body, p);
        break;
      case SpatialQuery::FirstHit: {
        const Real3 d = asked.direction.cast<Real>();
        const auto truth = body.each([&](const Real3& a, const Real3& b, const Real3& c) {
          const Real t = lineHit<Real>(p, d, a, b, c);
          return t >= 0 ? t : kNone;
        });
        check.nearest(answers.values[i], answers.elements[i], truth,
                      *std::min_element(truth.begin(), truth.end()));
        break;
      }
      case SpatialQuery::EightNearest: {
        const auto truth = distancesTo(body, p);
        auto sorted = truth;
        std::partial_sort(sorted.begin(), sorted.begin() + 8, sorted.end());
        for (std::size_t k = 0; k < 8; ++k)
          check.nearest(answers.values[8 * i + k], answers.elements[8 * i + k], truth, sorted[k]);
        break;
      }
      case SpatialQuery::Ball:
        check.list(found(), distancesTo(body, p), sizes.ball);
        break;
      case SpatialQuery::Capsule: {
        const Real3 half = asked.rotation.col(0).cast<Real>() * Real(sizes.capsuleLength) / 2;
        check.list(found(), body.each([&](const Real3& a, const Real3& b, const Real3& c) {
          return std::sqrt(segmentTriangleDistanceSquared<Real>(p - half, p + half, a, b, c));
        }),
                   sizes.capsuleRadius);
        break;
      }
      case SpatialQuery::Box: {
        const Eigen::Matrix<Real, 3, 3> toBox = asked.rotation.transpose().cast<Real>();
        check.list(found(), body.each([&](const Real3& a, const Real3& b, const Real3& c) {
          return boxGap<Real>(sizes.boxHalf.cast<Real>(), toBox * (a - p), toBox * (b - p),
                              toBox * (c - p), kNone);
        }),
                   0);
        break;
      }
    }
  }
  return errors;
}

}  // namespace palpate::benchmark
