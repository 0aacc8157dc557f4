#include "Scenes.h"

#include <palpate/Error.h>
#include <palpate/vtk/MeshFile.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <filesystem>
#include <fstream>

namespace palpate::vtk {
namespace {

using Eigen::Vector3d;
namespace fs = std::filesystem;

class MeshFiles : public ::testing::Test {
 protected:
  MeshFiles()
      : folder(fs::path(::testing::TempDir()) /
               ::testing::UnitTest::GetInstance()->current_test_info()->name()) {
    fs::create_directories(folder);
  }
  ~MeshFiles() override { fs::remove_all(folder); }

  fs::path write(const std::string& name, const std::string& content) const {
    fs::remove(folder / name);  // a file truncated and written again goes to the disk at once
    std::ofstream(folder / name, std::ios::binary) << content;
    return folder / name;
  }

  MeshFile read(const std::string& name, const std::string& content) const {
    return readTriangleMesh(write(name, content));
  }

  /// The message of the error, which must name the file. Empty if the file is read.
  std::string refusal(const fs::path& path) const {
    try {
      readTriangleMesh(path);
      return "";
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::File);
      EXPECT_NE(std::string(error.what()).find(path.string()), std::string::npos) << error.what();
      return error.what();
    }
  }

  std::string refusal(const std::string& name, const std::string& content) const {
    return refusal(write(name, content));
  }

  fs::path folder;
};

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

template <class T>
std::string bytes(T value, bool reversed = false) {
  std::string text(sizeof value, '\0');
  std::memcpy(text.data(), &value, sizeof value);
  return reversed ? std::string(text.rbegin(), text.rend()) : text;
}

std::string binaryPly(bool bigEndian) {
  std::string text = kPlyHeader;
  text.replace(text.find("ascii"), 5, bigEndian ? "binary_big_endian" : "binary_little_endian");
  for (const Vector3d& p : kSquare) {
    for (const double x : p) text += bytes(static_cast<float>(x), bigEndian);
    text += '\1';
  }
  text += '\4';
  for (int i = 0; i < 4; ++i) text += bytes(i, bigEndian);
  return text;
}

std::string binaryVtk() {
  std::string text =
      "# vtk DataFile Version 3.0\nsquare\nBINARY\nDATASET POLYDATA\nPOINTS 5 double\n";
  for (const Vector3d& p : kSquare) {
    for (const double x : p) text += bytes(x, true);
  }
  text += "\nPOLYGONS 1 5\n";
  for (const int i : {4, 0, 1, 2, 3}) text += bytes(i, true);
  return text + "\n";
}

std::string binaryStl() {
  std::string text = std::string(80, ' ') + bytes(std::uint32_t{2});
  for (const Triangle& triangle : kFan) {
    text += std::string(12, '\0');
    for (const std::uint32_t v : triangle) {
      for (const double x : kSquare[v]) text += bytes(static_cast<float>(x));
    }
    text += std::string(2, '\0');
  }
  return text;
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

TEST_F(MeshFiles, EveryFormatGivesVerticesAndPolygonsAsFans) {
  for (const auto& [name, content] : kGood) {
    const MeshFile mesh = read(name, content);
    const bool hasUnused = name.find("stl") == std::string::npos;
    EXPECT_EQ(mesh.positions,
              std::vector<Vector3d>(kSquare.begin(), kSquare.end() - (hasUnused ? 0 : 1)))
        << name;
    EXPECT_EQ(mesh.triangles, kFan) << name;
  }
}

TEST_F(MeshFiles, TruncatedFilesAreRefusedOrComplete) {
  // VTK must print no messages.
  ::testing::internal::CaptureStderr();
  ::testing::internal::CaptureStdout();
  std::vector<std::string> wrong;
  for (const auto& [name, content] : kGood) {
    for (std::size_t length = 0; length < content.size(); ++length) {
      try {
        const MeshFile mesh = read(name, content.substr(0, length));
        if (mesh.triangles != kFan) wrong.push_back(name + " " + std::to_string(length));
      } catch (const Error&) {
      }
    }
  }
  EXPECT_EQ(::testing::internal::GetCapturedStderr(), "");
  EXPECT_EQ(::testing::internal::GetCapturedStdout(), "");
  // In these formats, a text that ends within its last line or number cannot be told from a shorter
  // one.
  for (const std::string& one : wrong) EXPECT_TRUE(one.starts_with("a.obj")) << one;
}

TEST_F(MeshFiles, DamagedFilesAreReadOrRefusedWithoutOutput) {
  ::testing::internal::CaptureStderr();
  ::testing::internal::CaptureStdout();
  for (const auto& [name, content] : kGood) {
    for (std::size_t at = 0; at < content.size(); ++at) {
      for (const char damage : {'\0', '9', '-', '\xff'}) {
        std::string damaged = content;
        damaged[at] = damage;
        try {
          for (const Triangle& t : read(name, damaged).triangles)
            EXPECT_LT(std::max({t[0], t[1], t[2]}), 99u);
        } catch (const Error& error) {
          EXPECT_EQ(error.code(), ErrorCode::File);
        }
      }
    }
  }
  EXPECT_EQ(::testing::internal::GetCapturedStderr(), "");
  EXPECT_EQ(::testing::internal::GetCapturedStdout(), "");
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.rfind(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

TEST_F(MeshFiles, MissingFilesEmptyFilesFoldersAndUnknownFormatsAreRefused) {
  for (const char* kind : {".obj", ".ply", ".vtk", ".vtp", ".stl"}) {
    EXPECT_NE(refusal(folder / ("missing" + std::string(kind))).find("no such file"),
              std::string::npos);
    EXPECT_NE(refusal("empty" + std::string(kind), "").find("empty"), std::string::npos);
    EXPECT_NE(refusal("text" + std::string(kind), "Dear surgeon,\nthis is a letter.\n"), "");
    fs::create_directories(folder / ("folder" + std::string(kind)));
    EXPECT_NE(refusal(folder / ("folder" + std::string(kind))).find("folder"), std::string::npos);
  }
  EXPECT_NE(refusal("a.xyz", "1").find("does not end in"), std::string::npos);
}

TEST_F(MeshFiles, IndicesOutOfRangeAreRefused) {
  const std::string reason = "polygon 0 (from 0) has a vertex index out of range; the file has 5";
  EXPECT_NE(refusal("high.obj", replaced(kObj, "4//1", "6//1")).find(reason), std::string::npos);
  EXPECT_NE(refusal("zero.obj", replaced(kObj, "4//1", "0//1")).find(reason), std::string::npos);
  EXPECT_NE(refusal("back.obj", replaced(kObj, "4//1", "-6")).find(reason), std::string::npos);
  EXPECT_NE(refusal("high.ply", replaced(kPly, "2 3\n", "2 5\n")).find(reason), std::string::npos);
  EXPECT_NE(refusal("low.ply", replaced(kPly, "2 3\n", "2 -1\n")).find(reason), std::string::npos);
  EXPECT_NE(refusal("high.vtk", replaced(kVtk, "2 3\n", "2 5\n")).find(reason), std::string::npos);
  EXPECT_NE(refusal("high5.vtk", replaced(kVtk5, "2 3\n", "2 5\n")).find(reason),
            std::string::npos);
  EXPECT_NE(refusal("high.vtp", replaced(kVtp, "2 3<", "2 5<")).find(reason), std::string::npos);
  EXPECT_NE(refusal("low.vtp", replaced(kVtp, "2 3<", "2 -9<")).find(reason), std::string::npos);
  EXPECT_NE(refusal("half.vtp", replaced(kVtp, "2 3<", "2 2.5<")).find(reason), std::string::npos);
}

TEST_F(MeshFiles, PiecesOfAVtpFileAreOneMeshAndUseTheirOwnVertices) {
  const std::size_t begin = kVtp.find("<Piece"), end = kVtp.find("</PolyData>");
  const std::string piece = kVtp.substr(begin, end - begin);
  const auto withFirst = [&](const std::string& first) {
    return std::string(kVtp).insert(begin, first);
  };
  const MeshFile mesh = read("two.vtp", withFirst(piece));
  EXPECT_EQ(mesh.positions.size(), 10u);
  EXPECT_EQ(mesh.triangles, (std::vector<Triangle>{{0, 1, 2}, {0, 2, 3}, {5, 6, 7}, {5, 7, 8}}));
  EXPECT_NE(refusal("into.vtp", withFirst(replaced(piece, "2 3<", "2 6<"))).find("polygon 0"),
            std::string::npos);
  EXPECT_NE(refusal("back.vtp", replaced(withFirst(piece), "2 3<", "2 -1<")).find("polygon 1"),
            std::string::npos);
}

TEST_F(MeshFiles, CoordinatesThatAreNotFiniteAreRefused) {
  for (const char* value : {"nan", "inf", "1e999"}) {
    const std::string reason = "vertex 4 (from 0) has a coordinate that is not finite";
    EXPECT_NE(refusal("a.obj", replaced(kObj, "7 7 7", "7 7 " + std::string(value))).find(reason),
              std::string::npos);
    EXPECT_NE(refusal("a.ply", replaced(kPly, "7 7 7", "7 7 " + std::string(value))).find(reason),
              std::string::npos);
    EXPECT_NE(refusal("a.vtk", replaced(kVtk, "7 7 7", "7 7 " + std::string(value))).find(reason),
              std::string::npos);
  }
  EXPECT_NE(refusal("a.stl", replaced(kStl, "0 1 0", "0 nan 0")).find("not finite"),
            std::string::npos);
  EXPECT_EQ(refusal("tiny.obj", replaced(kObj, "7 7 7", "7 7 1e-999")), "");
}

TEST_F(MeshFiles, CountsLargerThanTheFileAreRefused) {
  const std::string reason = "shorter than its counts require";
  EXPECT_NE(refusal("a.ply", replaced(kPly, "vertex 5", "vertex 4000000000")).find(reason),
            std::string::npos);
  EXPECT_NE(refusal("a.vtk", replaced(kVtk, "POINTS 5", "POINTS 400000000000")).find(reason),
            std::string::npos);
  EXPECT_NE(refusal("a.vtp", replaced(kVtp, "Points=\"5\"", "Points=\"40000000000\"")).find(reason),
            std::string::npos);
  EXPECT_NE(refusal("list.ply", replaced(kPly, "4 0 1 2 3", "2000000000 0 1 2 3")), "");
  EXPECT_NE(refusal("cell.vtk", replaced(kVtk, "4 0 1 2 3", "9 0 1 2 3")).find("wrong number"),
            std::string::npos);
  EXPECT_NE(refusal("offset.vtp", replaced(kVtp, ">4<", ">9<")), "");
}

TEST_F(MeshFiles, OtherDataSetsAreRefused) {
  EXPECT_NE(
      refusal("grid.vtk", replaced(kVtk, "POLYDATA", "UNSTRUCTURED_GRID")).find("not POLYDATA"),
      std::string::npos);
  EXPECT_NE(refusal("line.obj", "v 0 0 0\nv 1 0 0\nl 1 2\n").find("no triangles"),
            std::string::npos);
  EXPECT_NE(refusal("two.obj", "v 0 0 0\nv 1 0 0\nf 1 2\n").find("fewer than three"),
            std::string::npos);
  EXPECT_NE(refusal("short.obj", "v 0 0 0\nv 1 0\n").find("in line 2 a number is missing"),
            std::string::npos);
  EXPECT_NE(refusal("half.obj", replaced(kObj, "4//1", "1.5")).find("not a whole number"),
            std::string::npos);
}

TEST_F(MeshFiles, StripsBecomeTheirTriangles) {
  const std::string strips =
      replaced(kVtk, "POLYGONS 1 5\n4 0 1 2 3", "TRIANGLE_STRIPS 1 5\n4 0 1 3 2");
  EXPECT_EQ(read("a.vtk", strips).triangles, (std::vector<Triangle>{{0, 1, 3}, {3, 1, 2}}));
}

TEST_F(MeshFiles, StlKeepsFacetsWithoutArea) {
  const std::string flat = replaced(kStl, "vertex 0 1 0", "vertex 1 1 0.5");
  EXPECT_EQ(read("a.stl", flat).triangles, (std::vector<Triangle>{{0, 1, 2}, {0, 2, 2}}));
}

TEST(MeshFile, OrgansAreReadAsWritten) {
  for (const auto& [name, mesh] : scenes::organMeshes()) {
    const MeshFile read =
        readTriangleMesh(std::string(PALPATE_SOURCE_DIR) + "/Data/Organs/" + name + ".obj");
    EXPECT_EQ(read.positions, mesh.positions) << name;
    EXPECT_EQ(read.triangles, mesh.triangles) << name;
  }
}

TEST(MeshFile, PublishedMeshesKeepTheirVertices) {
  const fs::path folder = fs::path(PALPATE_SHARED_DATA) / "meshes";
  if (!fs::exists(folder)) GTEST_SKIP() << "no published meshes";
  const auto counts = [&](const char* name) {
    const MeshFile mesh = readTriangleMesh(folder / name);
    return std::pair(mesh.positions.size(), mesh.triangles.size());
  };
  EXPECT_EQ(counts("liver-smooth.obj"), std::pair(std::size_t{2194}, std::size_t{4384}));
  EXPECT_EQ(counts("aneurysm.obj"), std::pair(std::size_t{7095}, std::size_t{14186}));
  EXPECT_EQ(counts("dental_instrument.obj"), std::pair(std::size_t{1100}, std::size_t{2178}));
}

}  // namespace
}  // namespace palpate::vtk
