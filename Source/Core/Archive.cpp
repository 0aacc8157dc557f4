#include "Core/Archive.h"

#include <palpate/Error.h>

#include <algorithm>
#include <utility>

namespace palpate {

namespace {

constexpr std::size_t kTitleSize = 16, kChecksumSize = 8;

}  // namespace

std::uint64_t archiveChecksum(std::span<const std::byte> bytes) {
  constexpr std::uint64_t kPrime = 0x100000001b3u;
  // Processors compute four sums at once.
  std::array<std::uint64_t, 4> sums{1, 2, 3, 4};
  std::array<std::uint64_t, 4> words{};
  const auto add = [&] {
    for (std::size_t k = 0; k < sums.size(); ++k) {
      const std::uint64_t product = (sums[k] ^ words[k]) * kPrime;
      sums[k] = product ^ product >> 32;
    }
  };
  const std::size_t rest = bytes.size() % sizeof words, end = bytes.size() - rest;
  for (std::size_t i = 0; i < end; i += sizeof words) {
    std::memcpy(words.data(), bytes.data() + i, sizeof words);
    add();
  }
  if (rest > 0) {
    words = {};
    std::memcpy(words.data(), bytes.data() + end, rest);
    add();
  }
  std::uint64_t sum = bytes.size();
  for (const std::uint64_t each : sums) sum = (sum ^ each) * kPrime;
  return sum;
}

ArchiveWriter::ArchiveWriter(std::string_view title, std::uint32_t version,
                             std::size_t expectedSize)
    : m_bytes(std::max<std::size_t>(4096, expectedSize)) {
  std::array<char, kTitleSize> padded{};
  std::copy_n(title.begin(), std::min(title.size(), padded.size()), padded.begin());
  append(padded.data(), padded.size());
  integer(version);
}

std::vector<std::byte> ArchiveWriter::bytes() {
  const std::uint64_t sum = archiveChecksum(std::span(m_bytes).first(m_size));
  append(&sum, kChecksumSize);
  m_bytes.resize(m_size);
  return std::move(m_bytes);
}

ArchiveReader::ArchiveReader(std::span<const std::byte> bytes, std::string name,
                             std::string_view title, std::uint32_t version)
    : m_bytes(bytes), m_name(std::move(name)) {
  std::array<char, kTitleSize> found{}, padded{};
  std::copy_n(title.begin(), std::min(title.size(), padded.size()), padded.begin());
  if (bytes.size() < kTitleSize + sizeof version + kChecksumSize) fail("it is truncated");
  take(found.data(), found.size());
  if (found != padded) {
    m_at = 0;
    fail("these bytes are something else");
  }
  std::uint32_t number = 0;
  integer(number);
  if (number != version)
    fail("the version is " + std::to_string(number) + "; version " + std::to_string(version) +
         " can be read");
  std::uint64_t sum = 0;
  std::memcpy(&sum, bytes.data() + bytes.size() - kChecksumSize, kChecksumSize);
  m_bytes = bytes.first(bytes.size() - kChecksumSize);
  if (sum != archiveChecksum(m_bytes)) {
    m_at = m_bytes.size();
    fail("the checksum is wrong: it is truncated or changed");
  }
}

void ArchiveReader::fail(const std::string& reason) const {
  throw Error(ErrorCode::File, m_name + ", byte " + std::to_string(m_at) + ": " + reason);
}

}  // namespace palpate
