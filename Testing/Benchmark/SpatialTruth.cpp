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

/// Of one case: the true value of each element, the limit of a list, and whether the point is
/// inside.
struct Truth {
  std::vector<Real> values;
  Real limit = 0;
  bool inside = false;
};

Truth truthOf(SpatialQuery query, const SpatialCase& asked, const ShapeSizes& sizes,
              const Body& body) {
  const Real3 p = asked.point.cast<Real>();
  switch (query) {
    case SpatialQuery::Closest:
    case SpatialQuery::EightNearest:
      return {distancesTo(body, p)};
    case SpatialQuery::SignedDistance:
      return {distancesTo(body, p), 0, isInside(body, p)};
    case SpatialQuery::Contains:
      return {{}, 0, isInside(body, p)};
    case SpatialQuery::FirstHit: {
      const Real3 d = asked.direction.cast<Real>();
      return {body.each([&](const Real3& a, const Real3& b, const Real3& c) {
        const Real t = lineHit<Real>(p, d, a, b, c);
        return t >= 0 ? t : kNone;
      })};
    }
    case SpatialQuery::AllHits: {
      const Real3 d = asked.direction.cast<Real>();
      return {body.each([&](const Real3& a, const Real3& b, const Real3& c) {
        return lineHit<Real>(p, d, a, b, c) >= 0 ? Real(-1) : kNone;
      })};
    }
    case SpatialQuery::Ball:
      return {distancesTo(body, p), sizes.ball};
    case SpatialQuery::Capsule: {
      const Real3 half = asked.rotation.col(0).cast<Real>() * Real(sizes.capsuleLength) / 2;
      return {body.each([&](const Real3& a, const Real3& b, const Real3& c) {
                return std::sqrt(segmentTriangleDistanceSquared<Real>(p - half, p + half, a, b, c));
              }),
              sizes.capsuleRadius};
    }
    case SpatialQuery::Box: {
      const Eigen::Matrix<Real, 3, 3> toBox = asked.rotation.transpose().cast<Real>();
      const Real3 half = sizes.boxHalf.cast<Real>();
      return {body.each([&](const Real3& a, const Real3& b, const Real3& c) {
        return boxGap<Real>(half, toBox * (a - p), toBox * (b - p), toBox * (c - p), kNone);
      })};
    }
  }
  return {};
}

/// The k nearest elements.
void checkNearest(const SpatialAnswers& answers, std::size_t first, std::size_t k,
                  const Truth& truth, Real tolerance, SpatialErrors& errors) {
  std::vector<Real> sorted = truth.values;
  std::partial_sort(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(k), sorted.end());
  for (std::size_t i = 0; i < k; ++i) {
    const std::uint32_t element = answers.elements[first + i];
    ++errors.of;
    if (sorted[i] == kNone || element >= sorted.size()) {
      errors.wrong += (sorted[i] == kNone) != (element >= sorted.size());
      continue;
    }
    const Real best = truth.inside ? -sorted[i] : sorted[i];
    errors.widest =
        std::max(errors.widest, static_cast<double>(std::abs(answers.values[first + i] - best)));
    errors.wrong += !(truth.values[element] <= sorted[i] + tolerance);
  }
}

void checkList(std::span<const std::uint32_t> found, const Truth& truth, Real tolerance,
               SpatialErrors& errors) {
  std::vector<char> in(truth.values.size());
  for (const std::uint32_t element : found) {
    errors.wrong += in[element] != 0 || truth.values[element] > truth.limit + tolerance;
    in[element] = 1;
  }
  for (std::size_t i = 0; i < in.size(); ++i) {
    const bool should = truth.values[i] < truth.limit - tolerance;
    errors.of += should;
    errors.wrong += should && !in[i];
  }
}

}  // namespace

std::vector<SpatialErrors> errorsOf(SpatialQuery query, std::span<const SpatialCase> cases,
                                    const ShapeSizes& sizes,
                                    std::span<const SpatialAnswers> ofEngines,
                                    const std::vector<Triangle>& triangles,
                                    const std::vector<Eigen::Vector3d>& positions,
                                    double tolerance) {
  std::vector<SpatialErrors> errors(ofEngines.size());
  for (std::size_t i = 0; i < cases.size(); ++i) {
    const Truth truth = truthOf(query, cases[i], sizes, {triangles, positions});
    for (std::size_t e = 0; e < ofEngines.size(); ++e) {
      const SpatialAnswers& answers = ofEngines[e];
      if (answers.values.empty() && answers.ends.empty()) continue;
      switch (query) {
        case SpatialQuery::Contains:
          ++errors[e].of;
          errors[e].wrong += (answers.values[i] != 0) != truth.inside;
          break;
        case SpatialQuery::AllHits:
        case SpatialQuery::Ball:
        case SpatialQuery::Capsule:
        case SpatialQuery::Box: {
          const std::size_t first = i > 0 ? answers.ends[i - 1] : 0;
          checkList(std::span(answers.elements).subspan(first, answers.ends[i] - first), truth,
                    tolerance, errors[e]);
          break;
        }
        default: {
          const std::size_t k = query == SpatialQuery::EightNearest ? 8 : 1;
          checkNearest(answers, k * i, k, truth, tolerance, errors[e]);
        }
      }
    }
  }
  return errors;
}

}  // namespace palpate::benchmark
