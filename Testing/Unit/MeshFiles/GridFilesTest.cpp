// Files with tetrahedra, written by hand from the descriptions of their formats.
#include "MeshFileFixture.h"

#include <string>
#include <vector>

namespace palpate::testing {
namespace {

using Eigen::Vector3d;

class GridFiles : public MeshFileFixture {};

// Two tetrahedra with a common face, of which the file has a triangle, an edge and a vertex.
const std::vector<Vector3d> kPositions{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 1, 1.5}};
const std::vector<Tetrahedron> kTetrahedra{{0, 1, 2, 3}, {1, 2, 3, 4}};
const std::vector<Triangle> kTriangles{{1, 2, 3}};
const std::vector<Segment> kSegments{{1, 2}};
const std::vector<std::uint32_t> kPoints{4};

const std::string kGmsh22 =
    "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n1\n3 1 \"liver\"\n$EndPhysicalNames\n"
    "$Nodes\n5\n1 0.0 0.0 0.0\n2 1.0 0.0 0.0\n3 0.0 1.0 0.0\n4 0 0 1e0\n5 1 1 1.5\n$EndNodes\n"
    "$Elements\n5\n1 15 2 0 1 5\n2 1 2 0 1 2 3\n3 2 2 99 2 2 3 4\n4 4 3 0 1 1 1 2 3 4\n"
    "5 4 0 2 3 4 5\n$EndElements\n$NodeData\n1\n\"a view\"\n$EndNodeData\n";
// Tags of nodes are not consecutive, and nodes have parametric coordinates.
const std::string kGmsh41 =
    "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Entities\n1 0 0 1\n1 0 0 0 0\n1 0 0 0 1 1 1 0 0\n"
    "$EndEntities\n$Nodes\n3 5 10 90\n0 1 0 1\n90\n0. 0. 0.\n2 1 1 2\n10\n20\n"
    "1 0 0 0.5 0.5\n0 1 0 0.25 1\n3 1 0 2\n40\n30\n0 0 1\n1 1 1.5\n$EndNodes\n"
    "$Elements\n4 5 1 5\n0 1 15 1\n1 30\n1 1 1 1\n2 10 20\n2 1 2 1\n3 10 20 40\n"
    "3 1 4 2\n4 90 10 20 40\n5 10 20 40 30\n$EndElements\n";
const std::string kMedit =
    "MeshVersionFormatted 1\n# made by hand\n\nDimension\n3\n\nVertices\n5\n0 0 0 1\n1 0 0 1\n"
    "0 1 0 1\n0 0 1 1 # a comment\n1 1 1.5 2\n\nEdges\n1\n2 3 0\n\nTriangles 1\n2 3 4 7\n"
    "Corners 1 5\nRequiredTriangles\n1\n1\nNormals\n1\n0 0 1\nNormalAtVertices\n1\n1 1\n"
    "AngleOfCornerBound 40.5\nHexahedra\n0\nTetrahedra\n2\n1 2 3 4 1\n2 3 4 5 1\n\nEnd\n";
const std::string kVtkHead =
    "# vtk DataFile Version 3.0\ngrid\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 5 double\n"
    "0 0 0 1 0 0 0 1 0 0 0 1 1 1 1.5\n";
const std::string kVtk =
    kVtkHead +
    "CELLS 5 19\n1 4\n2 1 2\n3 1 2 3\n4 0 1 2 3\n4 1 2 3 4\nCELL_TYPES 5\n1\n3\n"
    "5\n10\n10\nPOINT_DATA 5\nSCALARS s float 1\n";
const std::string kVtk5 = replaced(kVtkHead, "3.0", "5.1") +
                          "METADATA\nINFORMATION 0\n\nCELLS 6 14\nOFFSETS vtktypeint64\n0 1 3 6 10 "
                          "14\nCONNECTIVITY vtktypeint64\n4 1 2 1 2 3 0 1 2 3 1 2 3 4\n"
                          "CELL_TYPES 5\n1 3 5 10 10\n";
const std::string kVtu =
    "<?xml version=\"1.0\"?>\n<VTKFile type='UnstructuredGrid' version=\"0.1\" "
    "byte_order=\"LittleEndian\">\n<UnstructuredGrid>\n"
    "<Piece NumberOfPoints=\"5\" NumberOfCells=\"5\">\n<Points>\n"
    "<DataArray type=\"Float32\" NumberOfComponents=\"3\" format=\"ascii\">\n"
    "0 0 0 1 0 0 0 1 0 0 0 1 1 1 1.5\n</DataArray>\n</Points>\n<Cells>\n"
    "<DataArray type=\"Int32\" Name=\"connectivity\" format=\"ascii\">\n4 1 2 1 2 3\n"
    "0 1 2 3 1 2 3 4\n</DataArray>\n"
    "<DataArray type=\"Int32\" Name=\"offsets\" format=\"ascii\">1 3 6 10 14</DataArray>\n"
    "<DataArray type=\"UInt8\" Name=\"types\" format=\"ascii\">1 3 5 10 10</DataArray>\n"
    "</Cells>\n</Piece>\n</UnstructuredGrid>\n</VTKFile>\n";

std::string binaryGmsh22(bool bigEndian) {
  Binary out(bigEndian);
  out.text("$MeshFormat\n2.2 1 8\n").ints({1}).text("\n$EndMeshFormat\n$Nodes\n5\n");
  for (int i = 0; i < 5; ++i) out.ints({i + 1}).point(kPositions[static_cast<std::size_t>(i)]);
  out.text("\n$EndNodes\n$Elements\n5\n");
  out.ints({15, 1, 2, 1, 0, 1, 5, 1, 1, 0, 2, 2, 3, 2, 1, 2, 3, 99, 2, 2, 3, 4});
  out.ints({4, 2, 1, 4, 0, 1, 2, 3, 4, 5, 0, 2, 3, 4, 5});
  return out.text("\n$EndElements\n").content;
}

std::string binaryGmsh41(bool bigEndian) {
  Binary out(bigEndian);
  out.text("$MeshFormat\n4.1 1 8\n").ints({1}).text("\n$EndMeshFormat\n$Entities\n");
  out.sizes({1, 0, 0, 0}).ints({1}).point({0, 0, 0}).sizes({0}).text("\n$EndEntities\n$Nodes\n");
  out.sizes({2, 5, 1, 5}).ints({1, 1, 1}).sizes({1, 1}).point(kPositions[0]).point({9, 9, 9});
  out.content.resize(out.content.size() - 16);  // one parametric coordinate
  out.ints({3, 1, 0}).sizes({4, 2, 3, 4, 5});
  for (std::size_t i = 1; i < 5; ++i) out.point(kPositions[i]);
  out.text("\n$EndNodes\n$Elements\n").sizes({4, 5, 1, 5}).ints({0, 1, 15}).sizes({1, 1, 5});
  out.ints({1, 1, 1}).sizes({1, 2, 2, 3}).ints({2, 1, 2}).sizes({1, 3, 2, 3, 4}).ints({3, 1, 4});
  out.sizes({2, 4, 1, 2, 3, 4, 5, 2, 3, 4, 5});
  return out.text("\n$EndElements\n").content;
}

std::string binaryVtk() {
  Binary out(true);
  out.text(replaced(kVtkHead.substr(0, kVtkHead.find("0 0 0")), "ASCII", "BINARY"));
  for (const Vector3d& p : kPositions) out.point(p);
  out.text("\nCELLS 5 19\n").ints({1, 4, 2, 1, 2, 3, 1, 2, 3, 4, 0, 1, 2, 3, 4, 1, 2, 3, 4});
  return out.text("\nCELL_TYPES 5\n").ints({1, 3, 5, 10, 10}).text("\n").content;
}

std::string base64(const std::string& text) {
  constexpr char kDigits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string digits;
  for (std::size_t at = 0; at < text.size(); at += 3) {
    std::uint32_t bits = 0;
    for (std::size_t i = at; i < at + 3; ++i)
      bits = bits << 8 | (i < text.size() ? static_cast<std::uint8_t>(text[i]) : 0);
    for (std::size_t i = 0; i < 4; ++i)
      digits += at + i > text.size() ? '=' : kDigits[bits >> (18 - 6 * i) & 63];
  }
  return digits;
}

enum class Storage { Inline, AppendedBase64, AppendedRaw };

std::string binaryVtu(Storage storage, bool bigEndian, bool longHeader) {
  std::string appended,
      xml = "<VTKFile type=\"UnstructuredGrid\" byte_order=\"" +
            std::string(bigEndian ? "BigEndian" : "LittleEndian") + "\" header_type=\"" +
            (longHeader ? "UInt64" : "UInt32") +
            "\">\n<UnstructuredGrid><Piece NumberOfPoints=\"5\" NumberOfCells=\"5\">\n";
  const auto add = [&](const std::string& type, const std::string& name, const Binary& values) {
    const std::string array =
        (longHeader ? bytes(std::uint64_t{values.content.size()}, bigEndian)
                    : bytes(static_cast<std::uint32_t>(values.content.size()), bigEndian)) +
        values.content;
    xml += "<DataArray type=\"" + type + "\" Name=\"" + name + "\" ";
    if (storage == Storage::Inline) {
      xml += "format=\"binary\">\n  " + base64(array) + "\n</DataArray>\n";
    } else {
      xml += "format=\"appended\" offset=\"" + std::to_string(appended.size()) + "\"/>\n";
      appended += storage == Storage::AppendedRaw ? array : base64(array);
    }
  };
  Binary points(bigEndian), corners(bigEndian), ends(bigEndian);
  for (const Vector3d& p : kPositions) points.point(p);
  corners.ints({4, 1, 2, 1, 2, 3, 0, 1, 2, 3, 1, 2, 3, 4});
  ends.sizes({1, 3, 6, 10, 14});
  xml += "<Points>";
  add("Float64", "Points", points);
  xml += "</Points><Cells>";
  add("Int32", "connectivity", corners);
  add("Int64", "offsets", ends);
  add("UInt8", "types", Binary(bigEndian).text(std::string("\1\3\5\12\12")));
  xml += "</Cells></Piece></UnstructuredGrid>\n";
  if (!appended.empty())
    xml += "<AppendedData encoding=\"" +
           std::string(storage == Storage::AppendedRaw ? "raw" : "base64") + "\">\n_" + appended +
           "\n</AppendedData>\n";
  return xml + "</VTKFile>\n";
}

std::vector<std::pair<std::string, std::string>> goodFiles() {
  std::vector<std::pair<std::string, std::string>> files{
      {"22.msh", kGmsh22}, {"41.msh", kGmsh41}, {"a.mesh", kMedit},    {"a.vtk", kVtk},
      {"5.vtk", kVtk5},    {"a.vtu", kVtu},     {"b.vtk", binaryVtk()}};
  for (const bool bigEndian : {false, true}) {
    const std::string order = bigEndian ? "big" : "little";
    files.emplace_back("22" + order + ".msh", binaryGmsh22(bigEndian));
    files.emplace_back("41" + order + ".msh", binaryGmsh41(bigEndian));
    for (const Storage storage : {Storage::Inline, Storage::AppendedBase64, Storage::AppendedRaw})
      for (const bool isLong : {false, true})
        files.emplace_back(order + std::to_string(static_cast<int>(storage)) + "_" +
                               std::to_string(isLong) + ".vtu",
                           binaryVtu(storage, bigEndian, isLong));
  }
  return files;
}

bool isWhole(const MeshArrays& mesh, bool isMedit) {
  return mesh.positions.size() == 5 && mesh.tetrahedra.size() == 2 && mesh.triangles.size() == 1 &&
         mesh.segments.size() == 1 && mesh.points.size() == (isMedit ? 0 : 1);
}

TEST_F(GridFiles, EveryFormatGivesAllElements) {
  for (const auto& [name, content] : goodFiles()) {
    SCOPED_TRACE(name);
    MeshArrays mesh;
    EXPECT_NO_THROW(mesh = read(name, content));
    if (name == "41.msh") {  // its nodes stand in another order
      EXPECT_EQ(mesh.positions[4], kPositions[4]);
      EXPECT_EQ(mesh.positions[0], kPositions[0]);
    }
    EXPECT_EQ(mesh.positions, kPositions);
    EXPECT_EQ(mesh.tetrahedra, kTetrahedra);
    EXPECT_EQ(mesh.triangles, kTriangles);
    EXPECT_EQ(mesh.segments, kSegments);
    EXPECT_EQ(mesh.points, name == "a.mesh" ? std::vector<std::uint32_t>() : kPoints);
  }
}

TEST_F(GridFiles, TruncatedFilesAreRefusedOrComplete) {
  expectTruncatedRefused(goodFiles(), [](const std::string& name, const MeshArrays& mesh) {
    return isWhole(mesh, name == "a.mesh");
  });
}

TEST_F(GridFiles, DamagedFilesAreReadOrRefused) { expectDamagedRefused(goodFiles()); }

TEST_F(GridFiles, LinesMayEndWithCarriageReturns) {
  for (const char* const name : {"22.msh", "41.msh", "a.mesh", "a.vtk", "a.vtu"})
    for (const auto& [good, content] : goodFiles()) {
      if (good != name) continue;
      std::string other;
      for (const char c : content) other += c == '\n' ? "\r\n" : std::string(1, c);
      EXPECT_TRUE(isWhole(read(name, other), name == std::string("a.mesh"))) << name;
    }
}

TEST_F(GridFiles, CellsOfOtherKindsAreRefusedByName) {
  expectRefused("hexahedron.msh", replaced(kGmsh22, "5 4 0 2 3 4 5", "5 5 0 1 2 3 4 5 1 2 3"),
                "line 22: expected points, lines, triangles, quadrangles or tetrahedra of first "
                "order, not element type 5 (hexahedron)");
  expectRefused("quadratic.msh", replaced(kGmsh41, "3 1 4 2\n4 90", "3 1 11 2\n4 90"),
                "not element type 11 (tetrahedron of second order)");
  expectRefused("unknown.msh", replaced(kGmsh41, "3 1 4 2\n4 90", "3 1 444 2\n4 90"),
                "element type 444");
  expectRefused("a.mesh", replaced(kMedit, "Hexahedra\n0", "Hexahedra\n1\n1 2 3 4 5 1 2 3 0"),
                "line 32: expected Vertices, Edges, Triangles, Quadrilaterals, Tetrahedra or End, "
                "not \"Hexahedra\"");
  expectRefused("a.vtk", replaced(kVtk, "5\n10\n10", "5\n10\n12"),
                "line 18: expected vertices, lines, triangles, polygons or tetrahedra, not cell "
                "type 12 (hexahedron)");
  expectRefused("a.vtu", replaced(kVtu, "5 10 10", "5 10 24"),
                "line 16: expected vertices, lines, triangles, polygons or tetrahedra, not cell "
                "type 24 (quadratic tetrahedron)");
  expectRefused("b.vtu", replaced(kVtu, "5 10 10", "5 10 nan"), "not cell type nan");
  expectRefused("c.vtu", replaced(kVtu, "5 10 10", "5 10 5"),
                "cell 4 (from 0): expected 3 corners of a triangle, not 4");
}

TEST_F(GridFiles, QuadsBecomeTwoTrianglesAndStripsTheirs) {
  const std::vector<Triangle> two{{0, 1, 3}, {0, 3, 2}};
  EXPECT_EQ(read("a.msh", replaced(kGmsh22, "5 4 0 2 3 4 5", "5 3 0 1 2 4 3")).triangles.back(),
            two[1]);
  EXPECT_EQ(
      read("a.mesh", replaced(kMedit, "Hexahedra\n0", "Quadrilaterals 1 1 2 4 3 0")).triangles[1],
      two[0]);
  EXPECT_EQ(read("a.vtk", replaced(kVtk, "10\n10\nPOINT", "9\n6\nPOINT")).triangles.size(), 5u);
}

TEST_F(GridFiles, IndicesOutOfRangeAreRefusedWithTheirLineOrByte) {
  expectRefused("a.msh", replaced(kGmsh22, "2 3 4 5\n$EndE", "2 3 4 7\n$EndE"),
                "line 22: expected the tag of one of the 5 nodes, not 7");
  expectRefused("b.msh", replaced(kGmsh41, "10 20 40 30\n$EndE", "10 20 40 31\n$EndE"),
                "expected the tag of one of the 5 nodes, not 31");
  expectRefused("a.mesh", replaced(kMedit, "2 3 4 5 1", "2 3 4 6 1"),
                "line 37: expected the index of one of the 5 vertices, counted from 1, not 6");
  expectRefused("b.mesh", replaced(kMedit, "2 3 4 5 1", "2 3 4 0 1"), "counted from 1, not 0");
  expectRefused("a.vtk", replaced(kVtk, "4 1 2 3 4", "4 1 2 3 5"),
                "line 12: expected the index of one of the 5 vertices, counted from 0, not 5");
  expectRefused("a.vtu", replaced(kVtu, "1 2 3 4\n", "1 2 3 -4\n"),
                "line 13: expected the index of one of the 5");
  const std::string little = binaryGmsh22(false);
  const std::size_t last = little.rfind("\n$EndE") - 4;
  expectRefused(
      "c.msh", std::string(little).replace(last, 4, bytes(99)),
      "byte " + std::to_string(last) + ": expected the tag of one of the 5 nodes, not 99");
  const std::string vtu = binaryVtu(Storage::AppendedRaw, false, false);
  expectRefused("b.vtu",
                replaced(vtu, bytes(1) + bytes(2) + bytes(3) + bytes(4),
                         bytes(1) + bytes(2) + bytes(3) + bytes(5)),
                "byte ");
}

TEST_F(GridFiles, CountsAreCheckedBeforeMemoryIsTaken) {
  for (const std::string& count : {std::string("4000000000"), std::string("99999999999999999999"),
                                   std::string("-1"), std::string("x")}) {
    expectRefused("a.msh", replaced(kGmsh22, "$Nodes\n5", "$Nodes\n" + count), "line 9: expected");
    expectRefused("b.msh", replaced(kGmsh22, "$Elements\n5", "$Elements\n" + count),
                  "line 17: expected");
    expectRefused("c.msh", replaced(kGmsh41, "3 5 10 90", "3 " + count + " 10 90"),
                  "line 10: expected");
    expectRefused("d.msh", replaced(kGmsh41, "3 1 0 2", "3 1 0 " + count), "line 19: expected");
    expectRefused("a.mesh", replaced(kMedit, "Vertices\n5", "Vertices\n" + count),
                  "line 8: expected");
    expectRefused("a.vtk", replaced(kVtk, "CELLS 5", "CELLS " + count), "line 7: expected");
    expectRefused("b.vtk", replaced(kVtk, "TYPES 5", "TYPES " + count), "line 13: expected");
    expectRefused("a.vtu", replaced(kVtu, "OfCells=\"5\"", "OfCells=\"" + count + "\""),
                  "line 4: expected");
  }
  std::string little = binaryGmsh41(false);
  little.replace(little.find("$Nodes\n") + 7 + 8, 8, bytes(std::uint64_t{1} << 60));
  expectRefused("e.msh", little, "expected at most");
}

TEST_F(GridFiles, MalformedFilesAreRefusedWithWhatIsExpected) {
  expectRefused("version.msh", replaced(kGmsh22, "2.2 0", "4 0"),
                "line 2: expected version 2.2 or 4.1");
  expectRefused("twice.msh", replaced(kGmsh41, "40\n30\n0 0", "40\n10\n0 0"),
                "expected different tags of nodes, but two have 10");
  expectRefused("few.msh", replaced(kGmsh41, "3 5 10", "3 6 10"), "1 more are expected");
  expectRefused("end.msh", replaced(kGmsh22, "$EndNodes", "$EndNode"),
                "expected $EndNodes, not \"$EndNode\"");
  expectRefused("none.msh", kGmsh22.substr(0, kGmsh22.find("$Elements")), "expected $Elements");
  expectRefused("second.msh", kGmsh22 + kGmsh22.substr(kGmsh22.find("$Nodes")),
                "one section $Nodes, not two");
  expectRefused("size.msh", replaced(kGmsh22, "0 8", "0 4"), "8 as the size of numbers");
  std::string order = binaryGmsh22(false);
  order[20] = 7;
  expectRefused("order.msh", order, "expected the binary integer 1");
  expectRefused("plane.mesh", replaced(kMedit, "Dimension\n3", "Dimension\n2"),
                "line 5: expected dimension 3, not 2");
  expectRefused("end.mesh", replaced(kMedit, "End", ""), "expected a word, but this is the end");
  expectRefused("null.mesh", replaced(kMedit, "0 0 1 1 #", std::string("0 0 1\0 1 #", 10)),
                "line 12: expected a number, not \"1?\"");
  expectRefused("types.vtk", kVtk.substr(0, kVtk.find("CELL_TYPES")), "expected CELL_TYPES");
  expectRefused("early.vtk", kVtkHead + "CELL_TYPES 1\n10\n", "expected CELLS before CELL_TYPES");
  expectRefused("polygons.vtk", replaced(kVtk, "CELLS", "POLYGONS"),
                "expected a section of the data set, not \"POLYGONS\"");
  expectRefused("offset.vtk", replaced(kVtk5, "\n0 1 3", "\n1 1 3"),
                "expected a first offset of 0");
  expectRefused("type.vtu", replaced(kVtu, "\"UInt8\"", "\"String\""),
                "line 16: expected the type of numbers, not \"String\"");
  expectRefused("array.vtu", replaced(kVtu, "\"types\"", "\"kinds\""),
                "expected an array types in Cells");
  expectRefused("format.vtu",
                replaced(kVtu, "\"types\" format=\"ascii\"", "\"types\" format=\"bits\""),
                "the format ascii, binary or appended");
  std::string raw = binaryVtu(Storage::AppendedRaw, false, false);
  const std::size_t at = raw.find("_", raw.find("<AppendedData"));
  expectRefused("long.vtu", raw.replace(at + 1, 4, bytes(1 << 30)),
                "byte " + std::to_string(at + 1) + ": expected a number from 0 to");
}

}  // namespace
}  // namespace palpate::testing
