#pragma once

#include <palpate/Meshes.h>
#include <palpate/PenetrationTracker.h>
#include <palpate/SpatialQueries.h>

#include "Fields/Fields.h"

namespace palpate {

template <>
struct Fields<SurfacePoint> {
  using T = SurfacePoint;
  static constexpr auto kList = listOf(
      field("geometry", &T::geometry), field("element", &T::element),
      field("vertices", &T::vertices), field("weights", &T::weights),
      field("position", &T::position, Unit::Length), field("distance", &T::distance, Unit::Length),
      field("normal", &T::normal, Unit::Direction));
};

template <>
struct Fields<SignedDistance> {
  using T = SignedDistance;
  static constexpr auto kList =
      listOf(field("nearest", &T::nearest), field("distance", &T::distance, Unit::Length));
};

template <>
struct Fields<Ray> {
  using T = Ray;
  static constexpr auto kList = listOf(field("origin", &T::origin, Unit::Length),
                                       field("direction", &T::direction, Unit::Length),
                                       field("tMin", &T::tMin), field("tMax", &T::tMax));
};

template <>
struct Fields<RayHit> {
  using T = RayHit;
  static constexpr auto kList =
      listOf(field("geometry", &T::geometry), field("element", &T::element),
             field("vertices", &T::vertices), field("weights", &T::weights), field("t", &T::t),
             field("frontFace", &T::frontFace), field("crosses", &T::crosses));
};

template <>
struct Fields<Pick> {
  using T = Pick;
  static constexpr auto kList =
      listOf(field("hit", &T::hit), field("vertex", &T::vertex), field("edge", &T::edge));
};

template <>
struct Fields<GeometryDistance> {
  using T = GeometryDistance;
  static constexpr auto kList =
      listOf(field("a", &T::a), field("b", &T::b), field("distance", &T::distance, Unit::Length));
};

template <>
struct Fields<Penetration> {
  using T = Penetration;
  static constexpr auto kList = listOf(field("intersecting", &T::intersecting),
                                       field("direction", &T::direction, Unit::Direction),
                                       field("depth", &T::depth, Unit::Length), field("a", &T::a),
                                       field("b", &T::b), field("minimal", &T::minimal));
};

template <>
struct Fields<PathInterval> {
  using T = PathInterval;
  static constexpr auto kList =
      listOf(field("body", &T::body), field("enter", &T::enter, Unit::Length),
             field("leave", &T::leave, Unit::Length), field("entryElement", &T::entryElement),
             field("exitElement", &T::exitElement));
};

template <>
struct Fields<PathClearance> {
  using T = PathClearance;
  static constexpr auto kList =
      listOf(field("body", &T::body), field("distance", &T::distance, Unit::Length),
             field("at", &T::at, Unit::Length), field("nearest", &T::nearest));
};

template <>
struct Fields<InsideSettings> {
  using T = InsideSettings;
  static constexpr auto kList = listOf(field("rule", &T::rule), field("margin", &T::margin));
};

template <>
struct Fields<InsideVertex> {
  using T = InsideVertex;
  static constexpr auto kList = listOf(
      field("vertex", &T::vertex), field("triangle", &T::triangle), field("vertices", &T::vertices),
      field("weights", &T::weights), field("direction", &T::direction, Unit::Direction),
      field("depth", &T::depth, Unit::Length), field("decided", &T::decided));
};

template <>
struct Fields<TrackedVertex> {
  using T = TrackedVertex;
  static constexpr auto kList = listOf(field("penetration", &T::penetration),
                                       field("nearest", &T::nearest), field("change", &T::change));
};

template <>
struct Fields<TetrahedronPoint> {
  using T = TetrahedronPoint;
  static constexpr auto kList =
      listOf(field("tetrahedron", &T::tetrahedron), field("vertices", &T::vertices),
             field("weights", &T::weights));
};

template <>
struct Fields<EmbeddedVertex> {
  using T = EmbeddedVertex;
  static constexpr auto kList = listOf(field("vertex", &T::vertex), field("at", &T::at));
};

}  // namespace palpate
