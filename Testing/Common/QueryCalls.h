#pragma once

#include <palpate/Error.h>
#include <palpate/OctreeBasedCD.h>

#include <cstdint>
#include <vector>

namespace palpate::testing {

// Queries of the positions now, as values.

inline std::vector<InsideVertex> insideVertices(const OctreeBasedCD& collisions,
                                                GeometryId vertices, GeometryId body,
                                                const InsideSettings& settings = {}) {
  std::vector<InsideVertex> found;
  collisions.queries().findInsideVertices(vertices, body, found, settings);
  return found;
}

inline std::vector<EmbeddedVertex> embeddedVertices(const OctreeBasedCD& collisions,
                                                    GeometryId vertices, GeometryId body) {
  std::vector<EmbeddedVertex> found;
  collisions.queries().findEmbeddedVertices(vertices, body, found);
  return found;
}

/// The results of a query as words, or the error that it threw.
template <class F>
std::vector<std::uint64_t> wordsOf(F&& query) {
  std::vector<std::uint64_t> words;
  try {
    query(words);
  } catch (const Error& error) {
    words = {~std::uint64_t{0}, static_cast<std::uint64_t>(error.code())};
  }
  return words;
}

}  // namespace palpate::testing
