#pragma once

#include "Mesh/TriangleMesh.h"
#include "Core/Assert.h"
#include "Core/Buffer.h"
#include "Core/Threads.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace palpate {

struct ProxySettings {
  double reach = 0;         ///< L: distance to which points are answered, positive
  double allowedError = 0;  ///< L: largest proven error of a leaf's plane
  double normalCone = 0;    ///< rad: LeafSettings::widestNormalCone
  /// Most triangles that are compared with nodes while the leaves are built, and most in lists of
  /// leaves and of nodes that are divided last.
  std::uint64_t mostWork = std::uint64_t{1} << 33, mostListed = 1u << 26;
  /// Most in lists for each triangle of the body, where that is more than 2^23.
  static constexpr std::uint64_t kMostListedEach = 512;
  std::uint64_t mostListedOf(std::size_t triangles) const {
    return std::min(mostListed, std::max(std::uint64_t{1} << 23, kMostListedEach * triangles));
  }
  friend bool operator==(const ProxySettings&, const ProxySettings&) = default;
};

/// The smallest nodes have an edge of 1 unit. A cell has 4 x 4 x 4 of them, a brick 4 x 4 x 4
/// cells. A point's place is its brick, the cell in the brick (the 6 lowest bits of `cell`) and the
/// unit in the cell (the next 6 bits).
struct ProxyPlace {
  static constexpr std::uint32_t kOutside = 0xffffffffu;
  std::uint32_t brick, cell;
};

/// The cube around a surface in which nodes are.
struct ProxyGrid {
  Eigen::Vector3d lower = Eigen::Vector3d::Zero();  ///< L
  double unit = 1, reach = 0;                       ///< L
  double magnitude = 0;                             ///< L: largest coordinate of the cells
  std::uint32_t units = 0;                          ///< along each axis; 0 without triangles
  bool isClosed = true;  ///< the mesh, and consistently oriented: distances have a sign
};

/// An octree around a body's surface, in the body's frame. Its leaves have a plane or a list of
/// triangles; leaves further away than the reach have neither.
///
/// Laws     (1) for every point p of a leaf with a plane: the plane's distance from p and the
///          surface's differ by at most `error`. If the former exceeds `error`, p is on the side of
///          the surface that the sign of the plane's distance says.
///          (2) the list of a leaf with triangles has the triangle that is nearest to p.
///          (3) points in leaves without either are further from the surface than the reach.
///          Docs/SurfaceProxies.md has the proofs.
/// Errors   TooLarge if the reach is so large that the leaves would need more than mostWork
///          or mostListed; or if the extent is not from 2^-400 to 2^400.
/// Threads  the same leaves for any number of threads.
class SurfaceProxy {
 public:
  struct alignas(64) Leaf {
    std::array<double, 3> normal;  ///< unit, on the side of the winding normals
    double offset;                 ///< L: a point is normal . point - offset in front of the plane
    double error;                  ///< L: see law 1; 0 for triangles
    std::uint32_t firstTriangle, triangleCount;  ///< count 0: a plane
    std::array<std::uint16_t, 3> lower;          ///< in units; this and the size: for brute force
    std::uint16_t size;                          ///< in units, along each axis

    bool hasPlane() const { return triangleCount == 0; }
    double distance(double x, double y, double z) const {
      return (normal[0] * x + normal[1] * y + normal[2] * z) - offset;
    }
  };
  /// A triangle of a list, in a sphere. Floats: the radius is that about the rounded centre.
  struct Listed {
    float x, y, z, radius;
    std::uint32_t triangle;
  };
  using Block = std::array<std::uint32_t, 64>;  ///< entries of a brick's cells, or a cell's units
  static constexpr std::uint32_t kNoLeaf = 0xffffffffu;
  static constexpr std::uint32_t kBlock = 0x80000000u;  ///< marks the index of a block
  struct Lists {
    CountedVector<Block> blocks;
    CountedVector<Leaf> leaves;
    CountedVector<Listed> triangles;
  };

  SurfaceProxy(const TriangleMesh& body, const ProxySettings&, const Threads&);

  /// The leaf of a place; kNoLeaf if there is none.
  std::uint32_t leafAt(const ProxyPlace& place) const {
    if (place.brick == ProxyPlace::kOutside) return kNoLeaf;
    PALPATE_ASSERT(place.brick < m_bricks.size());
    std::uint32_t entry = m_bricks[place.brick];
    if (const std::uint32_t* cell = within(entry, place.cell)) entry = *cell;
    if (const std::uint32_t* unit = within(entry, place.cell >> 6)) entry = *unit;
    return entry;
  }
  /// The same, found among all leaves.
  std::uint32_t leafAtByBruteForce(const ProxyPlace&) const;

  std::span<const Leaf> leaves() const { return m_lists.leaves; }
  std::span<const Listed> trianglesOf(const Leaf& leaf) const {
    return std::span(m_lists.triangles).subspan(leaf.firstTriangle, leaf.triangleCount);
  }
  bool isClosed() const { return m_grid.isClosed; }
  double depth() const { return m_grid.reach; }  ///< L: Validity::proxyDepth
  double magnitude() const { return m_grid.magnitude; }
  const Eigen::Vector3d& lower() const { return m_grid.lower; }
  double unit() const { return m_grid.unit; }
  std::uint32_t unitCount() const { return m_grid.units; }
  std::size_t bytes() const;

  // For a look-up in steps, so that memory is fetched ahead.
  const std::uint32_t* brick(std::uint32_t index) const { return &m_bricks[index]; }
  /// The entry of a cell in its brick, or of a unit in its cell. Null if `entry` holds for all.
  const std::uint32_t* within(std::uint32_t entry, std::uint32_t index) const {
    if (entry == kNoLeaf || !(entry & kBlock)) return nullptr;
    PALPATE_ASSERT((entry & ~kBlock) < m_lists.blocks.size());
    return &m_lists.blocks[entry & ~kBlock][index & 63];
  }

 private:
  ProxyGrid m_grid;
  CountedVector<std::uint32_t> m_bricks;
  Lists m_lists;
};

}  // namespace palpate
