#pragma once

#include <palpate/Tracking.h>

#include "Contact/ContactLists.h"
#include "Contact/Contents.h"
#include "Core/Buffer.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>

namespace palpate {

/// cornersOf() a contact by its place in the list of a kind.
inline Triangle cornersAt(const CollisionData::Contents& contents, ContactKind kind,
                          std::size_t place) {
  Triangle corners{};
  forEachContactList(contents, [&](ContactKind of, const auto& list) {
    if (of == kind) corners = cornersOf(list[place]);
  });
  return corners;
}

/// The contact with this key, null if there is none. tracked: of one list.
template <class List>
auto* findTracked(List& tracked, const ContactKey& key) {
  const auto found =
      std::lower_bound(tracked.begin(), tracked.end(), key,
                       [](const TrackedContact& l, const ContactKey& r) { return l.key < r; });
  return found != tracked.end() && found->key == key ? &*found : nullptr;
}

/// Compares the contacts of two answers of a pair: which lasted, ended or began, and from which a
/// contact that began slid. Its scratch remembers its peak; pairs take turns with it.
class ContactMatch {
 public:
  using Contents = CollisionData::Contents;
  /// The vertices of a contact's two features, some of them twice. What has no vertices, as a
  /// shape, has kNoElement.
  using Vertices = std::array<Triangle, 2>;
  /// A contact of the answer before that is not in the next one.
  struct Ended {
    const TrackedContact* contact;
    Vertices vertices;
    bool isPredecessor;  ///< of a contact of the next answer
  };

  /// Writes the column `tracked` of the next answer, without Contents::ended. steps: between the
  /// answers. self: a mesh with itself. otherElements: Contents::shape has elements of the other
  /// geometry now, so that equal keys are other contacts.
  void track(const Contents& before, std::uint32_t steps, bool self, bool otherElements,
             Contents& next);
  /// User data given to a contact that began in the step.
  struct Given {
    ContactKey key;
    Triangle corners;  ///< cornersOf() the contact
    bool ofSecond;     ///< Contents::trackedOfSecond, of a contact with a shape; else false
    std::uint64_t userData;
    bool isOf(const Given& other) const {
      return key == other.key && corners == other.corners && ofSecond == other.ofSecond;
    }
  };
  /// The first with this key, or where it belongs. given: sorted by key.
  static auto placeOf(auto& given, const ContactKey& key) {
    return std::lower_bound(given.begin(), given.end(), key,
                            [](const Given& l, const ContactKey& r) { return l.key < r; });
  }
  /// Contacts that began get their user data. given: sorted by key.
  void takeUserData(std::span<const Given> given, bool ofSecond);
  /// Those of track(), ascending.
  std::span<const Ended> ended() const { return m_ended; }

 private:
  struct Begun {
    TrackedContact* contact;
    Vertices vertices;
    bool hasPredecessor;
  };
  /// A contact in the list of a vertex of its first feature.
  struct Link {
    std::uint64_t others;  ///< the vertices of its other feature, and maybe more
    std::uint32_t entry, next;
  };
  static constexpr std::uint32_t kNoLink = 0;  ///< its `others` is empty, and it follows itself
  /// A contact that began and one that ended, in the list of one of its three vertices.
  struct Candidate {
    std::uint32_t begun, entry;
    unsigned vertex;
  };
  /// A contact that ended and has `shared` vertices in common with one that began.
  struct Slide {
    std::uint32_t begun, entry;
    unsigned shared;
  };

  void match(const Contents& before, std::uint32_t steps, bool otherElements, Contents& next);
  template <ContactKind kKind>
  void matchList(const Contents& before, std::uint32_t steps, bool mayLast, Contents& next);
  void linkVertices(bool self);
  void findCandidates();
  void findSlides(bool self, bool otherElements);
  void takePredecessors(std::uint32_t steps);

  Buffer<Ended> m_ended;
  Buffer<Begun> m_begun;
  Buffer<std::uint32_t> m_lists;  ///< their first links, by the vertex modulo their number
  Buffer<Link> m_links;
  Buffer<Candidate> m_candidates;
  Buffer<Slide> m_slides, m_sortedSlides;
};

}  // namespace palpate
