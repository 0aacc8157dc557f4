#include "HtmlReport.h"

#include <nlohmann/json.hpp>

#include <cstdint>
#include <string_view>

namespace palpate::report {

namespace {

/// The content of HtmlReport.html, which CMake inserts.
constexpr std::string_view kPage =
#include "HtmlReportPage.inc"
    ;

using Json = nlohmann::ordered_json;

void replace(std::string& text, std::string_view mark, const std::string& by) {
  text.replace(text.find(mark), mark.size(), by);
}

/// Escapes "</", because "</script>" in a text would end the data.
std::string inScript(const Json& json) {
  std::string text = json.dump();
  for (std::size_t at = 0; (at = text.find("</", at)) != std::string::npos; at += 3)
    text.replace(at, 2, "<\\/");
  return text;
}

std::string base64(std::string_view bytes) {
  constexpr std::string_view kDigits =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  for (std::size_t at = 0; at < bytes.size(); at += 3) {
    std::uint32_t bits = 0;
    for (std::size_t i = 0; i < 3; ++i)
      bits = bits << 8 | (at + i < bytes.size() ? static_cast<unsigned char>(bytes[at + i]) : 0u);
    for (std::size_t i = 0; i < 4; ++i)
      text += at + i <= bytes.size() ? kDigits[bits >> (18 - 6 * i) & 63] : '=';
  }
  return text;
}

}  // namespace

std::string toHtml(const Figures& figures, const View& view) {
  Json json{{"title", view.title}, {"paragraphs", view.paragraphs},
            {"group", view.group}, {"series", view.series},
            {"label", view.label}, {"first", view.first},
            {"x", view.x},         {"y", view.y},
            {"xLow", view.xLow},   {"xHigh", view.xHigh},
            {"front", view.front}, {"lines", view.lines},
            {"logX", view.logX},   {"texts", figures.textKeys()}};
  json["pictures"] = Json::array();
  for (const std::string& png : view.pictures) json["pictures"].push_back(base64(png));
  for (const Quantity& quantity : figures.quantities())
    json["quantities"].push_back({{"key", quantity.key}, {"label", quantity.label}});
  for (const Figures::Row& row : figures.rows())
    json["rows"].push_back({{"texts", row.texts}, {"values", row.values}});  // NaN becomes null
  std::string page(kPage);
  replace(page, "{{data}}", inScript(json));
  return page;
}

}  // namespace palpate::report
