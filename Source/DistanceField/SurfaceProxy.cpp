#include "DistanceField/SurfaceProxy.h"

#include <palpate/Error.h>

#include "Math/ClosestPoint.h"
#include "Math/Tolerances.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>
#include <limits>

namespace palpate {

using Eigen::Vector3d;

namespace {

/// Levels of the octree. The cells of a brick are two levels deep.
constexpr int kFewestLevels = 6, kMostLevels = 9, kBrickLevels = 2;
/// Nodes down to this level are visited level by level, the others below each of them in one task.
constexpr int kSharedLevels = 3;
/// Edge of the smallest leaf in mean edges of the mesh, at most.
constexpr double kLargestCell = 1.5;
/// L. Squares of lengths in this range neither overflow nor lose bits.
constexpr double kLargestExtent = 0x1p400, kSmallestExtent = 0x1p-400;

/// A triangle with a sphere around it whose centre is a point of the triangle.
struct Item {
  double x, y, z, radius;
  std::uint32_t triangle;
  double squareFrom(const Vector3d& p) const {
    const double dx = x - p[0], dy = y - p[1], dz = z - p[2];
    return dx * dx + dy * dy + dz * dz;
  }
};

struct Node {
  std::array<std::uint32_t, 3> lower;  ///< in cells
  std::uint32_t size;                  ///< in cells
  Node child(std::uint32_t i) const {
    const std::uint32_t half = size / 2;
    return {{lower[0] + (i & 1) * half, lower[1] + (i >> 1 & 1) * half, lower[2] + (i >> 2) * half},
            half};
  }
};

/// What one task makes. Indices are those of the part.
struct Part {
  struct Entry {
    std::array<std::uint32_t, 3> lower;  ///< in bricks
    std::uint32_t size;                  ///< in bricks
    std::uint32_t value;
    bool isBlock;
  };
  std::vector<SurfaceProxy::Leaf> leaves;
  std::vector<std::uint32_t> triangles;
  std::vector<std::array<std::uint32_t, 64>> blocks;
  std::vector<Entry> entries;
};

}  // namespace

class SurfaceProxyBuilder {
 public:
  SurfaceProxyBuilder(const TriangleMesh& body, const ProxySettings& settings, SurfaceProxy& out)
      : m_topology(body.topology),
        m_positions(body.now.body()),
        m_settings(settings),
        m_cosine(std::cos(settings.normalCone)),
        m_out(out) {}

  void build(const Threads& threads) {
    placeCells();
    if (m_out.m_cells == 0) return;
    makeItems();
    struct Visited {
      Node node;
      std::vector<Item> items;
    };
    std::vector<Visited> level;
    level.push_back({{{0, 0, 0}, m_out.m_cells}, std::move(m_items)});
    std::vector<Part> parts(1);
    for (int depth = 1; depth <= kSharedLevels; ++depth) {
      std::vector<Visited> next(8 * level.size());
      std::vector<Part> found(next.size());
      threads.forEach(next.size(), [&](std::size_t i) {
        const Visited& parent = level[i / 8];
        next[i].node = parent.node.child(i % 8);
        if (!isDivided(next[i].node, parent.items, next[i].items, found[i])) next[i].items.clear();
      });
      for (Part& part : found) parts.push_back(std::move(part));
      std::erase_if(next, [](const Visited& visited) { return visited.items.empty(); });
      level = std::move(next);
    }
    const std::size_t first = parts.size();
    parts.resize(first + level.size());
    threads.forEach(level.size(), [&](std::size_t i) {
      std::vector<std::vector<Item>> scratch(kMostLevels + 1);
      divide(level[i].node, level[i].items, parts[first + i], scratch);
    });
    assemble(parts);
  }

 private:
  void placeCells() {
    Vector3d lower = Vector3d::Constant(std::numeric_limits<double>::infinity()), upper = -lower;
    double lengths = 0;
    std::size_t count = 0;
    m_out.m_isClosed = true;
    for (std::uint32_t t = 0; t < m_topology.triangles.size(); ++t) {
      if (!m_topology.isEnabled(t)) continue;
      const Triangle& corners = m_topology.triangles[t];
      for (int i = 0; i < 3; ++i) {
        const Vector3d &p = m_positions[corners[i]], &q = m_positions[corners[(i + 1) % 3]];
        lower = lower.cwiseMin(p);
        upper = upper.cwiseMax(p);
        lengths += (q - p).norm();
        m_out.m_isClosed &= m_topology.hasClosedStar[corners[i]] != 0;
      }
      ++count;
    }
    if (count == 0) return;
    const double edge = lengths / (3.0 * static_cast<double>(count));
    double extent = (upper - lower).maxCoeff() + 2.0 * m_settings.reach;
    if (!(extent <= kLargestExtent && extent >= kSmallestExtent))
      throw Error(ErrorCode::TooLarge,
                  "the extent of a body with a surface proxy must be from 2^-400 to 2^400");
    int levels = kFewestLevels;
    while (levels < kMostLevels && std::ldexp(extent, -levels) > kLargestCell * edge) ++levels;
    m_out.m_reach = std::max(m_settings.reach, std::ldexp(extent, -levels));
    extent = (upper - lower).maxCoeff() + 2.0 * m_out.m_reach;
    extent += kProxySlack * extent;
    m_out.m_cells = 1u << levels;
    m_out.m_cellSize = std::ldexp(extent, -levels);
    m_out.m_lower = 0.5 * (lower + upper) - Vector3d::Constant(0.5 * extent);
    m_out.m_magnitude = std::max(m_out.m_lower.cwiseAbs().maxCoeff(),
                                 (m_out.m_lower.array() + extent).abs().maxCoeff());
    m_rounding = kProxyRounding * m_out.m_magnitude;
  }

  void makeItems() {
    m_normals.resize(m_topology.triangles.size());
    for (std::uint32_t t = 0; t < m_topology.triangles.size(); ++t) {
      if (!m_topology.isEnabled(t)) continue;
      const auto& [i, j, k] = m_topology.triangles[t];
      const Vector3d &a = m_positions[i], &b = m_positions[j], &c = m_positions[k];
      const Vector3d centre = (a + b + c) / 3.0;
      const double square = std::max(
          {(a - centre).squaredNorm(), (b - centre).squaredNorm(), (c - centre).squaredNorm()});
      const double radius = std::sqrt(square) * (1.0 + kProxySlack) + m_rounding;
      m_items.push_back({centre[0], centre[1], centre[2], radius, t});
      m_normals[t] = (b - a).cross(c - a);
    }
  }

  Vector3d centreOf(const Node& node) const {
    const double half = 0.5 * node.size;
    return m_out.m_lower + m_out.m_cellSize * Vector3d(node.lower[0] + half, node.lower[1] + half,
                                                       node.lower[2] + half);
  }
  /// L: half the diagonal of a node, and what rounding adds when a point's cell is found.
  double halfDiagonalOf(const Node& node) const {
    return 0.5 * std::sqrt(3.0) * node.size * m_out.m_cellSize * (1.0 + kProxySlack) + m_rounding;
  }

  /// Visits a node. Keeps those items of the parent that may be nearest to a point of the node.
  /// Returns whether the node must be divided: it is near, and no plane stands for its surface.
  bool isDivided(const Node& node, std::span<const Item> items, std::vector<Item>& kept,
                 Part& out) {
    count(items.size(), m_work, SurfaceProxy::kMostWork);
    const Vector3d centre = centreOf(node);
    const double halfDiagonal = halfDiagonalOf(node);
    double least = std::numeric_limits<double>::infinity();
    const Item* nearest = nullptr;
    bool isNear = false;
    const double near = m_out.m_reach * (1.0 + kProxySlack) + m_rounding + halfDiagonal;
    for (const Item& item : items) {
      const double square = item.squareFrom(centre), limit = near + item.radius;
      isNear |= square <= limit * limit;
      if (square < least) least = square, nearest = &item;
    }
    kept.clear();
    if (!isNear) return false;
    const double distance = std::sqrt(least) * (1.0 + kProxySlack) + m_rounding,
                 limit = distance + 2.0 * halfDiagonal;
    for (const Item& item : items) {
      const double reach = limit + item.radius;
      if (item.squareFrom(centre) <= reach * reach) kept.push_back(item);
    }
    SurfaceProxy::Leaf leaf{};
    if (!findPlane(kept, centre, halfDiagonal, {nearest->x, nearest->y, nearest->z}, leaf))
      return true;
    addLeaf(node, leaf, out);
    return false;
  }

  void divide(const Node& node, std::span<const Item> items, Part& out,
              std::vector<std::vector<Item>>& scratch) {
    if (node.size == 1) return addSmallest(node, items, out);
    if (node.size == 1u << kBrickLevels) {
      out.entries.push_back(
          {brickOf(node), 1, static_cast<std::uint32_t>(out.blocks.size()), true});
      out.blocks.emplace_back().fill(SurfaceProxy::kNoLeaf);
    }
    std::vector<Item>& kept = scratch[std::size_t(std::countr_zero(node.size))];
    for (std::uint32_t i = 0; i < 8; ++i)
      if (isDivided(node.child(i), items, kept, out)) divide(node.child(i), kept, out, scratch);
  }

  /// A leaf of the smallest size, after exact distances have been found: the plane of fewer
  /// triangles, or the list of triangles.
  void addSmallest(const Node& node, std::span<const Item> items, Part& out) {
    const Vector3d centre = centreOf(node);
    const double halfDiagonal = halfDiagonalOf(node);
    double least = std::numeric_limits<double>::infinity();
    Vector3d nearest = centre;
    std::vector<double> distances;
    for (const Item& item : items) {
      const auto& [i, j, k] = m_topology.triangles[item.triangle];
      const VertexTriangleDistance found =
          finiteVertexTriangleDistance(centre, m_positions[i], m_positions[j], m_positions[k]);
      distances.push_back(found.distance);
      if (found.distance < least) least = found.distance, nearest = centre - found.difference;
    }
    if (!(least <= m_out.m_reach * (1.0 + kProxySlack) + m_rounding + halfDiagonal)) return;
    const double limit = least * (1.0 + kProxySlack) + m_rounding + 2.0 * halfDiagonal;
    std::vector<Item> kept;
    for (std::size_t i = 0; i < items.size(); ++i)
      if (distances[i] <= limit) kept.push_back(items[i]);
    SurfaceProxy::Leaf leaf{};
    if (!findPlane(kept, centre, halfDiagonal, nearest, leaf)) {
      count(kept.size(), m_listed, SurfaceProxy::kMostListed);
      leaf.firstTriangle = static_cast<std::uint32_t>(out.triangles.size());
      leaf.triangleCount = static_cast<std::uint32_t>(kept.size());
      for (const Item& item : kept) out.triangles.push_back(item.triangle);
    }
    addLeaf(node, leaf, out);
  }

  /// Finds a plane that stands for the surface in a node, and proves its error. items: all
  /// triangles within |centre - nearest| + 2 halfDiagonal of the centre. nearest: a surface point.
  bool findPlane(std::span<const Item> items, const Vector3d& centre, double halfDiagonal,
                 const Vector3d& nearest, SurfaceProxy::Leaf& leaf) const {
    Vector3d sum = Vector3d::Zero();
    for (const Item& item : items) sum += m_normals[item.triangle];
    const double length = sum.norm();
    if (!(length > 0.0)) return false;
    const Vector3d normal = sum / length;
    double low = std::numeric_limits<double>::infinity(), high = -low;
    for (const Item& item : items) {
      const Vector3d& of = m_normals[item.triangle];
      const double along = normal.dot(of), least = m_cosine * (1.0 + kProxySlack);
      if (!(along > 0.0 && along * along >= least * least * of.squaredNorm())) return false;
      for (const std::uint32_t v : m_topology.triangles[item.triangle]) {
        if (!m_topology.hasClosedStar[v]) return false;
        const double height = normal.dot(m_positions[v]);
        low = std::min(low, height);
        high = std::max(high, height);
      }
      if (high - low > 2.0 * m_settings.allowedError) return false;
    }
    const double offset = 0.5 * low + 0.5 * high,
                 error = (0.5 * high - 0.5 * low) * (1.0 + kProxySlack) + m_rounding;
    if (!(error <= m_settings.allowedError)) return false;
    const Vector3d difference = nearest - centre;
    const double along = normal.dot(difference),
                 lateral = std::sqrt(std::max(0.0, difference.squaredNorm() - along * along));
    const double footprint = std::max(halfDiagonal, lateral * (1.0 + kProxySlack) + m_rounding);
    if (!(footprint + 3.0 * error <= 2.0 * halfDiagonal)) return false;
    leaf.normal = {normal[0], normal[1], normal[2]};
    leaf.offset = offset;
    leaf.error = error;
    return true;
  }

  static std::array<std::uint32_t, 3> brickOf(const Node& node) {
    return {node.lower[0] >> kBrickLevels, node.lower[1] >> kBrickLevels,
            node.lower[2] >> kBrickLevels};
  }

  static void addLeaf(const Node& node, SurfaceProxy::Leaf& leaf, Part& out) {
    for (int k = 0; k < 3; ++k) leaf.lower[k] = static_cast<std::uint16_t>(node.lower[k]);
    leaf.size = static_cast<std::uint16_t>(node.size);
    const auto index = static_cast<std::uint32_t>(out.leaves.size());
    out.leaves.push_back(leaf);
    if (node.size >= 1u << kBrickLevels) {
      out.entries.push_back({brickOf(node), node.size >> kBrickLevels, index, false});
      return;
    }
    const std::array<std::uint32_t, 3> at{node.lower[0] & 3, node.lower[1] & 3, node.lower[2] & 3};
    for (std::uint32_t z = at[2]; z < at[2] + node.size; ++z)
      for (std::uint32_t y = at[1]; y < at[1] + node.size; ++y)
        for (std::uint32_t x = at[0]; x < at[0] + node.size; ++x)
          out.blocks.back()[(z * 4 + y) * 4 + x] = index;
  }

  void count(std::size_t size, std::atomic<std::uint64_t>& total, std::uint64_t most) const {
    if (total.fetch_add(size, std::memory_order_relaxed) + size > most)
      throw Error(ErrorCode::TooLarge,
                  "the leaves of a surface proxy need too much memory or time: the thickness and "
                  "the radii are too large for the body");
  }

  void assemble(std::span<Part> parts) {
    const std::uint32_t bricks = m_out.m_cells >> kBrickLevels;
    m_out.m_bricks.assign(std::size_t{bricks} * bricks * bricks, SurfaceProxy::kNoLeaf);
    std::size_t leaves = 0, triangles = 0, blocks = 0;
    for (const Part& part : parts) {
      leaves += part.leaves.size();
      triangles += part.triangles.size();
      blocks += part.blocks.size();
    }
    m_out.m_leaves.reserve(leaves);
    m_out.m_triangles.reserve(triangles);
    m_out.m_blocks.reserve(blocks);
    for (Part& part : parts) {
      const auto firstLeaf = static_cast<std::uint32_t>(m_out.m_leaves.size()),
                 firstTriangle = static_cast<std::uint32_t>(m_out.m_triangles.size()),
                 firstBlock = static_cast<std::uint32_t>(m_out.m_blocks.size());
      for (SurfaceProxy::Leaf& leaf : part.leaves) {
        leaf.firstTriangle += firstTriangle;
        m_out.m_leaves.push_back(leaf);
      }
      m_out.m_triangles.insert(m_out.m_triangles.end(), part.triangles.begin(),
                               part.triangles.end());
      for (auto& block : part.blocks) {
        for (std::uint32_t& leaf : block)
          if (leaf != SurfaceProxy::kNoLeaf) leaf += firstLeaf;
        m_out.m_blocks.push_back(block);
      }
      for (const Part::Entry& entry : part.entries) {
        const std::uint32_t value = entry.isBlock
                                        ? SurfaceProxy::kBlock | (entry.value + firstBlock)
                                        : entry.value + firstLeaf;
        const auto& [x0, y0, z0] = entry.lower;
        for (std::uint32_t z = z0; z < z0 + entry.size; ++z)
          for (std::uint32_t y = y0; y < y0 + entry.size; ++y)
            for (std::uint32_t x = x0; x < x0 + entry.size; ++x)
              m_out.m_bricks[(std::size_t{z} * bricks + y) * bricks + x] = value;
      }
    }
  }

  const MeshTopology& m_topology;
  const std::span<const Vector3d> m_positions;
  const ProxySettings m_settings;
  const double m_cosine;
  SurfaceProxy& m_out;
  std::vector<Item> m_items;
  std::vector<Vector3d> m_normals;  ///< per triangle, with twice its area as length
  double m_rounding = 0;            ///< L
  mutable std::atomic<std::uint64_t> m_work = 0, m_listed = 0;
};

SurfaceProxy::SurfaceProxy(const TriangleMesh& body, const ProxySettings& settings,
                           const Threads& threads)
    : m_reach(settings.reach) {
  SurfaceProxyBuilder(body, settings, *this).build(threads);
}

std::uint32_t SurfaceProxy::leafAtByBruteForce(const ProxyPlace& place) const {
  if (place.brick == ProxyPlace::kOutside) return kNoLeaf;
  const std::uint32_t bricks = m_cells >> kBrickLevels;
  const std::array<std::uint32_t, 3> at{(place.brick % bricks) * 4 + (place.cell & 3),
                                        (place.brick / bricks % bricks) * 4 + (place.cell >> 2 & 3),
                                        place.brick / (bricks * bricks) * 4 + (place.cell >> 4)};
  for (std::uint32_t i = 0; i < m_leaves.size(); ++i) {
    bool holds = true;
    for (int k = 0; k < 3; ++k)
      holds &= at[k] >= m_leaves[i].lower[k] && at[k] - m_leaves[i].lower[k] < m_leaves[i].size;
    if (holds) return i;
  }
  return kNoLeaf;
}

std::size_t SurfaceProxy::bytes() const {
  return m_bricks.capacity() * sizeof(std::uint32_t) + m_blocks.capacity() * sizeof(Block) +
         m_leaves.capacity() * sizeof(Leaf) + m_triangles.capacity() * sizeof(std::uint32_t);
}

}  // namespace palpate
