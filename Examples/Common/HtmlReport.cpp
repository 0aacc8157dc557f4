#include "HtmlReport.h"

#include "Page.h"

#include <string_view>

namespace palpate::report {

namespace {

/// The content of HtmlReport.html, which CMake inserts.
constexpr std::string_view kPage =
#include "HtmlReportPage.inc"
    ;

}  // namespace

std::string toHtml(const Figures& figures, const View& view) {
  Json json{{"title", view.title}, {"paragraphs", view.paragraphs},
            {"group", view.group}, {"series", view.series},
            {"label", view.label}, {"first", view.first},
            {"x", view.x},         {"y", view.y},
            {"xLow", view.xLow},   {"xHigh", view.xHigh},
            {"front", view.front}, {"lines", view.lines},
            {"logX", view.logX},   {"texts", figures.textKeys()}};
  for (const Quantity& quantity : figures.quantities())
    json["quantities"].push_back({{"key", quantity.key}, {"label", quantity.label}});
  for (const Figures::Row& row : figures.rows())
    json["rows"].push_back({{"texts", row.texts}, {"values", row.values}});  // NaN becomes null
  return filled(kPage, json);
}

}  // namespace palpate::report
