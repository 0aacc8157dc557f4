#pragma once

#include <vtkActor2D.h>
#include <vtkNew.h>
#include <vtkPoints.h>
#include <vtkTextActor.h>

#include <array>
#include <span>
#include <string>

class vtkRenderer;
class vtkTextProperty;

namespace palpate::vtk {

/// Dark text; size: pixels.
void setTextLook(vtkTextProperty*, int size);

/// Makes `actor` draw dark lines between points of the picture, in pixels.
void setLines(vtkActor2D* actor, vtkPoints*, std::span<const std::array<vtkIdType, 2>> lines);

/// A bar of a round length, with its length and unit.
class ScaleBar {
 public:
  ScaleBar();
  void show(vtkRenderer* overlay, int textSize);
  /// pixelsPerLength: of the picture, whose projection is parallel.
  void update(double pixelsPerLength, const std::string& unit, int width, int height);

 private:
  vtkNew<vtkPoints> m_points;
  vtkNew<vtkActor2D> m_line;
  vtkNew<vtkTextActor> m_text;
};

/// 1, 2 or 5 times a power of ten: the greatest such number that is at most `limit` > 0.
double roundLength(double limit);
/// The least such number that is at least `least` > 0.
double roundUp(double least);

}  // namespace palpate::vtk
