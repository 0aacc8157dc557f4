#pragma once

#include <cstddef>
#include <new>

namespace palpate::testing {

/// Makes one allocation of the process fail, to test what an exception leaves behind.
///
/// A test binary that compiles FailingAllocation.cpp replaces all forms of operator new: plain and
/// array, aligned and not, throwing and not. While armed, the n-th call of any of them from any
/// thread throws std::bad_alloc, or returns null where it must not throw. Calls of malloc() are
/// neither counted nor made to fail.
class FailingAllocation {
 public:
  enum class Failures {
    One,  ///< only the n-th allocation fails
    All   ///< the n-th allocation and all later ones fail
  };

  /// The n-th allocation from now on fails, counted from 1. With n = 0 none fails; they are only
  /// counted.
  static void arm(std::size_t n, Failures failures = Failures::One);
  static void disarm();
  /// Calls f while the n-th allocation fails. Returns whether it threw std::bad_alloc.
  template <class F>
  static bool throwsAt(std::size_t n, F&& f, Failures failures = Failures::One) {
    bool threw = false;
    arm(n, failures);
    try {
      f();
    } catch (const std::bad_alloc&) {
      threw = true;
    }
    disarm();
    return threw;
  }
  /// Allocations between the last arm() and the disarm() after it, or until now. Failed ones count.
  static std::size_t count();
  /// Whether an allocation failed since the last arm().
  static bool failed();
  /// The largest number of bytes that were allocated at once between the last arm() and the
  /// disarm() after it, or until now, less those that were allocated before.
  static std::size_t peakBytes();
  /// The bytes that are allocated now, less those that were allocated at the last arm().
  static std::size_t bytes();
};

}  // namespace palpate::testing
