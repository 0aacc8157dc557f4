#include "Vtk/Notes.h"

#include "Vtk/Annotations.h"
#include "Vtk/Labels.h"

#include <vtkActor.h>
#include <vtkArrowSource.h>
#include <vtkBillboardTextActor3D.h>
#include <vtkCamera.h>
#include <vtkPolyDataMapper.h>
#include <vtkProperty.h>
#include <vtkProperty2D.h>
#include <vtkRenderer.h>
#include <vtkTextProperty.h>

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace palpate::vtk {

using Eigen::Vector3d;

namespace {

/// width: L, of the shaft.
void addArrow(vtkRenderer* layer, const Note& note, double width) {
  const Vector3d way = note.at - *note.from;
  const double length = way.norm();
  if (!(length > 0)) return;
  vtkNew<vtkArrowSource> arrow;  // along x, of length 1
  arrow->SetShaftRadius(width / 2 / length);
  arrow->SetTipRadius(1.7 * width / length);
  arrow->SetTipLength(std::min(1.0, 5 * width / length));
  arrow->SetShaftResolution(24);
  arrow->SetTipResolution(32);
  const Eigen::AngleAxisd turn(Eigen::Quaterniond::FromTwoVectors(Vector3d::UnitX(), way));
  vtkNew<vtkPolyDataMapper> mapper;
  mapper->SetInputConnection(arrow->GetOutputPort());
  vtkNew<vtkActor> actor;
  actor->SetMapper(mapper);
  actor->SetScale(length);
  actor->SetPosition(note.from->x(), note.from->y(), note.from->z());
  actor->RotateWXYZ(180 / std::numbers::pi * turn.angle(), turn.axis().x(), turn.axis().y(),
                    turn.axis().z());
  actor->GetProperty()->SetColor(note.colour[0], note.colour[1], note.colour[2]);
  actor->GetProperty()->SetAmbient(0.5);
  actor->GetProperty()->SetDiffuse(0.6);
  layer->AddActor(actor);
}

void addText(vtkRenderer* layer, const Note& note, int textSize) {
  vtkNew<vtkBillboardTextActor3D> actor;
  actor->SetInput(note.text.c_str());
  const Vector3d at = note.from.value_or(note.at);
  actor->SetPosition(at.x(), at.y(), at.z());
  vtkTextProperty* look = actor->GetTextProperty();
  setTextLook(look, textSize);
  look->SetColor(note.colour[0], note.colour[1], note.colour[2]);
  look->BoldOn();
  look->SetJustificationToCentered();
  look->SetVerticalJustificationToCentered();
  look->SetBackgroundColor(1, 1, 1);
  look->SetBackgroundOpacity(0.8);
  layer->AddViewProp(actor);
}

}  // namespace

void showNotes(vtkRenderer* layer, const std::vector<Note>& notes, int textSize,
               double pixelsPerLength) {
  for (const Note& note : notes) {
    if (!note.at.allFinite() || !note.from.value_or(note.at).allFinite()) continue;
    if (note.from) addArrow(layer, note, 0.22 * textSize / pixelsPerLength);
    if (!note.text.empty()) addText(layer, note, textSize);
  }
}

InsetFrame::InsetFrame() {
  m_points->SetNumberOfPoints(8);
  constexpr std::array<std::array<vtkIdType, 2>, 8> kLines{
      {{0, 1}, {1, 2}, {2, 3}, {3, 0}, {4, 5}, {5, 6}, {6, 7}, {7, 4}}};
  setLines(m_lines, m_points, kLines);
}

void InsetFrame::show(vtkRenderer* overlay, int textSize) {
  m_lines->GetProperty()->SetLineWidth(std::max(1.0F, static_cast<float>(textSize) / 12));
  overlay->AddViewProp(m_lines);
}

void InsetFrame::update(vtkCamera* scene, vtkCamera* inset, const double* viewport, int width,
                        int height) {
  const Projected centre = Projection(scene, width, height)(Vector3d(inset->GetFocalPoint()));
  const double half = inset->GetParallelScale() / scene->GetParallelScale() * height / 2,
               left = viewport[0] * width, low = viewport[1] * height, right = viewport[2] * width,
               high = viewport[3] * height, halfWidth = half * (right - left) / (high - low);
  const std::array<std::array<double, 4>, 2> boxes{
      {{centre.x - halfWidth, centre.y - half, centre.x + halfWidth, centre.y + half},
       {left, low, right, high}}};
  for (int i = 0; i < 2; ++i) {
    const auto& [x0, y0, x1, y1] = boxes[i];
    m_points->SetPoint(4 * i, x0, y1, 0);
    m_points->SetPoint(4 * i + 1, x0, y0, 0);
    m_points->SetPoint(4 * i + 2, x1, y0, 0);
    m_points->SetPoint(4 * i + 3, x1, y1, 0);
  }
  m_points->Modified();
}

}  // namespace palpate::vtk
