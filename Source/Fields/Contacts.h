#pragma once

#include <palpate/CollisionData.h>

#include "Fields/Fields.h"

namespace palpate {

template <>
struct Fields<ElementPair> {
  static constexpr auto kList = listOf(field("a", &ElementPair::a), field("b", &ElementPair::b));
};

template <>
struct Fields<VertexTriangleContact> {
  using T = VertexTriangleContact;
  static constexpr auto kList = listOf(
      field("vertex", &T::vertex), field("triangle", &T::triangle), field("vertices", &T::vertices),
      field("weights", &T::weights), field("normal", &T::normal, Unit::Direction),
      field("distance", &T::distance, Unit::Length),
      field("timeOfImpact", &T::timeOfImpact, Unit::StepFraction), field("feature", &T::feature));
};

template <>
struct Fields<EdgeEdgeContact> {
  using T = EdgeEdgeContact;
  static constexpr auto kList =
      listOf(field("edgeA", &T::edgeA), field("edgeB", &T::edgeB), field("weightA", &T::weightA),
             field("weightB", &T::weightB), field("normal", &T::normal, Unit::Direction),
             field("distance", &T::distance, Unit::Length),
             field("timeOfImpact", &T::timeOfImpact, Unit::StepFraction),
             field("featureA", &T::featureA), field("featureB", &T::featureB));
};

template <>
struct Fields<ShapeContact> {
  using T = ShapeContact;
  static constexpr auto kList = listOf(
      field("element", &T::element), field("id", &T::id), field("vertices", &T::vertices),
      field("weights", &T::weights), field("point", &T::point, Unit::Length),
      field("pointOnShape", &T::pointOnShape, Unit::Length),
      field("normal", &T::normal, Unit::Direction), field("distance", &T::distance, Unit::Length),
      field("timeOfImpact", &T::timeOfImpact, Unit::StepFraction));
};

template <>
struct Fields<ShapeShapeContact> {
  using T = ShapeShapeContact;
  static constexpr auto kList = listOf(
      field("pointA", &T::pointA, Unit::Length), field("pointB", &T::pointB, Unit::Length),
      field("normal", &T::normal, Unit::Direction), field("distance", &T::distance, Unit::Length),
      field("timeOfImpact", &T::timeOfImpact, Unit::StepFraction));
};

template <>
struct Fields<ContactKey> {
  using T = ContactKey;
  static constexpr auto kList = listOf(field("kind", &T::kind), field("ids", &T::ids));
};

template <>
struct Fields<TrackedContact> {
  using T = TrackedContact;
  static constexpr auto kList = listOf(field("key", &T::key), field("predecessor", &T::predecessor),
                                       field("age", &T::age, Unit::Steps),
                                       field("userData", &T::userData), field("end", &T::end));
};

template <>
struct Fields<Crossing> {
  using T = Crossing;
  static constexpr auto kList =
      listOf(field("kind", &T::kind), field("ids", &T::ids),
             field("time", &T::time, Unit::StepFraction), field("forward", &T::forward));
};

template <>
struct Fields<Stencil> {
  static constexpr auto kList =
      listOf(field("vertices", &Stencil::vertices), field("weights", &Stencil::weights));
};

template <>
struct Fields<Validity> {
  using T = Validity;
  static constexpr auto kList = listOf(
      field("trusted", &T::trusted), field("startedApart", &T::startedApart),
      field("sideMayBeWrong", &T::sideMayBeWrong), field("unwelded", &T::unwelded),
      field("method", &T::method), field("reason", &T::reason), field("atEnd", &T::atEnd),
      field("atImpact", &T::atImpact), field("displacement", &T::displacement, Unit::Length),
      field("displacementLimit", &T::displacementLimit, Unit::Length),
      field("arcDeviation", &T::arcDeviation, Unit::Length),
      field("effectiveThickness", &T::effectiveThickness, Unit::Length),
      field("proxyDepth", &T::proxyDepth, Unit::Length), field("age", &T::age, Unit::Detections),
      field("advanceMayBeMissing", &T::advanceMayBeMissing),
      field("untrustedVerticesA", &T::untrustedVerticesA),
      field("untrustedVerticesB", &T::untrustedVerticesB),
      field("degenerateTrianglesA", &T::degenerateTrianglesA),
      field("degenerateTrianglesB", &T::degenerateTrianglesB),
      field("outsideBand", &T::outsideBand), field("nearThreshold", &T::nearThreshold),
      field("unreliableSign", &T::unreliableSign));
};

}  // namespace palpate
