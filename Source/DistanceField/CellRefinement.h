#pragma once

#include "DistanceField/CellCertifier.h"
#include "DistanceField/CellTree.h"
#include "DistanceField/SurfaceSign.h"
#include "Bodies/Body.h"
#include "Core/Threads.h"

#include <cstddef>
#include <functional>

namespace palpate {

/// What a build asks about the mesh.
struct FieldSurface {
  const SurfaceSign& sign;
  const Body& body;  ///< without copies of triangles
  const CellCertifier certifier;
};

/// The threads of a build, and the share of it that is done.
struct BuildProgress {
  const Threads& threads;
  std::function<bool(double)> progress;  ///< see DistanceFieldSettings
  int rounds = 0;                        ///< of refinement that have started
  bool isEstimated = false;              ///< the need for memory

  /// Throws Cancelled if the user cancels.
  void report(double fraction) const;
};

/// Refines the cells from `first` on: evaluates the distance at corners that are new, keeps a cell
/// if its error is certainly small or if it is beyond the band, and else splits it. Throws
/// MemoryLimit.
void refine(CellTree&, std::size_t first, const FieldSurface&, BuildProgress&);

}  // namespace palpate
