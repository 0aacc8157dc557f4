#pragma once

#include <palpate/StepGuard.h>
#include <palpate/ThreadTopology.h>

#include "Fields/Fields.h"

namespace palpate {

template <>
struct Fields<ThreadEvent> {
  using T = ThreadEvent;
  static constexpr auto kList =
      listOf(field("index", &T::index), field("step", &T::step), field("cause", &T::cause),
             field("change", &T::change), field("thread", &T::thread), field("loop", &T::loop),
             field("time", &T::time, Unit::StepFraction));
};

template <>
struct Fields<HeldVertex> {
  using T = HeldVertex;
  static constexpr auto kList = listOf(field("geometry", &T::geometry), field("vertex", &T::vertex),
                                       field("fraction", &T::fraction, Unit::StepFraction));
};

}  // namespace palpate
