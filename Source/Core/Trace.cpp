#include "Core/Trace.h"

#include "Core/Assert.h"

#include <algorithm>
#include <atomic>
#include <chrono>

namespace palpate {

namespace {

std::int64_t now() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

std::uint32_t threadNumber() {
  static std::atomic<std::uint32_t> next = 0;
  thread_local const std::uint32_t number = next.fetch_add(1, std::memory_order_relaxed);
  return number;
}

/// Nanoseconds as microseconds with three decimals.
std::string microseconds(std::int64_t nanoseconds) {
  const std::string decimals = std::to_string(nanoseconds % 1000);
  return std::to_string(nanoseconds / 1000) + "." + std::string(3 - decimals.size(), '0') +
         decimals;
}

std::string textOf(const TraceEvent& event, std::int64_t start, std::uint64_t frame) {
  const auto argument = [](const char* name, std::uint32_t value) {
    return value == kNoElement ? std::string()
                               : std::string(",\"") + name + "\":" + std::to_string(value);
  };
  return std::string("{\"ph\":\"X\",\"pid\":0,\"tid\":") + std::to_string(event.thread) +
         ",\"ts\":" + microseconds(event.begin - start) +
         ",\"dur\":" + microseconds(event.end - event.begin) + ",\"name\":\"" + event.name +
         "\",\"args\":{\"frame\":" + std::to_string(frame) +
         argument("a", static_cast<std::uint32_t>(event.a)) +
         argument("b", static_cast<std::uint32_t>(event.b)) + argument("job", event.job) + "}}";
}

}  // namespace

void Trace::startFrame() {
  ++m_number;
  current().number = m_number;
  current().events.clear();
}

std::size_t Trace::reserve(std::size_t count) {
  CountedVector<TraceEvent>& events = current().events;
  const std::size_t first = events.size();
  events.resize(first + count);
  return first;
}

void TraceSpan::start(const TraceEvent& event) {
  PALPATE_ASSERT(event.name && !(*m_trace)[m_index].name);
  TraceEvent& own = (*m_trace)[m_index];
  own = event;
  own.thread = threadNumber();
  own.begin = own.end = now();
}

void TraceSpan::end() { (*m_trace)[m_index].end = now(); }

std::string Trace::json() const {
  const auto forEach = [&](auto&& use) {
    for (std::size_t i = 1; i <= m_frames.size(); ++i) {
      const Frame& frame = m_frames[(m_number + i) % m_frames.size()];
      for (const TraceEvent& event : frame.events)
        if (event.name) use(event, frame.number);
    }
  };
  std::int64_t start = std::numeric_limits<std::int64_t>::max();
  forEach([&](const TraceEvent& event, std::uint64_t) { start = std::min(start, event.begin); });
  std::string text;
  forEach([&](const TraceEvent& event, std::uint64_t frame) {
    text += text.empty() ? "\n" : ",\n";
    text += textOf(event, start, frame);
  });
  return "{\"displayTimeUnit\":\"ms\",\"traceEvents\":[" + text + "\n]}\n";
}

}  // namespace palpate
