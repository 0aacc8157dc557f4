#include "Math/Predicates.h"

#include "Math/Compensated.h"
#include "Math/Exact.h"
#include "Math/WideInteger.h"

#include <algorithm>
#include <initializer_list>
#include <optional>

namespace palpate {

namespace {

/// No error of a product of up to three differences is then lost: nonzero coordinates of at least
/// 2^-300 are multiples of 2^-352, products of three then of 2^-1056; and six products of three
/// differences of at most 2^301 stay under 2^906.
bool fitTwoDoubles(std::initializer_list<const Eigen::Vector3d*> positions) {
  for (const Eigen::Vector3d* position : positions) {
    for (const double value : *position) {
      const double magnitude = std::abs(value);
      if (magnitude > kLargestCompensated || (magnitude < kSmallestCompensated && value != 0))
        return false;
    }
  }
  return true;
}

/// What degenerate input mostly is, and no arithmetic is needed for: flat along an axis.
bool flat(int axis, std::initializer_list<const Eigen::Vector3d*> positions) {
  const double first = (**positions.begin())[axis];
  return std::all_of(positions.begin(), positions.end(),
                     [&](const Eigen::Vector3d* position) { return (*position)[axis] == first; });
}

int compare(double a, double b) { return (a > b) - (a < b); }

/// Sums of two doubles, errors of errors dropped.
RoundedWithError operator+(const RoundedWithError& a, const RoundedWithError& b) {
  const auto [value, error] = exactSum(a.value, b.value);
  return {value, error + (a.error + b.error)};
}
RoundedWithError operator-(const RoundedWithError& a, const RoundedWithError& b) {
  return a + RoundedWithError{-b.value, -b.error};
}
RoundedWithError operator*(const RoundedWithError& a, const RoundedWithError& b) {
  const auto [value, error] = exactProduct(a.value, b.value);
  return {value, error + (a.value * b.error + a.error * b.value)};
}

/// (b - a) x (c - a) . (d - a), each difference by a function.
template <class Difference>
auto volume(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c,
            const Eigen::Vector3d& d, Difference&& difference) {
  const auto u0 = difference(b[0], a[0]), u1 = difference(b[1], a[1]), u2 = difference(b[2], a[2]);
  const auto v0 = difference(c[0], a[0]), v1 = difference(c[1], a[1]), v2 = difference(c[2], a[2]);
  const auto w0 = difference(d[0], a[0]), w1 = difference(d[1], a[1]), w2 = difference(d[2], a[2]);
  return decltype(difference(0, 0))((u1 * v2 - u2 * v1) * w0 + (u2 * v0 - u0 * v2) * w1 +
                                    (u0 * v1 - u1 * v0) * w2);
}

Integer integerDifference(double a, double b) { return scaledInteger(a) - scaledInteger(b); }

int volumeSign(const FixedGrid<4>& grid) {
  const auto& [origin, u, v, w] = grid.at;
  const auto minor = [&](int i, int j) { return Int128{u[i]} * v[j] - Int128{u[j]} * v[i]; };
  return (product(minor(1, 2), w[0]) + product(minor(2, 0), w[1]) + product(minor(0, 1), w[2]))
      .sign();
}

/// 0: left undecided. Of positions that fit. With e = 2^-53 and P the sum of the six
/// products' magnitudes, sums of two doubles err by 8 e² a product, 15 e² a minor, 35 e² a term and
/// 75 e² P in all, and P is at most the product of the differences' 1-norms: 2^-98 covers these and
/// the bound's own rounding.
int volumeSignWithTwoDoubles(const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                             const Eigen::Vector3d& c, const Eigen::Vector3d& d) {
  const auto [value, error] =
      volume(a, b, c, d, [](double x, double y) { return exactSum(x, -y); });
  const double bound =
      kTwoDoublesError * (b - a).lpNorm<1>() * (c - a).lpNorm<1>() * (d - a).lpNorm<1>();
  return std::abs(value + error) > bound ? compare(value + error, 0) : 0;
}

/// (b - a)[x] (c - a)[y] against (b - a)[y] (c - a)[x]: where the differences are doubles, the
/// rounded products compare as the exact ones do or are equal, and then their errors compare. None:
/// left undecided.
std::optional<int> areaSignWithTwoDoubles(int x, int y, const Eigen::Vector3d& a,
                                          const Eigen::Vector3d& b, const Eigen::Vector3d& c) {
  const auto ux = exactSum(b[x], -a[x]), uy = exactSum(b[y], -a[y]);
  const auto vx = exactSum(c[x], -a[x]), vy = exactSum(c[y], -a[y]);
  if (ux.error != 0 || uy.error != 0 || vx.error != 0 || vy.error != 0) return {};
  const auto forward = exactProduct(ux.value, vy.value),
             backward = exactProduct(uy.value, vx.value);
  return forward.value != backward.value ? compare(forward.value, backward.value)
                                         : compare(forward.error, backward.error);
}

Eigen::Vector3d flattened(int axis, Eigen::Vector3d position) {
  position[axis] = 0;
  return position;
}

}  // namespace

int orient3dExactly(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c,
                    const Eigen::Vector3d& d, SignCounts& counts) {
  for (int axis = 0; axis < 3; ++axis)
    if (flat(axis, {&a, &b, &c, &d})) return 0;
  if (a == b || a == c || a == d || b == c || b == d || c == d) return 0;
  ++counts.undecided;
  if (const int sign = fitTwoDoubles({&a, &b, &c, &d}) ? volumeSignWithTwoDoubles(a, b, c, d) : 0)
    return sign;
  if (const FixedGrid grid(a, b, c, d); grid.fits) return volumeSign(grid);
  ++counts.bigIntegers;
  return sgn(volume(a, b, c, d, integerDifference));
}

int orient2dExactly(int axis, const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                    const Eigen::Vector3d& c, SignCounts& counts) {
  const int x = (axis + 1) % 3, y = (axis + 2) % 3;
  if (flat(x, {&a, &b, &c}) || flat(y, {&a, &b, &c})) return 0;
  ++counts.undecided;
  if (fitTwoDoubles({&a, &b, &c}))
    if (const auto sign = areaSignWithTwoDoubles(x, y, a, b, c)) return *sign;
  if (const FixedGrid grid(flattened(axis, a), flattened(axis, b), flattened(axis, c)); grid.fits) {
    const auto& [origin, u, v] = grid.at;
    const Int128 area = Int128{u[x]} * v[y] - Int128{u[y]} * v[x];
    return (area > 0) - (area < 0);
  }
  ++counts.bigIntegers;
  const Integer ux = integerDifference(b[x], a[x]), uy = integerDifference(b[y], a[y]);
  return cmp(ux * integerDifference(c[y], a[y]), uy * integerDifference(c[x], a[x]));
}

}  // namespace palpate
