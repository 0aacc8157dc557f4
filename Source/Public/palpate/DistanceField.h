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
  /// L, positive: what value() may be off by in the band. If it exceeds the band, the band counts.
  double errorBound = 0.0;
  /// L, positive: how far errorBound holds. Both are at least 2^-18 of the longest side of the box
  /// with the band, itself in [2^-400, 2^400], and 2^-36 of its largest coordinate.
  double band = 0.0;
  /// Bytes of the field and the build, without the queries' copy of the mesh; 0: no limit. A build
  /// that needs more throws MemoryLimit. A field needs a quarter of its build.
  std::size_t memoryLimit = std::size_t{1} << 31;
  int threads = 0;  ///< in [0, 1024]; 0: one per core; does not change the field
  /// Called on the building thread with an increasing estimate. False: build() throws Cancelled.
  std::function<bool(double fraction)> progress{};
};

/// The signed distance from a triangle mesh, interpolated trilinearly in an octree with a proven
/// error (Docs/DistanceFields.md). A field never changes. Copies share memory. Any thread may read.
/// Every function of points throws NonFinitePosition, also beyond kLargestMeasure.
class PALPATE_EXPORT DistanceField {
 public:
  /// Keeps no reference to the mesh. Inside a closed, consistently oriented mesh the winding number
  /// is not 0, exactly; in others the generalised winding number exceeds 1/2 in magnitude.
  /// Errors   NonFinitePosition; IndexOutOfRange; TooLarge: 2^28 vertices or triangles; NotClosed
  ///          without triangles; InvalidSettings; MemoryLimit; Cancelled; those of `progress`.
  static DistanceField build(const TriangleMeshView&, const DistanceFieldSettings&);

  /// Whether the mesh was closed and consistently oriented, so that all signs are reliable.
  bool isClosed() const;
  double errorBound() const;  ///< L: the lesser of the settings' errorBound and band
  double band() const;        ///< L
  std::size_t bytes() const;  ///< of memory that the field holds
  std::size_t cells() const;  ///< with corner values

  /// L: interpolated, negative inside. Continuous up to rounding, between cells to 2^-20 of the
  /// band. Let d be the exact signed distance. |d| <= band: the value is within errorBound() of d.
  /// |d| > band: it has d's sign, and its magnitude is at most |d| and at least band -
  /// errorBound(). In the domain, a box around the mesh and its band, it is at most the band;
  /// outside, the band and the distance from the domain. Where signIsReliable() is false, this
  /// holds without signs; the value jumps at faces of cells.
  /// Cost     some tens of nanoseconds; allocates nothing.
  double value(const Eigen::Vector3d&) const;
  /// Whether the sign of value() is reliable. Of an open mesh: every patch that closes it and has a
  /// winding number below 5/8 in magnitude there gives this sign.
  bool signIsReliable(const Eigen::Vector3d&) const;
  /// The gradient of value(). It jumps at the faces of cells, where the cell with the larger
  /// coordinates counts, and at the band's end. It is 0 where the value is the band, and unit
  /// outside the domain.
  Eigen::Vector3d gradient(const Eigen::Vector3d&) const;
  /// value() of many points, with the same bits, on the calling thread. InvalidSettings for another
  /// size of `out`. An error names the point, such as "point 3", and nothing is written.
  void values(std::span<const Eigen::Vector3d> points, std::span<double> out) const;

  /// Writes a file completely or not at all; equal fields give equal files. Throws File.
  void save(const std::filesystem::path&) const;
  /// Reads a file of save(); any content is safe. Throws File, with the name and the byte.
  static DistanceField load(const std::filesystem::path&);

  struct Implementation;  ///< not part of the interface

 private:
  explicit DistanceField(std::shared_ptr<const Implementation>);
  const Implementation& valid() const;
  std::shared_ptr<const Implementation> m_implementation;
};

}  // namespace palpate
