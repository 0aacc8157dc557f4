#pragma once

#include "Case.h"
#include "Contestant.h"

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

namespace palpate::stability {

/// What a method reports by definition. The program checks it.
enum class Definition {
  None,          ///< no definition of the library: FCL, or Proximity in substeps
  Intersection,  ///< triangles that intersect at the end of a frame
  Proximity,     ///< features within the thickness at the end of a frame
  Continuous,    ///< features that touch within a frame, with the time
  Auto,          ///< at least all features that touch within a frame
  /// The same. In a frame that begins in intersection, contacts of vertices that are known to be
  /// behind the surface stand for others.
  DistinctAuto
};

struct Subject {
  accuracy::Contestant contestant;
  Definition definition;
};

/// The methods that the sweeps test.
std::vector<Subject> subjects();

/// Counts of one method, at one step of a sweep.
struct Tally {
  // Cases, about the two triangles as a whole:
  std::size_t cases = 0;
  std::size_t touching = 0;           ///< the triangles touch at any time
  std::size_t falseNegatives = 0;     ///< the triangles touch, and nothing is reported
  std::size_t falseNegativesNew = 0;  ///< false negatives in which they do not touch at the start
  std::size_t falsePositives = 0;     ///< a touch is reported, and the triangles do not touch
  std::size_t wrongSide = 0;  ///< a normal points to the side that the features did not come from
  std::size_t turnedByNoise = 0;  ///< noise of 1e-7 turns a normal by more than 90 degrees
  // Feature pairs that differ from the method's own definition:
  std::size_t featuresMissing = 0, featuresExtra = 0, untimely = 0;
  // Contacts:
  std::size_t contacts = 0, notFinite = 0, notUnit = 0;
  double milliseconds = 0;
  // Answers, one a frame. An answer is wrong if it lacks an impact of the frame, or if a normal is
  // on the wrong side. An answer of triangles is wrong if it has none although impacts exist.
  std::size_t answers = 0, wrong = 0;
  std::size_t wrongTrusted = 0;    ///< wrong and trusted
  std::size_t rightUntrusted = 0;  ///< right and not trusted
};

/// Runs `count` random cases of one step of a sweep with every subject.
std::vector<Tally> runStep(const Sweep&, double value, std::size_t count,
                           const std::vector<Subject>&);

}  // namespace palpate::stability
