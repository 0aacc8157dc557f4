#pragma once

#include "Common/Sanitized.h"

#include <csignal>
#include <functional>
#include <string>
#include <sys/wait.h>
#include <unistd.h>

namespace palpate::testing {

#ifdef PALPATE_EMULATED
inline constexpr bool kEmulated = true;  ///< in an emulator that runs one process, as qemu-user
#else
inline constexpr bool kEmulated = false;
#endif

/// AddressSanitizer does not lock its allocator around fork(). If another thread of the parent
/// allocates at that moment, the child finds the allocator locked for ever. Emulators do not lock
/// their own state either.
inline constexpr bool kForksBesideThreads = !kAddressSanitizer && !kEmulated;
inline constexpr const char* kNoForks =
    "AddressSanitizer and emulators do not support fork() beside threads";

/// The result of a child: "passed", "failed", "exit 3", or "signal 14" (SIGALRM: it hung). The
/// child runs `body` and exits without running the exit handlers of the process.
inline std::string inChild(const std::function<bool()>& body, unsigned seconds = 20) {
  const pid_t child = fork();
  if (child < 0) return "no fork";
  if (child == 0) {
    std::signal(SIGALRM, SIG_DFL);
    alarm(seconds);
    bool passed = false;
    try {
      passed = body();
    } catch (...) {
      _exit(3);
    }
    _exit(passed ? 0 : 1);
  }
  int status = 0;
  if (waitpid(child, &status, 0) != child) return "not waited for";
  if (WIFSIGNALED(status)) return "signal " + std::to_string(WTERMSIG(status));
  const int code = WEXITSTATUS(status);
  return code == 0 ? "passed" : code == 1 ? "failed" : "exit " + std::to_string(code);
}

}  // namespace palpate::testing
