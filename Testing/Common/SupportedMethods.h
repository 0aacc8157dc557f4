#pragma once

#include "Validity/Support.h"

#include "Common/StepBodies.h"

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

/// Two cases for each pair of bodies, so that every two bodies meet with and without a thickness.
inline PairSettings caseOf(const SupportedPairs& row, std::size_t number) {
  const bool needsThickness = row.has(kNeedsReach) || row.method == Method::Auto;
  PairSettings pair{row.method, number % 2 == 1 || needsThickness ? 0.03 : 0.0,
                    number % 3 == 0 ? Contacts::All : Contacts::Distinct};
  if (row.method == Method::Intersection) pair.thickness = 0.0;
  if (row.method == Method::Proxy) pair.allowedError = 0.005;
  // A field that is attached may answer.
  if (row.method == Method::Auto && number % 4 == 3) pair.allowedError = 0.02;
  if (row.method == Method::Continuous) pair.continuous.earliestTimeOnly = number % 5 == 0;
  return pair;
}

/// Whether the row answers the two in a step in which both move.
inline bool answers(const SupportedPairs& row, const StepBody& a, const StepBody& b) {
  const bool itself = &a == &b;
  if (supportOf(row.method, a.type, b.type, itself) != &row) return false;
  if (row.kind == PairKind::Field && !a.hasField && !b.hasField) return false;
  const auto isPlane = [](const StepBody& body) { return body.name.ends_with("plane"); };
  const bool isPlaced = a.name.starts_with("placed") || a.hasField;
  return !(isPlane(a) && isPlane(b)) && !(itself && isPlaced) &&
         !(row.has(kOneRadius) && (a.radii.size() > 1 || b.radii.size() > 1));
}

}  // namespace palpate::testing
