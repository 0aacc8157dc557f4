#include "CollisionDetection/GuardedStep.h"

#include "Core/Assert.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <utility>

namespace palpate {

namespace {

using Eigen::Vector3d;

/// Share of the room in front of a part that it leaves. A smaller value lets it go further in this
/// step, and less far in the next.
constexpr double kRoomLeft = 0.125;
/// Rounds in which only what approaches is shortened, before a component is shortened as a whole.
constexpr int kRoundsAlone = 8;
/// Rounds in which a component is shortened as a whole, before it stays at `before`. One suffices,
/// except where positions round.
constexpr int kRoundsTogether = 4;

/// At a fraction of the way, rounded, but not beyond its ends.
double between(double before, double now, double fraction) {
  return std::clamp(before + fraction * (now - before), std::min(before, now),
                    std::max(before, now));
}
Vector3d between(const Vector3d& before, const Vector3d& now, double fraction) {
  PALPATE_ASSERT(fraction >= 0.0 && fraction <= 1.0);
  if (fraction == 1.0) return now;
  Vector3d p;
  for (int k = 0; k < 3; ++k) p[k] = between(before[k], now[k], fraction);
  return p;
}

/// The rotation is the normalised interpolation of the quaternions along the shorter way.
Pose between(const Pose& before, const Pose& now, double fraction) {
  if (fraction == 0.0) return before;
  if (fraction == 1.0) return now;
  Pose pose{before.rotation, between(before.translation, now.translation, fraction)};
  if (before.rotation == now.rotation) return pose;
  const Eigen::Quaterniond from(before.rotation), to(now.rotation);
  const double side = from.coeffs().dot(to.coeffs()) < 0 ? -1.0 : 1.0;
  Eigen::Quaterniond turned;
  turned.coeffs() = (1.0 - fraction) * from.coeffs() + side * fraction * to.coeffs();
  pose.rotation = turned.normalized().toRotationMatrix();
  return pose;
}

}  // namespace

void GuardedFractions::start(std::size_t parts) {
  m_fraction.assign(parts, 1.0);
  m_factor.assign(parts, 1.0);
  m_connected.start(parts);
  m_components.assign(parts, {});
}

/// Joins the components of the free parts of a touch.
void GuardedFractions::join(const GuardedParts& parts, const GuardedTouch& touch) {
  std::uint32_t first = GuardedParts::kNone;
  for (const GuardedTouch::Mover& mover : touch.movers) {
    if (!parts.isFree(mover.part)) continue;
    const std::uint32_t component = m_connected.find(mover.part);
    if (first == GuardedParts::kNone) first = component;
    if (component == first) continue;
    const int alone = std::max(m_components[first].alone, m_components[component].alone);
    m_connected.join(first, component);
    first = m_connected.find(first);
    m_components[first] = {alone};
  }
}

/// Decides how components with touches are shortened. Returns whether any is as a whole.
bool GuardedFractions::decideComponents(const GuardedParts& parts,
                                        std::span<const GuardedTouch> touches) {
  for (Component& component : m_components) component.factor = 2.0;
  for (const GuardedTouch& touch : touches)
    for (const GuardedTouch::Mover& mover : touch.movers) {
      if (!parts.isFree(mover.part)) continue;
      double& factor = componentOf(mover.part).factor;
      factor = std::min(factor, touch.atStart ? 0.0 : (1.0 - kRoomLeft) * touch.time);
    }
  bool anyTogether = false;
  for (Component& component : m_components) {
    component.shortensAll = component.factor <= 1.0 && component.alone == kRoundsAlone;
    if (component.factor > 1.0) continue;
    if (!component.shortensAll)
      ++component.alone;
    else if (++component.together > kRoundsTogether)
      component.factor = 0.0;
    anyTogether |= component.shortensAll;
  }
  return anyTogether;
}

/// Leaves a share of the room in front of the parts that approach, if the others move as they do.
void GuardedFractions::shortenApproaching(const GuardedParts& parts, const GuardedTouch& touch) {
  const auto canShorten = [&](const GuardedTouch::Mover& mover) {
    return parts.isFree(mover.part) && m_fraction[mover.part] > 0.0;
  };
  PALPATE_ASSERT(touch.time >= 0.0 && touch.time <= 1.0);
  double approach = 0, others = 0;
  for (const GuardedTouch::Mover& mover : touch.movers)
    (mover.approach < 0 && canShorten(mover) ? approach : others) += mover.approach;
  const double all = approach + others, room = others - touch.time * all;
  // The normal may be of no use, and lengths may overflow.
  const bool isKnown = approach < 0 && all < 0 && std::isfinite(all);
  const double most = isKnown && room > 0 ? std::min(1.0, -room / approach)
                      : isKnown           ? 0.0
                                          : touch.time;
  for (const GuardedTouch::Mover& mover : touch.movers)
    if (canShorten(mover) && (!isKnown || mover.approach < 0))
      m_factor[mover.part] = std::min(m_factor[mover.part], (1.0 - kRoomLeft) * most);
}

void GuardedFractions::shorten(const GuardedParts& parts, std::span<const GuardedTouch> touches) {
  PALPATE_ASSERT(parts.nodeCount() == m_fraction.size());
  for (const GuardedTouch& touch : touches) join(parts, touch);
  const bool anyTogether = decideComponents(parts, touches);
  for (const GuardedTouch& touch : touches) {
    const auto first = std::find_if(touch.movers.begin(), touch.movers.end(),
                                    [&](const auto& m) { return parts.isFree(m.part); });
    PALPATE_ASSERT(first != touch.movers.end());
    if (!componentOf(first->part).shortensAll) shortenApproaching(parts, touch);
  }
  for (std::uint32_t part = 0; anyTogether && part < m_factor.size(); ++part)
    if (const Component& component = componentOf(part); component.shortensAll)
      m_factor[part] = component.factor;
  for (std::size_t part = 0; part < m_factor.size(); ++part) {
    m_fraction[part] *= std::exchange(m_factor[part], 1.0);
    PALPATE_ASSERT(m_fraction[part] >= 0.0 && m_fraction[part] <= 1.0);
  }
}

void setShortened(const GuardedParts& parts, std::span<const double> fractions,
                  GeometryTable& geometries, const Threads& threads,
                  std::vector<Vector3d>& scratch) {
  PALPATE_ASSERT(fractions.size() == parts.nodeCount());
  for (const GuardedParts::Body& body : parts.bodies()) {
    const GeometryId id = body.geometry->body.id;
    const TriangleMesh& mesh = body.geometry->body.mesh;
    const auto fraction = [&](std::uint32_t node) { return fractions[parts.partOf(body, node)]; };
    if (body.isWhole && fraction(0) < 1.0)
      geometries.setTransform(
          id, {}, between(mesh.before.transform(), body.given.transform(), fraction(0)));
    if (mesh.before.hasSameBody(body.given)) continue;
    const std::span<const Vector3d> before = mesh.before.body(), given = body.given.body();
    bool isShortened = false;
    scratch.assign(given.begin(), given.end());
    for (std::uint32_t v = 0; v < given.size(); ++v) {
      const double share = fraction(body.isWhole ? 0 : v);
      if (share == 1.0) continue;
      isShortened = true;
      scratch[v] = between(before[v], given[v], share);
    }
    if (isShortened) geometries.setPositions(id, {}, scratch, threads);
  }
}

void restoreGiven(const GuardedParts& parts, GeometryTable& geometries) noexcept {
  for (const GuardedParts::Body& body : parts.bodies())
    geometries.restoreNow(*body.geometry, body.given);
}

void listHeld(const GuardedParts& parts, std::span<const double> fractions,
              std::vector<HeldVertex>& out) {
  out.clear();
  for (const GuardedParts::Body& body : parts.bodies())
    for (std::uint32_t i = 0; i < body.nodeCount(); ++i)
      if (const double fraction = fractions[parts.partOf(body, i)]; fraction < 1.0 && body.moves(i))
        out.push_back({body.geometry->body.id, body.isWhole ? kNoElement : i, fraction});
}

}  // namespace palpate
