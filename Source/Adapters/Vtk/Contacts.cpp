#include "Vtk/Contacts.h"

#include "Vtk/Panel.h"

#include <algorithm>
#include <cmath>

namespace palpate::vtk {

using Eigen::Vector3d, Eigen::Quaterniond;
using Mesh = CollisionProblem::Geometry;

void ContactGlyphs::collect(const OctreeBasedCD& detection, const CollisionProblem& problem,
                            const std::map<GeometryId, std::size_t>& indices, double size,
                            const Vector3d& towards, const std::optional<Plane>& section) {
  constexpr double kBall = 0.011, kArrow = 0.04, kMark = 0.014;  // shares of the size
  constexpr double kFew = 400, kSmallest = 0.5;                  // many contacts are drawn smaller
  const double shrink = std::clamp(
      std::sqrt(kFew / static_cast<double>(detection.statistics().contacts + 1)), kSmallest, 1.0);
  for (const auto& [first, second, settings] : detection.pairs()) {
    const Mesh &a = problem.geometries[indices.at(first)],
               &b = problem.geometries[indices.at(second)];
    const CollisionData& data = answerOf(detection, first, second);
    const auto isHidden = [&](const Vector3d& at) {
      return section && (at - section->point).dot(section->normal) > 0;
    };
    const auto add = [&](const auto& c, const Vector3d& at) {
      if (isHidden(at)) return;
      spheres.add(at, c.distance, shrink * kBall * size, Quaterniond::Identity());
      arrows.add(at, c.distance, shrink * kArrow * size,
                 Quaterniond::FromTwoVectors(Vector3d::UnitX(), c.normal));
    };
    const auto middle = [](const Stencil& c, const std::array<const Mesh*, 4>& meshes) {
      Vector3d sum = Vector3d::Zero();
      for (std::size_t i = 0; i < 4; ++i)
        sum += std::abs(c.weights[i]) * meshes[i]->now[c.vertices[i]];
      return Vector3d(sum / 2);  // the weights of each side sum to 1
    };
    // split: how many vertices of the stencil are the first feature's
    const auto addPair = [&](const auto& c, const std::array<const Mesh*, 4>& meshes, int split) {
      const Stencil features = stencil(c);
      const Vector3d at = middle(features, meshes);
      add(c, at);
      const double depth = towards.dot(at);
      if (isHidden(at) || (nearest && depth >= nearest->depth)) return;
      const auto* v = features.vertices.data();
      nearest = {{{{meshes[0], {v, v + split}}, {meshes[3], {v + split, v + 4}}}}, depth};
    };
    for (const auto& c : data.vertexTriangle()) addPair(c, {&a, &b, &b, &b}, 1);
    for (const auto& c : data.triangleVertex()) addPair(c, {&b, &a, &a, &a}, 1);
    for (const auto& c : data.edgeEdge()) addPair(c, {&a, &a, &b, &b}, 2);
    for (const auto& c : data.shape()) add(c, (c.point + c.pointOnShape) / 2);
    for (const auto& c : data.shapeShape()) add(c, (c.pointA + c.pointB) / 2);
    const auto mark = [&](const Mesh& mesh, std::uint32_t vertex) {
      if (!isHidden(mesh.now[vertex]))
        untrusted.add(mesh.now[vertex], 0, kMark * size, Quaterniond::Identity());
    };
    const Validity& validity = data.validity();
    for (const auto v : validity.untrustedVerticesA) mark(a, v);
    for (const auto v : validity.untrustedVerticesB) mark(b, v);
    for (const auto t : validity.degenerateTrianglesA) mark(a, a.triangles[t][0]);
    for (const auto t : validity.degenerateTrianglesB) mark(b, b.triangles[t][0]);
  }
}

std::vector<LooseOctree::Node> cellsOf(const LooseOctree& octree, const FeaturePair& pair) {
  constexpr int kMostLevels = 2;
  std::vector<LooseOctree::Node> chosen;
  for (const auto& [mesh, vertices] : pair.features) {
    const std::vector<LooseOctree::Node> nodes = octree.nodes(mesh->id);
    for (std::uint32_t place = 0; place < nodes.size(); ++place) {
      const auto elements = nodes[place].elements;
      const auto holds = [&, &corners = vertices, &body = *mesh](std::uint32_t element) {
        if (body.type == GeometryType::Points) return element == corners.front();
        const Triangle& t = body.triangles[element];
        return std::all_of(corners.begin(), corners.end(), [&t](std::uint32_t v) {
          return std::find(t.begin(), t.end(), v) != t.end();
        });
      };
      if (std::none_of(elements.begin(), elements.end(), holds)) continue;
      int levels = 0;
      for (std::uint32_t up = place; up != kNoElement && levels < kMostLevels;
           up = nodes[up].parent, ++levels)
        chosen.push_back(nodes[up]);
      break;
    }
  }
  return chosen;
}

std::vector<LooseOctree::Node> cellsWithElements(const LooseOctree& octree) {
  std::vector<LooseOctree::Node> chosen;
  for (const GeometryId geometry : octree.geometries())
    for (const LooseOctree::Node& node : octree.nodes(geometry))
      if (!node.elements.empty()) chosen.push_back(node);
  return chosen;
}

}  // namespace palpate::vtk
