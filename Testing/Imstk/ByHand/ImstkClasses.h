#pragma once

// For the scene by hand of Docs/HowTo/FromIMSTK.md: iMSTK's own headers instead of
// Testing/Documentation/ImstkClasses.h.

#include <imstkCapsule.h>
#include <imstkCollisionData.h>
#include <imstkLineMesh.h>
#include <imstkSurfaceMesh.h>
#include <imstkTetrahedralMesh.h>
#include <imstkVecDataArray.h>

#include <memory>
#include <tuple>

namespace imstk {
template <class Positions, class Elements, class Mesh>
std::shared_ptr<Mesh> meshOf(const Positions& positions, const Elements& elements, Mesh*) {
  constexpr int kCorners = static_cast<int>(std::tuple_size_v<typename Elements::value_type>);
  const auto vertices = std::make_shared<VecDataArray<double, 3>>();
  for (const auto& p : positions) vertices->push_back(p);
  const auto cells = std::make_shared<VecDataArray<int, kCorners>>();
  for (const auto& element : elements) {
    Eigen::Matrix<int, kCorners, 1> cell;
    for (int i = 0; i < kCorners; ++i) cell[i] = static_cast<int>(element[static_cast<size_t>(i)]);
    cells->push_back(cell);
  }
  const auto mesh = std::make_shared<Mesh>();
  mesh->initialize(vertices, cells);
  return mesh;
}
}  // namespace imstk
