#pragma once

#include "Exact/ErrorBounds.h"

// The tolerances of decisions in double, with their units and derivations. u = 2^-53 is the
// rounding unit. Tolerances of boxes and filters in float are beside their derivations: boxes in
// Math/Box.h and Octree, filters in Mesh/UnfoldedStars and NarrowPhase.
namespace palpate {

// ---- Signs of polynomials in coordinate differences (EdgeEdgeDistance.cpp, Shapes) ----

/// kUnderflowGuard for signs that are multiplied by products of moderate coordinates, 2^200 at
/// most.
constexpr double kUnderflowGuardOfProducts = 0x1p-800;

// ---- Closest points (Foot.cpp, EdgeEdgeDistance.cpp) ----

/// Adding and subtracting this rounds a weight to a multiple of 2^-26. Its product with half of a
/// split double is then exact.
constexpr double kCoarseWeight = 0x1.8p26;
/// Weights are multiples of this. Those of a point inside a face sum to 1 and one of these at most,
/// unless the weight along a short edge is off by more. Integers then replace both.
constexpr double kWeightStep = 0x1p-53;
/// The longest Newton step that is accepted after the coarse weight. Its own rounding is then 2^-70
/// of the largest coordinate difference at the narrowest angle below. A longer step means that the
/// first estimate was bad, as for a feature that is tiny compared to its distance.
constexpr double kFineWeight = 0x1p-20;
/// Relative to the largest coordinate difference. A residual is off by 2^-76 at most. Longer
/// residuals therefore have a true direction, and shorter ones may be zero.
constexpr double kTouching = 0x1p-66;
/// Ratio of two lengths, each within 4 u. Lengths that are closer than this are compared in
/// integers, because the closest points of nearly parallel edges may lie far apart at almost the
/// same distance.
constexpr double kTie = 1 + 0x1p-49;
/// Squared sine of the angle between two edges. Below it, their cross product is computed with
/// compensation, because its plain error of 5 u over the sine would spoil the Newton step.
constexpr double kNarrowAngleSquare = 0x1p-16;
/// Squared sine below which integers replace the compensated Newton step.
constexpr double kSliverAngleSquare = 0x1p-40;
/// Errors of accurateCross(), in the sum of magnitudes: relative to the result, and relative to the
/// product of the factors' sums (3 2^-103, and m's own 2^-104 of the positions).
constexpr double kAccurateCrossError = 0x1p-52;
constexpr double kAccurateCrossLoss = 0x1p-101;

/// Relative to the size of both elements' boxes and the thickness: by how much the gap between the
/// boxes may be more than a thickness that a computed distance does not exceed. A distance is off
/// by 2^-49 of the size (edgeEdgeDistance()). The gap, the sum of thickness and radii, and the
/// subtraction of radii add less than 2^-50 of size and thickness.
constexpr double kBoxGapError = 0x1p-48;
/// Relative to the thickness: boxes in float never miss a gap that is more than it by this, so that
/// they find all pairs that boxes in double do (setShift()).
constexpr double kFloatBoxGap = 0x1p-26;

// ---- Impacts (RelativeMotion.cpp, FindTouch.cpp, FindApproach.cpp, ImpactFilter.cpp) ----

/// L. The bounds hold for coordinate differences up to this. No product then overflows, and
/// kImpactUnderflow covers all that underflow can lose, which is under 2^-800.
constexpr double kLargestImpactDifference = 0x1p200;
constexpr double kImpactUnderflow = 0x1p-700;
/// Error of a Bernstein coefficient of det(A, B, C), relative to the permanent of the largest
/// magnitudes over the step, which bound every term: 11 u (three differences, two products, at most
/// six sums and a division) and the permanent's own rounding.
constexpr double kCoplanarityError = 16 * 0x1p-53;
/// Error of restricting a polynomial to part of the step, relative to its largest coefficient: nine
/// roundings and those of the weights.
constexpr double kBlossomError = 16 * 0x1p-53;
/// Error of a Bernstein coefficient of a component of a cross product restricted to part of the
/// step, relative to the sum of the two products' largest magnitudes: 8 u, and 6 u from
/// restricting.
constexpr double kCrossError = 32 * 0x1p-53;
/// Share of the step: wider brackets of a root are left to findPassages().
constexpr double kWidestPassage = 0x1p-43;
/// Error of a component of a cross product in the middle of such a bracket, relative to the product
/// of the largest magnitudes (PassageFilter.cpp): 16 w for the motion in a bracket of width w, and
/// four times kCrossError. What is certain with it is so for all coefficients of kCrossError.
constexpr double kPassageError = 0x1p-38;
constexpr double kPassageUnderflow = 8 * kImpactUnderflow;
/// Error of a corner's position along a direction, relative to the sum of the products' magnitudes:
/// 1 u from the difference, 3 u from the dot product, 4 u from interpolating in time, and the same
/// again for the value that it is compared with.
constexpr double kAlongError = 16 * 0x1p-53;
/// Error of det(A, B, C) between two times, relative to the permanent, and of A x B, relative to
/// the product of their largest lengths: 4 u for each factor at a time, and at most 16 u as for
/// kCoplanarityError.
constexpr double kPlaneError = 32 * 0x1p-53;
/// Below this a direction's length loses precision to underflow.
constexpr double kShortestDirection = 0x1p-500;
/// Share of the step: smaller time tolerances are raised to this.
constexpr double kSmallestTimeTolerance = 0x1p-50;
/// Error of a moving corner's coordinate less the distance, relative to both: the difference of two
/// positions, the subtraction of the distance, and this bound's own rounding.
constexpr double kApproachBoxError = 0x1p-51;
/// Relative error of the quotient of two correctly rounded differences: 3 u, and a margin.
constexpr double kQuotientError = 0x1p-50;
/// Relative to the largest coordinate difference and the minimum distance: how far beyond tolerance
/// * displacement findApproach() may report. At 2^-36 the direction in which its features are apart
/// is right to 2^-39 (2^-50, and 2^-76 of twice the largest difference over the distance). A corner
/// is at most √3 of the largest difference away. The error therefore takes at most 2^-38 of the
/// largest difference from its distance along the direction.
constexpr double kApproachSlack = 0x1p-36;
/// The bound that is promised to users: kApproachSlack and the error of the distance computed at
/// the reported time, under 2^-45.
constexpr double kApproachError = 0x1p-35;
/// Share of the step: findApproach() checks whether the features are near, and reports, if it
/// cannot advance by more than this or the tolerance. Any value keeps its promises; smaller values
/// take more steps within the distance at which it may report.
constexpr double kShortestAdvance = 0x1p-20;
/// Error of det(A, B, C) with components up to 1 (sideBefore()): six terms of 12 u, twice.
constexpr double kSideError = 0x1p-46;
/// Share of the step: how far before an impact sideBefore() evaluates the side first. It goes back
/// further where that is too near to decide, so any value will do.
constexpr double kFirstStepBack = 0x1p-44;
/// Relative to the largest coordinate difference. Positions at a time are off by 2^-50 of it. The
/// direction between two points at least this far apart is therefore right to 2^-24.
constexpr double kCertainDirection = 0x1p-26;

// ---- Free motion (FreeMotion.cpp) ----

/// Relative to the largest magnitude of coordinates, radii and thickness: what rounding takes from
/// a gap and from the motions that share it, some 140 u on both sides together, and a margin.
constexpr double kFreeMotionError = 0x1p-44;
/// Relative to the extent of two features and their distance of contact: how much nearer than that
/// distance Continuous may report them. The motion increases the extent up to sixfold, so that this
/// is eight times kApproachError.
constexpr double kFreeMotionApproach = 8 * kApproachError;

// ---- Normals of features that touch (Contact/TouchNormal.cpp) ----

/// Sine of an angle: unit vectors that differ by less are equal. Above kCertainDirection's 2^-24
/// and the rounding of a star's directions, and far below any angle that matters to a solver.
constexpr double kTouchAngle = 0x1p-20;
/// Weight of a closest point within the step: a smaller one may be the rounding of a touch at an
/// edge or a corner, whose star then decides. Far above the rounding of weights; a star that is
/// asked without need only has more triangles.
constexpr double kTouchWeight = 0x1p-20;
/// L: shorter vectors are scaled up before they are interpolated in time.
constexpr double kTinyLength = 0x1p-500;

/// Relative to the largest coordinate difference and the radii: how much nearer than before the
/// step findNearing() lets features come that begin within their radii. findApproach() reports
/// nothing before features have come nearer by this much less kApproachError.
constexpr double kNearingSlack = 0x1p-33;
/// The same in time tolerances, relative to the motion: an impact may be reported one of them too
/// early, and one more covers the error of the motion.
constexpr double kNearingTolerances = 4;
/// Segments whose radius varies are divided into this many pieces of one radius each where they
/// begin within their largest radius. Any number will do; a larger one is less conservative.
constexpr int kTaperPieces = 16;
/// Most times at which findNearing() measures such segments. Any number will do; a larger one lets
/// them move further along a surface.
constexpr int kMostClearances = 32;

// ---- Vertices behind a surface (Contact/Piercing.cpp) ----

/// Exit distances that differ by a smaller share are equal, so that rounding does not choose.
/// Far above the rounding of a crossing's place, and far below any difference that matters.
constexpr double kExitDistanceSlack = 0x1p-20;

// ---- Shapes (Shapes, Queries/ElementsNearShape.cpp) ----

/// Weight on an edge: the width to which its point nearest to a shape is bracketed. A point this
/// near to an end counts as the end. The least distance varies by the square of this.
constexpr double kEdgeWeight = 0x1p-50;
/// Weight on an edge, of 1 and the ratio of its start's distance from a cylinder's axis to its
/// length: from how far beside the weight of its point nearest to the axis on the sign of a
/// computed slope is right. The slope has some ten roundings.
constexpr double kTurnError = 0x1p-46;
/// Relative to a shape's magnitude. A point this near to a capsule's axis, or this little outside a
/// face, has a direction that is only rounding. Two faces whose distances differ by no more than
/// this are equally near.
constexpr double kOnSurface = 0x1p-48;
/// Relative to the largest difference of two shapes' points: the width to which their distance is
/// bracketed. Each difference carries two roundings, its height five more.
constexpr double kShapePairGap = 0x1p-46;
/// Largest ratio of the sizes of two shapes whose distance uses the Minkowski difference. Beyond
/// it, kShapePairGap may be larger than the smaller shape.
constexpr double kMaxSizeRatio = 0x1p40;
/// L: replaces kShapePairGap where differences are so small that their own roundings are larger.
constexpr double kSmallestShapePairGap = 0x1p-1068;
/// Squared sine of the angle between a direction and a capsule's axis. Below it, another direction
/// across the axis is used. Any value will do.
constexpr double kAcrossSquare = 0x1p-10;
/// Largest deviation of R^T R from the identity. Rotations are this exact; boxes and cylinders use
/// the nearest rotation that is exact to double.
constexpr double kOrthonormal = 1e-9;
/// The same of a user's rotation, which is made exact: in float, or a product of some of these.
constexpr double kRoughRotation = 1e-5;
/// Error of a distance bounded from a box's centre, relative to the magnitudes of the box and the
/// shape: some twenty roundings.
constexpr double kShapeBoundError = 0x1p-46;

// ---- The nearest point of a surface (Queries/Containment.cpp) ----

/// Relative error of squared distances and of products of lengths: a dozen roundings each, and a
/// margin.
constexpr double kNearestError = 0x1p-40;
/// Error of a distance to a triangle, relative to the distance of its furthest corner: under 2^-48,
/// and a margin.
constexpr double kNearestSlack = 0x1p-45;
/// Error of a ray's point on a triangle, relative to the largest coordinate difference between the
/// ray's origin and the triangle.
constexpr double kRayError = 0x1p-50;
/// Errors of the last step of a refined ray's parameter: of the step's dividend, relative to the
/// product of its factors' sums (2^-103 and 2^-98), and of its divisor.
constexpr double kRefinedRayLoss = 0x1p-96;
constexpr double kRefinedRayError = 0x1p-48;
/// Relative error of a quotient of integers that was rounded to double.
constexpr double kRationalError = 0x1p-52;
/// Error of a ray's interval inside a round segment, relative to the lengths that it comes from.
constexpr double kRoundRayError = 0x1p-44;
/// Error of a ray in a geometry's floats, relative to the largest coordinate (RayHits.cpp).
constexpr double kFloatRayError = 0x1p-18;
/// Error of the distance between two points in a geometry's floats, relative to the largest
/// coordinate: each of six coordinates is rounded by 2^-24.
constexpr float kFloatPointError = 0x1p-21f;
/// Error of a point's distance from a plane or a segment in a geometry's floats, relative to the
/// largest coordinate of both: some twenty roundings of 2^-24, and a margin.
constexpr double kFloatOverlapError = 0x1p-18;
/// Error of a triangle that is clipped by planes, relative to the size of both: some hundred
/// roundings, narrow corners of 1e-3, and a margin. kClipOrigin: part of it for the error of the
/// planes' common point, relative to its coordinates.
constexpr double kClipError = 0x1p-36;
constexpr double kClipOrigin = 0x1p-10;
/// Error of a point that was brought into a body's frame, relative to the magnitudes of the
/// coordinates: under 2^-49 for the point and for a vertex, and a margin.
constexpr double kPlacedPointError = 0x1p-46;

// ---- Distance fields (DistanceField) ----

/// Error of coordinates and distances in the proof of a cell's bound, relative to the largest
/// coordinate: some hundred roundings, and a margin.
constexpr double kFieldError = 0x1p-42;
/// Relative to a stored distance: its rounding to float, and that of interpolation.
constexpr double kStoredError = 0x1p-23;

/// Relative to the error bound or the band, whichever is less: the error of a corner's distance. It
/// is subtracted from the error bound. Any value far below 1 will do; a smaller one takes more
/// exact distances.
constexpr double kCornerError = 0x1p-20;

// ---- Winding numbers (SolidAngle.h, Queries/WindingNumber.cpp) ----

/// Error of both parts of a triangle's half solid angle, from unit vectors within 3 u each: 9 u and
/// the products' 6 u, and 3 (6 u + 4 u) and the sums' 8 u; with the angle's own rounding.
constexpr double kSolidAngleError = 80 * 0x1p-53;
/// Error relative to what clusters add: some thirty roundings on the way up the tree. The error of
/// their centres is relative to the coordinates.
constexpr double kClusterError = 0x1p-46;
/// For each triangle: twice what a triangle that is not near adds to the error of the whole sum.
constexpr double kWindingSlack = 0x1p-44;

// ---- Bodies placed in the world (CollisionDetection/RigidSearch.cpp) ----

/// Error relative to the sum of the terms' magnitudes: 4 u for fl(R x + t), and 9 u for a
/// difference of two. Values that are computed from a box's centre and compared with them have some
/// ten roundings.
constexpr double kPlacedError = 0x1p-48;
/// L: coordinates of bodies and translations up to this are transformed without overflow.
constexpr double kLargestPlaced = 0x1p1000;

// ---- Contact frames (CollisionDetection/ContactMotions.cpp) ----

/// Squared length of the sum of two unit vectors. Below it they are opposite within rounding.
constexpr double kOppositeSquare = 0x1p-80;

// ---- Penetration directions (Queries/PenetrationTracker.cpp) ----

/// Largest deviation from orthonormal of a triangle's edge, normal and the direction across both.
/// Beyond it the normal is no more than rounding. Any value will do.
constexpr double kAxesError = 0x1p-20;

// ---- Penetration of bodies (Queries/BodyPenetration.cpp, TranslationSweep.cpp) ----

/// Weight: how far beyond a feature's end two features may touch. It is far above the rounding of
/// weights, and only says where a search continues; exact tests decide where it ends.
constexpr double kExitWeight = 0x1p-30;
/// Relative to the largest coordinate: by how much a translation is longer than where surfaces
/// touch last. Any value well above the roundings of moved positions, some 2^-51, will do. Meshes
/// whose vertices are in front of neighbouring faces by no more than this count as convex.
constexpr double kExitSlack = 0x1p-40;
/// Relative to the largest coordinate: how far beside the middle of a triangle it is tested whether
/// a body is there. Well above the roundings of that point, some 2^-51. Thinner bodies count as
/// flat.
constexpr double kBesideTriangle = 0x1p-38;
/// Relative to the largest coordinate: by how much a body is made smaller where a translation is
/// searched, so that faces that lie in each other do not meet. Well above the roundings of
/// coordinates, and of kExitSlack.
constexpr double kInset = 0x1p-36;
/// Sine of an angle: a motion at less than this to a plane counts as along it. Above the rounding
/// of a unit vector, and so far below kInset that no such motion leads through an inset.
constexpr double kAlongPlane = 0x1p-44;
/// Relative to the largest coordinate: triangles that touch last later by no more than this need no
/// test, because a translation is longer by kExitSlack. Well above the roundings of coordinates.
constexpr double kSameTouch = 0x1p-42;
/// Relative to the largest coordinate: how far beside a point of a surface it is asked whether a
/// body ends there. Points where triangles intersect are right to some 2^-50, and triangles within
/// kExitSlack of such a point count as triangles at it.
constexpr double kOuterAside = 0x1p-32;
/// Relative to the largest coordinate: a translation of convex meshes is minimal if none is shorter
/// by more than this. It covers kExitSlack, and vertices in front of faces by that.
constexpr double kMinimalSlack = 0x1p-36;
/// Relative to the least depth so far: shorter improvements are not searched. Any small value will
/// do.
constexpr double kDepthGain = 0x1p-14;

// ---- Normals that elements exclude (Math/NormalCone.h) ----

/// Component of a contact's normal along a unit direction, towards which it certainly leads. A
/// normal is off by the rounding of coordinates, 2^-50 at most, over the distance that it was
/// computed from. The normals of bodies that lie flat on each other differ by no more.
constexpr double kNormalConeError = 0x1p-40;
/// Of the thickness: features at most this far from a contact's tangent plane are in it. Soft
/// tissue bends by more around a tool, and then needs all its contacts: with 2^-4, tools sink twice
/// as often into a sheet that rows push away.
constexpr double kPlaneShare = 0x1p-7;
/// Of the thickness: a straight body that rests on both sides of an edge may be nearer to the edge
/// by this, and the edge is no ridge. 64 such edges under one body add up to kPlaneShare.
constexpr double kRidgeShare = 0x1p-13;
/// Sine of an angle, and a share of a shape's size: normals that differ by less, at points further
/// apart, are of one flat or straight part of the shape. Any small angle and share will do.
constexpr double kSamePartAngle = 0x1p-10;
constexpr double kSamePartShare = 0x1p-3;
/// L²: squared lengths above this, and products with them, lose nothing significant to underflow.
constexpr double kSmallestEdgeSquare = 0x1p-900;

// ---- Triangles without area in contacts (NarrowPhase/StepCheck.cpp) ----

/// Squared sine of a triangle's angle above which the triangle certainly has area: u^2 and more.
/// Any value above the rounding of a cross product will do.
constexpr double kFlatSquare = 0x1p-60;

// ---- Motion bounds (Mesh/Motion.cpp, MotionBound.cpp, Validity, NarrowPhase/Auto.cpp) ----

/// Relative error of motions; for a distance, relative to the largest coordinate difference. A
/// displacement carries 2 u, a difference of two 5 u, and its length 4 u more. A distance is within
/// 16 u of the largest coordinate difference (<palpate/FeaturePairs.h>).
constexpr double kMotionError = 0x1p-46;
/// Multiple of the time tolerance by which a motion that extends a thickness is enlarged. It covers
/// twice what Continuous may report early.
constexpr double kMotionSlack = 4;
/// Relative to squared lengths of displacements: how far below the limit certainly slow ones are.
/// Any value above a dozen roundings will do.
constexpr double kSlowSlack = 0x1p-20;
/// L²: squares above this lose nothing significant to underflow.
constexpr double kSmallestSlowSquare = 0x1p-900;

/// Of a sum of unit normals around an edge or vertex: a shorter sum has no direction. Some hundred
/// roundings, so that faces in opposite directions cancel.
constexpr double kOpposedNormals = 0x1p-40;

/// Relative to the largest coordinate: by how much positions that a caller passes for a contact may
/// be off those of the step. Some roundings to float, as callers may keep floats.
constexpr double kRowPositions = 0x1p-20;

// ---- Surface proxies (DistanceField) ----

/// Relative: more than all roundings of a distance, a height or a bound along the way of a proof,
/// each of which has fewer than 32 operations.
constexpr double kProxySlack = 0x1p-40;
/// Relative to the largest coordinate of the cells, and of the translation of the body. A point is
/// taken into the body's frame with 16 roundings, its height above a plane has 6, and placing the
/// body's vertices in the world 6. The factors of a rotation are at most 1 + 2^-20.
constexpr double kProxyRounding = 64 * 0x1p-53;
/// rad. Planes stand for triangles on their front only.
constexpr double kWidestNormalCone = 1.5;
// ---- Contacts with distance fields (DistanceField/FieldContacts.cpp) ----

/// Share of a field's error bound: by how much a contact of an edge or a triangle may be less deep
/// than its deepest point. Any share will do; a smaller one takes longer.
constexpr double kDepthShare = 0.5;
/// Of the field's band: the least such depth. Rounding to float moves the field by about as much.
constexpr double kLeastDepthTolerance = 0x1p-20;
/// Relative error of lengths in the bounds that pass over features: some roundings of each
/// coordinate difference. Any value well above u will do, as the field's error bound covers the
/// rounding of coordinates.
constexpr double kFieldLengthError = 0x1p-40;
/// 1/sqrt(3), rounded up: a triangle's points are at most this share of its longest side from a
/// corner.
constexpr double kRootOfThird = 0.57735026918962585;

}  // namespace palpate
