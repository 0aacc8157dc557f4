#pragma once

#include <CLI/CLI.hpp>

#include <cstdio>
#include <exception>

namespace palpate::scenes {

/// The exit code of a program: 0 if f() returns. If it throws, one line goes to stderr, and the
/// code is 1. CLI11 sets the code for help and for wrong arguments.
template <class F>
int exitCodeOf(const CLI::App& app, F&& f) {
  try {
    f();
    return 0;
  } catch (const CLI::ParseError& error) {
    return app.exit(error);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}

}  // namespace palpate::scenes
