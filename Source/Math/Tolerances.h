#pragma once

#include "Exact/ErrorBounds.h"

// The tolerances of what is decided in double, with their units and where they come from. u = 2^-53
// is the rounding unit. Boxes and filters in float have theirs where their derivations are: boxes
// in Math/Box.h and Octree, filters in Mesh/UnfoldedStars and NarrowPhase.
namespace palpate {

// ---- Signs of polynomials in coordinate differences (ClosestPoint.cpp) ----

/// The same where they are multiplied by products of moderate coordinates, 2^200 at most.
constexpr double kUnderflowGuardOfProducts = 0x1p-800;

// ---- Closest points (ClosestPoint.cpp) ----

/// Added and taken away again it rounds a weight to a multiple of 2^-26, so that its product with
/// half of a split double is exact.
constexpr double kCoarseWeight = 0x1.8p26;
/// The Newton step after the coarse weight must be this short at most: its own rounding is then
/// 2^-70 of the largest coordinate difference at the narrowest angle below. A longer one means that
/// the first estimate was bad, as of a feature tiny beside its distance.
constexpr double kFineWeight = 0x1p-20;
/// Relative to the largest coordinate difference. A residual is off by 2^-76 at most, so that
/// longer ones have a true direction and shorter ones may be zero.
constexpr double kTouching = 0x1p-66;
/// Of two lengths, each within 4 u: closer ones are told apart in integers, because the closest
/// points of nearly parallel edges may lie far apart at almost the same distance.
constexpr double kTie = 1 + 0x1p-49;
/// Squared sine of the angle between two edges below which their cross product is taken with
/// compensation: its plain error of 5 u over the sine would spoil the Newton step.
constexpr double kNarrowAngleSquare = 0x1p-16;
/// Squared sine below which the compensated Newton step is left to integers.
constexpr double kSliverAngleSquare = 0x1p-40;
/// Of accurateCross(), in the sum of magnitudes: relative to the result, and to the product of the
/// factors' sums (3 2^-103, and m's own 2^-104 of the positions).
constexpr double kAccurateCrossError = 0x1p-52;
constexpr double kAccurateCrossLoss = 0x1p-101;

// ---- Impacts (RelativeMotion.cpp, FindTouch.cpp, FindApproach.cpp, ImpactFilter.cpp) ----

/// L. Bounds hold for coordinate differences up to this: no product overflows, and all that
/// underflow can lose, under 2^-800, is within kImpactUnderflow.
constexpr double kLargestImpactDifference = 0x1p200;
constexpr double kImpactUnderflow = 0x1p-700;
/// Of a Bernstein coefficient of det(A, B, C), relative to the permanent of the largest magnitudes
/// over the step, of whose terms none is exceeded: 11 u (three differences, two products, at most
/// six sums and a division) and the permanent's own rounding.
constexpr double kCoplanarityError = 16 * 0x1p-53;
/// Of restricting a polynomial to part of the step, relative to its largest coefficient: nine
/// roundings and those of the weights.
constexpr double kBlossomError = 16 * 0x1p-53;
/// Of a Bernstein coefficient of a component of a cross product restricted to part of the step,
/// relative to the sum of the two products' largest magnitudes: 8 u, and 6 u from restricting.
constexpr double kCrossError = 32 * 0x1p-53;
/// Of a corner's position along a direction, relative to the sum of the products' magnitudes: 1 u
/// from the difference, 3 u from the dot product, 4 u from interpolating in time, and the same
/// again for what it is compared with.
constexpr double kAlongError = 16 * 0x1p-53;
/// Of det(A, B, C) between two times, relative to the permanent, and of A x B, relative to the
/// product of their largest lengths: 4 u for each factor at a time, and at most 16 u as for
/// kCoplanarityError.
constexpr double kPlaneError = 32 * 0x1p-53;
/// Below this a direction's length loses precision to underflow.
constexpr double kShortestDirection = 0x1p-500;
/// Of the step: the smallest tolerance that is kept.
constexpr double kSmallestTimeTolerance = 0x1p-50;
/// Of a coordinate of a moving corner less the distance, relative to both: the difference of two
/// positions, that less the distance, and this bound's own rounding.
constexpr double kApproachBoxError = 0x1p-51;
/// Of the quotient of two differences, each its operands' nearest, relative: 3 u, and above that.
constexpr double kQuotientError = 0x1p-50;
/// Relative to the largest coordinate difference and the minimum distance: the distance at which
/// findApproach() may report, beyond tolerance * displacement. At 2^-36 the direction in which its
/// features are apart is right to 2^-39 (2^-50, and 2^-76 of twice the largest difference over the
/// distance), which takes at most 2^-38 of the largest difference, √3 of it away, from what corners
/// are apart.
constexpr double kApproachSlack = 0x1p-36;
/// The same as promised: with what the distance computed there is off by, under 2^-45.
constexpr double kApproachError = 0x1p-35;
/// Of the step: findApproach() asks whether the features are near, and reports, where it cannot go
/// on for longer than this or the tolerance. Any value keeps its promises; smaller ones take more
/// steps within what it may report.
constexpr double kShortStretch = 0x1p-20;
/// Of det(A, B, C) with components up to 1 (sideBefore()): six terms of 12 u, twice.
constexpr double kSideError = 0x1p-46;
/// Of the step: how far before an impact sideBefore() looks first; where that is too near to tell,
/// ever further, so any value will do.
constexpr double kFirstStepBack = 0x1p-44;

// ---- Shapes (Shapes/Shape.cpp, Queries/ElementsNearShape.cpp) ----

/// Of an edge: how closely its point nearest to a shape is bracketed, and how near to an end it is
/// that end. The least distance varies by the square of that.
constexpr double kEdgeWeight = 0x1p-50;
/// Relative to a shape's magnitude: nearer to a capsule's axis, or out of a face, the direction to
/// it is rounding; and of two faces, this much nearer, which is nearer.
constexpr double kOnSurface = 0x1p-48;
/// Relative to the largest difference of two shapes' points: how closely their distance is
/// bracketed. Each difference carries two roundings, its height five more.
constexpr double kShapePairGap = 0x1p-46;
/// Of the sizes of two shapes whose distance is that of the body of differences; beyond it that gap
/// may be larger than the smaller shape.
constexpr double kMostSizeRatio = 0x1p40;
/// L: the same where differences are so small that their own roundings are larger.
constexpr double kSmallestShapePairGap = 0x1p-1068;
/// Squared sine from a capsule's axis below which another direction across it is taken: any value.
constexpr double kAcrossSquare = 0x1p-10;
/// Of R^T R from 1: rotations as exact as users have them; boxes and cylinders take the nearest one
/// that is exact to double.
constexpr double kOrthonormal = 1e-9;
/// Relative to the magnitudes of a box and a shape: a distance bounded from a box's centre carries
/// some twenty roundings.
constexpr double kShapeBoundError = 0x1p-46;

// ---- The nearest point of a surface (Queries/Containment.cpp) ----

/// Relative, of squared distances and of products of lengths: a dozen roundings each, and above
/// that.
constexpr double kNearestError = 0x1p-40;
/// Relative to the distance of a triangle's furthest corner: what a distance to the triangle is off
/// by, under 2^-48, and above that.
constexpr double kNearestSlack = 0x1p-45;

// ---- Winding numbers (SolidAngle.h, Queries/WindingNumber.cpp) ----

/// Of both parts of a triangle's half solid angle, from unit vectors within 3 u each: 9 u and the
/// products' 6 u, and 3 (6 u + 4 u) and the sums' 8 u; with the angle's own rounding.
constexpr double kSolidAngleError = 80 * 0x1p-53;
/// Relative to what clusters add: some thirty roundings on the way up the tree, and of their
/// centres relative to the coordinates.
constexpr double kClusterError = 0x1p-46;
/// For each triangle: twice what one that is not near adds to the error of a sum of all.
constexpr double kWindingSlack = 0x1p-44;

// ---- Bodies placed in the world (CollisionDetection/RigidBody.cpp) ----

/// Of fl(R x + t), relative to the sum of its terms' magnitudes: 4 u; of a difference of two 9 u;
/// and of what is compared with them, computed from a box's centre, some ten roundings.
constexpr double kPlacedError = 0x1p-48;
/// L: coordinates of bodies and translations up to this are placed without overflow.
constexpr double kLargestPlaced = 0x1p1000;

// ---- Contact frames (CollisionDetection/ContactMotions.cpp) ----

/// Of the squared sum of two unit vectors: below it they are opposite but for rounding.
constexpr double kOppositeSquare = 0x1p-80;

// ---- Penetration directions (Queries/PenetrationTracker.cpp) ----

/// Of a triangle's edge, normal and what is across both from being orthonormal: beyond it the
/// normal is no more than rounding. Any value.
constexpr double kAxesError = 0x1p-20;

// ---- Triangles without area in contacts (NarrowPhase/StepCheck.cpp) ----

/// Squared sine of an angle of a triangle above which it certainly has area: u^2 and more. Any
/// value above the rounding of a cross product.
constexpr double kFlatSquare = 0x1p-60;

// ---- Motion bounds (Motion.cpp, MotionBound.cpp) ----

/// Relative, and of a distance relative to the largest coordinate difference beside it: a
/// displacement carries 2 u, a difference of two 5 u, its length 4 u more; a distance is within 16
/// u of the largest coordinate difference (<palpate/Distance.h>).
constexpr double kMotionError = 0x1p-46;
/// Of the time tolerance, added to a motion that extends a thickness, relative: covers twice what
/// Continuous may report early.
constexpr double kMotionSlack = 4;
/// Relative, of squared lengths of displacements: how far below the limit certainly slow ones are.
/// Any value above a dozen roundings.
constexpr double kSlowSlack = 0x1p-20;
/// L²: squares above this lose nothing of note to underflow.
constexpr double kSmallestSlowSquare = 0x1p-900;

}  // namespace palpate
