#include "Exact/PerturbedSide.h"

#include "Exact/ExactVector.h"
#include "Exact/Predicates.h"
#include "Exact/Rational.h"
#include "Core/Assert.h"

#include <bit>

namespace palpate {

namespace {

/// The direction in which a point moves.
exact::Vector<Integer> shiftOf(std::uint64_t number) {
  const Integer n = integer(number), square = n * n;
  return {n, square, square * n};
}

}  // namespace

int perturbedSide(const NumberedPoint& a, const NumberedPoint& b, const NumberedPoint& c,
                  const NumberedPoint& d) {
  SignCounts counts;
  if (const int side = orient3d(a.position, b.position, c.position, d.position, counts))
    return side;
  const exact::Integers points(a.position, b.position, c.position, d.position);
  const std::array shifts{shiftOf(a.number), shiftOf(b.number), shiftOf(c.number),
                          shiftOf(d.number)};
  // The volume is a cubic in e. Its coefficient of e^k sums the volumes in which k of the three
  // vectors are shifts. The last one is a Vandermonde determinant of the numbers.
  std::array<std::array<exact::Vector<Integer>, 2>, 3> vectors;
  using exact::operator-;
  for (std::size_t i = 0; i < 3; ++i) {
    vectors[i][0] = points.at[i + 1] - points.at[0];
    vectors[i][1] = shifts[i + 1] - shifts[0];
  }
  for (int degree = 1; degree <= 3; ++degree) {
    Integer coefficient = 0;
    for (unsigned chosen = 0; chosen < 8; ++chosen)
      if (std::popcount(chosen) == degree)
        coefficient += exact::volumeOf(vectors[0][chosen & 1], vectors[1][chosen >> 1 & 1],
                                       vectors[2][chosen >> 2]);
    if (const int side = sgn(coefficient)) return side;
  }
  PALPATE_ASSERT(false);
  return 0;
}

}  // namespace palpate
