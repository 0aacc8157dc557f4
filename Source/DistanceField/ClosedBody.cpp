#include "DistanceField/ClosedBody.h"

#include <palpate/Error.h>

#include "Core/Text.h"
#include "Math/Range.h"
#include "Mesh/FloatPositions.h"
#include "Queries/Containment.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

namespace palpate {

namespace {

constexpr std::size_t kMostElements = std::size_t{1} << 28;

void checkMesh(const TriangleMeshView& mesh, GeometryId id) {
  if (std::max(mesh.positions.size(), mesh.triangles.size()) > kMostElements)
    throw Error(ErrorCode::TooLarge,
                nameOf(id) + ": " + std::to_string(mesh.positions.size()) + " vertices and " +
                    std::to_string(mesh.triangles.size()) +
                    " triangles; at most 2^28 of each are supported",
                id);
  for (std::size_t v = 0; v < mesh.positions.size(); ++v)
    if (!isWithinRange(mesh.positions[v]))
      throw Error(ErrorCode::NonFinitePosition,
                  nameOf(id) + ", vertex " + std::to_string(v) + " is " +
                      textOf(mesh.positions[v]) + "; it must be " + kRangeRule,
                  id, v);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    for (const std::uint32_t vertex : mesh.triangles[t])
      if (vertex >= mesh.positions.size())
        throw Error(ErrorCode::IndexOutOfRange,
                    nameOf(id) + ", triangle " + std::to_string(t) + ": vertex index " +
                        std::to_string(vertex) + " is out of range; the mesh has " +
                        std::to_string(mesh.positions.size()) + " vertices",
                    id, t);
}

}  // namespace

void makeClosedBody(const TriangleMeshView& mesh, const Threads& threads, Body& out) {
  makeCheckedBody(mesh, threads, out);
  checkInside(out, InsideRule::Closed);
}

void makeCheckedBody(const TriangleMeshView& mesh, const Threads& threads, Body& out) {
  checkMesh(mesh, out.id);
  if (mesh.triangles.empty())
    throw Error(ErrorCode::NotClosed, nameOf(out) + " has no triangles", out.id);
  makeBody(mesh.positions, mesh.triangles, threads, out);
}

void checkPositive(double length, const char* name) {
  if (!(length > 0.0) || !isWithinRange(length))
    throw Error(ErrorCode::InvalidSettings, std::string(name) + " is " + textOf(length) +
                                                "; it must be positive and at most 1e+300");
}

void checkThreads(int threads) {
  if (threads < 0 || threads > 1024)
    throw Error(ErrorCode::InvalidSettings,
                "threads is " + std::to_string(threads) + "; it must be in [0, 1024]");
}

}  // namespace palpate
