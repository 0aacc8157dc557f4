#include <palpate/Settings.h>

#include "Common/SupportedMethods.h"

#include <algorithm>
#include <fstream>
#include <iostream>
#include <iterator>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

// SupportMatrix FILE [--write]: compares the rows of methods in Docs/SupportMatrix.md with the
// table of support, or writes them.

namespace palpate::testing {
namespace {

using Named = std::pair<std::string, GeometryType>;
const std::vector<Named> kTypes{{"meshes", GeometryType::Triangles},
                                {"lines", GeometryType::Lines},
                                {"points", GeometryType::Points},
                                {"shapes", GeometryType::Shape}};

std::string cellOf(GeometryType a, GeometryType b) {
  std::vector<Method> methods = supportedMethods(a, b);
  std::stable_partition(methods.begin(), methods.end(),
                        [](Method method) { return method == Method::Auto; });
  if (methods.size() > 3 && methods.back() != Method::Proxy) return " every method but `Proxy` |";
  std::string cell;
  for (const Method method : methods)
    cell += (cell.empty() ? " `" : ", `") + std::string(toString(method)) + "`";
  return cell + " |";
}

/// The row that begins with this name, with a cell for each type.
std::string rowOf(const Named& first) {
  std::string row = "| **" + first.first + "** |";
  for (const Named& second : kTypes) row += cellOf(first.second, second.second);
  return row;
}

int run(const std::string& path, bool writes) {
  std::vector<std::string> rows;
  for (const Named& type : kTypes) rows.push_back(rowOf(type));
  std::ifstream file(path);
  std::string old, line, text;
  while (std::getline(file, line)) {
    old += line + "\n";
    for (const std::string& row : rows)
      if (line.compare(0, line.find("** |") + 4, row, 0, row.find("** |") + 4) == 0) line = row;
    text += line + "\n";
  }
  for (const std::string& row : rows)
    if (text.find(row + "\n") == std::string::npos) {
      std::cerr << path << " has no row for " << row << "\n";
      return 1;
    }
  if (writes)
    std::ofstream(path) << text;
  else if (text != old)
    std::cerr << path << " differs from Validity/Support.h: run SupportMatrix FILE --write\n";
  return !writes && text != old;
}

}  // namespace
}  // namespace palpate::testing

int main(int count, char** arguments) {
  return count < 2 ? 1 : palpate::testing::run(arguments[1], count > 2);
}
