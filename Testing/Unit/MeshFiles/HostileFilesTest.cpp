// Files that are made to take much memory or time.
#include "MeshFileFixture.h"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <utility>
#include <vector>

namespace palpate::testing {
namespace {

constexpr std::size_t kSize = 400'000;

std::string ply(const std::string& header, const std::string& body) {
  return "ply\nformat binary_little_endian 1.0\n" + header + "end_header\n" + body;
}
std::string vtkFile(const std::string& version, const std::string& body) {
  return "# vtk DataFile Version " + version + "\nx\nBINARY\nDATASET POLYDATA\n" + body;
}
std::string vtp(const std::string& attributes, const std::string& pieces,
                const std::string& appended = "") {
  return "<VTKFile type=\"PolyData\" byte_order=\"LittleEndian\"" + attributes + "><PolyData>" +
         pieces + "</PolyData>" + appended + "</VTKFile>";
}
const std::string kXyz = "property uchar x\nproperty uchar y\nproperty uchar z\n";
const std::string kThree = "element vertex 3\n" + kXyz;

/// Files without compression, each by a name that ends in its format.
std::vector<std::pair<std::string, std::string>> hostileFiles() {
  const std::string n = std::to_string(kSize), third = std::to_string(kSize / 3);
  const std::string points(9, '\1');
  std::vector<std::pair<std::string, std::string>> files{
      {"no-properties.ply", ply(repeated("element vertex 100\n", kSize), "")},
      {"nothing.ply", ply(repeated("element x 100\n", kSize), "")},
      {"elements.ply", ply(repeated("element x 0\n", kSize), "")},
      {"properties.ply", ply("element x 0\n" + repeated("property char a\n", kSize), "")},
      {"vertices.ply", ply("element vertex " + third + "\n" + kXyz, std::string(kSize, '\1'))},
      {"faces.ply", ply(kThree + "element face " + std::to_string(kSize / 4) +
                            "\nproperty list uchar uchar vertex_index\n",
                        points + repeated(std::string("\3\0\1\2", 4), kSize))},
      {"empty-faces.ply",
       ply(kThree + "element face " + n + "\nproperty list uchar uchar vertex_index\n",
           points + std::string(kSize, '\0'))},
      {"strip.ply",
       ply(kThree + "element tristrips 1\nproperty list uint uchar vertex_index\n",
           points + bytes(static_cast<std::uint32_t>(kSize)) + std::string(kSize, '\1'))},
      {"corners.obj", "v 0 0 0\n" + repeated("f 1 1 1\n", kSize)},
      {"vertices.obj", repeated("v 1 2 3\n", kSize) + "f 1 2 3\n"},
      {"empty.obj", repeated("f\n", kSize)},
      {"lines.obj", "v 0 0 0\nf 1 1 " + repeated("1\\\n ", kSize)},
      {"text.stl", "solid facet\n" + repeated("vertex 1 2 3 ", kSize) + "\nendsolid"},
      {"points.vtk", vtkFile("3.0", "POINTS " + third + " char\n" + std::string(kSize, '\1'))},
      {"strips.vtk",
       vtkFile("5.1", "POINTS 3 char\n" + points + "TRIANGLE_STRIPS 2 " + n + "\nOFFSETS int\n" +
                          std::string(4, '\0') + std::string{'\0', '\6', '\32', char(0x80)} +
                          "CONNECTIVITY char\n" + std::string(kSize, '\1'))},
      {"offsets.vtk",
       vtkFile("5.1", "POINTS 3 char\n" + points + "POLYGONS " + n + " 0\nOFFSETS char\n" +
                          std::string(kSize, '\0') + "CONNECTIVITY char\n")},
      {"set.vtk", "# vtk DataFile Version 3.0\nx\nASCII\nDATASET " + std::string(kSize, 'x')},
      {"pieces.vtp", vtp("", repeated("<Piece ", kSize) + "</Piece>")},
      {"arrays.vtp",
       vtp("", "<Piece NumberOfPoints=\"1\"><Points>" +
                   repeated("<DataArray Name=\"offsets\" ", kSize) + "</Points></Piece>")}};

  files.emplace_back("tags.msh", "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n" +
                                     std::to_string(kSize / 8) + "\n" +
                                     repeated("1 1 1 1\n", kSize));
  std::string nodes, elements;
  for (std::size_t i = 0; nodes.size() < kSize; ++i)
    nodes += std::to_string(2 * i + 1) + " 0 0 0\n";
  const auto count = [](const std::string& lines) {
    return std::to_string(std::count(lines.begin(), lines.end(), '\n'));
  };
  files.emplace_back("sparse.msh", "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n" + count(nodes) +
                                       "\n" + nodes +
                                       "$EndNodes\n$Elements\n1\n1 2 0 1 3 5\n$EndElements\n");
  elements = repeated("1 15 0 1\n", kSize);
  files.emplace_back(
      "points.msh",
      "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n1\n1 0 0 0\n$EndNodes\n$Elements\n" +
          count(elements) + "\n" + elements + "$EndElements\n");
  files.emplace_back("sections.msh",
                     "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n" + repeated("$a\n$Enda\n", kSize));
  files.emplace_back("open.msh",
                     "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n" + repeated("$a\n", kSize));
  files.emplace_back("blocks.msh", "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n" +
                                       std::to_string(kSize / 8) + " 0 0 0\n" +
                                       repeated("3 1 0 0\n", kSize) + "$EndNodes\n");
  files.emplace_back("points.mesh", "MeshVersionFormatted 1\nDimension 3\nVertices " +
                                        std::to_string(kSize / 8) + "\n" +
                                        repeated("0 0 0 0 ", kSize) + " Triangles 1 1 1 1 0 End");
  files.emplace_back("comments.mesh", "MeshVersionFormatted 1\n" + repeated("#\n", kSize));
  files.emplace_back(
      "tets.mesh", "MeshVersionFormatted 1\nDimension 3\nVertices 1 0 0 0 0\nTetrahedra " +
                       std::to_string(kSize / 10) + "\n" + repeated("1 1 1 1 0\n", kSize) + "End");
  files.emplace_back(
      "types.vtk",
      "# vtk DataFile Version 5.1\nx\nBINARY\nDATASET UNSTRUCTURED_GRID\nPOINTS 3 char\n" + points +
          "CELLS " + n + " " + n + "\nOFFSETS char\n" + std::string(kSize, '\0') +
          "CONNECTIVITY char\n" + std::string(kSize, '\1') + "CELL_TYPES 1\n" + bytes(0x0a000000));

  // Pieces that share an appended array, and a piece whose arrays have one byte for each number.
  const auto array = [](const char* name, std::size_t offset) {
    return "<DataArray type=\"UInt8\" Name=\"" + std::string(name) +
           "\" format=\"appended\" offset=\"" + std::to_string(offset) + "\"/>";
  };
  const std::string shared =
      "<Piece NumberOfPoints=\"" + third + "\"><Points>" + array("Points", 0) + "</Points></Piece>";
  const std::string block = bytes(static_cast<std::uint32_t>(kSize)) + std::string(kSize, '\1');
  const std::string raw = "<AppendedData encoding=\"raw\">_" + block + "</AppendedData>";
  files.emplace_back("one-array.vtp", vtp("", shared, raw));
  files.emplace_back("shared.vtp", vtp("", repeated(shared, kSize), raw));
  files.emplace_back("strip.vtp",
                     vtp("",
                         "<Piece NumberOfPoints=\"3\" NumberOfStrips=\"1\"><Points>" +
                             array("Points", 0) + "</Points><Strips>" + array("connectivity", 0) +
                             "<DataArray type=\"UInt32\" Name=\"offsets\" format=\"ascii\">" + n +
                             "</DataArray></Strips></Piece>",
                         raw));
  // Each of many pieces reads a few numbers at the start of a long Base64 text.
  const std::string few =
      "<Piece NumberOfPoints=\"1\"><Points>" + array("Points", 0) + "</Points></Piece>";
  files.emplace_back("base64.vtp", vtp("", repeated(few, kSize),
                                       "<AppendedData encoding=\"base64\">_AwAAAAEBAQ" +
                                           std::string(kSize, 'A') + "</AppendedData>"));
  return files;
}

TEST(HostileFiles, TakeAtMostTwentyTimesTheirSize) {
  for (const auto& [name, content] : hostileFiles()) {
    const ReadOutcome outcome = outcomeOf("hostile-" + name, content);
    EXPECT_LE(outcome.peak, 20 * content.size() + 1'000'000) << name << " " << outcome.refusal;
    EXPECT_LT(outcome.refusal.size(), 500u) << name;
    if (::testing::Test::HasFailure() || std::getenv("PALPATE_SHOW"))
      std::printf("%s: %.1f times, %s\n", name.c_str(),
                  static_cast<double>(outcome.peak) / static_cast<double>(content.size()),
                  outcome.refusal.c_str());
  }
}

}  // namespace
}  // namespace palpate::testing
