#pragma once

#include "Validity/Support.h"

#include <vector>

namespace palpate::testing {

/// The methods that answer two geometries of these types without a field, in the order of kSupport.
inline std::vector<Method> supportedMethods(GeometryType a, GeometryType b) {
  std::vector<Method> methods;
  for (const SupportedPairs& row : kSupport)
    if (row.kind != PairKind::Field && supportOf(row.method, a, b, false) == &row)
      methods.push_back(row.method);
  return methods;
}

}  // namespace palpate::testing
