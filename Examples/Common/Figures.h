#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

namespace palpate::report {

/// A column of numbers in a table of figures.
struct Quantity {
  std::string key;    ///< name in the CSV
  std::string label;  ///< text at an axis, with the unit
};

/// A table of measured figures. Each row has texts that name it, and numbers. A missing number is
/// NaN.
class Figures {
 public:
  struct Row {
    std::vector<std::string> texts;
    std::vector<double> values;
  };

  Figures(std::vector<std::string> textKeys, std::vector<Quantity> quantities)
      : m_textKeys(std::move(textKeys)), m_quantities(std::move(quantities)) {}

  void add(Row);
  const std::vector<std::string>& textKeys() const { return m_textKeys; }
  const std::vector<Quantity>& quantities() const { return m_quantities; }
  const std::vector<Row>& rows() const { return m_rows; }
  std::size_t indexOf(const std::string& quantity) const;  ///< throws std::out_of_range
  /// The row whose first texts are these, or null.
  const Row* find(std::span<const std::string> texts) const;

  std::string csv() const;
  /// Adds the rows of a file that csv() wrote. Adds none if the file does not exist or has other
  /// columns.
  void addFrom(const std::filesystem::path& csv);

 private:
  std::string header() const;

  std::vector<std::string> m_textKeys;
  std::vector<Quantity> m_quantities;
  std::vector<Row> m_rows;
};

/// Formats a number with three significant digits.
std::string shortNumber(double);

}  // namespace palpate::report
