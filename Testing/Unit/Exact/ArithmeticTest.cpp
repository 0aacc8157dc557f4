#include "Exact/Compensated.h"
#include "Exact/ExactVector.h"
#include "Exact/FilteredSigns.h"
#include "Exact/Rational.h"
#include "Common/Sanitized.h"
#include "Unit/Math/RationalOracle.h"
#include "Unit/Math/TrianglePairs.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace palpate::test {
namespace {

using Exactly = mpq_class;

double uneven(Random& random) {
  const double size = random.ldexp(random.unit() + 0.5, -30, 30);
  return random.below(2) ? size : -size;
}
Eigen::Vector3d unevenVector(Random& random) {
  return {uneven(random), uneven(random), uneven(random)};
}
Difference unevenDifference(Random& random) {
  const Eigen::Vector3d a = unevenVector(random), b = unevenVector(random);
  return difference(a, b);
}
Exactly valueOf(const Difference& a, int i) { return Exactly(a.high[i]) + Exactly(a.low[i]); }
oracle::Vector valueOf(const Difference& a) {
  return {valueOf(a, 0), valueOf(a, 1), valueOf(a, 2)};
}
Exactly magnitude(const oracle::Vector& a) {
  return Exactly(abs(a[0])) + Exactly(abs(a[1])) + Exactly(abs(a[2]));
}
bool isWithin(const Exactly& error, const Exactly& bound) { return abs(error) <= bound; }

TEST(Compensated, SumsAndProductsAreExact) {
  Random random(1);
  for (int repeat = 0; repeat < 20000; ++repeat) {
    const double a = uneven(random), b = uneven(random);
    const RoundedWithError sum = exactSum(a, b), product = exactProduct(a, b),
                           halves = splitInHalves(a);
    ASSERT_TRUE(sum.value == a + b && Exactly(sum.value) + sum.error == Exactly(a) + b);
    ASSERT_TRUE(product.value == a * b && Exactly(product.value) + product.error == Exactly(a) * b);
    ASSERT_EQ(halves.value + halves.error, a);
    for (const double half : {halves.value, halves.error}) {
      int exponent;
      const double bits = std::ldexp(std::frexp(half, &exponent), 26);
      ASSERT_EQ(bits, std::trunc(bits));
    }
  }
}

TEST(Compensated, DifferencesAreExactAndSumsNearlySo) {
  Random random(2);
  for (int repeat = 0; repeat < 5000; ++repeat) {
    const Eigen::Vector3d p = unevenVector(random), q = unevenVector(random);
    const Difference a = difference(p, q), b = unevenDifference(random), c = sum(a, b), d = half(a);
    for (int i = 0; i < 3; ++i) {
      ASSERT_EQ(a.high[i], p[i] - q[i]);
      ASSERT_TRUE(valueOf(a, i) == Exactly(p[i]) - q[i]);
      ASSERT_TRUE(2 * valueOf(d, i) == valueOf(a, i));
      const Exactly terms = Exactly(abs(valueOf(a, i))) + Exactly(abs(valueOf(b, i)));
      ASSERT_TRUE(isWithin(valueOf(c, i) - valueOf(a, i) - valueOf(b, i), terms * 0x1p-104));
    }
  }
}

TEST(Compensated, CombinationsCrossAndDotProductsKeepTheirBounds) {
  Random random(3);
  const auto coarse = [&] { return std::ldexp(random.between(-(1 << 26), 1 << 26), -26); };
  for (int repeat = 0; repeat < 5000; ++repeat) {
    const Difference u = unevenDifference(random), v = unevenDifference(random);
    const double s = coarse(), t = coarse();
    Difference m = unevenDifference(random);
    if (repeat % 2) {  // cancels to a small remainder
      for (int i = 0; i < 3; ++i) m.high[i] = -(s * u.high[i] + t * v.high[i]);
      m = difference(m.high, 0x1p-60 * unevenVector(random));
    }
    const Eigen::Vector3d two = combination(m, s, u, t, v), one = combination(m, s, u);
    for (int i = 0; i < 3; ++i) {
      const Exactly a = valueOf(m, i), b = Exactly(s) * valueOf(u, i),
                    c = Exactly(t) * valueOf(v, i);
      const Exactly terms = Exactly(abs(a)) + Exactly(abs(b)), more = terms + Exactly(abs(c));
      ASSERT_TRUE(
          isWithin(two[i] - (a + b + c), Exactly(abs(a + b + c)) * 0x1p-53 + more * 0x1p-78));
      ASSERT_TRUE(isWithin(one[i] - (a + b), Exactly(abs(a + b)) * 0x1p-53 + terms * 0x1p-78));
    }
    const oracle::Vector exact = oracle::cross(valueOf(u), valueOf(v));
    const Difference product = cross(u, v), swapped = cross(v, u);
    const Exactly lengths = magnitude(valueOf(u)) * magnitude(valueOf(v));
    for (int i = 0; i < 3; ++i) {
      ASSERT_TRUE(isWithin(valueOf(product, i) - exact[i], lengths * 0x1p-103));
      ASSERT_TRUE(product.high[i] == -swapped.high[i] && product.low[i] == -swapped.low[i]);
    }
    ASSERT_EQ(accurateCross(u, v), product.high);
    Difference w = v;  // the dot product with u cancels
    w.high[2] = -(u.high[0] * v.high[0] + u.high[1] * v.high[1]) / u.high[2];
    w = difference(w.high, 0x1p-60 * unevenVector(random));
    for (const Difference& other : {v, w}) {
      const Exactly truth = oracle::dot(valueOf(u), valueOf(other));
      Exactly products = 0;
      for (int i = 0; i < 3; ++i) products += Exactly(abs(valueOf(u, i) * valueOf(other, i)));
      ASSERT_TRUE(isWithin(accurateDot(u, other) - truth,
                           Exactly(abs(truth)) * 0x1p-53 + products * 0x1p-98));
    }
    ASSERT_DOUBLE_EQ(sumOfMagnitudes(u.high), u.high.lpNorm<1>());
    ASSERT_EQ(largest(u.high), u.high.lpNorm<Eigen::Infinity>());
    ASSERT_EQ(dot(u.high, v.high),
              (u.high[0] * v.high[0] + u.high[1] * v.high[1]) + u.high[2] * v.high[2]);
  }
}

TEST(Compensated, ScalesBringExtentsNearOne) {
  constexpr double kLargest = std::numeric_limits<double>::max(),
                   kLeast = std::numeric_limits<double>::denorm_min();
  for (int exponent = -1074; exponent <= 1023; ++exponent) {
    const double extent = std::ldexp(1.0, exponent);
    EXPECT_EQ(isModerate(extent), exponent > -100 && exponent < 100);
    EXPECT_EQ(exponentTowardsOne(extent), -exponent);
    EXPECT_EQ(scaleTowardsOne(extent),
              isModerate(extent) ? 1.0 : std::ldexp(1.0, std::clamp(-exponent, -1000, 1000)));
  }
  EXPECT_EQ(exponentTowardsOne(kLargest), -1023);
  EXPECT_EQ(exponentTowardsOne(kLeast), 1074);
  EXPECT_EQ(exponentTowardsOne(INFINITY), -1023);
  EXPECT_EQ(exponentTowardsOne(NAN), -1023);
  EXPECT_EQ(exponentTowardsOne(0.0), 1074);
  EXPECT_EQ(palpate::scaled(Eigen::Vector3d(1, -2, 3), 4), Eigen::Vector3d(16, -32, 48));
}

Int128 wide(Random& random) {
  const auto part = [&] { return static_cast<UnsignedInt128>(random.unit() * 0x1p53); };
  const UnsignedInt128 bits = (part() << 75 ^ part() << 40 ^ part()) >> random.below(128);
  const Int128 magnitude = static_cast<Int128>(bits >> 2);
  return random.below(2) ? magnitude : -magnitude;
}
Integer integerOf(UnsignedInt128 a) {
  Integer high = integer(static_cast<std::uint64_t>(a >> 64)),
          low = integer(static_cast<std::uint64_t>(a));
  return (high << 64) + low;
}
Integer integerOf(Int128 a) {
  const Integer magnitude = integerOf(static_cast<UnsignedInt128>(a < 0 ? -a : a));
  return a < 0 ? Integer(-magnitude) : magnitude;
}
Integer integerOf(const Int256& a) {
  Integer value = (integerOf(a.high) << 128) + integerOf(a.low);
  if (a.sign() < 0) value -= Integer(1) << 256;
  return value;
}

Integer integerOf(const Int512& a) {
  Integer value = 0;
  for (std::size_t i = a.words.size(); i-- > 0;)
    value = (value << 64) + integerOf(UnsignedInt128{a.words[i]});
  if (a.sign() < 0) value -= Integer(1) << 512;
  return value;
}

TEST(WideInteger, ProductsSumsAndSignsAreThoseOfIntegers) {
  Random random(5);
  for (int repeat = 0; repeat < 20000; ++repeat) {
    const Int128 a = wide(random), b = wide(random), c = wide(random), d = wide(random);
    const Int256 p = product(a, b), q = product(c, d);
    const Integer truthP = integerOf(a) * integerOf(b), truthQ = integerOf(c) * integerOf(d);
    ASSERT_TRUE(integerOf(p) == truthP) << repeat;
    ASSERT_TRUE(integerOf(p + q) == truthP + truthQ) << repeat;
    ASSERT_TRUE(integerOf(p - q) == truthP - truthQ) << repeat;
    ASSERT_EQ((p - q).sign(), sgn(Integer(truthP - truthQ)));
    ASSERT_EQ((p - p).sign(), 0);
    ASSERT_EQ(exact::signOf(a), sgn(integerOf(a)));
    ASSERT_EQ(exact::signOf(p), sgn(truthP));
    const Int512 r = product(p, q), s = product(q, q);
    const Integer truthR = truthP * truthQ, truthS = truthQ * truthQ;
    ASSERT_TRUE(integerOf(r) == truthR) << repeat;
    ASSERT_TRUE(integerOf(r + s) == truthR + truthS) << repeat;
    ASSERT_TRUE(integerOf(r - s) == truthR - truthS) << repeat;
    ASSERT_EQ((r - s).sign(), sgn(Integer(truthR - truthS)));
    ASSERT_EQ((r - r).sign(), 0);
    ASSERT_TRUE(integerOf(exact::product(p, c)) == truthP * integerOf(c));
  }
}

TEST(WideInteger, GridsHoldDifferencesOfPositionsOrSayThatTheyDoNot) {
  Random random(6);
  int fitting = 0;
  for (int repeat = 0; repeat < 20000; ++repeat) {
    const int bits = random.between(1, 70), exponent = random.between(-1000, 900);
    const auto coordinate = [&] {
      const int low = random.below(2) ? 0 : random.between(0, bits);
      return std::ldexp(std::round(std::ldexp(random.unit() - 0.5, std::min(bits, 52))),
                        exponent + low);
    };
    const auto position = [&] { return Eigen::Vector3d{coordinate(), coordinate(), coordinate()}; };
    const Eigen::Vector3d a = position(), b = position(), c = position();
    const ExponentRange range(a, b, c);
    int lowest = ExponentRange::kNone, highest = -ExponentRange::kNone;
    for (const Eigen::Vector3d* p : {&a, &b, &c})
      for (const double x : *p) {
        if (x == 0.0) continue;
        int least = std::ilogb(x);
        highest = std::max(highest, least + 1);
        while (std::ldexp(x, -least) != std::trunc(std::ldexp(x, -least))) --least;
        lowest = std::min(lowest, least);
      }
    ASSERT_EQ(range.lowest, lowest);
    ASSERT_EQ(range.highest, highest);
    const FixedGrid grid(a, b, c);
    const Eigen::Vector3d* const all[] = {&a, &b, &c};
    bool fits = highest - lowest <= 120;
    for (int n = 0; n < 3; ++n)
      for (int i = 0; i < 3; ++i) {
        if (lowest == ExponentRange::kNone) continue;
        const Integer relative = scaledInteger((*all[n])[i], lowest) - scaledInteger(a[i], lowest);
        fits = fits && abs(relative) < Integer(1) << 60;
        if (grid.fits) {
          const std::int64_t found = grid.at[n][i];
          ASSERT_TRUE(abs(relative) == integer(static_cast<std::uint64_t>(std::abs(found))) &&
                      sgn(relative) == (found > 0) - (found < 0));
        }
      }
    ASSERT_EQ(grid.fits, fits) << repeat;
    fitting += fits;
  }
  EXPECT_GT(fitting, 2000);
  EXPECT_LT(fitting, 18000);
}

TEST(Rational, QuotientsAreWithinAnUlpForAllSizes) {
  Random random(7);
  const auto large = [&] {
    const auto part = [&] { return integer(static_cast<std::uint64_t>(random.unit() * 0x1p62)); };
    Integer value = part() + 1;
    value <<= random.below(300);
    value += part();
    return value >>= random.below(60);
  };
  for (int repeat = 0; repeat < 20000; ++repeat) {
    const Integer size = large(), numerator = random.below(2) ? size : Integer(-size),
                  denominator = large() + 1;
    const int exponent = random.between(-300, 300);
    const double value = exact::quotient(numerator, denominator, exponent);
    Exactly truth(numerator, denominator);
    truth.canonicalize();
    if (exponent >= 0)
      truth *= Exactly(Integer(1) << exponent);
    else
      truth /= Exactly(Integer(1) << -exponent);
    ASSERT_TRUE(isWithin(value - truth, Exactly(abs(truth)) * 0x1p-53 * (1 + 0x1p-9))) << repeat;
  }
  EXPECT_EQ(exact::quotient(0, 5, 3), 0.0);
}

TEST(Rational, DoublesKeepTheirValueAndOrder) {
  Random random(8);
  const auto any = [&] {
    return random.below(9) == 0 ? double(random.between(-2, 2))
                                : random.ldexp(random.unit() - 0.5, -1080, 1020);
  };
  for (int repeat = 0; repeat < 20000; ++repeat) {
    const double a = any(), b = random.below(5) == 0 ? a : any();
    const exact::Rational r = exact::rational(a);
    ASSERT_GT(sgn(r.denominator), 0);
    ASSERT_EQ(exact::toDouble(r), a);
    ASSERT_EQ(exact::compare(r, b), (a > b) - (a < b));
    ASSERT_EQ(exact::compare(r, exact::rational(b)), (a > b) - (a < b));
  }
  EXPECT_EQ(exact::compare(exact::rational(1), INFINITY), -1);
  EXPECT_EQ(exact::compare(exact::rational(1), -INFINITY), 1);
}

TEST(Rational, IntegersOfPositionsAreExactAndShort) {
  Random random(9);
  for (int repeat = 0; repeat < 2000; ++repeat) {
    const Eigen::Vector3d a = unevenVector(random), b = unevenVector(random);
    const exact::Integers integers(a, b);
    bool odd = false;
    for (int i = 0; i < 3; ++i) {
      ASSERT_TRUE(integers.at[0][i] == scaledInteger(a[i], integers.exponent));
      ASSERT_TRUE(integers.at[1][i] == scaledInteger(b[i], integers.exponent));
      ASSERT_EQ(std::ldexp(integers.at[0][i].get_d(), integers.exponent), a[i]);
      odd = odd || mpz_odd_p(integers.at[0][i].get_mpz_t()) ||
            mpz_odd_p(integers.at[1][i].get_mpz_t());
    }
    ASSERT_TRUE(odd);
  }
}

/// A decided sign is that of the exact differences, also next to zero and where products
/// underflow or overflow.
TEST(FilteredSigns, DecidedSignsAreThoseOfExactDifferences) {
  Random random(10);
  int decided = 0;
  for (int repeat = 0; repeat < testing::casesOf(200000); ++repeat) {
    const int e = repeat % 4 == 0   ? random.between(-545, -490)
                  : repeat % 4 == 1 ? random.between(-200, 500)
                                    : 0;
    const Eigen::Vector3d a = scaled(random.inCube(), e), b = scaled(random.inCube(), e),
                          c = scaled(random.inCube(), e);
    Eigen::Vector3d d = c - scaled(random.inCube(), e);
    const Eigen::Vector3d u = a - b;
    // c - d becomes perpendicular to a - b, up to a share of 1 to 2^-56 of its length.
    const double share = random.ldexp(random.unit() - 0.5, -55, 0);
    if (u[2] != 0.0) {
      const double along = (u[0] * (c[0] - d[0]) + u[1] * (c[1] - d[1])) / u[2];
      d[2] = c[2] + along * (1 + share);
    }
    const Eigen::Vector3d v = c - d;
    if (!v.allFinite()) continue;
    const Sign sign = signAlong(u, v);
    if (sign == Sign::Unknown) continue;
    ++decided;
    Integer truth = 0;
    for (int i = 0; i < 3; ++i)
      truth +=
          (scaledInteger(a[i]) - scaledInteger(b[i])) * (scaledInteger(c[i]) - scaledInteger(d[i]));
    ASSERT_EQ(sign == Sign::Positive, sgn(truth) > 0) << repeat;
  }
  EXPECT_GT(decided, 1000 / testing::kShareOfCases);
}

TEST(FilteredSigns, PerpendicularAxesAreDecided) {
  const Eigen::Vector3d x(2, 0, 0), yz(0, -1, 3);
  EXPECT_EQ(signAlong(x, yz), Sign::NotPositive);
  EXPECT_EQ(signAlong(x, x), Sign::Positive);
  EXPECT_EQ(signAlong(x, -x), Sign::NotPositive);
  EXPECT_EQ(signAlong({1, 1, 0}, {1, -1, 0}), Sign::Unknown);
  EXPECT_EQ(signAlong({1e200, 0, 0}, {1e200, 0, 0}), Sign::Unknown);
  EXPECT_EQ(signAlong({NAN, 0, 0}, {1, 0, 0}), Sign::Unknown);
  EXPECT_EQ(signOf(NAN, 0.0), Sign::Unknown);
  EXPECT_EQ(signOf(1.0, 1.0), Sign::Unknown);
  EXPECT_EQ(signOf(-1.0, 1.0), Sign::Unknown);
}

TEST(FilteredSigns, DecidedSidesAreThoseOfExactDifferences) {
  Random random(11);
  int decided = 0;
  const auto exactDifference = [](const Eigen::Vector3d& p, const Eigen::Vector3d& q) {
    return oracle::operator-(oracle::toRational(p), oracle::toRational(q));
  };
  for (int repeat = 0; repeat < 20000; ++repeat) {
    const int e = repeat % 2 ? random.between(-290, -240) : 0;
    const auto position = [&] { return scaled(random.inCube(), e); };
    const Eigen::Vector3d a = position(), b = position(), c = position(), d = position(),
                          g = position();
    // The point is on the plane through the edge and the normal, up to rounding.
    const Eigen::Vector3d edge = b - a, p = c - a, q = d - a, normal = p.cross(q);
    Eigen::Vector3d at = a + random.unit() * edge;
    at += random.unit() *
          (normal.norm() > 0 ? Eigen::Vector3d(normal / normal.norm() * edge.norm()) : g);
    const double aside = std::ldexp(1.0, -random.below(56));
    at += aside * position();
    const Eigen::Vector3d from = at - a;
    const Sign sign = signAside(edge, from, normal, sumOfMagnitudes(p) * sumOfMagnitudes(q));
    if (sign == Sign::Unknown) continue;
    ++decided;
    const oracle::Vector n = oracle::cross(exactDifference(c, a), exactDifference(d, a));
    const oracle::Vector side = oracle::cross(exactDifference(b, a), exactDifference(at, a));
    ASSERT_EQ(sign == Sign::Positive, sgn(oracle::dot(side, n)) > 0) << repeat;
  }
  EXPECT_GT(decided, 10);
  EXPECT_EQ(signAside({1, 0, 0}, {0, 1, 0}, {0, 0, 1}, 1.0), Sign::Positive);
  EXPECT_EQ(signAside({1, 0, 0}, {0, 1, 0}, {0, 0, 1}, 1e200), Sign::Unknown);
  EXPECT_EQ(signAside({1e100, 0, 0}, {0, 1e100, 0}, {0, 0, 1}, 1.0), Sign::Unknown);
}

/// An edge of a box with a face of it: no rounding error, and nothing beside the vectors counts.
TEST(FilteredSigns, VectorsThatShareNoAxisAreNotAlong) {
  struct {
    Eigen::Vector3d vector;
    double next;
  } u{{1, 0, 3}, 1}, v{{0, 2, 0}, 1};
  EXPECT_EQ(signAlong(u.vector, v.vector), Sign::NotPositive);
  EXPECT_EQ(signAlong({1, 0, 0x1p-600}, {0, 2, 0x1p-600}), Sign::Unknown);
}

TEST(ExactVector, ProductsTakeEachComponent) {
  const exact::Vector<std::int64_t> a{2, 3, 5}, b{7, 11, 13};
  EXPECT_TRUE(exact::dot(a, b) == 112);
  const auto c = exact::cross(a, b);
  EXPECT_TRUE(c[0] == -16 && c[1] == 9 && c[2] == 1);
  EXPECT_TRUE(exact::operator-(b, a) == (exact::Vector<std::int64_t>{5, 8, 8}));
}

}  // namespace
}  // namespace palpate::test
