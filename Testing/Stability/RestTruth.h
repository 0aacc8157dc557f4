#pragma once

#include "Features.h"

#include <vector>

namespace palpate::stability {

/// Two triangles at rest, decided in rational arithmetic that shares nothing with the library.
struct Rest {
  struct Near {
    FeaturePair features;
    double distance;  ///< L
    double error;     ///< L: what the library may be off by (Docs/Accuracy.md)
  };
  std::vector<Near> pairs;  ///< those whose boxes are within twice the thickness, and maybe others
  bool intersect = false;   ///< touching counts
};
Rest restOf(const Case::Frame&, double thickness);

}  // namespace palpate::stability
