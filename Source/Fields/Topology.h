#pragma once

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

}  // namespace palpate
