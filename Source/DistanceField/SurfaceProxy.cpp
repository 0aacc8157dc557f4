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

/// Levels of the octree down to cells.
constexpr int kFewestLevels = 5, kMostLevels = 9;
/// Sizes of nodes, in units.
constexpr std::uint32_t kCell = 4, kBrick = 16;
/// Most nodes below cells that are expected: a number, or as many as twice the triangles. It bounds
/// memory and time where planes are rare.
constexpr std::size_t kMostSmall = std::size_t{1} << 15, kSmallPerTriangle = 2;
/// Cells without a plane that one task divides.
constexpr std::size_t kCellsPerTask = 64;
/// Nodes down to this level are visited level by level, the others below each of them in one task.
constexpr int kSharedLevels = 3;
/// Edge of a cell in mean edges of the mesh, at most.
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
  std::array<std::uint32_t, 3> lower;  ///< in units
  std::uint32_t size;                  ///< in units
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
  std::vector<SurfaceProxy::Listed> triangles;
  std::vector<std::array<std::uint32_t, 64>> blocks;
  std::vector<Entry> entries;
  /// A cell without a plane, and the triangles that may be nearest to its points.
  struct Open {
    Node node;
    std::size_t block;  ///< of the cell's brick
    std::vector<std::uint32_t> triangles;
  };
  std::vector<Open> open;
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
    if (m_out.m_units == 0) return;
    makeItems();
    struct Visited {
      Node node;
      std::vector<Item> items;
    };
    std::vector<Visited> level;
    level.push_back({{{0, 0, 0}, m_out.m_units}, m_items});
    std::vector<Part> parts(1);
    for (int depth = 1; depth <= kSharedLevels; ++depth) {
      std::vector<Visited> next(8 * level.size());
      std::vector<Part> found(next.size());
      threads.forEach(next.size(), [&](std::size_t i) {
        const Visited& parent = level[i / 8];
        next[i].node = parent.node.child(i % 8);
        std::vector<Shadow> shadows;
        if (!isDivided(next[i].node, parent.items, next[i].items, shadows, found[i]))
          next[i].items.clear();
      });
      for (Part& part : found) parts.push_back(std::move(part));
      std::erase_if(next, [](const Visited& visited) { return visited.items.empty(); });
      level = std::move(next);
    }
    const std::size_t first = parts.size();
    parts.resize(first + level.size());
    threads.forEach(level.size(), [&](std::size_t i) {
      Scratch scratch;
      divide(level[i].node, level[i].items, parts[first + i], scratch);
    });
    assemble(parts);
    divideCells(parts, threads);
  }

 private:
  /// A triangle about a node's centre: two coordinates along a plane, and the height.
  struct Shadow {
    std::array<Vector3d, 3> corners;
    Vector3d low, high;
  };

  /// Of one task.
  struct Scratch {
    std::array<std::vector<Item>, kMostLevels + 3> kept;  ///< by the size of the parent
    std::vector<Shadow> shadows;
  };

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
    m_out.m_units = kCell << levels;
    m_out.m_unit = std::ldexp(extent, -levels) / kCell;
    m_out.m_lower = 0.5 * (lower + upper) - Vector3d::Constant(0.5 * extent);
    m_out.m_magnitude = std::max(m_out.m_lower.cwiseAbs().maxCoeff(),
                                 (m_out.m_lower.array() + extent).abs().maxCoeff());
    m_rounding = kProxyRounding * m_out.m_magnitude;
  }

  void makeItems() {
    m_normals.resize(m_topology.triangles.size());
    m_itemOf.resize(m_topology.triangles.size());
    for (std::uint32_t t = 0; t < m_topology.triangles.size(); ++t) {
      if (!m_topology.isEnabled(t)) continue;
      const auto& [i, j, k] = m_topology.triangles[t];
      const Vector3d &a = m_positions[i], &b = m_positions[j], &c = m_positions[k];
      const Vector3d centre = (a + b + c) / 3.0;
      const double square = std::max(
          {(a - centre).squaredNorm(), (b - centre).squaredNorm(), (c - centre).squaredNorm()});
      const double radius = std::sqrt(square) * (1.0 + kProxySlack) + m_rounding;
      m_itemOf[t] = static_cast<std::uint32_t>(m_items.size());
      m_items.push_back({centre[0], centre[1], centre[2], radius, t});
      m_normals[t] = (b - a).cross(c - a);
    }
  }

  Vector3d centreOf(const Node& node) const {
    const double half = 0.5 * node.size;
    return m_out.m_lower + m_out.m_unit * Vector3d(node.lower[0] + half, node.lower[1] + half,
                                                   node.lower[2] + half);
  }
  /// L: half the diagonal of a node, and what rounding adds when a point's cell is found.
  double halfDiagonalOf(const Node& node) const {
    return 0.5 * std::sqrt(3.0) * node.size * m_out.m_unit * (1.0 + kProxySlack) + m_rounding;
  }

  /// Visits a node. Keeps those items of the parent that may be nearest to a point of the node.
  /// Returns whether the node must be divided: it is near, and no plane stands for its surface.
  bool isDivided(const Node& node, std::span<const Item> items, std::vector<Item>& kept,
                 std::vector<Shadow>& shadows, Part& out) {
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
    const Vector3d at(nearest->x, nearest->y, nearest->z);
    if (!findPlane({kept, centre, halfDiagonal, limit, at}, node, leaf, shadows)) return true;
    addLeaf(node, leaf, out);
    return false;
  }

  void divide(const Node& node, std::span<const Item> items, Part& out, Scratch& scratch) {
    if (node.size == kCell) {
      Part::Open& open = out.open.emplace_back();
      open.node = node;
      open.block = out.blocks.size() - 1;
      for (const Item& item : items) open.triangles.push_back(item.triangle);
      return;
    }
    if (node.size == kBrick) {
      out.entries.push_back(
          {brickOf(node), 1, static_cast<std::uint32_t>(out.blocks.size()), true});
      out.blocks.emplace_back().fill(SurfaceProxy::kNoLeaf);
    }
    std::vector<Item>& kept = scratch.kept[std::size_t(std::countr_zero(node.size))];
    for (std::uint32_t i = 0; i < 8; ++i)
      if (isDivided(node.child(i), items, kept, scratch.shadows, out))
        divide(node.child(i), kept, out, scratch);
  }

  /// Divides cells without a plane up to twice. What remains without a plane gets a list.
  void divideCells(std::span<const Part> parts, const Threads& threads) {
    std::vector<const Part::Open*> cells;
    std::vector<std::uint32_t*> entries;
    std::size_t firstBlock = 0;
    for (const Part& part : parts) {
      for (const Part::Open& open : part.open) {
        cells.push_back(&open);
        const auto& [x, y, z] = open.node.lower;
        const std::uint32_t cell = (z / kCell % 4 * 4 + y / kCell % 4) * 4 + x / kCell % 4;
        entries.push_back(&m_out.m_blocks[firstBlock + open.block][cell]);
      }
      firstBlock += part.blocks.size();
    }
    // About a quarter of the nodes that are divided once needs it again.
    const std::size_t most = std::max(kMostSmall, kSmallPerTriangle * m_items.size());
    const std::uint32_t smallest = 8 * cells.size() > most    ? kCell
                                   : 16 * cells.size() > most ? kCell / 2
                                                              : 1;
    std::vector<Part> found((cells.size() + kCellsPerTask - 1) / kCellsPerTask);
    threads.forChunks(cells.size(), kCellsPerTask,
                      [&](std::size_t chunk, std::size_t begin, std::size_t end) {
                        Scratch scratch;
                        std::vector<Item> items;
                        for (std::size_t i = begin; i < end; ++i) {
                          items.clear();
                          for (const std::uint32_t t : cells[i]->triangles)
                            items.push_back(m_items[m_itemOf[t]]);
                          found[chunk].blocks.emplace_back().fill(SurfaceProxy::kNoLeaf);
                          divideCell(cells[i]->node, items, smallest, found[chunk], scratch);
                        }
                      });
    // join() moves the blocks, so that their entries are written first.
    auto next = static_cast<std::uint32_t>(m_out.m_blocks.size());
    for (std::uint32_t* entry : entries) *entry = SurfaceProxy::kBlock | next++;
    for (Part& part : found) join(part);
  }

  void divideCell(const Node& node, std::span<const Item> items, std::uint32_t smallest, Part& out,
                  Scratch& scratch) {
    if (node.size == smallest) return addSmallest(node, items, out, scratch.shadows);
    std::vector<Item>& kept = scratch.kept[std::size_t(std::countr_zero(node.size))];
    for (std::uint32_t i = 0; i < 8; ++i)
      if (isDivided(node.child(i), items, kept, scratch.shadows, out))
        divideCell(node.child(i), kept, smallest, out, scratch);
  }

  /// A leaf of the smallest size, after exact distances have been found: the plane of fewer
  /// triangles, or the list of triangles.
  void addSmallest(const Node& node, std::span<const Item> items, Part& out,
                   std::vector<Shadow>& shadows) {
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
    if (!findPlane({kept, centre, halfDiagonal, limit, nearest}, node, leaf, shadows)) {
      count(kept.size(), m_listed, SurfaceProxy::kMostListed);
      leaf.firstTriangle = static_cast<std::uint32_t>(out.triangles.size());
      leaf.triangleCount = static_cast<std::uint32_t>(kept.size());
      for (const Item& item : kept) out.triangles.push_back(listed(item.triangle));
    }
    addLeaf(node, leaf, out);
  }

  /// What is known when a plane is looked for.
  struct Surroundings {
    std::span<const Item> items;  ///< all triangles within `reach` of the centre, or more
    Vector3d centre;              ///< of the node
    double halfDiagonal;          ///< L, of the node
    double reach;                 ///< L: |centre - nearest| + 2 halfDiagonal, at least
    Vector3d nearest;             ///< a surface point
  };

  /// The mean normal near the nearest point; zero if the normals there are not within the cone.
  Vector3d normalNear(const Surroundings& around) const {
    const auto isNear = [&](const Item& item) {
      const double reach = around.halfDiagonal + item.radius;
      return item.squareFrom(around.nearest) <= reach * reach;
    };
    const Vector3d* first = nullptr;
    const double widest = 2.0 * m_cosine * m_cosine - 1.0;  // of twice the angle
    Vector3d sum = Vector3d::Zero();
    for (const Item& item : around.items) {
      if (!isNear(item)) continue;
      const Vector3d& normal = m_normals[item.triangle];
      if (!first) first = &normal;
      const double along = first->dot(normal);
      if (widest > 0.0 &&
          !(along > 0.0 &&
            along * along >= 0.99 * widest * widest * first->squaredNorm() * normal.squaredNorm()))
        return Vector3d::Zero();
      sum += normal;
    }
    const double length = sum.norm();
    return length > 0.0 ? Vector3d(sum / length) : Vector3d::Zero();
  }

  bool isInCone(std::uint32_t triangle, const Vector3d& normal) const {
    const Vector3d& of = m_normals[triangle];
    const double along = normal.dot(of), least = m_cosine * (1.0 + kProxySlack);
    if (!(along > 0.0 && along * along >= least * least * of.squaredNorm())) return false;
    const Triangle& corners = m_topology.triangles[triangle];
    return std::all_of(corners.begin(), corners.end(),
                       [&](std::uint32_t v) { return m_topology.hasClosedStar[v] != 0; });
  }

  /// Finds a plane that stands for the surface in a node, and proves its error
  /// (Docs/SurfaceProxies.md).
  bool findPlane(const Surroundings& around, const Node& node, SurfaceProxy::Leaf& leaf,
                 std::vector<Shadow>& shadows) const {
    const Vector3d normal = normalNear(around);
    if (normal.isZero(0.0)) return false;
    int least = 0;
    normal.cwiseAbs().minCoeff(&least);
    const Vector3d u = normal.cross(Vector3d::Unit(least)).normalized(), v = normal.cross(u);
    shadows.clear();
    for (const Item& item : around.items) {
      Shadow& shadow = shadows.emplace_back();
      for (int i = 0; i < 3; ++i) {
        const Vector3d p = m_positions[m_topology.triangles[item.triangle][i]] - around.centre;
        shadow.corners[i] = {u.dot(p), v.dot(p), normal.dot(p)};
      }
      const auto& [a, b, c] = shadow.corners;
      shadow.low = a.cwiseMin(b).cwiseMin(c);
      shadow.high = a.cwiseMax(b).cwiseMax(c);
    }
    const double half = 0.5 * node.size * m_out.m_unit;
    const auto extentAlong = [&](const Vector3d& axis) {
      return half * axis.cwiseAbs().sum() * (1.0 + kProxySlack) + m_rounding;
    };
    const Vector3d footprint(extentAlong(u), extentAlong(v), extentAlong(normal));
    const Vector3d toNearest = around.nearest - around.centre;
    const Vector3d nearest(u.dot(toNearest), v.dot(toNearest), normal.dot(toNearest));
    for (const double margin : {0.125, 0.5, 1.0}) {
      const double more = margin * half;
      const std::array<double, 2> window{footprint[0] + more, footprint[1] + more};
      double low = std::numeric_limits<double>::infinity(), high = -low;
      for (std::size_t i = 0; i < shadows.size(); ++i) {
        const Shadow& shadow = shadows[i];
        if (shadow.high[0] < -window[0] || shadow.low[0] > window[0] ||
            shadow.high[1] < -window[1] || shadow.low[1] > window[1])
          continue;
        if (!addHeights(shadow, window, low, high)) continue;
        if (!isInCone(around.items[i].triangle, normal)) return false;
        if (high - low > 2.0 * m_settings.allowedError) return false;
      }
      if (!(low <= high)) return false;
      const double middle = 0.5 * low + 0.5 * high,
                   error = (0.5 * high - 0.5 * low) * (1.0 + kProxySlack) + m_rounding;
      if (!(error <= m_settings.allowedError)) return false;
      const double height = std::abs(middle) + error,
                   corner =
                       std::sqrt(height * height + window[0] * window[0] + window[1] * window[1]);
      if (!(corner * (1.0 + kProxySlack) + m_rounding <= around.reach)) return false;
      if (!(std::abs(nearest[0]) + m_rounding <= window[0] &&
            std::abs(nearest[1]) + m_rounding <= window[1]))
        continue;
      if (!isNearestInside(shadows, footprint, more, middle, error)) continue;
      leaf.normal = {normal[0], normal[1], normal[2]};
      leaf.offset = normal.dot(around.centre) + middle;
      leaf.error = error;
      return true;
    }
    return false;
  }

  /// Whether points of the node have no surface outside the window that is nearer to them than the
  /// plane less the error. more: L, by which the window exceeds the footprint. middle: the plane's
  /// height above the centre.
  bool isNearestInside(std::span<const Shadow> shadows, const Vector3d& footprint, double more,
                       double middle, double error) const {
    const double front = footprint[2] - middle, back = footprint[2] + middle;
    const auto isFar = [&](double lateral, double side, double height) {
      if (!(side > error && height > error)) return true;
      const double most = std::min(height, side);
      const double square = (most - error) * (2.0 * side - most - error);
      return lateral * lateral >= square * (1.0 + kProxySlack);
    };
    for (const Shadow& shadow : shadows) {
      const double high = shadow.high[2] - middle + m_rounding,
                   low = shadow.low[2] - middle - m_rounding;
      if (!(high > error || low < -error)) continue;
      double square = 0;
      for (int k = 0; k < 2; ++k) {
        const double gap =
            std::max({0.0, shadow.low[k] - footprint[k], -footprint[k] - shadow.high[k]});
        square += gap * gap;
      }
      const double lateral = std::max(more, std::sqrt(square)) * (1.0 - kProxySlack) - m_rounding;
      if (!(lateral > 0.0)) return false;
      if (!isFar(lateral, front, high) || !isFar(lateral, back, -low)) return false;
    }
    return true;
  }

  /// Extends [low, high] by the heights of a triangle's part in the window. Returns whether there
  /// is such a part.
  static bool addHeights(const Shadow& shadow, const std::array<double, 2>& window, double& low,
                         double& high) {
    std::array<Vector3d, 8> polygon, next;
    std::copy(shadow.corners.begin(), shadow.corners.end(), polygon.begin());
    std::size_t size = 3;
    for (int k = 0; k < 2; ++k)
      for (const double sign : {1.0, -1.0}) {
        if (sign > 0 ? shadow.high[k] <= window[k] : shadow.low[k] >= -window[k]) continue;
        std::size_t count = 0;
        for (std::size_t i = 0; i < size; ++i) {
          const Vector3d &p = polygon[i], &q = polygon[(i + 1) % size];
          const double fromP = window[k] - sign * p[k], fromQ = window[k] - sign * q[k];
          if (fromP >= 0.0) next[count++] = p;
          if ((fromP < 0.0) != (fromQ < 0.0) && fromP != fromQ)
            next[count++] = p + fromP / (fromP - fromQ) * (q - p);
        }
        polygon = next;
        size = count;
        if (size == 0) return false;
      }
    for (std::size_t i = 0; i < size; ++i) {
      low = std::min(low, polygon[i][2]);
      high = std::max(high, polygon[i][2]);
    }
    return true;
  }

  static std::array<std::uint32_t, 3> brickOf(const Node& node) {
    return {node.lower[0] / kBrick, node.lower[1] / kBrick, node.lower[2] / kBrick};
  }

  /// Writes a leaf and its entries. Those of leaves below a brick are in the last block: of the
  /// brick or, while cells are divided, of the cell.
  void addLeaf(const Node& node, SurfaceProxy::Leaf& leaf, Part& out) const {
    for (int k = 0; k < 3; ++k) leaf.lower[k] = static_cast<std::uint16_t>(node.lower[k]);
    leaf.size = static_cast<std::uint16_t>(node.size);
    const auto index = static_cast<std::uint32_t>(out.leaves.size());
    out.leaves.push_back(leaf);
    if (node.size >= kBrick) {
      out.entries.push_back({brickOf(node), node.size / kBrick, index, false});
      return;
    }
    const std::uint32_t step = m_dividesCells ? 1 : kCell, size = node.size / step;
    const std::array<std::uint32_t, 3> at{node.lower[0] / step % 4, node.lower[1] / step % 4,
                                          node.lower[2] / step % 4};
    for (std::uint32_t z = at[2]; z < at[2] + size; ++z)
      for (std::uint32_t y = at[1]; y < at[1] + size; ++y)
        for (std::uint32_t x = at[0]; x < at[0] + size; ++x)
          out.blocks.back()[(z * 4 + y) * 4 + x] = index;
  }

  SurfaceProxy::Listed listed(std::uint32_t triangle) const {
    const auto& [i, j, k] = m_topology.triangles[triangle];
    const Vector3d &a = m_positions[i], &b = m_positions[j], &c = m_positions[k];
    const Eigen::Vector3f rounded = ((a + b + c) / 3.0).cast<float>();
    const Vector3d centre = rounded.cast<double>();
    const double radius = std::max({(a - centre).norm(), (b - centre).norm(), (c - centre).norm()});
    const auto outward = static_cast<float>(radius * (1.0 + 0x1p-20) + m_rounding);
    return {rounded[0], rounded[1], rounded[2],
            std::nextafter(outward, std::numeric_limits<float>::infinity()), triangle};
  }

  void count(std::size_t size, std::atomic<std::uint64_t>& total, std::uint64_t most) const {
    if (total.fetch_add(size, std::memory_order_relaxed) + size > most)
      throw Error(ErrorCode::TooLarge,
                  "the leaves of a surface proxy need too much memory or time: the thickness and "
                  "the radii are too large for the body");
  }

  /// Appends leaves, lists and blocks. Returns the indices of the part's first leaf and block.
  std::array<std::uint32_t, 2> join(Part& part) {
    const auto firstLeaf = static_cast<std::uint32_t>(m_out.m_leaves.size()),
               firstTriangle = static_cast<std::uint32_t>(m_out.m_triangles.size()),
               firstBlock = static_cast<std::uint32_t>(m_out.m_blocks.size());
    for (SurfaceProxy::Leaf& leaf : part.leaves) {
      leaf.firstTriangle += firstTriangle;
      m_out.m_leaves.push_back(leaf);
    }
    m_out.m_triangles.insert(m_out.m_triangles.end(), part.triangles.begin(), part.triangles.end());
    for (auto& block : part.blocks) {
      for (std::uint32_t& leaf : block)
        if (leaf != SurfaceProxy::kNoLeaf) leaf += firstLeaf;
      m_out.m_blocks.push_back(block);
    }
    return {firstLeaf, firstBlock};
  }

  void assemble(std::span<Part> parts) {
    const std::uint32_t bricks = m_out.m_units / kBrick;
    m_out.m_bricks.assign(std::size_t{bricks} * bricks * bricks, SurfaceProxy::kNoLeaf);
    for (Part& part : parts) {
      const auto [firstLeaf, firstBlock] = join(part);
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
    m_dividesCells = true;
  }

  const MeshTopology& m_topology;
  const std::span<const Vector3d> m_positions;
  const ProxySettings m_settings;
  const double m_cosine;
  SurfaceProxy& m_out;
  std::vector<Item> m_items;
  std::vector<std::uint32_t> m_itemOf;  ///< per triangle
  bool m_dividesCells = false;
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
  const std::uint32_t bricks = m_units / kBrick;
  std::array<std::uint32_t, 3> at{place.brick % bricks, place.brick / bricks % bricks,
                                  place.brick / (bricks * bricks)};
  for (std::uint32_t k = 0; k < 3; ++k)
    at[k] = at[k] * kBrick + (place.cell >> 2 * k & 3) * kCell + (place.cell >> (6 + 2 * k) & 3);
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
         m_leaves.capacity() * sizeof(Leaf) + m_triangles.capacity() * sizeof(Listed);
}

}  // namespace palpate
