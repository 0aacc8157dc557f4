#include "HtmlReport.h"

#include <nlohmann/json.hpp>

#include <string_view>

namespace palpate::report {

namespace {

/// HtmlReport.html, its bytes put here by CMake.
constexpr std::string_view kPage =
#include "HtmlReportPage.inc"
    ;

using Json = nlohmann::ordered_json;

void replace(std::string& text, std::string_view mark, const std::string& by) {
  text.replace(text.find(mark), mark.size(), by);
}

/// "</script>" in a text would end the data.
std::string inScript(const Json& json) {
  std::string text = json.dump();
  for (std::size_t at = 0; (at = text.find("</", at)) != std::string::npos; at += 3)
    text.replace(at, 2, "<\\/");
  return text;
}

}  // namespace

std::string toHtml(const Figures& figures, const View& view) {
  Json json{{"title", view.title},
            {"paragraphs", view.paragraphs},
            {"group", view.group},
            {"series", view.series},
            {"label", view.label},
            {"first", view.first},
            {"x", view.x},
            {"y", view.y},
            {"front", view.front},
            {"lines", view.lines},
            {"texts", figures.textKeys()}};
  for (const Quantity& quantity : figures.quantities())
    json["quantities"].push_back({{"key", quantity.key}, {"label", quantity.label}});
  for (const Figures::Row& row : figures.rows())
    json["rows"].push_back({{"texts", row.texts}, {"values", row.values}});  // NaN becomes null
  std::string page(kPage);
  replace(page, "{{data}}", inScript(json));
  return page;
}

}  // namespace palpate::report
