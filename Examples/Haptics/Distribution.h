#pragma once

#include <string>
#include <vector>

namespace palpate::scenes {

/// Samples of one quantity.
struct Distribution {
  std::string name;  ///< with the unit
  std::vector<double> samples;

  void sort();
  double at(double share) const;  ///< after sort(): the sample that this share does not exceed
  double most() const { return at(1.0); }
};

/// How many samples are above each value: a line for each distribution, as CSV.
std::string csvOf(const std::vector<Distribution>&);

/// The same as a chart: the share of samples above a value, both logarithmic.
struct Panel {
  std::string title, unit;
  std::vector<const Distribution*> lines;
};
std::string svgOf(const std::vector<Panel>&);

}  // namespace palpate::scenes
