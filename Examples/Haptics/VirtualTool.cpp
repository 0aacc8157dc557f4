#include "VirtualTool.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace palpate::scenes {

using Eigen::Matrix3d;
using Eigen::Vector3d;

namespace {

constexpr double kSkin = 0.3;  // mm, between the proxy and the surface
constexpr double kMostMove =
    0.25;  // mm, of the proxy in one tick: it follows hands of at most 250 mm/s
constexpr int kMostSweeps = 100;
constexpr double kSolved = 1e-6;  // mm, by which no row changes the motion any more

Vector3d shortened(const Vector3d& v, double most) {
  return v.norm() > most ? Vector3d(most / v.norm() * v) : v;
}

/// The largest part of a move, in [0, 1], for which |part * move - way| <= most, where |way| is at
/// most `most`.
double partWithin(const Vector3d& move, const Vector3d& way, double most) {
  const double square = move.squaredNorm(), along = move.dot(way);
  const double room = most * most - way.squaredNorm();
  if (square == 0 || square - 2 * along <= room) return 1;
  return (along + std::sqrt(along * along + square * room)) / square;
}

/// A point of the organ's surface at a share of the step.
Vector3d pointOf(const Snapshot& snapshot, GeometryId organ,
                 const std::array<std::uint32_t, 3>& vertices, const Vector3d& weights,
                 double share) {
  Vector3d point = Vector3d::Zero();
  for (int i = 0; i < 3; ++i)
    if (weights[i] != 0) point += weights[i] * snapshot.position(organ, vertices[i], share);
  return point;
}

}  // namespace

bool SurfacePlayer::advance(std::shared_ptr<const Snapshot> latest, double time, double tick) {
  m_played = 0;
  if (!latest) return false;
  if (m_count == 0) m_time = latest->time();
  if (m_count == 0 || m_held[m_count - 1]->number() != latest->number()) {
    if (m_count == m_held.size()) {  // the player was not called for long
      std::rotate(m_held.begin(), m_held.begin() + 1, m_held.end());
      --m_count;
    }
    m_held[m_count++] = std::move(latest);
  }
  const double end = m_held[m_count - 1]->time();
  m_played = std::clamp(time - m_delay - m_time, 0.0, 2 * tick);
  m_played = std::clamp(end - m_time, 0.0, m_played);
  m_time += m_played;
  while (m_count > 1 && m_held[0]->time() < m_time) {
    std::rotate(m_held.begin(), m_held.begin() + 1, m_held.begin() + m_count);
    m_held[--m_count].reset();
  }
  m_share = std::clamp(1 - (m_held[0]->time() - m_time) / m_step, 0.0, 1.0);
  return true;
}

VirtualTool::VirtualTool(GeometryId organ)
    : m_organ(organ),
      m_blade(Box{Vector3d::Zero(), {kHalfExtents[0], kHalfExtents[1], kHalfExtents[2]}}) {}

Vector3d turnOf(const Matrix3d& rotation) {
  const Eigen::AngleAxisd turn(rotation);
  return turn.angle() * turn.axis();
}

/// The snapshot has its octree at the end of the step. The query therefore goes where the surface
/// near the proxy will be then, and its contacts are brought back to the surface at `share`.
void VirtualTool::addRows(const Snapshot& snapshot, double share) {
  const auto at = [&](const std::array<std::uint32_t, 3>& vertices, const Vector3d& weights,
                      double when) { return pointOf(snapshot, m_organ, vertices, weights, when); };
  const Vector3d ahead = at(m_nearest, m_weights, 1) - at(m_nearest, m_weights, share);
  snapshot.queries().contacts(m_organ, m_blade, {m_proxy.rotation, m_proxy.position + ahead},
                              kSkin + 2 * kMostMove, m_contacts);
  m_rows.clear();
  m_speed = 0;
  m_least = kInfinity;
  for (const ShapeContact& contact : m_contacts) {
    const Vector3d now = at(contact.vertices, contact.weights, share);
    const Vector3d back = now - at(contact.vertices, contact.weights, 1) + ahead;
    const double distance = contact.distance + contact.normal.dot(back);
    m_speed = std::max(m_speed, (at(contact.vertices, contact.weights, 1) -
                                 at(contact.vertices, contact.weights, 0))
                                    .norm());
    m_rows.push_back(
        {contact.normal, (now - m_proxy.position).cross(contact.normal), distance - kSkin, 0});
    if (distance >= m_least) continue;
    m_least = distance;
    m_nearest = contact.vertices;
    m_weights = contact.weights;
  }
}

/// Brings the wanted motion to the nearest one with normal . move + moment . turn <= gap in each
/// row.
void VirtualTool::solve(Vector3d& move, Vector3d& turn) {
  for (int sweep = 0; sweep < kMostSweeps; ++sweep) {
    double change = 0;
    for (Row& row : m_rows) {
      const double mass = 1 / (1 + row.moment.squaredNorm() / (kLever * kLever));
      const double over = row.normal.dot(move) + row.moment.dot(turn) - row.gap;
      const double before =
          std::exchange(row.multiplier, std::max(0.0, row.multiplier + over * mass));
      const double push = row.multiplier - before;
      move -= push * row.normal;
      turn -= push / (kLever * kLever) * row.moment;
      change = std::max(change, std::abs(push));
    }
    if (change < kSolved) return;
  }
}

VirtualTool::Answer VirtualTool::step(const Snapshot& snapshot, double share, double played,
                                      const ToolPose& device) {
  const double lastSpeed = m_speed;
  addRows(snapshot, share);
  const Vector3d way = device.position - m_device.position;
  const double motion =
      way.norm() + Vector3d(kHalfExtents.data()).norm() *
                       turnOf(device.rotation * m_device.rotation.transpose()).norm();
  m_device = device;
  Vector3d move = shortened(device.position - m_proxy.position, kMostMove);
  Vector3d turn =
      shortened(turnOf(device.rotation * m_proxy.rotation.transpose()), kMostMove / kLever);
  solve(move, turn);
  const double part = partWithin(move, way, motion + played * std::max(m_speed, lastSpeed));
  m_proxy.position += part * move;
  if (const double angle = part * turn.norm(); angle > 0) {
    const Eigen::AngleAxisd by(angle, turn.normalized());
    m_proxy.rotation = Eigen::Quaterniond(by * m_proxy.rotation).normalized().toRotationMatrix();
  }
  return {kStiffness * (m_proxy.position - device.position),
          kTurnStiffness * turnOf(m_proxy.rotation * device.rotation.transpose()), m_rows.size(),
          m_least, motion};
}

}  // namespace palpate::scenes
