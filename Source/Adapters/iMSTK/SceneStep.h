#pragma once

#include "iMSTK/CollisionStep.h"

#include <palpate/imstk/PalpateScene.h>

#include <imstkCollisionData.h>
#include <imstkMath.h>
#include <imstkPbdConstraint.h>

#include <cstddef>
#include <memory>
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
  void restart() { m_restarts = true; }

  void appendElements(int pair, std::vector<imstk::CollisionElement>& a,
                      std::vector<imstk::CollisionElement>& b);
  void appendRows(int pair, std::vector<ParticleRow>& rows);
  double gapOf(int pair) const;
  imstk::PbdModel* modelOf(int pair) const;  ///< null: no PbdObject

  bool trusted() const { return m_isTrusted; }
  std::size_t held() const { return m_held; }
  const std::string& error() const { return m_error; }
  void warn(const std::string& message);

 private:
  struct Body;
  struct Pair;
  template <class F>
  bool attempt(F&& f);
  int bodyOf(const std::shared_ptr<imstk::Geometry>& geometry,
             const std::shared_ptr<imstk::CollidingObject>& object);
  int addPairOfBodies(int a, int b, const PalpateSettings& settings);
  void read(Body& body, bool startsStep);
  void write(Body& body);

  std::unique_ptr<CollisionStep> m_step;
  std::vector<Body> m_bodies;
  std::vector<Pair> m_pairs;
  std::vector<Pair> m_newPairs;
  std::unordered_map<const imstk::Geometry*, double> m_radii;
  bool m_isDetected = false, m_hasAnswer = false, m_restarts = false, m_isTrusted = false;
  std::size_t m_held = 0;
  std::string m_error, m_lastWarning;
};

}  // namespace palpate
