#pragma once

#include "Figures.h"

#include <string>
#include <vector>

namespace palpate::report {

/// What the page shows at first. The reader can change it there.
struct View {
  std::string title;
  std::vector<std::string> paragraphs;  ///< what was measured, and how to read it
  std::string group;            ///< text column; the page shows the rows of one value at a time
  std::string series;           ///< text column; each value has a colour and a mark
  std::string label;            ///< text column; name of a point within its series
  std::string first;            ///< value of the group
  std::string x, y;             ///< quantities; smaller is better
  std::string xLow{}, xHigh{};  ///< quantities: bounds of x, drawn as a bar; or empty
  bool front = false;           ///< draws the Pareto front
  bool lines = false;           ///< joins a series' points in the order of x
  bool logX = true;
};

/// Returns one HTML page that needs no other file and no network.
std::string toHtml(const Figures&, const View&);

}  // namespace palpate::report
