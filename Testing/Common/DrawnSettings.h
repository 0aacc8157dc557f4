#pragma once

#include <palpate/Executor.h>
#include <palpate/Settings.h>

#include "Common/RandomMeshes.h"
#include "Fields/Names.h"
#include "Fields/Settings.h"

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <type_traits>

namespace palpate::testing {

/// Changes members of settings to values that their lists in Source/Fields allow, so that a new
/// member is drawn as soon as it is listed. A member of a new type does not compile.
class DrawnSettings {
 public:
  /// Changes each member with a probability of one in `rarity`. lengths: L, some that matter.
  DrawnSettings(Random& random, unsigned rarity, const std::array<double, 4>& lengths)
      : m_random(random), m_rarity(rarity), m_lengths(lengths) {}

  template <HasFields Struct>
  void operator()(Struct& settings) {
    forEachMember(settings, [&](const auto& field, auto& member) {
      using Member = std::remove_cvref_t<decltype(member)>;
      if constexpr (HasFields<Member>)
        (*this)(member);
      else if (m_random() % m_rarity == 0)
        draw(member, field.unit);
    });
  }

 private:
  template <class Enumeration>
  requires std::is_enum_v<Enumeration>
  void draw(Enumeration& value, Unit) {
    value = static_cast<Enumeration>(m_random() % countEnumerators<Enumeration>());
  }
  void draw(bool& value, Unit) { value = m_random() % 2; }
  void draw(int& value, Unit) { value = std::array{1, 2, 7, 32}[m_random() % 4]; }
  void draw(std::uint64_t& value, Unit unit) {
    value = unit == Unit::Bytes ? m_random() % 2 << 40 : m_random();
  }
  void draw(std::uint32_t& value, Unit) { value = 1 + m_random() % 3; }
  void draw(double& value, Unit unit) {
    switch (unit) {
      case Unit::Length:
        value = m_lengths[m_random() % m_lengths.size()];
        return;
      case Unit::StepFraction:
        value = std::array{0x1p-50, 1e-6, 1e-3, 1.0}[m_random() % 4];
        return;
      case Unit::Angle:
        value = std::array{1e-3, 0.25, 1.5}[m_random() % 3];
        return;
      default:
        value = std::array{0.0, 0.5, 1.0}[m_random() % 3];
    }
  }
  /// A folder for files of the audit: none, so that runs leave no files.
  void draw(std::filesystem::path&, Unit) {}
  void draw(std::shared_ptr<Executor>& executor, Unit) {
    static const std::shared_ptr<Executor> pool = makeThreadPool(2);
    executor = pool;
  }

  Random& m_random;
  unsigned m_rarity;
  std::array<double, 4> m_lengths;
};

}  // namespace palpate::testing
