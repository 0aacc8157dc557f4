#pragma once

#include <palpate/FrameStatistics.h>

#include "Fields/Fields.h"

namespace palpate {

template <>
struct Fields<UnfinishedPair> {
  using T = UnfinishedPair;
  static constexpr auto kList = listOf(
      field("a", &T::a), field("b", &T::b), field("distanceBound", &T::distanceBound, Unit::Length),
      field("age", &T::age, Unit::Detections), field("exceedsBudget", &T::exceedsBudget));
};

}  // namespace palpate
