// Files that VTK compressed, and such that are made to take much memory.
#include "Unit/MeshFiles/MeshFileFixture.h"

#include <gtest/gtest.h>
#include <vtkDataCompressor.h>
#include <vtkLZ4DataCompressor.h>
#include <vtkNew.h>
#include <vtkSmartPointer.h>
#include <vtkZLibDataCompressor.h>

#include <random>
#include <string>
#include <vector>

namespace palpate::testing {
namespace {

std::string vtp(const std::string& compressor, const std::string& pieces,
                const std::string& appended) {
  return "<VTKFile type=\"PolyData\" byte_order=\"LittleEndian\" compressor=\"" + compressor +
         "\"><PolyData>" + pieces + "</PolyData><AppendedData encoding=\"raw\">_" + appended +
         "</AppendedData></VTKFile>";
}

std::string compressed(vtkDataCompressor& compressor, const std::string& plain) {
  std::string packed(compressor.GetMaximumCompressionSpace(plain.size()), '\0');
  packed.resize(compressor.Compress(reinterpret_cast<const unsigned char*>(plain.data()),
                                    plain.size(), reinterpret_cast<unsigned char*>(packed.data()),
                                    packed.size()));
  return packed;
}

/// An array of one block.
std::string block(const std::string& packed, std::size_t plainSize) {
  return bytes(std::uint32_t{1}) + bytes(static_cast<std::uint32_t>(plainSize)) +
         bytes(std::uint32_t{0}) + bytes(static_cast<std::uint32_t>(packed.size())) + packed;
}

/// A piece whose coordinates are the first appended array, and one triangle.
std::string piece(std::size_t points) {
  return "<Piece NumberOfPoints=\"" + std::to_string(points) +
         "\" NumberOfPolys=\"1\"><Points><DataArray type=\"UInt8\" format=\"appended\" "
         "offset=\"0\"/></Points><Polys><DataArray type=\"UInt8\" Name=\"connectivity\" "
         "format=\"ascii\">0 1 2</DataArray><DataArray type=\"UInt8\" Name=\"offsets\" "
         "format=\"ascii\">3</DataArray></Polys></Piece>";
}

/// Bytes that compress well, badly, and by references that overlap with what they give.
std::vector<std::string> plainTexts() {
  std::mt19937 random(7);
  std::vector<std::string> texts{std::string(9, '\1'), std::string(30'000, '\2')};
  for (const unsigned range : {2u, 16u, 256u}) {
    std::string& text = texts.emplace_back(60'000, ' ');
    for (char& c : text) c = static_cast<char>(random() % range);
  }
  std::string& mixed = texts.emplace_back();
  for (unsigned i = 0; mixed.size() < 90'000; ++i) {
    const auto repeats = random() % 300;
    const auto letter = static_cast<char>(random() % 256);
    const auto start = random() % (mixed.size() + 1);
    const std::string again = mixed.substr(start, random() % 900);
    mixed += std::string(repeats, letter) + again;
  }
  for (std::string& text : texts) text.resize(text.size() / 3 * 3);
  return texts;
}

template <class Compressor>
void expectReadBack(const char* name, const std::vector<int>& levels) {
  for (const std::string& plain : plainTexts())
    for (const int level : levels) {
      vtkNew<Compressor> compressor;
      compressor->SetCompressionLevel(level);
      const std::string packed = compressed(*compressor, plain);
      const ReadOutcome outcome = outcomeOf(
          "compressed.vtp", vtp(name, piece(plain.size() / 3), block(packed, plain.size())));
      ASSERT_EQ(outcome.refusal, "") << level << " " << plain.size();
      for (std::size_t i = 0; i < plain.size(); ++i)
        ASSERT_EQ(outcome.mesh.positions[i / 3][static_cast<int>(i % 3)],
                  static_cast<unsigned char>(plain[i]));
    }
}

TEST(CompressedFiles, BlocksOfEveryLevelAreReadBack) {
  expectReadBack<vtkZLibDataCompressor>("vtkZLibDataCompressor", {0, 1, 5, 9});
  expectReadBack<vtkLZ4DataCompressor>("vtkLZ4DataCompressor", {1, 5, 9});
}

template <class Compressor>
void expectDamageIsFound(const char* name, bool hasSum) {
  const std::string plain = plainTexts().back().substr(0, 900);
  vtkNew<Compressor> compressor;
  const std::string packed = compressed(*compressor, plain);
  const auto read = [&](const std::string& bytes) {
    return outcomeOf("compressed.vtp", vtp(name, piece(300), block(bytes, 900)));
  };
  const MeshArrays whole = read(packed).mesh;
  std::mt19937 random(3);
  for (std::size_t at = 0; at < packed.size(); ++at) {
    std::string damaged = packed;
    damaged[at] = static_cast<char>(damaged[at] ^ (1 << random() % 8));
    const ReadOutcome one = read(damaged);
    EXPECT_TRUE(!hasSum || one.refusal != "" || one.mesh.positions == whole.positions) << at;
    EXPECT_NE(read(packed.substr(0, at)).refusal, "") << at;
  }
  EXPECT_NE(outcomeOf("compressed.vtp", vtp(name, piece(300), block(packed, 899))).refusal, "");
  EXPECT_NE(outcomeOf("compressed.vtp", vtp(name, piece(300), block(packed, 901))).refusal, "");
}

TEST(CompressedFiles, DamagedAndTruncatedBlocksAreRefused) {
  expectDamageIsFound<vtkZLibDataCompressor>("vtkZLibDataCompressor", true);
  expectDamageIsFound<vtkLZ4DataCompressor>("vtkLZ4DataCompressor", false);
}

/// Compressed pieces may not decode to more in all than ZLib can store in the file.
TEST(CompressedFiles, PiecesThatShareABlockAreRefused) {
  constexpr std::size_t kDecoded = 3'000'000;
  vtkNew<vtkZLibDataCompressor> compressor;
  const std::string shared = block(compressed(*compressor, std::string(kDecoded, '\1')), kDecoded);
  const std::string one = piece(1'000'000), zlib = "vtkZLibDataCompressor";
  EXPECT_EQ(outcomeOf("compressed.vtp", vtp(zlib, one, shared)).refusal, "");
  const std::string many = vtp(zlib, repeated(one, 60 * one.size()), shared);
  const ReadOutcome outcome = outcomeOf("compressed.vtp", many);
  EXPECT_NE(outcome.refusal, "");
  EXPECT_LE(outcome.peak, 20 * 1032 * many.size() + 1'000'000);
}

}  // namespace
}  // namespace palpate::testing
