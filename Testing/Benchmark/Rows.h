#pragma once

#include "Measure.h"
#include "Report.h"

namespace palpate::benchmark {

/// Options of the tables other than "race".
struct RowOptions {
  std::vector<int> threads = {1, 2};
  std::size_t frames = 0;
  MeasureOptions measure;
  std::string sharedData;
  bool quick = false;  ///< a million triangles at most, a hundred steady frames
  /// Parts of names, of which one must match; empty: all. Of the scenes of the tables race,
  /// bounds, queries and fields, and of engines.
  std::vector<std::string> scenes, engines;
};

/// Whether one of the parts is in a name, or there are none.
bool isWanted(const std::string& name, const std::vector<std::string>& parts);

// Each prints a table of Palpate alone, or beside a baseline.

/// Milliseconds of each stage, nanoseconds per triangle and per pair.
void stageRows(Report&, const RowOptions&);
void wholeFrameRows(Report&, const RowOptions&);   ///< organs, all contacts, sorted
void farTriangleRows(Report&, const RowOptions&);  ///< one triangle a million scene sizes away
void atRestRows(Report&, const RowOptions&);       ///< nothing moved
void smallToolRows(Report&, const RowOptions&);    ///< a small tool against large sheets at rest
void scaleRows(Report&, const RowOptions&);    ///< up to four million triangles, bytes per triangle
void steadyRows(Report&, const RowOptions&);   ///< allocations of a thousand frames, p99
void featureRows(Report&, const RowOptions&);  ///< vertex-triangle and edge-edge candidates
void lineRows(Report&, const RowOptions&);     ///< a suture with itself and with organs
void shapeRows(Report&, const RowOptions&);    ///< a capsule in a sheet, and in points
void insideRows(Report&, const RowOptions&);   ///< vertices inside a body, particles around it
void rigidRows(Report&, const RowOptions&);    ///< a large bone moved by its transform
void fieldFrameRows(Report&, const RowOptions&);  ///< its distance field beside its triangles
void proxyRows(Report&, const RowOptions&);       ///< a million particles near a large bone
void coarseRows(Report&, const RowOptions&);      ///< a bone behind its certified simplification
void boundsRows(Report&, const RowOptions&);      ///< placed bodies with each kind of bounds
void continuousRows(Report&, const RowOptions&);  ///< times of impact of the published steps
void validityRows(Report&, const RowOptions&);    ///< the share of validity() in a frame
void restingRows(Report&, const RowOptions&);     ///< a sheet on another, partly fast, or aligned
void freeMotionRows(Report&, const RowOptions&);  ///< free motion beside Continuous, and its share
void keptRows(Report&, const RowOptions&);        ///< slow frames with kept candidates
void optionRows(Report&, const RowOptions&);   ///< options of a pair, cuts, budgets, saved states
void cutRows(Report&, const RowOptions&);      ///< cuts of all sizes beside new objects
void spatialRows(Report&, const RowOptions&);  ///< spatial queries beside other libraries
void fieldRows(Report&, const RowOptions&);    ///< distance fields beside OpenVDB
void simdRows(Report&, const RowOptions&);     ///< every path that this processor runs

/// The number of feature candidates in the step from a workload's first frame to its second.
std::size_t featureCandidates(const Workload&);

}  // namespace palpate::benchmark
