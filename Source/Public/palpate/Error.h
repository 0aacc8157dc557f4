#pragma once

#include <palpate/Export.h>
#include <palpate/Types.h>

#include <cstddef>
#include <optional>
#include <stdexcept>
#include <string>

namespace palpate {

enum class ErrorCode {
  NonFinitePosition,   ///< a position is NaN or infinite
  WrongPositionCount,  ///< as many positions as the geometry has vertices are needed
  IndexOutOfRange,  ///< an element names a vertex that is not there, or one twice where it may not
  UnknownGeometry,  ///< never added, or removed
  UnknownPair,      ///< never added, removed, or asked for in the other order
  DuplicatePair,    ///< added before, in either order
  InvalidSettings,  ///< a setting outside its range
  NotClosed,        ///< a mesh that has no inside: see findMeshDefects()
  UnsupportedMethod,  ///< this method does not exist yet, or not for these geometries
  TooLarge,           ///< more elements than 32-bit ids can name
  NotAvailable,       ///< the answer was not kept, or no frame has been computed
  File,               ///< a file that cannot be read or written, or is not what it should be
  InvalidRadius,      ///< negative, NaN or infinite, or not one for each vertex
  InvalidShape,       ///< a measure of a shape: not finite, negative, no direction, or too large
  InvalidTransform,   ///< not a rotation, or a translation that is not finite
  SharedFace,         ///< a face of more than two tetrahedra
  InvalidCall,        ///< of an object that was moved from, or from a callback that it calls
  ImpactRemains,      ///< features touch within a step, and StepGuard may not move their vertices
};

/// What was wrong with a call, and where. The call that throws it has changed nothing.
class PALPATE_EXPORT Error : public std::runtime_error {
 public:
  Error(ErrorCode code, const std::string& sentence, std::optional<GeometryId> geometry = {},
        std::optional<std::size_t> element = {});

  ErrorCode code() const noexcept { return m_code; }
  /// the geometry at fault
  std::optional<GeometryId> geometry() const noexcept { return m_geometry; }
  /// its vertex or triangle
  std::optional<std::size_t> element() const noexcept { return m_element; }

 private:
  ErrorCode m_code;
  std::optional<GeometryId> m_geometry;
  std::optional<std::size_t> m_element;
};

}  // namespace palpate
