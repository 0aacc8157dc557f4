#include <palpate/vtk/Picture.h>

#include <palpate/Error.h>

#include <vtkActor.h>
#include <vtkCamera.h>
#include <vtkCellArray.h>
#include <vtkCellData.h>
#include <vtkGlyph3DMapper.h>
#include <vtkImageData.h>
#include <vtkLight.h>
#include <vtkNew.h>
#include <vtkPNGWriter.h>
#include <vtkPointData.h>
#include <vtkPoints.h>
#include <vtkPolyData.h>
#include <vtkPolyDataMapper.h>
#include <vtkPolyDataNormals.h>
#include <vtkProperty.h>
#include <vtkRenderWindow.h>
#include <vtkRenderer.h>
#include <vtkSphereSource.h>
#include <vtkUnsignedCharArray.h>

#include <X11/Xlib.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <ctime>
#include <memory>
#include <numbers>

// X11's header defines these as macros.
#undef None
#undef Status
#undef Success

namespace palpate::vtk {

namespace {

using Eigen::Vector3d;

constexpr std::array<std::array<double, 3>, 6> kBodyColours{{{0.72, 0.25, 0.25},
                                                             {0.85, 0.55, 0.55},
                                                             {0.55, 0.30, 0.55},
                                                             {0.35, 0.35, 0.65},
                                                             {0.80, 0.65, 0.45},
                                                             {0.60, 0.60, 0.65}}};

vtkNew<vtkPolyData> surface(const TriangleMeshView& mesh) {
  vtkNew<vtkPoints> points;
  points->SetDataTypeToDouble();
  for (const Vector3d& p : mesh.positions) points->InsertNextPoint(p.data());
  vtkNew<vtkCellArray> cells;
  for (const auto& [a, b, c] : mesh.triangles) {
    const std::array<vtkIdType, 3> corners{a, b, c};
    cells->InsertNextCell(3, corners.data());
  }
  vtkNew<vtkPolyData> data;
  data->SetPoints(points);
  data->SetPolys(cells);
  return data;
}

void addBody(vtkRenderer* renderer, const TriangleMeshView& mesh, std::size_t index) {
  vtkNew<vtkPolyDataNormals> normals;
  normals->SetInputData(surface(mesh));
  normals->SplittingOff();
  normals->ConsistencyOff();
  vtkNew<vtkPolyDataMapper> mapper;
  mapper->SetInputConnection(normals->GetOutputPort());
  vtkNew<vtkActor> actor;
  actor->SetMapper(mapper);
  const auto& colour = kBodyColours[index % kBodyColours.size()];
  actor->GetProperty()->SetColor(colour[0], colour[1], colour[2]);
  actor->GetProperty()->SetOpacity(0.45);
  actor->GetProperty()->SetSpecular(0.2);
  actor->ForceTranslucentOn();
  renderer->AddActor(actor);
}

/// The twelve edges of a cell's cube join corners whose numbers (bit 0: x, 1: y, 2: z) differ in
/// one bit.
void addCube(const Eigen::AlignedBox3d& cube, vtkPoints* points, vtkCellArray* lines) {
  std::array<vtkIdType, 8> corners;
  for (unsigned corner = 0; corner < 8; ++corner) {
    Vector3d p;
    for (int axis = 0; axis < 3; ++axis)
      p[axis] = corner >> axis & 1 ? cube.max()[axis] : cube.min()[axis];
    corners[corner] = points->InsertNextPoint(p.data());
  }
  for (unsigned corner = 0; corner < 8; ++corner) {
    for (int axis = 0; axis < 3; ++axis) {
      if (corner >> axis & 1) continue;
      const std::array<vtkIdType, 2> edge{corners[corner], corners[corner | 1u << axis]};
      lines->InsertNextCell(2, edge.data());
    }
  }
}

void addCells(vtkRenderer* renderer, const LooseOctree& octree) {
  vtkNew<vtkPoints> points;
  points->SetDataTypeToDouble();
  vtkNew<vtkCellArray> lines;
  vtkNew<vtkUnsignedCharArray> colours;
  colours->SetNumberOfComponents(4);
  const double deepest = std::max(1, octree.statistics().deepestLevel);
  for (const auto id : octree.nodes()) {
    const LooseOctree::Node node = octree.node(id);
    if (node.primitives.empty()) continue;
    addCube(node.bounds, points, lines);
    const double depth = node.depth / deepest;
    const auto shade = static_cast<unsigned char>(60 + 190 * depth);
    const auto opacity = static_cast<unsigned char>(150 - 90 * depth);  // the deepest are the most
    const std::array<unsigned char, 4> colour{0, shade, 0, opacity};
    for (int edge = 0; edge < 12; ++edge) colours->InsertNextTypedTuple(colour.data());
  }
  vtkNew<vtkPolyData> data;
  data->SetPoints(points);
  data->SetLines(lines);
  data->GetCellData()->SetScalars(colours);
  vtkNew<vtkPolyDataMapper> mapper;
  mapper->SetInputData(data);
  vtkNew<vtkActor> actor;
  actor->SetMapper(mapper);
  actor->GetProperty()->LightingOff();
  actor->ForceTranslucentOn();
  renderer->AddActor(actor);
}

Vector3d middle(const Stencil& contact, const std::array<std::span<const Vector3d>, 4>& positions) {
  Vector3d sum = Vector3d::Zero();
  for (std::size_t i = 0; i < 4; ++i) {
    sum += std::abs(contact.weights[i]) * positions[i][contact.vertices[i]];
  }
  return sum / 2;  // the weights of each side sum to 1
}

void addContacts(vtkRenderer* renderer, const Picture& picture, double radius) {
  vtkNew<vtkPoints> points;
  points->SetDataTypeToDouble();
  const auto add = [&](const Vector3d& p) { points->InsertNextPoint(p.data()); };
  for (const auto& [first, second, data] : picture.contacts) {
    const auto a = picture.bodies[first].positions, b = picture.bodies[second].positions;
    for (const auto& contact : data->vertexTriangle()) add(middle(stencil(contact), {a, b, b, b}));
    for (const auto& contact : data->triangleVertex()) add(middle(stencil(contact), {b, a, a, a}));
    for (const auto& contact : data->edgeEdge()) add(middle(stencil(contact), {a, a, b, b}));
    for (const auto& contact : data->shape()) add((contact.point + contact.pointOnShape) / 2);
    for (const auto& contact : data->shapeShape()) add((contact.pointA + contact.pointB) / 2);
  }
  vtkNew<vtkPolyData> data;
  data->SetPoints(points);
  vtkNew<vtkSphereSource> sphere;
  sphere->SetRadius(radius);
  vtkNew<vtkGlyph3DMapper> mapper;
  mapper->SetInputData(data);
  mapper->SetSourceConnection(sphere->GetOutputPort());
  mapper->ScalingOff();
  mapper->ScalarVisibilityOff();
  vtkNew<vtkActor> actor;
  actor->SetMapper(mapper);
  actor->GetProperty()->SetColor(1.0, 0.6, 0.0);
  actor->GetProperty()->SetAmbient(0.5);
  renderer->AddActor(actor);
}

Eigen::AlignedBox3d boundsOf(const std::vector<TriangleMeshView>& bodies) {
  Eigen::AlignedBox3d box;
  for (const TriangleMeshView& body : bodies) {
    for (const Vector3d& p : body.positions) box.extend(p);
  }
  return box.isEmpty() ? Eigen::AlignedBox3d(Vector3d::Zero(), Vector3d::Ones()) : box;
}

/// From the front, somewhat to the right and above, towards the middle of the bodies, as near as
/// has all in view.
void aim(vtkRenderer* renderer, const Picture& picture, const Eigen::AlignedBox3d& box) {
  const Vector3d back = Vector3d(0.5, -1.0, 0.6).normalized();
  const Vector3d right = Vector3d::UnitZ().cross(back).normalized(), up = back.cross(right);
  vtkCamera* camera = renderer->GetActiveCamera();
  const double slope =
      std::tan(camera->GetViewAngle() / 2 * std::numbers::pi / 180);  // up from the middle
  const double slopeRight = slope * picture.width / picture.height;
  double distance = 0.1 * box.diagonal().norm();
  for (const TriangleMeshView& body : picture.bodies) {
    for (const Vector3d& p : body.positions) {
      const Vector3d q = p - box.center();
      const double needed =
          std::max(std::abs(q.dot(up)) / slope, std::abs(q.dot(right)) / slopeRight);
      distance = std::max(distance, needed + q.dot(back));
    }
  }
  const Vector3d centre = box.center(), position = centre + 1.08 * distance * back;
  camera->SetFocalPoint(centre.data());
  camera->SetPosition(position.data());
  camera->SetViewUp(0, 0, 1);
  renderer->ResetCameraClippingRange();
}

void check(const Picture& picture) {
  constexpr int kMost = 16384;
  if (picture.width < 1 || picture.width > kMost || picture.height < 1 || picture.height > kMost) {
    throw Error(ErrorCode::InvalidSettings,
                "A picture's width and height must be from 1 to 16384 pixels.");
  }
  for (const auto& [a, b, data] : picture.contacts) {
    if (a >= picture.bodies.size() || b >= picture.bodies.size() || data == nullptr) {
      throw Error(ErrorCode::InvalidSettings,
                  "A picture's contacts are of no body of the picture, or absent.");
    }
  }
}

using Connection = std::unique_ptr<Display, int (*)(Display*)>;

/// VTK ends the program where it cannot open the display. One connection stays open while VTK has
/// its own: an X server such as Xvfb starts anew when its last client leaves, and for a moment
/// takes nobody.
Connection connect() {
  constexpr int kAttempts = 10;
  constexpr timespec kPause{0, 50'000'000};  // 50 ms
  for (int attempt = 0; std::getenv("DISPLAY") != nullptr && attempt < kAttempts; ++attempt) {
    if (Display* display = XOpenDisplay(nullptr)) return {display, XCloseDisplay};
    nanosleep(&kPause, nullptr);
  }
  throw Error(
      ErrorCode::NotAvailable,
      "There is no display to draw with: set DISPLAY, or run the program under xvfb-run -a.");
}

}  // namespace

Image draw(const Picture& picture) {
  check(picture);
  const Connection connection = connect();
  vtkNew<vtkRenderer> renderer;
  renderer->SetBackground(1, 1, 1);
  for (std::size_t i = 0; i < picture.bodies.size(); ++i) addBody(renderer, picture.bodies[i], i);
  const Eigen::AlignedBox3d box = boundsOf(picture.bodies);
  if (picture.octree != nullptr) addCells(renderer, *picture.octree);
  addContacts(renderer, picture, 0.004 * box.diagonal().norm());
  renderer->SetUseDepthPeeling(true);
  renderer->SetMaximumNumberOfPeels(12);

  vtkNew<vtkRenderWindow> window;
  window->SetShowWindow(false);
  window->SetOffScreenRendering(true);
  window->SetAlphaBitPlanes(1);
  window->SetMultiSamples(0);
  window->SetSize(picture.width, picture.height);
  window->AddRenderer(renderer);
  aim(renderer, picture, box);
  window->Render();

  vtkNew<vtkUnsignedCharArray> pixels;
  window->GetPixelData(0, 0, picture.width - 1, picture.height - 1, 0, pixels);
  const unsigned char* first = pixels->GetPointer(0);
  return {picture.width, picture.height, {first, first + pixels->GetNumberOfValues()}};
}

std::string toPng(const Image& image) {
  vtkNew<vtkImageData> data;
  data->SetDimensions(image.width, image.height, 1);
  data->AllocateScalars(VTK_UNSIGNED_CHAR, 3);
  std::copy(image.rgb.begin(), image.rgb.end(),
            static_cast<unsigned char*>(data->GetScalarPointer()));
  vtkNew<vtkPNGWriter> writer;
  writer->SetInputData(data);
  writer->WriteToMemoryOn();
  writer->Write();
  vtkUnsignedCharArray* png = writer->GetResult();
  return {png->GetPointer(0), png->GetPointer(0) + png->GetNumberOfValues()};
}

}  // namespace palpate::vtk
