#pragma once

#include "Case.h"
#include "Contestant.h"

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

namespace palpate::stability {

/// What a method promises to report, and is held to.
enum class Definition {
  None,          ///< another's method, or one put together
  Intersection,  ///< triangles that intersect at the end of a frame
  Proximity,     ///< features within the thickness at the end of a frame
  Continuous,    ///< features that touch within a frame, and when
  Auto           ///< no feature that touches within a frame is missing
};

struct Subject {
  accuracy::Contestant contestant;
  Definition definition;
};

/// The methods of the chart that are swept.
std::vector<Subject> subjects();

/// Counts cases, but for the contacts' own faults.
struct Tally {
  std::size_t cases = 0;
  std::size_t touching = 0;  ///< the triangles touch, at any time
  // Wrong about that:
  std::size_t missed = 0;       ///< touch, and nothing is reported
  std::size_t missedApart = 0;  ///< of these, those that do not touch from the start
  std::size_t invented = 0;     ///< reported to touch, and do not
  std::size_t turned = 0;       ///< a normal points to the side that the features did not come from
  // Wrong by the method's own definition, features compared one by one:
  std::size_t undefinedMissed = 0, undefinedInvented = 0, untimely = 0;
  // Contacts:
  std::size_t contacts = 0, notFinite = 0, notUnit = 0;
  std::size_t flipped = 0;  ///< cases with a normal that is turned by noise of 1e-7 of the size
  double milliseconds = 0;
  // Answers, frame by frame. Wrong: features that touch in the frame are missing or a normal is on
  // the wrong side; of a method that speaks of triangles, that they do not touch although they do.
  std::size_t answers = 0, wrong = 0;
  std::size_t silent = 0;  ///< wrong and trusted
  std::size_t alarms = 0;  ///< right and not trusted
};

/// `count` random cases of one step of a sweep, by every subject.
std::vector<Tally> runStep(const Sweep&, double value, std::size_t count,
                           const std::vector<Subject>&);

}  // namespace palpate::stability
