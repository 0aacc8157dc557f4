#include "Vtk/Labels.h"

#include "Vtk/Annotations.h"

#include <vtkBillboardTextActor3D.h>
#include <vtkCamera.h>
#include <vtkNew.h>
#include <vtkRenderer.h>
#include <vtkTextProperty.h>

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <string>
#include <utility>
#include <vector>

namespace palpate::vtk {

namespace {

using Mesh = CollisionProblem::Geometry;
using Eigen::Vector3d;

/// A name, and the points at which it may stand.
struct Label {
  std::string text;
  std::vector<Projected> places;
};

/// The least depth in each square of pixels: what hides what, roughly.
class DepthGrid {
 public:
  DepthGrid(const std::vector<Projected>& points, int square) : m_square(square) {
    for (const Projected& p : points) {
      double& depth =
          m_depths.try_emplace(key(p), std::numeric_limits<double>::infinity()).first->second;
      depth = std::min(depth, p.depth);
    }
  }
  double at(const Projected& p) const {
    const auto found = m_depths.find(key(p));
    return found == m_depths.end() ? std::numeric_limits<double>::infinity() : found->second;
  }

 private:
  std::pair<int, int> key(const Projected& p) const {
    return {static_cast<int>(std::floor(p.x / m_square)),
            static_cast<int>(std::floor(p.y / m_square))};
  }

  int m_square;
  std::map<std::pair<int, int>, double> m_depths;
};

/// The labels, and the points at which each may stand.
std::vector<Label> labelsOf(const CollisionProblem& problem,
                            const std::map<GeometryId, Parts>& parts, const Projection& project) {
  std::vector<Label> labels;
  for (const Mesh& mesh : problem.geometries) {
    const Parts& own = parts.at(mesh.id);
    for (auto part = own.begin(); part != own.end(); ++part) {
      if (part->second.label.empty()) continue;
      const std::size_t end =
          std::next(part) == own.end() ? mesh.triangles.size() : std::next(part)->first;
      Label label{part->second.label, {}};
      for (std::size_t e = part->first; e < end; ++e)
        label.places.push_back(project(mesh.now[mesh.triangles[e][0]]));
      for (std::size_t i = 0; mesh.type == GeometryType::Points && i < mesh.now.size(); ++i)
        label.places.push_back(project(mesh.now[i]));
      labels.push_back(std::move(label));
    }
  }
  return labels;
}

/// Points all over the surfaces of opaque bodies, at most `spacing` pixels apart.
std::vector<Projected> occludersOf(const CollisionProblem& problem,
                                   const std::map<GeometryId, Parts>& parts,
                                   const Projection& project, int spacing) {
  std::vector<Projected> points;
  for (const Mesh& mesh : problem.geometries) {
    const Appearance& look = parts.at(mesh.id).begin()->second;
    if (mesh.type == GeometryType::Points || look.opacity < 1 || !look.frontFaces) continue;
    for (const auto& [a, b, c] : mesh.triangles) {
      const Projected p = project(mesh.now[a]), q = project(mesh.now[b]), r = project(mesh.now[c]);
      const double width = std::max({p.x, q.x, r.x}) - std::min({p.x, q.x, r.x}),
                   height = std::max({p.y, q.y, r.y}) - std::min({p.y, q.y, r.y});
      const int steps = static_cast<int>(std::ceil(std::max(width, height) / spacing));
      for (int i = 0; i <= steps; ++i) {
        for (int j = 0; i + j <= steps; ++j) {
          const double u = steps > 0 ? static_cast<double>(i) / steps : 0,
                       v = steps > 0 ? static_cast<double>(j) / steps : 0, w = 1 - u - v;
          points.push_back({Vector3d::Zero(), w * p.x + u * q.x + v * r.x,
                            w * p.y + u * q.y + v * r.y, w * p.depth + u * q.depth + v * r.depth});
        }
      }
    }
  }
  return points;
}

}  // namespace

Projection::Projection(vtkCamera* camera, int width, int height)
    : m_focus(camera->GetFocalPoint()),
      m_towards(camera->GetDirectionOfProjection()),
      m_right(m_towards.cross(Eigen::Vector3d(camera->GetViewUp())).normalized()),
      m_up(m_right.cross(m_towards)),
      m_scale(height / (2 * camera->GetParallelScale())),
      m_middleX(width / 2.0),
      m_middleY(height / 2.0) {}

Projected Projection::operator()(const Eigen::Vector3d& p) const {
  const Eigen::Vector3d d = p - m_focus;
  return {p, m_middleX + m_scale * m_right.dot(d), m_middleY + m_scale * m_up.dot(d),
          m_towards.dot(d)};
}

void showLabels(vtkRenderer* layer, const CollisionProblem& problem,
                const std::map<GeometryId, Parts>& parts, const Projection& project, int textSize,
                bool allTranslucent) {
  const std::vector<Label> labels = labelsOf(problem, parts, project);
  if (labels.empty()) return;
  std::vector<Projected> occluders;
  if (!allTranslucent) occluders = occludersOf(problem, parts, project, textSize);
  const DepthGrid depths(occluders, textSize);
  Eigen::AlignedBox3d box;
  for (const Mesh& mesh : problem.geometries)
    for (const Vector3d& p : mesh.now) box.extend(p);
  const double depthTolerance = 0.02 * box.diagonal().norm();
  std::vector<std::pair<Eigen::Vector2d, double>> taken;  // middle and width of each label
  for (const auto& [text, places] : labels) {
    std::vector<const Projected*> visible;
    Eigen::Vector2d low(1e9, 1e9), high = -low, middle = Eigen::Vector2d::Zero();
    for (const Projected& p : places) {
      if (p.depth > depths.at(p) + depthTolerance) continue;
      visible.push_back(&p);
      low = low.cwiseMin(Eigen::Vector2d(p.x, p.y));
      high = high.cwiseMax(Eigen::Vector2d(p.x, p.y));
      middle += Eigen::Vector2d(p.x, p.y);
    }
    if (visible.empty()) continue;
    middle /= static_cast<double>(visible.size());
    const double width = 0.6 * textSize * static_cast<double>(text.size()) + textSize;
    // Above a body that it would hide.
    const bool above = std::min((high - low).x() / width, (high - low).y() / textSize) < 2.5;
    const double rise = above ? 1.3 * textSize : 0;
    const Projected* best = nullptr;
    double least = std::numeric_limits<double>::infinity();
    for (const Projected* p : visible) {
      const Eigen::Vector2d at(p->x, p->y + rise);
      const Eigen::Vector2d wanted(middle.x(), above ? high.y() : middle.y());
      double cost = (Eigen::Vector2d(p->x, p->y) - wanted).norm();
      for (const auto& [other, otherWidth] : taken)
        if (std::abs(at.x() - other.x()) < (width + otherWidth) / 2 &&
            std::abs(at.y() - other.y()) < 1.8 * textSize)
          cost += 1e6;
      if (cost < least) least = cost, best = p;
    }
    taken.emplace_back(Eigen::Vector2d(best->x, best->y + rise), width);
    vtkNew<vtkBillboardTextActor3D> actor;
    actor->SetInput(text.c_str());
    actor->SetPosition(best->position.x(), best->position.y(), best->position.z());
    actor->SetDisplayOffset(0, static_cast<int>(rise));
    vtkTextProperty* look = actor->GetTextProperty();
    setTextLook(look, textSize);
    look->SetJustificationToCentered();
    look->SetVerticalJustificationToCentered();
    look->SetBackgroundColor(1, 1, 1);
    look->SetBackgroundOpacity(0.72);
    layer->AddViewProp(actor);
  }
}

}  // namespace palpate::vtk
