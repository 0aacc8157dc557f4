#pragma once

#include <palpate/FeaturePairs.h>

#include "Fields/Fields.h"

namespace palpate {

template <>
struct Fields<VertexTriangleDistance> {
  using T = VertexTriangleDistance;
  static constexpr auto kList = listOf(
      field("weights", &T::weights), field("difference", &T::difference, Unit::Length),
      field("normal", &T::normal, Unit::Direction), field("distance", &T::distance, Unit::Length),
      field("feature", &T::feature), field("exact", &T::exact));
};

template <>
struct Fields<EdgeEdgeDistance> {
  using T = EdgeEdgeDistance;
  static constexpr auto kList = listOf(
      field("weightA", &T::weightA), field("weightB", &T::weightB),
      field("difference", &T::difference, Unit::Length),
      field("normal", &T::normal, Unit::Direction), field("distance", &T::distance, Unit::Length),
      field("featureA", &T::featureA), field("featureB", &T::featureB),
      field("parallel", &T::parallel), field("exact", &T::exact));
};

}  // namespace palpate
