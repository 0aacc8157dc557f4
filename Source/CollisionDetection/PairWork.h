#pragma once

#include <palpate/FrameStatistics.h>
#include <palpate/Settings.h>

#include "CollisionDetection/FieldWork.h"
#include "CollisionDetection/MeshWork.h"
#include "CollisionDetection/AttachedProxyWork.h"
#include "CollisionDetection/ProxyWork.h"
#include "CollisionDetection/ShapeWork.h"

#include <variant>

namespace palpate {

/// The work of one pair in one frame. Each alternative is a value without buffers:
///
/// start()            returns the number of jobs; 0: nothing is near. Once all pairs have started,
/// hasRound(n, jobs)  says whether all jobs run for the n-th time,
/// run(n, i, scratch) runs the i-th one, on any thread,
/// join()             writes the results to PairRecord::next.
/// runByBruteForce()  does the work of all jobs without octrees, and without start().
using PairWork = std::variant<MeshWork, ShapeWork, FieldWork, ProxyWork, AttachedProxyWork>;

/// The work for the pair's plan.
inline PairWork workOf(PairRecord& record) {
  switch (record.plan.kind) {
    case PairKind::Meshes:
      break;
    case PairKind::MeshAndShape:
    case PairKind::Shapes:
      return ShapeWork(record);
    case PairKind::Field:
      return FieldWork(record);
    case PairKind::Proxy:
      return ProxyWork(record);
    case PairKind::AttachedProxy:
      return AttachedProxyWork(record);
  }
  return MeshWork(record);
}

}  // namespace palpate
