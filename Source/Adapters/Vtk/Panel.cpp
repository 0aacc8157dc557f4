#include "Vtk/Panel.h"

#include <palpate/Error.h>

#include <array>
#include <cstdio>

namespace palpate::vtk {

namespace {

/// Why the answer is not trusted, in a few words.
const char* reasonOf(const Validity& validity) {
  if (!validity.startedApart && validity.method != Method::Intersection)
    return "may intersect at the start";
  if (validity.displacementOverLimit() > 1) return "moves further than the method's limit";
  return "see validity()";
}

}  // namespace

const CollisionData& answerOf(const OctreeBasedCD& detection, GeometryId a, GeometryId b) {
  static const CollisionData none;
  try {
    return detection.collisionData(a, b);
  } catch (const Error& error) {
    if (error.code() != ErrorCode::NotAvailable) throw;
  }
  return none;
}

std::string panelText(const OctreeBasedCD& detection,
                      const std::function<std::string(GeometryId)>& nameOf, int frame,
                      double framesPerSecond) {
  constexpr std::size_t kMostReasons = 3;
  const FrameStatistics& statistics = detection.statistics();
  const FrameStatistics::Stages& ms = statistics.milliseconds;
  std::string text;
  std::array<char, 160> line;
  const auto add = [&](const char* format, auto... values) {
    std::snprintf(line.data(), line.size(), format, values...);
    text += line.data();
  };
  add("frame         %8d\n", frame);
  if (framesPerSecond > 0) add("frame rate    %8.1f /s\n", framesPerSecond);
  add("contacts      %8zu\n", statistics.contacts);
  add("candidates    %8zu\n", statistics.candidatePairs);
  add("detection     %8.3f ms\n", ms.total());
  const std::array<std::pair<const char*, double>, 5> stages{{{"boxes", ms.boxes},
                                                              {"octree", ms.octree},
                                                              {"pairs", ms.pairs},
                                                              {"narrow phase", ms.narrowPhase},
                                                              {"order", ms.order}}};
  for (const auto& [name, value] : stages) add(" %-12s %8.3f ms\n", name, value);
  std::size_t trusted = 0, reasons = 0;
  std::string untrusted;
  for (const auto& [a, b, settings] : detection.pairs()) {
    const Validity& validity = answerOf(detection, a, b).validity();
    trusted += validity.trusted;
    if (!validity.trusted && reasons++ < kMostReasons)
      untrusted += "\n " + nameOf(a) + ", " + nameOf(b) + ": " + reasonOf(validity);
  }
  add("trusted pairs %8zu of %zu", trusted, detection.pairs().size());
  text += untrusted;
  if (reasons > kMostReasons) add("\n and %zu more pairs", reasons - kMostReasons);
  return text;
}

}  // namespace palpate::vtk
