#pragma once

#include "CollisionDetection/Geometry.h"

#include <functional>
#include <vector>

namespace palpate {

/// A change of topology that keeps what belongs to other elements. Until it is applied, the
/// geometry is as it was, but for new vertices at the end of those at rest, which the destructor
/// removes again.
class GeometryCut {
 public:
  /// New vertices of a cut, and where they are at rest; empty: there.
  struct NewVertices {
    std::span<const Eigen::Vector3d> positions, rest;
  };
  /// Receives the new edges, and all positions at rest, before they are set. What it throws leaves
  /// the geometry as it was. Null if nothing is to be prepared.
  using Preparation = std::function<void(const EdgeChange&, std::span<const Eigen::Vector3d> rest)>;
  using Ids = std::span<const std::uint32_t>;

  GeometryCut(Geometry&, bool ofTetrahedra, const NewVertices&);
  GeometryCut(const GeometryCut&) = delete;
  GeometryCut& operator=(const GeometryCut&) = delete;
  ~GeometryCut() {
    if (!m_isApplied) rest().resize(m_verticesBefore);
  }
  /// Returns the ids of what was added.
  std::vector<std::uint32_t> replace(Ids removed, std::span<const Triangle> added,
                                     const Preparation&);
  std::vector<std::uint32_t> replace(Ids removed, std::span<const Tetrahedron> added,
                                     const Preparation&);

 private:
  CountedVector<Eigen::Vector3d>& rest() const { return m_geometry.body.mesh.rest; }
  void apply(Ids removed, std::span<const Triangle> added, const Preparation&);

  Geometry& m_geometry;
  const std::size_t m_verticesBefore;
  CountedVector<Eigen::Vector3d> m_positions;  ///< of the new vertices
  bool m_isApplied = false;
};

}  // namespace palpate
