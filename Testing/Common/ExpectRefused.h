#pragma once

#include <palpate/Error.h>

#include <gtest/gtest.h>

#include <string>

namespace palpate::testing {

/// Expects that the call throws this error and that its message contains the words.
template <class Call>
void expectRefused(ErrorCode code, const std::string& words, Call&& call) {
  try {
    call();
    ADD_FAILURE() << "accepted; expected: " << words;
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), code);
    EXPECT_NE(std::string(error.what()).find(words), std::string::npos) << error.what();
  }
}

}  // namespace palpate::testing
