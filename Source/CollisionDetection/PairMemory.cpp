#include "CollisionDetection/PairMemory.h"

#include "CollisionDetection/PairTable.h"
#include "Search/PairResults.h"
#include "Contact/ContactLists.h"

#include <algorithm>

namespace palpate {

using Contents = CollisionData::Contents;

void TrackerMemory::follow(const PairMoment& moment, bool isCurrent, ContactMatch& scratch) {
  const auto& [step, question, collides, last, found, isOutdated] = moment;
  const bool changes = !isCurrent;
  if (changes && !collides) found.contents() = {};
  if (tracker && tracker->hasEnded(step)) tracker.reset();
  if (!question.settings().trackContacts) {
    if (tracker) tracker->startStep(step, Contents::of(last));
    if (!changes || !collides) return;
    found.contents().drop(&Contents::Columns::tracked);
    CountedVector<TrackedContact>().swap(found.contents().ended);
    found.contents().trackedOfSecond = false;
    return;
  }
  if (!tracker) tracker = std::make_unique<ContactTracker>();
  const bool begins = tracker->startStep(step, Contents::of(last));
  if (!changes) {
    if (begins) tracker->keep();
  } else if (collides || tracker->hadContacts(Contents::of(last))) {
    Contents& contents = found.contents();
    contents.trackedOfSecond = !contents.shape.empty() && &question.mesh() == &question.b;
    tracker->track(question.meshes(), collides,
                   {question.a.revisions.elements, question.b.revisions.elements},
                   Contents::of(last), contents, scratch);
  }
}

void TrackerMemory::keep(CollisionData& last) noexcept {
  if (tracker && tracker->keeps()) tracker->commit(Contents::of(last));
}

void TrackerMemory::commit(const PairMoment& moment) noexcept {
  if (!tracker) return;
  tracker->hold(moment.found.contents());
  tracker->setTracked(moment.question.settings().trackContacts);
}

void TrackerMemory::skip(const PairMoment& moment) noexcept {
  if (tracker) tracker->skip(moment.step, moment.isOutdated, Contents::of(moment.last));
}

void TrackerMemory::release(bool) {
  if (tracker) tracker->releaseMemory();
}

void SidesMemory::startStep(const PairMoment& moment) {
  const bool isSet = moment.question.settings().rememberSides;
  if (!sides && isSet) sides = std::make_unique<SideMemory>();
  if (!sides) return;
  sides->startStep(moment.step);
  if (!isSet && sides->isEmpty()) sides.reset();
}

bool SidesMemory::isWanted(const PairMoment& moment) {
  return moment.question.settings().rememberSides && moment.collides;
}

void SidesMemory::follow(const Question& question, Answer& found) {
  Contents& contents = found.contents();
  contents.rememberedSides.clear();
  found.bySides = false;
  if (!question.settings().rememberSides) return;
  const MeshPair meshes = question.meshes();
  sides->follow(meshes, contents.crossings);
  const bool anyAtEnd = contents.validity.atEnd > 0;
  sides->apply(meshes, contents);
  found.bySides = sides->changesContacts();
  if (found.bySides) contents.step.endRows.clear();
  std::size_t atImpact = 0;
  forEachContactList(contents, [&](ContactKind, const auto& contacts) {
    for (const auto& contact : contacts) atImpact += !anyAtEnd || contact.timeOfImpact < 1.0;
  });
  countContacts(atImpact, contents);
  if (!question.settings().reportCrossings) contents.crossings.clear();
}

void SidesMemory::commit(const PairMoment& moment) noexcept {
  if (!sides) return;
  if (!isWanted(moment)) sides->followNone();
  sides->commit();
}

void SidesMemory::release(bool) {
  if (sides) sides->releaseMemory();
}

bool ProxyMemory::isOf(const ProxySettings& settings, const State& state) const {
  return proxy && m_settings == settings && m_version.isCurrent(state);
}

bool ProxyMemory::update(const PairRecord& record,
                         std::span<const std::unique_ptr<PairRecord>> others,
                         const Threads& threads) {
  PALPATE_ASSERT(record.support->kind == PairKind::Proxy);
  const Body &a = record.a->body, &b = record.b->body;
  const PairSettings& settings = record.pair.settings;
  const State state{b.revisions.elements, b.mesh.now.bodyRevision()};
  const ProxySettings wanted{settings.thickness + a.mesh.largestRadius, settings.allowedError,
                             settings.proxy.widestNormalCone};
  if (isOf(wanted, state)) return false;
  if (m_version.isValid() && m_version.state().elements.topology == state.elements.topology &&
      m_version.state().positions != state.positions)
    throw Error(ErrorCode::UnsupportedMethod,
                nameOf(*record.a, *record.b) +
                    ": Method::Proxy is for a rigid body, and the positions of " + nameOf(b) +
                    " were changed; move it by setTransform(), or set its elements again",
                b.id);
  const auto shared = std::find_if(others.begin(), others.end(), [&](const auto& other) {
    return other->b == record.b && other->memory.proxy.isOf(wanted, state);
  });
  const bool builds = shared == others.end();
  proxy = builds ? std::make_shared<const SurfaceProxy>(b.mesh, wanted, threads)
                 : (*shared)->memory.proxy.proxy;
  m_settings = wanted;
  m_version.commit(state);
  return builds;
}

void ProxyMemory::forgetBody() noexcept {
  proxy.reset();
  m_version.invalidate();
}

void ProxyMemory::takeOver(ProxyMemory& former) noexcept {
  if (former.proxy && m_version.isValid() && former.isOf(m_settings, m_version.state()))
    proxy = std::move(former.proxy);
}

}  // namespace palpate
