#pragma once

#include "Features.h"

#include <vector>

namespace palpate::stability {

/// The reference for two triangles at rest, in rational arithmetic that shares no code with the
/// library.
struct Rest {
  struct Near {
    FeaturePair features;
    double distance;  ///< L
    double error;     ///< L: error bound of the library (Docs/Accuracy.md)
  };
  std::vector<Near>
      pairs;  ///< all pairs whose boxes are within twice the thickness, and some others
  bool intersect = false;  ///< true also if they only touch
};
Rest restOf(const Case::Frame&, double thickness);

}  // namespace palpate::stability
