#include "Vtk/Light.h"

#include <vtkCamera.h>
#include <vtkImageData.h>
#include <vtkLightKit.h>
#include <vtkOpenGLRenderer.h>
#include <vtkPBRPrefilterTexture.h>
#include <vtkRenderer.h>

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace palpate::vtk {

using Eigen::Vector3d, std::numbers::pi;

namespace {

/// The brightness of the room in a direction of the camera's frame: x right, y up, z towards it.
double brightness(const Vector3d& d) {
  const auto lamp = [&d](const Vector3d& at, double width) {
    return std::clamp((d.dot(at.normalized()) - 1 + width) / (0.3 * width), 0.0, 1.0);
  };
  return 0.16 + 0.1 * d.y() + 1.7 * lamp({-0.5, 0.9, 0.6}, 0.16) + 0.8 * lamp({0.9, 0.1, 0.5}, 0.1);
}

}  // namespace

Light::Light() {
  constexpr int kWidth = 128, kHeight = 64;
  vtkNew<vtkImageData> image;
  image->SetDimensions(kWidth, kHeight, 1);
  image->AllocateScalars(VTK_FLOAT, 3);
  for (int row = 0; row < kHeight; ++row) {
    for (int i = 0; i < kWidth; ++i) {
      const double around = 2 * pi * ((i + 0.5) / kWidth - 0.5),
                   up = pi * ((row + 0.5) / kHeight - 0.5);
      const Vector3d d(std::cos(up) * std::cos(around), std::sin(up),
                       std::cos(up) * std::sin(around));
      for (int c = 0; c < 3; ++c) image->SetScalarComponentFromDouble(i, row, 0, c, brightness(d));
    }
  }
  m_room->SetInputData(image);
  m_room->SetColorModeToDirectScalars();
  m_room->MipmapOn();
  m_room->InterpolateOn();
}

void Light::show(vtkRenderer* renderer) {
  vtkNew<vtkLightKit> lights;
  lights->SetKeyLightIntensity(0.4);
  lights->SetKeyToFillRatio(2.5);
  lights->SetKeyToHeadRatio(4);
  lights->AddLightsToRenderer(renderer);
  auto* openGl = vtkOpenGLRenderer::SafeDownCast(renderer);
  openGl->GetEnvMapPrefiltered()->SetPrefilterMaxSamples(128);
  renderer->UseImageBasedLightingOn();
  renderer->SetEnvironmentTexture(m_room);
}

void Light::follow(vtkRenderer* renderer) const {
  vtkCamera* camera = renderer->GetActiveCamera();
  const Vector3d up(camera->GetViewUp()),
      right = Vector3d(camera->GetDirectionOfProjection()).cross(up);
  renderer->SetEnvironmentUp(up.x(), up.y(), up.z());
  renderer->SetEnvironmentRight(right.x(), right.y(), right.z());
}

}  // namespace palpate::vtk
