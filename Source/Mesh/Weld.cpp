// Part of <palpate/Types.h>: weld().
#include <palpate/Error.h>
#include <palpate/Types.h>

#include "Math/Range.h"
#include "Math/StableLength.h"
#include "Core/Text.h"

#include <array>
#include <cmath>
#include <string>
#include <unordered_map>
#include <vector>

namespace palpate {

using Eigen::Vector3d;

namespace {

void check(std::span<const Vector3d> positions, std::span<const Triangle> triangles,
           double distance) {
  if (!(distance >= 0.0) || !isWithinRange(distance))
    throw Error(ErrorCode::InvalidSettings,
                "distance is " + textOf(distance) + "; it must be " + kLengthRule);
  if (positions.size() >= kNoElement)
    throw Error(ErrorCode::TooLarge, "there are " + std::to_string(positions.size()) +
                                         " positions; at most 4294967294 are allowed");
  for (std::size_t v = 0; v < positions.size(); ++v)
    if (!isWithinRange(positions[v]))
      throw Error(ErrorCode::NonFinitePosition,
                  "vertex " + std::to_string(v) + " is " + textOf(positions[v]) + "; it must be " +
                      kRangeRule,
                  {}, v);
  for (std::size_t t = 0; t < triangles.size(); ++t)
    for (const std::uint32_t v : triangles[t])
      if (v >= positions.size())
        throw Error(ErrorCode::IndexOutOfRange,
                    "triangle " + std::to_string(t) + " names vertex " + std::to_string(v) +
                        "; there are " + std::to_string(positions.size()),
                    {}, t);
}

/// A cube of the side `distance`; with a distance of 0, a position.
using Cell = std::array<double, 3>;
struct CellHash {
  std::size_t operator()(const Cell& cell) const {
    std::size_t hash = 0;
    for (const double c : cell) hash = hash * 0x9e3779b97f4a7c15u + std::hash<double>()(c);
    return hash ^ hash >> 29;
  }
};

}  // namespace

Welded weld(std::span<const Vector3d> positions, std::span<const Triangle> triangles,
            double distance) {
  check(positions, triangles, distance);
  // Where quotients are rounded, doubles differ by more than the distance. -0 becomes 0.
  const auto cellOf = [&](const Vector3d& p) -> Cell {
    const auto at = [&](double x) {
      const double quotient = std::floor(x / distance);
      return std::isfinite(quotient) ? quotient : x + 0.0;
    };
    return {at(p.x()), at(p.y()), at(p.z())};
  };
  Welded welded;
  welded.vertexOf.reserve(positions.size());
  // The last new vertex in each cell, and for each new vertex the one before in its cell.
  std::unordered_map<Cell, std::uint32_t, CellHash> last;
  std::vector<std::uint32_t> before;
  const auto lowestIn = [&](const Cell& cell, const Vector3d& p, std::uint32_t lowest) {
    const auto found = last.find(cell);
    if (found == last.end()) return lowest;
    for (std::uint32_t v = found->second; v != kNoElement; v = before[v])
      if (v < lowest && stableLength(welded.positions[v] - p) <= distance) lowest = v;
    return lowest;
  };
  for (const Vector3d& p : positions) {
    const Cell cell = cellOf(p);
    std::uint32_t vertex = kNoElement;
    const int reach = distance > 0.0 ? 1 : 0;
    for (int x = -reach; x <= reach; ++x)
      for (int y = -reach; y <= reach; ++y)
        for (int z = -reach; z <= reach; ++z)
          vertex = lowestIn({cell[0] + x, cell[1] + y, cell[2] + z}, p, vertex);
    if (vertex == kNoElement) {
      vertex = static_cast<std::uint32_t>(welded.positions.size());
      const auto [at, isNew] = last.emplace(cell, vertex);
      before.push_back(isNew ? kNoElement : at->second);
      at->second = vertex;
      welded.positions.push_back(p);
    }
    welded.vertexOf.push_back(vertex);
  }
  welded.triangles.reserve(triangles.size());
  for (const auto& [a, b, c] : triangles)
    welded.triangles.push_back({welded.vertexOf[a], welded.vertexOf[b], welded.vertexOf[c]});
  return welded;
}

}  // namespace palpate
