#pragma once

#include <filesystem>
#include <string>

namespace palpate::scenes {

/// Written beside its place, then moved there. Throws Error (ErrorCode::File).
void writeWhole(const std::filesystem::path& path, const std::string& content);

/// Throws Error (ErrorCode::File) where it cannot be made or written to.
void makeFolder(const std::filesystem::path& folder);

}  // namespace palpate::scenes
