#pragma once

// Classes with the names and signatures of iMSTK's, for the program of Docs/HowTo/FromIMSTK.md.

#include <palpate/ArrayAdapter.h>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <memory>
#include <vector>

// iMSTK's are macros, too.
#define IMSTK_VERTEX 0
#define IMSTK_EDGE 1
#define IMSTK_TRIANGLE 2

namespace imstk {
template <class T, int N>
class VecDataArray {  // as iMSTK's, getPointer() is not const
 public:
  using ValueType = Eigen::Matrix<T, N, 1>;
  std::vector<ValueType> values;
  ValueType* getPointer() { return values.data(); }
  int size() const { return static_cast<int>(values.size()); }
  const ValueType& operator[](const size_t i) const { return values[i]; }
};
template <int N>
struct CellMesh {
  std::shared_ptr<VecDataArray<double, 3>> positions = std::make_shared<VecDataArray<double, 3>>();
  std::shared_ptr<VecDataArray<int, N>> cells = std::make_shared<VecDataArray<int, N>>();
  std::shared_ptr<VecDataArray<double, 3>> getVertexPositions() { return positions; }
  std::shared_ptr<VecDataArray<int, N>> getCells() const { return cells; }
};
using TetrahedralMesh = CellMesh<4>;
using SurfaceMesh = CellMesh<3>;
using LineMesh = CellMesh<2>;
struct Capsule {
  Eigen::Vector3d position;
  double radius, length;
  void setPosition(const Eigen::Vector3d& p) { position = p; }
  void setRadius(double r) { radius = r; }
  void setLength(double l) { length = l; }
  double getRadius() { return radius; }
  double getLength() { return length; }
  Eigen::Vector3d getPosition() { return position; }
  Eigen::Quaterniond getOrientation() { return Eigen::Quaterniond::Identity(); }
};
using CellTypeId = int;
struct CellIndexElement {
  int ids[4] = {-1, -1, -1, -1};
  int idCount = 0;
  CellTypeId cellType = IMSTK_VERTEX;
};
template <class Source, class Elements, int N>
std::shared_ptr<CellMesh<N>> meshOf(const Source& positions, const Elements& elements,
                                    CellMesh<N>*) {
  auto mesh = std::make_shared<CellMesh<N>>();
  mesh->positions->values.assign(positions.begin(), positions.end());
  for (const auto& element : elements) {
    Eigen::Matrix<int, N, 1> cell;
    for (std::size_t i = 0; i < static_cast<std::size_t>(N); ++i)
      cell[static_cast<int>(i)] = static_cast<int>(element[i]);
    mesh->cells->values.push_back(cell);
  }
  return mesh;
}
}  // namespace imstk
