#pragma once

// Includes the headers that most programs need, and with them those of all types in their
// functions. You may rely on that. Include <palpate/Distance.h>, <palpate/Intersection.h>,
// <palpate/TimeOfImpact.h>, <palpate/ClosedMesh.h>, <palpate/ArrayAdapter.h> and standard headers
// yourself where you use them.
#include <palpate/Capture.h>
#include <palpate/CollisionData.h>
#include <palpate/ConstraintRows.h>
#include <palpate/Error.h>
#include <palpate/OctreeBasedCD.h>
#include <palpate/PenetrationTracker.h>
#include <palpate/Settings.h>
#include <palpate/StepGuard.h>
#include <palpate/Types.h>
