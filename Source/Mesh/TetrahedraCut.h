#pragma once

#include "Mesh/TetrahedralTopology.h"
#include "Core/CountedVector.h"

#include <Eigen/Core>

#include <array>
#include <cstdint>
#include <optional>
#include <span>

namespace palpate {

/// A cut of tetrahedra that all have a volume: some are removed, in ascending order, and others
/// added. apply() makes it; the topology then equals topologyOf() with keepSurfaceIds().
/// Cost     searches for what is around the cut. It is linear for the first cut, and, amortized by
///          what is added, where arrays have to grow.
class TetrahedraCut {
 public:
  /// Whether the tetrahedra of a topology, and those that are to be added, have volumes.
  static bool isPossible(const TetrahedralTopology&, std::span<const Eigen::Vector3d> rest,
                         std::span<const Tetrahedron> added);

  TetrahedraCut(TetrahedralTopology&, std::span<const Eigen::Vector3d> rest,
                std::span<const std::uint32_t> removed, std::span<const Tetrahedron> added);

  /// As of topologyOf(). With a fault there is nothing to apply.
  const std::optional<OverusedFace>& fault() const { return m_fault; }
  std::span<const std::uint32_t> goneFaces() const { return m_gone; }  ///< surface ids, ascending
  std::span<const Triangle> newFaces() const { return m_new; }         ///< they get the next ids
  /// Surface triangles of which the tetrahedron is another one.
  std::span<const std::uint32_t> passedFaces() const { return m_passed; }
  void apply() noexcept;

 private:
  using Sides = CountedVector<std::uint32_t>;  ///< 4 times a tetrahedron, plus a face; ascending
  bool isRemoved(std::uint32_t tetrahedron) const;
  const Tetrahedron& tetrahedron(std::uint32_t id) const;
  Triangle orientedFace(std::uint32_t side) const;
  std::span<const std::uint32_t> shortestList(const Triangle& face) const;
  void makeLists();
  void findFaces();
  void findIds(Sides& exposed, CountedVector<std::uint32_t>& gone);
  void findStars();
  void reserve();

  /// Tetrahedra around a vertex afterwards.
  struct Star {
    std::uint32_t vertex;
    CountedVector<std::uint32_t> list;
  };

  TetrahedralTopology& m_topology;
  std::span<const std::uint32_t> m_removed;
  std::span<const Tetrahedron> m_added;
  const std::size_t m_vertexCount;
  CountedVector<std::uint8_t> m_isPositive;  ///< of the added ones
  std::optional<OverusedFace> m_fault;
  CountedVector<std::uint32_t> m_gone, m_passed;
  CountedVector<Triangle> m_new;
  Sides m_passedTo, m_newOf;  ///< the sides of m_passed and of m_new
  CountedVector<Star> m_stars;
};

}  // namespace palpate
