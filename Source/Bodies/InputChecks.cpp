#include "Bodies/InputChecks.h"

#include <palpate/Error.h>

#include "Math/Range.h"
#include "Core/Text.h"

#include <algorithm>
#include <atomic>
#include <mutex>
#include <optional>
#include <string>

namespace palpate {

namespace {

constexpr std::size_t kCopyGrain = 16384, kPiece = 512;  ///< kPiece fits in the nearest cache
// Ids have 32 bits, and the highest bit of octree node numbers is in use.
constexpr std::size_t kMostElements = std::size_t{1} << 28;
constexpr std::size_t kMostTetrahedra = kMostElements / 4;  // of four faces each

void checkIndices(const GeometryLabel& label, const std::string& element, std::size_t index,
                  std::span<const std::uint32_t> vertices, std::size_t count) {
  for (const std::uint32_t vertex : vertices)
    if (vertex >= count)
      throw Error(ErrorCode::IndexOutOfRange,
                  nameOf(label) + ", " + element + " " + std::to_string(index) + ": vertex index " +
                      std::to_string(vertex) + " is out of range; the mesh has " +
                      std::to_string(count) + " vertices",
                  label.id, index);
}

}  // namespace

Eigen::AlignedBox3d checkPositions(const GeometryLabel& label,
                                   std::span<const Eigen::Vector3d> positions, Eigen::Vector3d* out,
                                   const char* which, const Threads& threads,
                                   const Eigen::Vector3d* before, MotionRange* moved,
                                   std::size_t first) {
  std::atomic<std::size_t> firstBad = positions.size();
  Eigen::AlignedBox3d all;
  std::mutex mutex;
  threads.forChunks(
      positions.size(), kCopyGrain, [&](std::size_t, std::size_t from, std::size_t to) {
        MotionRange range;
        Eigen::AlignedBox3d bounds;
        std::size_t bad = to;
        for (std::size_t i = from; i < to && bad == to; i += kPiece) {
          const auto part = positions.subspan(i, std::min(kPiece, to - i));
          const std::size_t good = copyFinite(part, out + i, bounds);
          if (good < part.size()) bad = i + good;
          if (before) range.add(motionRange({before + i, good}, {out + i, good}));
        }
        std::size_t known = firstBad;
        while (bad < to && bad < known && !firstBad.compare_exchange_weak(known, bad)) {
        }
        const std::lock_guard lock(mutex);
        all.extend(bounds);
        if (before) moved->add(range);
      });
  const std::size_t bad = firstBad;
  if (bad == positions.size()) return all;
  throw Error(ErrorCode::NonFinitePosition,
              nameOf(label) + ", vertex " + std::to_string(first + bad) + ": position" + which +
                  " is " + textOf(positions[bad]) + "; positions must be " + kRangeRule,
              label.id, first + bad);
}

CountedVector<Eigen::Vector3d> checkedRest(const GeometryLabel& label,
                                           std::span<const Eigen::Vector3d> positions) {
  CountedVector<Eigen::Vector3d> rest(positions.size());
  checkPositions(label, positions, rest.data(), "", Threads(1));
  return rest;
}

void checkCounts(const GeometryLabel& label, std::size_t vertexCount,
                 std::span<const Triangle> triangles, GeometryType type, std::size_t first) {
  const bool lines = type == GeometryType::Lines;
  const std::string element = lines ? "segment" : "triangle";
  if (vertexCount > kMostElements || first + triangles.size() > kMostElements)
    throw Error(ErrorCode::TooLarge,
                nameOf(label) + ": " + std::to_string(vertexCount) + " vertices and " +
                    std::to_string(first + triangles.size()) + " " + element +
                    "s; at most 2^28 of each are supported",
                label.id);
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    checkIndices(label, element, first + t, triangles[t], vertexCount);
    if (lines && triangles[t][0] == triangles[t][1])
      throw Error(ErrorCode::IndexOutOfRange,
                  nameOf(label) + ", segment " + std::to_string(t) + " joins vertex " +
                      std::to_string(triangles[t][0]) + " with itself",
                  label.id, t);
  }
}

void checkTetrahedra(const GeometryLabel& label, std::size_t vertexCount,
                     std::span<const Tetrahedron> tetrahedra, std::size_t first) {
  if (vertexCount > kMostElements || first + tetrahedra.size() > kMostTetrahedra)
    throw Error(ErrorCode::TooLarge,
                nameOf(label) + ": " + std::to_string(vertexCount) + " vertices and " +
                    std::to_string(first + tetrahedra.size()) +
                    " tetrahedra; at most 2^28 and 2^26 are supported",
                label.id);
  for (std::size_t i = 0; i < tetrahedra.size(); ++i) {
    const std::size_t t = first + i;
    checkIndices(label, "tetrahedron", t, tetrahedra[i], vertexCount);
    Tetrahedron sorted = tetrahedra[i];
    std::sort(sorted.begin(), sorted.end());
    if (const auto twice = std::adjacent_find(sorted.begin(), sorted.end()); twice != sorted.end())
      throw Error(ErrorCode::IndexOutOfRange,
                  nameOf(label) + ", tetrahedron " + std::to_string(t) + " has vertex " +
                      std::to_string(*twice) + " twice",
                  label.id, t);
  }
}

void refuse(const GeometryLabel& label, const OverusedFace& fault) {
  const auto& [a, b, c] = fault.face;
  const auto& [s, t, u] = fault.tetrahedra;
  throw Error(ErrorCode::SharedFace,
              nameOf(label) + ", tetrahedron " + std::to_string(u) + ": its face with vertices " +
                  std::to_string(a) + ", " + std::to_string(b) + " and " + std::to_string(c) +
                  " already belongs to tetrahedra " + std::to_string(s) + " and " +
                  std::to_string(t),
              label.id, u);
}

TetrahedralTopology checkedTopology(const GeometryLabel& label,
                                    std::span<const Eigen::Vector3d> rest,
                                    std::span<const Tetrahedron> tetrahedra,
                                    std::span<const std::uint32_t> removed) {
  checkTetrahedra(label, rest.size(), tetrahedra);
  std::optional<OverusedFace> fault;
  TetrahedralTopology topology = topologyOf(rest, tetrahedra, fault, removed);
  if (fault) refuse(label, *fault);
  return topology;
}

CountedVector<std::uint32_t> checkedRemoval(const GeometryLabel& label, const std::string& element,
                                            std::size_t count,
                                            std::span<const std::uint32_t> removedBefore,
                                            std::span<const std::uint32_t> removed) {
  const auto refuse = [&](std::uint32_t id, const std::string& reason) {
    throw Error(ErrorCode::IndexOutOfRange,
                nameOf(label) + ": " + element + " " + std::to_string(id) + reason, label.id, id);
  };
  for (const std::uint32_t id : removed) {
    if (id >= count) refuse(id, " is out of range; there are " + std::to_string(count));
    if (std::binary_search(removedBefore.begin(), removedBefore.end(), id))
      refuse(id, " was removed before");
  }
  CountedVector<std::uint32_t> sorted(removed.begin(), removed.end());
  if (!std::is_sorted(sorted.begin(), sorted.end())) std::sort(sorted.begin(), sorted.end());
  if (const auto twice = std::adjacent_find(sorted.begin(), sorted.end()); twice != sorted.end())
    refuse(*twice, " is removed twice");
  return sorted;
}

void checkRadii(const GeometryLabel& label, std::span<const double> radii) {
  for (std::size_t v = 0; v < radii.size(); ++v)
    if (!(radii[v] >= 0.0) || !isWithinRange(radii[v]))
      throw Error(ErrorCode::InvalidRadius,
                  nameOf(label) + ", vertex " + std::to_string(v) + ": radius is " +
                      textOf(radii[v]) + "; it must be " + kLengthRule,
                  label.id, v);
}

void checkOnePerVertex(const GeometryLabel& label, std::span<const Eigen::Vector3d> positions,
                       std::span<const double> radii) {
  if (radii.size() != positions.size())
    throw Error(ErrorCode::InvalidRadius,
                nameOf(label) + ": " + std::to_string(radii.size()) + " radii given for " +
                    std::to_string(positions.size()) + " vertices",
                label.id);
}

void checkVertex(const GeometryLabel& label, std::uint32_t vertex, std::size_t count) {
  if (vertex >= count)
    throw Error(ErrorCode::IndexOutOfRange,
                nameOf(label) + ": vertex " + std::to_string(vertex) +
                    " is out of range; the geometry has " + std::to_string(count) + " vertices",
                label.id, vertex);
}

}  // namespace palpate
