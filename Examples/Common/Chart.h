#pragma once

#include "Figures.h"

#include <filesystem>
#include <string>
#include <vector>

namespace palpate::report {

/// One diagram: of the rows whose text in the column `group` is `value`, y over x, a colour for
/// each text in the column `series`.
struct Diagram {
  std::string title;
  std::string group, value, series;
  std::string x, y;  ///< quantities
  bool logX = true;
  bool lines = false;  ///< points of a series are joined in the order of x
  bool front = false;  ///< the Pareto front is drawn
};

struct Charts {
  std::vector<Diagram> diagrams;  ///< row by row
  int columns = 1;
  int width = 640, height = 420;  ///< pixels of one diagram
};

/// Writes PATH.svg and, where there is a display (xvfb-run -a), PATH.png. Returns the files.
std::vector<std::filesystem::path> draw(const Figures&, const Charts&,
                                        const std::filesystem::path& path);

}  // namespace palpate::report
