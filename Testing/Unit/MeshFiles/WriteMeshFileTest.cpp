#include "Common/ExpectRefused.h"
#include "MeshFileFixture.h"

#include <cfloat>
#include <clocale>
#include <cmath>
#include <limits>
#include <locale>
#include <sys/stat.h>

namespace palpate::testing {
namespace {

using Eigen::Vector3d;
namespace fs = std::filesystem;

class WriteMeshFile : public MeshFileFixture {};

/// Numbers that a decimal of 15 digits, or one of 17, does not hold in every printer.
MeshArrays mesh() {
  MeshArrays mesh;
  mesh.positions = {{0.1, -0.0, 1.0 / 3},
                    {DBL_MIN, -DBL_TRUE_MIN, 1e300},
                    {-1e300, 5e-324, 123456789.123456789},
                    {std::nextafter(1.0, 2.0), 2e22, 1e-7},
                    {7, 7, 7}};
  mesh.triangles = {{0, 1, 2}, {2, 1, 3}};
  mesh.tetrahedra = {{0, 1, 2, 3}, {3, 2, 1, 0}};
  mesh.segments = {{0, 1}, {3, 1}, {1, 2}};
  mesh.points = {3, 0};
  return mesh;
}

struct Variant {
  std::string name;
  MeshWriteSettings settings;
};
const Variant kVariants[]{{"a.obj", {}},
                          {"text.ply", {.binary = false}},
                          {"binary.ply", {}},
                          {"text.stl", {.binary = false}},
                          {"binary.stl", {}},
                          {"text.vtk", {.binary = false}},
                          {"binary.vtk", {}},
                          {"text.vtp", {.binary = false}},
                          {"binary.vtp", {}},
                          {"text.vtu", {.binary = false}},
                          {"binary.vtu", {}},
                          {"text22.msh", {.binary = false, .gmsh22 = true}},
                          {"binary22.msh", {.gmsh22 = true}},
                          {"text41.msh", {.binary = false}},
                          {"binary41.MSH", {}},
                          {"a.mesh", {}}};

/// Without the elements that a format does not have.
MeshArrays heldBy(const std::string& name, MeshArrays mesh) {
  const std::string kind = name.substr(name.find('.') + 1);
  if (kind == "obj" || kind == "ply" || kind == "stl" || kind == "vtp") mesh.tetrahedra.clear();
  if (kind == "ply" || kind == "stl" || kind == "mesh") mesh.points.clear();
  if (kind == "stl") mesh.segments.clear();
  return mesh;
}

std::vector<std::uint64_t> bitsOf(const std::vector<Vector3d>& positions) {
  std::vector<std::uint64_t> bits;
  for (const Vector3d& p : positions)
    for (const double x : p) bits.push_back(std::bit_cast<std::uint64_t>(x));
  return bits;
}

void expectSame(const MeshArrays& a, const MeshArrays& b) {
  EXPECT_EQ(bitsOf(a.positions), bitsOf(b.positions));
  EXPECT_EQ(a.triangles, b.triangles);
  EXPECT_EQ(a.tetrahedra, b.tetrahedra);
  EXPECT_EQ(a.segments, b.segments);
  EXPECT_EQ(a.points, b.points);
}

/// Each format but STL reads back the mesh without the elements that it does not have.
void expectReadsBack(const fs::path& folder, const MeshArrays& mesh) {
  for (const auto& [name, settings] : kVariants) {
    if (name.ends_with(".stl")) continue;
    SCOPED_TRACE(name);
    const MeshArrays written = heldBy(name, mesh);
    if (written.points.empty() && written.segments.empty() && written.triangles.empty() &&
        written.tetrahedra.empty())
      continue;
    writeMeshFile(folder / name, written, settings);
    expectSame(readMeshFile(folder / name), written);
  }
}

TEST_F(WriteMeshFile, ReadsBackTheSameBitsOfAllAndOfEachKindOfElements) {
  expectReadsBack(folder, mesh());
  for (int kind = 0; kind < 4; ++kind) {
    SCOPED_TRACE(kind);
    MeshArrays one = mesh();
    if (kind != 0) one.points.clear();
    if (kind != 1) one.segments.clear();
    if (kind != 2) one.triangles.clear();
    if (kind != 3) one.tetrahedra.clear();
    expectReadsBack(folder, one);
  }
}

TEST_F(WriteMeshFile, StlKeepsTextExactlyAndFloatsInBinary) {
  const MeshArrays written = heldBy("a.stl", mesh());
  writeMeshFile(folder / "a.stl", written, {.binary = false});
  const MeshArrays text = readMeshFile(folder / "a.stl");
  ASSERT_EQ(text.positions.size(), 6u);
  for (std::size_t i = 0; i < 6; ++i)
    EXPECT_EQ(text.positions[text.triangles[i / 3][i % 3]],
              written.positions[written.triangles[i / 3][i % 3]]);
  testing::expectRefused(
      ErrorCode::NonFinitePosition, "", [&] { writeMeshFile(folder / "a.stl", written); }, {}, 1u);
  MeshArrays small = written;
  small.positions = {{0.1, 0.2, 0.3}, {1, 0, 0}, {0, 1, 0}, {1, 1, 1}};
  writeMeshFile(folder / "a.stl", small);
  const MeshArrays binary = readMeshFile(folder / "a.stl", {.weldDistance = 0.0});
  EXPECT_EQ(binary.triangles, small.triangles);
  EXPECT_EQ(binary.positions[0], Vector3d(0.1f, 0.2f, 0.3f));
  EXPECT_EQ(contentOf(folder / "a.stl").size(), 84u + 2 * 50);
}

TEST_F(WriteMeshFile, RefusesElementsThatTheFormatDoesNotHave) {
  const MeshArrays all = mesh();
  for (const auto& [name, settings] : kVariants) {
    const MeshArrays held = heldBy(name, all);
    if (held.tetrahedra == all.tetrahedra && held.segments == all.segments &&
        held.points == all.points)
      continue;
    testing::expectRefused(ErrorCode::File, " has no ", [&, &n = name, &how = settings] {
      writeMeshFile(folder / n, all, how);
    });
    EXPECT_FALSE(fs::exists(folder / name));
  }
}

TEST_F(WriteMeshFile, RefusesInvalidArraysAndLeavesTheOldFile) {
  const auto refuse = [&](ErrorCode code, const MeshArrays& mesh) {
    testing::expectRefused(code, "", [&] { writeMeshFile(folder / "a.vtu", mesh); });
  };
  writeMeshFile(folder / "a.vtu", mesh());
  const std::string old = contentOf(folder / "a.vtu");
  MeshArrays bad = mesh();
  bad.positions[3].y() = std::numeric_limits<double>::quiet_NaN();
  refuse(ErrorCode::NonFinitePosition, bad);
  bad = mesh();
  bad.positions[3].y() = 2e300;
  refuse(ErrorCode::NonFinitePosition, bad);
  for (int kind = 0; kind < 4; ++kind) {
    bad = mesh();
    if (kind == 0) bad.triangles[1][2] = 5;
    if (kind == 1) bad.tetrahedra[1][2] = 5;
    if (kind == 2) bad.segments[1][1] = 5;
    if (kind == 3) bad.points[1] = 5;
    refuse(ErrorCode::IndexOutOfRange, bad);
  }
  EXPECT_EQ(contentOf(folder / "a.vtu"), old);
}

#ifndef _WIN32  // which has no pipes with a path
TEST_F(WriteMeshFile, RefusesPathsThatNameNoRegularFile) {
  const auto refuse = [&](const fs::path& path) {
    testing::expectRefused(ErrorCode::File, "", [&] { writeMeshFile(path, mesh()); });
  };
  fs::create_directories(folder / "a.vtu");
  refuse(folder / "a.vtu");
  EXPECT_TRUE(fs::is_directory(folder / "a.vtu"));
  ASSERT_EQ(::mkfifo((folder / "pipe.vtu").c_str(), 0600), 0);
  refuse(folder / "pipe.vtu");
  EXPECT_TRUE(fs::is_fifo(folder / "pipe.vtu"));
  fs::create_symlink("/dev/null", folder / "null.vtu");
  refuse(folder / "null.vtu");
  refuse(folder / "missing" / "a.vtu");
  refuse(folder / "a.xyz");
  refuse(folder / "a");
  EXPECT_THROW(readMeshFile(folder / "pipe.vtu"), Error);
  for (const auto& entry : fs::directory_iterator(folder))
    EXPECT_NE(entry.path().extension(), ".part");
}
#endif

/// Decimal commas and grouped digits, whatever locales the machine has.
class Commas : public std::numpunct<char> {
  char do_decimal_point() const override { return ','; }
  char do_thousands_sep() const override { return '.'; }
  std::string do_grouping() const override { return "\3"; }
};

TEST_F(WriteMeshFile, TheLocaleHasNoEffect) {
  const std::locale old = std::locale::global(std::locale(std::locale(), new Commas));
  std::setlocale(LC_ALL, "de_DE.UTF-8");
  MeshArrays large = mesh();
  large.positions.resize(2000, Vector3d(1234567.25, 0.5, 0));
  large.triangles.push_back({1000, 1500, 1999});
  expectReadsBack(folder, large);
  std::locale::global(old);
  std::setlocale(LC_ALL, "C");
}

TEST_F(WriteMeshFile, TextIsTheShortestDecimal) {
  MeshArrays one;
  one.positions = {{0.1, 1e22, -0.0}, {1, 2, 3}, {0.30000000000000004, 0, 1}};
  one.triangles = {{0, 1, 2}};
  writeMeshFile(folder / "a.obj", one);
  EXPECT_EQ(contentOf(folder / "a.obj"),
            "v 0.1 1e+22 -0\nv 1 2 3\nv 0.30000000000000004 0 1\nf 1 2 3\n");
}

}  // namespace
}  // namespace palpate::testing
