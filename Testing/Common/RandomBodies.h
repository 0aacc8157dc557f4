#pragma once

#include <palpate/AnalyticalGeometry.h>

#include "Common/Solids.h"
#include "Common/TestGeometry.h"

#include <array>
#include <cstdint>

namespace palpate::testing {

/// Where bodies are. All but Unit are states in which filters leave decisions to exact arithmetic.
enum class Space : std::uint8_t {
  Unit,        ///< anywhere in a cube
  Grid,        ///< at corners of a coarse grid: features coincide
  Flat,        ///< in one plane
  FlatGrid,    ///< at corners of a grid in one plane
  NearlyFlat,  ///< about 1e-13 beside a plane
  Far,         ///< 2^20 cubes away
  Tiny,        ///< in a cube of 2^-300
};

enum class BodySize : std::uint8_t {
  Small,  ///< some dozen elements
  Large   ///< a thousand elements, so that candidates are kept
};

/// Random bodies, motions and poses in a space.
class RandomBodies {
 public:
  /// unit: L, of all lengths, a power of two.
  RandomBodies(Random& random, Space space, BodySize size, double unit)
      : m_random(random), m_space(space), m_size(size), m_unit(unit) {}

  Space space() const { return m_space; }
  bool areLarge() const { return m_size == BodySize::Large; }
  double unit() const { return m_unit; }

  /// Where the space has a position.
  Vector3d inSpace(Vector3d) const;
  Positions inSpace(Positions) const;
  double length(double units) const;      ///< one that the space has
  std::array<double, 4> lengths() const;  ///< L: thicknesses and reaches that matter
  TestGeometry geometry(int type);        ///< of six types
  TestGeometry stretched(TestGeometry);
  Solid solid();
  AnalyticalGeometry shape();
  Positions motion(const Positions& from);
  Pose pose(const Pose& from);

 private:
  double grid() const { return areLarge() ? 0x1p-6 : 0.25; }  ///< in units
  bool isGrid() const { return m_space == Space::Grid || m_space == Space::FlatGrid; }
  Vector3d motionStep();
  TestGeometry box();                    ///< in units
  TestGeometry smallGeometry(int type);  ///< in units
  TestGeometry largeGeometry(int type);  ///< in units

  Random& m_random;
  Space m_space;
  BodySize m_size;
  double m_unit;
};

}  // namespace palpate::testing
