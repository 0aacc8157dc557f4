#include <palpate/ConstraintRows.h>
#include <palpate/Error.h>

#include "CollisionDetection/PairTable.h"
#include "CollisionDetection/StepRows.h"
#include "Contact/ContactLists.h"
#include "Mesh/PointMotion.h"
#include "Mesh/Rotation.h"
#include "Math/Tolerances.h"
#include "Core/FloatingPoint.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <string>
#include <utility>

namespace palpate {

Stencil stencil(const EdgeEdgeContact& contact) {
  const StandardFloatingPoint standard;
  return standard.evaluated(
      Stencil{{contact.edgeA[0], contact.edgeA[1], contact.edgeB[0], contact.edgeB[1]},
              {1.0 - contact.weightA, contact.weightA, contact.weightB - 1.0, -contact.weightB}});
}

double ConstraintRow::gap(std::span<const Eigen::Vector3d> positions) const {
  const StandardFloatingPoint standard;
  for (const std::uint32_t vertex : vertices)
    if (vertex >= positions.size())
      throw Error(ErrorCode::WrongPositionCount,
                  "gap(): a row has vertex " + std::to_string(vertex) +
                      " of the solver, but there are " + std::to_string(positions.size()) +
                      " positions",
                  {}, vertex);
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < 4; ++i) sum += weights[i] * positions[vertices[i]];
  return standard.evaluated(normal.dot(sum) - offset);
}

namespace {

using Eigen::Vector3d;
using Contents = CollisionData::Contents;

using Sides = std::array<std::size_t, 4>;  // sidesOf()

/// A contact's row: linearised at its time, or, with `end`, at the step's end.
struct Linearised {
  Stencil stencil;
  Sides sides;
  Vector3d normal;
  const Contents::Step::EndRow* end;
};

/// Makes the rows of contacts with vertices on both sides, in their order.
class Linearisation {
 public:
  explicit Linearisation(const Contents& contents) : m_endRows(contents.step.endRows) {}
  /// smooth: null if the pair has no smooth normals.
  Linearised next(const auto& contact, const Sides& sides, const Vector3d* smooth) {
    const std::uint32_t number = m_next++;
    if (m_endRows.empty() || m_endRows.front().contact != number)
      return {stencil(contact), sides, smooth ? *smooth : contact.normal, nullptr};
    const Contents::Step::EndRow& row = m_endRows.front();
    m_endRows = m_endRows.subspan(1);
    return {row.stencil, sides, smooth ? *smooth : row.normal, &row};
  }

 private:
  std::span<const Contents::Step::EndRow> m_endRows;
  std::uint32_t m_next = 0;
};

/// Calls f(kind, contact, smooth normal or null) for all contacts that have rows.
template <class F>
void forEachWithSmooth(const Contents& contents, F&& f) {
  forEachContactList(contents, [&](auto kind, const auto& list) {
    if constexpr (kind != ContactKind::ShapeShape) {
      const auto& smooth = contents.columnsOf(kind).smooth;
      for (std::size_t i = 0; i < list.size(); ++i)
        f(kind, list[i], smooth.empty() ? nullptr : &smooth[i]);
    }
  });
}

/// Appends the rows of all lists. first: the solver's numbers of vertex 0 of both sides.
/// of(contact, row): the offset of a Linearised row of a contact with vertices on both sides.
/// ofShape(contact, normal): of one with a shape. If these throw, no row is added.
template <class Of, class OfShape>
void addRows(const Contents& contents, const std::array<std::uint32_t, 2>& first,
             std::size_t sideOfElements, std::vector<ConstraintRow>& rows, Of&& of,
             OfShape&& ofShape) {
  const std::size_t initialSize = rows.size();
  Linearisation linearisation(contents);
  const auto rowOf = [&](auto kind, const auto& contact, const Vector3d* smooth) -> ConstraintRow {
    if constexpr (kind == ContactKind::Shape) {
      const Vector3d& normal = smooth ? *smooth : contact.normal;
      const auto& [i, j, k] = contact.vertices;
      const std::uint32_t number = first[sideOfElements];
      return {{number + i, number + j, number + k, number + i},
              {contact.weights[0], contact.weights[1], contact.weights[2], 0.0},
              normal,
              ofShape(contact, normal)};
    } else {
      const Linearised own = linearisation.next(contact, sidesOf(kind), smooth);
      ConstraintRow row{own.stencil.vertices, own.stencil.weights, own.normal, of(contact, own)};
      for (std::size_t i = 0; i < 4; ++i) row.vertices[i] += first[own.sides[i]];
      return row;
    }
  };
  try {
    forEachWithSmooth(contents, [&](auto kind, const auto& contact, const Vector3d* smooth) {
      rows.push_back(rowOf(kind, contact, smooth));
    });
  } catch (...) {
    rows.erase(rows.begin() + static_cast<std::ptrdiff_t>(initialSize), rows.end());
    throw;
  }
}

/// The weighted sum of positions at a time. at(side, vertex): those before and now.
template <class At>
Vector3d sumOf(const Stencil& stencil, const Sides& sides, double time, At&& at) {
  Vector3d sum = Vector3d::Zero();
  for (std::size_t i = 0; i < 4; ++i) {
    const auto& [before, now] = at(sides[i], stencil.vertices[i]);
    sum += stencil.weights[i] * ((1 - time) * before + time * now);
  }
  return sum;
}

/// The offset of a row. at(side, vertex): the positions before and now.
template <class At>
double offsetOf(const auto& contact, const Linearised& row, At&& at) {
  const double time = row.end ? 1.0 : contact.timeOfImpact;
  return row.normal.dot(sumOf(row.stencil, row.sides, time, at)) -
         (row.end ? row.end->gap : contact.distance);
}

/// body: the motion of the shape, or of the field's body.
double offsetOf(const ShapeContact& contact, const Vector3d& normal, const RigidMotion& body) {
  const double time = contact.timeOfImpact;
  const Vector3d rest =
      (1 - time) * displacementAt(body.before, body.now, contact.pointOnShape, time);
  return normal.dot(contact.point + rest) - contact.distance;
}

/// Whether the ends of the step are those for which the pair's answer holds. Positions now may have
/// been corrected since.
bool isInStep(const PairRecord& record) {
  if (!record.last.version.isValid()) return false;
  const PairState& state = record.last.version.state();
  const auto isOf = [](const BodyState& found, const Geometry& geometry) {
    return found.elements.topology == geometry.body.revisions.elements.topology &&
           found.before == geometry.body.mesh.before.state() &&
           found.now == geometry.step.detected().state();
  };
  return isOf(state.a, *record.a) && isOf(state.b, *record.b);
}

/// The offsets of rows with the positions of a pair's step. isInStep().
class StepOffsets {
 public:
  StepOffsets(const PairRecord& record, bool elementsOfSecond)
      : m_sides{record.a, record.b}, m_body(motionOf(*m_sides[elementsOfSecond ? 0 : 1])) {}

  double operator()(const auto& contact, const Linearised& row) const {
    return offsetOf(contact, row, [&](std::size_t side, std::uint32_t vertex) {
      const Geometry& geometry = *m_sides[side];
      return std::pair<Vector3d, Vector3d>(geometry.body.mesh.before[vertex],
                                           geometry.step.detected()[vertex]);
    });
  }
  double operator()(const ShapeContact& contact, const Vector3d& normal) const {
    return offsetOf(contact, normal, m_body);
  }

 private:
  static RigidMotion motionOf(const Geometry& geometry) {
    return {geometry.body.mesh.before.transform(), geometry.step.detected().transform()};
  }

  std::array<const Geometry*, 2> m_sides;
  RigidMotion m_body;
};

/// Throws unless the offset of a row is a sum of radii, which is the law of contacts.
/// largest: the largest coordinate of its positions, L; motion: the sum of their motions, L.
void checkOffset(const Contents::Step& step, double errorBound, double offset, double largest,
                 double motion, std::uint32_t vertex) {
  const double error = errorBound + step.timeTolerance * motion + kRowPositions * largest;
  // Not for NaN, which is in no step.
  if (offset >= -error && offset <= step.radii + error) return;
  throw Error(ErrorCode::InvalidCall,
              "appendRows(): these positions are not those of the detected step, as a contact of "
              "vertex " +
                  std::to_string(vertex) +
                  " is not at its distance with them: pass the positions before and now that the "
                  "detection had, or call CollisionData::appendRows()",
              {}, vertex);
}

}  // namespace

void keepOffsets(Contents& contents) {
  const PairRecord* const record = std::exchange(contents.step.record, nullptr);
  if (!record || !isInStep(*record)) return;
  const StandardFloatingPoint standard;
  const StepOffsets offsets(*record, contents.step.elementsOfSecond);
  CountedVector<double>& kept = contents.step.offsets;
  kept.clear();
  kept.reserve(contactCount(contents));
  Linearisation linearisation(contents);
  forEachWithSmooth(contents, [&](auto kind, const auto& contact, const Vector3d* normal) {
    if constexpr (kind == ContactKind::Shape)
      kept.push_back(offsets(contact, normal ? *normal : contact.normal));
    else
      kept.push_back(offsets(contact, linearisation.next(contact, sidesOf(kind), normal)));
  });
  contents.step.hasOffsets = true;
}

void CollisionData::appendRows(std::vector<ConstraintRow>& rows, std::uint32_t firstOfA,
                               std::uint32_t firstOfB) const {
  const StandardFloatingPoint standard;
  const Contents::Step& step = read().step;
  const std::array first{firstOfA, firstOfB};
  const std::size_t sideOfElements = step.elementsOfSecond ? 1 : 0;
  if (step.hasOffsets) {
    const double* next = step.offsets.data();
    const auto offset = [&](const auto&...) { return *next++; };
    return addRows(read(), first, sideOfElements, rows, offset, offset);
  }
  if (!step.record)
    throw Error(ErrorCode::NotAvailable,
                "appendRows(): the step of these contacts is not known, as they were made of "
                "Parts, or copied when the step was over: pass positions");
  if (!isInStep(*step.record))
    throw Error(ErrorCode::InvalidCall,
                "appendRows(): the step of these contacts of " +
                    nameOf(*step.record->a, *step.record->b) +
                    " is over: call it, or copy the CollisionData, after the detection and before "
                    "advance()",
                step.record->pair.a);
  const StepOffsets offsets(*step.record, step.elementsOfSecond);
  addRows(read(), first, sideOfElements, rows, offsets, offsets);
}

void appendRows(const CollisionData& contacts, const SolverVertices& a, const SolverVertices& b,
                std::vector<ConstraintRow>& rows, const RigidMotion& body) {
  const StandardFloatingPoint standard;
  const RigidMotion motion = withExactRotations(body);
  const std::array<const SolverVertices*, 2> both{&a, &b};
  const auto require = [&](const SolverVertices& side, std::uint32_t vertex) {
    if (vertex < side.before.size() && vertex < side.now.size()) return;
    throw Error(ErrorCode::WrongPositionCount,
                "appendRows(): a contact refers to vertex " + std::to_string(vertex) + " of " +
                    (&side == &a ? "a" : "b") + ", which has " +
                    std::to_string(side.before.size()) + " positions before and " +
                    std::to_string(side.now.size()) + " now",
                {}, vertex);
  };
  const Contents& contents = Contents::read(contacts);
  const auto at = [&](std::size_t side, std::uint32_t vertex) {
    require(*both[side], vertex);
    return std::pair<const Vector3d&, const Vector3d&>(both[side]->before[vertex],
                                                       both[side]->now[vertex]);
  };
  const auto of = [&](const auto& contact, const Linearised& row) {
    const Sides& sides = row.sides;
    const Linearised atTime{stencil(contact), sides, contact.normal, nullptr};
    double largest = 0.0, moved = 0.0;
    for (std::size_t i = 0; i < 4; ++i) {
      const auto& [before, now] = at(sides[i], atTime.stencil.vertices[i]);
      largest = std::max({largest, before.cwiseAbs().maxCoeff(), now.cwiseAbs().maxCoeff()});
      moved += std::abs(atTime.stencil.weights[i]) * (now - before).cwiseAbs().sum();
    }
    checkOffset(contents.step, contents.errorBound, offsetOf(contact, atTime, at), largest, moved,
                atTime.stencil.vertices[0]);
    return offsetOf(contact, row, at);
  };
  const auto isEmpty = [](const SolverVertices& side) {
    return side.before.empty() && side.now.empty();
  };
  if (!contacts.shape().empty() && !isEmpty(a) && !isEmpty(b))
    throw Error(ErrorCode::WrongPositionCount,
                "appendRows(): both sides have positions, but one of them is a shape, or a body "
                "whose distance field answered; leave that one empty");
  const std::size_t sideOfElements = isEmpty(a) ? 1 : 0;  // the other: the shape
  const auto ofShape = [&](const ShapeContact& contact, const Vector3d& normal) {
    for (const std::uint32_t vertex : contact.vertices) require(*both[sideOfElements], vertex);
    return offsetOf(contact, normal, motion);
  };
  addRows(contents, {a.first, b.first}, sideOfElements, rows, of, ofShape);
}

void forEachEntry(std::span<const ConstraintRow> rows, void (*entry)(void*, int, int, double),
                  void* context) {
  const StandardFloatingPoint standard;
  for (std::size_t r = 0; r < rows.size(); ++r) {
    for (std::size_t i = 0; i < 4; ++i) {
      if (rows[r].weights[i] == 0) continue;
      for (int axis = 0; axis < 3; ++axis) {
        entry(context, static_cast<int>(r), static_cast<int>(3 * rows[r].vertices[i] + axis),
              rows[r].weights[i] * rows[r].normal[axis]);
      }
    }
  }
}

}  // namespace palpate
