#pragma once

#include <CLI/CLI.hpp>

#include <algorithm>
#include <charconv>
#include <cstdio>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace palpate::scenes {

/// A program ran, and what it promises does not hold.
class BrokenPromise : public std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// The exit code of a program, as that of palpate-check: 0 if f() returns true, 1 if it returns
/// false or throws BrokenPromise, 2 for a wrong call, a file or anything else that it throws. An
/// exception becomes one line on stderr.
template <class F>
int exitCodeOf(const CLI::App& app, F&& f) {
  const auto fails = [&app](const std::string& text, int code) {
    std::fprintf(stderr, "%s: %s\n", app.get_name().c_str(), text.c_str());
    return code;
  };
  try {
    return f() ? 0 : 1;
  } catch (const CLI::Success& help) {
    return app.exit(help);
  } catch (const CLI::ArgumentMismatch& error) {
    const std::string option =
        std::string(error.what()).substr(0, std::string(error.what()).find(':'));
    return fails(option + ": values are missing, or too many; see --help", 2);
  } catch (const CLI::ParseError& error) {
    return fails(std::string(error.what()) + "; see --help", 2);
  } catch (const BrokenPromise& error) {
    return fails(error.what(), 1);
  } catch (const std::exception& error) {
    return fails(error.what(), 2);
  }
}

/// Numbers of an option, of the type of its bounds.
template <class T>
CLI::Validator between(T low, T high) {
  const auto text = [](T value) {
    std::string digits = std::to_string(value);
    if (digits.find('.') != std::string::npos) digits.erase(digits.find_last_not_of("0") + 1);
    if (digits.back() == '.') digits.pop_back();
    return digits;
  };
  const std::string range = std::string(std::is_integral_v<T> ? "a whole number" : "a number") +
                            " from " + text(low) + " to " + text(high);
  return {[low, high, range](std::string& given) -> std::string {
            T value{};
            const auto [end, fault] =
                std::from_chars(given.data(), given.data() + given.size(), value);
            const bool isIn = fault == std::errc{} && end == given.data() + given.size() &&
                              value >= low && value <= high;
            return isIn ? "" : "\"" + given + "\" is not " + range;
          },
          range};
}

inline CLI::Validator oneOf(std::vector<std::string> names) {
  const std::string all = CLI::detail::join(names, ", ");
  return {[names = std::move(names), all](std::string& given) -> std::string {
            given = CLI::detail::to_lower(given);
            const bool isThere = std::find(names.begin(), names.end(), given) != names.end();
            return isThere ? "" : "\"" + given + "\" is none of " + all;
          },
          all};
}

/// Throws if a choice is part of no name. what: what the names are, as "scene".
inline void checkChoices(const std::vector<std::string>& choices,
                         const std::vector<std::string>& names, const std::string& what) {
  for (const std::string& choice : choices) {
    std::set<std::string> all;
    bool isThere = false;
    for (const std::string& name : names) {
      isThere |= name.find(choice) != std::string::npos;
      all.insert(name);
    }
    if (!isThere)
      throw std::invalid_argument("there is no " + what + " \"" + choice + "\", but " +
                                  CLI::detail::join(all, ", "));
  }
}

}  // namespace palpate::scenes
