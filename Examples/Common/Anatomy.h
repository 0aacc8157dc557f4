#pragma once

#include "Implicit.h"

#include <vector>

namespace palpate::scenes {

// Organs of the upper abdomen in clinical proportions and millimetres, for pictures. They are made
// by formulas and are not models of anybody. x leads to the body's left, y to the back, z to the
// head; the origin is below the middle of the liver.

SceneMesh anatomicalLiver(double edge);  ///< two lobes, 194 mm wide; it has a fossa
bool isInLiver(const Eigen::Vector3d&);
SceneMesh anatomicalGallbladder(double edge);  ///< in the fossa, 45 mm long, with the cystic duct
SceneMesh anatomicalStomach(double edge);      ///< 141 mm high
SceneMesh anatomicalKidney(double edge);       ///< the right one, 102 mm long
SceneMesh anatomicalSpleen(double edge);       ///< 110 mm long
SceneMesh portalVein(double edge);
SceneMesh hepaticArtery(double edge);
SceneMesh bileDuct(double edge);

}  // namespace palpate::scenes
