#pragma once

#include <palpate/Capture.h>
#include <palpate/Error.h>
#include <palpate/OctreeBasedCD.h>
#include <palpate/Settings.h>

#include "CollisionDetection/GeometryBuilder.h"
#include "CollisionDetection/GeometryCut.h"
#include "Core/Threads.h"

#include <functional>
#include <optional>
#include <string>
#include <type_traits>
#include <vector>

namespace palpate {

/// Adds geometries of a problem, also with the ids that cuts left.
struct ProblemGeometries {
  static GeometryId add(OctreeBasedCD&, const CollisionProblem::Geometry&);
};

struct RestoredGeometry;

/// Geometries by id. Checks the user's input.
class GeometryTable {
 public:
  /// Makes what is added next. Throws if no id is left.
  GeometryBuilder builder() const;
  GeometryId add(std::unique_ptr<Geometry>);
  void attach(GeometryId, std::shared_ptr<const DistanceField>);  ///< null: detaches
  void attach(GeometryId, const std::optional<SurfaceProxySettings>&, const Threads&);
  std::unique_ptr<Geometry> remove(GeometryId);
  void setPositions(GeometryId, std::optional<std::span<const Eigen::Vector3d>> before,
                    std::span<const Eigen::Vector3d> now, const Threads&);
  void setSomePositions(GeometryId, std::size_t first, std::span<const Eigen::Vector3d> now,
                        const Threads&);
  /// Receives a new topology and its positions at rest before they are set. What it throws leaves
  /// the geometry as it was. Null if nothing is to be prepared.
  using Preparation = std::function<void(const MeshTopology&, std::span<const Eigen::Vector3d>)>;
  void setTriangles(GeometryId, std::span<const Eigen::Vector3d> positions,
                    std::span<const Triangle>, const Preparation&);
  void setTetrahedra(GeometryId, std::span<const Eigen::Vector3d> positions,
                     std::span<const Tetrahedron>, const Preparation&);
  /// Returns the ids of what was added: triangles, or tetrahedra of a tetrahedral mesh.
  template <class Element>
  std::vector<std::uint32_t> cut(GeometryId id, GeometryCut::Ids removed,
                                 std::span<const Element> added,
                                 const GeometryCut::NewVertices& vertices,
                                 const GeometryCut::Preparation& prepare) {
    GeometryCut cut(at(id), std::is_same_v<Element, Tetrahedron>, vertices);
    auto ids = cut.replace(removed, added, prepare);
    ++m_state;
    return ids;
  }
  void setName(GeometryId, std::string name);
  void setFilter(GeometryId, const CollisionFilter&);
  void setDisabled(GeometryId, std::span<const std::uint32_t> elements);
  void setTags(GeometryId, std::span<const std::uint32_t>);

  void setTransform(GeometryId, const std::optional<Pose>& before, const Pose& now);
  /// Puts the positions and the transform now back to those of earlier in this step.
  void restoreNow(Geometry&, const Positions& now) noexcept;
  void advance() noexcept;
  std::uint32_t lastId() const { return m_nextId; }          ///< ids are below it
  std::uint64_t stepNumber() const { return m_stepNumber; }  ///< counts advance()
  /// A number for the present state of all positions, transforms, elements and shapes; not 0.
  std::uint64_t state() const { return m_state; }

  Geometry* find(GeometryId) const;  ///< null if there is none
  Geometry& at(GeometryId) const;    ///< throws UnknownGeometry
  std::span<const std::unique_ptr<Geometry>> all() const { return m_geometries; }

  /// Makes a geometry of a saved state.
  GeometryBuilder restorer(GeometryId) const;
  /// The table becomes that of a saved state. Call prepareToRestore() before.
  void prepareToRestore(std::size_t count) { m_geometries.reserve(count); }
  void restore(std::span<RestoredGeometry>, std::uint32_t nextId,
               std::uint64_t stepNumber) noexcept;

 private:
  void setElements(Geometry&, RestShape, const Preparation&);

  CountedVector<std::unique_ptr<Geometry>> m_geometries;  ///< ascending ids
  std::uint32_t m_nextId = 0;
  std::uint64_t m_stepNumber = 0, m_state = 1;
  /// Counts restore(). Ids are then used again, so that revisions must differ from all before.
  std::uint64_t m_restores = 0;
};

}  // namespace palpate
