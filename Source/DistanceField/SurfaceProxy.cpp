#include "DistanceField/SurfaceProxy.h"

#include <palpate/Error.h>

#include "DistanceField/ProxyPlane.h"
#include "Math/ClosestPoint.h"
#include "Math/Tolerances.h"
#include "Core/Assert.h"
#include "Core/FloatingPoint.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

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
/// Memory of a ProxyItem, in that of an entry of a list.
constexpr std::uint64_t kListedPerItem = 3;
constexpr const char* kInLists = "entries in lists of triangles";
/// Edge of a cell in mean edges of the mesh, at most.
constexpr double kLargestCell = 1.5;
/// L. Squares of lengths in this range neither overflow nor lose bits.
constexpr double kLargestExtent = 0x1p400, kSmallestExtent = 0x1p-400;

struct Node {
  std::array<std::uint32_t, 3> lower;  ///< in units
  std::uint32_t size;                  ///< in units
  Node child(std::uint32_t i) const {
    const std::uint32_t half = size / 2;
    return {{lower[0] + (i & 1) * half, lower[1] + (i >> 1 & 1) * half, lower[2] + (i >> 2) * half},
            half};
  }
  std::array<std::uint32_t, 3> brick() const {
    return {lower[0] / kBrick, lower[1] / kBrick, lower[2] / kBrick};
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
  /// A cell without a plane, and the triangles that may be nearest to its points.
  struct Open {
    Node node;
    std::size_t block;  ///< of the cell's brick
    CountedVector<std::uint32_t> triangles;
  };
  std::uint32_t step = kCell;  ///< units of an entry of the blocks
  SurfaceProxy::Lists lists{};
  CountedVector<Entry> entries{};
  CountedVector<Open> open{};
};

/// Counts on all threads, up to a limit.
class Limit {
 public:
  Limit(std::uint64_t most, const char* what) : m_most(most), m_what(what) {}

  void add(std::size_t size) {
    if (m_count.fetch_add(size, std::memory_order_relaxed) + size > m_most)
      throw Error(ErrorCode::TooLarge,
                  "the leaves of a surface proxy need more than " + std::to_string(m_most) + " " +
                      m_what +
                      ": the thickness and the radii are too large for the body, or it has too "
                      "many triangles apart from each other");
  }
  std::uint64_t most() const { return m_most; }

 private:
  const std::uint64_t m_most;
  const char* const m_what;
  std::atomic<std::uint64_t> m_count = 0;
};

ProxyGrid gridOf(const TriangleMesh& body, double reach) {
  ProxyGrid grid;
  grid.reach = reach;
  Vector3d lower = Vector3d::Constant(std::numeric_limits<double>::infinity()), upper = -lower;
  double lengths = 0;
  std::size_t count = 0;
  const auto positions = body.now.body();
  for (std::uint32_t t = 0; t < body.topology.elements.size(); ++t) {
    if (!body.topology.isEnabled(t)) continue;
    const Triangle& corners = body.topology.elements[t];
    for (int i = 0; i < 3; ++i) {
      const Vector3d &p = positions[corners[i]], &q = positions[corners[(i + 1) % 3]];
      lower = lower.cwiseMin(p);
      upper = upper.cwiseMax(p);
      lengths += (q - p).norm();
    }
    grid.isClosed &= hasClosedStars(body.topology, t);
    ++count;
  }
  if (count == 0) return grid;
  const double edge = lengths / (3.0 * static_cast<double>(count));
  double extent = (upper - lower).maxCoeff() + 2.0 * reach;
  if (!(extent <= kLargestExtent && extent >= kSmallestExtent))
    throw Error(ErrorCode::TooLarge,
                "the extent of a body with a surface proxy must be from 2^-400 to 2^400");
  int levels = kFewestLevels;
  while (levels < kMostLevels && std::ldexp(extent, -levels) > kLargestCell * edge) ++levels;
  grid.reach = std::max(reach, std::ldexp(extent, -levels));
  extent = (upper - lower).maxCoeff() + 2.0 * grid.reach;
  extent += kProxySlack * extent;
  grid.units = kCell << levels;
  grid.unit = std::ldexp(extent, -levels) / kCell;
  grid.lower = 0.5 * (lower + upper) - Vector3d::Constant(0.5 * extent);
  grid.magnitude =
      std::max(grid.lower.cwiseAbs().maxCoeff(), (grid.lower.array() + extent).abs().maxCoeff());
  return grid;
}

/// Divides nodes, on all threads, into leaves and cells without a plane.
class Division {
 public:
  /// Of one task.
  struct Scratch {
    std::array<ProxyItems, kMostLevels + 3> kept;  ///< by the size of the parent
    ProxyPlanes::Scratch planes;
    CountedVector<double> distances;
  };

  Division(const TriangleMesh& body, const ProxySettings& settings, const ProxyGrid& grid)
      : m_topology(body.topology),
        m_positions(body.now.body()),
        m_grid(grid),
        m_rounding(kProxyRounding * grid.magnitude),
        m_planes(m_topology, m_positions, settings.allowedError, settings.normalCone, m_rounding),
        m_all(itemsOf(m_topology, m_positions, m_rounding)),
        m_work(settings.mostWork, "comparisons of triangles with cells"),
        m_listed(settings.mostListedOf(m_topology.elements.size()), kInLists) {}

  const ProxyItems& all() const { return m_all; }
  std::uint64_t mostListed() const { return m_listed.most(); }

  /// Visits a node. Keeps those items of the parent that may be nearest to a point of the node.
  /// Returns whether the node must be divided: it is near, and no plane stands for its surface.
  bool isDivided(const Node& node, const ProxyItems& items, ProxyItems& kept,
                 ProxyPlanes::Scratch& scratch, Part& out) {
    m_work.add(items.size);
    const ProxyCube cube = cubeOf(node);
    const NearestItem found = nearestOf(items, cube.centre, nearOf(cube));
    kept.size = 0;
    if (!found.isNear) return false;
    const double distance = std::sqrt(found.square) * (1.0 + kProxySlack) + m_rounding,
                 reach = distance + 2.0 * cube.halfDiagonal;
    const std::size_t nearest = keepWithin(items, cube.centre, reach, found.square, kept);
    return !addPlane(node, {kept, cube, reach, kept.centre(nearest)}, scratch, out);
  }

  /// Divides a node down to cells.
  void divide(const Node& node, const ProxyItems& items, Part& out, Scratch& scratch) {
    if (node.size == kCell) {
      PALPATE_ASSERT(!out.lists.blocks.empty());
      Part::Open& open = out.open.emplace_back();
      open.node = node;
      open.block = out.lists.blocks.size() - 1;
      m_listed.add(items.size);
      open.triangles.reserve(items.size);
      for (std::size_t i = 0; i < items.size; ++i) open.triangles.push_back(items.triangleAt(i));
      return;
    }
    if (node.size == kBrick) {
      out.entries.push_back(
          {node.brick(), 1, static_cast<std::uint32_t>(out.lists.blocks.size()), true});
      out.lists.blocks.emplace_back().fill(SurfaceProxy::kNoLeaf);
    }
    ProxyItems& kept = scratch.kept[std::size_t(std::countr_zero(node.size))];
    for (std::uint32_t i = 0; i < 8; ++i)
      if (isDivided(node.child(i), items, kept, scratch.planes, out))
        divide(node.child(i), kept, out, scratch);
  }

  /// Divides a cell down to nodes of the smallest size.
  void divideCell(const Node& node, const ProxyItems& items, std::uint32_t smallest, Part& out,
                  Scratch& scratch) {
    if (node.size == smallest) return addSmallest(node, items, out, scratch);
    ProxyItems& kept = scratch.kept[std::size_t(std::countr_zero(node.size))];
    for (std::uint32_t i = 0; i < 8; ++i)
      if (isDivided(node.child(i), items, kept, scratch.planes, out))
        divideCell(node.child(i), kept, smallest, out, scratch);
  }

 private:
  /// With what rounding adds when a point's cell is found.
  ProxyCube cubeOf(const Node& node) const {
    const double half = 0.5 * node.size * m_grid.unit * (1.0 + kProxySlack);
    const Vector3d middle =
        Vector3d(node.lower[0], node.lower[1], node.lower[2]).array() + 0.5 * node.size;
    return {m_grid.lower + m_grid.unit * middle, half + m_rounding,
            std::sqrt(3.0) * half + m_rounding};
  }
  double nearOf(const ProxyCube& cube) const {
    return m_grid.reach * (1.0 + kProxySlack) + m_rounding + cube.halfDiagonal;
  }

  /// Adds a leaf with a plane, if there is one.
  bool addPlane(const Node& node, const ProxyPlanes::Surroundings& around,
                ProxyPlanes::Scratch& scratch, Part& out) const {
    ProxyPlanes::Plane plane;
    if (!m_planes.find(around, plane, scratch)) return false;
    SurfaceProxy::Leaf leaf{};
    leaf.normal = {plane.normal[0], plane.normal[1], plane.normal[2]};
    leaf.offset = plane.offset;
    leaf.error = plane.error;
    addLeaf(node, leaf, out);
    return true;
  }

  /// A leaf of the smallest size, after exact distances have been found: the plane of fewer
  /// triangles, or the list of triangles.
  void addSmallest(const Node& node, const ProxyItems& items, Part& out, Scratch& scratch) {
    const ProxyCube cube = cubeOf(node);
    const Vector3d& centre = cube.centre;
    double least = std::sqrt(nearestOf(items, centre, 0.0).square) * (1.0 + kProxySlack);
    Vector3d nearest = centre;
    scratch.distances.resize(items.size);
    const double most = least + 2.0 * cube.halfDiagonal + 2.0 * m_rounding;
    for (std::size_t i = 0; i < items.size; ++i) {
      double& distance = scratch.distances[i];
      distance = (items.centre(i) - centre).norm() - items.radius[i];
      if (distance > most) continue;
      const auto& [a, b, c] = m_topology.elements[items.triangleAt(i)];
      const VertexTriangleDistance found =
          finiteVertexTriangleDistance(centre, m_positions[a], m_positions[b], m_positions[c]);
      distance = found.distance;
      if (found.distance <= least) least = found.distance, nearest = centre - found.difference;
    }
    if (!(least <= nearOf(cube))) return;
    const double reach = least * (1.0 + kProxySlack) + m_rounding + 2.0 * cube.halfDiagonal;
    ProxyItems& kept = scratch.kept.front();
    kept.reserve(items.size);
    kept.size = 0;
    for (std::size_t i = 0; i < items.size; ++i)
      if (scratch.distances[i] <= reach) kept.append(items, i);
    if (addPlane(node, {kept, cube, reach, nearest}, scratch.planes, out)) return;
    PALPATE_ASSERT(kept.size > 0);
    m_listed.add(kept.size);
    SurfaceProxy::Leaf leaf{};
    leaf.firstTriangle = static_cast<std::uint32_t>(out.lists.triangles.size());
    leaf.triangleCount = static_cast<std::uint32_t>(kept.size);
    for (std::size_t i = 0; i < kept.size; ++i)
      out.lists.triangles.push_back(listed(kept.triangleAt(i)));
    addLeaf(node, leaf, out);
  }

  /// Writes a leaf and its entries. Those of leaves below a brick are in the last block: of the
  /// brick or, while cells are divided, of the cell.
  void addLeaf(const Node& node, SurfaceProxy::Leaf& leaf, Part& out) const {
    for (int k = 0; k < 3; ++k) leaf.lower[k] = static_cast<std::uint16_t>(node.lower[k]);
    leaf.size = static_cast<std::uint16_t>(node.size);
    const auto index = static_cast<std::uint32_t>(out.lists.leaves.size());
    out.lists.leaves.push_back(leaf);
    if (node.size >= kBrick) {
      out.entries.push_back({node.brick(), node.size / kBrick, index, false});
      return;
    }
    PALPATE_ASSERT(node.size % out.step == 0 && !out.lists.blocks.empty());
    const std::uint32_t step = out.step, size = node.size / step;
    const std::array<std::uint32_t, 3> at{node.lower[0] / step % 4, node.lower[1] / step % 4,
                                          node.lower[2] / step % 4};
    for (std::uint32_t z = at[2]; z < at[2] + size; ++z)
      for (std::uint32_t y = at[1]; y < at[1] + size; ++y)
        for (std::uint32_t x = at[0]; x < at[0] + size; ++x)
          out.lists.blocks.back()[(z * 4 + y) * 4 + x] = index;
  }

  SurfaceProxy::Listed listed(std::uint32_t triangle) const {
    const auto& [i, j, k] = m_topology.elements[triangle];
    const Vector3d &a = m_positions[i], &b = m_positions[j], &c = m_positions[k];
    const Vector3d middle = (a + b + c) / 3.0;
    const Eigen::Vector3f rounded(roundedToFloat(middle[0]), roundedToFloat(middle[1]),
                                  roundedToFloat(middle[2]));
    const Vector3d centre = rounded.cast<double>();
    const double radius = std::max({(a - centre).norm(), (b - centre).norm(), (c - centre).norm()});
    const auto outward = static_cast<float>(radius * (1.0 + 0x1p-20) + m_rounding);
    return {rounded[0], rounded[1], rounded[2],
            std::nextafter(outward, std::numeric_limits<float>::infinity()), triangle};
  }

  const MeshTopology& m_topology;
  const std::span<const Vector3d> m_positions;
  const ProxyGrid& m_grid;
  const double m_rounding;  ///< L
  const ProxyPlanes m_planes;
  const ProxyItems m_all;
  Limit m_work, m_listed;
};

/// Visits the first levels one after another, and then the nodes below each node in one task.
CountedVector<Part> divideToCells(Division& division, std::uint32_t units, const Threads& threads) {
  struct Visited {
    Node node;
    ProxyItems items;
  };
  CountedVector<Visited> level;
  level.push_back({{{0, 0, 0}, units}, division.all()});
  CountedVector<Part> parts(1);
  for (int depth = 1; depth <= kSharedLevels; ++depth) {
    CountedVector<Visited> next(8 * level.size());
    CountedVector<Part> found(next.size());
    Limit kept(division.mostListed() / kListedPerItem, kInLists);
    threads.forEach(next.size(), [&](std::size_t i) {
      const Visited& parent = level[i / 8];
      next[i].node = parent.node.child(i % 8);
      ProxyPlanes::Scratch scratch;
      if (!division.isDivided(next[i].node, parent.items, next[i].items, scratch, found[i]))
        next[i].items = {};
      kept.add(next[i].items.size);
    });
    for (Part& part : found) parts.push_back(std::move(part));
    std::erase_if(next, [](const Visited& visited) { return visited.items.size == 0; });
    level = std::move(next);
  }
  const std::size_t first = parts.size();
  parts.resize(first + level.size());
  threads.forEach(level.size(), [&](std::size_t i) {
    Division::Scratch scratch;
    division.divide(level[i].node, level[i].items, parts[first + i], scratch);
  });
  return parts;
}

/// Appends leaves, lists and blocks. Returns the indices of the first leaf and block.
std::array<std::uint32_t, 2> join(SurfaceProxy::Lists& part, SurfaceProxy::Lists& out) {
  const auto firstLeaf = static_cast<std::uint32_t>(out.leaves.size()),
             firstTriangle = static_cast<std::uint32_t>(out.triangles.size()),
             firstBlock = static_cast<std::uint32_t>(out.blocks.size());
  for (SurfaceProxy::Leaf& leaf : part.leaves) {
    leaf.firstTriangle += firstTriangle;
    out.leaves.push_back(leaf);
  }
  out.triangles.insert(out.triangles.end(), part.triangles.begin(), part.triangles.end());
  for (SurfaceProxy::Block& block : part.blocks) {
    for (std::uint32_t& leaf : block)
      if (leaf != SurfaceProxy::kNoLeaf) leaf += firstLeaf;
    out.blocks.push_back(block);
  }
  PALPATE_ASSERT(out.leaves.size() < SurfaceProxy::kBlock);
  return {firstLeaf, firstBlock};
}

/// Joins the lists of all parts. Returns the entries of bricks.
CountedVector<std::uint32_t> assemble(std::span<Part> parts, std::uint32_t bricks,
                                      SurfaceProxy::Lists& out) {
  CountedVector<std::uint32_t> values(std::size_t{bricks} * bricks * bricks, SurfaceProxy::kNoLeaf);
  for (Part& part : parts) {
    const auto [firstLeaf, firstBlock] = join(part.lists, out);
    for (const Part::Entry& entry : part.entries) {
      const std::uint32_t value = entry.isBlock ? SurfaceProxy::kBlock | (entry.value + firstBlock)
                                                : entry.value + firstLeaf;
      const auto& [x0, y0, z0] = entry.lower;
      for (std::uint32_t z = z0; z < z0 + entry.size; ++z)
        for (std::uint32_t y = y0; y < y0 + entry.size; ++y)
          for (std::uint32_t x = x0; x < x0 + entry.size; ++x) {
            std::uint32_t& at = values[(std::size_t{z} * bricks + y) * bricks + x];
            PALPATE_ASSERT(at == SurfaceProxy::kNoLeaf);
            at = value;
          }
    }
  }
  return values;
}

/// Divides cells without a plane up to twice. What remains without a plane gets a list. The parts
/// must be those that `out` was assembled from.
void divideCells(Division& division, std::span<const Part> parts, const Threads& threads,
                 SurfaceProxy::Lists& out) {
  CountedVector<const Part::Open*> cells;
  CountedVector<std::uint32_t*> entries;
  std::size_t firstBlock = 0;
  for (const Part& part : parts) {
    for (const Part::Open& open : part.open) {
      cells.push_back(&open);
      const auto& [x, y, z] = open.node.lower;
      const std::uint32_t cell = (z / kCell % 4 * 4 + y / kCell % 4) * 4 + x / kCell % 4;
      entries.push_back(&out.blocks[firstBlock + open.block][cell]);
    }
    firstBlock += part.lists.blocks.size();
  }
  // About a quarter of the nodes that are divided once needs it again.
  const std::size_t most = std::max(kMostSmall, kSmallPerTriangle * division.all().size);
  const std::uint32_t smallest = 8 * cells.size() > most    ? kCell
                                 : 16 * cells.size() > most ? kCell / 2
                                                            : 1;
  const ProxyItems& all = division.all();  // by ascending triangles
  CountedVector<std::uint32_t> itemOf(all.triangleAt(all.size - 1) + std::size_t{1});
  for (std::uint32_t i = 0; i < all.size; ++i) itemOf[all.triangleAt(i)] = i;
  CountedVector<Part> found((cells.size() + kCellsPerTask - 1) / kCellsPerTask);
  threads.forChunks(cells.size(), kCellsPerTask,
                    [&](std::size_t chunk, std::size_t begin, std::size_t end) {
                      Division::Scratch scratch;
                      ProxyItems items;
                      found[chunk].step = 1;
                      for (std::size_t i = begin; i < end; ++i) {
                        items.size = 0;
                        items.reserve(cells[i]->triangles.size());
                        for (const std::uint32_t t : cells[i]->triangles)
                          items.append(all, itemOf[t]);
                        found[chunk].lists.blocks.emplace_back().fill(SurfaceProxy::kNoLeaf);
                        division.divideCell(cells[i]->node, items, smallest, found[chunk], scratch);
                      }
                    });
  // join() moves the blocks, so that their entries are written first.
  auto next = static_cast<std::uint32_t>(out.blocks.size());
  for (std::uint32_t* entry : entries) {
    PALPATE_ASSERT(*entry == SurfaceProxy::kNoLeaf);
    *entry = SurfaceProxy::kBlock | next++;
  }
  for (Part& part : found) join(part.lists, out);
}

}  // namespace

SurfaceProxy::SurfaceProxy(const TriangleMesh& body, const ProxySettings& settings,
                           const Threads& threads)
    : m_grid(gridOf(body, settings.reach)) {
  PALPATE_ASSERT(settings.reach > 0.0);
  if (m_grid.units == 0) return;
  Division division(body, settings, m_grid);
  CountedVector<Part> parts = divideToCells(division, m_grid.units, threads);
  m_bricks = assemble(parts, m_grid.units / kBrick, m_lists);
  divideCells(division, parts, threads, m_lists);
}

std::uint32_t SurfaceProxy::leafAtByBruteForce(const ProxyPlace& place) const {
  if (place.brick == ProxyPlace::kOutside) return kNoLeaf;
  const std::uint32_t bricks = m_grid.units / kBrick;
  std::array<std::uint32_t, 3> at{place.brick % bricks, place.brick / bricks % bricks,
                                  place.brick / (bricks * bricks)};
  for (std::uint32_t k = 0; k < 3; ++k)
    at[k] = at[k] * kBrick + (place.cell >> 2 * k & 3) * kCell + (place.cell >> (6 + 2 * k) & 3);
  for (std::uint32_t i = 0; i < m_lists.leaves.size(); ++i) {
    bool holds = true;
    for (int k = 0; k < 3; ++k)
      holds &= at[k] >= m_lists.leaves[i].lower[k] &&
               at[k] - m_lists.leaves[i].lower[k] < m_lists.leaves[i].size;
    if (holds) return i;
  }
  return kNoLeaf;
}

std::size_t SurfaceProxy::bytes() const {
  return m_bricks.capacity() * sizeof(std::uint32_t) + m_lists.blocks.capacity() * sizeof(Block) +
         m_lists.leaves.capacity() * sizeof(Leaf) + m_lists.triangles.capacity() * sizeof(Listed);
}

}  // namespace palpate
