// VTK 9.1: vtkStaticCellLocator or vtkCellLocator, rebuilt for each frame. FindCellsWithinBounds
// gives candidates for shapes, and ours tests the triangles.
#include "SpatialEngine.h"
#include "TriangleGeometry.h"

#include <vtkCellArray.h>
#include <vtkCellLocator.h>
#include <vtkDoubleArray.h>
#include <vtkGenericCell.h>
#include <vtkIdList.h>
#include <vtkNew.h>
#include <vtkPoints.h>
#include <vtkPolyData.h>
#include <vtkStaticCellLocator.h>

#include <cstdlib>
#include <limits>

namespace palpate::benchmark {
namespace {

template <class Locator>
class VtkQueries : public SpatialEngine {
  static constexpr bool kStatic = std::is_same_v<Locator, vtkStaticCellLocator>;

 public:
  std::string name() const override {
    return kStatic ? "VTK 9.1 vtkStaticCellLocator" : "VTK 9.1 vtkCellLocator";
  }

  void prepare(const std::vector<Triangle>& triangles,
               const std::vector<Eigen::Vector3d>& positions) override {
    setenv("VTK_SMP_BACKEND_IN_USE", "Sequential", 1);  // vtkSMPTools.h is not C++20
    m_triangles = triangles;
    m_points->SetDataTypeToDouble();
    m_points->SetNumberOfPoints(static_cast<vtkIdType>(positions.size()));
    vtkNew<vtkCellArray> cells;
    for (const auto& [a, b, c] : triangles) {
      const vtkIdType ids[] = {a, b, c};
      cells->InsertNextCell(3, ids);
    }
    m_surface->SetPoints(m_points);
    m_surface->SetPolys(cells);
    m_surface->BuildCells();
    m_locator->SetDataSet(m_surface);
    update(positions);
  }

  void update(const std::vector<Eigen::Vector3d>& positions) override {
    m_positions = positions;
    for (std::size_t i = 0; i < positions.size(); ++i)
      m_points->SetPoint(static_cast<vtkIdType>(i), positions[i].data());
    m_points->Modified();
    m_surface->ComputeBounds();
    m_locator->BuildLocator();
  }

  bool answers(SpatialQuery query) const override {
    switch (query) {
      case SpatialQuery::Closest:
      case SpatialQuery::FirstHit:
      case SpatialQuery::Ball:
      case SpatialQuery::Capsule:
      case SpatialQuery::Box:
        return true;
      default:
        return false;
    }
  }

  void ask(SpatialQuery query, std::span<const SpatialCase> cases, const ShapeSizes& sizes,
           SpatialAnswers& out) override {
    for (const SpatialCase& c : cases) {
      if (query == SpatialQuery::Closest)
        closest(c, out);
      else if (query == SpatialQuery::FirstHit)
        firstHit(c, out);
      else
        list(query, c, sizes, out);
    }
  }

 private:
  void closest(const SpatialCase& c, SpatialAnswers& out) {
    double closest[3], distanceSquared;
    vtkIdType cell = -1;
    int part;
    m_locator->FindClosestPoint(c.point.data(), closest, m_cell, cell, part, distanceSquared);
    out.add(std::sqrt(distanceSquared), static_cast<std::uint32_t>(cell));
  }

  void firstHit(const SpatialCase& c, SpatialAnswers& out) {
    const double* bounds = m_surface->GetBounds();
    double reach = 0;  // to the other side of the body
    for (int i = 0; i < 3; ++i)
      reach +=
          std::max(std::abs(bounds[2 * i] - c.point[i]), std::abs(bounds[2 * i + 1] - c.point[i]));
    const Eigen::Vector3d end = c.point + reach * c.direction;
    double t, at[3], parameters[3];
    int part;
    vtkIdType cell = -1;
    const bool hit = m_locator->IntersectWithLine(c.point.data(), end.data(), 0, t, at, parameters,
                                                  part, cell, m_cell) != 0;
    out.add(hit ? t * reach : std::numeric_limits<double>::infinity(),
            hit ? static_cast<std::uint32_t>(cell) : ~0u);
  }

  const Eigen::Vector3d& corner(std::uint32_t triangle, std::size_t i) const {
    return m_positions[m_triangles[triangle][i]];
  }

  void list(SpatialQuery query, const SpatialCase& c, const ShapeSizes& sizes,
            SpatialAnswers& out) {
    const Eigen::Vector3d half = c.rotation.col(0) * sizes.capsuleLength / 2;
    const Eigen::Vector3d p0 = c.point - half, p1 = c.point + half;
    const Eigen::Matrix3d toBox = c.rotation.transpose();
    Eigen::Vector3d reach = Eigen::Vector3d::Constant(sizes.ball);
    if (query == SpatialQuery::Capsule)
      reach = half.cwiseAbs() + Eigen::Vector3d::Constant(sizes.capsuleRadius);
    if (query == SpatialQuery::Box) reach = c.rotation.cwiseAbs() * sizes.boxHalf;
    double bounds[6];
    for (int i = 0; i < 3; ++i) {
      bounds[2 * i] = c.point[i] - reach[i];
      bounds[2 * i + 1] = c.point[i] + reach[i];
    }
    const auto meets = [&](const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                           const Eigen::Vector3d& d) {
      if (query == SpatialQuery::Ball)
        return closestOnTriangle<double>(c.point, a, b, d).distanceSquared <=
               sizes.ball * sizes.ball;
      if (query == SpatialQuery::Capsule)
        return segmentTriangleDistanceSquared<double>(p0, p1, a, b, d) <=
               sizes.capsuleRadius * sizes.capsuleRadius;
      return boxGap<double>(sizes.boxHalf, toBox * (a - c.point), toBox * (b - c.point),
                            toBox * (d - c.point), 0) <= 0;
    };
    m_locator->FindCellsWithinBounds(bounds, m_found);
    for (vtkIdType i = 0; i < m_found->GetNumberOfIds(); ++i) {
      const auto t = static_cast<std::uint32_t>(m_found->GetId(i));
      if (meets(corner(t, 0), corner(t, 1), corner(t, 2))) out.elements.push_back(t);
    }
    out.endCase();
  }

  std::vector<Triangle> m_triangles;
  std::vector<Eigen::Vector3d> m_positions;
  vtkNew<vtkPoints> m_points;
  vtkNew<vtkPolyData> m_surface;
  vtkNew<Locator> m_locator;
  vtkNew<vtkGenericCell> m_cell;
  vtkNew<vtkIdList> m_found;
};

}  // namespace

std::unique_ptr<SpatialEngine> makeVtkQueries(bool isStatic) {
  if (isStatic) return std::make_unique<VtkQueries<vtkStaticCellLocator>>();
  return std::make_unique<VtkQueries<vtkCellLocator>>();
}

}  // namespace palpate::benchmark
