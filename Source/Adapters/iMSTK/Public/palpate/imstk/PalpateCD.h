#pragma once

#include <palpate/Export.h>
#include <palpate/imstk/PalpateScene.h>

#include <imstkCCDAlgorithm.h>
#include <imstkMacros.h>

#include <memory>
#include <utility>
#include <vector>

namespace palpate {

/// The detection "PalpateCD" of imstk::CDObjectFactory, for surface, tetrahedral, line and point
/// meshes, Sphere, Capsule, Cylinder, OrientedBox and Plane, in either order, and for one mesh with
/// itself. A PalpateScene shares its work among interactions. Without one, as in a picker, it is an
/// OctreeBasedCD of its own, whose step begins at the positions of the last update(), and every
/// cell that touches is an element.
/// Elements of meshes: a CellIndex for each, of one vertex, of two vertices (edge), or of three
///          (triangle). parentId is the lowest cell of the mesh that has these vertices; without a
///          PalpateScene there is an element for each of these cells. Of a
///          shape: a PointDirection, with a PointIndexDirection for a vertex, or a CellIndex for an
///          edge or triangle. Two shapes: a PointDirection for each.
/// Depth    positive where they overlap. `dir` of a side is the direction in which it leaves.
class PALPATE_EXPORT PalpateCD : public imstk::CCDAlgorithm {
 public:
  PalpateCD();
  ~PalpateCD() override;
  IMSTK_TYPE_NAME(PalpateCD)

  /// Of an object without a PalpateScene. Call it before the first update().
  void setSettings(const PalpateSettings& settings) { m_settings = settings; }

  /// Ends the step.
  void updatePreviousTimestepGeometry(std::shared_ptr<const imstk::Geometry> geometryA,
                                      std::shared_ptr<const imstk::Geometry> geometryB) override;

  /// For PalpateScene and PalpateCH.
  void setStep(std::shared_ptr<SceneStep> step);
  void setPair(int pair) { m_pair = pair; }
  const std::shared_ptr<SceneStep>& step() const { return m_step; }
  int pair() const { return m_pair; }

 protected:
  void computeCollisionDataAB(std::shared_ptr<imstk::Geometry> geometryA,
                              std::shared_ptr<imstk::Geometry> geometryB,
                              std::vector<imstk::CollisionElement>& elementsA,
                              std::vector<imstk::CollisionElement>& elementsB) override;

 private:
  PalpateSettings m_settings;
  std::shared_ptr<SceneStep> m_step;
  int m_pair = -1;
  bool m_ownStep = false;
  std::pair<std::shared_ptr<imstk::Geometry>, std::shared_ptr<imstk::Geometry>> m_inputs;  // of it
};

}  // namespace palpate
