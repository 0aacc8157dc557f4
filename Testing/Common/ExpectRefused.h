#pragma once

#include <palpate/Error.h>

#include <gtest/gtest.h>

#include <optional>
#include <string>

namespace palpate::testing {

/// Expects that the call throws this error, that its message contains the words, and that it names
/// the geometry and the element, if they are given.
template <class Call>
void expectRefused(ErrorCode code, const std::string& words, Call&& call,
                   std::optional<GeometryId> geometry = std::nullopt,
                   std::optional<std::size_t> element = std::nullopt) {
  try {
    call();
    ADD_FAILURE() << "accepted; expected: " << words;
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), code);
    EXPECT_NE(std::string(error.what()).find(words), std::string::npos) << error.what();
    if (geometry) {
      EXPECT_EQ(error.geometry(), geometry);
    }
    if (element) {
      EXPECT_EQ(error.element(), element);
    }
  }
}

}  // namespace palpate::testing
