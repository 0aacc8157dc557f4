#include "MeshFiles/Inflate.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>

// Source: RFC 1950 (ZLIB), RFC 1951 (DEFLATE), and "LZ4 Block Format Description", Collet.

namespace palpate::files {

namespace {

struct Damage {};  ///< thrown

/// The bytes that were decompressed, of which there may be no more than `size`.
class Window {
 public:
  explicit Window(std::size_t size) : m_size(size) {}

  void append(std::string_view bytes) {
    if (bytes.size() > m_size - m_bytes.size()) throw Damage{};
    m_bytes += bytes;
  }
  /// Repeats bytes from so far back; they may overlap with what they become.
  void repeat(std::size_t distance, std::size_t length) {
    if (distance == 0 || distance > m_bytes.size() || length > m_size - m_bytes.size())
      throw Damage{};
    for (; length > 0; --length) m_bytes += m_bytes[m_bytes.size() - distance];
  }
  bool isFull() const { return m_bytes.size() == m_size; }
  std::string& bytes() { return m_bytes; }

 private:
  std::string m_bytes;
  std::size_t m_size;
};

class Bits {
 public:
  explicit Bits(std::string_view bytes) : m_bytes(bytes) {}

  std::uint32_t take(int count) {  // at most 16
    while (m_held < count) {
      m_bits |= std::uint32_t{byte()} << m_held;
      m_held += 8;
    }
    const std::uint32_t value = m_bits & ((1u << count) - 1);
    m_bits >>= count;
    m_held -= count;
    return value;
  }
  std::uint8_t byte() {
    if (m_at == m_bytes.size()) throw Damage{};
    return static_cast<std::uint8_t>(m_bytes[m_at++]);
  }
  void skipToByte() {
    m_bits = 0;
    m_held = 0;
  }
  std::string_view bytes(std::size_t count) {
    if (count > m_bytes.size() - m_at) throw Damage{};
    m_at += count;
    return m_bytes.substr(m_at - count, count);
  }

 private:
  std::string_view m_bytes;
  std::size_t m_at = 0;
  std::uint32_t m_bits = 0;
  int m_held = 0;
};

/// A canonical Huffman code. Codes of one length are consecutive numbers, in the symbols' order.
class Code {
 public:
  explicit Code(std::span<const std::uint8_t> lengths) {
    for (const std::uint8_t length : lengths) ++m_counts[length];
    m_counts[0] = 0;
    std::array<std::uint16_t, kLongest + 2> next{};
    std::int32_t left = 1;  // codes of this length that are not taken
    for (std::size_t length = 1; length <= kLongest; ++length) {
      left = 2 * left - m_counts[length];
      if (left < 0) throw Damage{};
      next[length + 1] = static_cast<std::uint16_t>(next[length] + m_counts[length]);
    }
    for (std::size_t symbol = 0; symbol < lengths.size(); ++symbol)
      if (lengths[symbol] != 0)
        m_symbols[next[lengths[symbol]]++] = static_cast<std::uint16_t>(symbol);
  }

  std::uint32_t read(Bits& bits) const {
    std::uint32_t code = 0, first = 0, index = 0;
    for (std::size_t length = 1; length <= kLongest; ++length) {
      code = code << 1 | bits.take(1);
      if (code - first < m_counts[length]) return m_symbols[index + code - first];
      index += m_counts[length];
      first = (first + m_counts[length]) << 1;
    }
    throw Damage{};
  }

 private:
  static constexpr std::size_t kLongest = 15;
  std::array<std::uint16_t, kLongest + 1> m_counts{};
  std::array<std::uint16_t, 288> m_symbols{};
};

struct Codes {
  Code literals, distances;
};

Codes fixedCodes() {
  std::array<std::uint8_t, 288> literals;
  for (std::size_t symbol = 0; symbol < literals.size(); ++symbol)
    literals[symbol] = symbol < 144 ? 8 : symbol < 256 ? 9 : symbol < 280 ? 7 : 8;
  std::array<std::uint8_t, 30> distances;
  distances.fill(5);
  return {Code(literals), Code(distances)};
}

Codes readCodes(Bits& bits) {
  constexpr std::uint8_t kOrder[]{16, 17, 18, 0, 8, 7, 9, 6, 10, 5, 11, 4, 12, 3, 13, 2, 14, 1, 15};
  const std::size_t literals = bits.take(5) + 257, distances = bits.take(5) + 1,
                    own = bits.take(4) + 4;
  if (literals > 286) throw Damage{};
  std::array<std::uint8_t, 19> ownLengths{};
  for (std::size_t i = 0; i < own; ++i)
    ownLengths[kOrder[i]] = static_cast<std::uint8_t>(bits.take(3));
  const Code code(ownLengths);
  std::array<std::uint8_t, 286 + 32> lengths{};
  for (std::size_t at = 0; at < literals + distances;) {
    const std::uint32_t symbol = code.read(bits);
    if (symbol < 16) {
      lengths[at++] = static_cast<std::uint8_t>(symbol);
      continue;
    }
    if (symbol == 16 && at == 0) throw Damage{};
    const std::uint8_t length = symbol == 16 ? lengths[at - 1] : std::uint8_t{0};
    const std::size_t times = symbol == 16   ? 3 + bits.take(2)
                              : symbol == 17 ? 3 + bits.take(3)
                                             : 11 + bits.take(7);
    if (times > literals + distances - at) throw Damage{};
    std::fill_n(lengths.begin() + static_cast<std::ptrdiff_t>(at), times, length);
    at += times;
  }
  const std::span all(lengths);
  return {Code(all.first(literals)), Code(all.subspan(literals, distances))};
}

/// A base and a number of bits to add, for symbols that come in groups: the number of bits grows by
/// one with each group.
std::size_t grouped(std::uint32_t symbol, std::uint32_t group, std::size_t first, Bits& bits) {
  if (symbol < 2 * group) return first + symbol;
  const auto more = static_cast<int>(symbol / group - 1);
  return first + (std::size_t{group + symbol % group} << more) + bits.take(more);
}

void readCompressed(Bits& bits, const Codes& codes, Window& window) {
  for (std::uint32_t symbol; (symbol = codes.literals.read(bits)) != 256;) {
    if (symbol < 256) {
      const char literal = static_cast<char>(symbol);
      window.append({&literal, 1});
      continue;
    }
    if (symbol > 285) throw Damage{};
    const std::size_t length = symbol == 285 ? 258 : grouped(symbol - 257, 4, 3, bits);
    const std::uint32_t distance = codes.distances.read(bits);
    if (distance > 29) throw Damage{};
    window.repeat(grouped(distance, 2, 1, bits), length);
  }
}

void readStored(Bits& bits, Window& window) {
  bits.skipToByte();
  const std::uint32_t length = bits.take(16), complement = bits.take(16);
  if ((length ^ complement) != 0xffff) throw Damage{};
  window.append(bits.bytes(length));
}

void readDeflate(Bits& bits, Window& window) {
  for (bool isLast = false; !isLast;) {
    isLast = bits.take(1) == 1;
    const std::uint32_t kind = bits.take(2);
    if (kind == 3) throw Damage{};
    if (kind == 0)
      readStored(bits, window);
    else
      readCompressed(bits, kind == 1 ? fixedCodes() : readCodes(bits), window);
  }
}

std::uint32_t adler32(std::string_view bytes) {
  std::uint32_t a = 1, b = 0;
  for (const char c : bytes) {
    a = (a + static_cast<std::uint8_t>(c)) % 65521;
    b = (b + a) % 65521;
  }
  return b << 16 | a;
}

/// A length of LZ4: 15 in a token goes on in bytes, until one of them is not 255.
std::size_t lz4Length(std::size_t inToken, Bits& bits) {
  std::size_t length = inToken;
  for (std::uint8_t more = inToken == 15 ? 255 : 0; more == 255; length += more) more = bits.byte();
  return length;
}

void readLz4(Bits& bits, Window& window) {
  for (;;) {
    const std::uint8_t token = bits.byte();
    window.append(bits.bytes(lz4Length(token >> 4, bits)));
    if (window.isFull()) return;  // the last sequence has literals only
    const std::size_t low = bits.byte(), high = bits.byte();
    window.repeat(low | high << 8, 4 + lz4Length(token & 15, bits));
  }
}

template <class Read>
std::optional<std::string> inflate(std::size_t size, Read&& read) {
  try {
    Window window(size);
    read(window);
    if (window.isFull()) return std::move(window.bytes());
  } catch (const Damage&) {
  }
  return std::nullopt;
}

}  // namespace

std::optional<std::string> inflateZlib(std::string_view packed, std::size_t size) {
  return inflate(size, [&](Window& window) {
    Bits bits(packed);
    const std::uint32_t method = bits.byte(), flags = bits.byte();
    if ((method & 15) != 8 || (method << 8 | flags) % 31 != 0 || (flags & 32) != 0) throw Damage{};
    readDeflate(bits, window);
    bits.skipToByte();
    std::uint32_t sum = 0;
    for (int i = 0; i < 4; ++i) sum = sum << 8 | bits.byte();
    if (sum != adler32(window.bytes())) throw Damage{};
  });
}

std::optional<std::string> inflateLz4(std::string_view packed, std::size_t size) {
  return inflate(size, [&](Window& window) {
    Bits bits(packed);
    readLz4(bits, window);
  });
}

}  // namespace palpate::files
