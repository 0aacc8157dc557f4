#pragma once

#include <palpate/Settings.h>

#include "CollisionDetection/PairTable.h"
#include "CollisionDetection/SeparateSearch.h"

namespace palpate {

// The plan of a pair in a detection is made here and nowhere else. What is expected of the motion
// says whether boxes enclose the step, and which octrees may lag. Once these are up to date, the
// plan is completed from support, motion and memory.

/// The plan of a pair before anything is known about its motion.
PairPlan planWithoutMotion(const PairRecord&);

/// Auto: whether the settings allow the surface proxy that is attached to b.
bool mayUseProxy(const PairRecord&);

/// Asks by the plan that is expected from the motion in the step, which is measured, and lets the
/// boxes of both octrees enclose the step if the plan needs it. detecting: contacts are wanted;
/// otherwise only the motion on which candidates depend is included.
void expectPlan(PairRecord&, bool detecting);
void expectPlan(SeparateSearch&);

/// Decides for which of the pairs lists of candidates are used, and which octrees may lag behind
/// the positions. Measures the motion that lists need.
void planKeptCandidates(const GeometryTable&, std::span<const std::unique_ptr<PairRecord>>,
                        const Settings&);
/// The octrees that follow cuts are up to date: decides again about lists and other octrees.
void reviewCuts(std::span<const std::unique_ptr<PairRecord>>);

/// Auto: answers by an attached field, if that is allowed, and if the field proves that nothing
/// touched in the step. The octrees must be up to date.
void planByFieldIfProven(PairRecord&, Engine);
/// Completes the plan of a detection. The octrees must be up to date.
void completePlan(PairRecord&, Engine);

}  // namespace palpate
