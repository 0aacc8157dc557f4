#pragma once

#include <palpate/Export.h>
#include <palpate/MeshFiles.h>

class vtkPolyData;
class vtkUnstructuredGrid;
template <class T>
class vtkSmartPointer;

namespace palpate::vtk {

/// Copies the positions and elements of a data set of VTK, as readMeshFile() does those of a file;
/// polylines become segments, vertices points.
/// Errors   NonFinitePosition, IndexOutOfRange, TooLarge; UnsupportedMethod for others.
/// Threads  as VTK's, which may build its list of cells: no other thread may use the data set.
PALPATE_EXPORT MeshArrays toMeshArrays(vtkPolyData&);
PALPATE_EXPORT MeshArrays toMeshArrays(vtkUnstructuredGrid&);

/// Points in double and one cell per element: points, segments, triangles, then tetrahedra. Linear.
/// Needs VTK's headers for the result.
/// Errors   IndexOutOfRange, and UnsupportedMethod for tetrahedra in polygonal data.
PALPATE_EXPORT vtkSmartPointer<vtkPolyData> toPolyData(const MeshArrays&);
PALPATE_EXPORT vtkSmartPointer<vtkUnstructuredGrid> toUnstructuredGrid(const MeshArrays&);

}  // namespace palpate::vtk
