#pragma once

#include <CLI/CLI.hpp>

#include <cstdio>
#include <exception>

namespace palpate::scenes {

/// A program's exit code: 0 when f() returns. What it throws is said in one line on stderr, and
/// gives 1; help and arguments that CLI11 refuses end as it has them.
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
