#include <palpate/vtk/Window.h>

#include "Vtk/Annotations.h"
#include "Vtk/Bodies.h"
#include "Vtk/Contacts.h"
#include "Vtk/Glyphs.h"
#include "Vtk/Labels.h"
#include "Vtk/Light.h"
#include "Vtk/Notes.h"
#include "Vtk/Panel.h"
#include "Vtk/TimesGraph.h"

#include <palpate/Error.h>

#include <vtkActor.h>
#include <vtkArrowSource.h>
#include <vtkCamera.h>
#include <vtkCellData.h>
#include <vtkCellPicker.h>
#include <vtkColorTransferFunction.h>
#include <vtkCubeSource.h>
#include <vtkDataSet.h>
#include <vtkImageData.h>
#include <vtkInteractorStyleTrackballCamera.h>
#include <vtkLookupTable.h>
#include <vtkNew.h>
#include <vtkPNGWriter.h>
#include <vtkProperty.h>
#include <vtkProperty2D.h>
#include <vtkRenderWindow.h>
#include <vtkRenderWindowInteractor.h>
#include <vtkRenderer.h>
#include <vtkScalarBarActor.h>
#include <vtkSphereSource.h>
#include <vtkTextActor.h>
#include <vtkTextProperty.h>
#include <vtkUnsignedCharArray.h>

#include <X11/Xlib.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <ctime>
#include <map>
#include <optional>
#include <string_view>
#include <utility>

// X11's header defines these as macros.
#undef None
#undef Status
#undef Success

namespace palpate::vtk {

namespace {

using Eigen::Vector3d, Eigen::Quaterniond;
using Mesh = CollisionProblem::Geometry;
using Clock = std::chrono::steady_clock;

constexpr timespec kPause{0, 20'000'000};  // 20 ms
/// The least radius with which lines are drawn, as a share of the diagonal of everything in view.
constexpr double kThinnest = 0.0012;

void check(const View& view) {
  const auto& [from, up, centre, height] = view;
  if (!from.allFinite() || !up.allFinite() || !centre.allFinite() || !(height >= 0) ||
      !std::isfinite(height) || !(up.cross(from).norm() > 0))
    throw Error(ErrorCode::InvalidSettings,
                "A view needs finite values, a height of at least 0, and directions that are not "
                "parallel.");
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
  enum class Cells { None, OfContact, ByDepth, ByOccupancy };

  const OctreeBasedCD& detection;
  std::shared_ptr<void> connection = openDisplay();
  vtkNew<vtkRenderer> renderer{}, inset{}, overlay{}, labelLayer{}, graph{};
  vtkNew<vtkRenderWindow> window{};
  vtkNew<vtkRenderWindowInteractor> interactor{};
  vtkNew<vtkTextActor> pickedText{}, panelText{};
  vtkNew<vtkScalarBarActor> colourBar{};
  vtkNew<vtkColorTransferFunction> colours{};  // of distances
  std::array<double, 2> colourRange{};
  Light light{};
  ScaleBar scaleBar{};
  InsetFrame insetFrame{};
  std::vector<Note> notes{};
  TimesGraph times{};
  CollisionProblem problem{};  // of the frame that is shown
  std::map<GeometryId, std::size_t> indices{};
  std::map<GeometryId, Parts> parts{};
  std::map<vtkProp*, const Mesh*> bodies{};
  std::string picked{}, unit{};
  View view{};
  std::optional<Inset> insetView{};
  std::optional<Plane> section{};
  std::optional<FeaturePair> nearest{};  // contact to the camera
  Eigen::AlignedBox3d box{};
  Clock::time_point lastShow{};
  double framesPerSecond = 0;
  Cells cells = Cells::None;
  int frames = 0, frame = -1;
  bool contacts = true, normals = true, untrusted = true, names = true, panel = false,
       translucent = false, isOpen = true, waits = false, isNew = true;

  void answer(vtkObject*, unsigned long event, void*) {
    const int* at = interactor->GetEventPosition();
    if (event == vtkCommand::KeyPressEvent) press(interactor->GetKeyCode());
    if (event == vtkCommand::LeftButtonPressEvent) pick(at[0], at[1]);
    if (event == vtkCommand::ExitEvent) isOpen = false;
  }

  void press(char key) {
    const std::string unknown = std::string("no key ") + key + "; see Docs/Scenes.md";
    pickedText->SetInput(hasKey(key) || key <= ' ' ? picked.c_str() : unknown.c_str());
    for (const auto& [name, flag] : {std::pair('c', &contacts),
                                     {'n', &normals},
                                     {'u', &untrusted},
                                     {'l', &names},
                                     {'p', &panel},
                                     {'b', &translucent},
                                     {' ', &waits}})
      if (key == name) *flag = !*flag;
    if (key == 'o') cells = static_cast<Cells>((static_cast<int>(cells) + 1) % 4);
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
                                      std::to_string(elementOf(picker));
    }
    pickedText->SetInput(picked.c_str());
    window->Render();
  }

  static long elementOf(vtkCellPicker* picker) {
    const double element = picker->GetDataSet()->GetCellData()->GetArray("element")->GetComponent(
        picker->GetCellId(), 0);
    return std::lround(element);
  }

  /// Of texts, in pixels. It grows with the window.
  int textSize() const { return std::max(9, window->GetSize()[1] / 38); }
  double pixelsPerLength() const {
    return window->GetSize()[1] / (2 * renderer->GetActiveCamera()->GetParallelScale());
  }
  const Parts& partsOf(const Mesh& mesh);
  std::string nameOf(GeometryId) const;
  void take();
  void measureFrameRate();
  void draw();
  void drawBodies();
  void drawCells() const;
  void drawContacts();
  void drawContactsIn(vtkRenderer*, const ContactGlyphs&);
  void drawAnnotations();
  void updateScale(vtkObject* = nullptr, unsigned long = 0, void* = nullptr);
  void aim();
};

const Parts& Window::Implementation::partsOf(const Mesh& mesh) {
  Parts& own = parts[mesh.id];
  own.try_emplace(0, usualAppearance(indices.at(mesh.id)));
  return own;
}

/// The label of a geometry, or its number.
std::string Window::Implementation::nameOf(GeometryId id) const {
  const auto found = parts.find(id);
  if (found != parts.end() && !found->second.begin()->second.label.empty())
    return found->second.begin()->second.label;
  return "geometry " + std::to_string(static_cast<std::uint32_t>(id));
}

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

void Window::Implementation::measureFrameRate() {
  constexpr double kShare = 0.1;  // of the newest frame in the mean
  const Clock::time_point now = Clock::now();
  const double seconds = std::chrono::duration<double>(now - lastShow).count();
  if (frames == 1) framesPerSecond = 1 / seconds;
  if (frames > 1) framesPerSecond += kShare * (1 / seconds - framesPerSecond);
  lastShow = now;
}

void Window::Implementation::drawBodies() {
  constexpr double kTranslucent = 0.4;
  for (const Mesh& mesh : problem.geometries) {
    Parts look = partsOf(mesh);
    double& opacity = look.begin()->second.opacity;
    const bool thin = mesh.type == GeometryType::Lines || mesh.type == GeometryType::Points;
    if (translucent && !thin) opacity = std::min(opacity, kTranslucent);
    vtkProp* body = addBody(renderer, mesh, look, section, kThinnest * box.diagonal().norm(),
                            pixelsPerLength());
    if (body == nullptr) continue;
    bodies[body] = &mesh;
    if (insetView) inset->AddViewProp(body);
  }
}

void Window::Implementation::drawCells() const {
  const LooseOctree& octree = detection.octree();
  std::vector<LooseOctree::Node> chosen;
  if (cells != Cells::OfContact)
    chosen = cellsWithElements(octree);
  else if (nearest)
    chosen = cellsOf(octree, *nearest);
  Glyphs cubes;
  for (const LooseOctree::Node& node : chosen) {
    const Mesh& mesh = problem.geometries[indices.at(node.geometry)];
    const Pose& pose = mesh.motion.now;
    cubes.add(pose(node.bounds.center()),
              cells == Cells::ByOccupancy ? static_cast<double>(node.elements.size()) : node.depth,
              node.bounds.sizes().x(), Quaterniond(pose.rotation));
  }
  vtkNew<vtkLookupTable> green;
  green->SetHueRange(0.36, 0.36);
  green->SetSaturationRange(1, 1);
  green->SetValueRange(0.4, 0.75);
  green->SetTableRange(cubes.range().data());
  vtkProperty* look = cubes.show(renderer, vtkNew<vtkCubeSource>(), green);
  look->SetRepresentationToWireframe();
  look->LightingOff();
  look->SetOpacity(cells == Cells::OfContact ? 1 : 0.5);
  if (cells == Cells::OfContact) look->SetLineWidth(static_cast<float>(textSize()) / 10);
}

/// Draws the contacts that no body hides.
void Window::Implementation::drawContactsIn(vtkRenderer* shown, const ContactGlyphs& glyphs) {
  vtkNew<vtkSphereSource> ball;
  ball->SetThetaResolution(16);
  ball->SetPhiResolution(12);
  vtkNew<vtkArrowSource> arrow;
  arrow->SetTipResolution(16);
  arrow->SetShaftResolution(12);
  if (contacts) glyphs.spheres.show(shown, ball, colours);
  if (normals) glyphs.arrows.show(shown, arrow, colours);
  vtkNew<vtkLookupTable> magenta;
  magenta->SetHueRange(0.85, 0.85);
  if (untrusted) glyphs.untrusted.show(shown, ball, magenta);
}

void Window::Implementation::drawContacts() {
  ContactGlyphs main, enlarged;
  const auto collect = [&](ContactGlyphs& glyphs, vtkRenderer* shown) {
    vtkCamera* camera = shown->GetActiveCamera();
    glyphs.collect(detection, problem, indices, 2.5 * camera->GetParallelScale(),
                   Vector3d(camera->GetDirectionOfProjection()), section);
  };
  collect(main, renderer);
  nearest = main.nearest;
  const auto [low, high] = main.spheres.range();
  double most = 0;
  for (const auto& pair : detection.pairs()) most = std::max(most, pair.settings.thickness);
  if (most == 0) most = std::max(high, -low);
  auto& [least, greatest] = colourRange;  // round numbers, which stay from frame to frame
  greatest = std::max(greatest, most > 0 ? roundUp(most) : 1);
  if (low < 0 || least < 0) least = -greatest;
  setDistanceColours(colours, colourRange);
  drawContactsIn(renderer, main);
  if (insetView) {
    collect(enlarged, inset);
    drawContactsIn(inset, enlarged);
  }
  if (!problem.pairs.empty() && (contacts || normals)) overlay->AddViewProp(colourBar);
}

void Window::Implementation::updateScale(vtkObject*, unsigned long, void*) {
  const int* size = window->GetSize();
  scaleBar.update(pixelsPerLength(), unit, size[0], size[1]);
  for (vtkRenderer* shown : {renderer.Get(), inset.Get()}) light.follow(shown);
  if (insetView)
    insetFrame.update(renderer->GetActiveCamera(), inset->GetActiveCamera(), inset->GetViewport(),
                      size[0], size[1]);
}

void Window::Implementation::drawAnnotations() {
  const int *size = window->GetSize(), text = textSize();
  if (!problem.geometries.empty()) scaleBar.show(overlay, text);
  if (names)
    showLabels(labelLayer, problem, parts,
               Projection(renderer->GetActiveCamera(), size[0], size[1]), text, translucent);
  showNotes(overlay, notes, text, pixelsPerLength());
  if (insetView) insetFrame.show(overlay, text);
  setTextLook(pickedText->GetTextProperty(), text);
  pickedText->SetPosition(0.4 * size[0], 0.03 * size[1]);
  overlay->AddViewProp(pickedText);
  colourBar->SetTitle(unit.empty() ? "distance" : ("distance [" + unit + "]").c_str());
  for (vtkTextProperty* look :
       {colourBar->GetTitleTextProperty(), colourBar->GetLabelTextProperty()}) {
    setTextLook(look, text);
    look->BoldOff();
  }
  if (!panel) return;
  const auto name = [this](GeometryId id) { return nameOf(id); };
  panelText->SetInput(vtk::panelText(detection, name, frame, framesPerSecond).c_str());
  vtkTextProperty* look = panelText->GetTextProperty();
  setTextLook(look, text * 7 / 10);
  look->SetFontFamilyToCourier();
  look->SetVerticalJustificationToTop();
  look->SetBackgroundColor(1, 1, 1);
  look->SetBackgroundOpacity(0.75);
  panelText->SetPosition(0.015 * size[0], 0.985 * size[1]);
  overlay->AddViewProp(panelText);
}

/// Aims the camera as the view says.
void Window::Implementation::aim() {
  // The share of the picture that bodies fill at most; below are the bars of length and colours.
  constexpr double kShareOfWidth = 0.9, kShareOfHeight = 0.78, kMiddleY = 0.56;
  const Vector3d from = view.from.normalized(), right = view.up.cross(from).normalized(),
                 top = from.cross(right);
  Vector3d focus = view.centre;
  double height = view.height;
  if (height == 0) {
    Eigen::AlignedBox3d seen;  // in the camera's directions
    Eigen::Matrix3d turn;
    turn << right.transpose(), top.transpose(), from.transpose();
    for (const Mesh& mesh : problem.geometries) {
      const bool isPlane = mesh.analytical && std::holds_alternative<Plane>(*mesh.analytical);
      if (!isPlane && partsOf(mesh).begin()->second.opacity > 0)
        for (const Vector3d& p : mesh.now) seen.extend(Vector3d(turn * p));
    }
    if (seen.isEmpty()) seen.extend(Vector3d(turn * box.min())).extend(Vector3d(turn * box.max()));
    focus = turn.transpose() * seen.center();
    const int* size = window->GetSize();
    const double aspect = static_cast<double>(size[0]) / size[1];
    height = std::max(seen.sizes().y() / kShareOfHeight, seen.sizes().x() / kShareOfWidth / aspect);
    focus += (0.5 - kMiddleY) * height * top;
  }
  if (height == 0) height = 1;  // a single point
  const auto place = [&](vtkCamera* camera, const Vector3d& at, double seen) {
    const Vector3d position = at + (box.diagonal().norm() + height) * from;
    camera->ParallelProjectionOn();
    camera->SetFocalPoint(at.data());
    camera->SetPosition(position.data());
    camera->SetViewUp(top.data());
    camera->SetParallelScale(seen / 2);
  };
  place(renderer->GetActiveCamera(), focus, height);
  if (insetView) place(inset->GetActiveCamera(), insetView->centre, insetView->height);
}

void Window::Implementation::draw() {
  renderer->RemoveAllViewProps();
  inset->RemoveAllViewProps();
  overlay->RemoveAllViewProps();
  labelLayer->RemoveAllViewProps();
  bodies.clear();
  if (isNew) aim();
  isNew = false;
  drawBodies();
  drawContacts();
  if (cells != Cells::None) drawCells();
  drawAnnotations();
  for (vtkRenderer* shown : {renderer.Get(), inset.Get()}) {
    constexpr double kHalf = 1.0 / 1024;  // VTK keeps positions as halves: less would be bands
    shown->ResetCameraClippingRange();
    const double height = 2 * shown->GetActiveCamera()->GetParallelScale(),
                 depth = shown->GetActiveCamera()->GetClippingRange()[1];
    shown->SetSSAORadius(0.08 * height);
    shown->SetSSAOBias(std::max(0.003 * height, kHalf * depth));
  }
  window->Render();
}

Window::Window(const OctreeBasedCD& detection, bool onScreen, int width, int height) {
  constexpr int kMost = 16384;
  if (std::min(width, height) < 1 || std::max(width, height) > kMost)
    throw Error(ErrorCode::InvalidSettings,
                "A window's width and height must be from 1 to 16384 pixels.");
  m_implementation.reset(new Implementation{detection});
  Implementation& own = *m_implementation;
  own.panel = onScreen;
  for (vtkRenderer* shown : {own.renderer.Get(), own.inset.Get()}) {
    shown->SetBackground(1, 1, 1);
    shown->SetUseDepthPeeling(true);
    shown->SetMaximumNumberOfPeels(12);
    shown->SetUseSSAO(shown == own.renderer);  // it needs the whole window
    shown->SetSSAOKernelSize(64);
    shown->SetSSAOBlur(true);
    shown->SetUseFXAA(true);
    own.light.show(shown);
  }
  own.inset->InteractiveOff();
  own.inset->SetDraw(false);
  for (vtkRenderer* layer : {own.overlay.Get(), own.labelLayer.Get()}) {
    layer->SetLayer(layer == own.overlay ? 1 : 2);
    layer->InteractiveOff();
    layer->SetActiveCamera(own.renderer->GetActiveCamera());
  }
  own.renderer->AddObserver(vtkCommand::StartEvent, &own, &Implementation::updateScale);
  own.colourBar->SetLookupTable(own.colours);
  own.colourBar->UnconstrainedFontSizeOn();
  own.colourBar->SetOrientationToHorizontal();
  own.colourBar->SetLabelFormat("%.3g");
  own.colourBar->SetNumberOfLabels(3);
  own.colourBar->DrawBackgroundOn();
  own.colourBar->GetBackgroundProperty()->SetColor(1, 1, 1);
  own.colourBar->GetBackgroundProperty()->SetOpacity(0.75);
  own.colourBar->SetBarRatio(0.2);
  own.colourBar->SetVerticalTitleSeparation(std::max(4, height / 60));
  own.colourBar->SetPosition(0.68, 0.02);
  own.colourBar->SetWidth(0.28);
  own.colourBar->SetHeight(0.11);
  own.graph->SetViewport(0.62, 0, 1, 0.32);
  own.graph->SetLayer(3);
  own.graph->InteractiveOff();
  own.graph->SetDraw(onScreen);
  own.times.show(own.graph, std::max(8, height / 70));
  own.window->SetWindowName("Palpate");
  own.window->SetShowWindow(onScreen);
  own.window->SetOffScreenRendering(!onScreen);
  own.window->SetAlphaBitPlanes(1);
  own.window->SetMultiSamples(0);
  own.window->SetSize(width, height);
  own.window->SetNumberOfLayers(4);
  own.window->AddRenderer(own.renderer);
  own.window->AddRenderer(own.inset);
  own.window->AddRenderer(own.overlay);
  own.window->AddRenderer(own.labelLayer);
  own.window->AddRenderer(own.graph);
  own.interactor->SetRenderWindow(own.window);
  own.interactor->SetInteractorStyle(vtkNew<vtkInteractorStyleTrackballCamera>());
  for (const auto event :
       {vtkCommand::KeyPressEvent, vtkCommand::LeftButtonPressEvent, vtkCommand::ExitEvent})
    own.interactor->AddObserver(event, &own, &Implementation::answer);
  if (onScreen) own.interactor->Initialize();
}

Window::~Window() = default;

void Window::setAppearance(GeometryId id, const Appearance& appearance,
                           std::uint32_t firstElement) {
  const auto isShare = [](double value) { return value >= 0 && value <= 1; };  // NaN is not
  if (!isShare(appearance.opacity) || !isShare(appearance.roughness) ||
      !isShare(appearance.metallic) ||
      !std::all_of(appearance.colour.begin(), appearance.colour.end(), isShare))
    throw Error(ErrorCode::InvalidSettings,
                "An appearance's colour, opacity, roughness and metallic must be from 0 to 1.");
  Implementation& own = *m_implementation;
  own.parts[id].insert_or_assign(firstElement, appearance);
}

void Window::setView(const View& view) {
  check(view);
  m_implementation->view = view;
  m_implementation->isNew = true;
}

void Window::setInset(const Inset& shown) {
  if (!shown.centre.allFinite() || !std::isfinite(shown.height) || !(shown.height > 0))
    throw Error(ErrorCode::InvalidSettings,
                "An inset needs a finite centre and a finite positive height.");
  constexpr double kWidth = 0.29, kHeight = 0.4, kMargin = 0.015, kBars = 0.14;
  const double x = shown.left ? kMargin : 1 - kMargin - kWidth,
               y = shown.top ? 1 - kMargin - kHeight : kBars;
  Implementation& own = *m_implementation;
  own.insetView = shown;
  own.inset->SetViewport(x, y, x + kWidth, y + kHeight);
  own.inset->SetDraw(true);
  own.isNew = true;
}

void Window::setSection(const Plane& plane) {
  if (!plane.point.allFinite() || !plane.normal.allFinite() || !(plane.normal.norm() > 0))
    throw Error(ErrorCode::InvalidSettings, "A section needs a finite plane with a normal.");
  m_implementation->section = plane;
}

void Window::setNotes(std::vector<Note> notes) { m_implementation->notes = std::move(notes); }

void Window::setLengthUnit(std::string unit) { m_implementation->unit = std::move(unit); }

bool Window::show(int frame) {
  Implementation& own = *m_implementation;
  own.frame = frame < 0 ? own.frame + 1 : frame;
  own.window->SetWindowName(("Palpate, frame " + std::to_string(own.frame)).c_str());
  own.take();
  own.measureFrameRate();
  own.times.add(own.detection.statistics().milliseconds);
  ++own.frames;
  own.draw();
  for (own.interactor->ProcessEvents(); own.waits && own.isOpen; own.interactor->ProcessEvents())
    nanosleep(&kPause, nullptr);
  return own.isOpen;
}

bool Window::hasKey(char key) {
  return std::string_view("cnulpb otrq").find(key) != std::string_view::npos;
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
