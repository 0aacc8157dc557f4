#pragma once

#include <palpate/Capture.h>
#include <palpate/Error.h>
#include <palpate/OctreeBasedCD.h>
#include <palpate/Settings.h>

#include "CollisionDetection/Geometry.h"
#include "Core/Threads.h"

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace palpate {

/// Adds geometries of a problem, also with the ids that cuts left.
struct ProblemGeometries {
  static GeometryId add(OctreeBasedCD&, const CollisionProblem::Geometry&);
};

/// What a saved state has of a geometry.
struct SavedGeometry {
  /// Without a field and a proxy. Positions are in the body's frame.
  CollisionProblem::Geometry problem;
  std::optional<std::array<double, 2>> field{};  ///< error bound and band of the one that it has
  std::optional<SurfaceProxySettings> proxy{};
  std::array<std::optional<Pose>, 3> poses{};  ///< now, before, detected; none: not placed
  bool isDetectedOther = false;                ///< its positions are neither those now nor before
  bool isDetectedBefore = false;               ///< else: they are those before
  std::vector<Eigen::Vector3d> detected{};     ///< with isDetectedOther
  bool isNew = false, bodyGiven = false, transformGiven = false;
  StepSets sets{};
  std::vector<double> freeMotion{};
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
  /// At rest at its positions, without what is attached. Of a tetrahedral mesh after cuts,
  /// `triangles` is the surface.
  GeometryId add(const CollisionProblem::Geometry&);
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
  /// the geometry as it was. Null if nothing is to be prepared.
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
  /// The same before a cut, with those at rest of new vertices.
  using CutPreparation =
      std::function<void(const EdgeChange&, std::span<const Eigen::Vector3d> rest)>;
  /// Returns the ids of what was added.
  std::vector<std::uint32_t> replaceTriangles(GeometryId, Ids removed, std::span<const Triangle>,
                                              const NewVertices&, const CutPreparation&);
  std::vector<std::uint32_t> replaceTetrahedra(GeometryId, Ids removed,
                                               std::span<const Tetrahedron>, const NewVertices&,
                                               const CutPreparation&);
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

  GeometryId nextId() const;  ///< of what is added next; throws if there are no more

  /// A geometry of a saved state, checked. It is one of the table, which keeps what follows from
  /// its elements, or a new one.
  struct Restored {
    Geometry* geometry = nullptr;
    std::unique_ptr<Geometry> made{};
    GeometryStep::State step{};
    std::string name{};
    CollisionFilter filter{};
    CountedVector<std::uint32_t> tags{}, solidTags{};
    std::optional<MeshTopology> topology{};  ///< where other elements are disabled
    BodyRevisions revisions{};
    Buffer<double> freeMotion{};
    void apply() noexcept;  ///< all but `made`
  };
  /// Throws the errors of the calls that add and change geometries. NotAvailable if the table has
  /// no such field.
  Restored restored(const SavedGeometry&, const Threads&) const;
  /// The table becomes that of a saved state. Call prepareToRestore() before.
  void prepareToRestore(std::size_t count);
  void restore(std::span<Restored>, std::uint32_t nextId, std::uint64_t stepNumber) noexcept;

 private:
  /// A geometry with its topology, and positions at both ends of the step; not yet in the table.
  std::unique_ptr<Geometry> make(CountedVector<Eigen::Vector3d> rest, MeshTopology) const;
  GeometryId add(std::unique_ptr<Geometry>);
  std::unique_ptr<Geometry> make(const SavedGeometry&, const Threads&) const;
  static void setTopology(Geometry&, CountedVector<Eigen::Vector3d> rest, MeshTopology,
                          std::unique_ptr<Solid>, const Preparation&);
  struct Cut;
  static void apply(Cut&, const CutPreparation&);

  CountedVector<std::unique_ptr<Geometry>> m_geometries;  ///< ascending ids
  std::uint32_t m_nextId = 0;
  std::uint64_t m_stepNumber = 0, m_state = 1;
  /// Counts restore(). Ids are then used again, so that revisions must differ from all before.
  std::uint64_t m_restores = 0;
};

}  // namespace palpate
