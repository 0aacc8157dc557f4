#pragma once

#include <palpate/Export.h>
#include <palpate/Types.h>

#include <Eigen/Core>

#include <cstddef>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>

namespace palpate {

/// Settings of DistanceField::build(). A value out of range throws InvalidSettings.
struct DistanceFieldSettings {
  /// L, positive: what value() may be off by, in the band. If it exceeds the band, the band takes
  /// its place, so that signs beyond the band are right.
  double errorBound = 0.0;
  /// L, positive: the distance from the surface up to which the error bound holds. Both lengths are
  /// at least 2^-18 of the longest side of the mesh's box, enlarged by the band, and 2^-36 of the
  /// largest coordinate of that box. The longest side is from 2^-400 to 2^400.
  double band = 0.0;
  /// Bytes that the field and the build may hold, without the queries' copy of the mesh. 0: no
  /// limit. A build that needs more throws MemoryLimit, with the number of bytes, before it
  /// allocates them; soon, with an estimate, if it needs far more. A field is about a quarter of
  /// its build.
  std::size_t memoryLimit = std::size_t{1} << 31;
  /// Number of threads of the build, in [0, 1024]; 0: one per core. The field does not depend on
  /// it.
  int threads = 0;
  /// Called from time to time by the thread that calls build(), with an estimate in [0, 1] of the
  /// work done, which never decreases. build() throws Cancelled if it returns false.
  std::function<bool(double fraction)> progress{};
};

/// The signed distance from the surface of a triangle mesh, tabulated in an octree and interpolated
/// trilinearly. Its error has a proven bound (Docs/DistanceFields.md).
/// Threads  const functions are safe from any number of threads.
/// Copies   are cheap and share the memory. A field never changes.
class PALPATE_EXPORT DistanceField {
 public:
  /// Builds the field of a mesh. Of a closed, consistently oriented mesh, inside is where the
  /// winding number, decided exactly, is not 0. Of any other mesh, inside is where the magnitude of
  /// the generalised winding number is more than 1/2, and signIsReliable() says where that holds
  /// for certain. The field keeps no reference to the mesh.
  /// Errors   NonFinitePosition, also for one beyond kLargestMeasure; IndexOutOfRange for a vertex
  ///          index; TooLarge for more than 2^28 vertices or triangles; NotClosed for a mesh
  ///          without triangles; InvalidSettings; MemoryLimit; Cancelled. Messages name the mesh
  ///          geometry 0. Exceptions of `progress` end the build.
  static DistanceField build(const TriangleMeshView&, const DistanceFieldSettings&);

  /// Whether the mesh was closed and consistently oriented: all signs are reliable.
  bool isClosed() const;
  double errorBound() const;  ///< L: the lesser of the settings' errorBound and band
  double band() const;        ///< L
  std::size_t bytes() const;  ///< of memory that the field holds
  std::size_t cells() const;  ///< with corner values

  /// The interpolated distance, negative inside. Continuous, up to rounding: where cells of
  /// different size meet, both have the same values to 2^-20 of the band.
  ///
  /// Let d be the exact signed distance.
  ///   |d| <= band   the value is within errorBound() of d.
  ///   |d| > band    the value has d's sign, and its magnitude is at most |d| and at least
  ///                 band - errorBound(). In the domain, a box around the mesh and its band, it is
  ///                 at most the band. Outside the domain it is the band and the distance from the
  ///                 domain.
  /// Where signIsReliable() is false, all of this holds for the distance without its sign. The
  /// value is then not negative, and it jumps at faces of cells.
  /// Units    L.
  /// Errors   NonFinitePosition.
  /// Cost     some tens of nanoseconds. Allocates nothing.
  double value(const Eigen::Vector3d&) const;
  /// Whether the sign of value() is reliable. It is, of a closed mesh, everywhere. Of an open one
  /// it is in cells in which the winding number is certainly within 3/8 of an integer. Every patch
  /// that closes the mesh, and whose own winding number about the point is less than 5/8 in
  /// magnitude, gives the same sign.
  /// Errors   NonFinitePosition.
  bool signIsReliable(const Eigen::Vector3d&) const;
  /// The gradient of value(). It jumps at the faces of cells, where it is that of the cell with the
  /// larger coordinates, and at the end of the band. 0 where the value is the constant band;
  /// outside the domain the unit vector away from it. In the band it is not exactly of length 1.
  /// Errors   NonFinitePosition.
  Eigen::Vector3d gradient(const Eigen::Vector3d&) const;
  /// value() of many points, on the calling thread in SIMD lanes, with the same bits.
  /// Errors   NonFinitePosition, which names the point, such as "point 3"; InvalidSettings if `out`
  ///          has another size than `points`. Nothing is written then.
  void values(std::span<const Eigen::Vector3d> points, std::span<double> out) const;

  /// Writes the field to a file, completely or not at all. Equal fields give equal files.
  /// Errors   File.
  void save(const std::filesystem::path&) const;
  /// Reads a file of save(). Any content is safe: a file with a fault throws File, and the message
  /// names the file and the byte.
  static DistanceField load(const std::filesystem::path&);

  struct Implementation;  ///< not part of the interface

 private:
  explicit DistanceField(std::shared_ptr<const Implementation>);
  const Implementation& valid() const;
  std::shared_ptr<const Implementation> m_implementation;
};

}  // namespace palpate
