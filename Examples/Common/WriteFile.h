#pragma once

#include <filesystem>
#include <string>

namespace palpate::scenes {

/// Writes to a temporary file, then moves it to its place. Throws Error (ErrorCode::File).
void writeWhole(const std::filesystem::path& path, const std::string& content);

/// Throws Error (ErrorCode::File) if it cannot be made or written to.
void makeFolder(const std::filesystem::path& folder);

}  // namespace palpate::scenes
