#include "CollisionDetection/GuardedTouches.h"

#include "Contact/ContactLists.h"
#include "Contact/Contents.h"
#include "Contact/MeshFeature.h"
#include "Math/ImpactQuery.h"
#include "Math/Nearing.h"
#include "Core/Assert.h"

#include <algorithm>
#include <cstddef>
#include <string>
#include <type_traits>

namespace palpate {

namespace {

using Eigen::Vector3d;

/// Fraction of the step: earlier times are computed again.
constexpr double kEarlyTime = 0x1p-12;

/// A contact of a list, with the geometries of its vertices.
template <class Contact>
struct Placed {
  const Contact& contact;
  const Geometry &first, &second;  ///< second: of the triangle, of edge b, or the shape
};
template <class Contact>
Placed(const Contact&, const Geometry&, const Geometry&) -> Placed<Contact>;

ImpactQuery::Step stepOf(const Geometry& geometry, std::uint32_t v) {
  return {geometry.body.mesh.before[v], geometry.body.mesh.now[v]};
}

/// How a point of a placed geometry moves in the step as it is now.
Vector3d displacementOf(const Geometry& geometry, const Vector3d& point) {
  const Pose &before = geometry.body.mesh.before.transform(),
             &now = geometry.body.mesh.now.transform();
  const Vector3d inBody = before.rotation.transpose() * (point - before.translation);
  return now(inBody) - before(inBody);
}

std::string elementOf(const Geometry& geometry, std::uint32_t index) {
  const GeometryType type = geometry.body.mesh.topology.type;
  const char* name = type == GeometryType::Lines    ? ", segment "
                     : type == GeometryType::Points ? ", point "
                                                    : ", triangle ";
  return nameOf(geometry) + name + std::to_string(index);
}
std::string edgeOf(const Geometry& geometry, const std::array<std::uint32_t, 2>& edge) {
  return nameOf(geometry) + ", edge (" + std::to_string(edge[0]) + ", " + std::to_string(edge[1]) +
         ")";
}

/// The features of a contact, for messages.
struct FeatureNames {
  std::string first, second;
  std::uint32_t element;  ///< of the first
};
FeatureNames namesOf(const Placed<VertexTriangleContact>& placed) {
  const std::uint32_t vertex = placed.contact.vertex;
  return {nameOf(placed.first) + ", vertex " + std::to_string(vertex),
          elementOf(placed.second, placed.contact.triangle), vertex};
}
FeatureNames namesOf(const Placed<EdgeEdgeContact>& placed) {
  const auto& [contact, first, second] = placed;
  return {edgeOf(first, contact.edgeA), edgeOf(second, contact.edgeB), contact.edgeA[0]};
}
FeatureNames namesOf(const Placed<ShapeContact>& placed) {
  const std::uint32_t id = placed.contact.id;
  return {elementOf(placed.first, id), nameOf(placed.second), id};
}
FeatureNames namesOf(const Placed<ShapeShapeContact>& placed) {
  return {nameOf(placed.first), nameOf(placed.second), 0};
}

/// Finds the touches of one pair.
class TouchFinder {
 public:
  TouchFinder(const GuardedParts& parts, std::span<const double> fractions,
              std::vector<GuardedTouch>& out)
      : m_parts(parts), m_fractions(fractions), m_out(out) {}

  void find(const SeparateSearch& search) {
    const Geometry &a = *search.a, &b = *search.b;
    forEachContactList(
        CollisionData::Contents::read(search.found.data), [&](ContactKind kind, const auto& list) {
          const bool swapped =
              kind == ContactKind::TriangleVertex || (kind == ContactKind::Shape && a.body.shape);
          for (const auto& contact : list) add(Placed{contact, swapped ? b : a, swapped ? a : b});
        });
  }

 private:
  template <class Contact>
  void add(const Placed<Contact>& placed) {
    const auto& [contact, first, second] = placed;
    GuardedTouch touch{{}, contact.timeOfImpact, contact.timeOfImpact == 0.0};
    touch.movers.fill({GuardedParts::kNone, 0.0});
    if constexpr (std::is_same_v<Contact, ShapeShapeContact>) {
      addMover(touch, first, kNoElement, contact.normal.dot(displacementOf(first, contact.pointA)));
      addMover(touch, second, kNoElement,
               -contact.normal.dot(displacementOf(second, contact.pointB)));
    } else if constexpr (std::is_same_v<Contact, ShapeContact>) {
      for (int i = 0; i < 3; ++i)
        addVertex(touch, first, contact.vertices[i], contact.weights[i], contact.normal);
      addMover(touch, second, kNoElement,
               -contact.normal.dot(displacementOf(second, contact.pointOnShape)));
    } else {
      if (contact.timeOfImpact < kEarlyTime && partsAtStart(placed, touch)) return;
      const Stencil of = stencil(contact);
      constexpr std::size_t kSecond = std::is_same_v<Contact, VertexTriangleContact> ? 1 : 2;
      for (std::size_t i = 0; i < 4; ++i)
        addVertex(touch, i < kSecond ? first : second, of.vertices[i], of.weights[i],
                  contact.normal);
    }
    if (std::none_of(touch.movers.begin(), touch.movers.end(), [&](const auto& mover) {
          return m_parts.isFree(mover.part) && m_fractions[mover.part] > 0.0;
        }))
      throwRemains(placed, touch);
    m_out.push_back(touch);
  }

  /// Computes an early touch again. Returns whether the features touch at the step's start only and
  /// certainly part.
  template <class Contact>
  static bool partsAtStart(const Placed<Contact>& placed, GuardedTouch& touch) {
    const ImpactQuery query =
        queryOf(placed.first.body.mesh, placed.second.body.mesh, placed.contact);
    ImpactQuery start = query;
    for (ImpactQuery::Step& step : start.vertices) step.now = step.before;
    touch.atStart = findTouch(start, kGuardTolerance).impact;
    if (touch.atStart && certainlyPart(query)) return true;
    // Only features without radii touch as their centre lines do.
    if (const ImpactResult again = findTouch(query, kGuardTolerance);
        again.impact &&
        placed.first.body.mesh.largestRadius + placed.second.body.mesh.largestRadius == 0.0)
      touch.time = again.time;
    return false;
  }

  void addVertex(GuardedTouch& touch, const Geometry& geometry, std::uint32_t v, double weight,
                 const Vector3d& normal) const {
    const auto [before, now] = stepOf(geometry, v);
    addMover(touch, geometry, v, weight * normal.dot(now - before));
  }
  void addMover(GuardedTouch& touch, const Geometry& geometry, std::uint32_t vertex,
                double approach) const {
    const std::uint32_t part = m_parts.partOf(geometry.body.id, vertex);
    const auto mover = std::find_if(touch.movers.begin(), touch.movers.end(), [&](const auto& m) {
      return m.part == part || m.part == GuardedParts::kNone;
    });
    PALPATE_ASSERT(mover != touch.movers.end());
    mover->part = part;
    mover->approach += approach;
  }

  /// Throws an Error about features that touch, when none of them can be shortened.
  template <class Contact>
  [[noreturn]] void throwRemains(const Placed<Contact>& placed, const GuardedTouch& touch) const {
    const bool moves = std::any_of(touch.movers.begin(), touch.movers.end(), [&](const auto& m) {
      return m_parts.moves(m.part) && !m_parts.isFree(m.part);
    });
    const auto [first, second, element] = namesOf(placed);
    throw Error(ErrorCode::ImpactRemains,
                first + ", and " + second +
                    (moves && !touch.atStart
                         ? " touch within the step, and all their vertices that move are fixed"
                         : " touched before the step"),
                placed.first.body.id, element);
  }

  const GuardedParts& m_parts;
  std::span<const double> m_fractions;
  std::vector<GuardedTouch>& m_out;
};

}  // namespace

void findTouches(SeparateSearches pairs, const GuardedParts& parts,
                 std::span<const double> fractions, std::vector<GuardedTouch>& out) {
  PALPATE_ASSERT(fractions.size() == parts.nodeCount());
  out.clear();
  for (const auto& pair : pairs)
    if (pair->a->meets(*pair->b)) TouchFinder(parts, fractions, out).find(*pair);
}

}  // namespace palpate
