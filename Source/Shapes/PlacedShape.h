#pragma once

#include "Shapes/Shape.h"

#include <optional>

namespace palpate {

/// An analytical geometry at both ends of a step, in the world.
struct PlacedShape {
  explicit PlacedShape(const AnalyticalGeometry& geometry)
      : analytical(geometry), now(geometry, {}), before(now) {}

  AnalyticalGeometry analytical;  ///< in the body's frame
  Shape now, before;
};

/// The shape at rest at a pose, in memory that is kept from call to call.
inline const PlacedShape& placeAtRest(const AnalyticalGeometry& geometry,
                                      const RigidTransform& pose,
                                      std::optional<PlacedShape>& kept) {
  if (!kept || !(kept->analytical == geometry)) kept.emplace(geometry);
  kept->now.place(geometry, pose);
  kept->before = kept->now;
  return *kept;
}

}  // namespace palpate
