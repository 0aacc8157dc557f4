#include "Core/MemoryBudget.h"

#include <palpate/Error.h>

#include "Core/Assert.h"

#include <algorithm>
#include <bit>
#include <limits>
#include <new>
#include <string>

namespace palpate {

namespace {

thread_local MemoryScope::Place place;

/// Lies before each block of memory.
struct alignas(__STDCPP_DEFAULT_NEW_ALIGNMENT__) Header {
  MemoryScope::Place place;
};

constexpr std::size_t kDefaultAlignment = __STDCPP_DEFAULT_NEW_ALIGNMENT__;
static_assert(sizeof(Header) == kDefaultAlignment);

std::size_t offsetOf(std::size_t alignment) { return std::max(sizeof(Header), alignment); }

constexpr std::array<const char*, 7> kNames{"geometries",       "octrees", "candidate pairs",
                                            "the narrow phase", "results", "spatial queries",
                                            "snapshots"};

}  // namespace

std::shared_ptr<MemoryBudget> MemoryBudget::make(std::size_t limit) {
  return {new MemoryBudget(limit), [](MemoryBudget* budget) { budget->leave(); }};
}

void MemoryBudget::leave() noexcept {
  const std::size_t users = m_users.fetch_sub(1);
  PALPATE_ASSERT(users > 1 || m_total.now == 0);
  if (users == 1) delete this;
}

void MemoryBudget::Count::raisePeak(std::size_t bytes) {
  for (std::size_t most = peak; bytes > most && !peak.compare_exchange_weak(most, bytes);) {
  }
}

void MemoryBudget::charge(MemoryStage stage, std::size_t bytes) {
  const std::size_t limit = m_limit > 0 ? m_limit : std::numeric_limits<std::size_t>::max();
  std::size_t now = m_total.now;
  do {
    if (now > limit || bytes > limit - now) refuse(stage, bytes, now);
  } while (!m_total.now.compare_exchange_weak(now, now + bytes));
  m_total.raisePeak(now + bytes);
  Count& count = m_stages[static_cast<std::size_t>(stage)];
  count.raisePeak(count.now.fetch_add(bytes) + bytes);
  ++m_users;
}

void MemoryBudget::discharge(MemoryStage stage, std::size_t bytes) noexcept {
  PALPATE_ASSERT(m_stages[static_cast<std::size_t>(stage)].now >= bytes && m_total.now >= bytes);
  m_stages[static_cast<std::size_t>(stage)].now -= bytes;
  m_total.now -= bytes;
  leave();
}

void MemoryBudget::refuse(MemoryStage stage, std::size_t bytes, std::size_t now) const {
  throw Error(ErrorCode::MemoryLimit, "memoryLimit is " + std::to_string(m_limit) + " bytes; " +
                                          std::to_string(now) + " are in use, and " +
                                          kNames[static_cast<std::size_t>(stage)] + " would need " +
                                          std::to_string(bytes) + " more");
}

MemoryUse MemoryBudget::read(std::atomic<std::size_t> Count::*which) const {
  const auto of = [&](MemoryStage stage) -> std::size_t {
    return m_stages[static_cast<std::size_t>(stage)].*which;
  };
  return {of(MemoryStage::Geometries), of(MemoryStage::Octrees),
          of(MemoryStage::Pairs),      of(MemoryStage::NarrowPhase),
          of(MemoryStage::Results),    of(MemoryStage::Queries),
          of(MemoryStage::Snapshots),  m_total.*which};
}

MemoryUse MemoryBudget::now() const { return read(&Count::now); }
MemoryUse MemoryBudget::peak() const { return read(&Count::peak); }

void MemoryBudget::startPeak() {
  m_total.peak = m_total.now.load();
  for (Count& count : m_stages) count.peak = count.now.load();
}

MemoryScope::MemoryScope(const Place& next) : m_before(place) { place = next; }
MemoryScope::~MemoryScope() { place = m_before; }
MemoryScope::Place MemoryScope::current() { return place; }

void* allocateCounted(std::size_t bytes, std::size_t alignment) {
  PALPATE_ASSERT(std::has_single_bit(alignment));
  const std::size_t offset = offsetOf(alignment), all = bytes + offset;
  const MemoryScope::Place now = place;
  if (now.budget) now.budget->charge(now.stage, all);
  void* memory = nullptr;
  try {
    memory = alignment <= kDefaultAlignment ? ::operator new(all)
                                            : ::operator new (all, std::align_val_t{alignment});
  } catch (...) {
    if (now.budget) now.budget->discharge(now.stage, all);
    throw;
  }
  std::byte* const start = static_cast<std::byte*>(memory) + offset;
  ::new (static_cast<void*>(start - sizeof(Header))) Header{now};
  return start;
}

void freeCounted(void* memory, std::size_t bytes, std::size_t alignment) noexcept {
  if (!memory) return;
  std::byte* const start = static_cast<std::byte*>(memory);
  const MemoryScope::Place charged = reinterpret_cast<Header*>(start - sizeof(Header))->place;
  const std::size_t offset = offsetOf(alignment);
  if (alignment <= kDefaultAlignment)
    ::operator delete(start - offset);
  else
    ::operator delete (start - offset, std::align_val_t{alignment});
  if (charged.budget) charged.budget->discharge(charged.stage, bytes + offset);
}

}  // namespace palpate
