#include "Exact/Predicates.h"

#include "Exact/ExactSum.h"
#include "Exact/ExactVector.h"

#include <algorithm>
#include <initializer_list>

namespace palpate {

namespace {

using Eigen::Vector3d;

/// Whether the positions are flat along an axis. Most degenerate input is, and this test needs no
/// arithmetic.
bool flat(int axis, std::initializer_list<const Vector3d*> positions) {
  const double first = (**positions.begin())[axis];
  return std::all_of(positions.begin(), positions.end(),
                     [&](const Vector3d* position) { return (*position)[axis] == first; });
}

Vector3d flattened(int axis, Vector3d position) {
  position[axis] = 0;
  return position;
}

}  // namespace

int orient3dExactly(const Vector3d& a, const Vector3d& b, const Vector3d& c, const Vector3d& d,
                    SignCounts& counts) {
  for (int axis = 0; axis < 3; ++axis)
    if (flat(axis, {&a, &b, &c, &d})) return 0;
  if (a == b || a == c || a == d || b == c || b == d || c == d) return 0;
  ++counts.undecided;
  if (const FixedGrid grid(a, b, c, d); grid.fits)
    return exact::signOf(exact::volumeOf(grid.at[1], grid.at[2], grid.at[3]));
  // The volume is [b c d] - [a c d] + [a b d] - [a b c], determinants of six products of
  // coordinates each.
  ExactSum volume;
  const auto add = [&](const Vector3d& p, const Vector3d& q, const Vector3d& r, bool negative) {
    for (int i = 0; i < 3; ++i) {
      const int j = (i + 1) % 3, k = (i + 2) % 3;
      volume.add(p[i], q[j], r[k], negative);
      volume.add(p[i], q[k], r[j], !negative);
    }
  };
  add(b, c, d, false);
  add(a, c, d, true);
  add(a, b, d, false);
  add(a, b, c, true);
  return volume.sign();
}

int orient2dExactly(int axis, const Vector3d& a, const Vector3d& b, const Vector3d& c,
                    SignCounts& counts) {
  const int x = (axis + 1) % 3, y = (axis + 2) % 3;
  if (flat(x, {&a, &b, &c}) || flat(y, {&a, &b, &c})) return 0;
  ++counts.undecided;
  if (const FixedGrid grid(flattened(axis, a), flattened(axis, b), flattened(axis, c)); grid.fits) {
    const auto& [origin, u, v] = grid.at;
    return exact::signOf(Int128{u[x]} * v[y] - Int128{u[y]} * v[x]);
  }
  // The area is [b c] - [a c] + [a b], determinants of two products of coordinates each.
  ExactSum area;
  const auto add = [&](const Vector3d& p, const Vector3d& q, bool negative) {
    area.add(p[x], q[y], 1.0, negative);
    area.add(p[y], q[x], 1.0, !negative);
  };
  add(b, c, false);
  add(a, c, true);
  add(a, b, false);
  return area.sign();
}

}  // namespace palpate
