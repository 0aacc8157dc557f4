#include "Vtk/Glyphs.h"

#include <vtkActor.h>
#include <vtkAlgorithm.h>
#include <vtkColorTransferFunction.h>
#include <vtkGlyph3DMapper.h>
#include <vtkPointData.h>
#include <vtkPolyData.h>
#include <vtkProperty.h>
#include <vtkRenderer.h>

#include <cstddef>
#include <span>

namespace palpate::vtk {

Glyphs::Glyphs() {
  m_turns->SetNumberOfComponents(4);
  m_turns->SetName("turn");
  m_sizes->SetName("size");
  m_points->SetDataTypeToDouble();
}

void Glyphs::add(const Eigen::Vector3d& at, double value, double size,
                 const Eigen::Quaterniond& turn) {
  m_points->InsertNextPoint(at.data());
  m_values->InsertNextValue(value);
  m_sizes->InsertNextValue(size);
  m_turns->InsertNextTuple4(turn.w(), turn.x(), turn.y(), turn.z());
}

bool Glyphs::empty() const { return m_points->GetNumberOfPoints() == 0; }

std::array<double, 2> Glyphs::range() const {
  std::array<double, 2> range{};
  if (!empty()) m_values->GetRange(range.data());
  return range;
}

vtkProperty* Glyphs::show(vtkRenderer* renderer, vtkAlgorithm* shape,
                          vtkScalarsToColors* colours) const {
  vtkNew<vtkPolyData> data;
  data->SetPoints(m_points);
  data->GetPointData()->SetScalars(m_values);
  data->GetPointData()->AddArray(m_sizes);
  data->GetPointData()->AddArray(m_turns);
  vtkNew<vtkGlyph3DMapper> mapper;
  mapper->SetInputData(data);
  mapper->SetSourceConnection(shape->GetOutputPort());
  mapper->SetScaleArray("size");
  mapper->SetScaleModeToScaleByMagnitude();
  mapper->SetOrientationArray("turn");
  mapper->SetOrientationModeToQuaternion();
  mapper->SetLookupTable(colours);
  mapper->UseLookupTableScalarRangeOn();
  vtkNew<vtkActor> actor;
  actor->SetMapper(mapper);
  actor->GetProperty()->SetAmbient(0.5);
  actor->GetProperty()->SetDiffuse(0.6);
  renderer->AddActor(actor);
  return actor->GetProperty();
}

void setDistanceColours(vtkColorTransferFunction* colours, const std::array<double, 2>& range) {
  using Colour = std::array<int, 3>;
  constexpr std::array<Colour, 10> kViridis{{{68, 1, 84},
                                             {72, 40, 120},
                                             {62, 74, 137},
                                             {49, 104, 142},
                                             {38, 130, 142},
                                             {31, 158, 137},
                                             {53, 183, 121},
                                             {109, 205, 89},
                                             {180, 222, 44},
                                             {253, 231, 37}}};
  constexpr std::array<Colour, 7> kRedToBlue{{{178, 24, 43},
                                              {239, 138, 98},
                                              {253, 219, 199},
                                              {255, 255, 255},
                                              {209, 229, 240},
                                              {103, 169, 207},
                                              {33, 102, 172}}};
  colours->RemoveAllPoints();
  const std::span<const Colour> places =
      range[0] < 0 ? std::span<const Colour>(kRedToBlue) : std::span<const Colour>(kViridis);
  for (std::size_t i = 0; i < places.size(); ++i) {
    const auto& [red, green, blue] = places[i];
    const double share = static_cast<double>(i) / static_cast<double>(places.size() - 1);
    colours->AddRGBPoint(range[0] + share * (range[1] - range[0]), red / 255.0, green / 255.0,
                         blue / 255.0);
  }
}

}  // namespace palpate::vtk
