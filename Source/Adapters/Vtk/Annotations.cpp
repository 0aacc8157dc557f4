#include "Vtk/Annotations.h"

#include <vtkCellArray.h>
#include <vtkPolyData.h>
#include <vtkPolyDataMapper2D.h>
#include <vtkProperty2D.h>
#include <vtkRenderer.h>
#include <vtkTextProperty.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

namespace palpate::vtk {

void setTextLook(vtkTextProperty* look, int size) {
  look->SetColor(0.1, 0.1, 0.12);
  look->SetFontSize(size);
  look->ShadowOff();
  look->ItalicOff();
}

double roundLength(double limit) {
  const double power = std::pow(10, std::floor(std::log10(limit)));
  for (const double factor : {5.0, 2.0})
    if (factor * power <= limit) return factor * power;
  return power;
}

double roundUp(double least) {
  constexpr double kRounding = 1 - 1e-9;
  const double power = std::pow(10, std::floor(std::log10(least)));
  for (const double factor : {1.0, 2.0, 5.0})
    if (factor * power >= kRounding * least) return factor * power;
  return 10 * power;
}

void setLines(vtkActor2D* actor, vtkPoints* points,
              std::span<const std::array<vtkIdType, 2>> lines) {
  vtkNew<vtkCellArray> cells;
  for (const auto& line : lines) cells->InsertNextCell(2, line.data());
  vtkNew<vtkPolyData> data;
  data->SetPoints(points);
  data->SetLines(cells);
  vtkNew<vtkPolyDataMapper2D> mapper;
  mapper->SetInputData(data);
  actor->SetMapper(mapper);
  actor->GetProperty()->SetColor(0.1, 0.1, 0.12);
}

ScaleBar::ScaleBar() {
  m_points->SetNumberOfPoints(6);
  setLines(m_line, m_points, std::array<std::array<vtkIdType, 2>, 3>{{{0, 1}, {2, 3}, {4, 5}}});
}

void ScaleBar::show(vtkRenderer* overlay, int textSize) {
  setTextLook(m_text->GetTextProperty(), textSize);
  m_text->GetTextProperty()->SetJustificationToCentered();
  m_line->GetProperty()->SetLineWidth(std::max(1.0F, static_cast<float>(textSize) / 9));
  overlay->AddViewProp(m_line);
  overlay->AddViewProp(m_text);
}

void ScaleBar::update(double pixelsPerLength, const std::string& unit, int width, int height) {
  const double length = roundLength(0.22 * width / pixelsPerLength),
               pixels = length * pixelsPerLength;
  const double x = 0.03 * width, y = 0.04 * height, tick = 0.008 * height;
  m_points->SetPoint(0, x, y, 0);
  m_points->SetPoint(1, x + pixels, y, 0);
  for (int end = 0; end < 2; ++end) {
    m_points->SetPoint(2 + 2 * end, x + end * pixels, y - tick, 0);
    m_points->SetPoint(3 + 2 * end, x + end * pixels, y + tick, 0);
  }
  m_points->Modified();
  std::array<char, 32> number;
  std::snprintf(number.data(), number.size(), "%g ", length);
  m_text->SetInput((number.data() + unit).c_str());
  m_text->SetPosition(x + pixels / 2, y + 1.5 * tick);
}

}  // namespace palpate::vtk
