#pragma once

#include <palpate/CollisionData.h>

#include "Common/RidgeTruth.h"
#include "Common/ShapeTruth.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <set>
#include <span>
#include <tuple>
#include <vector>

namespace palpate::testing {

/// The definition of Contacts::Distinct for a mesh and a shape, which is no plane.
struct DistinctTruth {
  const std::vector<Vector3d>&before, &now;
  const std::vector<Triangle>& elements;  ///< segments as {p, q, q}
  double radius;
  const PlacedShape &atStart, &atEnd;
  double thickness, timeTolerance;

  Vector3d at(std::uint32_t v, double time) const { return (1 - time) * before[v] + time * now[v]; }
  static bool has(const Triangle& element, std::uint32_t v) {
    return std::find(element.begin(), element.end(), v) != element.end();
  }

  /// The vertices of the corner, edge or face that holds the contact's point.
  static std::set<std::uint32_t> holdersOf(const ShapeContact& c) {
    std::set<std::uint32_t> holders;  // a point on the boundary counts as inside by rounding
    for (int i = 0; i < 3; ++i)
      if (c.weights[i] > 0x1p-49) holders.insert(c.vertices[i]);
    return holders;
  }
  /// Whether the contact's point is on a ridge or a border of a mesh with faces. The straight parts
  /// of a sphere and of a capsule are those of its axis.
  bool isOnRidge(const ShapeContact& c) const {
    const bool hasFaces = std::ranges::any_of(
        elements, [](const Triangle& element) { return element[1] != element[2]; });
    if (!hasFaces) return false;
    double axis = sizeOf(atEnd);
    if (const auto* sphere = std::get_if<Sphere>(&atEnd.geometry)) axis -= 2 * sphere->radius;
    if (const auto* capsule = std::get_if<Capsule>(&atEnd.geometry)) axis -= 2 * capsule->radius;
    return RidgeTruth{now, elements, 2 * axis, thickness}.isOnRidge(holdersOf(c), -c.normal);
  }
  /// Whether the direction from a contact's vertex or edge to the shape leads into an element
  /// there.
  bool isExcluded(const ShapeContact& c) const {
    const std::set<std::uint32_t> holders = holdersOf(c);
    if (holders.size() == 3) return false;
    const std::uint32_t p = *holders.begin(), q = *holders.rbegin();
    for (const Triangle& element : elements) {
      if (!has(element, p) || !has(element, q)) continue;
      for (const std::uint32_t v : element) {
        if (v == p || v == q) continue;
        const Vector3d way = at(v, c.timeOfImpact) - at(p, c.timeOfImpact);
        Vector3d inwards = way;
        if (p != q) {
          const Vector3d along = (at(q, c.timeOfImpact) - at(p, c.timeOfImpact)).normalized();
          inwards -= inwards.dot(along) * along;
        }
        if (-c.normal.dot(inwards) > 1e-12 * way.lpNorm<1>()) return true;
      }
    }
    return false;
  }

  Vector3d pointAtEnd(const ShapeContact& c) const {
    Vector3d point = Vector3d::Zero();
    for (int i = 0; i < 3; ++i) point += c.weights[i] * now[c.vertices[i]];
    return point;
  }

  /// Whether each contact stays. gaps: of their rows at the step's end.
  std::vector<char> kept(std::span<const ShapeContact> all, std::span<const double> gaps) const {
    const auto isFirst = [&](std::size_t l, std::size_t r) {
      return std::tie(all[l].timeOfImpact, all[l].distance) <
             std::tie(all[r].timeOfImpact, all[r].distance);
    };
    std::vector<std::size_t> proper, excluded;
    for (std::size_t i = 0; i < all.size(); ++i)
      (isExcluded(all[i]) ? excluded : proper).push_back(i);
    std::stable_sort(proper.begin(), proper.end(), isFirst);
    std::vector<char> stays(all.size(), true);
    const double near = thickness / 128 + 1e-12;
    for (int planes = 0; planes < 8 && !proper.empty(); ++planes) {
      const std::size_t first = proper.front();
      const ShapeContact& s = all[first];
      const double height = s.normal.dot(pointAtEnd(s));
      double gap = gaps[first];
      std::erase_if(proper, [&](std::size_t i) {
        if ((all[i].normal - s.normal).norm() > 1e-12 ||
            std::abs(s.normal.dot(pointAtEnd(all[i])) - height) > 2 * near)
          return false;
        gap = std::min(gap, gaps[i]);
        return true;
      });
      // The shape is on the side that the normal comes from.
      if (reachOf(atEnd, s.normal) > height - radius - gap + near) continue;
      std::erase_if(excluded, [&](std::size_t i) {
        const ShapeContact& c = all[i];
        const bool inTime = isFirst(first, i) || (s.element == ShapeElement::Face &&
                                                  s.timeOfImpact <= c.timeOfImpact + timeTolerance),
                   isIn = std::all_of(c.vertices.begin(), c.vertices.end(), [&](std::uint32_t v) {
                     return std::abs(s.normal.dot(now[v]) - height) <= near;
                   });
        // At another part of a flat side of the shape, the same normal is no tilted one.
        const bool isAlike = (c.normal - s.normal).norm() <= 0x1p-10 &&
                             (endOnShape(c) - endOnShape(s)).norm() > 0.125 * sizeOf(atEnd);
        if (!inTime || !isIn || isAlike || isOnRidge(c)) return false;
        stays[i] = false;
        return true;
      });
    }
    if (!std::holds_alternative<Sphere>(atEnd.geometry) &&
        !std::holds_alternative<Capsule>(atEnd.geometry))
      dropAlongFlatParts(all, excluded, isFirst, stays);
    return stays;
  }

 private:
  /// Drops excluded contacts around which all elements lie in one plane, where the shape has sunk
  /// in.
  template <class IsFirst>
  void dropAlongFlatParts(std::span<const ShapeContact> all,
                          const std::vector<std::size_t>& excluded, const IsFirst& isFirst,
                          std::vector<char>& stays) const {
    for (const std::size_t c : excluded) {
      Vector3d normal = Vector3d::Zero();
      double height = 0;
      int count = 0;
      bool isFlat = true;
      for (const Triangle& element : elements) {
        bool isThere = true;
        for (int i = 0; i < 3; ++i)
          isThere = isThere && (all[c].weights[i] <= 0x1p-49 || has(element, all[c].vertices[i]));
        if (!isThere) continue;
        const auto& [p, q, r] = element;
        const Vector3d own = (now[q] - now[p]).cross(now[r] - now[p]).normalized();
        if (count++ == 0) normal = own, height = own.dot(now[p]);
        isFlat = isFlat && own.norm() > 0.5 && own.cross(normal).norm() <= 1e-12;
      }
      if (!isFlat || count < 2) continue;
      for (std::size_t s = 0; s < all.size(); ++s) {
        const bool isIn =
            std::all_of(all[s].vertices.begin(), all[s].vertices.end(), [&](std::uint32_t v) {
              return std::abs(normal.dot(now[v]) - height) <= thickness / 128 + 1e-12;
            });
        if (isIn && all[s].distance < 0 && !isExcluded(all[s]) &&
            std::abs(normal.dot(all[s].normal)) > std::abs(normal.dot(all[c].normal)) + 0x1p-10 &&
            (isFirst(s, c) || (all[s].element == ShapeElement::Face &&
                               all[s].timeOfImpact <= all[c].timeOfImpact + timeTolerance)))
          stays[c] = false;
      }
    }
  }
  /// The contact's point on the shape, at the step's end.
  Vector3d endOnShape(const ShapeContact& c) const {
    const double t = c.timeOfImpact;
    const Matrix3d turn = (1 - t) * atStart.rotation + t * atEnd.rotation;
    const Vector3d place = (1 - t) * atStart.translation + t * atEnd.translation;
    return atEnd.rotation * turn.inverse() * (c.pointOnShape - place) + atEnd.translation;
  }
  static double sizeOf(const PlacedShape& shape) {
    double radius = 0;
    std::vector<Vector3d> corners = cornersOf({shape.geometry}, radius);
    if (const auto* cylinder = std::get_if<Cylinder>(&shape.geometry)) {
      corners = {cylinder->p0, cylinder->p1};
      radius = cylinder->radius;
    }
    Vector3d low = corners.front(), high = low;
    for (const Vector3d& p : corners) low = low.cwiseMin(p), high = high.cwiseMax(p);
    return (high - low).maxCoeff() + 2 * radius;
  }
};

}  // namespace palpate::testing
