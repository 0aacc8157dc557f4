#pragma once

#include <palpate/Error.h>
#include <palpate/OctreeBasedCD.h>
#include <palpate/Settings.h>

#include "CollisionDetection/Geometry.h"
#include "Core/Threads.h"
#include "Core/Trace.h"

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace palpate {

/// A mesh after cuts, with the ids that they left. Of a tetrahedral mesh, `triangles` is the
/// surface.
struct CutMesh {
  std::span<const Eigen::Vector3d> positions;
  std::span<const Triangle> triangles;
  std::span<const std::uint32_t> removed;
  std::span<const Tetrahedron> tetrahedra;
  std::span<const std::uint32_t> removedTetrahedra;

  GeometryId addTo(OctreeBasedCD&) const;
};

/// Geometries by id. Checks the user's input.
class GeometryTable {
 public:
  /// radii: none, one for all, or as many as positions.
  GeometryId add(std::span<const Eigen::Vector3d> positions, std::span<const Triangle>,
                 GeometryType = GeometryType::Triangles, std::span<const double> radii = {});
  GeometryId addLines(std::span<const Eigen::Vector3d> positions, std::span<const Segment>,
                      std::span<const double> radii);
  GeometryId addPoints(std::span<const Eigen::Vector3d> positions, std::span<const double> radii);
  GeometryId add(std::span<const Eigen::Vector3d> positions, std::span<const Tetrahedron>);
  GeometryId add(const CutMesh&);
  GeometryId add(const AnalyticalGeometry&);
  GeometryId add(std::shared_ptr<const DistanceField>);
  void attach(GeometryId, std::shared_ptr<const DistanceField>);  ///< null: detaches
  void attach(GeometryId, const std::optional<SurfaceProxySettings>&, const Threads&);
  void remove(GeometryId);
  void setPositions(GeometryId, std::optional<std::span<const Eigen::Vector3d>> before,
                    std::span<const Eigen::Vector3d> now, const Threads&);
  void setSomePositions(GeometryId, std::size_t first, std::span<const Eigen::Vector3d> now,
                        const Threads&);
  /// Receives a new topology and its positions at rest before they are set. What it throws leaves
  /// the geometry as it was.
  using Preparation = std::function<void(const MeshTopology&, std::span<const Eigen::Vector3d>)>;
  void setTriangles(GeometryId, std::span<const Eigen::Vector3d> positions,
                    std::span<const Triangle>, const Preparation&);
  void setTetrahedra(GeometryId, std::span<const Eigen::Vector3d> positions,
                     std::span<const Tetrahedron>, const Preparation&);
  using Ids = std::span<const std::uint32_t>;
  /// New vertices of a cut, and where they are at rest; empty: there.
  struct NewVertices {
    std::span<const Eigen::Vector3d> positions, rest;
  };
  /// Returns the ids of what was added.
  std::vector<std::uint32_t> replaceTriangles(GeometryId, Ids removed, std::span<const Triangle>,
                                              const NewVertices&, const Preparation&);
  std::vector<std::uint32_t> replaceTetrahedra(GeometryId, Ids removed,
                                               std::span<const Tetrahedron>, const NewVertices&,
                                               const Preparation&);
  void setName(GeometryId, std::string name);
  void setFilter(GeometryId, const CollisionFilter&);
  void setDisabled(GeometryId, std::span<const std::uint32_t> elements);
  void setTags(GeometryId, std::span<const std::uint32_t>);

  void setTransform(GeometryId, const std::optional<Pose>& before, const Pose& now);
  /// Puts the positions and the transform now back to those of earlier in this step.
  void restoreNow(Geometry&, const Positions& now) noexcept;
  void advance() noexcept;
  std::uint64_t stepNumber() const { return m_stepNumber; }  ///< counts advance()
  /// A number for the present state of all positions, transforms, elements and shapes; not 0.
  std::uint64_t state() const { return m_state; }

  Geometry* find(GeometryId) const;  ///< null if there is none
  Geometry& at(GeometryId) const;    ///< throws UnknownGeometry
  std::span<const std::unique_ptr<Geometry>> all() const { return m_geometries; }

  /// Updates the octrees to the positions now, or to the whole step (GeometryOctree::setSwept()).
  void updateOctrees(const OctreeSettings&, const Threads&, Trace* = nullptr);
  /// Whether one thread made the last update. Its cache then has the data.
  bool wasUpdatedByOneThread() const { return m_wasUpdatedByOneThread; }

  GeometryId nextId() const;  ///< of what is added next; throws if there are no more

 private:
  /// A geometry with its topology, and positions at both ends of the step; not yet in the table.
  std::unique_ptr<Geometry> make(CountedVector<Eigen::Vector3d> rest, MeshTopology) const;
  GeometryId add(std::unique_ptr<Geometry>);
  static void setTopology(Geometry&, CountedVector<Eigen::Vector3d> rest, MeshTopology,
                          std::unique_ptr<Solid>, const Preparation&);
  struct Cut;
  static void apply(Cut, const Preparation&);

  CountedVector<std::unique_ptr<Geometry>> m_geometries;  ///< ascending ids
  std::uint32_t m_nextId = 0;
  CountedVector<Geometry*> m_changed;
  bool m_wasUpdatedByOneThread = false;
  std::uint64_t m_stepNumber = 0, m_state = 1;
};

}  // namespace palpate
