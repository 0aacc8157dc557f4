#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace palpate::files {

/// Decompresses a block of exactly `size` bytes; nothing if the packed bytes are damaged. Memory is
/// taken as the result grows.
std::optional<std::string> inflateZlib(std::string_view packed, std::size_t size);
std::optional<std::string> inflateLz4(std::string_view packed, std::size_t size);

}  // namespace palpate::files
