#pragma once

#include <palpate/Executor.h>

#include "Core/Threads.h"

#include <atomic>
#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <vector>

/// Executors that run tasks in different ways.
namespace palpate {

/// Runs tasks as the function does.
class FunctionExecutor : public Executor {
 public:
  using Run = std::function<void(std::size_t count, Task task, void* context)>;
  FunctionExecutor(int concurrency, Run run) : m_concurrency(concurrency), m_run(std::move(run)) {}
  int concurrency() const noexcept override { return m_concurrency; }
  void run(std::size_t count, Task task, void* context) override {
    ++calls;
    m_run(count, task, context);
  }
  std::atomic<int> calls{0};

 private:
  int m_concurrency;
  Run m_run;
};

inline std::shared_ptr<FunctionExecutor> executorOf(int concurrency, FunctionExecutor::Run run) {
  return std::make_shared<FunctionExecutor>(concurrency, std::move(run));
}

inline void backwards(std::size_t count, Executor::Task task, void* context) {
  while (count-- > 0) task(context, count);
}

/// One thread for each task, other than the caller's.
inline void onThreads(std::size_t count, Executor::Task task, void* context) {
  std::vector<std::thread> threads;
  for (std::size_t i = 0; i < count; ++i) threads.emplace_back([=] { task(context, i); });
  for (std::thread& thread : threads) thread.join();
}

struct Named {
  std::string name;
  std::shared_ptr<Executor> executor;
};

inline std::vector<Named> executors() {
  return {{"the library's pool", makeThreadPool(3)},
          {"backwards", executorOf(4, backwards)},
          {"a thread for each task", executorOf(3, onThreads)},
          {"first half on a thread, the rest here",
           executorOf(5, [](std::size_t count, Executor::Task task, void* context) {
             std::thread other([=] {
               for (std::size_t i = 0; i < count / 2; ++i) task(context, i);
             });
             for (std::size_t i = count / 2; i < count; ++i) task(context, i);
             other.join();
           })}};
}

/// Threads of the library's own pool, and of executors.
inline std::vector<Threads> threadsOfEveryKind() {
  std::vector<Threads> all;
  for (const int count : {1, 2, 3, 8}) all.emplace_back(count);
  for (const auto& [name, executor] : executors())
    for (const int count : {0, 2}) all.emplace_back(count, executor);
  return all;
}

}  // namespace palpate
