#pragma once

#include "Search/Question.h"
#include "NarrowPhase/NarrowPhase.h"
#include "Core/Buffer.h"

#include <cstdint>
#include <span>

// Functions that searches by Engine::BruteForce call, and that the module Diagnostics defines in
// CandidatesByBruteForce.cpp and DetectionByBruteForce.cpp.
namespace palpate {

/// Lists all element pairs whose boxes in double overlap when each is inflated by half the
/// thickness; sorted. This is the reference for the octree's candidate pairs. For self-collision it
/// lists pairs with a < b that share no vertex.
void findCandidatesByBruteForce(const MeshPair&, Buffer<ElementPair>& out);

/// Finds what all jobs of a search find, by testing every feature against every other.
/// intersections: receives the contacts that Auto takes from Intersection.
void detectPairByBruteForce(const Question&, ContactBuffers& contacts,
                            ContactBuffers& intersections);

/// Finds the contacts of these vertices of the pair's first body, by the method of its plan.
void detectVerticesByBruteForce(const Question&, std::span<const std::uint32_t> vertices,
                                ContactBuffers& contacts);

}  // namespace palpate
