#include "Math/ImpactQuery.h"
#include "Math/RelativeMotion.h"
#include "Math/Tolerances.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace palpate {

namespace {

using Kind = ImpactQuery::Kind;

/// Until then some coordinate certainly keeps the features further apart than the distance. What
/// only nearly comes so close is not found before: whoever compared boxes over part of the step
/// may have left it out.
template <Kind kind>
double boxesSeparateUntil(const RelativeMotion<kind>& motion, double distance) {
  double latest = 0.0;
  for (int k = 0; k < 3; ++k)
    for (const double side : {1.0, -1.0}) {
      double until = 1.0;
      for (const auto& ends : motion.corner) {
        const double first = side * ends[0][k], last = side * ends[1][k];
        const double needed =
            distance + kApproachBoxError * (std::max(std::abs(first), std::abs(last)) + distance);
        if (!(first > needed))
          until = 0.0;
        else if (!(last > needed))
          until = std::min(until, (first - needed) / (first - last) * (1.0 - 0x1p-50));
      }
      latest = std::max(latest, until);
    }
  return latest;
}

/// Covers the step from then on with times at which the features are certainly further apart than
/// the distance: what a fixed direction separates at one time it separates for a while before and
/// after. Where they are within distance + slack an impact is reported, and from then on only
/// earlier times matter. Pieces after upTo are left out, which changes nothing before it.
template <Kind kind>
ImpactAnswer find(const ImpactQuery& query, double distance, double tolerance, double upTo) {
  const RelativeMotion<kind> motion(query);
  const double start = boxesSeparateUntil(motion, distance);
  if (start > upTo || start == 1.0) return {};
  const Eigen::Vector3d largest = motion.largestDifference();
  double displacement = 0.0;
  for (const auto& ends : motion.corner)
    displacement = std::max(displacement, (ends[1] - ends[0]).norm());
  const double near =
      distance + tolerance * displacement + kApproachSlack * (largest.maxCoeff() + distance);

  // Most have nothing to fear before upTo: one direction that keeps them apart by more than any
  // time looked at below would ask for.
  const double half = 0.5 * (start + upTo);
  if (upTo < 1.0 && separatedAround(half, motion, largest, bestSeparation(motion, half),
                                    near * (1.0 + kApproachSlack))
                        .holds({start, upTo}))
    return {};

  // What is left, later pieces first. With slack, each cover is at least `tolerance` wide and
  // usually far wider; the limits bound the time whatever the motion, and report an impact where
  // they are met.
  constexpr int kMostPieces = 64, kMostSteps = 4096;
  std::array<Interval, kMostPieces> pieces;
  int count = 0;
  pieces[count++] = {start, 1.0};
  ImpactAnswer answer;
  for (int step = 0; count > 0; ++step) {
    const Interval piece = pieces[--count];
    if (piece.low > upTo) return {};
    const double t = 0.5 * (piece.low + piece.high);
    const Separation separation = bestSeparation(motion, t);
    const Interval clear = separatedAround(t, motion, largest, separation, distance);
    if (step == kMostSteps || count + 2 > kMostPieces) return {true, false, piece.low};
    if (clear.empty() || separation.distance <= near) {
      if (piece.high - piece.low <= tolerance) return {true, false, piece.low};
      answer = {true, false, t};
      count = 0;
      pieces[count++] = {piece.low, t};
    } else {
      if (clear.high < piece.high) pieces[count++] = {clear.high, piece.high};
      if (clear.low > piece.low) pieces[count++] = {piece.low, clear.low};
    }
  }
  return answer;
}

/// A power of two that brings the largest coordinate near 1 where it is so large or small that
/// products of differences would leave the range of doubles, else 1.
double scaleFor(const ImpactQuery& query) {
  double largest = 0.0;
  for (const auto& vertex : query.vertices)
    for (int end = 0; end < 2; ++end)
      largest = std::max(largest, vertex.at(end).cwiseAbs().maxCoeff());
  if (largest == 0.0 || (largest > 0x1p-100 && largest < 0x1p100)) return 1.0;
  return std::ldexp(1.0, -std::clamp(std::ilogb(largest), -1000, 1000));
}

}  // namespace

ImpactAnswer findApproach(const ImpactQuery& query, double distance, double tolerance,
                          double upTo) {
  const double scale = scaleFor(query);
  std::array<Eigen::Vector3d, 8> positions;
  ImpactQuery scaled{query.kind, {}};
  for (int i = 0; i < 4; ++i) {
    for (int end = 0; end < 2; ++end) positions[2 * i + end] = scale * query.vertices[i].at(end);
    scaled.vertices[i] = {&positions[2 * i], &positions[2 * i + 1]};
  }
  distance *= scale;
  return query.kind == Kind::VertexTriangle
             ? find<Kind::VertexTriangle>(scaled, distance, tolerance, upTo)
             : find<Kind::EdgeEdge>(scaled, distance, tolerance, upTo);
}

}  // namespace palpate
