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

ScaleBar::ScaleBar() {
  m_points->SetNumberOfPoints(6);
  vtkNew<vtkCellArray> lines;
  for (const std::array<vtkIdType, 2>& line : {std::array<vtkIdType, 2>{0, 1}, {2, 3}, {4, 5}})
    lines->InsertNextCell(2, line.data());
  vtkNew<vtkPolyData> data;
  data->SetPoints(m_points);
  data->SetLines(lines);
  vtkNew<vtkPolyDataMapper2D> mapper;
  mapper->SetInputData(data);
  m_line->SetMapper(mapper);
  m_line->GetProperty()->SetColor(0.1, 0.1, 0.12);
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
