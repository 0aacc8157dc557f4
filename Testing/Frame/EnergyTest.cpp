#include "Common/DegenerateCases.h"
#include "Common/PairRun.h"
#include "Common/RandomMeshes.h"
#include "Common/Sanitized.h"

#include <palpate/ConstraintRows.h>
#include <palpate/OctreeBasedCD.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

namespace palpate::testing {
namespace {

using Eigen::Vector3d;

/// Two bodies of equal particles that nothing holds together, and an inelastic solver that projects
/// them onto the reported rows, one after the other.
class Particles {
 public:
  Particles(const Mesh& a, const Mesh& b, const PairSettings& settings)
      : m_sizeOfA(a.positions.size()), m_x(a.positions) {
    m_x.insert(m_x.end(), b.positions.begin(), b.positions.end());
    m_a = addMesh(m_collisions, a);
    m_b = addMesh(m_collisions, b);
    m_collisions.addCollisionPair(m_a, m_b, settings);
    m_collisions.advance();
  }

  /// Two velocities, L per step, and differences of each particle up to `noise`.
  void setVelocities(Random& random, const Vector3d& ofA, const Vector3d& ofB, double noise) {
    for (std::size_t i = 0; i < m_x.size(); ++i)
      m_velocities.push_back((i < m_sizeOfA ? ofA : ofB) + randomPoint(random, -noise, noise));
  }
  double energy() const {
    double sum = 0;
    for (const Vector3d& v : m_velocities) sum += v.squaredNorm();
    return sum;
  }

  /// Returns whether all answers of the step were trusted.
  bool step() {
    const std::vector<Vector3d> before = m_x;
    for (std::size_t i = 0; i < m_x.size(); ++i) m_x[i] += m_velocities[i];
    bool areTrusted = true;
    for (int round = 0; round < 4; ++round) {
      const CollisionData& data = detect(before);
      areTrusted &= data.validity().trusted;
      std::vector<ConstraintRow> rows;
      data.appendRows(rows, 0, static_cast<std::uint32_t>(m_sizeOfA));
      for (int iteration = 0; iteration < 10; ++iteration)
        for (const ConstraintRow& row : rows) project(row);
    }
    detect(before);
    m_collisions.advance();
    for (std::size_t i = 0; i < m_x.size(); ++i) m_velocities[i] = m_x[i] - before[i];
    return areTrusted;
  }

 private:
  const CollisionData& detect(const std::vector<Vector3d>& before) {
    const std::span<const Vector3d> start(before), now(m_x);
    m_collisions.setPositions(m_a, start.first(m_sizeOfA), now.first(m_sizeOfA));
    m_collisions.setPositions(m_b, start.subspan(m_sizeOfA), now.subspan(m_sizeOfA));
    m_collisions.detectCollision();
    return m_collisions.collisionData(m_a, m_b);
  }
  void project(const ConstraintRow& row) {
    const double gap = row.gap(m_x);
    if (gap >= 0) return;
    double square = 0;
    for (const double weight : row.weights) square += weight * weight;
    for (std::size_t i = 0; i < 4; ++i)
      m_x[row.vertices[i]] -= gap / square * row.weights[i] * row.normal;
  }

  OctreeBasedCD m_collisions{settingsOf(Engine::Octree)};
  GeometryId m_a{}, m_b{};
  std::size_t m_sizeOfA;
  std::vector<Vector3d> m_x, m_velocities;  ///< of a, then of b
};

Mesh clothOrBox(Random& random) {
  const bool isFlat = random() % 2;
  if (random() % 2) return dividedBox({0, 0, 0}, {1, 1, 0.5}, 1 + static_cast<int>(random() % 3));
  Mesh cloth = sheet(4, 0, 0);
  if (isFlat)
    for (Vector3d& p : cloth.positions) p.z() = 0;
  return cloth;
}

/// On each other, exactly or with a gap of 0.1, at places of a grid of quarters or at any.
void putOn(const Mesh& lower, Random& random, Mesh& upper) {
  double top = -1, bottom = 1;
  for (const Vector3d& p : lower.positions) top = std::max(top, p.z());
  for (const Vector3d& p : upper.positions) bottom = std::min(bottom, p.z());
  Vector3d way = randomPoint(random, -0.5, 0.5);
  const bool isExact = random() % 2;
  if (isExact) way = (4 * way).array().round() / 4;
  way.z() = top - bottom + (isExact ? 0 : 0.1);
  for (Vector3d& p : upper.positions) p += way;
}

/// Rows that a step's start meets cannot push particles away from it: a projection onto them keeps
/// or shortens every displacement. Contacts that demand more than the features need would not.
TEST(Energy, DoesNotGrowInTrustedSteps) {
  Random random(12);
  std::size_t trusted = 0;
  for (int run = 0; run < casesOf(150, 30); ++run) {
    const Mesh b = clothOrBox(random);
    Mesh a = clothOrBox(random);
    putOn(b, random, a);
    PairSettings settings;
    if (random() % 4 == 0) settings.method = Method::Continuous;
    if (random() % 2) settings.thickness = 0.05;
    if (random() % 2) settings.contacts = Contacts::All;
    settings.smoothNormals = random() % 4 == 0;
    const double speed = std::pow(10.0, uniform(random, -1.5, -0.5));
    Vector3d ofA = speed * randomPoint(random, -1, 1);
    ofA.z() = -std::abs(ofA.z());
    Particles particles(a, b, settings);
    particles.setVelocities(random, ofA, speed * randomPoint(random, -1, 1), 0.05 * speed);
    for (int step = 0; step < 15; ++step) {
      const double before = particles.energy();
      if (!particles.step()) continue;
      ++trusted;
      EXPECT_LE(particles.energy(), before * (1 + 1e-9)) << "run " << run << ", step " << step;
    }
  }
  EXPECT_GE(trusted, leastOf(800, 150));
}

}  // namespace
}  // namespace palpate::testing
