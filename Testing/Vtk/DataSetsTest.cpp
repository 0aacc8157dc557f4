#include <palpate/Error.h>
#include <palpate/vtk/DataSets.h>

#include "Common/ExpectRefused.h"

#include <gtest/gtest.h>
#include <vtkCellArray.h>
#include <vtkCellType.h>
#include <vtkNew.h>
#include <vtkPoints.h>
#include <vtkPolyData.h>
#include <vtkSmartPointer.h>
#include <vtkUnstructuredGrid.h>

#include <limits>

namespace palpate::vtk {
namespace {

using palpate::testing::expectRefused;

MeshArrays mesh() {
  MeshArrays mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1.0 / 3, -0.0, 1e300}};
  mesh.triangles = {{0, 1, 2}, {2, 1, 4}};
  mesh.segments = {{0, 1}, {4, 1}};
  mesh.points = {3};
  return mesh;
}

void expectEqual(const MeshArrays& a, const MeshArrays& b) {
  EXPECT_EQ(a.positions, b.positions);
  EXPECT_EQ(a.triangles, b.triangles);
  EXPECT_EQ(a.tetrahedra, b.tetrahedra);
  EXPECT_EQ(a.segments, b.segments);
  EXPECT_EQ(a.points, b.points);
}

TEST(DataSets, ComeBackAsTheyWere) {
  MeshArrays solid = mesh();
  expectEqual(toMeshArrays(*toPolyData(solid)), solid);
  solid.tetrahedra = {{0, 1, 2, 3}, {1, 2, 3, 4}};
  expectEqual(toMeshArrays(*toUnstructuredGrid(solid)), solid);
  expectEqual(toMeshArrays(*toUnstructuredGrid({})), {});
  expectEqual(toMeshArrays(*toPolyData({})), {});
  expectRefused(ErrorCode::UnsupportedMethod, "", [&] { toPolyData(solid); });
}

TEST(DataSets, PolygonsPolylinesAndStripsAreSplit) {
  const vtkSmartPointer<vtkUnstructuredGrid> grid = toUnstructuredGrid(mesh());
  const vtkIdType ids[]{0, 1, 2, 3, 4};
  grid->InsertNextCell(VTK_POLY_LINE, 3, ids);
  grid->InsertNextCell(VTK_POLY_VERTEX, 2, ids);
  grid->InsertNextCell(VTK_QUAD, 4, ids);
  grid->InsertNextCell(VTK_POLYGON, 5, ids);
  grid->InsertNextCell(VTK_TRIANGLE_STRIP, 4, ids);
  MeshArrays expected = mesh();
  expected.segments.insert(expected.segments.end(), {{0, 1}, {1, 2}});
  expected.points.insert(expected.points.end(), {0, 1});
  expected.triangles.insert(
      expected.triangles.end(),
      {{0, 1, 2}, {0, 2, 3}, {0, 1, 2}, {0, 2, 3}, {0, 3, 4}, {0, 1, 2}, {2, 1, 3}});
  expectEqual(toMeshArrays(*grid), expected);
}

TEST(DataSets, OtherCellsAreRefusedByName) {
  const vtkSmartPointer<vtkUnstructuredGrid> grid = toUnstructuredGrid(mesh());
  const vtkIdType ids[]{0, 1, 2, 3, 4, 0, 1, 2, 3, 4};
  grid->InsertNextCell(VTK_HEXAHEDRON, 8, ids);
  expectRefused(ErrorCode::UnsupportedMethod,
                "Cell 5 of the data set is a vtkHexahedron of 8 points",
                [&] { toMeshArrays(*grid); });
  const vtkSmartPointer<vtkUnstructuredGrid> second = toUnstructuredGrid(mesh());
  second->InsertNextCell(VTK_QUADRATIC_TETRA, 10, ids);
  expectRefused(ErrorCode::UnsupportedMethod, "vtkQuadraticTetra", [&] { toMeshArrays(*second); });
}

TEST(DataSets, InvalidPointsAreRefused) {
  const vtkSmartPointer<vtkPolyData> data = toPolyData(mesh());
  data->GetPoints()->SetPoint(2, 0, std::numeric_limits<double>::quiet_NaN(), 0);
  expectRefused(ErrorCode::NonFinitePosition, "Point 2", [&] { toMeshArrays(*data); });
  const vtkSmartPointer<vtkUnstructuredGrid> grid = toUnstructuredGrid(mesh());
  const vtkIdType ids[]{0, 1, 5};
  grid->InsertNextCell(VTK_TRIANGLE, 3, ids);
  expectRefused(ErrorCode::IndexOutOfRange, "point 5", [&] { toMeshArrays(*grid); });
  MeshArrays bad = mesh();
  bad.segments[1][0] = 5;
  expectRefused(ErrorCode::IndexOutOfRange, "", [&] { toPolyData(bad); });
  expectRefused(ErrorCode::IndexOutOfRange, "", [&] { toUnstructuredGrid(bad); });
}

}  // namespace
}  // namespace palpate::vtk
