#pragma once

#include <vtkNew.h>
#include <vtkTexture.h>

class vtkRenderer;

namespace palpate::vtk {

/// The light of an operating theatre: a pale room with one large lamp above the camera. Bodies
/// mirror it by their roughness.
class Light {
 public:
  Light();
  void show(vtkRenderer*);
  void follow(vtkRenderer*) const;  ///< turns it with the renderer's camera

 private:
  vtkNew<vtkTexture> m_room;
};

}  // namespace palpate::vtk
