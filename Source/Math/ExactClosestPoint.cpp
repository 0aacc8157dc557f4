#include "Math/ExactClosestPoint.h"

#include "Math/Exact.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace palpate::exact {

namespace {

using Eigen::Vector3d;

/// A vector of integers in units of 2^exponent of its Grid.
struct IntegerVector {
  std::array<Integer, 3> component;
  const Integer& operator[](int i) const { return component[i]; }
  Integer& operator[](int i) { return component[i]; }
};

IntegerVector operator-(const IntegerVector& a, const IntegerVector& b) {
  return {{a[0] - b[0], a[1] - b[1], a[2] - b[2]}};
}

IntegerVector scaled(const Integer& factor, const IntegerVector& a) {
  return {{factor * a[0], factor * a[1], factor * a[2]}};
}

Integer dot(const IntegerVector& a, const IntegerVector& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

IntegerVector cross(const IntegerVector& a, const IntegerVector& b) {
  return {{a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]}};
}

/// Positions as integers in units of 2^exponent, exactly.
template <std::size_t Count>
struct Grid {
  std::array<IntegerVector, Count> at;
  int exponent = 1024;

  template <class... Positions>
  explicit Grid(const Positions&... positions) {
    const std::array<const Vector3d*, Count> all{&positions...};
    for (const Vector3d* position : all) {
      for (int i = 0; i < 3; ++i) {
        int own;
        if (std::frexp((*position)[i], &own) != 0.0) exponent = std::min(exponent, own - 53);
      }
    }
    for (std::size_t n = 0; n < Count; ++n) {
      for (int i = 0; i < 3; ++i) {
        int own;
        const double mantissa = std::ldexp(std::frexp((*all[n])[i], &own), 53);
        if (mantissa == 0.0) continue;
        at[n][i] = mantissa;
        at[n][i] <<= own - 53 - exponent;
      }
    }
  }
};
template <class... Positions>
Grid(const Positions&...) -> Grid<sizeof...(Positions)>;

int bits(const Integer& a) { return static_cast<int>(mpz_sizeinbase(a.get_mpz_t(), 2)); }

/// numerator 2^exponent / denominator, within an ulp; denominator positive.
double quotient(const Integer& numerator, const Integer& denominator, int exponent = 0) {
  if (numerator == 0) return 0.0;
  // 64 or 65 bits of quotient, cut to 63, so that one rounding to double is left.
  const int shift = 64 - bits(numerator) + bits(denominator);
  const Integer magnitude = abs(numerator);
  Integer ratio = shift >= 0 ? Integer((magnitude << shift) / denominator)
                             : Integer(magnitude / (denominator << -shift));
  const int excess = bits(ratio) - 63;
  ratio >>= excess;
  const double value =
      std::ldexp(static_cast<double>(mpz_get_ui(ratio.get_mpz_t())), exponent - shift + excess);
  return sgn(numerator) < 0 ? -value : value;
}

/// numerator / denominator to the nearest multiple of 2^-53, where 0 <= numerator <= denominator.
double weight(const Integer& numerator, const Integer& denominator) {
  const Integer nearest = ((numerator << 54) + denominator) / (2 * denominator);
  return std::ldexp(nearest.get_d(), -53);
}

Vector3d unit(const IntegerVector& a) {
  const Integer square = dot(a, a);
  if (square == 0) return Vector3d::Zero();
  const int shift = std::max(0, (140 - bits(square)) / 2 + 1);  // of a root with 70 bits
  const Integer root = sqrt(Integer(square << 2 * shift));
  Vector3d result;
  for (int i = 0; i < 3; ++i) result[i] = quotient(a[i] << shift, root);
  return result;
}

/// The foot whose difference is a 2^exponent / denominator.
Foot footFrom(const IntegerVector& a, const Integer& denominator, int exponent) {
  const Integer square = dot(a, a);
  const int shift = square == 0 ? 0 : std::max(0, (140 - bits(square)) / 2 + 1);
  const Integer root = sqrt(Integer(square << 2 * shift));
  Foot foot{
      Vector3d::Zero(), unit(a), quotient(root, denominator << shift, exponent), 0.0, 0.0, true};
  for (int i = 0; i < 3; ++i) foot.difference[i] = quotient(a[i], denominator, exponent);
  return foot;
}

int side(const IntegerVector& p, const IntegerVector& a, const IntegerVector& b,
         const IntegerVector& normal) {
  return sgn(dot(cross(b - a, p - a), normal));
}

bool isAlong(const IntegerVector& p, const IntegerVector& a, const IntegerVector& b) {
  return dot(p - a, b - a) > 0 && dot(p - b, a - b) > 0;
}

/// Of a triangle without area: its longest edge, the first of equals.
int longestEdge(const std::array<IntegerVector, 4>& at) {
  int longest = 0;
  Integer most = -1;
  for (int i = 0; i < 3; ++i) {
    const IntegerVector edge = at[(i + 1) % 3] - at[i];
    const Integer square = dot(edge, edge);
    if (square > most) {
      most = square;
      longest = i;
    }
  }
  return longest;
}

}  // namespace

int along(const Vector3d& p, const Vector3d& a, const Vector3d& b) {
  const Grid grid(p, a, b);
  return sgn(dot(grid.at[0] - grid.at[1], grid.at[2] - grid.at[1]));
}

int side(const Vector3d& p, const Vector3d& a, const Vector3d& b, const Vector3d& c) {
  const Grid grid(p, a, b, c);
  const auto& [ip, ia, ib, ic] = grid.at;
  return side(ip, ia, ib, cross(ib - ia, ic - ia));
}

TriangleFeature closestFeature(const Vector3d& p, const Vector3d& a, const Vector3d& b,
                               const Vector3d& c) {
  const Grid grid(a, b, c, p);
  const auto& at = grid.at;
  const IntegerVector normal = cross(at[1] - at[0], at[2] - at[0]);
  if (dot(normal, normal) == 0) {
    const int edge = longestEdge(at);
    const int next = (edge + 1) % 3;
    if (isAlong(at[3], at[edge], at[next])) return static_cast<TriangleFeature>(3 + edge);
    const bool beyondStart = dot(at[3] - at[edge], at[next] - at[edge]) <= 0;
    return static_cast<TriangleFeature>(beyondStart ? edge : next);
  }
  bool inside = true;
  for (int i = 0; i < 3; ++i) {
    if (side(at[3], at[i], at[(i + 1) % 3], normal) > 0) continue;
    if (isAlong(at[3], at[i], at[(i + 1) % 3])) return static_cast<TriangleFeature>(3 + i);
    inside = false;
  }
  if (inside) return TriangleFeature::Face;
  for (int i = 0; i < 2; ++i) {
    const IntegerVector from = at[3] - at[i];
    if (dot(from, at[(i + 1) % 3] - at[i]) <= 0 && dot(from, at[(i + 2) % 3] - at[i]) <= 0)
      return static_cast<TriangleFeature>(i);
  }
  return TriangleFeature::CornerC;
}

Foot footOnPoint(const Vector3d& p, const Vector3d& a) {
  const Grid grid(p, a);
  return footFrom(grid.at[0] - grid.at[1], 1, grid.exponent);
}

Foot footOnLine(const Vector3d& p, const Vector3d& a, const Vector3d& b) {
  const Grid grid(p, a, b);
  const IntegerVector from = grid.at[0] - grid.at[1], edge = grid.at[2] - grid.at[1];
  const Integer numerator = dot(from, edge), denominator = dot(edge, edge);
  Foot foot =
      footFrom(scaled(denominator, from) - scaled(numerator, edge), denominator, grid.exponent);
  foot.s = weight(numerator, denominator);
  return foot;
}

Foot footOnPlane(const Vector3d& p, const Vector3d& a, const Vector3d& b, const Vector3d& c) {
  const Grid grid(p, a, b, c);
  const IntegerVector from = grid.at[0] - grid.at[1];
  const IntegerVector ab = grid.at[2] - grid.at[1], ac = grid.at[3] - grid.at[1];
  const IntegerVector normal = cross(ab, ac);
  const Integer denominator = dot(normal, normal);
  Foot foot = footFrom(scaled(dot(normal, from), normal), denominator, grid.exponent);
  foot.s = weight(dot(cross(from, ac), normal), denominator);
  foot.t = weight(dot(cross(ab, from), normal), denominator);
  return foot;
}

namespace {

/// Numerators of the two lines' weights over the squared length of their common normal.
struct Lines {
  IntegerVector normal;
  Integer s, t, denominator;

  explicit Lines(const std::array<IntegerVector, 4>& at) {
    const IntegerVector p = at[1] - at[0], q = at[3] - at[2], from = at[0] - at[2];
    normal = cross(p, q);
    denominator = dot(normal, normal);
    s = -dot(cross(from, q), normal);
    t = -dot(cross(from, p), normal);
  }
};

}  // namespace

Crossing crossing(const Vector3d& p0, const Vector3d& p1, const Vector3d& q0, const Vector3d& q1) {
  const Lines lines(Grid(p0, p1, q0, q1).at);
  if (lines.denominator == 0) return Crossing::Parallel;
  const bool inside =
      lines.s > 0 && lines.s < lines.denominator && lines.t > 0 && lines.t < lines.denominator;
  return inside ? Crossing::Interior : Crossing::Outside;
}

Foot footBetweenLines(const Vector3d& p0, const Vector3d& p1, const Vector3d& q0,
                      const Vector3d& q1) {
  const Grid grid(p0, p1, q0, q1);
  const Lines lines(grid.at);
  const Integer height = dot(lines.normal, grid.at[0] - grid.at[2]);
  Foot foot = footFrom(scaled(height, lines.normal), lines.denominator, grid.exponent);
  foot.s = weight(lines.s, lines.denominator);
  foot.t = weight(lines.t, lines.denominator);
  return foot;
}

namespace {

/// Squared distance as a quotient.
struct Quotient {
  Integer numerator, denominator;
};

Quotient squaredDistanceToEdge(const IntegerVector& p, const IntegerVector& a,
                               const IntegerVector& b) {
  const IntegerVector from = p - a, edge = b - a;
  const Integer along = dot(from, edge), square = dot(edge, edge);
  if (along <= 0) return {dot(from, from), 1};
  if (along >= square) return {dot(p - b, p - b), 1};
  return {dot(from, from) * square - along * along, square};
}

}  // namespace

int nearestEnd(const Vector3d& p0, const Vector3d& p1, const Vector3d& q0, const Vector3d& q1) {
  const Grid grid(p0, p1, q0, q1);
  const auto& at = grid.at;
  int nearest = 0;
  Quotient least = squaredDistanceToEdge(at[0], at[2], at[3]);
  for (int i = 1; i < 4; ++i) {
    const int other = i < 2 ? 2 : 0;
    const Quotient own = squaredDistanceToEdge(at[i], at[other], at[other + 1]);
    if (own.numerator * least.denominator < least.numerator * own.denominator) {
      least = own;
      nearest = i;
    }
  }
  return nearest;
}

Vector3d unitCross(const Vector3d& a, const Vector3d& b, const Vector3d& c, const Vector3d& d) {
  const Grid grid(a, b, c, d);
  return unit(cross(grid.at[1] - grid.at[0], grid.at[3] - grid.at[2]));
}

}  // namespace palpate::exact
