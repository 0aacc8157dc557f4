#pragma once

#include "Core/FloatingPoint.h"

#include <cstddef>
#include <memory>
#include <type_traits>

namespace palpate {

/// The one place for threads: a pool of std::thread, or oneTBB where PALPATE_THREADS=TBB.
///
/// Work is cut into chunks whose bounds depend on its size only, never on the number of threads, so
/// results written per chunk are the same for any number.
class Threads {
 public:
  explicit Threads(int count);  ///< 0: all cores
  ~Threads();
  Threads(Threads&&) noexcept;
  Threads& operator=(Threads&&) noexcept;

  int count() const { return m_count; }

  /// f(chunk, begin, end) for each chunk of at most `grain` of [0, size); returns when all are
  /// done. An exception from f is rethrown here.
  template <class F>
  void forChunks(std::size_t size, std::size_t grain, F&& f) const {
    if (size == 0) return;
    const std::size_t chunks = (size + grain - 1) / grain;
    forEach(chunks, [&](std::size_t chunk) {
      const std::size_t begin = chunk * grain;
      f(chunk, begin, begin + grain < size ? begin + grain : size);
    });
  }

  /// f(i) for each i in [0, size), one task each.
  template <class F>
  void forEach(std::size_t size, F&& f) const {
    if (m_count == 1 || size <= 1) {
      for (std::size_t i = 0; i < size; ++i) f(i);
      return;
    }
    using Function = std::remove_reference_t<F>;
    run(
        size,
        [](void* function, std::size_t i) {
          const StandardFloatingPoint standard;
          (*static_cast<Function*>(function))(i);
        },
        const_cast<void*>(static_cast<const void*>(std::addressof(f))));
  }

 private:
  void run(std::size_t size, void (*call)(void*, std::size_t), void* function) const;

  struct Pool;
  int m_count;
  std::unique_ptr<Pool> m_pool;
};

}  // namespace palpate
