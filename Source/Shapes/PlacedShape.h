#pragma once

#include "Shapes/Shape.h"

namespace palpate {

/// An analytical geometry at both ends of a step, in the world.
struct PlacedShape {
  explicit PlacedShape(const AnalyticalGeometry& geometry)
      : analytical(geometry), now(geometry, {}), before(now) {}

  AnalyticalGeometry analytical;  ///< in the body's frame
  Shape now, before;
};

}  // namespace palpate
