#pragma once

#include "Shapes/Shape.h"

#include <array>
#include <optional>
#include <variant>

namespace palpate {

/// An analytical geometry at both ends of a step, in the world.
struct PlacedShape {
  explicit PlacedShape(const AnalyticalGeometry& geometry)
      : analytical(geometry), now(geometry, {}), before(now) {}

  AnalyticalGeometry analytical;  ///< in the body's frame
  Shape now, before;
};

/// The memory of the last shape of each type.
using KeptShapes = std::array<std::optional<PlacedShape>, std::variant_size_v<AnalyticalGeometry>>;

/// The shape at rest at a pose, in memory that is kept from call to call. Only a box or hull that
/// differs from the last one, or the first shape of a type, allocates.
inline const PlacedShape& placeAtRest(const AnalyticalGeometry& geometry, const Pose& pose,
                                      KeptShapes& shapes) {
  std::optional<PlacedShape>& kept = shapes[geometry.index()];
  const bool hasHull =
      std::holds_alternative<Box>(geometry) || std::holds_alternative<ConvexHull>(geometry);
  if (!kept || (hasHull && !(kept->analytical == geometry)))
    kept.emplace(geometry);
  else if (!hasHull)
    kept->analytical = geometry;
  kept->now.place(geometry, pose);
  kept->before = kept->now;
  return *kept;
}

}  // namespace palpate
