#include "Limits.h"

#include "Vtk/MeshFile.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace palpate::fuzz {

namespace {

void expectValid(const vtk::MeshFile& mesh) {
  EXPECT_FALSE(mesh.triangles.empty());
  EXPECT_TRUE(std::ranges::all_of(mesh.positions, [](const auto& p) { return p.allFinite(); }));
  EXPECT_TRUE(std::ranges::all_of(mesh.triangles, [&](const Triangle& triangle) {
    return std::ranges::max(triangle) < mesh.positions.size();
  }));
}

/// Reads a file's content as readTriangleMesh() does. decoded: bytes at most that it stands for.
void read(vtk::Polygons (*reader)(std::string_view), Bytes bytes, std::size_t decoded) {
  withinLimits(decoded, [&] {
    try {
      expectValid(reader(textOf(bytes)).mesh());
    } catch (const vtk::FileFault& fault) {
      expectShort(fault.reason);
    }
  });
}

}  // namespace

void objFile(Bytes bytes) { read(vtk::readObj, bytes, bytes.size()); }
void stlFile(Bytes bytes) { read(vtk::readStl, bytes, bytes.size()); }
void plyFile(Bytes bytes) { read(vtk::readPly, bytes, bytes.size()); }
void vtkFile(Bytes bytes) { read(vtk::readLegacyVtk, bytes, bytes.size()); }

void vtpFile(Bytes bytes) {
  constexpr std::size_t kMostCompression = 1032;  // of Zlib
  const bool isCompressed = textOf(bytes).find("compressor=") != std::string_view::npos;
  read(vtk::readVtp, bytes, (isCompressed ? kMostCompression : 1) * bytes.size());
}

}  // namespace palpate::fuzz
