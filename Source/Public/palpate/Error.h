#pragma once

#include <palpate/Export.h>
#include <palpate/Types.h>

#include <cstddef>
#include <optional>
#include <stdexcept>
#include <string>

namespace palpate {

/// The reason for an Error. Each function documents the codes that it throws.
enum class ErrorCode {
  NonFinitePosition,   ///< a position is NaN or infinite, or beyond 2^1000 under setTransform()
  WrongPositionCount,  ///< the number of positions differs from the number of vertices
  /// an index names a vertex, element or octree node that does not exist; or a segment or
  /// tetrahedron names one vertex twice
  IndexOutOfRange,
  UnknownGeometry,    ///< the geometry was never added, or was removed
  UnknownPair,        ///< the pair was never added, was removed, or was added in the other order
  DuplicatePair,      ///< the pair was added before, in this order or in the other
  InvalidSettings,    ///< a setting or argument is outside its range
  NotClosed,          ///< the geometry has no inside: see findMeshDefects()
  UnsupportedMethod,  ///< the method or function does not exist for these geometries
  TooLarge,           ///< more vertices, elements, geometries or vertex pairs than ids can name
  NotAvailable,       ///< the answer was not computed or not kept, or a resource is missing
  File,               ///< a file cannot be read or written, or has the wrong content
  InvalidRadius,      ///< a radius is negative, NaN or infinite, or there is not one per vertex
  InvalidShape,       ///< a shape has an invalid measure, direction or number of points
  InvalidTransform,   ///< not a rotation, or not finite, or beyond 2^1000
  SharedFace,         ///< a face belongs to more than two tetrahedra
  InvalidCall,        ///< the object was moved from, is outdated, or is at work on another call
  ImpactRemains,      ///< features touch within a step, and StepGuard may not move their vertices
};

/// The exception that the library throws for an invalid call. what() is a sentence that names the
/// geometry, the element and the value at fault. The call leaves the object unchanged.
class PALPATE_EXPORT Error : public std::runtime_error {
 public:
  /// sentence: the text of what().
  Error(ErrorCode code, const std::string& sentence, std::optional<GeometryId> geometry = {},
        std::optional<std::size_t> element = {});

  ErrorCode code() const noexcept { return m_code; }
  /// The geometry at fault, if there is one. A function that adds a geometry names the id that the
  /// geometry would have had.
  std::optional<GeometryId> geometry() const noexcept { return m_geometry; }
  /// The index of the vertex, element, tetrahedron or hull point at fault, if there is one. The
  /// sentence says which of these it is.
  std::optional<std::size_t> element() const noexcept { return m_element; }

 private:
  ErrorCode m_code;
  std::optional<GeometryId> m_geometry;
  std::optional<std::size_t> m_element;
};

}  // namespace palpate
