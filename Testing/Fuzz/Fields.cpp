#include "Limits.h"

#include "DistanceField/FieldCells.h"
#include "Math/Range.h"

#include <palpate/DistanceField.h>
#include <palpate/Error.h>

#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

namespace palpate::fuzz {

namespace {

/// Points in the domain and around it, at borders of its cells and between them. Those that calls
/// refuse are left out.
std::vector<Eigen::Vector3d> pointsOf(const FieldCells& cells) {
  constexpr std::array kParts{-0.5, 0.0, 0.1, 0.5, 1.0, 1.75};
  const FieldFrame frame(cells);
  std::vector<Eigen::Vector3d> points;
  for (const double x : kParts)
    for (const double y : kParts)
      for (const double z : kParts) {
        const std::array parts{x, y, z};
        Eigen::Vector3d& point = points.emplace_back();
        for (std::size_t k = 0; k < 3; ++k)
          point[static_cast<int>(k)] = frame.origin[k] + parts[k] * frame.size[k] * frame.unit;
      }
  std::erase_if(points, [](const Eigen::Vector3d& point) { return !isWithinRange(point); });
  return points;
}

void check(const DistanceField& field) {
  const std::vector<Eigen::Vector3d> points =
      pointsOf(DistanceField::Implementation::lookupOf(field).cells());
  std::vector<double> values(points.size());
  field.values(points, values);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double value = field.value(points[i]);
    EXPECT_TRUE(std::isfinite(value)) << value;
    EXPECT_GE(value, -field.band());
    EXPECT_EQ(std::bit_cast<std::uint64_t>(value), std::bit_cast<std::uint64_t>(values[i]));
    EXPECT_TRUE(field.gradient(points[i]).allFinite());
  }
}

void load(std::string_view content) {
  const std::filesystem::path path = fileWith(content);
  std::optional<DistanceField> field;
  withinLimits(content.size(), [&] {
    try {
      field = DistanceField::load(path);
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::File);
      expectShort(error.what());
    }
  });
  if (field) check(*field);
}

/// FNV-1a, as in FieldFile.h.
std::uint64_t checksumOf(std::string_view bytes) {
  std::uint64_t sum = 0xcbf29ce484222325u;
  for (const char byte : bytes) sum = (sum ^ static_cast<unsigned char>(byte)) * 0x100000001b3u;
  return sum;
}

}  // namespace

/// The file, and the file with the right checksum, which no fuzzer would find.
void fieldFile(Bytes bytes) {
  std::string content(textOf(bytes));
  load(content);
  if (content.size() < sizeof(std::uint64_t)) return;
  content.resize(content.size() - sizeof(std::uint64_t));
  const std::uint64_t sum = checksumOf(content);
  for (std::size_t i = 0; i < sizeof sum; ++i) content += static_cast<char>(sum >> 8 * i & 0xff);
  load(content);
}

}  // namespace palpate::fuzz
