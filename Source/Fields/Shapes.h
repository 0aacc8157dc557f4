#pragma once

#include <palpate/AnalyticalGeometry.h>

#include "Fields/Fields.h"

namespace palpate {

template <>
struct Fields<Sphere> {
  static constexpr auto kList = listOf(field("centre", &Sphere::centre, Unit::Length),
                                       field("radius", &Sphere::radius, Unit::Length));
};

template <>
struct Fields<Capsule> {
  static constexpr auto kList =
      listOf(field("p0", &Capsule::p0, Unit::Length), field("p1", &Capsule::p1, Unit::Length),
             field("radius", &Capsule::radius, Unit::Length));
};

template <>
struct Fields<Plane> {
  static constexpr auto kList =
      listOf(field("point", &Plane::point, Unit::Length), field("normal", &Plane::normal),
             field("twoSided", &Plane::twoSided));
};

template <>
struct Fields<Box> {
  static constexpr auto kList = listOf(field("centre", &Box::centre, Unit::Length),
                                       field("halfExtents", &Box::halfExtents, Unit::Length));
};

template <>
struct Fields<Cylinder> {
  static constexpr auto kList =
      listOf(field("p0", &Cylinder::p0, Unit::Length), field("p1", &Cylinder::p1, Unit::Length),
             field("radius", &Cylinder::radius, Unit::Length));
};

template <>
struct Fields<ConvexHull> {
  static constexpr auto kList = listOf(field("points", &ConvexHull::points, Unit::Length));
};

}  // namespace palpate
