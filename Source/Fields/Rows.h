#pragma once

#include <palpate/ConstraintRows.h>

#include "Fields/Fields.h"

namespace palpate {

template <>
struct Fields<ConstraintRow> {
  using T = ConstraintRow;
  static constexpr auto kList = listOf(
      field("vertices", &T::vertices), field("weights", &T::weights),
      field("normal", &T::normal, Unit::Direction), field("offset", &T::offset, Unit::Length));
};

template <>
struct Fields<ContactMotion> {
  using T = ContactMotion;
  static constexpr auto kList =
      listOf(field("point", &T::point, Unit::Length), field("opposite", &T::opposite, Unit::Length),
             field("relativeDisplacement", &T::relativeDisplacement, Unit::Length));
};

}  // namespace palpate
