#pragma once

#include <nlohmann/json.hpp>

#include <string>
#include <string_view>

namespace palpate::report {

using Json = nlohmann::ordered_json;

inline std::string replaced(std::string text, std::string_view mark, std::string_view by) {
  return text.replace(text.find(mark), mark.size(), by);
}

/// The page with the data in place of {{data}}. Escapes "</", because "</script>" in a text would
/// end the data.
inline std::string filled(std::string_view page, const Json& data) {
  std::string text = data.dump();
  for (std::size_t at = 0; (at = text.find("</", at)) != std::string::npos; at += 3)
    text.replace(at, 2, "<\\/");
  return replaced(std::string(page), "{{data}}", text);
}

}  // namespace palpate::report
