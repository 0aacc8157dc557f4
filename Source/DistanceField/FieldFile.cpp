#include "DistanceField/FieldFile.h"

#include <palpate/AnalyticalGeometry.h>
#include <palpate/Error.h>

#include "Core/Assert.h"
#include "Core/WholeFile.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <fstream>
#include <iterator>
#include <string>
#include <string_view>
#include <system_error>
#include <type_traits>
#include <utility>
#include <vector>

namespace palpate {

namespace {

constexpr std::string_view kTitle("palpate-field\0\0\0", 16);
constexpr std::uint32_t kVersion = 2;
constexpr std::size_t kHeader = 104, kChecksum = 8;
/// L: no build makes a domain with larger coordinates. The surface and its band are within
/// 2 kLargestMeasure, and the units add less than half of it.
constexpr double kLargestFileDomain = 4.0 * kLargestMeasure;

std::uint64_t checksumOf(std::string_view bytes) {
  std::uint64_t sum = 0xcbf29ce484222325u;
  for (const char byte : bytes) sum = (sum ^ static_cast<unsigned char>(byte)) * 0x100000001b3u;
  return sum;
}

/// Appends numbers to a text, the lowest byte first.
class Writer {
 public:
  explicit Writer(std::size_t size) { m_bytes.reserve(size); }
  void title() { m_bytes += kTitle; }
  template <class Integer>
  void integer(Integer value) {
    const auto bits = static_cast<std::make_unsigned_t<Integer>>(value);
    for (std::size_t i = 0; i < sizeof bits; ++i)
      m_bytes += static_cast<char>(static_cast<unsigned char>(bits >> 8 * i));
  }
  void real(double value) { integer(std::bit_cast<std::uint64_t>(value)); }
  void real(float value) { integer(std::bit_cast<std::uint32_t>(value)); }
  const std::string& bytes() const { return m_bytes; }

 private:
  std::string m_bytes;
};

/// Reads such a text. Throws Error (ErrorCode::File) that names the file and the byte.
class Reader {
 public:
  Reader(const std::filesystem::path& path, std::string bytes)
      : m_name("the distance field \"" + path.string() + "\""), m_bytes(std::move(bytes)) {}

  template <class Integer>
  Integer integer() {
    if (m_bytes.size() - m_at < sizeof(Integer)) fail("the file is truncated");
    std::make_unsigned_t<Integer> bits = 0;
    for (std::size_t i = 0; i < sizeof bits; ++i)
      bits |= static_cast<decltype(bits)>(static_cast<unsigned char>(m_bytes[m_at + i])) << 8 * i;
    m_last = m_at;
    m_at += sizeof bits;
    return static_cast<Integer>(bits);
  }
  double real() {
    const auto value = std::bit_cast<double>(integer<std::uint64_t>());
    if (!std::isfinite(value)) refuse("a number is not finite");
    return value;
  }
  float shortReal() {
    const auto value = std::bit_cast<float>(integer<std::uint32_t>());
    if (!std::isfinite(value)) refuse("a distance is not finite");
    return value;
  }
  void title() {
    if (!std::string_view(m_bytes).starts_with(kTitle)) fail("it is not a distance field");
    m_at = kTitle.size();
  }
  void checksum() {
    if (m_bytes.size() < kHeader + kChecksum) fail("the file is truncated");
    const std::size_t end = m_bytes.size() - kChecksum, at = std::exchange(m_at, end);
    if (integer<std::uint64_t>() != checksumOf(std::string_view(m_bytes).substr(0, end)))
      refuse("the checksum is wrong");
    m_bytes.resize(end);
    m_at = at;
  }
  std::size_t left() const { return m_bytes.size() - m_at; }
  [[noreturn]] void fail(const std::string& reason) const {
    throw Error(ErrorCode::File, m_name + ", byte " + std::to_string(m_at) + ": " + reason);
  }
  /// For a fault of the last number.
  [[noreturn]] void refuse(const std::string& reason) const {
    throw Error(ErrorCode::File, m_name + ", byte " + std::to_string(m_last) + ": " + reason);
  }

 private:
  std::string m_name, m_bytes;
  std::size_t m_at = 0, m_last = 0;
};

/// An entry in block `block`, or among the roots (-1). Children come after their parent, so that
/// no cell contains itself.
CellEntry entryOf(Reader& file, bool isClosed, std::size_t blocks, std::size_t leaves,
                  std::int64_t block) {
  const CellEntry entry{file.integer<std::uint32_t>()};
  const auto index = static_cast<std::int64_t>(entry.index());
  const CellKind kind = entry.kind();
  if (kind == CellKind::Block && (entry.index() >= blocks || index <= block))
    file.refuse("block " + std::to_string(index) + " is out of range");
  if (kind == CellKind::Leaf && entry.index() >= leaves)
    file.refuse("leaf " + std::to_string(index) + " is out of range");
  if (!entry.isReliable() && (isClosed || (kind != CellKind::Leaf && kind != CellKind::Outside)))
    file.refuse("the sign of a cell cannot be unreliable");
  if (kind != CellKind::Block && kind != CellKind::Leaf && index != 0)
    file.refuse("a cell without values has an index");
  return entry;
}

}  // namespace

void writeField(const FieldCells& cells, const std::filesystem::path& path) {
  PALPATE_ASSERT(cells.roots.size() == std::size_t{cells.size[0]} * cells.size[1] * cells.size[2]);
  Writer file(kHeader + cells.bytes() + kChecksum);
  file.title();
  file.integer(kVersion);
  file.integer(static_cast<std::int32_t>(cells.exponent));
  file.real(cells.errorBound);
  file.real(cells.band);
  for (const std::int64_t origin : cells.origin) file.integer(origin);
  for (const std::uint32_t size : cells.size) file.integer(size);
  file.integer(std::uint32_t{cells.isClosed ? 0u : 1u});
  file.real(cells.unreliableMargin);
  file.integer(std::uint64_t{cells.blocks.size()});
  file.integer(std::uint64_t{cells.leaves.size()});
  for (const CellEntry entry : cells.roots) file.integer(entry.bits);
  for (const FieldCells::Block& block : cells.blocks)
    for (const CellEntry entry : block) file.integer(entry.bits);
  for (const FieldCells::Leaf& leaf : cells.leaves)
    for (const float value : leaf) file.real(value);
  file.integer(checksumOf(file.bytes()));

  writeWholeFile(path, file.bytes(), "the distance field");
}

FieldCells readField(const std::filesystem::path& path) {
  Reader file(path, readWholeFile(path, "the distance field"));
  file.title();
  if (const auto version = file.integer<std::uint32_t>(); version != kVersion)
    file.refuse("the version is " + std::to_string(version) + "; version " +
                std::to_string(kVersion) + " can be read");
  file.checksum();
  FieldCells cells;
  cells.exponent = file.integer<std::int32_t>();
  if (cells.exponent < -1000 || cells.exponent > 1000) file.refuse("the exponent is out of range");
  cells.errorBound = file.real();
  if (!(cells.errorBound > 0)) file.refuse("the error bound is not positive");
  cells.band = file.real();
  if (!(cells.band > 0)) file.refuse("the band is not positive");
  if (std::ldexp(cells.band, -cells.exponent) > kMostRoots) file.refuse("the band is too wide");
  for (std::int64_t& origin : cells.origin) {
    origin = file.integer<std::int64_t>();
    if (origin < -kMostOrigin || origin > kMostOrigin) file.refuse("the origin is out of range");
  }
  std::size_t roots = 1;
  for (std::uint32_t& size : cells.size) {
    size = file.integer<std::uint32_t>();
    if (size < 1 || size > kMostRoots) file.refuse("the number of cells is out of range");
    roots *= size;
  }
  for (std::size_t k = 0; k < 3; ++k)
    for (const std::int64_t end : {cells.origin[k], cells.origin[k] + cells.size[k]})
      if (!(std::abs(std::ldexp(static_cast<double>(end), cells.exponent)) <= kLargestFileDomain))
        file.refuse("the domain is out of range");
  const auto isOpen = file.integer<std::uint32_t>();
  if (isOpen > 1) file.refuse("the number is not 0 or 1");
  cells.isClosed = isOpen == 0;
  cells.unreliableMargin = file.real();
  if (!(cells.unreliableMargin >= 0)) file.refuse("the margin is negative");
  const auto blocks = file.integer<std::uint64_t>(), leaves = file.integer<std::uint64_t>();
  // The counts are compared with the bytes that are there before any memory is allocated.
  const std::size_t most = file.left() / sizeof(FieldCells::Leaf);
  if (blocks > most || leaves > most || std::max(blocks, leaves) >= CellEntry::kMostIndices ||
      roots * sizeof(CellEntry) + (blocks + leaves) * sizeof(FieldCells::Leaf) != file.left())
    file.refuse("the numbers of cells do not match the size of the file");
  const auto entry = [&](std::int64_t block) {
    return entryOf(file, cells.isClosed, blocks, leaves, block);
  };
  cells.roots.resize(roots);
  for (CellEntry& root : cells.roots) root = entry(-1);
  cells.blocks.resize(blocks);
  std::vector<std::uint8_t> levels(blocks);  // of the cells that have the block
  for (std::size_t i = 0; i < blocks; ++i)
    for (CellEntry& child : cells.blocks[i]) {
      child = entry(static_cast<std::int64_t>(i));
      if (child.kind() != CellKind::Block) continue;
      std::uint8_t& level = levels[child.index()];
      level = std::max<std::uint8_t>(level, levels[i] + 1);
      if (level >= kMostLevels) file.refuse("the cells are too deep");
    }
  cells.leaves.resize(leaves);
  for (FieldCells::Leaf& leaf : cells.leaves)
    for (float& value : leaf) value = file.shortReal();
  return cells;
}

}  // namespace palpate
