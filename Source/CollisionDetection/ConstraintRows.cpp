#include <palpate/ConstraintRows.h>
#include <palpate/Error.h>

#include "CollisionDetection/PairResults.h"
#include "CollisionDetection/PairTable.h"
#include "CollisionDetection/StepRows.h"
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

/// On which side each of a contact's four vertices is: 0, the pair's first geometry, or 1.
using Sides = std::array<std::size_t, 4>;
constexpr Sides kVertexOfFirst{0, 1, 1, 1}, kVertexOfSecond{1, 0, 0, 0}, kEdges{0, 0, 1, 1};

/// What each row of a contact with vertices on both sides says at the step's end at least, in the
/// order of the rows.
class EndGaps {
 public:
  explicit EndGaps(const Contents* contents)
      : m_gaps(contents ? std::span<const double>(contents->step.endGaps)
                        : std::span<const double>()) {}
  double next() {
    return m_next < m_gaps.size() ? m_gaps[m_next++] : -std::numeric_limits<double>::infinity();
  }

 private:
  const std::span<const double> m_gaps;
  std::size_t m_next = 0;
};

/// Appends the rows of all lists. first: the solver's numbers of vertex 0 of both sides.
/// of(contact, normal, stencil, sides): the offset of a contact with vertices on both sides.
/// ofShape(contact, normal): of one with a shape. If these throw, no row is added.
template <class Of, class OfShape>
void addRows(const CollisionData& contacts, const std::array<std::uint32_t, 2>& first,
             std::size_t sideOfElements, std::vector<ConstraintRow>& rows, Of&& of,
             OfShape&& ofShape) {
  const std::size_t initialSize = rows.size();
  // Calls f(contact, normal) with the smooth normals if there are any.
  const auto forEach = [](const auto& list, std::span<const Vector3d> smooth, auto&& f) {
    for (std::size_t i = 0; i < list.size(); ++i)
      f(list[i], smooth.empty() ? list[i].normal : smooth[i]);
  };
  const auto add = [&](const Sides& sides) {
    return [&](const auto& contact, const Vector3d& normal) {
      const Stencil s = stencil(contact);
      ConstraintRow row{s.vertices, s.weights, normal, of(contact, normal, s, sides)};
      for (std::size_t i = 0; i < 4; ++i) row.vertices[i] += first[sides[i]];
      rows.push_back(row);
    };
  };
  try {
    forEach(contacts.vertexTriangle(), contacts.smoothVertexTriangle(), add(kVertexOfFirst));
    forEach(contacts.triangleVertex(), contacts.smoothTriangleVertex(), add(kVertexOfSecond));
    forEach(contacts.edgeEdge(), contacts.smoothEdgeEdge(), add(kEdges));
    forEach(contacts.shape(), contacts.smoothShape(), [&](const auto& contact, const auto& normal) {
      const auto& [i, j, k] = contact.vertices;
      const double offset = ofShape(contact, normal);
      const std::uint32_t number = first[sideOfElements];
      rows.push_back({{number + i, number + j, number + k, number + i},
                      {contact.weights[0], contact.weights[1], contact.weights[2], 0.0},
                      normal,
                      offset});
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
  if (!record.dataVersion.isValid()) return false;
  const PairRecord::State& state = record.dataVersion.state();
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
  StepOffsets(const PairRecord& record, const Contents& contents)
      : m_sides{record.a, record.b},
        m_body(motionOf(*m_sides[contents.step.elementsOfSecond ? 0 : 1])),
        m_endGaps(&contents) {}

  double operator()(const auto& contact, const Vector3d& normal, const Stencil& stencil,
                    const Sides& sides) {
    const auto at = [&](std::size_t side, std::uint32_t vertex) {
      const Geometry& geometry = *m_sides[side];
      return std::pair<Vector3d, Vector3d>(geometry.body.mesh.before[vertex],
                                           geometry.step.detected()[vertex]);
    };
    const double offset =
        normal.dot(sumOf(stencil, sides, contact.timeOfImpact, at)) - contact.distance;
    return std::min(offset, normal.dot(sumOf(stencil, sides, 1.0, at)) - m_endGaps.next());
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
  EndGaps m_endGaps;
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
  StepOffsets offsets(*record, contents);
  CountedVector<double>& kept = contents.step.offsets;
  kept.clear();
  kept.reserve(sizeOf(contents));
  const auto keep = [&](const auto& list, const auto& smooth, auto&& of) {
    for (std::size_t i = 0; i < list.size(); ++i)
      kept.push_back(of(list[i], smooth.empty() ? list[i].normal : smooth[i]));
  };
  const auto with = [&](const Sides& sides) {
    return [&](const auto& contact, const Vector3d& normal) {
      return offsets(contact, normal, stencil(contact), sides);
    };
  };
  const Contents::Smooth& smooth = contents.smooth;
  keep(contents.vertexTriangle, smooth.vertexTriangle, with(kVertexOfFirst));
  keep(contents.triangleVertex, smooth.triangleVertex, with(kVertexOfSecond));
  keep(contents.edgeEdge, smooth.edgeEdge, with(kEdges));
  keep(contents.shape, smooth.shape, offsets);
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
    return addRows(*this, first, sideOfElements, rows, offset, offset);
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
  StepOffsets offsets(*step.record, read());
  const auto ofShape = [&](const ShapeContact& contact, const Vector3d& normal) {
    return offsets(contact, normal);
  };
  addRows(*this, first, sideOfElements, rows, offsets, ofShape);
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
  const Contents* const contents = Contents::in(contacts);
  EndGaps endGaps(contents);
  const auto of = [&](const auto& contact, const Vector3d& normal, const Stencil& s,
                      const Sides& sides) {
    double largest = 0.0, moved = 0.0;
    const auto at = [&](std::size_t side, std::uint32_t vertex) {
      require(*both[side], vertex);
      return std::pair<const Vector3d&, const Vector3d&>(both[side]->before[vertex],
                                                         both[side]->now[vertex]);
    };
    const Vector3d sum = sumOf(s, sides, contact.timeOfImpact, at);
    for (std::size_t i = 0; i < 4; ++i) {
      const auto& [before, now] = at(sides[i], s.vertices[i]);
      largest = std::max({largest, before.cwiseAbs().maxCoeff(), now.cwiseAbs().maxCoeff()});
      moved += std::abs(s.weights[i]) * (now - before).cwiseAbs().sum();
    }
    checkOffset(contents->step, contents->errorBound, contact.normal.dot(sum) - contact.distance,
                largest, moved, s.vertices[0]);
    return std::min(normal.dot(sum) - contact.distance,
                    normal.dot(sumOf(s, sides, 1.0, at)) - endGaps.next());
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
  addRows(contacts, {a.first, b.first}, sideOfElements, rows, of, ofShape);
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
