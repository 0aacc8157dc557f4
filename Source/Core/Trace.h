#pragma once

#include <palpate/Types.h>

#include "Core/CountedVector.h"

#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>

namespace palpate {

/// A part of a frame on one thread.
struct TraceEvent {
  const char* name = nullptr;               ///< null: not recorded
  std::int64_t begin = 0, end = 0;          ///< ns of the process's steady clock
  std::uint32_t thread = 0;                 ///< a number of its own for each thread of the process
  GeometryId a{kNoElement}, b{kNoElement};  ///< of a pair, or `a` alone; kNoElement: of neither
  std::uint32_t job = kNoElement;           ///< number in the pair, or kNoElement
};

/// The events of the last frames of one OctreeBasedCD. Memory is reused from frame to frame.
/// Threads  one at a time, but each reserved event may be recorded on a thread of its own.
class Trace {
 public:
  /// frames: how many are kept, at least 1.
  explicit Trace(std::size_t frames) : m_frames(frames) {}

  void startFrame();  ///< replaces the oldest one
  /// Appends events to the frame, to be recorded once. Returns the index of the first.
  std::size_t reserve(std::size_t count);
  TraceEvent& operator[](std::size_t index) { return current().events[index]; }

  /// The frames that were completed or ended by an exception, oldest first, in the Trace Event
  /// Format of Chrome and Perfetto.
  std::string json() const;

 private:
  struct Frame {
    std::uint64_t number = 0;  ///< from 1; 0: none
    CountedVector<TraceEvent> events;
  };
  Frame& current() { return m_frames[m_number % m_frames.size()]; }

  CountedVector<Frame> m_frames;
  std::uint64_t m_number = 0;
};

/// Records an event while it exists.
class TraceSpan {
 public:
  /// trace: null: no frame is traced, which costs nothing.
  TraceSpan(Trace* trace, const char* name, GeometryId a = GeometryId{kNoElement},
            GeometryId b = GeometryId{kNoElement})
      : TraceSpan(trace, trace ? trace->reserve(1) : 0, {name, 0, 0, 0, a, b}) {}
  /// Of a reserved event.
  TraceSpan(Trace* trace, std::size_t index, const TraceEvent& event)
      : m_trace(trace), m_index(index) {
    if (m_trace) start(event);
  }
  ~TraceSpan() {
    if (m_trace) end();
  }
  TraceSpan(const TraceSpan&) = delete;
  TraceSpan& operator=(const TraceSpan&) = delete;

 private:
  void start(const TraceEvent&);
  void end();

  Trace* const m_trace;
  const std::size_t m_index;
};

}  // namespace palpate
