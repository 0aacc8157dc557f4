#pragma once

#include <cmath>

namespace palpate {

/// A real number as an unevaluated sum of doubles: nonzero, strongly nonoverlapping, of increasing
/// magnitude, so that the last one has the sign of all. No terms: zero. N bounds their number.
///
/// Sums and products are exact as long as no operation overflows and every partial product is a
/// multiple of the smallest denormal; the caller sees to that. Needs round-to-even, as the whole
/// tree does.
/// Source   Shewchuk, Adaptive precision floating-point arithmetic and fast robust geometric predicates,
///          Discrete & Computational Geometry 18 (1997), sections 2.3 to 2.5, with zeros left out.
template <int N>
struct Expansion {
  double terms[N];
  int size = 0;

  void append(double term) {
    terms[size] = term;
    size += term != 0;  // no branch: which terms are zero cannot be foreseen
  }
  int sign() const { return size == 0 ? 0 : terms[size - 1] > 0 ? 1 : -1; }
};

/// value + error is the exact result of an operation whose rounded result is value.
struct RoundedWithError {
  double value, error;
};

inline RoundedWithError exactSum(double a, double b) {
  const double sum = a + b, bRounded = sum - a;
  return {sum, (a - (sum - bRounded)) + (b - bRounded)};
}

/// Veltkamp: halves of at most 26 bits that sum to a.
inline RoundedWithError halves(double a) {
  const double scaled = 134217729.0 * a;  // 2^27 + 1
  const double high = scaled - (scaled - a);
  return {high, a - high};
}

/// Dekker, without fused multiply-add: the baseline instruction set has none.
inline RoundedWithError exactProduct(double a, double b, const RoundedWithError& bHalves) {
  const double product = a * b;
  const auto [high, low] = halves(a);
  return {product, ((high * bHalves.value - product) + high * bHalves.error + low * bHalves.value) +
                       low * bHalves.error};
}

inline RoundedWithError exactProduct(double a, double b) { return exactProduct(a, b, halves(b)); }

inline Expansion<2> exactDifference(double a, double b) {
  const auto [value, error] = exactSum(a, -b);
  Expansion<2> difference;
  difference.append(error);
  difference.append(value);
  return difference;
}

template <int N, int M>
Expansion<N + M> operator+(const Expansion<N>& e, const Expansion<M>& f) {
  Expansion<N + M> sum;
  double rest = 0;
  const auto add = [&](double term) {
    const auto [value, error] = exactSum(rest, term);
    sum.append(error);
    rest = value;
  };
  int i = 0, j = 0;
  while (i < e.size && j < f.size)
    add(std::abs(e.terms[i]) < std::abs(f.terms[j]) ? e.terms[i++] : f.terms[j++]);
  while (i < e.size) add(e.terms[i++]);
  while (j < f.size) add(f.terms[j++]);
  sum.append(rest);
  return sum;
}

template <int N>
Expansion<N> operator-(const Expansion<N>& e) {
  Expansion<N> negated;
  for (int i = 0; i < e.size; ++i) negated.append(-e.terms[i]);
  return negated;
}

template <int N, int M>
Expansion<N + M> operator-(const Expansion<N>& e, const Expansion<M>& f) {
  return e + -f;
}

template <int N>
Expansion<2 * N> operator*(const Expansion<N>& e, double factor) {
  Expansion<2 * N> scaled;
  const RoundedWithError factorHalves = halves(factor);
  double rest = 0;
  for (int i = 0; i < e.size; ++i) {
    const auto product = exactProduct(e.terms[i], factor, factorHalves);
    const auto low = exactSum(rest, product.error);
    scaled.append(low.error);
    const auto high = exactSum(product.value, low.value);
    scaled.append(high.error);
    rest = high.value;
  }
  scaled.append(rest);
  return scaled;
}

template <int N>
Expansion<4 * N> operator*(const Expansion<N>& e, const Expansion<2>& f) {
  if (f.size == 2) return e * f.terms[0] + e * f.terms[1];
  Expansion<4 * N> product;
  if (f.size == 0) return product;
  const Expansion<2 * N> only = e * f.terms[0];
  for (int i = 0; i < only.size; ++i) product.append(only.terms[i]);
  return product;
}

}  // namespace palpate
