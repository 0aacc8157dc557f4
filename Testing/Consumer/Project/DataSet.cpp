#include <palpate/vtk/DataSets.h>

#include <vtkSmartPointer.h>
#include <vtkUnstructuredGrid.h>

int main() {
  palpate::MeshArrays mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  mesh.tetrahedra = {{0, 1, 2, 3}};
  const vtkSmartPointer<vtkUnstructuredGrid> grid = palpate::vtk::toUnstructuredGrid(mesh);
  return palpate::vtk::toMeshArrays(*grid).tetrahedra == mesh.tetrahedra ? 0 : 1;
}
