#pragma once

#include <palpate/DistanceField.h>
#include <palpate/OctreeBasedCD.h>

#include "Common/Renamed.h"
#include "Common/TestGeometry.h"

#include <map>
#include <memory>
#include <optional>
#include <vector>

namespace palpate::testing {

/// The values that a geometry was given last.
struct ModelBody {
  /// At rest, with the elements that are there: of a tetrahedral mesh those of its surface.
  TestGeometry geometry;
  std::vector<Tetrahedron> tetrahedra{};  ///< by id, with removed ones
  Ids removedTetrahedra{};                ///< ascending
  Ids tetrahedronOf{};                    ///< of each triangle of the surface, by id
  std::optional<AnalyticalGeometry> shape{};
  std::shared_ptr<const DistanceField> field{};  ///< the geometry itself, or attached to a mesh
  std::optional<SurfaceProxySettings> leaves{};
  Positions before{}, now{};  ///< in the body's frame
  bool isNew = true, bodyGiven = false, placed = false, transformGiven = false;
  Pose poseBefore{}, pose{};
  CollisionFilter filter{};
  Ids disabled{};
  Ids tags{};     ///< one per element, of a tetrahedral mesh one per tetrahedron, or none
  Ids removed{};  ///< ids of elements that cuts removed, ascending

  bool isField() const { return geometry.type == GeometryType::Field; }
  bool hasVertices() const { return !shape && !isField(); }
  bool isMesh() const { return hasVertices() && geometry.type == GeometryType::Triangles; }
  bool isRigid() const { return field || leaves; }
  std::size_t elements() const;  ///< with removed ones
  Ids ids() const { return idsWithout(elements(), removed); }
  /// Elements by their ids: those that are there, by their place.
  Ids placesOf(const Ids& elements) const;
  std::size_t tagCount() const;
  Positions beforeInWorld() const;
  Positions nowInWorld() const;
};

struct ModelPair {
  GeometryId a, b;
  PairSettings settings;
  int predicate = 0;  ///< 0: none
};

/// Whether features with these tags may be a contact. ofA, ofB: the ids of elements, where those of
/// the object count from 0; none: its own.
ContactPredicate predicateOf(int number, Ids ofA = {}, Ids ofB = {});

/// The last values of an object, by the rules of a step.
struct Model {
  std::map<GeometryId, ModelBody> bodies;
  std::vector<ModelPair> pairs;

  ModelPair* find(GeometryId a, GeometryId b);  ///< in either order
  void removeGeometry(GeometryId);
  void advance();
};

/// A new object with the values of a model. Its elements count from 0 without removed ones.
struct NewObject {
  OctreeBasedCD object;
  std::map<GeometryId, GeometryId> ids;  ///< of the model's geometries
};
/// inWorld: placed bodies have positions in the world instead of a pose, where that is possible.
NewObject newObject(const Model&, const Settings&, bool inWorld = false);
/// Adds a body at rest, without what is attached to it.
GeometryId addBody(OctreeBasedCD&, const ModelBody&);

}  // namespace palpate::testing
