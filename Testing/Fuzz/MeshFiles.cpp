#include "Limits.h"

#include "MeshFiles/Formats.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <optional>

namespace palpate::fuzz {

namespace {

using Reader = void (*)(files::FileText, files::MeshBuilder&);
using Writer = std::string (*)(const MeshArrays&, const MeshWriteSettings&);

void expectValid(const MeshArrays& mesh) {
  EXPECT_TRUE(std::ranges::all_of(mesh.positions, [](const auto& p) { return p.allFinite(); }));
  const auto expectIndices = [&](const auto& elements) {
    EXPECT_TRUE(std::ranges::all_of(elements, [&](const auto& element) {
      return std::ranges::max(element) < mesh.positions.size();
    }));
  };
  expectIndices(mesh.triangles);
  expectIndices(mesh.tetrahedra);
  expectIndices(mesh.segments);
  expectIndices(files::pointElements(mesh));
}

/// What is read can be written, and then reads the same.
void expectRoundTrip(const MeshArrays& mesh, Reader reader, Writer writer) {
  for (const bool isBinary : {false, true}) {
    const MeshArrays again = files::meshOf(reader, writer(mesh, {.binary = isBinary}));
    EXPECT_EQ(again.positions, mesh.positions);
    EXPECT_EQ(again.triangles, mesh.triangles);
    EXPECT_EQ(again.tetrahedra, mesh.tetrahedra);
    EXPECT_EQ(again.segments, mesh.segments);
    EXPECT_EQ(again.points, mesh.points);
  }
}

/// Reads a file's content as readMeshFile() does. decoded: bytes at most that it stands for.
void read(Reader reader, Writer writer, Bytes bytes, std::size_t decoded) {
  std::optional<MeshArrays> mesh;
  withinLimits(decoded, [&] {
    try {
      mesh = files::meshOf(reader, textOf(bytes));
    } catch (const files::FileFault& fault) {
      expectShort(fault.reason);
    }
  });
  if (!mesh) return;
  expectValid(*mesh);
  if (writer) expectRoundTrip(*mesh, reader, writer);
}

void readXml(Reader reader, Writer writer, Bytes bytes) {
  constexpr std::size_t kMostCompression = 1032;  // of ZLib
  const bool isCompressed = textOf(bytes).find("compressor=") != std::string_view::npos;
  read(reader, writer, bytes, (isCompressed ? kMostCompression : 1) * bytes.size());
}

}  // namespace

void objFile(Bytes bytes) { read(files::readObj, files::writeObj, bytes, bytes.size()); }
// Vertices of an STL file that is written are those of its facets.
void stlFile(Bytes bytes) { read(files::readStl, nullptr, bytes, bytes.size()); }
void plyFile(Bytes bytes) { read(files::readPly, files::writePly, bytes, bytes.size()); }
void vtkFile(Bytes bytes) {
  read(files::readLegacyVtk, files::writeLegacyVtk, bytes, bytes.size());
}
void vtpFile(Bytes bytes) { readXml(files::readVtp, files::writeVtp, bytes); }
void vtuFile(Bytes bytes) { readXml(files::readVtu, files::writeVtu, bytes); }
void gmshFile(Bytes bytes) { read(files::readGmsh, files::writeGmsh, bytes, bytes.size()); }
void meditFile(Bytes bytes) { read(files::readMedit, files::writeMedit, bytes, bytes.size()); }

}  // namespace palpate::fuzz
