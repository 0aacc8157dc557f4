#pragma once

#include <palpate/Export.h>

#include <cstddef>
#include <memory>
#include <string>

namespace imstk {
class CollidingObject;
class CollisionInteraction;
class Geometry;
class PbdObjectCollision;
class Scene;
}  // namespace imstk

// These headers need C++14, and none of Palpate's that need C++20.

namespace palpate {

class SceneStep;

enum class PalpateMethod {
  /// With a thickness Auto. Without one Intersection for two surfaces, Proximity for a pair with a
  /// shape, else Continuous.
  Default,
  Auto,
  Intersection,
  Proximity,
  Continuous
};
PALPATE_EXPORT const char* toString(PalpateMethod) noexcept;  ///< its name, or "unknown"

/// How one interaction is detected. Lengths are in L, the scene's unit.
struct PalpateSettings {
  PalpateMethod method = PalpateMethod::Default;
  /// Features at most this far apart are contacts. Negative, and 0 of makeCollision() but for
  /// Intersection: a fiftieth of the diagonal of the smaller body's box, or half the mean length of
  /// its edges if that is less.
  double thickness = 0.0;
  double gap = -1.0;  ///< that PalpateCH keeps; negative: half the thickness
  /// Self-collision: nearer features along edges, at rest, do not touch. With the thickness chosen
  /// by default, 0 is twice that.
  double restDistance = 0.0;
  /// Whether the end of the step holds back what would pass through. False for a needle, which is
  /// meant to pass.
  bool guarded = true;
  /// Whether PalpateCH sweeps further around a haptic tool. False saves at most the time of the
  /// solver's iterations in one thread, and the tool feels softer tissue.
  bool furtherSweeps = true;
};

/// One OctreeBasedCD for all interactions of an iMSTK scene. Each geometry is added once. One task
/// node detects all pairs, after the geometries and before the interactions of a step.
/// Use      create it before the scene is initialized. The scene keeps it.
/// Step     begins where the last one ended; the first one at the positions before iMSTK's first
///          prediction. A PbdObject that something else moved in between begins where it is.
/// Guard    runs once in each step, after the solver and before iMSTK computes velocities, when the
///          first interaction calls CCDAlgorithm::updatePreviousTimestepGeometry(). It moves the
///          particles and rigid bodies of PbdObjects. Other objects are held inside Palpate only,
///          but for showHeld(): their geometries stay where your program put them, and the next
///          step begins where they were held. All PbdObjects must share one PbdModel.
/// Crossing pairs at a step's start are named in iMSTK's log, and not guarded until they are apart.
/// Cuts     a geometry whose cells or number of vertices changed is replaced before the detection.
/// Errors   are logged by iMSTK as warnings, each once in a row; error() has the last step's. A step whose
///          detection failed has no contacts and no guard.
class PALPATE_EXPORT PalpateScene {
 public:
  /// threads: 0: as many as iMSTK's thread pool has.
  explicit PalpateScene(const std::shared_ptr<imstk::Scene>& scene, int threads = 0);
  ~PalpateScene();

  /// An interaction with PalpateCD and PalpateCH, to be added to the scene. One object is a
  /// PbdObject. For self-collision pass it twice.
  std::shared_ptr<imstk::PbdObjectCollision> makeCollision(
      const std::shared_ptr<imstk::CollidingObject>& a,
      const std::shared_ptr<imstk::CollidingObject>& b, const PalpateSettings& settings = {});

  /// Takes in an interaction of any class, as NeedleInteraction, and keeps its handler. A PalpateCD
  /// replaces its detection. False, with a warning, without a handler.
  bool share(const std::shared_ptr<imstk::CollisionInteraction>& interaction,
             const PalpateSettings& settings = {});

  /// L, of the lines or points of a geometry. Call it before the scene is initialized.
  void setRadius(const std::shared_ptr<imstk::Geometry>& geometry, double radius);

  /// The guard moves the colliding geometry of an object that no solver moves to where it holds it,
  /// and updates its visual geometry. Your program sets its place anew in each step, as from a
  /// device; otherwise it stays there. Call it before the scene is initialized.
  void showHeld(const std::shared_ptr<imstk::CollidingObject>& object);

  /// The next two steps begin where all objects then are, PbdObjects as always. Call it with
  /// Scene::reset(), which acts at the end of the next step, and when an object that is no
  /// PbdObject jumps.
  /// Threads  restart(), trusted(), held() and error() may be called from any thread.
  void restart();

  /// Whether all answers of the last detection are trusted (Docs/HowTo/Validity.md).
  bool trusted() const;
  /// The number of vertices and bodies that the last guard held back.
  std::size_t held() const;
  /// Of the last step that ended, or empty.
  std::string error() const;

 private:
  std::shared_ptr<SceneStep> m_step;
};

}  // namespace palpate
