#pragma once

#include "Meshes.h"

#include <Eigen/Geometry>

#include <functional>

namespace palpate::scenes {

/// A body as the positions where a function is negative. The function is about a distance in mm.
using Implicit = std::function<double(const Eigen::Vector3d&)>;

/// The least of two functions, rounded where they are within `radius` of each other.
double smoothMin(double a, double b, double radius);
inline double smoothMax(double a, double b, double radius) { return -smoothMin(-a, -b, radius); }

/// About the distance to an ellipsoid.
double toEllipsoid(const Eigen::Vector3d& p, const Eigen::Vector3d& centre,
                   const Eigen::Vector3d& radii);
/// The distance to a segment less a radius that changes evenly from end to end.
double toCone(const Eigen::Vector3d& p, const Eigen::Vector3d& p0, const Eigen::Vector3d& p1,
              double radius0, double radius1);

/// The surface of the body inside the box, in triangles with sides of about `edge`. Closed if the
/// body is inside the box. Outward winding.
///
/// Source   naive surface nets (Gibson, 1998), with corners moved to the surface.
SceneMesh meshOf(const Implicit&, const Eigen::AlignedBox3d&, double edge);

}  // namespace palpate::scenes
