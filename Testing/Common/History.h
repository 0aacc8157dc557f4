#pragma once

#include <palpate/Capture.h>
#include <palpate/OctreeBasedCD.h>
#include <palpate/PenetrationTracker.h>

#include "Common/PairRun.h"
#include "Common/Solids.h"
#include "Common/TestGeometry.h"

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <vector>

namespace palpate::testing {

/// A random history of an OctreeBasedCD. Geometries of every type and pairs of every method are
/// added and removed. Geometries move within steps and between steps. Topology, filters, disabled
/// elements and predicates change, with queries, updates and detections in between.
///
/// A model beside it keeps only the last values, by the rules of a step. After each frame the
/// object must have the same contacts as a new object with the values of the model, and as brute
/// force. State that lasts from step to step must be as in an object that was given only the last
/// values of each step. Some frames are made twice, the second time from a saved state, which may
/// be restored into a new object; all bits must be the same.
class RandomHistory {
 public:
  explicit RandomHistory(std::uint64_t seed);
  /// The history that these bytes decide, in a length unit of any size and with coordinates of very
  /// different sizes.
  explicit RandomHistory(std::span<const std::uint8_t> decisions);

  /// Makes some random calls and a detection, and compares everything. Failures are GoogleTest's.
  void frame();
  std::size_t contacts() const { return m_contacts; }  ///< of all frames
  bool isOver() const { return m_random.isOver(); }    ///< whether nothing is left to decide
  CollisionProblem problem() const { return m_collisions.problem(); }

 private:
  RandomHistory(Random, OctreeBounds);

  struct Body {
    TestGeometry geometry;                ///< of the last topology; its positions at rest
    std::vector<Tetrahedron> tetrahedra;  ///< of a tetrahedral mesh
    std::optional<AnalyticalGeometry> shape;
    Positions before, now;  ///< in the body's frame
    bool isNew = true, bodyGiven = false, placed = false, transformGiven = false;
    Eigen::Matrix3d rotationBefore = Eigen::Matrix3d::Identity(), rotation = rotationBefore;
    Vector3d translationBefore = Vector3d::Zero(), translation = translationBefore;
    CollisionFilter filter{};
    std::vector<std::uint32_t> disabled{};
    std::vector<std::uint32_t> tags{};
    std::vector<std::uint32_t> removed{};  ///< by cuts, ascending; geometry.triangles lacks them

    bool isMesh() const { return !shape && geometry.type == GeometryType::Triangles; }
    std::size_t elements() const;  ///< with removed ones
    /// The ids of the elements that are there.
    std::vector<std::uint32_t> ids() const;
    /// Of elements by their ids: those that are there, by their place.
    std::vector<std::uint32_t> placesOf(const std::vector<std::uint32_t>& elements) const;
  };
  struct Pair {
    GeometryId a, b;
    PairSettings settings;
    int predicate = 0;  ///< 0: none
  };

  // Random calls. Each changes the object and the model, or neither if the library refuses the
  // call.
  void act();
  void actAndDetect();
  /// actAndDetect(), and again from a saved state.
  void replay();
  void add();
  void remove(GeometryId);
  void setPositions(GeometryId);
  void setTransform(GeometryId);
  void setTopology(GeometryId);
  void cut(GeometryId);
  void setFilter(GeometryId);
  void setDisabled(GeometryId);
  void setTags(GeometryId);
  void addOrChangePair();
  void query();

  GeometryId anyBody();
  TestGeometry randomGeometry(int type);  ///< in units
  TestGeometry stretched(TestGeometry);
  Solid randomSolid();
  PairSettings randomSettings();
  Positions randomMotion(const Positions&);
  Eigen::Matrix3d randomTurn();
  /// ofA, ofB: the ids of elements that are there.
  static ContactPredicate predicateOf(int number, std::vector<std::uint32_t> ofA = {},
                                      std::vector<std::uint32_t> ofB = {});
  /// call() throws if it is refused. Returns whether it was accepted.
  template <class F>
  static bool accepts(F&& call);

  static GeometryId addTo(OctreeBasedCD&, const Body&);
  static void setEnds(OctreeBasedCD&, GeometryId, const Body&);
  /// A new object with the last values, whose elements are numbered anew. ids: the history's
  /// geometries in it.
  OctreeBasedCD fresh(Engine, std::map<GeometryId, GeometryId>& ids) const;
  void compareContacts(const OctreeBasedCD& other, const std::map<GeometryId, GeometryId>&,
                       bool isBruteForce);
  bool startsApart(const Pair&) const;
  void compareCandidates(OctreeBasedCD& bruteForce, const std::map<GeometryId, GeometryId>&);
  void compareQueries(OctreeBasedCD& other, const std::map<GeometryId, GeometryId>&);
  void expectSameEnds(const OctreeBasedCD& other) const;
  void compareWhatLasts();
  void endStep();

  Random m_random;
  OctreeBasedCD m_collisions;
  double m_unit = 1.0;  ///< of all lengths, a power of two
  /// An object that is given only the last values of each step.
  OctreeBasedCD m_committed;
  std::map<GeometryId, Body> m_bodies;
  std::vector<Pair> m_pairs;
  /// Vertices and body of the trackers, one for each of the two objects.
  struct Tracked {
    Tracked(GeometryId a, GeometryId b) : vertices(a), body(b), running(a, b), committed(a, b) {}
    GeometryId vertices, body;
    PenetrationTracker running, committed;
  };
  std::optional<Tracked> m_tracked;
  std::size_t m_contacts = 0;
};

}  // namespace palpate::testing
