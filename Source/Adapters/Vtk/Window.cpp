#include <palpate/vtk/Window.h>

#include <palpate/Error.h>

#include <vtkActor.h>
#include <vtkArrowSource.h>
#include <vtkCamera.h>
#include <vtkCellArray.h>
#include <vtkCellPicker.h>
#include <vtkChartXY.h>
#include <vtkContextActor.h>
#include <vtkContextScene.h>
#include <vtkCubeSource.h>
#include <vtkDoubleArray.h>
#include <vtkGlyph3DMapper.h>
#include <vtkImageData.h>
#include <vtkInteractorStyleTrackballCamera.h>
#include <vtkLookupTable.h>
#include <vtkNew.h>
#include <vtkPNGWriter.h>
#include <vtkPlot.h>
#include <vtkPointData.h>
#include <vtkPolyData.h>
#include <vtkPolyDataMapper.h>
#include <vtkPolyDataNormals.h>
#include <vtkProperty.h>
#include <vtkRenderWindow.h>
#include <vtkRenderWindowInteractor.h>
#include <vtkRenderer.h>
#include <vtkSphereSource.h>
#include <vtkTable.h>
#include <vtkTextActor.h>
#include <vtkTextProperty.h>
#include <vtkUnsignedCharArray.h>

#include <X11/Xlib.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <ctime>
#include <map>

// X11's header defines these as macros.
#undef None
#undef Status
#undef Success

namespace palpate::vtk {

namespace {

using Eigen::Vector3d, Eigen::Quaterniond;
using Mesh = CollisionProblem::Geometry;

constexpr timespec kPause{0, 20'000'000};  // 20 ms
constexpr std::array<std::array<double, 3>, 6> kBodyColours{{{0.72, 0.25, 0.25},
                                                             {0.85, 0.55, 0.55},
                                                             {0.55, 0.30, 0.55},
                                                             {0.35, 0.35, 0.65},
                                                             {0.80, 0.65, 0.45},
                                                             {0.60, 0.60, 0.65}}};

/// Copies of one shape, each with its place, size, rotation, and a value that gives its colour.
class Glyphs {
 public:
  Glyphs() {
    m_turns->SetNumberOfComponents(4);
    m_turns->SetName("turn");
    m_sizes->SetName("size");
    m_points->SetDataTypeToDouble();
  }
  void add(const Vector3d& at, double value, double size, const Quaterniond& turn) {
    m_points->InsertNextPoint(at.data());
    m_values->InsertNextValue(value);
    m_sizes->InsertNextValue(size);
    m_turns->InsertNextTuple4(turn.w(), turn.x(), turn.y(), turn.z());
  }
  /// Adds the copies to the renderer. from, to: hues in [0, 1] of the least and the greatest value.
  /// dark: the brightness of the least value.
  vtkProperty* show(vtkRenderer* renderer, vtkAlgorithm* shape, double from, double to,
                    double dark) const {
    vtkNew<vtkPolyData> data;
    data->SetPoints(m_points);
    data->GetPointData()->SetScalars(m_values);
    data->GetPointData()->AddArray(m_sizes);
    data->GetPointData()->AddArray(m_turns);
    vtkNew<vtkLookupTable> colours;
    colours->SetHueRange(from, to);
    colours->SetValueRange(dark, 1);
    vtkNew<vtkGlyph3DMapper> mapper;
    mapper->SetInputData(data);
    mapper->SetSourceConnection(shape->GetOutputPort());
    mapper->SetScaleArray("size");
    mapper->SetScaleModeToScaleByMagnitude();
    mapper->SetOrientationArray("turn");
    mapper->SetOrientationModeToQuaternion();
    mapper->SetLookupTable(colours);
    mapper->SetScalarRange(m_values->GetRange());
    vtkNew<vtkActor> actor;
    actor->SetMapper(mapper);
    actor->GetProperty()->SetAmbient(0.5);
    renderer->AddActor(actor);
    return actor->GetProperty();
  }

 private:
  vtkNew<vtkPoints> m_points;
  vtkNew<vtkDoubleArray> m_values, m_sizes, m_turns;
};

/// The point of a shape that lies furthest along d, in the shape's frame. A plane counts as bounded
/// by the distance `size` from its point.
Vector3d furthest(const AnalyticalGeometry& shape, const Vector3d& d, double size) {
  const auto across = [&](const Vector3d& n) {
    return Vector3d(d - d.dot(n) / n.squaredNorm() * n);
  };
  if (const auto* s = std::get_if<Sphere>(&shape)) return s->centre + s->radius * d;
  if (const auto* s = std::get_if<Plane>(&shape)) return s->point + size * across(s->normal);
  if (const auto* s = std::get_if<Capsule>(&shape))
    return (d.dot(s->p1 - s->p0) > 0 ? s->p1 : s->p0) + s->radius * d;
  if (const auto* s = std::get_if<Cylinder>(&shape))
    return (d.dot(s->p1 - s->p0) > 0 ? s->p1 : s->p0) +
           s->radius * across(s->p1 - s->p0).normalized();
  if (const auto* s = std::get_if<Box>(&shape))
    return s->centre + s->halfExtents.cwiseProduct(d.cwiseSign());
  const auto& points = std::get<ConvexHull>(shape).points;
  return *std::max_element(points.begin(), points.end(), [&](const Vector3d& a, const Vector3d& b) {
    return d.dot(a) < d.dot(b);
  });
}

/// Gives a shape a mesh: the furthest points along directions all around.
void tessellate(Mesh& shape, double size) {
  vtkNew<vtkSphereSource> sphere;
  sphere->SetThetaResolution(32);
  sphere->SetPhiResolution(32);
  sphere->Update();
  vtkPolyData* all = sphere->GetOutput();
  for (vtkIdType i = 0; i < all->GetNumberOfPoints(); ++i)
    shape.now.push_back(shape.rotation *
                            furthest(*shape.analytical, 2 * Vector3d(all->GetPoint(i)), size) +
                        shape.translation);
  vtkNew<vtkIdList> corners;
  for (vtkIdType i = 0; i < all->GetNumberOfCells(); ++i) {
    all->GetCellPoints(i, corners);
    const auto corner = [&](int k) { return static_cast<std::uint32_t>(corners->GetId(k)); };
    shape.triangles.push_back({corner(0), corner(1), corner(2)});
  }
}

/// Adds a body to the renderer. The cells are the body's elements, in their order.
vtkProp* addBody(vtkRenderer* renderer, const Mesh& mesh, std::size_t index) {
  vtkNew<vtkPoints> points;
  points->SetDataTypeToDouble();
  for (const Vector3d& p : mesh.now) points->InsertNextPoint(p.data());
  vtkNew<vtkCellArray> cells;
  for (const auto& [a, b, c] : mesh.triangles) {
    const std::array<vtkIdType, 3> corners{a, b, c};
    cells->InsertNextCell(b == c ? 2 : 3, corners.data());
  }
  for (vtkIdType i = 0; mesh.type == GeometryType::Points && i < points->GetNumberOfPoints(); ++i)
    cells->InsertNextCell(1, &i);
  vtkNew<vtkPolyData> data;
  data->SetPoints(points);
  const bool thin = mesh.type == GeometryType::Lines || mesh.type == GeometryType::Points;
  if (mesh.type == GeometryType::Points) data->SetVerts(cells);
  if (mesh.type == GeometryType::Lines) data->SetLines(cells);
  if (!thin) data->SetPolys(cells);
  vtkNew<vtkPolyDataNormals> normals;
  normals->SetInputData(data);
  normals->SplittingOff();
  normals->ConsistencyOff();
  vtkNew<vtkPolyDataMapper> mapper;
  thin ? mapper->SetInputData(data) : mapper->SetInputConnection(normals->GetOutputPort());
  vtkNew<vtkActor> actor;
  actor->SetMapper(mapper);
  vtkProperty* look = actor->GetProperty();
  const auto& colour = kBodyColours[index % kBodyColours.size()];
  look->SetColor(colour[0], colour[1], colour[2]);
  look->SetOpacity(thin ? 1 : 0.45);
  look->SetSpecular(0.2);
  look->SetPointSize(2);
  look->SetLineWidth(4);
  look->RenderLinesAsTubesOn();
  actor->SetForceTranslucent(!thin);
  renderer->AddActor(actor);
  return actor;
}

}  // namespace

std::shared_ptr<void> openDisplay() {
  constexpr int kAttempts = 25;
  for (int attempt = 0; std::getenv("DISPLAY") != nullptr && attempt < kAttempts; ++attempt) {
    if (Display* display = XOpenDisplay(nullptr)) return {display, XCloseDisplay};
    nanosleep(&kPause, nullptr);
  }
  throw Error(
      ErrorCode::NotAvailable,
      "There is no display to draw with: set DISPLAY, or run the program under xvfb-run -a.");
}

struct Window::Implementation {
  const OctreeBasedCD& detection;
  std::shared_ptr<void> connection = openDisplay();
  vtkNew<vtkRenderer> renderer{}, graph{};
  vtkNew<vtkRenderWindow> window{};
  vtkNew<vtkRenderWindowInteractor> interactor{};
  vtkNew<vtkTextActor> text{};
  vtkNew<vtkTable> times{};
  vtkNew<vtkChartXY> chart{};
  CollisionProblem problem{};  // of the frame that is shown
  std::map<GeometryId, std::size_t> indices{};
  std::map<vtkProp*, const Mesh*> bodies{};
  std::string picked{};
  Eigen::AlignedBox3d box{};
  int cells = 0, frames = 0;
  bool contacts = true, normals = true, untrusted = true, isOpen = true, waits = false,
       isNew = true;

  void answer(vtkObject*, unsigned long event, void*) {
    const int* at = interactor->GetEventPosition();
    if (event == vtkCommand::KeyPressEvent) press(interactor->GetKeyCode());
    if (event == vtkCommand::LeftButtonPressEvent) pick(at[0], at[1]);
    if (event == vtkCommand::ExitEvent) isOpen = false;
  }

  void press(char key) {
    for (const auto& [name, flag] :
         {std::pair('c', &contacts), {'n', &normals}, {'u', &untrusted}, {' ', &waits}})
      if (key == name) *flag = !*flag;
    if (key == 'o') cells = (cells + 1) % 3;
    if (key == 't') graph->SetDraw(!graph->GetDraw());
    isNew |= key == 'r';
    isOpen &= key != 'q';
    if (frames > 0) draw();
  }

  void pick(int x, int y) {
    constexpr std::array kNames{", triangle ", ", segment ", ", point "};
    vtkNew<vtkCellPicker> picker;
    picker->SetTolerance(0.002);
    picker->PickFromListOn();
    for (const auto& [body, mesh] : bodies) picker->AddPickList(body);
    picked.clear();
    if (picker->Pick(x, y, 0, renderer)) {
      const Mesh& mesh = *bodies.at(picker->GetActor());
      picked = "geometry " + std::to_string(static_cast<std::uint32_t>(mesh.id));
      picked += mesh.analytical ? ", a shape"
                                : kNames[static_cast<std::size_t>(mesh.type)] +
                                      std::to_string(picker->GetCellId());
    }
    text->SetInput(picked.c_str());
    window->Render();
  }

  void take();
  void addTimes();
  void draw();
  void drawCells() const;
  const CollisionData& answer(GeometryId a, GeometryId b) const;
  void drawContacts() const;
  void aim();
};

/// Copies the frame. Keys that redraw it then show this frame, even after the user has moved
/// geometries.
void Window::Implementation::take() {
  problem = detection.problem();
  bodies.clear();
  indices.clear();
  box.setEmpty();
  for (const Mesh& mesh : problem.geometries)
    for (const Vector3d& p : mesh.now) box.extend(p);
  if (box.isEmpty()) box = {Vector3d::Zero(), Vector3d::Ones()};
  for (Mesh& mesh : problem.geometries) {
    indices[mesh.id] = &mesh - problem.geometries.data();
    if (mesh.analytical) tessellate(mesh, box.diagonal().norm());
    for (const Vector3d& p : mesh.now)
      if (mesh.analytical && !std::holds_alternative<Plane>(*mesh.analytical)) box.extend(p);
  }
}

void Window::Implementation::drawCells() const {
  const LooseOctree& octree = detection.octree();
  Glyphs cubes;
  for (const auto id : octree.nodes()) {
    const LooseOctree::Node node = octree.node(id);
    if (node.elements.empty()) continue;
    const Mesh& mesh = problem.geometries[indices.at(node.geometry)];
    cubes.add(mesh.rotation * node.bounds.center() + mesh.translation,
              cells == 1 ? node.depth : static_cast<double>(node.elements.size()),
              node.bounds.sizes().x(), Quaterniond(mesh.rotation));
  }
  vtkProperty* look = cubes.show(renderer, vtkNew<vtkCubeSource>(), 0.33, 0.33, 0.3);
  look->SetRepresentationToWireframe();
  look->LightingOff();
  look->SetOpacity(0.5);
}

/// The result of a pair; empty before the first detection.
const CollisionData& Window::Implementation::answer(GeometryId a, GeometryId b) const {
  static const CollisionData none;
  try {
    return detection.collisionData(a, b);
  } catch (const Error& error) {
    if (error.code() != ErrorCode::NotAvailable) throw;
  }
  return none;
}

void Window::Implementation::drawContacts() const {
  Glyphs spheres, arrows, wrong;
  const double size = box.diagonal().norm();
  for (const auto& [first, second, settings] : detection.pairs()) {
    const Mesh &a = problem.geometries[indices.at(first)],
               &b = problem.geometries[indices.at(second)];
    const CollisionData& data = answer(first, second);
    const auto add = [&](const auto& c, const Vector3d& at) {
      spheres.add(at, c.distance, 0.008 * size, Quaterniond::Identity());
      arrows.add(at, c.distance, 0.05 * size,
                 Quaterniond::FromTwoVectors(Vector3d::UnitX(), c.normal));
    };
    const auto middle = [](const Stencil& c, const std::array<const Mesh*, 4>& meshes) {
      Vector3d sum = Vector3d::Zero();
      for (std::size_t i = 0; i < 4; ++i)
        sum += std::abs(c.weights[i]) * meshes[i]->now[c.vertices[i]];
      return Vector3d(sum / 2);  // the weights of each side sum to 1
    };
    for (const auto& c : data.vertexTriangle()) add(c, middle(stencil(c), {&a, &b, &b, &b}));
    for (const auto& c : data.triangleVertex()) add(c, middle(stencil(c), {&b, &a, &a, &a}));
    for (const auto& c : data.edgeEdge()) add(c, middle(stencil(c), {&a, &a, &b, &b}));
    for (const auto& c : data.shape()) add(c, (c.point + c.pointOnShape) / 2);
    for (const auto& c : data.shapeShape()) add(c, (c.pointA + c.pointB) / 2);
    const auto mark = [&](const Mesh& mesh, std::uint32_t vertex) {
      wrong.add(mesh.now[vertex], 0, 0.01 * size, Quaterniond::Identity());
    };
    const Validity& validity = data.validity();
    for (const auto v : validity.untrustedVerticesA) mark(a, v);
    for (const auto v : validity.untrustedVerticesB) mark(b, v);
    for (const auto t : validity.degenerateTrianglesA) mark(a, a.triangles[t][0]);
    for (const auto t : validity.degenerateTrianglesB) mark(b, b.triangles[t][0]);
  }
  const vtkNew<vtkSphereSource> ball;
  if (contacts) spheres.show(renderer, ball, 0, 0.67, 1);
  if (normals) arrows.show(renderer, vtkNew<vtkArrowSource>(), 0, 0.67, 1);
  if (untrusted) wrong.show(renderer, ball, 0.83, 0.83, 1);
}

/// Aims the camera from the front, somewhat to the right and above, with everything in view.
void Window::Implementation::aim() {
  const Vector3d focus = box.center(), position = focus + Vector3d(0.5, -1.0, 0.6);
  vtkCamera* camera = renderer->GetActiveCamera();
  camera->SetFocalPoint(focus.data());
  camera->SetPosition(position.data());
  camera->SetViewUp(0, 0, 1);
  renderer->ResetCamera();
  camera->Zoom(1.3);
}

void Window::Implementation::draw() {
  renderer->RemoveAllViewProps();
  renderer->AddViewProp(text);
  bodies.clear();
  for (const Mesh& mesh : problem.geometries)
    bodies[addBody(renderer, mesh, &mesh - problem.geometries.data())] = &mesh;
  if (isNew) aim();
  isNew = false;
  if (cells > 0) drawCells();
  drawContacts();
  renderer->ResetCameraClippingRange();
  window->Render();
}

void Window::Implementation::addTimes() {
  constexpr std::array kNames{"frame", "boxes", "octree", "pairs", "narrow phase", "order"};
  constexpr vtkIdType kMostFrames = 300;
  const FrameStatistics::Stages& ms = detection.statistics().milliseconds;
  const std::array values{
      static_cast<double>(frames), ms.boxes, ms.octree, ms.pairs, ms.narrowPhase, ms.order};
  for (std::size_t i = 0; frames == 0 && i < kNames.size(); ++i) {
    vtkNew<vtkDoubleArray> column;
    column->SetName(kNames[i]);
    times->AddColumn(column);
  }
  times->InsertNextBlankRow();
  for (std::size_t i = 0; i < kNames.size(); ++i) {
    times->SetValue(times->GetNumberOfRows() - 1, static_cast<vtkIdType>(i), values[i]);
    if (frames != 1 || i == 0) continue;  // a line needs two points
    vtkPlot* line = chart->AddPlot(vtkChart::LINE);
    line->SetInputData(times, 0, static_cast<vtkIdType>(i));
    line->SetColor(kBodyColours[i][0], kBodyColours[i][1], kBodyColours[i][2]);
  }
  if (times->GetNumberOfRows() > kMostFrames) times->RemoveRow(0);
  times->Modified();
  chart->RecalculateBounds();
  ++frames;
}

Window::Window(const OctreeBasedCD& detection, bool onScreen, int width, int height) {
  constexpr int kMost = 16384;
  if (std::min(width, height) < 1 || std::max(width, height) > kMost)
    throw Error(ErrorCode::InvalidSettings,
                "A window's width and height must be from 1 to 16384 pixels.");
  m_implementation.reset(new Implementation{detection});
  Implementation& own = *m_implementation;
  own.renderer->SetBackground(1, 1, 1);
  own.renderer->SetUseDepthPeeling(true);
  own.renderer->SetMaximumNumberOfPeels(12);
  own.graph->SetViewport(0.6, 0, 1, 0.35);
  own.graph->SetLayer(1);
  own.graph->InteractiveOff();
  own.graph->SetDraw(onScreen);
  own.chart->SetTitle("ms");
  own.chart->SetShowLegend(true);
  vtkNew<vtkContextActor> actor;
  actor->GetScene()->AddItem(own.chart);
  own.graph->AddActor(actor);
  own.text->GetTextProperty()->SetColor(0, 0, 0);
  own.text->GetTextProperty()->SetFontSize(20);
  own.window->SetWindowName("Palpate");
  own.window->SetShowWindow(onScreen);
  own.window->SetOffScreenRendering(!onScreen);
  own.window->SetAlphaBitPlanes(1);
  own.window->SetMultiSamples(0);
  own.window->SetSize(width, height);
  own.window->SetNumberOfLayers(2);
  own.window->AddRenderer(own.renderer);
  own.window->AddRenderer(own.graph);
  own.interactor->SetRenderWindow(own.window);
  own.interactor->SetInteractorStyle(vtkNew<vtkInteractorStyleTrackballCamera>());
  for (const auto event :
       {vtkCommand::KeyPressEvent, vtkCommand::LeftButtonPressEvent, vtkCommand::ExitEvent})
    own.interactor->AddObserver(event, &own, &Implementation::answer);
  if (onScreen) own.interactor->Initialize();
}

Window::~Window() = default;

bool Window::show() {
  Implementation& own = *m_implementation;
  own.take();
  own.addTimes();
  own.draw();
  for (own.interactor->ProcessEvents(); own.waits && own.isOpen; own.interactor->ProcessEvents())
    nanosleep(&kPause, nullptr);
  return own.isOpen;
}

void Window::press(char key) {
  m_implementation->interactor->SetKeyCode(key);
  m_implementation->interactor->InvokeEvent(vtkCommand::KeyPressEvent);
}

std::string Window::pick(int x, int y) {
  m_implementation->interactor->SetEventInformation(x, y);
  m_implementation->interactor->InvokeEvent(vtkCommand::LeftButtonPressEvent);
  m_implementation->interactor->InvokeEvent(vtkCommand::LeftButtonReleaseEvent);
  return m_implementation->picked;
}

Image Window::image() const {
  vtkRenderWindow* window = m_implementation->window;
  window->SwapBuffersOff();  // so that the pixels can be read after rendering
  window->Render();
  vtkNew<vtkUnsignedCharArray> pixels;
  const int *size = window->GetSize(), width = size[0], height = size[1];
  window->GetPixelData(0, 0, width - 1, height - 1, 0, pixels);
  window->SwapBuffersOn();
  const unsigned char* first = pixels->GetPointer(0);
  return {width, height, {first, first + pixels->GetNumberOfValues()}};
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
