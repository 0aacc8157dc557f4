#pragma once

#include "Bodies/Body.h"
#include "Octree/BoxMap.h"
#include "Octree/Traversal.h"
#include "Mesh/FloatPositions.h"
#include "Mesh/Positions.h"

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <optional>

namespace palpate {

/// The float frame of a body's octree as it stands in the world now: positions of the world become
/// floats, and boxes of floats become boxes in the world. OctreeFrame.cpp proves the bounds of the
/// errors.
class OctreeFrame {
 public:
  explicit OctreeFrame(const Body&);

  /// Where the zero of the floats is in the world.
  const Eigen::Vector3d& origin() const { return m_origin; }
  double scale() const { return m_frame.scale; }
  double unit() const { return 1.0 / m_frame.scale; }  ///< L: of the floats
  /// L: the sum of the coordinates that positions in the world come from.
  double magnitude() const { return m_origin.cwiseAbs().sum() + m_frame.origin.cwiseAbs().sum(); }

  /// In the frame, in double. The inverse of an inexact rotation is taken as its transpose.
  Eigen::Vector3d toFrame(const Eigen::Vector3d& position) const {
    return turned(m_frame.scaled(m_origin, position));
  }
  /// A direction of the world in the body.
  Eigen::Vector3d turned(const Eigen::Vector3d& direction) const {
    return m_pose ? Eigen::Vector3d(m_pose->rotation.transpose() * direction) : direction;
  }
  /// In units of the floats: bounds what doubles lose of the difference between a position and a
  /// vertex in the frame, besides their share of the coordinates in the frame.
  double error() const;
  /// In units of the floats: bounds the error of the distance between a position and an element of
  /// the octree. Infinite where floats are clamped.
  float slackAt(const FloatPoint& position) const;

  /// The map from boxes of the octree to boxes in the world, as floats relative to `origin`. It
  /// grows them by `thickness`, in units of these floats. The boxes enclose the positions now, or
  /// the whole step. For a body that is not placed, the map changes nothing.
  BoxMap toWorld(const Eigen::Vector3d& origin, double thickness, bool wholeStep) const;
  BoxMap toWorld(bool wholeStep = false) const { return toWorld(m_origin, 0.0, wholeStep); }
  /// L, relative to origin(): a box that toWorld() returned. None if the box may hold anything.
  std::optional<Eigen::AlignedBox3d> lengthsOf(const FloatBox& inWorld) const {
    return m_frame.lengthsOf(inWorld);
  }
  /// A position of the world as a box that compares with those of toWorld().
  FloatBox boxInWorld(const Eigen::Vector3d& position) const {
    return OutwardRounding::outward(FloatFrame::rounded(m_frame.scaled(m_origin, position)).box());
  }

 private:
  const Body& m_body;
  const FloatFrame& m_frame;
  const Pose* const m_pose;  ///< null: not placed
  const Eigen::Vector3d m_origin;
};

/// The frame in which a traversal compares boxes of two geometries.
enum class BoxFrame {
  World,  ///< candidates are defined there
  /// If both are placed: that of a body which does not turn while boxes enclose the step, b's if
  /// possible; else the world. Elements within the thickness are found in any frame. Here fewer
  /// others are, and faster, because only one geometry's boxes are mapped.
  Body
};

/// The octrees of two geometries, whose frames have one scale, for a traversal. thickness: L.
TreePair treesOf(const Body& a, const Body& b, double thickness, bool wholeStep,
                 BoxFrame frame = BoxFrame::World);
/// The map of b's boxes to a's floats, where a is moved by `shift`, L in the world. a's rotation
/// leaves distances from a's origin as they are within kOrthonormal.
BoxMap mapBetween(const Body& a, const Body& b,
                  const Eigen::Vector3d& shift = Eigen::Vector3d::Zero());
/// In a's floats: boxes of elements with a common point may be so far apart in mapBetween().
float boxErrorOf(const Body& a, const Body& b);

}  // namespace palpate
