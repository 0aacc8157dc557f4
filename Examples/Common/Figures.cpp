#include "Figures.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <stdexcept>

namespace palpate::report {

namespace {

/// Refuses texts with a comma, a quote or a line break, which a field of this CSV cannot hold.
void checkText(const std::string& text) {
  if (text.find_first_of(",\"\n\r") != std::string::npos)
    throw std::invalid_argument("\"" + text + "\" has a comma, a quote or a line break");
}

std::string number(const char* format, double value) {
  std::array<char, 32> text;
  return {text.data(),
          static_cast<std::size_t>(std::snprintf(text.data(), text.size(), format, value))};
}

std::vector<std::string> fieldsOf(const std::string& line) {
  std::vector<std::string> fields{""};
  for (const char c : line) {
    if (c == ',')
      fields.emplace_back();
    else
      fields.back() += c;
  }
  return fields;
}

}  // namespace

void Figures::add(Row row) {
  if (row.texts.size() != m_textKeys.size() || row.values.size() != m_quantities.size())
    throw std::invalid_argument("The row has other columns than the table.");
  for (const std::string& text : row.texts) checkText(text);
  m_rows.push_back(std::move(row));
}

std::size_t Figures::indexOf(const std::string& quantity) const {
  for (std::size_t i = 0; i < m_quantities.size(); ++i)
    if (m_quantities[i].key == quantity) return i;
  throw std::out_of_range("no quantity " + quantity);
}

const Figures::Row* Figures::find(std::span<const std::string> texts) const {
  const auto row = std::find_if(m_rows.begin(), m_rows.end(), [&](const Row& candidate) {
    return std::equal(texts.begin(), texts.end(), candidate.texts.begin());
  });
  return row == m_rows.end() ? nullptr : &*row;
}

std::string Figures::header() const {
  std::string line;
  for (const std::string& key : m_textKeys) line += key + ",";
  for (const Quantity& quantity : m_quantities) line += quantity.key + ",";
  line.back() = '\n';
  return line;
}

std::string Figures::csv() const {
  std::string text = header();
  for (const Row& row : m_rows) {
    for (const std::string& field : row.texts) text += field + ",";
    for (const double value : row.values) text += number("%.6g", value) + ",";
    text.back() = '\n';
  }
  return text;
}

void Figures::addFrom(const std::filesystem::path& csv) {
  std::ifstream file(csv);
  std::string line;
  if (!std::getline(file, line) || line + "\n" != header()) return;
  while (std::getline(file, line)) {
    const std::vector<std::string> fields = fieldsOf(line);
    if (fields.size() != m_textKeys.size() + m_quantities.size()) return;
    const auto firstValue = fields.begin() + static_cast<std::ptrdiff_t>(m_textKeys.size());
    Row row{{fields.begin(), firstValue}, {}};
    for (auto field = firstValue; field != fields.end(); ++field)
      row.values.push_back(std::strtod(field->c_str(), nullptr));
    add(std::move(row));
  }
}

std::string shortNumber(double value) { return number("%.3g", value); }

}  // namespace palpate::report
