#pragma once

#include "CollisionDetection/GeometryTable.h"

namespace palpate {

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

/// A geometry of a saved state, checked. It is one of the table, which keeps what follows from its
/// elements, or a new one.
struct RestoredGeometry {
  /// Throws the errors of the calls that add and change geometries. NotAvailable if the table has
  /// no such field.
  RestoredGeometry(const SavedGeometry&, const GeometryTable&, const Threads&);

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

}  // namespace palpate
