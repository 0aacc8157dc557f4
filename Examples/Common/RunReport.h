#pragma once

#include "SceneProgram.h"
#include "World.h"

#include <limits>
#include <memory>
#include <set>
#include <span>
#include <string>
#include <vector>

namespace palpate::scenes {

/// The values of a quantity, one for each frame. The name ends with the unit, as "force mN".
struct Series {
  std::string name;
  std::vector<double> values;
  double budget = std::numeric_limits<double>::infinity();  ///< frames above it are marked
};

/// The report of a run as one HTML page that needs no other file and no network: its frames in 3D,
/// and a row for each series.
///
/// Bounds   positions are rounded to 1/8463 of their box. When the frames exceed 7.5 MB, the page
///          holds every second, fourth ... frame, and those in which a series is worst. Meshes of
///          more than 60,000 triangles are simplified on a grid. Every n-th is shown of more than
///          10,000 points, and of more than 4,000 contacts of a frame.
class RunReport {
 public:
  struct Text {
    std::string title;
    std::vector<std::string> paragraphs;
    std::string unit;      ///< of lengths
    int worst = 0;         ///< the frame that the page shows at first
    std::string whyWorst;  ///< in a few words
  };

  RunReport(World&, std::span<const BodyLook>, const PictureView&);
  ~RunReport();
  /// worst: the frames in which a series has its worst value so far.
  void add(World&, int frame, const std::set<int>& worst);
  std::string html(const Text&, std::span<const Series>) const;

 private:
  struct Implementation;
  std::unique_ptr<Implementation> m_implementation;
};

}  // namespace palpate::scenes
