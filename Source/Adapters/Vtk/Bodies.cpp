#include "Vtk/Bodies.h"

#include <vtkActor.h>
#include <vtkCellArray.h>
#include <vtkCellData.h>
#include <vtkCleanPolyData.h>
#include <vtkDoubleArray.h>
#include <vtkIdTypeArray.h>
#include <vtkNew.h>
#include <vtkPlane.h>
#include <vtkPointData.h>
#include <vtkPolyData.h>
#include <vtkPolyDataMapper.h>
#include <vtkPolyDataNormals.h>
#include <vtkProperty.h>
#include <vtkRenderer.h>
#include <vtkSphereSource.h>
#include <vtkUnsignedCharArray.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

namespace palpate::vtk {

namespace {

using Eigen::Vector3d, std::numbers::pi;
using Mesh = CollisionProblem::Geometry;

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

/// Lines as round tubes with balls at their joints.
class Tubes {
 public:
  Tubes() {
    normals->SetNumberOfComponents(3);
    points->SetDataTypeToDouble();
  }
  void addTube(const Vector3d& p, const Vector3d& q, double radiusP, double radiusQ,
               vtkIdType element) {
    const Vector3d along = q - p;
    if (along.norm() == 0) return;
    const Vector3d u = along.unitOrthogonal(), v = u.cross(along.normalized());
    const vtkIdType first = points->GetNumberOfPoints();
    for (int i = 0; i <= kAround; ++i) {
      const Vector3d out = std::cos(2 * pi * i / kAround) * u + std::sin(2 * pi * i / kAround) * v;
      addPoint(p + radiusP * out, out);
      addPoint(q + radiusQ * out, out);
    }
    addStrips(first, kAround, 2, element);
  }
  void addBall(const Vector3d& p, double radius, vtkIdType element) {
    const vtkIdType first = points->GetNumberOfPoints();
    for (int i = 0; i <= kAround; ++i) {
      for (int j = 0; j <= kAround / 2; ++j) {
        const double a = 2 * pi * i / kAround, b = 2 * pi * j / kAround;
        const Vector3d out(std::cos(a) * std::sin(b), std::sin(a) * std::sin(b), std::cos(b));
        addPoint(p + radius * out, out);
      }
    }
    addStrips(first, kAround, kAround / 2 + 1, element);
  }

  vtkNew<vtkPoints> points;
  vtkNew<vtkDoubleArray> normals;
  vtkNew<vtkCellArray> cells;
  vtkNew<vtkIdTypeArray> elements;

 private:
  static constexpr int kAround = 12;

  void addPoint(const Vector3d& p, const Vector3d& normal) {
    points->InsertNextPoint(p.data());
    normals->InsertNextTuple(normal.data());
  }
  /// Quadrilaterals between rows of `perRow` points.
  void addStrips(vtkIdType first, int rows, int perRow, vtkIdType element) {
    for (int i = 0; i < rows; ++i) {
      for (int j = 0; j + 1 < perRow; ++j) {
        const vtkIdType a = first + i * perRow + j, b = a + perRow;
        const std::array corners{a, a + 1, b + 1, b};
        cells->InsertNextCell(4, corners.data());
        elements->InsertNextValue(element);
      }
    }
  }
};

double radiusAt(const Mesh& mesh, std::uint32_t vertex, double thinnest) {
  const double radius = mesh.radii.empty()      ? 0
                        : mesh.radii.size() > 1 ? mesh.radii[vertex]
                                                : mesh.radii[0];
  return std::max(radius, thinnest);
}

/// More segments than this are drawn as thin lines.
constexpr std::size_t kMostTubes = 20'000;

void makeTubes(vtkPolyData* data, const Mesh& mesh, double thinnest) {
  Tubes tubes;
  std::vector<bool> hasBall(mesh.now.size());
  for (std::size_t s = 0; s < mesh.triangles.size(); ++s) {
    const auto& [p, q, q2] = mesh.triangles[s];
    const auto element = static_cast<vtkIdType>(s);
    tubes.addTube(mesh.now[p], mesh.now[q], radiusAt(mesh, p, thinnest),
                  radiusAt(mesh, q, thinnest), element);
    for (const std::uint32_t end : {p, q}) {
      if (!hasBall[end]) tubes.addBall(mesh.now[end], radiusAt(mesh, end, thinnest), element);
      hasBall[end] = true;
    }
  }
  data->SetPoints(tubes.points);
  data->SetPolys(tubes.cells);
  data->GetPointData()->SetNormals(tubes.normals);
  tubes.elements->SetName("element");
  data->GetCellData()->AddArray(tubes.elements);
}

/// One cell per element, in their order.
void makeCells(vtkPolyData* data, const Mesh& mesh) {
  vtkNew<vtkPoints> points;
  points->SetDataTypeToDouble();
  for (const Vector3d& p : mesh.now) points->InsertNextPoint(p.data());
  vtkNew<vtkCellArray> cells;
  for (const auto& [a, b, c] : mesh.triangles) {
    const std::array<vtkIdType, 3> corners{a, b, c};
    cells->InsertNextCell(mesh.type == GeometryType::Lines ? 2 : 3, corners.data());
  }
  for (vtkIdType i = 0; mesh.type == GeometryType::Points && i < points->GetNumberOfPoints(); ++i)
    cells->InsertNextCell(1, &i);
  data->SetPoints(points);
  if (mesh.type == GeometryType::Points)
    data->SetVerts(cells);
  else if (mesh.type == GeometryType::Lines)
    data->SetLines(cells);
  else
    data->SetPolys(cells);
  vtkNew<vtkIdTypeArray> elements;
  elements->SetName("element");
  for (vtkIdType i = 0; i < cells->GetNumberOfCells(); ++i) elements->InsertNextValue(i);
  data->GetCellData()->AddArray(elements);
}

/// Gives each cell the colour of its part.
void setColours(vtkPolyData* data, const Parts& parts) {
  vtkNew<vtkUnsignedCharArray> colours;
  colours->SetNumberOfComponents(3);
  const auto* elements = vtkIdTypeArray::SafeDownCast(data->GetCellData()->GetArray("element"));
  for (vtkIdType i = 0; i < data->GetNumberOfCells(); ++i) {
    const auto element = static_cast<std::uint32_t>(elements->GetValue(i));
    const auto& colour = std::prev(parts.upper_bound(element))->second.colour;
    colours->InsertNextTuple3(255 * colour[0], 255 * colour[1], 255 * colour[2]);
  }
  data->GetCellData()->SetScalars(colours);
}

}  // namespace

Appearance usualAppearance(std::size_t index) {
  // Tissue: told apart by lightness, too.
  constexpr std::array<std::array<double, 3>, 6> kColours{{{0.66, 0.33, 0.27},
                                                           {0.94, 0.76, 0.70},
                                                           {0.80, 0.52, 0.42},
                                                           {0.64, 0.49, 0.53},
                                                           {0.88, 0.82, 0.58},
                                                           {0.80, 0.76, 0.72}}};
  Appearance appearance;
  appearance.colour = kColours[index % kColours.size()];
  return appearance;
}

void tessellate(Mesh& shape, double size) {
  vtkNew<vtkSphereSource> sphere;
  sphere->SetThetaResolution(48);
  sphere->SetPhiResolution(48);
  sphere->Update();
  vtkPolyData* all = sphere->GetOutput();
  for (vtkIdType i = 0; i < all->GetNumberOfPoints(); ++i)
    shape.now.push_back(
        shape.motion.now(furthest(*shape.analytical, 2 * Vector3d(all->GetPoint(i)), size)));
  vtkNew<vtkIdList> corners;
  for (vtkIdType i = 0; i < all->GetNumberOfCells(); ++i) {
    all->GetCellPoints(i, corners);
    const auto corner = [&](int k) { return static_cast<std::uint32_t>(corners->GetId(k)); };
    shape.triangles.push_back({corner(0), corner(1), corner(2)});
  }
}

vtkProp* addBody(vtkRenderer* renderer, const Mesh& mesh, const Parts& parts,
                 const std::optional<Plane>& section, double thinnest, double pixelsPerLength) {
  const Appearance& look = parts.begin()->second;
  if (look.opacity == 0) return nullptr;
  const bool tubes = mesh.type == GeometryType::Lines && mesh.triangles.size() <= kMostTubes,
             thin = mesh.type == GeometryType::Lines || mesh.type == GeometryType::Points;
  vtkNew<vtkPolyData> data;
  if (tubes)
    makeTubes(data, mesh, thinnest);
  else
    makeCells(data, mesh);
  if (parts.size() > 1) setColours(data, parts);
  vtkNew<vtkCleanPolyData> clean;  // corners where faces of a shape meet
  clean->SetInputData(data);
  clean->SetTolerance(1e-6);
  vtkNew<vtkPolyDataNormals> normals;
  if (mesh.analytical)
    normals->SetInputConnection(clean->GetOutputPort());
  else
    normals->SetInputData(data);
  normals->SetSplitting(mesh.analytical.has_value());
  normals->SetFeatureAngle(40);
  normals->ConsistencyOff();
  vtkNew<vtkPolyDataMapper> mapper;
  thin ? mapper->SetInputData(data) : mapper->SetInputConnection(normals->GetOutputPort());
  if (section && look.isCut) {
    const Vector3d in = -section->normal;
    vtkNew<vtkPlane> cut;
    cut->SetOrigin(section->point.data());
    cut->SetNormal(in.data());
    mapper->AddClippingPlane(cut);
  }
  vtkNew<vtkActor> actor;
  actor->SetMapper(mapper);
  vtkProperty* property = actor->GetProperty();
  property->SetColor(look.colour[0], look.colour[1], look.colour[2]);
  property->SetOpacity(look.opacity);
  property->SetFrontfaceCulling(!look.frontFaces);
  if (tubes || !thin)
    property->SetInterpolationToPBR();
  else
    property->SetAmbient(0.5);
  property->SetRoughness(look.roughness);
  property->SetMetallic(look.metallic);
  const double diameter = mesh.radii.empty() ? 0 : 2 * mesh.radii.front();
  property->SetPointSize(static_cast<float>(std::max(2.0, pixelsPerLength * diameter)));
  property->SetLineWidth(3);
  property->RenderPointsAsSpheresOn();
  renderer->AddActor(actor);
  return actor;
}

}  // namespace palpate::vtk
