#pragma once

#include "CollisionDetection/GuardedParts.h"
#include "CollisionDetection/GuardedTouches.h"
#include "Core/DisjointSets.h"

#include <cstdint>
#include <span>
#include <vector>

namespace palpate {

/// The fractions of their steps that parts make, while StepGuard::hold() shortens them. Touches
/// connect parts to components. Its arrays remember their peak.
class GuardedFractions {
 public:
  void start(std::size_t parts);
  std::span<const double> all() const { return m_fraction; }  ///< by part
  /// Shortens the steps of parts that touch. Each touch has a free part with a fraction above 0.
  void shorten(const GuardedParts&, std::span<const GuardedTouch>);

 private:
  /// Shortening of the parts of one component.
  struct Component {
    int alone = 0;     ///< rounds in which only approaching parts were shortened
    int together = 0;  ///< rounds since a part joined in which all were
    double factor = 1.0;
    bool shortensAll = false;
  };

  Component& componentOf(std::uint32_t part) { return m_components[m_connected.find(part)]; }
  void join(const GuardedParts&, const GuardedTouch&);
  bool decideComponents(const GuardedParts&, std::span<const GuardedTouch>);
  void shortenApproaching(const GuardedParts&, const GuardedTouch&);

  std::vector<double> m_fraction, m_factor;  ///< by part
  DisjointSets m_connected;
  std::vector<Component> m_components;  ///< by component
};

/// Sets positions and transforms now, at the parts' fractions of their steps. scratch: keeps its
/// peak.
void setShortened(const GuardedParts&, std::span<const double> fractions, GeometryTable&,
                  const Threads&, std::vector<Eigen::Vector3d>& scratch);
/// Sets them back to those at GuardedParts::start().
void restoreGiven(const GuardedParts&, GeometryTable&) noexcept;
/// What moves and makes less than its whole step, ascending.
void listHeld(const GuardedParts&, std::span<const double> fractions, std::vector<HeldVertex>& out);

}  // namespace palpate
