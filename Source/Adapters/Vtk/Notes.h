#pragma once

#include <palpate/vtk/Window.h>

#include <vtkActor2D.h>
#include <vtkNew.h>
#include <vtkPoints.h>

#include <vector>

class vtkCamera;
class vtkRenderer;

namespace palpate::vtk {

/// Adds texts and arrows to a layer in front of all bodies. pixelsPerLength: of the picture.
void showNotes(vtkRenderer*, const std::vector<Note>&, int textSize, double pixelsPerLength);

/// The frame of an inset, and the frame of the part of the scene that it shows.
class InsetFrame {
 public:
  InsetFrame();
  void show(vtkRenderer* overlay, int textSize);
  /// Both cameras look in the same direction. viewport: of the inset, in shares of the picture.
  void update(vtkCamera* scene, vtkCamera* inset, const double* viewport, int width, int height);

 private:
  vtkNew<vtkPoints> m_points;
  vtkNew<vtkActor2D> m_lines;
};

}  // namespace palpate::vtk
