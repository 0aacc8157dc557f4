#pragma once

#include "Vtk/Bodies.h"

#include <palpate/Capture.h>

#include <Eigen/Core>

#include <map>

class vtkCamera;
class vtkRenderer;

namespace palpate::vtk {

/// A point of the scene in the picture: pixels to the right and up, and the depth along the view.
struct Projected {
  Eigen::Vector3d position;
  double x, y, depth;
};

/// From the scene to the picture, by a camera with a parallel projection.
class Projection {
 public:
  Projection(vtkCamera*, int width, int height);
  Projected operator()(const Eigen::Vector3d&) const;

 private:
  Eigen::Vector3d m_focus, m_towards, m_right, m_up;
  double m_scale, m_middleX, m_middleY;
};

/// Writes the label of each part of a geometry at a visible point near the middle of the part's
/// visible points. A label that would hide a small part stands above it. Labels avoid each other
/// while free points are left. allTranslucent: no body hides another.
void showLabels(vtkRenderer*, const CollisionProblem&, const std::map<GeometryId, Parts>&,
                const Projection&, int textSize, bool allTranslucent);

}  // namespace palpate::vtk
