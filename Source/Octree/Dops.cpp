#include "Octree/Dops.h"

#include "Octree/BoxMap.h"
#include "Octree/OctreeNodes.h"

#include <cmath>
#include <limits>

namespace palpate {

namespace {

constexpr std::array<DopDirection, 7> kDop14{
    {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 1, 1}, {1, 1, -1}, {1, -1, 1}, {-1, 1, 1}}};
constexpr std::array<DopDirection, 9> kDop18{{{1, 0, 0},
                                              {0, 1, 0},
                                              {0, 0, 1},
                                              {1, 1, 0},
                                              {1, -1, 0},
                                              {1, 0, 1},
                                              {1, 0, -1},
                                              {0, 1, 1},
                                              {0, 1, -1}}};

constexpr double dot(const DopDirection& a, const DopDirection& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
constexpr DopDirection cross(const DopDirection& a, const DopDirection& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
constexpr DopDirection over(const DopDirection& v, double divisor) {
  return {v[0] / divisor, v[1] / divisor, v[2] / divisor};
}

/// Three directions that are linearly independent. A direction c is the sum of them with the
/// factors dot(dual[i], c).
struct Triple {
  std::array<std::uint8_t, 3> from;
  std::array<DopDirection, 3> dual;

  std::array<double, 3> factors(const DopDirection& c) const {
    return {dot(dual[0], c), dot(dual[1], c), dot(dual[2], c)};
  }
};

template <std::size_t size>
struct Triples {
  std::array<Triple, size*(size - 1) * (size - 2) / 6> all{};
  std::size_t count = 0;

  constexpr explicit Triples(const std::array<DopDirection, size>& d) {
    for (std::uint8_t i = 0; i < size; ++i)
      for (auto j = static_cast<std::uint8_t>(i + 1); j < size; ++j)
        for (auto l = static_cast<std::uint8_t>(j + 1); l < size; ++l) {
          const double volume = dot(d[i], cross(d[j], d[l]));
          if (volume == 0) continue;
          all[count++] = {{i, j, l},
                          {over(cross(d[j], d[l]), volume), over(cross(d[l], d[i]), volume),
                           over(cross(d[i], d[j]), volume)}};
        }
  }
  constexpr std::span<const Triple> span() const { return std::span(all).first(count); }
};
constexpr Triples kTriples14(kDop14);
constexpr Triples kTriples18(kDop18);

/// setEnd() derives its error from this.
constexpr bool areHalvesOrOnes(std::span<const Triple> triples) {
  for (const Triple& triple : triples)
    for (const DopDirection& dual : triple.dual)
      for (const double entry : dual)
        if (entry * entry != 0 && entry * entry != 0.25 && entry * entry != 1) return false;
  return true;
}
static_assert(areHalvesOrOnes(kTriples14.span()) && areHalvesOrOnes(kTriples18.span()));

}  // namespace

int directionCount(OctreeBounds bounds) { return bounds == OctreeBounds::Dop14 ? 7 : 9; }

std::span<const DopDirection> dopDirections(int count) {
  return count == 7 ? std::span<const DopDirection>(kDop14)
                    : std::span<const DopDirection>(kDop18).first(static_cast<std::size_t>(count));
}

std::size_t OctreeDops::bytes() const {
  std::size_t bytes = blocks.capacity() * sizeof(Siblings);
  for (const auto* bounds : {&lower, &upper})
    for (const Buffer<float>& buffer : *bounds) bytes += buffer.capacity() * sizeof(float);
  return bytes;
}

void setEnd(DopMap::End& end, const OctreeDops& dops,
            const std::array<std::array<double, 3>, 3>& matrix, const std::array<double, 3>& offset,
            double thickness, double error) {
  const auto triples = dops.directions == 7 ? kTriples14.span() : kTriples18.span();
  const std::array<double, kMostDirections>& widths = dops.halfWidths;
  int k = 0;
  for (const DopDirection& direction : dopDirections(dops.directions)) {
    DopDirection c{};
    double size = 0;
    for (int j = 0; j < 3; ++j) {
      c[j] =
          direction[0] * matrix[0][j] + direction[1] * matrix[1][j] + direction[2] * matrix[2][j];
      size += std::abs(direction[j]);
    }
    double least = std::numeric_limits<double>::infinity();
    for (const Triple& triple : triples) {
      const auto factors = triple.factors(c);
      double width = 0;
      for (int i = 0; i < 3; ++i) width += std::abs(factors[i]) * widths[triple.from[i]];
      if (!(width < least)) continue;
      least = width;
      for (int i = 0; i < 3; ++i) {
        end.from[k][i] = triple.from[i];
        end.matrix[k][i] = static_cast<float>(factors[i]);
      }
    }
    const double length = std::sqrt(dot(direction, direction));
    setShift(end.shiftLower[k], end.shiftUpper[k], dot(direction, offset),
             length * thickness + size * error);
    ++k;
  }
}

void OctreeDops::fit(const OctreeNodes& nodes, int count) {
  constexpr float kInfinity = FloatBox::kEmptyLower;
  const auto further = static_cast<std::size_t>(count - 3);
  double leaves = 0;
  halfWidths.fill(0);
  // Children come after their parents.
  for (std::size_t block = nodes.pool.used(); block-- > 0;)
    for (unsigned slot = 0; slot < kChildren; ++slot) {
      const auto node = nodeOf(static_cast<std::uint32_t>(block), slot);
      const bool isUsed = (block > 0 || slot == 0) && !nodes.isEmpty(node);
      const auto [begin, end] = isUsed ? nodes.ownRange(node) : std::pair(0u, 0u);
      const std::size_t child = isUsed ? blockOf(nodes.firstChild(node)) : 0;
      const bool isLeaf = isUsed && child == 0;
      leaves += isLeaf;
      for (int k = 0; k < 3 && isLeaf; ++k) {
        const FloatBox fitted = nodes.box(node);
        halfWidths[k] += 0.5 * (double{fitted.upper[k]} - fitted.lower[k]);
      }
      for (std::size_t k = 0; k < further; ++k) {
        float least = kInfinity, most = -kInfinity;
        for (std::uint32_t i = begin; i < end; ++i) {
          least = std::min(least, lower[k + 3][i]);
          most = std::max(most, upper[k + 3][i]);
        }
        for (unsigned s = 0; child != 0 && s < kChildren; ++s) {
          least = std::min(least, blocks[child * further + k].lower[s]);
          most = std::max(most, blocks[child * further + k].upper[s]);
        }
        blocks[block * further + k].lower[slot] = least;
        blocks[block * further + k].upper[slot] = most;
        if (isLeaf) halfWidths[k + 3] += 0.5 * (double{most} - least);
      }
    }
  for (double& width : halfWidths) width /= leaves;
  directions = count;
}

}  // namespace palpate
