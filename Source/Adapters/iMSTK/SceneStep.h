#pragma once

#include "iMSTK/CollisionStep.h"

#include <palpate/imstk/PalpateScene.h>

#include <imstkCollisionData.h>
#include <imstkMath.h>
#include <imstkPbdConstraint.h>

#include <atomic>
#include <cstddef>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

namespace imstk {
class CollidingObject;
class CollisionInteraction;
class Geometry;
class PbdModel;
class PbdObject;
}  // namespace imstk

namespace palpate {

class PalpateCD;
class PalpateCH;

/// A row in iMSTK's numbers: gap = normal . (sum of weights times positions) - offset.
struct ParticleRow {
  struct Term {
    imstk::PbdParticleId particle;
    double weight;
    bool rigid;
    Eigen::Vector3d local;  ///< of a rigid body: the point in its frame
  };
  std::vector<Term> terms;
  Eigen::Vector3d normal;
  double offset;
  Eigen::Vector3d fixedDisplacement;  ///< weighted, of bodies without particles, in the step
};

/// The step of all interactions of a scene, or of one PalpateCD without a scene: reads iMSTK's
/// geometries and particles, and writes what the guard held back. No exception leaves it.
class SceneStep {
 public:
  explicit SceneStep(int threads);
  ~SceneStep();

  void setRadius(const std::shared_ptr<imstk::Geometry>& geometry, double radius);
  void showHeld(const std::shared_ptr<imstk::CollidingObject>& object);
  /// An interaction to be added by addSharedPairs().
  void share(const std::shared_ptr<imstk::CollisionInteraction>& interaction,
             const std::shared_ptr<PalpateCD>& detection, const PalpateSettings& settings);
  /// Adds the pairs that are new, at rest, where their bodies are.
  void addSharedPairs();
  /// A pair of geometries without particles; -1 with a warning if Palpate refuses it.
  int addPair(const std::shared_ptr<imstk::Geometry>& a, const std::shared_ptr<imstk::Geometry>& b,
              const PalpateSettings& settings);
  std::vector<std::shared_ptr<imstk::CollisionInteraction>> interactions() const;

  /// Begins a step where the last one ended, and detects all pairs.
  void detect();
  bool isDetected() const { return m_isDetected; }
  /// Ends the step, if a detection began it, at the positions now; guarded: after hold().
  void end(bool guarded);
  /// Of the next two steps: Scene::reset() acts at the end of the next one.
  void restart() { m_restarts = 2; }

  void appendElements(int pair, std::vector<imstk::CollisionElement>& a,
                      std::vector<imstk::CollisionElement>& b);
  void appendRows(int pair, std::vector<ParticleRow>& rows);
  double gapOf(int pair) const;
  bool isEnabled(int pair) const;
  std::string nameOf(int pair) const;
  bool hasRigidBody(int pair) const;
  /// Whether a pair wants further sweeps, and a haptic tool may press particles: a rigid body on
  /// which a force from outside the solver acts in this step, as that of a PbdObjectController.
  bool sweepsFurther(int pair) const;
  imstk::PbdModel* modelOf(int pair) const;  ///< null: no PbdObject
  /// A handler with rows in this step.
  void addHandler(PalpateCH* handler) { m_handlers.push_back(handler); }

  bool trusted() const { return m_isTrusted; }
  std::size_t held() const { return m_held; }
  std::string error() const;
  void warn(const std::string& message);
  void note(const std::string& message);  ///< a warning that is no error

 private:
  struct Body;
  struct Pair;
  template <class F>
  bool attempt(F&& f);
  int bodyOf(const std::shared_ptr<imstk::Geometry>& geometry,
             const std::shared_ptr<imstk::CollidingObject>& object);
  int addPairOfBodies(int a, int b, const PalpateSettings& settings, bool isPicked);
  void read(Body& body, bool startsStep);
  bool write(Body& body, bool last);
  void draw(Body& body);
  void project();
  std::size_t hold();
  std::size_t hold(std::vector<int>& touching);
  void publishError();
  void findCrossedPairs();
  void setDefaults(Pair& pair);

  std::unique_ptr<CollisionStep> m_step;
  std::vector<Body> m_bodies;
  std::vector<Pair> m_pairs;
  std::vector<Pair> m_newPairs;
  std::unordered_map<const imstk::Geometry*, double> m_radii;
  std::set<std::shared_ptr<imstk::CollidingObject>> m_shown;
  std::vector<PalpateCH*> m_handlers;
  bool m_isDetected = false, m_hasAnswer = false, m_isRestarted = false;
  // Read and set from other threads, as m_error.
  std::atomic<int> m_restarts{0};
  std::atomic<bool> m_isTrusted{false};
  std::atomic<std::size_t> m_held{0};
  mutable std::mutex m_errorLock;
  std::string m_error;
  std::string m_stepError, m_lastWarning;  // of the step's thread
};

}  // namespace palpate
