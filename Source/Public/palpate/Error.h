#pragma once

#include <palpate/Export.h>
#include <palpate/Types.h>

#include <cstddef>
#include <optional>
#include <stdexcept>
#include <string>

namespace palpate {

/// Docs/Errors.md has the cause and the remedy of each code.
enum class ErrorCode {
  NonFinitePosition,   ///< A position is NaN, infinite or beyond kLargestMeasure.
  WrongPositionCount,  ///< The number of positions differs from the number of vertices.
  IndexOutOfRange,     ///< no such vertex or element (any more), or one twice where it may not be
  UnknownGeometry,     ///< The geometry was never added, or was removed.
  UnknownPair,         ///< The pair was never added, was removed, or was added in the other order.
  DuplicatePair,       ///< The pair was added before, in this order or in the other.
  InvalidSettings,     ///< A setting or argument is outside its range.
  NotClosed,           ///< The geometry has no inside: see findMeshDefects().
  UnsupportedMethod,   ///< The method or function does not exist for these geometries.
  TooLarge,          ///< There are more vertices, elements, geometries or pairs than ids can name.
  NotAvailable,      ///< The answer was not computed or not kept, or a resource is missing.
  File,              ///< A file cannot be read or written, or has the wrong content.
  InvalidRadius,     ///< A radius is not in [0, kLargestMeasure], or not one per vertex.
  InvalidShape,      ///< A shape has an invalid measure, direction or number of points.
  InvalidTransform,  ///< No rotation, or a translation that is beyond kLargestMeasure.
  SharedFace,        ///< A face belongs to more than two tetrahedra.
  InvalidCall,       ///< An object was moved from, is outdated, or at work; positions of no step.
  ImpactRemains,     ///< Features touch within a step, and StepGuard cannot shorten their steps.
  MemoryLimit,       ///< The answer needs more memory than the limit that you set.
  Cancelled,         ///< A progress callback returned false.
};
PALPATE_EXPORT const char* toString(ErrorCode) noexcept;  ///< its name, or "unknown"

/// Invalid calls throw it and change nothing. what() names geometry, element and value at fault.
class PALPATE_EXPORT Error : public std::runtime_error {
 public:
  Error(ErrorCode code, const std::string& sentence, std::optional<GeometryId> geometry = {},
        std::optional<std::size_t> element = {});

  ErrorCode code() const noexcept { return m_code; }
  /// The geometry at fault, if any; when one is added, the id that it would have had.
  std::optional<GeometryId> geometry() const noexcept { return m_geometry; }
  /// The index of the vertex, element or hull point at fault, if any; the sentence says which.
  std::optional<std::size_t> element() const noexcept { return m_element; }

 private:
  ErrorCode m_code;
  std::optional<GeometryId> m_geometry;
  std::optional<std::size_t> m_element;
};

}  // namespace palpate
