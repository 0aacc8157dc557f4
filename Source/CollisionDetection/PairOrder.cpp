#include "CollisionDetection/PairOrder.h"

#include "DistanceField/FieldContacts.h"
#include "Math/StableLength.h"
#include "Math/Tolerances.h"
#include "Core/Assert.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <tuple>

namespace palpate {

namespace {

using Eigen::AlignedBox3d;
using Eigen::Vector3d;

AlignedBox3d grown(const AlignedBox3d& box, double distance) {
  const Vector3d margin = Vector3d::Constant(distance);
  return box.isEmpty() ? box : AlignedBox3d(box.min() - margin, box.max() + margin);
}

/// The points of a shape, but a plane, are within its radius of its corners' hull. Corners move
/// linearly.
AlignedBox3d boxOf(const Shape& shape) {
  PALPATE_ASSERT(!shape.isPlane() && !shape.corners().empty());
  AlignedBox3d box;
  for (const Vector3d& corner : shape.corners()) box.extend(corner);
  return grown(box, shape.radius());
}

AlignedBox3d boxOf(const Positions& end) {
  const AlignedBox3d& box = end.bounds();
  if (box.isEmpty() || !end.isPlaced()) return box;
  const Vector3d centre = end.transform()(box.center()),
                 half = end.transform().rotation.cwiseAbs() * (0.5 * box.sizes());
  return {centre - half, centre + half};
}

AlignedBox3d boxOf(const Body& body, bool ofStep) {
  const TriangleMesh& mesh = body.mesh;
  const auto atEnd = [&](const Positions& end, const Shape* shape) {
    return shape            ? boxOf(*shape)
           : body.isField() ? PlacedField(*body.field, end).domain()
                            : grown(boxOf(end), mesh.largestRadius);
  };
  AlignedBox3d box = atEnd(mesh.now, body.shape ? &body.shape->now : nullptr);
  if (ofStep) box.extend(atEnd(mesh.before, body.shape ? &body.shape->before : nullptr));
  return box;
}

/// L: the largest coordinate.
double largestOf(const AlignedBox3d& box) {
  return std::max(box.min().cwiseAbs().maxCoeff(), box.max().cwiseAbs().maxCoeff());
}

/// L: of a box, which encloses the step, from a plane. A plane that turns has no bound.
double distanceFrom(const PlacedShape& plane, const AlignedBox3d& box, bool ofStep) {
  const Shape &start = ofStep ? plane.before : plane.now, &end = plane.now;
  const Vector3d normal = end.axes().col(2);
  if (normal != start.axes().col(2)) return 0.0;
  const double half = normal.cwiseAbs().dot(0.5 * box.sizes()),
               atStart = normal.dot(box.center() - start.origin()),
               atEnd = normal.dot(box.center() - end.origin());
  const double least = std::min(atStart, atEnd), most = std::max(atStart, atEnd);
  return (end.isTwoSided() && most < 0.0 ? -most : least) - half;
}

double distanceOf(const AlignedBox3d& a, const AlignedBox3d& b) {
  const Vector3d gap = (a.min() - b.max()).cwiseMax(b.min() - a.max()).cwiseMax(Vector3d::Zero());
  return stableLength(gap);
}

std::int64_t highestPriority(std::span<PairRecord* const> records) {
  std::int64_t highest = std::numeric_limits<std::int64_t>::min();
  for (const PairRecord* record : records)
    highest = std::max(highest, std::int64_t{record->pair.settings.priority});
  return highest;
}

}  // namespace

double distanceBoundOf(const PairRecord& record) {
  const Body &a = record.a->body, &b = record.b->body;
  const Method method = record.pair.settings.method;
  const bool ofStep = method == Method::Continuous || method == Method::Auto;
  if (&a == &b) return 0.0;
  const auto isPlane = [](const Body& body) { return body.shape && body.shape->now.isPlane(); };
  const Body *plane = isPlane(a) ? &a : isPlane(b) ? &b : nullptr, *other = plane == &a ? &b : &a;
  if (plane && isPlane(*other)) return 0.0;
  const AlignedBox3d box = boxOf(*other, ofStep);
  if (box.isEmpty()) return std::numeric_limits<double>::infinity();
  double distance = 0.0, size = largestOf(box);
  if (plane) {
    distance = distanceFrom(*plane->shape, box, ofStep);
    size += plane->shape->now.magnitude() + plane->shape->before.magnitude();
  } else {
    const AlignedBox3d ofB = boxOf(b, ofStep);
    if (ofB.isEmpty()) return std::numeric_limits<double>::infinity();
    distance = distanceOf(box, ofB);
    size += largestOf(ofB);
  }
  return std::max(0.0, distance - 2.0 * kShapeBoundError * size);
}

void orderByUrgency(std::span<PairRecord*> records) {
  for (PairRecord* record : records)
    record->memory.urgency.distanceBound = distanceBoundOf(*record);
  const std::int64_t highest = highestPriority(records);
  const auto rank = [highest](const PairRecord& record) {
    const Validity& last = record.last.data.validity();
    const std::int64_t age = record.memory.urgency.yields ? 0 : last.age,
                       priority = record.pair.settings.priority;
    const bool isLower = record.memory.urgency.yields || priority < highest;
    const bool isApart =
        last.atEnd + last.atImpact == 0 && record.last.data.intersectingTriangles().empty();
    const double distance =
        std::min(record.memory.urgency.distanceBound, std::numeric_limits<double>::max());
    return std::tuple(isLower, -age, -priority, isApart, distance - record.question->plan.motion,
                      record.index);
  };
  std::sort(records.begin(), records.end(),
            [&](const PairRecord* l, const PairRecord* r) { return rank(*l) < rank(*r); });
}

const PairRecord* findExceeding(std::span<PairRecord* const> records) {
  const std::int64_t highest = highestPriority(records);
  const auto unfinished =
      std::find_if(records.begin(), records.end(),
                   [](const PairRecord* record) { return record->memory.urgency.isUnfinished; });
  if (unfinished == records.end()) return nullptr;
  const auto isHighest = [highest](const PairRecord* record) {
    return record->pair.settings.priority == highest;
  };
  const bool hadAll =
      unfinished == records.begin() ||
      (!isHighest(*unfinished) && std::all_of(records.begin(), unfinished, isHighest));
  return hadAll ? *unfinished : nullptr;
}

}  // namespace palpate
