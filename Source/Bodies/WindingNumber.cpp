#include "Bodies/WindingNumber.h"

#include "Bodies/Body.h"
#include "Octree/Walk.h"
#include "Math/Tolerances.h"
#include "Core/Assert.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace palpate {

namespace {

using Eigen::Vector3d;

constexpr std::size_t kBlocksPerPart = 64;
/// The distance, in radii of a cluster, from which it has a share with a useful error bound.
constexpr double kFarRadii = 1.5;

WindingNumbers::Result decide(double least, double most, double margin) {
  const bool outside = most < (0.5 - margin);  // both are false for NaN
  const bool inside = least > (0.5 + margin);
  return {!outside, outside || inside};
}

/// The answer for a sum with an error bound. The sum may have either sign.
WindingNumbers::Result decide(const SolidAngleShare& sum, double margin) {
  const double number = std::abs(sum.value);
  return decide(number - sum.error, number + sum.error, margin);
}

}  // namespace

void WindingNumbers::Cluster::add(const Cluster& other) {
  const double all = area + other.area;
  const Vector3d before = centre;
  if (all > 0)
    centre += (other.area / all) * (other.centre - centre);
  else if (radius == 0)
    centre = other.centre;
  spread += (before - centre) * normal.transpose() + other.spread +
            (other.centre - centre) * other.normal.transpose();
  normal += other.normal;
  area = all;
}

void WindingNumbers::Cluster::enclose(const Cluster& part) {
  radius = std::max(radius, (part.centre - centre).norm() + part.radius);
}

/// Computes the cluster of the triangles that a node holds itself, without its children.
void WindingNumbers::computeOwnCluster(const Body& body, OctreeNode node) {
  Cluster& all = m_clusters[node] = {};
  const auto [begin, end] = body.tree.octree().ownRange(node);
  const Positions& now = body.mesh.now;
  for (const bool measuresRadius : {false, true})
    for (std::uint32_t i = begin; i < end; ++i) {
      const auto& [ia, ib, ic] = body.tree.ordered()[i];
      const Vector3d a = now[ia], b = now[ib], c = now[ic], u = b - a, v = c - a;
      if (measuresRadius) {
        for (const Vector3d& corner : {a, b, c})
          all.radius = std::max(all.radius, (corner - all.centre).norm());
        continue;
      }
      Cluster one;
      one.centre = a + (u + v) / 3;
      one.normal = 0.5 * u.cross(v);
      one.area = one.normal.norm();
      all.add(one);
    }
}

void WindingNumbers::update(const Body& body, const Threads& threads) {
  PALPATE_ASSERT(body.tree.isValid() && body.tree.octree().isBuilt());
  const PositionsState now = body.mesh.now.state();
  if (m_clustersVersion.isCurrent(now) && m_treeUpdates == body.tree.updates()) return;
  m_clustersVersion.invalidate();
  const Octree& octree = body.tree.octree();
  const std::size_t blocks = octree.pool().used();
  m_clusters.resize(kChildren * blocks);
  threads.forChunks(blocks, kBlocksPerPart, [&](std::size_t, std::size_t from, std::size_t to) {
    for (auto node = static_cast<OctreeNode>(kChildren * from); node < kChildren * to; ++node)
      if (octree.isEmpty(node))
        m_clusters[node] = {};
      else
        computeOwnCluster(body, node);
  });
  // Children come after their parents, so that this order completes the children first.
  for (std::size_t block = blocks; block-- > 1;) {
    Cluster& parent = m_clusters[octree.parent(block)];
    Cluster own = parent;
    const std::span children = std::span(m_clusters).subspan(kChildren * block, kChildren);
    for (const Cluster& child : children) parent.add(child);
    parent.radius = 0;
    if (own.radius > 0) parent.enclose(own);
    for (const Cluster& child : children)
      if (child.radius > 0) parent.enclose(child);
  }
  m_magnitude = m_clusters[0].centre.cwiseAbs().maxCoeff() + m_clusters[0].radius;
  m_treeUpdates = body.tree.updates();
  m_clustersVersion.commit(now);
}

SolidAngleShare WindingNumbers::clusterShare(const Cluster& cluster, const Vector3d& p,
                                             double distance) const {
  const Vector3d from = cluster.centre - p;
  const double square = distance * distance, cube = square * distance,
               nearest = distance - cluster.radius, squareOfNearest = nearest * nearest;
  const double angle = cluster.normal.dot(from) / cube + cluster.spread.trace() / cube -
                       3 * from.dot(cluster.spread * from) / (cube * square);
  const double remainder =
      3 * cluster.radius * cluster.radius / (squareOfNearest * squareOfNearest);
  const double rounding = kClusterError * (1 + m_magnitude / nearest) / squareOfNearest;
  constexpr double kSphere = 4 * std::numbers::pi;
  return {angle / kSphere, cluster.area * (remainder + rounding) / kSphere};
}

static SolidAngleShare sumOfAll(const TriangleMesh& mesh, const Vector3d& p) {
  SolidAngleShare sum;
  const Positions& now = mesh.now;
  mesh.topology.forEachElement([&](std::uint32_t t) {
    const auto& [a, b, c] = mesh.topology.elements[t];
    sum.add(solidAngleShare(p, now[a], now[b], now[c]));
  });
  return sum;
}

/// Clusters that stand for all triangles that were not summed one by one, as a heap by error.
struct WindingNumbers::Front {
  struct Entry {  // without initial values, so that a search does not write unused ones
    double value, error;
    OctreeNode node;
    friend bool operator<(const Entry& l, const Entry& r) { return l.error < r.error; }
  };
  std::array<Entry, kMostClusters> all;
  std::size_t size = 0;
  SolidAngleShare sum;  ///< updated with each change, and therefore rounded

  bool hasRoom() const { return size + kChildren * kMaxLevels <= all.size(); }
  void push(OctreeNode, const SolidAngleShare&);
  OctreeNode popLargestError();
  SolidAngleShare exactSum() const;
};

void WindingNumbers::Front::push(OctreeNode node, const SolidAngleShare& share) {
  PALPATE_ASSERT(size < all.size());
  all[size++] = {share.value, share.error, node};
  std::push_heap(all.data(), all.data() + size);
  sum.add(share);
}

OctreeNode WindingNumbers::Front::popLargestError() {
  PALPATE_ASSERT(size > 0);
  std::pop_heap(all.data(), all.data() + size--);
  const auto& [value, error, node] = all[size];
  sum.value -= value;
  sum.error -= error;
  return node;
}

SolidAngleShare WindingNumbers::Front::exactSum() const {
  SolidAngleShare exact;
  for (std::size_t i = 0; i < size; ++i) exact.add({all[i].value, all[i].error});
  return exact;
}

template <class F>
std::optional<SolidAngleShare> WindingNumbers::sumOfClusters(const Body& body, const Vector3d& p,
                                                             F&& isEnough) const {
  const Octree& octree = body.tree.octree();
  const Positions& now = body.mesh.now;
  const double slack = kWindingSlack * static_cast<double>(octree.size());
  Front front;
  SolidAngleShare near;
  // Sums what the node holds itself, and adds its children to the front, or opens them if the
  // point is among their triangles.
  const auto open = [&](auto& self, OctreeNode node) -> void {
    const auto [begin, end] = octree.ownRange(node);
    for (std::uint32_t i = begin; i < end; ++i) {
      const auto& [a, b, c] = body.tree.ordered()[i];
      near.add(solidAngleShare(p, now[a], now[b], now[c]));
    }
    const OctreeNode children = octree.firstChild(node);
    for (unsigned slot = 0; children != 0 && slot < kChildren; ++slot) {
      const OctreeNode child = children + slot;
      if (octree.isEmpty(child)) continue;
      const Cluster& cluster = m_clusters[child];
      const double distance = (cluster.centre - p).norm();
      if (distance > kFarRadii * cluster.radius)
        front.push(child, clusterShare(cluster, p, distance));
      else
        self(self, child);
    }
  };
  for (open(open, 0); front.hasRoom(); open(open, front.popLargestError())) {
    // The error bound encloses the sum over all triangles, within its own error bound.
    const auto sumWith = [&](const SolidAngleShare& far) {
      return SolidAngleShare{far.value + near.value, far.error + 2 * near.error + slack};
    };
    if (front.size == 0 || isEnough(sumWith(front.sum)))
      if (const SolidAngleShare sum = sumWith(front.exactSum()); isEnough(sum)) return sum;
    if (front.size == 0) break;
  }
  return {};
}

template <class F>
SolidAngleShare WindingNumbers::sum(const Body& body, const Vector3d& p, bool bruteForce,
                                    F&& isEnough) const {
  if (!bruteForce)
    if (const auto found = sumOfClusters(body, p, isEnough)) return *found;
  return sumOfAll(body.mesh, p);
}

WindingNumbers::Result WindingNumbers::evaluate(const Body& body, const Vector3d& p, double margin,
                                                bool bruteForce) const {
  PALPATE_ASSERT(bruteForce || m_clustersVersion.isCurrent(body.mesh.now.state()));
  return decide(sum(body, p, bruteForce,
                    [&](const SolidAngleShare& found) { return decide(found, margin).decided; }),
                margin);
}

SolidAngleShare WindingNumbers::value(const Body& body, const Vector3d& p, double error) const {
  PALPATE_ASSERT(m_clustersVersion.isCurrent(body.mesh.now.state()));
  PALPATE_ASSERT(error > 0.0);
  return sum(body, p, false, [&](const SolidAngleShare& found) { return found.error <= error; });
}

}  // namespace palpate
