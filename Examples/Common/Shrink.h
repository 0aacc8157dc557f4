#pragma once

#include <palpate/Capture.h>
#include <palpate/OctreeBasedCD.h>

#include <functional>

namespace palpate::scenes {

/// The object after one frame of the problem, by this engine.
OctreeBasedCD solve(CollisionProblem problem, Engine engine);
/// The contacts of one of its pairs, after solve().
const CollisionData& dataOf(const OctreeBasedCD& detection, const CollisionProblem::Pair& pair);

/// A smaller problem that still fails. It drops triangles by halves, then by smaller parts down to
/// single ones. Then it drops pairs, and everything that no triangle or pair uses. It keeps a
/// change only if the rest fails.
///
/// Needs    fails(problem) to hold, and to answer the same each time.
/// Returns  a problem that fails; without any one of its triangles or pairs it does not.
/// Cost     about as many calls of `fails` as (triangles left) · log2(triangles) where few are left.
/// Source   Zeller and Hildebrandt, Simplifying and Isolating Failure-Inducing Input (IEEE TSE 2002).
///          Difference: parts are dropped only, never kept alone.
CollisionProblem shrink(CollisionProblem problem,
                        const std::function<bool(const CollisionProblem&)>& fails);

}  // namespace palpate::scenes
