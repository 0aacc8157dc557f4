#include <palpate/vtk/DataSets.h>

#include <palpate/AnalyticalGeometry.h>
#include <palpate/Error.h>

#include <vtkCellArray.h>
#include <vtkCellType.h>
#include <vtkCellTypes.h>
#include <vtkIdList.h>
#include <vtkNew.h>
#include <vtkPoints.h>
#include <vtkPolyData.h>
#include <vtkSmartPointer.h>
#include <vtkUnstructuredGrid.h>

#include <array>
#include <cmath>
#include <string>

namespace palpate::vtk {

namespace {

std::vector<Eigen::Vector3d> positionsOf(vtkPointSet& set) {
  const vtkIdType count = set.GetNumberOfPoints();
  if (count >= static_cast<vtkIdType>(kNoElement))
    throw Error(ErrorCode::TooLarge, "The data set has 2^32 - 1 points or more.");
  std::vector<Eigen::Vector3d> positions(static_cast<std::size_t>(count));
  for (std::size_t i = 0; i < positions.size(); ++i) {
    set.GetPoint(static_cast<vtkIdType>(i), positions[i].data());
    for (const double x : positions[i])
      if (!(std::abs(x) <= kLargestMeasure))  // refuses NaN
        throw Error(ErrorCode::NonFinitePosition,
                    "Point " + std::to_string(i) +
                        " of the data set has a coordinate that is not "
                        "finite, or beyond 1e300.",
                    {}, i);
  }
  return positions;
}

/// Adds cells to arrays whose positions are complete.
class Cells {
 public:
  explicit Cells(MeshArrays& mesh) : m_mesh(mesh) {}

  void add(int type, vtkIdType cell, vtkIdList& points) {
    readCorners(cell, points);
    const std::size_t count = m_corners.size();
    if (type == VTK_VERTEX || type == VTK_POLY_VERTEX)
      m_mesh.points.insert(m_mesh.points.end(), m_corners.begin(), m_corners.end());
    else if ((type == VTK_LINE || type == VTK_POLY_LINE) && count >= 2)
      addSegments();
    else if ((type == VTK_TRIANGLE || type == VTK_QUAD || type == VTK_POLYGON) && count >= 3)
      addFan();
    else if (type == VTK_TRIANGLE_STRIP && count >= 3)
      addStrip();
    else if (type == VTK_TETRA && count == 4)
      m_mesh.tetrahedra.push_back({m_corners[0], m_corners[1], m_corners[2], m_corners[3]});
    else
      refuse(type, cell);
  }

 private:
  void readCorners(vtkIdType cell, vtkIdList& points) {
    m_corners.clear();
    for (vtkIdType i = 0; i < points.GetNumberOfIds(); ++i) {
      const vtkIdType corner = points.GetId(i);
      if (corner < 0 || corner >= static_cast<vtkIdType>(m_mesh.positions.size()))
        throw Error(ErrorCode::IndexOutOfRange,
                    "Cell " + std::to_string(cell) + " of the data set has point " +
                        std::to_string(corner) + ", but there are " +
                        std::to_string(m_mesh.positions.size()) + " points.",
                    {}, static_cast<std::size_t>(cell));
      m_corners.push_back(static_cast<std::uint32_t>(corner));
    }
  }

  void addSegments() {
    for (std::size_t i = 1; i < m_corners.size(); ++i)
      m_mesh.segments.push_back({m_corners[i - 1], m_corners[i]});
  }
  void addFan() {
    for (std::size_t i = 2; i < m_corners.size(); ++i)
      m_mesh.triangles.push_back({m_corners[0], m_corners[i - 1], m_corners[i]});
  }
  /// Every second triangle of a strip is wound the other way.
  void addStrip() {
    for (std::size_t i = 2; i < m_corners.size(); ++i)
      m_mesh.triangles.push_back(
          {m_corners[i - 2 + i % 2], m_corners[i - 1 - i % 2], m_corners[i]});
  }

  [[noreturn]] void refuse(int type, vtkIdType cell) const {
    throw Error(ErrorCode::UnsupportedMethod,
                "Cell " + std::to_string(cell) + " of the data set is a " +
                    vtkCellTypes::GetClassNameFromTypeId(type) + " of " +
                    std::to_string(m_corners.size()) +
                    " points. Vertices, lines, triangles, polygons, strips and tetrahedra of first "
                    "order can be used.",
                {}, static_cast<std::size_t>(cell));
  }

  MeshArrays& m_mesh;
  std::vector<std::uint32_t> m_corners;
};

template <class Set>
MeshArrays arraysOf(Set& set) {
  MeshArrays mesh;
  mesh.positions = positionsOf(set);
  Cells cells(mesh);
  vtkNew<vtkIdList> points;
  for (vtkIdType cell = 0; cell < set.GetNumberOfCells(); ++cell) {
    set.GetCellPoints(cell, points);
    cells.add(set.GetCellType(cell), cell, *points);
  }
  return mesh;
}

vtkSmartPointer<vtkPoints> pointsOf(const MeshArrays& mesh) {
  auto points = vtkSmartPointer<vtkPoints>::New();
  points->SetDataTypeToDouble();
  points->SetNumberOfPoints(static_cast<vtkIdType>(mesh.positions.size()));
  for (std::size_t i = 0; i < mesh.positions.size(); ++i)
    points->SetPoint(static_cast<vtkIdType>(i), mesh.positions[i].data());
  return points;
}

template <std::size_t N>
std::array<vtkIdType, N> idsOf(const std::array<std::uint32_t, N>& element,
                               const MeshArrays& mesh) {
  std::array<vtkIdType, N> ids;
  for (std::size_t i = 0; i < N; ++i) {
    if (element[i] >= mesh.positions.size())
      throw Error(ErrorCode::IndexOutOfRange,
                  "An element has vertex " + std::to_string(element[i]) + ", but there are " +
                      std::to_string(mesh.positions.size()) + " vertices.");
    ids[i] = element[i];
  }
  return ids;
}

template <class Elements, class Insert>
void insertAll(const MeshArrays& mesh, const Elements& elements, Insert&& insert) {
  for (const auto& element : elements) {
    const auto ids = idsOf(element, mesh);
    insert(static_cast<vtkIdType>(ids.size()), ids.data());
  }
}

std::vector<std::array<std::uint32_t, 1>> pointElements(const MeshArrays& mesh) {
  std::vector<std::array<std::uint32_t, 1>> elements;
  for (const std::uint32_t point : mesh.points) elements.push_back({point});
  return elements;
}

}  // namespace

MeshArrays toMeshArrays(vtkPolyData& data) { return arraysOf(data); }
MeshArrays toMeshArrays(vtkUnstructuredGrid& grid) { return arraysOf(grid); }

vtkSmartPointer<vtkPolyData> toPolyData(const MeshArrays& mesh) {
  if (!mesh.tetrahedra.empty())
    throw Error(ErrorCode::UnsupportedMethod, "Polygonal data of VTK have no tetrahedra.");
  const auto cellsOf = [&](const auto& elements) {
    auto cells = vtkSmartPointer<vtkCellArray>::New();
    insertAll(mesh, elements,
              [&](vtkIdType count, const vtkIdType* ids) { cells->InsertNextCell(count, ids); });
    return cells;
  };
  auto data = vtkSmartPointer<vtkPolyData>::New();
  data->SetPoints(pointsOf(mesh));
  data->SetVerts(cellsOf(pointElements(mesh)));
  data->SetLines(cellsOf(mesh.segments));
  data->SetPolys(cellsOf(mesh.triangles));
  return data;
}

vtkSmartPointer<vtkUnstructuredGrid> toUnstructuredGrid(const MeshArrays& mesh) {
  auto grid = vtkSmartPointer<vtkUnstructuredGrid>::New();
  grid->SetPoints(pointsOf(mesh));
  const auto add = [&](int type, const auto& elements) {
    insertAll(mesh, elements, [&](vtkIdType count, const vtkIdType* ids) {
      grid->InsertNextCell(type, count, ids);
    });
  };
  add(VTK_VERTEX, pointElements(mesh));
  add(VTK_LINE, mesh.segments);
  add(VTK_TRIANGLE, mesh.triangles);
  add(VTK_TETRA, mesh.tetrahedra);
  return grid;
}

}  // namespace palpate::vtk
