#pragma once

#include <cstdint>

namespace palpate {

/// How a geometry was set in one step, by which a missing advance() is noticed
/// (Validity::advanceMayBeMissing): each set then moves it on by about as much as the first.
struct StepSets {
  double first = 0.0, whole = 0.0;  ///< L: the motion by the first set, and by all of them
  std::uint32_t count = 0;          ///< of sets whose motions added up, one after another
  bool isSet = false;               ///< at least once
  bool isDetected = false;          ///< a detection has used the last set
  bool addUp = false;               ///< the answer for this step

  /// The first set that moved the geometry, measured when there is another one.
  void begin(double motion) {
    if (motion == 0.0) return;
    first = whole = motion;
    count = 1;
  }
  /// Another set, which moves the geometry by `last`, so that it has moved by `now` in the step.
  void add(double last, double now) {
    if (last == 0.0) return;
    // A correction by a solver is small, or leads back. Any such shares will do.
    constexpr double kShareOfFirst = 0.5, kShareOfLast = 0.75;
    constexpr std::uint32_t kWithDetections = 4;
    const bool goesOn = last >= kShareOfFirst * first && now >= whole + kShareOfLast * last;
    count = goesOn ? count + 1 : 1;
    addUp |= goesOn && (!isDetected || count >= kWithDetections);
    whole = now;
  }
};

}  // namespace palpate
