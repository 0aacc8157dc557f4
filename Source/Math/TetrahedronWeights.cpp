#include "Math/TetrahedronWeights.h"

#include "Exact/ExactVector.h"

#include <cmath>

namespace palpate {

namespace {

using Eigen::Vector3d;

/// The magnitude mantissa 2^exponent.
struct Value {
  double mantissa;
  long exponent;
};

Value valueOf(const Int256& x) {
  if (x.sign() < 0) return valueOf(Int256{} - x);
  return {static_cast<double>(x.high) * 0x1p128 + static_cast<double>(x.low), 0};
}

Value valueOf(const Integer& x) {
  Value value{};
  value.mantissa = std::abs(mpz_get_d_2exp(&value.exponent, x.get_mpz_t()));
  return value;
}

/// at: the corners relative to p. Face i is opposite corner i.
template <class T>
std::array<double, 4> weightsOf(const std::array<exact::Vector<T>, 4>& at,
                                const std::array<int, 4>& signs) {
  std::array<Value, 4> volumes{};
  long largest = 0;
  bool any = false;
  for (std::size_t i = 0; i < 4; ++i) {
    if (signs[i] == 0) continue;
    volumes[i] = valueOf(exact::volumeOf(at[(i + 1) % 4], at[(i + 2) % 4], at[(i + 3) % 4]));
    largest = any ? std::max(largest, volumes[i].exponent) : volumes[i].exponent;
    any = true;
  }
  std::array<double, 4> weights{};
  double sum = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    weights[i] = std::ldexp(volumes[i].mantissa, static_cast<int>(volumes[i].exponent - largest));
    sum += weights[i];
  }
  for (double& weight : weights) weight /= sum;
  return weights;
}

}  // namespace

std::optional<std::array<double, 4>> tetrahedronWeights(const Vector3d& p, const Vector3d& a,
                                                        const Vector3d& b, const Vector3d& c,
                                                        const Vector3d& d, SignCounts& counts) {
  // The four volumes in which p replaces one corner sum to the whole volume, so their signs decide.
  const std::array<const Vector3d*, 4> corners{&a, &b, &c, &d};
  std::array<int, 4> signs{};
  int sign = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    std::array<const Vector3d*, 4> with = corners;
    with[i] = &p;
    signs[i] = orient3d(*with[0], *with[1], *with[2], *with[3], counts);
    if (signs[i] == 0) continue;
    if (sign == -signs[i]) return {};
    sign = signs[i];
  }
  if (sign == 0) return {};
  if (const FixedGrid grid(p, a, b, c, d); grid.fits)
    return weightsOf<std::int64_t>({grid.at[1], grid.at[2], grid.at[3], grid.at[4]}, signs);
  std::array<exact::Vector<Integer>, 4> at;
  for (std::size_t i = 0; i < 4; ++i)
    for (std::size_t k = 0; k < 3; ++k)
      at[i][k] = scaledInteger((*corners[i])[k]) - scaledInteger(p[k]);
  return weightsOf(at, signs);
}

}  // namespace palpate
