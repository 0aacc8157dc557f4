#include "MeshFiles/Inflate.h"

#include <gtest/gtest.h>

#include <string>
#include <string_view>

namespace palpate::files {
namespace {

template <std::size_t N>
constexpr std::string_view view(const char (&literal)[N]) {
  return {literal, N - 1};  // zeros included
}

std::string livers(int count) {
  std::string text;
  for (int i = 0; i < count; ++i) text += "liver";
  return text;
}

/// Text that a code of its own is worth, and repetitions that overlap with themselves.
std::string mixed() {
  std::string text;
  for (int i = 0; i < 600; ++i) text += static_cast<char>(i * i / 7 % 61 + 32);
  return text + livers(60);
}

// By Python's zlib: a code of its own (level 9), and the fixed code.
constexpr std::string_view kOwnCode = view(
    "\x78\xda\xed\x91\xcb\x8e\x9b\x30\x00\x00\x7f\x85\x80\x60\xcd\x23\x10\x63\x03\x8e\x05\x0b"
    "\xc6\x78\xb5\x04\x93\x08\x43\x4c\x82\xb9\xf6\x50\xa9\xa7\x1e\xfa\xfd\xcd\x4a\xfd\x80\x5e"
    "\x2b\x75\x0e\x73\x1f\x8d\x65\x59\x07\xdb\x71\xdf\xfc\x30\x86\x98\x94\x4d\xd7\x5f\xe7\xa7"
    "\x0d\xe2\xac\xe4\xc3\x6c\xbc\x84\xb0\xe1\x6e\x47\x45\x3b\x3e\x01\x6e\xc6\x2d\x20\x1f\x8b"
    "\x8b\xb9\x72\x33\x71\xf7\xe9\x60\xa5\x9d\x8e\x6a\xe5\x57\x13\xa8\x54\xd0\xe8\x44\xec\xf9"
    "\x08\x9a\x07\x92\x80\x19\xa2\x92\x0b\xe0\xf6\xfb\x76\xd6\xf9\x8c\x15\x9a\x90\xc2\x4b\xb1"
    "\x52\x53\x3b\x22\x90\x70\xa1\x56\x17\xde\x72\xc3\xc3\x89\x3a\x3d\xda\xba\x64\x6d\x8f\xba"
    "\x8d\x1f\x22\xdd\x2f\xc4\x53\xec\xb4\xcb\x32\xda\x86\xf2\xb8\x5f\x1b\xe4\xe9\xbe\x82\xee"
    "\x2a\x59\x1e\xd9\x77\xc9\x29\xf4\x0f\xfa\xf6\xc9\x28\x8e\x81\x63\xf4\x34\xf6\xa2\xad\xcb"
    "\x73\x91\xa1\x14\x9e\x92\x17\x27\x98\xa2\xac\x38\x97\x75\x2b\xfa\x71\xd2\xc6\x01\x31\xa6"
    "\xec\xf3\xa6\x0f\x3e\xa4\x5c\xbe\x9a\x72\x26\x57\x17\x56\xbd\xf6\x50\x73\xdd\x8f\xe5\xb0"
    "\x45\xa5\xdc\x4f\x4c\x79\xe4\xb2\xa7\xe2\x11\xb7\xfa\xd8\xae\x49\xb7\xa1\xde\xa1\x53\xc8"
    "\x4d\x7e\x0b\x3b\x8b\x2e\x50\x06\xc2\xa9\x0d\x5d\x8b\xe5\x4f\xd4\x9c\xeb\xf3\xf6\x6e\x73"
    "\x70\x49\x14\x31\x0c\x48\xf4\x68\xc0\x98\xef\x22\xd1\x4d\xa0\x2a\x30\x55\xbe\xaa\x23\xdd"
    "\xa5\xd6\x40\xfd\xbb\xc8\x5c\xc5\xb1\xbb\x7c\x90\x60\x1b\x1b\x0c\x9e\x63\x5b\xbc\x9a\x06"
    "\x46\x12\xcf\xcc\x03\x2f\xb3\x18\xd8\xcf\xf9\xda\x77\x4d\x49\x30\x8c\x43\xff\xcd\x75\xec"
    "\x83\xf5\xc5\xbf\xb3\xea\xc7\xf7\x5f\xdf\x7e\xfe\xd7\x5f\xe9\x37\x53\xe5\x10\xe2");
constexpr std::string_view kFixedCode =
    view("\x78\x01\xcb\xc9\x2c\x4b\x2d\xca\x19\x25\x88\x21\x00\x3e\xfd\x7f\xf9");

TEST(Inflate, AllKindsOfBlocks) {
  EXPECT_EQ(inflateZlib(kOwnCode, mixed().size()), mixed());
  EXPECT_EQ(inflateZlib(kFixedCode, 300), livers(60));
  const std::string_view stored = view(
      "\x78\x01\x01\x03\x00\xfc\xff"
      "abc"
      "\x02\x4d\x01\x27");
  EXPECT_EQ(inflateZlib(stored, 3), "abc");
}

TEST(Inflate, DamagedTruncatedAndWrongSizesAreNoticed) {
  EXPECT_EQ(inflateZlib(kOwnCode, mixed().size() - 1), std::nullopt);
  EXPECT_EQ(inflateZlib(kOwnCode, mixed().size() + 1), std::nullopt);
  for (std::size_t size = 0; size < kOwnCode.size(); ++size)
    EXPECT_EQ(inflateZlib(kOwnCode.substr(0, size), mixed().size()), std::nullopt) << size;
  for (std::size_t bit = 0; bit < 8 * kOwnCode.size(); ++bit) {
    std::string damaged(kOwnCode);
    damaged[bit / 8] = static_cast<char>(damaged[bit / 8] ^ 1 << bit % 8);
    const auto result = inflateZlib(damaged, mixed().size());
    // Three bits of the header say how it was compressed, and no more.
    EXPECT_TRUE(!result || *result == mixed()) << bit;
  }
}

TEST(Inflate, Lz4) {
  // "abcd", then 15 + 4 + 5 bytes from 4 back, then "e".
  const std::string_view packed = view(
      "\x4f"
      "abcd"
      "\x04\x00\x05"
      "\x10"
      "e");
  EXPECT_EQ(inflateLz4(packed, 29), "abcdabcdabcdabcdabcdabcdabcde");
  for (std::size_t size = 0; size < packed.size(); ++size)
    EXPECT_EQ(inflateLz4(packed.substr(0, size), 29), std::nullopt) << size;
  EXPECT_EQ(inflateLz4(packed, 28), std::nullopt);
  EXPECT_EQ(inflateLz4(packed, 30), std::nullopt);
  EXPECT_EQ(inflateLz4(view("\x1f"
                            "a"
                            "\x02\x00\x00"
                            "\x10"
                            "e"),
                       21),
            std::nullopt);  // from before
  EXPECT_EQ(inflateLz4(view("\x1f"
                            "a"
                            "\x00\x00\x00"
                            "\x10"
                            "e"),
                       21),
            std::nullopt);  // from itself
  EXPECT_EQ(inflateLz4(view("\x00"), 0), "");
}

}  // namespace
}  // namespace palpate::files
