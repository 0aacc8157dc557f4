#pragma once

// Includes all headers of the library but those of optional targets, such as Palpate::Simplify.
#include <palpate/AnalyticalGeometry.h>
#include <palpate/ArrayAdapter.h>
#include <palpate/Capture.h>
#include <palpate/CollisionData.h>
#include <palpate/ConstraintRows.h>
#include <palpate/DistanceField.h>
#include <palpate/Error.h>
#include <palpate/Executor.h>
#include <palpate/FeaturePairs.h>
#include <palpate/FrameStatistics.h>
#include <palpate/LooseOctree.h>
#include <palpate/Meshes.h>
#include <palpate/OctreeBasedCD.h>
#include <palpate/PenetrationTracker.h>
#include <palpate/Settings.h>
#include <palpate/Snapshot.h>
#include <palpate/SpatialQueries.h>
#include <palpate/StepGuard.h>
#include <palpate/ThreadTopology.h>
#include <palpate/Tracking.h>
#include <palpate/Types.h>
#include <palpate/Validity.h>
