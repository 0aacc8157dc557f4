#include "MeshFileFixture.h"
#include "Scenes.h"

#include <limits>

namespace palpate::testing {
namespace {

using Eigen::Vector3d;
namespace fs = std::filesystem;

class SurfaceFiles : public MeshFileFixture {};

// A square of four vertices and a fifth unused one: one polygon if the format has polygons.
const std::vector<Vector3d> kSquare{{0, 0, 0}, {1, 0, 0}, {1, 1, 0.5}, {0, 1, 0}, {7, 7, 7}};
const std::vector<Triangle> kFan{{0, 1, 2}, {0, 2, 3}};

const std::string kObj =
    "# square\r\nv 0 0 0\nv 1 0 0 1.0\nv +1 1 5e-1\nv 0 1 0\nv 7 7 7\nvt 0 0\nvt 1 1\nvn 0 0 1\n"
    "g side\nf 1/1/1 2/2/1 \\\n 3/1/1 4//1 # end\n";
const std::string kPlyHeader =
    "ply\nformat ascii 1.0\ncomment square\nelement vertex 5\nproperty float x\nproperty float "
    "y\nproperty float z\n"
    "property uchar red\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n";
const std::string kPly = kPlyHeader + "0 0 0 1\n1 0 0 2\n1 1 0.5 3\n0 1 0 4\n7 7 7 5\n4 0 1 2 3\n";
const std::string kVtk =
    "# vtk DataFile Version 3.0\nsquare\nASCII\nDATASET POLYDATA\nPOINTS 5 float\n0 0 0 1 0 0 1 1 "
    "0.5 0 1 0 7 7 7\n"
    "VERTICES 1 2\n1 4\nPOLYGONS 1 5\n4 0 1 2 3\nPOINT_DATA 5\nSCALARS s float 1\n";
const std::string kVtk5 =
    "# vtk DataFile Version 5.1\nsquare\nASCII\nDATASET POLYDATA\nPOINTS 5 double\n0 0 0 1 0 0 1 1 "
    "0.5 0 1 0 7 7 7\n"
    "METADATA\nINFORMATION 0\n\nPOLYGONS 2 4\nOFFSETS vtktypeint64\n0 4\nCONNECTIVITY "
    "vtktypeint64\n0 1 2 3\n";
const std::string kVtp =
    "<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" version=\"1.0\" "
    "byte_order=\"LittleEndian\"><PolyData>"
    "<Piece NumberOfPoints=\"5\" NumberOfPolys=\"1\"><Points>"
    "<DataArray type=\"Float64\" NumberOfComponents=\"3\" format=\"ascii\">0 0 0 1 0 0 1 1 0.5 0 1 "
    "0 7 7 7</DataArray>"
    "</Points><Polys><DataArray type=\"Int64\" Name=\"connectivity\" format=\"ascii\">0 1 2 "
    "3</DataArray>"
    "<DataArray type=\"Int64\" Name=\"offsets\" "
    "format=\"ascii\">4</DataArray></Polys></Piece></PolyData></VTKFile>\n";
// The same file as VTK's own writer makes it: compressed, appended.
const std::string kAppendedVtp =
    "<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" version=\"0.1\" "
    "byte_order=\"LittleEndian\" "
    "header_type=\"UInt32\" compressor=\"vtkZLibDataCompressor\">\n<PolyData>\n"
    "<Piece NumberOfPoints=\"5\" NumberOfVerts=\"0\" NumberOfLines=\"0\" NumberOfStrips=\"0\" "
    "NumberOfPolys=\"1\">\n"
    "<Points><DataArray type=\"Float64\" Name=\"Points\" NumberOfComponents=\"3\" "
    "format=\"appended\" offset=\"0\"/>"
    "</Points>\n<Polys><DataArray type=\"Int64\" Name=\"connectivity\" format=\"appended\" "
    "offset=\"156\"/>\n"
    "<DataArray type=\"Int64\" Name=\"offsets\" format=\"appended\" "
    "offset=\"208\"/></Polys>\n</Piece>\n</PolyData>\n"
    "<AppendedData encoding=\"base64\">\n"
    "_AQAAAACAAAB4AAAAGwAAAA==eJxjYMAHPtjjF4fRD+"
    "yxy8OAjAM6DQBm6gbwAAAAAACAAAAAAAAAAAAAAACAAAAAAAAAAAAAAACAAAAAAAAA"
    "AAAAAACAAAAAAAAAAAAAAACAAAAAAAAAAAAAAACAAAAAAAAAAQAAAACAAAAgAAAAEwAAAA=="
    "eJxjYIAARijNBKWZoTQAAHAABw=="
    "AQAAAACAAAAIAAAACwAAAA==eJxjYYAAAAAoAAU=\n</AppendedData>\n</VTKFile>\n";
const std::string kStl =
    "solid square\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 1 1 "
    "0.5\nendloop\nendfacet\n"
    "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 1 0.5\nvertex 0 1 "
    "0\nendloop\nendfacet\nendsolid square\n";

std::string binaryPly(bool bigEndian) {
  std::string text = kPlyHeader;
  text.replace(text.find("ascii"), 5, bigEndian ? "binary_big_endian" : "binary_little_endian");
  Binary out(bigEndian);
  out.text(text);
  for (const Vector3d& p : kSquare) out.coarse(p).text("\1");
  return out.text("\4").ints({0, 1, 2, 3}).content;
}

std::string binaryVtk() {
  Binary out(true);
  out.text("# vtk DataFile Version 3.0\nsquare\nBINARY\nDATASET POLYDATA\nPOINTS 5 double\n");
  for (const Vector3d& p : kSquare) out.point(p);
  return out.text("\nPOLYGONS 1 5\n").ints({4, 0, 1, 2, 3}).text("\n").content;
}

std::string binaryStl() {
  Binary out;
  out.text(std::string(80, ' ')).ints({2});
  for (const Triangle& triangle : kFan) {
    out.coarse(Vector3d::Zero());
    for (const std::uint32_t v : triangle) out.coarse(kSquare[v]);
    out.text(std::string(2, '\0'));
  }
  return out.content;
}

const std::vector<std::pair<std::string, std::string>> kGood{{"a.obj", kObj},
                                                             {"a.ply", kPly},
                                                             {"little.ply", binaryPly(false)},
                                                             {"big.PLY", binaryPly(true)},
                                                             {"a.vtk", kVtk},
                                                             {"a5.vtk", kVtk5},
                                                             {"binary.vtk", binaryVtk()},
                                                             {"a.vtp", kVtp},
                                                             {"appended.vtp", kAppendedVtp},
                                                             {"a.stl", kStl},
                                                             {"binary.stl", binaryStl()}};

TEST_F(SurfaceFiles, EveryFormatGivesVerticesAndPolygonsAsFans) {
  for (const auto& [name, content] : kGood) {
    const MeshArrays mesh = read(name, content, {.weldDistance = 0.0});
    const bool hasUnused = name.find("stl") == std::string::npos;
    EXPECT_EQ(mesh.positions,
              std::vector<Vector3d>(kSquare.begin(), kSquare.end() - (hasUnused ? 0 : 1)))
        << name;
    EXPECT_EQ(mesh.triangles, kFan) << name;
  }
}

/// A text that ends within its last line or number, or between two sections, cannot be told from a
/// shorter one.
TEST_F(SurfaceFiles, TruncatedFilesAreRefusedOrComplete) {
  const auto isComplete = [](const std::string& name, const MeshArrays& mesh) {
    const bool isSection = mesh.triangles.empty() && mesh.points.size() == 1;
    return mesh.triangles == kFan || name == "a.obj" || (name == "a.vtk" && isSection);
  };
  expectTruncatedRefused(kGood, isComplete, {.weldDistance = 0.0});
}

TEST_F(SurfaceFiles, DamagedFilesAreReadOrRefused) { expectDamagedRefused(kGood); }

TEST_F(SurfaceFiles, MissingFilesEmptyFilesFoldersAndUnknownFormatsAreRefused) {
  for (const char* kind : {".obj", ".ply", ".vtk", ".vtp", ".vtu", ".stl", ".msh", ".mesh"}) {
    EXPECT_NE(refusal(folder / ("missing" + std::string(kind))).find("no such file"),
              std::string::npos);
    EXPECT_NE(refusal("empty" + std::string(kind), "").find("empty"), std::string::npos);
    EXPECT_NE(refusal("text" + std::string(kind), "Dear surgeon,\nthis is a letter.\n"), "");
    fs::create_directories(folder / ("folder" + std::string(kind)));
    EXPECT_NE(refusal(folder / ("folder" + std::string(kind))).find("no regular file"),
              std::string::npos);
  }
  EXPECT_NE(refusal("a.xyz", "1").find("does not end in"), std::string::npos);
}

TEST_F(SurfaceFiles, IndicesOutOfRangeAreRefusedWithTheirLineOrByte) {
  const std::string of5 = "expected the index of one of the 5 vertices, counted from ";
  expectRefused("high.obj", replaced(kObj, "4//1", "6//1"), "line 11: " + of5 + "1, not 6");
  expectRefused("zero.obj", replaced(kObj, "4//1", "0//1"), "line 11: " + of5 + "1, not 0");
  expectRefused("back.obj", replaced(kObj, "4//1", "-6"), "line 11: expected an index that counts");
  expectRefused("high.ply", replaced(kPly, "2 3\n", "2 5\n"), "line 17: " + of5 + "0, not 5");
  expectRefused("low.ply", replaced(kPly, "2 3\n", "2 -1\n"), "line 17: " + of5 + "0, not -1");
  expectRefused("high.vtk", replaced(kVtk, "2 3\n", "2 5\n"), "line 10: " + of5 + "0, not 5");
  expectRefused("high5.vtk", replaced(kVtk5, "2 3\n", "2 5\n"), "line 14: " + of5 + "0, not 5");
  expectRefused("high.vtp", replaced(kVtp, "2 3<", "2 5<"), "line 2: " + of5 + "0, not 5");
  expectRefused("low.vtp", replaced(kVtp, "2 3<", "2 -9<"), "line 2: " + of5 + "0, not -9");
  expectRefused("half.vtp", replaced(kVtp, "2 3<", "2 2.5<"), "line 2: " + of5 + "0, not 2.5");
  const std::string ply = binaryPly(false);
  expectRefused("high.ply", replaced(ply, bytes(3), bytes(9)),
                "byte " + std::to_string(ply.size() - 4) + ": " + of5 + "0, not 9");
  const std::string vtk = binaryVtk();
  expectRefused("high.vtk", replaced(vtk, bytes(3, true), bytes(9, true)),
                "byte " + std::to_string(vtk.size() - 5) + ": " + of5 + "0, not 9");
}

TEST_F(SurfaceFiles, PiecesOfAVtpFileAreOneMeshAndUseTheirOwnVertices) {
  const std::size_t begin = kVtp.find("<Piece"), end = kVtp.find("</PolyData>");
  const std::string piece = kVtp.substr(begin, end - begin);
  const auto withFirst = [&](const std::string& first) {
    return std::string(kVtp).insert(begin, first);
  };
  const MeshArrays mesh = read("two.vtp", withFirst(piece));
  EXPECT_EQ(mesh.positions.size(), 10u);
  EXPECT_EQ(mesh.triangles, (std::vector<Triangle>{{0, 1, 2}, {0, 2, 3}, {5, 6, 7}, {5, 7, 8}}));
  expectRefused("into.vtp", withFirst(replaced(piece, "2 3<", "2 6<")), "5 vertices");
  expectRefused("back.vtp", replaced(withFirst(piece), "2 3<", "2 -1<"), "5 vertices");
}

TEST_F(SurfaceFiles, CoordinatesThatAreNotFiniteOrOutOfRangeAreRefused) {
  for (const char* value : {"nan", "inf", "1e999", "-1e301"}) {
    const std::string reason = "vertex 4 (from 0): expected a finite coordinate of at most 1e300";
    const std::string last = "7 7 " + std::string(value);
    for (const auto& [name, content] : kGood)
      if (content.find("7 7 7") != std::string::npos)
        expectRefused(name, replaced(content, "7 7 7", last), reason);
  }
  expectRefused("a.stl", replaced(kStl, "0 1 0", "0 nan 0"), "line 13: vertex 5 (from 0)");
  std::string stl = binaryStl();
  stl.replace(84 + 12, 4, bytes(std::numeric_limits<float>::infinity()));
  expectRefused("b.stl", stl, "byte 104: vertex 0 (from 0)");
  EXPECT_EQ(refusal("tiny.obj", replaced(kObj, "7 7 7", "7 7 1e-999")), "");
}

TEST_F(SurfaceFiles, CountsLargerThanTheFileAreRefused) {
  expectRefused("a.ply", replaced(kPly, "vertex 5", "vertex 4000000000"), "not 4000000000");
  expectRefused("a.vtk", replaced(kVtk, "POINTS 5", "POINTS 400000000000"),
                "line 5: expected at most");
  expectRefused("a.vtp", replaced(kVtp, "Points=\"5\"", "Points=\"40000000000\""),
                "not 40000000000");
  expectRefused("list.ply", replaced(kPly, "4 0 1 2 3", "2000000000 0 1 2 3"), "line 17");
  expectRefused("cell.vtk", replaced(kVtk, "4 0 1 2 3", "9 0 1 2 3"),
                "line 10: expected at most 4 corners");
  expectRefused("few.vtk", replaced(kVtk, "4 0 1 2 3", "3 0 1 2 3"),
                "line 10: expected no corners after");
  expectRefused("offset.vtp", replaced(kVtp, ">4<", ">9<"), "line 2: expected at most 4 corners");
  expectRefused("few.vtp", replaced(kVtp, ">4<", ">3<"), "line 2: expected no corners after");
  expectRefused("falling.vtk",
                replaced(replaced(kVtk5, "POLYGONS 2", "POLYGONS 3"), "\n0 4\n", "\n0 4 3\n"),
                "line 12: expected an end of corners from 4 on, not 3");
  for (const char* count : {"-1", "1e9", "99999999999999999999", "2.5", "", "0x5"})
    expectRefused("a.vtk", replaced(kVtk, "POINTS 5", "POINTS " + std::string(count)),
                  "line 5: expected");
}

TEST_F(SurfaceFiles, OtherContentIsRefusedByName) {
  expectRefused("grid.vtk", replaced(kVtk, "POLYDATA", "STRUCTURED_GRID"),
                "not \"STRUCTURED_GRID\"");
  expectRefused("vertices.obj", "v 0 0 0\nv 1 0 0\n", "it has no elements");
  expectRefused("two.obj", "v 0 0 0\nv 1 0 0\nf 1 2\n", "line 3: expected a polygon of at least 3");
  expectRefused("short.obj", "v 0 0 0\nv 1 0\n", "line 2: expected a number");
  expectRefused("half.obj", replaced(kObj, "4//1", "1.5"),
                "line 11: expected a whole number, not \"1.5\"");
  expectRefused("surface.obj", kObj + "curv 0 1 1 2\n",
                "line 13: expected a statement v, p, l or f");
  expectRefused("null.obj", kObj + std::string("f\0 1 2 3\n", 9), "not \"f?\"");
  expectRefused("tets.ply", replaced(kPly, "element face", "element tet"),
                "expected corners of faces");
  expectRefused("list.ply", replaced(kPly, "vertex_indices", "corners"),
                "expected the list vertex_indices");
  expectRefused("flat.ply", replaced(kPly, "property float z\n", ""), "the properties x, y and z");
  expectRefused("lzma.vtp", replaced(kAppendedVtp, "ZLib", "LZMA"),
                "not \"vtkLZMADataCompressor\"");
  expectRefused("grid.vtp", replaced(kVtp, "<PolyData>", "<ImageData>"),
                "expected an element PolyData");
  expectRefused("hollow.stl", replaced(kStl, "endloop", "vertex 1 1 1\nendloop"),
                "line 14: expected endloop");
}

TEST_F(SurfaceFiles, LinesAndPointsAreRead) {
  const std::vector<Segment> lines{{0, 1}, {1, 2}};
  const std::string three = "v 0 0 0\nv 1 0 0\nv 1 1 0\n";
  const MeshArrays obj = read("a.obj", three + "l 1/1 2/2 -1\np 1 3\n");
  EXPECT_EQ(obj.segments, lines);
  EXPECT_EQ(obj.points, (std::vector<std::uint32_t>{0, 2}));
  const MeshArrays vtk =
      read("a.vtk", replaced(kVtk, "POLYGONS 1 5\n4 0 1 2 3", "LINES 1 4\n3 0 1 2"));
  EXPECT_EQ(vtk.segments, lines);
  EXPECT_EQ(vtk.points, std::vector<std::uint32_t>{4});
  const std::string edges = replaced(
      kPly, "end_header", "element edge 2\nproperty int vertex1\nproperty int vertex2\nend_header");
  EXPECT_EQ(read("a.ply", edges + "0 1\n1 2\n").segments, lines);
  expectRefused("a.ply", edges + "0 1\n1 5\n", "line 22: expected the index");
}

TEST_F(SurfaceFiles, ComesWithCommentsBlankLinesAndEitherEndOfLine) {
  for (const auto& [name, content] : kGood) {
    const bool isText = content.find('\0') == std::string::npos && !name.ends_with(".PLY");
    if (!isText || name == "little.ply" || name == "appended.vtp" || name == "a5.vtk") continue;
    std::string other;
    for (const char c : content)
      other += c == '\n' && !other.ends_with('\r') ? std::string("\r\n") : std::string(1, c);
    EXPECT_EQ(read(name, other, {.weldDistance = 0.0}).triangles, kFan) << name;
  }
  EXPECT_EQ(read("blank.obj", "\n  \n# f 9 9 9\n" + kObj + "\n\n \t# end").triangles, kFan);
  EXPECT_EQ(read("blank.stl", replaced(kStl, "outer loop", "\n\n outer\n\tloop")).triangles.size(),
            2u);
  EXPECT_EQ(
      read("c.ply", replaced(kPly, "element face", "comment \nobj_info x\nelement face")).triangles,
      kFan);
}

TEST_F(SurfaceFiles, VerticesAreJoinedOnRequestOnly) {
  const MeshArrays apart = read("a.stl", kStl);
  EXPECT_EQ(apart.positions.size(), 6u);
  EXPECT_EQ(apart.triangles, (std::vector<Triangle>{{0, 1, 2}, {3, 4, 5}}));
  EXPECT_EQ(apart.joinedVertices, 0u);
  const MeshArrays joined = read("a.stl", kStl, {.weldDistance = 0.0});
  EXPECT_EQ(joined.triangles, kFan);
  EXPECT_EQ(joined.joinedVertices, 2u);
  const std::string near = replaced(kStl, "vertex 0 0 0", "vertex 0 0 0.01");
  EXPECT_EQ(read("a.stl", near, {.weldDistance = 0.0}).joinedVertices, 1u);
  EXPECT_EQ(read("a.stl", near, {.weldDistance = 0.02}).joinedVertices, 2u);
  EXPECT_THROW(read("a.stl", kStl, {.weldDistance = -1.0}), Error);
  const MeshArrays lines =
      read("a.obj", "v 0 0 0\nv 1 0 0\nv 0 0 0\nl 1 2 3\np 3\n", {.weldDistance = 0.0});
  EXPECT_EQ(lines.segments, (std::vector<Segment>{{0, 1}, {1, 0}}));
  EXPECT_EQ(lines.points, std::vector<std::uint32_t>{0});
}

TEST_F(SurfaceFiles, CellsMayComeBeforeTheirVertices) {
  EXPECT_EQ(read("a.obj", "f 1 2 3\nv 0 0 0\nv 1 0 0\nv 0 1 0\n").triangles,
            (std::vector<Triangle>{{0, 1, 2}}));
  expectRefused("a.obj", "\nf 1 2 4\nv 0 0 0\nv 1 0 0\nv 0 1 0\n",
                "line 2: expected the index of one of the 3 vertices");
  expectRefused("b.obj", "f 1 2 3\n", "line 1: expected the index of one of the 0 vertices");
}

TEST_F(SurfaceFiles, StripsBecomeTheirTriangles) {
  const std::string strips =
      replaced(kVtk, "POLYGONS 1 5\n4 0 1 2 3", "TRIANGLE_STRIPS 1 5\n4 0 1 3 2");
  EXPECT_EQ(read("a.vtk", strips).triangles, (std::vector<Triangle>{{0, 1, 3}, {3, 1, 2}}));
}

TEST_F(SurfaceFiles, StlKeepsFacetsWithoutArea) {
  const std::string flat = replaced(kStl, "vertex 0 1 0", "vertex 1 1 0.5");
  EXPECT_EQ(read("a.stl", flat, {.weldDistance = 0.0}).triangles,
            (std::vector<Triangle>{{0, 1, 2}, {0, 2, 2}}));
}

TEST(MeshFiles, OrgansAreReadAsWritten) {
  for (const auto& [name, mesh] : scenes::organMeshes()) {
    const MeshArrays read =
        readMeshFile(std::string(PALPATE_SOURCE_DIR) + "/Data/Organs/" + name + ".obj");
    EXPECT_EQ(read.positions, mesh.positions) << name;
    EXPECT_EQ(read.triangles, mesh.triangles) << name;
  }
}

TEST(MeshFiles, PublishedMeshesKeepTheirVertices) {
  const fs::path folder = fs::path(PALPATE_SHARED_DATA) / "meshes";
  if (!fs::exists(folder)) GTEST_SKIP() << "no published meshes";
  const auto counts = [&](const char* name) {
    const MeshArrays mesh = readMeshFile(folder / name);
    return std::pair(mesh.positions.size(), mesh.triangles.size());
  };
  EXPECT_EQ(counts("liver-smooth.obj"), std::pair(std::size_t{2194}, std::size_t{4384}));
  EXPECT_EQ(counts("aneurysm.obj"), std::pair(std::size_t{7095}, std::size_t{14186}));
  EXPECT_EQ(counts("dental_instrument.obj"), std::pair(std::size_t{1100}, std::size_t{2178}));
}

}  // namespace
}  // namespace palpate::testing
