#pragma once

#include <palpate/Settings.h>

#include "Fields/Fields.h"

namespace palpate {

template <>
struct Fields<OctreeSettings> {
  using T = OctreeSettings;
  static constexpr auto kList =
      listOf(field("maxDepth", &T::maxDepth), field("maxElementsPerLeaf", &T::maxElementsPerLeaf),
             field("update", &T::update), field("bounds", &T::bounds),
             field("keepsPairs", &T::keepsPairs));
};

template <>
struct Fields<AuditSettings> {
  using T = AuditSettings;
  static constexpr auto kList =
      listOf(field("features", &T::features), field("seed", &T::seed), field("folder", &T::folder),
             field("maxFiles", &T::maxFiles));
};

template <>
struct Fields<Settings> {
  using T = Settings;
  static constexpr auto kList = listOf(
      field("octree", &T::octree), field("engine", &T::engine), field("threads", &T::threads),
      notInC(field("audit", &T::audit)), notInC(field("traceFrames", &T::traceFrames)),
      notInC(field("executor", &T::executor)), field("memoryLimit", &T::memoryLimit, Unit::Bytes));
};

template <>
struct Fields<ContinuousSettings> {
  using T = ContinuousSettings;
  static constexpr auto kList =
      listOf(field("timeTolerance", &T::timeTolerance, Unit::StepFraction),
             field("earliestTimeOnly", &T::earliestTimeOnly));
};

template <>
struct Fields<AutoSettings> {
  static constexpr auto kList =
      listOf(field("motionTolerance", &AutoSettings::motionTolerance, Unit::Length));
};

template <>
struct Fields<LeafSettings> {
  static constexpr auto kList =
      listOf(field("widestNormalCone", &LeafSettings::widestNormalCone, Unit::Angle));
};

template <>
struct Fields<PairSettings> {
  using T = PairSettings;
  static constexpr auto kList = listOf(
      field("method", &T::method), field("thickness", &T::thickness, Unit::Length),
      field("contacts", &T::contacts), field("restDistance", &T::restDistance, Unit::Length),
      field("allowedError", &T::allowedError, Unit::Length),
      field("freeMotionReach", &T::freeMotionReach, Unit::Length),
      field("trackContacts", &T::trackContacts), field("reportCrossings", &T::reportCrossings),
      field("smoothNormals", &T::smoothNormals), field("rememberSides", &T::rememberSides),
      field("continuous", &T::continuous), field("automatic", &T::automatic),
      field("proxy", &T::proxy), field("priority", &T::priority));
};

template <>
struct Fields<CollisionFilter> {
  using T = CollisionFilter;
  static constexpr auto kList = listOf(field("groups", &T::groups), field("mask", &T::mask),
                                       field("sidedness", &T::sidedness));
};

template <>
struct Fields<ContactFeatures> {
  using T = ContactFeatures;
  static constexpr auto kList =
      listOf(field("kind", &T::kind), field("a", &T::a), field("b", &T::b), field("tagA", &T::tagA),
             field("tagB", &T::tagB));
};

template <>
struct Fields<SurfaceProxySettings> {
  using T = SurfaceProxySettings;
  static constexpr auto kList = listOf(
      field("reach", &T::reach, Unit::Length), field("errorBound", &T::errorBound, Unit::Length),
      field("widestNormalCone", &T::widestNormalCone, Unit::Angle));
};

}  // namespace palpate
