#pragma once

#include "Measure.h"
#include "Report.h"

namespace palpate::benchmark {

/// What the rows beside the race need to know.
struct RowOptions {
  std::vector<int> threads = {1, 2};
  std::size_t frames = 0;
  MeasureOptions measure;
  std::string sharedData;
  bool quick = false;  ///< a million triangles at most, a hundred steady frames
};

/// Each prints a table of Palpate alone, or beside Embree where a limit is set against it.
void stageRows(Report&,
               const RowOptions&);  ///< milliseconds of each stage, ns per triangle and pair
void wholeFrameRows(Report&, const RowOptions&);  ///< organs, all contacts delivered and sorted
void farFlungRows(Report&, const RowOptions&);    ///< one triangle a million scene sizes away
void stillRows(Report&, const RowOptions&);       ///< nothing moved
void payRows(Report&, const RowOptions&);         ///< a small tool against large still sheets
void scaleRows(Report&, const RowOptions&);       ///< to four million triangles, bytes a triangle
void steadyRows(Report&, const RowOptions&);      ///< allocations of a thousand frames, p99
void featureRows(Report&, const RowOptions&);     ///< vertex-triangle and edge-edge candidates
void lineRows(Report&, const RowOptions&);        ///< a suture with itself and with organs
void shapeRows(Report&, const RowOptions&);       ///< a capsule in a sheet, and in points
void insideRows(Report&, const RowOptions&);      ///< vertices inside a body, particles around it
void rigidRows(Report&, const RowOptions&);       ///< a large bone moved by its transform
void continuousRows(Report&, const RowOptions&);  ///< times of impact of the published steps
void validityRows(Report&, const RowOptions&);    ///< what validity() takes of a frame
void simdRows(Report&, const RowOptions&);        ///< every path that this processor runs

/// Of the step from a workload's first frame to its second.
std::size_t featureCandidates(const Workload&);

}  // namespace palpate::benchmark
