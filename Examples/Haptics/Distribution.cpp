#include "Distribution.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

namespace palpate::scenes {

namespace {

constexpr double kWidth = 560, kHeight = 300, kLeft = 64, kRight = 32, kTop = 36, kBottom = 48;
constexpr int kLeastShare = -5;  // 10^-5
constexpr std::array<const char*, 4> kColours{"#0b5394", "#b45f06", "#38761d", "#741b47"};
/// The shares of samples that stay at or below a row's value.
constexpr std::array<double, 12> kShares{0,    0.25,  0.5,   0.75,   0.9,    0.95,
                                         0.99, 0.995, 0.999, 0.9995, 0.9999, 1};

template <class... Values>
std::string format(const char* text, Values... values) {
  std::array<char, 400> line;
  std::snprintf(line.data(), line.size(), text, values...);
  return line.data();
}

std::string panelOf(const Panel& panel, double top) {
  double most = 1e-9, least = 1e9;
  for (const Distribution* line : panel.lines)
    for (const double sample : line->samples)
      if (sample > 0) most = std::max(most, sample), least = std::min(least, sample);
  const double first = std::floor(std::log10(std::max(least, 1e-4 * most))),
               last = std::max(first + 1, std::ceil(std::log10(most)));
  const auto x = [&](double value) {
    const double at = std::log10(std::max(value, 1e-300));
    return kLeft + (kWidth - kLeft - kRight) * std::clamp((at - first) / (last - first), 0.0, 1.0);
  };
  const auto y = [&](double share) {
    const double at = std::log10(std::max(share, 1e-300)) / kLeastShare;
    return top + kTop + (kHeight - kTop - kBottom) * std::clamp(at, 0.0, 1.0);
  };
  std::string svg = format("<text x='%g' y='%g' font-weight='bold'>%s</text>\n", kLeft, top + 20,
                           panel.title.c_str());
  for (int i = 0; i >= kLeastShare; --i)
    svg += format(
        "<line x1='%g' x2='%g' y1='%.1f' y2='%.1f' stroke='#ddd'/>"
        "<text x='%g' y='%.1f' text-anchor='end'>%g %%</text>\n",
        kLeft, kWidth - kRight, y(std::pow(10, i)), y(std::pow(10, i)), kLeft - 6,
        y(std::pow(10, i)) + 4, 100 * std::pow(10, i));
  for (double i = first; i <= last; ++i)
    svg += format(
        "<line x1='%.1f' x2='%.1f' y1='%g' y2='%g' stroke='#ddd'/>"
        "<text x='%.1f' y='%g' text-anchor='middle'>%g %s</text>\n",
        x(std::pow(10, i)), x(std::pow(10, i)), top + kTop, top + kHeight - kBottom,
        x(std::pow(10, i)), top + kHeight - kBottom + 18, std::pow(10, i), panel.unit.c_str());
  for (std::size_t k = 0; k < panel.lines.size(); ++k) {
    const Distribution& line = *panel.lines[k];
    const char* const colour = kColours[k % kColours.size()];
    const double count = static_cast<double>(line.samples.size());
    svg += format("<polyline fill='none' stroke='%s' stroke-width='1.5' points='", colour);
    std::string lastPoint;
    for (std::size_t i = 0; i < line.samples.size(); ++i) {
      std::string point = format("%.0f,%.0f ", x(line.samples[i]),
                                 y(static_cast<double>(line.samples.size() - i) / count));
      if (point != lastPoint) svg += point;
      lastPoint = std::move(point);
    }
    svg += "'/>\n";
    svg +=
        format("<text x='%g' y='%g' fill='%s'>%s</text>\n", kLeft + 8,
               top + kHeight - kBottom - 8 - 16 * static_cast<double>(panel.lines.size() - 1 - k),
               colour, line.name.c_str());
  }
  return svg;
}

}  // namespace

void Distribution::sort() { std::sort(samples.begin(), samples.end()); }

double Distribution::at(double share) const {
  if (samples.empty()) return 0;
  const auto size = static_cast<double>(samples.size());
  return samples[static_cast<std::size_t>(std::max(0.0, std::ceil(share * size) - 1))];
}

std::string csvOf(const std::vector<Distribution>& all) {
  std::string csv = "quantity,samples";
  for (const double share : kShares) csv += format(",p%g", 100 * share);
  csv += '\n';
  for (const Distribution& each : all) {
    csv += format("%s,%zu", each.name.c_str(), each.samples.size());
    for (const double share : kShares) csv += format(",%.6g", each.at(share));
    csv += '\n';
  }
  return csv;
}

std::string svgOf(const std::vector<Panel>& panels) {
  const double height = kHeight * static_cast<double>(panels.size());
  std::string svg = format(
      "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 %g %g' font-family='sans-serif' "
      "font-size='12'>\n<rect width='%g' height='%g' fill='white'/>\n",
      kWidth, height, kWidth, height);
  for (std::size_t i = 0; i < panels.size(); ++i)
    svg += panelOf(panels[i], kHeight * static_cast<double>(i));
  return svg + "</svg>\n";
}

}  // namespace palpate::scenes
