#pragma once

#include <palpate/Capture.h>
#include <palpate/OctreeBasedCD.h>

#include "Common/DrawnSettings.h"
#include "Common/Lockstep.h"
#include "Common/RandomBodies.h"

#include <cstdint>
#include <map>
#include <memory>
#include <ostream>
#include <set>
#include <span>
#include <string>
#include <vector>

namespace palpate::testing {

/// What is at work in a frame of a history.
enum class Feature {
  Triangles,
  Tetrahedra,
  Lines,
  Points,
  Shapes,
  Fields,
  AttachedFields,
  Proxies,
  SelfCollision,
  Placed,
  Coincident,
  Large,
  Tracking,
  UserData,
  Crossings,
  Sides,
  GivenSides,
  SmoothNormals,
  Tags,
  FreeMotion,
  RestDistance,
  EarliestTime,
  Predicate,
  Disabled,
  Groups,
  Sidedness,
  Cut,
  TetrahedraCut,
  NewTopology,
  SomePositions,
  BothEnds,
  KeptCandidates,
  OutOfTime,
  EndedEarly,
  FailedCall,
  Restored,
  Captured,
  Guard,
  Threads,
  Snapshot,
  PenetrationTracker,
  Audit,
  Executor
};

/// How often two features were at work in the same frame.
class FeaturePairsTable {
 public:
  void add(const std::set<Feature>& frame) {
    for (const Feature a : frame)
      for (const Feature b : frame) ++m_counts[{a, b}];
  }
  /// Counts of each feature, and the pairs that no frame had.
  void print(std::ostream&) const;

 private:
  std::map<std::pair<Feature, Feature>, std::size_t> m_counts;
};

/// A random history of objects with different settings. Geometries of every type and pairs of every
/// method are added and removed. Geometries move within steps and between steps. Topology, filters,
/// disabled elements, tags, predicates, sides and settings change, with queries, updates and
/// detections in between.
///
/// Lockstep compares the objects. After each frame they must have the same contacts as a new object
/// with the last values, and as brute force. Answers over time must be those of an object that was
/// given only the last values of each step.
class RandomHistory {
 public:
  explicit RandomHistory(std::uint64_t seed, BodySize = BodySize::Small);
  /// The history that these bytes decide, in a length unit of any size and with coordinates of very
  /// different sizes.
  explicit RandomHistory(std::span<const std::uint8_t> decisions);
  RandomHistory(const RandomHistory&) = delete;
  RandomHistory& operator=(const RandomHistory&) = delete;

  /// Makes some random calls and a detection, and compares everything. Failures are GoogleTest's.
  void frame();
  std::size_t contacts() const { return m_contacts; }  ///< of all frames
  bool isOver() const { return m_random.isOver(); }    ///< whether nothing is left to decide
  CollisionProblem problem() const { return m_lockstep.first().problem(); }
  std::size_t decisions() const { return m_decisions; }  ///< so far
  /// These decisions, which count from 0, are left out.
  void leaveOut(std::set<std::size_t> decisions) { m_leftOut = std::move(decisions); }
  void writeTo(std::ostream* calls) { m_lockstep.writeTo(calls); }
  const std::set<Feature>& features() const { return m_features; }  ///< of the last frame
  std::string description() const;

 private:
  RandomHistory(Random, std::uint64_t seed, Space, BodySize, double unit);

  /// Whether the next decision is made. It depends on the seed and its number alone.
  bool decide();

  void act();
  void change(GeometryId);
  void add();
  void setPositions(GeometryId);
  void setSomePositions(GeometryId);
  void setTransform(GeometryId);
  void setTopology(GeometryId);
  void cut(GeometryId);
  void cutTriangles(GeometryId);
  void cutTetrahedra(GeometryId);
  void setFilter(GeometryId);
  void setDisabled(GeometryId);
  void setTags(GeometryId);
  void addOrChangePair();
  void changePair(const ModelPair&);
  void setSides();
  void setUserData();
  void hold();
  void expectNothingTouches();
  void watch();
  void publish();
  void query();

  GeometryId anyBody();
  const ModelPair* anyPair();
  PairSettings randomSettings();

  void compareWithNewObjects();
  void compareContacts(const NewObject&, bool isBruteForce);
  void compareInWorld();
  void compareCapture();
  void compareCrossings();
  bool startsApart(const ModelPair&) const;
  void giveSides(NewObject&) const;
  void compareCandidates(NewObject& bruteForce);
  void compareQueries(NewObject& other);
  void compareSnapshot();
  void noteFeatures();

  Random m_random;
  std::uint64_t m_seed;
  RandomBodies m_draw;
  Lockstep m_lockstep;
  std::shared_ptr<const Snapshot> m_snapshot;
  std::vector<std::uint64_t> m_snapshotWords;
  std::size_t m_contacts = 0, m_decisions = 0, m_frames = 0, m_vertexPaths = 0;
  std::set<std::size_t> m_leftOut;
  std::set<Feature> m_features;
};

}  // namespace palpate::testing
