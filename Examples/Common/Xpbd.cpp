#include "Xpbd.h"

#include <Eigen/Geometry>

#include <algorithm>

namespace palpate::scenes {

using Eigen::Vector3d;

std::uint32_t Xpbd::add(std::span<const Vector3d> positions, double inverseMass) {
  const auto first = static_cast<std::uint32_t>(now.size());
  now.insert(now.end(), positions.begin(), positions.end());
  before = now;
  velocities.resize(now.size(), Vector3d::Zero());
  inverseMasses.resize(now.size(), inverseMass);
  return first;
}

void Xpbd::predict(double seconds, const Vector3d& acceleration, double damping) {
  m_distanceMultipliers.assign(distances.size(), 0.0);
  m_bendMultipliers.assign(bends.size(), Vector3d::Zero());
  m_volumeMultipliers.assign(volumes.size(), 0.0);
  for (std::size_t i = 0; i < now.size(); ++i) {
    now[i] = before[i];
    if (inverseMasses[i] == 0) continue;
    velocities[i] = (1 - damping) * velocities[i] + seconds * acceleration;
    now[i] += seconds * velocities[i];
  }
}

std::span<const double> Xpbd::solve(double seconds, std::span<const ConstraintRow> rows,
                                    int iterations) {
  m_rowMultipliers.assign(rows.size(), 0.0);
  for (int iteration = 0; iteration < iterations; ++iteration) {
    // Forwards and backwards, so that a pull on either end of a thread reaches the other at once.
    const std::size_t count = distances.size();
    for (std::size_t i = 0; i < count; ++i)
      solveDistance(iteration % 2 == 0 ? i : count - 1 - i, seconds);
    for (std::size_t i = 0; i < bends.size(); ++i)
      solveBend(iteration % 2 == 0 ? i : bends.size() - 1 - i, seconds);
    for (std::size_t i = 0; i < volumes.size(); ++i) solveVolume(i, seconds);
    for (std::size_t i = 0; i < rows.size(); ++i) solveRow(rows[i], m_rowMultipliers[i]);
  }
  return m_rowMultipliers;
}

void Xpbd::commit(double seconds) {
  for (std::size_t i = 0; i < now.size(); ++i) velocities[i] = (now[i] - before[i]) / seconds;
  before = now;
}

void Xpbd::solveDistance(std::size_t index, double seconds) {
  const auto& [a, b, rest, compliance] = distances[index];
  const Vector3d along = now[a] - now[b];
  const double length = along.norm(), mobility = inverseMasses[a] + inverseMasses[b];
  if (length == 0 || mobility == 0) return;
  const double softness = compliance / (seconds * seconds);
  const double change =
      (rest - length - softness * m_distanceMultipliers[index]) / (mobility + softness);
  m_distanceMultipliers[index] += change;
  const Vector3d push = along * (change / length);
  now[a] += inverseMasses[a] * push;
  now[b] -= inverseMasses[b] * push;
}

void Xpbd::solveBend(std::size_t index, double seconds) {
  const auto& [a, middle, b, compliance] = bends[index];
  const double mobility = inverseMasses[middle] + (inverseMasses[a] + inverseMasses[b]) / 4;
  if (mobility == 0) return;
  const double softness = compliance / (seconds * seconds);
  const Vector3d error = now[middle] - (now[a] + now[b]) / 2;
  const Vector3d change = -(error + softness * m_bendMultipliers[index]) / (mobility + softness);
  m_bendMultipliers[index] += change;
  now[middle] += inverseMasses[middle] * change;
  now[a] -= inverseMasses[a] / 2 * change;
  now[b] -= inverseMasses[b] / 2 * change;
}

void Xpbd::solveVolume(std::size_t index, double seconds) {
  const auto& [first, count, triangles, rest, compliance] = volumes[index];
  const std::span<Vector3d> positions(now.data() + first, count);
  m_gradients.assign(count, Vector3d::Zero());
  for (const auto& [a, b, c] : triangles) {
    m_gradients[a] += positions[b].cross(positions[c]) / 6;
    m_gradients[b] += positions[c].cross(positions[a]) / 6;
    m_gradients[c] += positions[a].cross(positions[b]) / 6;
  }
  double mobility = compliance / (seconds * seconds);
  double error = rest - volumeOf(positions, triangles) - mobility * m_volumeMultipliers[index];
  for (std::uint32_t i = 0; i < count; ++i)
    mobility += inverseMasses[first + i] * m_gradients[i].squaredNorm();
  if (mobility == 0) return;
  error /= mobility;
  m_volumeMultipliers[index] += error;
  for (std::uint32_t i = 0; i < count; ++i)
    positions[i] += inverseMasses[first + i] * error * m_gradients[i];
}

void Xpbd::solveRow(const ConstraintRow& row, double& multiplier) {
  double mobility = 0;
  for (std::size_t i = 0; i < 4; ++i)
    mobility += inverseMasses[row.vertices[i]] * row.weights[i] * row.weights[i];
  if (mobility == 0) return;
  const double change = std::max(-row.gap(now) / mobility, -multiplier);
  multiplier += change;
  for (std::size_t i = 0; i < 4; ++i)
    now[row.vertices[i]] += inverseMasses[row.vertices[i]] * row.weights[i] * change * row.normal;
}

double volumeOf(std::span<const Vector3d> positions, std::span<const Triangle> triangles) {
  double six = 0;
  for (const auto& [a, b, c] : triangles) six += positions[a].dot(positions[b].cross(positions[c]));
  return six / 6;
}

}  // namespace palpate::scenes
