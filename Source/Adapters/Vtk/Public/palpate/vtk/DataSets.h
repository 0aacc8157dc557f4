#pragma once

#include <palpate/Export.h>
#include <palpate/MeshFiles.h>

class vtkPolyData;
class vtkUnstructuredGrid;
template <class T>
class vtkSmartPointer;

namespace palpate::vtk {

/// The positions and elements of a data set of VTK, copied.
///
/// Shapes   all points in their order. Polygons and quads become fans about their first corner,
///          triangle strips their triangles, polylines their segments, vertices points. Arrays of
///          data are left behind. VTK may build its list of cells in the data set.
/// Errors   UnsupportedMethod for cells of other kinds, such as hexahedra and quadratic cells, with
///          VTK's name; NonFinitePosition, IndexOutOfRange, TooLarge.
/// Cost     linear.
/// Threads  as VTK's: other threads must not use the data set.
PALPATE_EXPORT MeshArrays toMeshArrays(vtkPolyData&);
PALPATE_EXPORT MeshArrays toMeshArrays(vtkUnstructuredGrid&);

/// The arrays as a data set of VTK, with points in double, and one cell for each element: points,
/// segments, triangles, then tetrahedra. Include VTK's headers for the result.
///
/// Errors   IndexOutOfRange, and UnsupportedMethod for tetrahedra in polygonal data.
/// Cost     linear.
PALPATE_EXPORT vtkSmartPointer<vtkPolyData> toPolyData(const MeshArrays&);
PALPATE_EXPORT vtkSmartPointer<vtkUnstructuredGrid> toUnstructuredGrid(const MeshArrays&);

}  // namespace palpate::vtk
