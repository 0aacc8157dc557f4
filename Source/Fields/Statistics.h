#pragma once

#include <palpate/FrameStatistics.h>
#include <palpate/LooseOctree.h>

#include "Fields/Fields.h"

namespace palpate {

template <>
struct Fields<MemoryUse> {
  using T = MemoryUse;
  static constexpr auto kList = listOf(
      field("geometries", &T::geometries, Unit::Bytes), field("octrees", &T::octrees, Unit::Bytes),
      field("pairs", &T::pairs, Unit::Bytes), field("narrowPhase", &T::narrowPhase, Unit::Bytes),
      field("results", &T::results, Unit::Bytes), field("queries", &T::queries, Unit::Bytes),
      field("snapshots", &T::snapshots, Unit::Bytes), field("total", &T::total, Unit::Bytes));
};

template <>
struct Fields<UnfinishedPair> {
  using T = UnfinishedPair;
  static constexpr auto kList = listOf(
      field("a", &T::a), field("b", &T::b), field("distanceBound", &T::distanceBound, Unit::Length),
      field("age", &T::age, Unit::Detections), field("exceedsBudget", &T::exceedsBudget));
};

template <>
struct Fields<FrameStatistics::Stages> {
  using T = FrameStatistics::Stages;
  static constexpr auto kList = listOf(field("boxes", &T::boxes, Unit::Milliseconds),
                                       field("octree", &T::octree, Unit::Milliseconds),
                                       field("pairs", &T::pairs, Unit::Milliseconds),
                                       field("narrowPhase", &T::narrowPhase, Unit::Milliseconds),
                                       field("order", &T::order, Unit::Milliseconds));
};

template <>
struct Fields<FrameStatistics> {
  using T = FrameStatistics;
  static constexpr auto kList = listOf(
      field("milliseconds", &T::milliseconds), field("geometries", &T::geometries),
      field("triangles", &T::triangles), field("segments", &T::segments),
      field("points", &T::points), field("untestedVertices", &T::untestedVertices),
      field("rebuiltOctrees", &T::rebuiltOctrees), field("refittedOctrees", &T::refittedOctrees),
      field("unchangedOctrees", &T::unchangedOctrees), field("candidatePairs", &T::candidatePairs),
      field("featurePairs", &T::featurePairs), field("contacts", &T::contacts),
      field("intersectingTriangles", &T::intersectingTriangles),
      field("exactDecisions", &T::exactDecisions), field("validityPairs", &T::validityPairs),
      field("memory", &T::memory), field("peakMemory", &T::peakMemory),
      notInC(field("unfinishedPairs", &T::unfinishedPairs)),
      field("freeMotionUnfinished", &T::freeMotionUnfinished));
};

template <>
struct Fields<PairStatistics> {
  using T = PairStatistics;
  static constexpr auto kList =
      listOf(field("milliseconds", &T::milliseconds, Unit::Milliseconds),
             field("candidatePairs", &T::candidatePairs), field("featurePairs", &T::featurePairs),
             field("exactDecisions", &T::exactDecisions), field("contacts", &T::contacts));
};

template <>
struct Fields<OctreeStatistics> {
  using T = OctreeStatistics;
  static constexpr auto kList =
      listOf(field("nodesInUse", &T::nodesInUse), field("nodesAllocated", &T::nodesAllocated),
             field("blocksInUse", &T::blocksInUse), field("blocksFree", &T::blocksFree),
             field("blocksAllocated", &T::blocksAllocated), field("deepestLevel", &T::deepestLevel),
             field("elements", &T::elements), field("maxElementsInNode", &T::maxElementsInNode),
             field("nodesByDepth", &T::nodesByDepth), field("elementsByDepth", &T::elementsByDepth),
             field("bytes", &T::bytes, Unit::Bytes));
};

}  // namespace palpate
