#include "Exact/AlgebraicTime.h"

#include "Exact/CubicRoot.h"
#include "Unit/Math/TrianglePairs.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace palpate::test {
namespace {

// Forms with small integer coefficients. Their values at roots of other such forms are zero or far
// from zero, so that long double decides their signs.

constexpr long double kZero = 1e-9L;

long double valueAt(const std::vector<int>& c, long double x) {
  long double value = 0;
  for (std::size_t i = c.size(); i-- > 0;) value = value * x + c[i];
  return value;
}
int signAt(const std::vector<int>& c, long double x) {
  const long double value = valueAt(c, x);
  return value > kZero ? 1 : value < -kZero ? -1 : 0;
}

/// The positive roots of Σ c[i] x^i, ascending, each once. Between roots of the derivative there is
/// at most one.
std::vector<long double> positiveRoots(const std::vector<int>& c) {
  if (c.size() < 2) return {};
  std::vector<int> slope;
  for (std::size_t i = 1; i < c.size(); ++i) slope.push_back(static_cast<int>(i) * c[i]);
  std::vector<long double> ends = positiveRoots(slope), roots;
  ends.insert(ends.begin(), 1e-4L);
  ends.push_back(1e4L);
  for (std::size_t i = 0; i + 1 < ends.size(); ++i) {
    long double low = ends[i], high = ends[i + 1];
    const int before = signAt(c, low), after = signAt(c, high);
    if (before * after < 0) {
      for (int step = 0; step < 120; ++step) {
        const long double middle = (low + high) / 2;
        ((valueAt(c, middle) > 0) == (after > 0) ? high : low) = middle;
      }
      roots.push_back((low + high) / 2);
    }
    if (after == 0 && i + 2 < ends.size()) roots.push_back(high);
  }
  return roots;
}

template <std::size_t N>
std::array<Integer, N> formOf(const std::vector<int>& c, int shift = 0) {
  std::array<Integer, N> form;
  for (std::size_t i = 0; i < c.size(); ++i) form[i] = Integer(c[i]) << shift;
  return form;
}

std::vector<int> coefficients(int code, std::size_t count, int most) {
  std::vector<int> c;
  for (std::size_t i = 0; i < count; ++i, code /= 2 * most + 1)
    c.push_back(code % (2 * most + 1) - most);
  return c;
}
int power(int base, int exponent) { return exponent == 0 ? 1 : base * power(base, exponent - 1); }

bool isZeroForm(const std::vector<int>& c) {
  return std::all_of(c.begin(), c.end(), [](int x) { return x == 0; });
}

TEST(AlgebraicTime, QuadraticRootsAreThoseOfTheForm) {
  constexpr int kMost = 5, kCodes = 11 * 11 * 11;
  Random random(1);
  for (int code = 0; code < kCodes; ++code) {
    const std::vector<int> c = coefficients(code, 3, kMost);
    if (isZeroForm(c)) continue;
    const std::vector<QuadraticTime> roots = rootsInside(formOf<3>(c));
    const std::vector<long double> truth = positiveRoots(c);
    ASSERT_EQ(roots.size(), truth.size()) << code;
    for (std::size_t i = 0; i < roots.size(); ++i) {
      ASSERT_EQ(roots[i].sign(formOf<3>(c)), 0) << code;
      const double below =
          static_cast<double>(truth[i] / (1 + truth[i]) - roots[i].timeLowerBound());
      ASSERT_GE(below, -1e-15) << code;
      ASSERT_LE(below, 0x1p-51 + 1e-15) << code;
      for (int other = random.below(40); other < kCodes; other += 40) {
        const std::vector<int> g = coefficients(other, 3, kMost);
        ASSERT_EQ(roots[i].sign(formOf<3>(g)), signAt(g, truth[i])) << code << ' ' << other;
        ASSERT_EQ(roots[i].sign(Form<1>{g[0], g[1]}), signAt({g[0], g[1]}, truth[i])) << code;
      }
      for (int other = random.below(900); other < power(7, 4); other += 900) {
        const std::vector<int> g = coefficients(other, 4, 3);
        ASSERT_EQ(roots[i].sign(formOf<4>(g)), signAt(g, truth[i])) << code << ' ' << other;
      }
    }
  }
}

TEST(AlgebraicTime, LinearRootsAreThoseOfTheForm) {
  for (int a = -6; a <= 6; ++a) {
    for (int b = -6; b <= 6; ++b) {
      if (a == 0 && b == 0) continue;
      const std::vector<QuadraticTime> roots = rootsInside(Form<1>{a, b});
      ASSERT_EQ(roots.size(), a * b < 0 ? 1u : 0u);
      if (roots.empty()) continue;
      EXPECT_EQ(roots[0].sign(Form<1>{a, b}), 0);
      const double x = std::abs(a) / static_cast<double>(std::abs(b));
      EXPECT_NEAR(roots[0].timeLowerBound(), x / (1 + x), 1e-15);
      EXPECT_EQ(roots[0].sign(Form<1>{a - 1, b}), -1);
      EXPECT_EQ(roots[0].sign(Form<1>{a + 1, b}), 1);
    }
  }
}

template <class Root>
double lowerBound(const Root& root, double tolerance) {
  if constexpr (std::is_same_v<Root, CubicTime>)
    return root.timeLowerBound(tolerance);
  else
    return root.timeLowerBound();
}

/// Every cubic with small coefficients, and with the same coefficients times 2^1200, which has the
/// same roots.
TEST(AlgebraicTime, CubicRootsAreThoseOfTheForm) {
  Random random(2);
  for (int code = 0; code < power(7, 4); ++code) {
    const std::vector<int> c = coefficients(code, 4, 3);
    if (isZeroForm(c)) continue;
    const std::vector<long double> truth = positiveRoots(c);
    const int shift = code % 3 == 0 ? 1200 : 0;
    std::size_t count = 0;
    anyRootInside(formOf<4>(c, shift), [&](const auto& root) {
      if (count >= truth.size()) return ++count > 9;
      const long double x = truth[count++];
      for (const double tolerance : {0x1p-40, 0x1p-52}) {
        const double below = static_cast<double>(x / (1 + x) - lowerBound(root, tolerance));
        EXPECT_GE(below, -1e-15) << code;
        EXPECT_LE(below, std::max(tolerance, 0x1p-51) + 1e-15) << code;
      }
      const auto check = [&](const std::vector<int>& g) {
        EXPECT_EQ(root.sign(formOf<3>(g)), signAt(g, x))
            << code << ": " << g[0] << ' ' << g[1] << ' ' << g[2];
      };
      for (int other = random.below(60); other < power(11, 3); other += 60)
        check(coefficients(other, 3, 5));
      // Forms that vanish near this root, so that bounds of the root do not decide.
      for (int denominator = 1; denominator <= 7; ++denominator) {
        const int numerator = static_cast<int>(std::lround(x * denominator));
        check({-numerator, denominator, 0});
        check({0, -numerator, denominator});
        check({-numerator, denominator - numerator, denominator});
      }
      return false;
    });
    EXPECT_EQ(count, truth.size()) << code;
  }
}

/// A root next to 1, whose time is next to a half: beside it by less than a double resolves.
TEST(AlgebraicTime, LowerBoundsAreNotLateNextToADouble) {
  for (int exponent = 60; exponent < 120; exponent += 5) {
    const Integer p = Integer(1) << exponent;
    // x² - 2p x + 2p - 2 has the lower root p - √((p - 1)² + 1) < 1.
    const std::vector<QuadraticTime> below = rootsInside(Form<2>{2 * p - 2, -2 * p, 1});
    ASSERT_EQ(below.size(), 2u);
    EXPECT_LT(below[0].timeLowerBound(), 0.5);
    EXPECT_GE(below[0].timeLowerBound(), 0.5 - 0x1p-51);
    // x² + 2p x - 2p - 2 has the root √((p + 1)² + 1) - p > 1.
    const std::vector<QuadraticTime> above = rootsInside(Form<2>{-2 * p - 2, 2 * p, 1});
    ASSERT_EQ(above.size(), 1u);
    EXPECT_LE(above[0].timeLowerBound(), 0.5);
    EXPECT_GE(above[0].timeLowerBound(), 0.5 - 0x1p-51);
  }
}

/// A quadratic that vanishes at the cubic's root, beside one that differs from it by one part in
/// 2^160, far below what floating point resolves.
TEST(AlgebraicTime, SignsNextToACubicRootAreExact) {
  Random random(3);
  for (int repeat = 0; repeat < 2000; ++repeat) {
    const auto nonzero = [&] {
      const int size = random.between(1, 30);
      return random.below(2) ? size : -size;
    };
    const int p = random.between(1, 30), r = random.between(1, 30), a = nonzero(), b = nonzero(),
              c = nonzero();
    // (r x - p) (a + b x + c x²)
    const Form<3> cubic{-p * a, r * a - p * b, r * b - p * c, r * c};
    const std::vector<int> quadratic{a, b, c};
    int linear = 0, common = 0;
    anyRootInside(cubic, [&](const auto& root) {
      const Form<2> line{-p, r, 0}, factor{a, b, c};
      if (root.sign(line) == 0) {
        ++linear;
        EXPECT_EQ(root.sign(factor), signAt(quadratic, static_cast<long double>(p) / r));
        // Beside the root by 2^-160.
        Form<2> beside{Integer(-p) << 160, Integer(r) << 160, 0};
        beside[0] += 1;
        EXPECT_EQ(root.sign(beside), 1);
        beside[0] -= 2;
        EXPECT_EQ(root.sign(beside), -1);
        beside[2] = beside[1];
        beside[1] = beside[0];
        beside[0] = 0;
        EXPECT_EQ(root.sign(beside), -1);
      } else {
        EXPECT_EQ(root.sign(factor), 0);
        ++common;
        Form<2> beside{Integer(a) << 160, Integer(b) << 160, Integer(c) << 160};
        beside[1] += 1;
        EXPECT_EQ(root.sign(beside), 1);
        beside[1] -= 2;
        EXPECT_EQ(root.sign(beside), -1);
      }
      return false;
    });
    EXPECT_EQ(linear, 1);
    const std::size_t roots = positiveRoots(quadratic).size();
    const bool shared = signAt(quadratic, static_cast<long double>(p) / r) == 0;
    EXPECT_EQ(common, static_cast<int>(roots) - shared);
  }
}

/// A square vanishes at its root without a change of sign. Around it, rounding errors are larger
/// than its values, whatever its magnitude is.
TEST(AlgebraicTime, ASquareVanishesAtItsRoot) {
  Random random(6);
  for (int repeat = 0; repeat < 2000; ++repeat) {
    const int p = random.between(1, 30), r = random.between(1, 30), shift = 40 * random.below(5);
    const Form<3> cubic{-7 * p, 7 * r - 2 * p, 2 * r - 5 * p, 5 * r};  // one root: p / r
    const Form<2> square{Integer(p * p) << shift, Integer(-2 * p * r) << shift,
                         Integer(r * r) << shift};
    int count = 0;
    anyRootInside(cubic, [&](const auto& root) {
      ++count;
      EXPECT_EQ(root.sign(square), 0) << p << ' ' << r << ' ' << shift;
      EXPECT_EQ(root.sign(Form<2>{square[0] + 1, square[1], square[2]}), 1);
      EXPECT_EQ(root.sign(Form<2>{square[0] - 1, square[1], square[2]}), -1);
      return false;
    });
    EXPECT_EQ(count, 1);
  }
}

/// (r x - p)³ = 2^-3m has one real root, and two others around it. Floating point finds it with few
/// digits.
TEST(AlgebraicTime, ARootInAClusterIsExact) {
  for (int m = 1; m <= 60; ++m)
    for (const auto& [p, r] : {std::array{1, 3}, {2, 5}, {7, 3}, {11, 13}}) {
      SCOPED_TRACE(std::to_string(m) + ", " + std::to_string(p) + " / " + std::to_string(r));
      const Integer one = Integer(1) << 3 * m;
      const Form<3> cubic{-one * (p * p * p) - 1, one * (3 * p * p * r), -one * (3 * p * r * r),
                          one * (r * r * r)};
      // x = (p 2^m + 1) / (r 2^m), and t = x / (1 + x)
      const Integer numerator = (Integer(p) << m) + 1, denominator = Integer(r) << m;
      const mpq_class truth(numerator, numerator + denominator);
      int count = 0;
      anyRootInside(cubic, [&](const auto& root) {
        ++count;
        EXPECT_EQ(root.sign(Form<2>{-numerator, denominator, 0}), 0);
        EXPECT_EQ(root.sign(Form<2>{-numerator - 1, denominator, 0}), -1);
        EXPECT_EQ(root.sign(Form<2>{-numerator + 1, denominator, 0}), 1);
        const mpq_class below = truth - mpq_class(lowerBound(root, 0x1p-50));
        EXPECT_TRUE(below >= 0 && below <= mpq_class(0x1p-50)) << below.get_d();
        return false;
      });
      EXPECT_EQ(count, 1);
    }
}

TEST(AlgebraicTime, TheSearchStopsAtTheFirstRootTaken) {
  const Form<3> cubic{-6, 11, -6, 1};  // roots 1, 2, 3
  int calls = 0;
  EXPECT_TRUE(anyRootInside(cubic, [&](const auto&) { return ++calls == 2; }));
  EXPECT_EQ(calls, 2);
  EXPECT_FALSE(anyRootInside(cubic, [&](const auto&) { return ++calls < 0; }));
  EXPECT_EQ(calls, 5);
}

TEST(AlgebraicTime, EndsOfTheStepTakeTheirCoefficient) {
  EXPECT_EQ(StartOfStep().sign(Form<2>{-3, 0, 5}), -1);
  EXPECT_EQ(EndOfStep().sign(Form<2>{-3, 0, 5}), 1);
  EXPECT_TRUE(isZero(Form<2>{0, 0, 0}));
  for (int i = 0; i < 3; ++i) {
    Form<2> form{0, 0, 0};
    form[i] = -1;
    EXPECT_FALSE(isZero(form));
  }
}

/// (1 - t)^i t^(3 - i) and sums of them, by exact values at multiples of 1/8.
TEST(CubicRoot, BlossomsHaveThePolynomialAsDiagonal) {
  Random random(4);
  for (int repeat = 0; repeat < 200; ++repeat) {
    CubicBernstein b;
    for (double& x : b) x = random.between(-9, 9);
    for (int i = 0; i <= 8; ++i) {
      const double t = i / 8.0, s = 1 - t;
      const double value =
          b[0] * s * s * s + 3 * b[1] * s * s * t + 3 * b[2] * s * t * t + b[3] * t * t * t;
      EXPECT_EQ(blossom(b, t, t, t), value);
      const double other = random.below(9) / 8.0;
      EXPECT_EQ(blossom(b, t, t, other), blossom(b, other, t, t));
      EXPECT_EQ(blossom(b, t, other, t), blossom(b, other, t, t));
    }
  }
}

TEST(CubicRoot, TheRootOfAMonotoneCubicIsFound) {
  Random random(5);
  for (int repeat = 0; repeat < 5000; ++repeat) {
    CubicBernstein b{-1 - random.unit()};
    for (std::size_t i = 1; i < 4; ++i) b[i] = b[i - 1] + random.unit();
    const double end = 0.01 + random.unit();
    for (double& x : b) x -= b[3] - end;
    if (!(b[0] < -0.01)) continue;
    for (const int rising : {1, -1}) {
      CubicBernstein c = b;
      for (double& x : c) x *= rising;
      const double t = approximateRoot(c, 0.0, 1.0, rising);
      EXPECT_GT(t, 0.0);
      EXPECT_LT(t, 1.0);
      EXPECT_NEAR(blossom(c, t, t, t), 0.0, 0x1p-50);
    }
  }
}

/// Where the slope is nearly zero, Newton's step leads out of the interval.
TEST(CubicRoot, ARootBeyondAnInflectionIsFound) {
  for (int i = 1; i < 40; ++i) {
    // (2t - 1)³ + s at t = 0, and its blossoms up to t = 1
    const double s = std::ldexp(i % 2 ? 1.0 : -1.0, -i);
    const CubicBernstein b{s - 1, s + 1, s - 1, s + 1};
    const double t = approximateRoot(b, 0.0, 1.0, 1);
    EXPECT_NEAR(t, (1 - std::cbrt(s)) / 2, 1e-5) << s;
    EXPECT_GE(approximateRoot(b, 0.75, 1.0, 1), 0.75);
    EXPECT_LE(approximateRoot(b, 0.0, 0.25, 1), 0.25);
  }
}

}  // namespace
}  // namespace palpate::test
