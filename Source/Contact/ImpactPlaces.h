#pragma once

#include "Contact/ContactLists.h"
#include "Contact/Contents.h"
#include "Contact/Order.h"
#include "Contact/SidedImpact.h"
#include "Core/Assert.h"
#include "Core/Buffer.h"
#include "Core/Stopping.h"

#include <array>
#include <cstddef>
#include <cstdint>

namespace palpate {

/// A contact of two meshes by its list and its place there.
struct ImpactPlace {
  ContactKind kind;
  std::uint32_t index;
};

/// One value for each contact of two meshes.
template <class T>
class PerImpact {
 public:
  void assign(const CollisionData::Contents& contents, const T& value) {
    forEachMeshList(
        contents, [&](ContactKind kind, const auto& list) { of(kind).assign(list.size(), value); });
  }
  T& operator[](const ImpactPlace& place) { return of(place.kind)[place.index]; }
  const T& operator[](const ImpactPlace& place) const {
    return m_values[static_cast<std::size_t>(place.kind)][place.index];
  }

 private:
  Buffer<T>& of(ContactKind kind) { return m_values[static_cast<std::size_t>(kind)]; }

  std::array<Buffer<T>, 3> m_values;
};

/// The impacts of an answer for which others may stand: contacts before `end` that are not from
/// preferred buffers. ordered: of the call of orderContacts() that filled the contents.
class Impacts {
 public:
  Impacts(const CollisionData::Contents& contents, double end, const OrderScratch& ordered)
      : m_contents(contents), m_end(end), m_ordered(ordered) {}

  const CollisionData::Contents& contents() const { return m_contents; }
  /// Calls f(contact, place) for each impact, in the order of the lists.
  template <class F>
  void forEach(F&& f) const {
    TimeCheck check(32);
    forEachMeshList(m_contents, [&](ContactKind kind, const auto& contacts) {
      const Buffer<std::uint8_t>& preferred = m_ordered.preferred[static_cast<std::size_t>(kind)];
      PALPATE_ASSERT(preferred.empty() || preferred.size() == contacts.size());
      for (std::uint32_t i = 0; i < contacts.size(); ++i) {
        if (!(contacts[i].timeOfImpact < m_end) || (!preferred.empty() && preferred[i])) continue;
        check();
        f(contacts[i], ImpactPlace{kind, i});
      }
    });
  }
  /// Calls f(contact) for the contact at a place.
  template <class F>
  void with(const ImpactPlace& place, F&& f) const {
    forEachMeshList(m_contents, [&](ContactKind kind, const auto& contacts) {
      if (kind == place.kind) f(contacts[place.index]);
    });
  }

 private:
  const CollisionData::Contents& m_contents;
  const double m_end;
  const OrderScratch& m_ordered;
};

/// What Contacts::Distinct drops of the impacts of one answer.
struct DroppedImpacts {
  struct StandIn {
    ImpactPlace dropped, kept;
  };
  PerImpact<std::uint8_t> isDropped;
  /// Of impacts that are dropped for another one with their features: that one.
  PerImpact<ImpactPlace> sameFeatures;
  Buffer<StandIn> standIns;  ///< of all dropped impacts

  void drop(const ImpactPlace& dropped, const ImpactPlace& kept) {
    isDropped[dropped] = 1;
    standIns.push_back({dropped, kept});
  }
};

}  // namespace palpate
