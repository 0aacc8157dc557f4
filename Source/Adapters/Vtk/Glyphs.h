#pragma once

#include <Eigen/Geometry>

#include <vtkDoubleArray.h>
#include <vtkNew.h>
#include <vtkPoints.h>

#include <array>

class vtkAlgorithm;
class vtkColorTransferFunction;
class vtkProperty;
class vtkRenderer;
class vtkScalarsToColors;

namespace palpate::vtk {

/// Copies of one shape. Each has its place, size, rotation, and a value that gives its colour.
class Glyphs {
 public:
  Glyphs();
  void add(const Eigen::Vector3d& at, double value, double size, const Eigen::Quaterniond& turn);
  bool empty() const;
  std::array<double, 2> range() const;  ///< the least and the greatest value
  /// Adds the copies to the renderer.
  vtkProperty* show(vtkRenderer*, vtkAlgorithm* shape, vtkScalarsToColors*) const;

 private:
  vtkNew<vtkPoints> m_points;
  vtkNew<vtkDoubleArray> m_values, m_sizes, m_turns;
};

/// Colours of distances. From 0: dark violet, then yellow for the greatest one; lightness grows
/// evenly, so that colour-blind readers can tell them apart. Otherwise white at 0, red below and
/// blue above.
///
/// Source   the maps viridis (Smith and van der Walt, 2015) and RdBu (Brewer, 2002).
void setDistanceColours(vtkColorTransferFunction*, const std::array<double, 2>& range);

}  // namespace palpate::vtk
