#pragma once

/// Includes the headers that most programs need.
#include <palpate/Capture.h>
#include <palpate/CollisionData.h>
#include <palpate/ConstraintRows.h>
#include <palpate/Error.h>
#include <palpate/OctreeBasedCD.h>
#include <palpate/PenetrationTracker.h>
#include <palpate/Settings.h>
#include <palpate/StepGuard.h>
#include <palpate/Types.h>
