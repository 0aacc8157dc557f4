#pragma once

#include <palpate/FrameStatistics.h>
#include <palpate/Settings.h>

#include "Search/FieldWork.h"
#include "Search/FreeMotionWork.h"
#include "Search/MeshWork.h"
#include "Search/AttachedProxyWork.h"
#include "Search/ProxyWork.h"
#include "Search/ShapeWork.h"

#include <variant>

namespace palpate {

/// The work of one pair in one frame. Each alternative is a value without buffers:
///
/// start()            returns the number of jobs; 0: nothing is near. Once all pairs have started,
/// hasRound(n, jobs)  says whether all jobs run for the n-th time,
/// run(n, i, scratch) runs the i-th one, on any thread,
/// join()             writes the answer.
using PairWork =
    std::variant<MeshWork, ShapeWork, FieldWork, ProxyWork, AttachedProxyWork, FreeMotionWork>;

/// The work for the plan of a search.
inline PairWork workOf(const Search& search) {
  switch (search.question->plan.kind) {
    case PairKind::Meshes:
      break;
    case PairKind::MeshAndShape:
    case PairKind::Shapes:
      return ShapeWork(search);
    case PairKind::Field:
      return FieldWork(search);
    case PairKind::Proxy:
      return ProxyWork(search);
    case PairKind::AttachedProxy:
      return AttachedProxyWork(search);
  }
  return MeshWork(search);
}

}  // namespace palpate
