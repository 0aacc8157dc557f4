#pragma once

#include <palpate/Tracking.h>

#include "Contact/Contents.h"
#include "NarrowPhase/NarrowPhase.h"
#include "Tracking/ContactMatch.h"
#include "Mesh/Revision.h"
#include "Core/MemoryBudget.h"

#include <array>
#include <cstdint>
#include <limits>
#include <span>

namespace palpate {

/// The contacts of one pair over time (PairSettings::trackContacts). Docs/HowTo/ContactsOverTime.md
/// has the rules.
class ContactTracker : public CountedObject {
 public:
  using Contents = CollisionData::Contents;

  /// Takes over the contacts of the last detection if a step has begun since. Call before the
  /// other functions. step: the number of the present one. Returns whether it did.
  bool startStep(std::uint64_t step, const Contents& last) noexcept;
  bool hadContacts(const Contents& last) const;  ///< at the last advance()

  /// Writes the column `tracked` and Contents::ended of an answer in this step. last: of the last
  /// detection, maybe in this step. collides: false if groups exclude the pair. elements: of the
  /// pair's geometries.
  void track(const MeshPair&, bool collides, const std::array<ElementsState, 2>& elements,
             const Contents& last, Contents& next, ContactMatch& scratch);
  /// An answer that needs no detection lasts into this step. Call commit() then.
  void keep() { m_keeps = true; }
  bool keeps() const { return m_keeps; }
  void commit(Contents& kept) noexcept;
  /// Another answer has replaced the last one. Takes the contacts of that one, which `before` has,
  /// if they are those at the last advance().
  void hold(Contents& before) noexcept;
  /// Whether the last answer is tracked. If not, and it is that at the end of its step, contacts
  /// begin anew in the next one.
  void setTracked(bool isTracked) noexcept { m_isTracked = isTracked; }
  bool isTracked() const { return m_isTracked; }
  bool hasEnded(std::uint64_t step) const { return !m_isTracked && m_step != step; }
  /// There is no answer in this step: `kept` is that of an earlier detection, whose contacts
  /// neither grow older nor end. drops: it will be cleared, as its elements are no more. The next
  /// answer is compared with it even so.
  void skip(std::uint64_t step, bool drops, Contents& kept) noexcept;

  void releaseMemory();  ///< keeps what contacts have been

  /// Returns whether the answer has the contact.
  bool setUserData(Contents&, const ContactKey&, std::uint64_t);

  /// For saved states. revisions: SavedRevisions of the pair's geometries. kept: the last answer,
  /// which was described before. isCurrent: it holds for the present state of the pair.
  template <class File>
  void describe(File&, const auto& revisions, const Contents& kept, bool isCurrent);

 private:
  /// Whether Contents::shape has elements of the other geometry now: equal keys are other contacts.
  bool hasOtherElements(const Contents& next) const {
    return next.trackedOfSecond != m_beforeOfSecond;
  }
  /// The contacts at the last advance().
  const Contents& before(const Contents& last) const { return m_isHeld ? m_held : last; }
  void reserveAs(const Contents& next);
  void give(const ContactMatch::Given&);
  ContactEnd endOf(const MeshPair&, bool collides, const ContactMatch::Ended&) const;

  static constexpr std::uint64_t kNoStep = std::numeric_limits<std::uint64_t>::max();
  std::uint64_t m_step = kNoStep;  ///< the one after the last advance()
  /// The contacts at the last advance(), if m_isHeld; else the last answer has them, one step older
  /// if m_hasGrown.
  Contents m_held;
  bool m_isHeld = false, m_hasGrown = false;
  bool m_beforeOfSecond = false;  ///< Contents::trackedOfSecond of these contacts
  std::array<ElementsState, 2> m_elementsBefore, m_elements;  ///< theirs; of the last answer
  Buffer<ContactMatch::Given> m_given;                        ///< in this step, sorted by key
  bool m_keeps = false;                                       ///< keep()
  bool m_isTracked = true;                                    ///< the last answer
  bool m_isDropped = false;  ///< m_held is all that is left of the last answer
};

}  // namespace palpate
