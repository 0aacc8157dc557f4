#include "Features.h"

namespace palpate::stability {

namespace {

using Kind = FeaturePair::Kind;

std::vector<FeaturePair> makeEveryFeaturePair() {
  std::vector<FeaturePair> all;
  const std::array<std::array<std::uint32_t, 2>, 3> edges{{{0, 1}, {1, 2}, {0, 2}}};
  for (std::uint32_t vertex = 0; vertex < 3; ++vertex) {
    all.push_back({Kind::VertexTriangle, {vertex, 0}});
    all.push_back({Kind::TriangleVertex, {0, vertex}});
  }
  for (const auto& [i, j] : edges)
    for (const auto& [k, l] : edges) all.push_back({Kind::EdgeEdge, {i, j, k, l}});
  return all;
}

}  // namespace

const std::vector<FeaturePair>& everyFeaturePair() {
  static const std::vector<FeaturePair> all = makeEveryFeaturePair();
  return all;
}

std::array<Eigen::Vector3d, 4> positionsOf(const FeaturePair& pair, const Case::Frame& frame) {
  const auto& [i, j, k, l] = pair.ids;
  const auto& [a, b] = frame;
  if (pair.kind == Kind::VertexTriangle) return {a[i], b[0], b[1], b[2]};
  if (pair.kind == Kind::TriangleVertex) return {b[j], a[0], a[1], a[2]};
  return {a[i], a[j], b[k], b[l]};
}

}  // namespace palpate::stability
