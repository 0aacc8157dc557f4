#pragma once

#include "Figures.h"

#include <string>
#include <vector>

namespace palpate::report {

/// How figures are first shown; the reader may choose otherwise.
struct View {
  std::string title;
  std::vector<std::string> paragraphs;  ///< what was measured and how it is to be read
  std::string group;                    ///< text column: one of its values is shown at a time
  std::string series;                   ///< text column: a colour each
  std::string label;                    ///< text column: what a point is called within its series
  std::string first;                    ///< of the group's values
  std::string x, y;                     ///< quantities; smaller is better
  bool front = false;                   ///< the Pareto front is drawn
  bool lines = false;                   ///< a series' points are joined in the order of x
  bool logX = true;
  std::vector<std::string> pictures{};  ///< contents of PNG files
};

/// One page that needs neither network nor any other file.
std::string toHtml(const Figures&, const View&);

}  // namespace palpate::report
