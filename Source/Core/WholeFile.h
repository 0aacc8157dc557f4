#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace palpate {

/// Returns the bytes of a file.
///
/// what     the start of the message, such as "the capture"
/// Errors   File, with the reason; also for a path that names no regular file, which is not opened.
std::string readWholeFile(const std::filesystem::path&, const std::string& what);

/// Writes a file completely or not at all: to a file beside it, which then takes its name. A
/// symbolic link stays, and the file that it names is written.
///
/// what     the start of the message, such as "the capture"
/// Errors   File, also for a path that names no regular file, as a device, a pipe or a folder; it
///          stays as it is.
void writeWholeFile(const std::filesystem::path&, std::string_view bytes, const std::string& what);

}  // namespace palpate
