#pragma once

#include <palpate/Capture.h>

#include "Fields/Contacts.h"
#include "Fields/Settings.h"

namespace palpate {

template <>
struct Fields<CollisionProblem::Pair> {
  using T = CollisionProblem::Pair;
  static constexpr auto kList = listOf(
      field("a", &T::a), field("b", &T::b), field("settings", &T::settings),
      field("method", &T::method), field("predicate", &T::predicate), field("sides", &T::sides));
};

}  // namespace palpate
