#include "Core/WholeFile.h"

#include <palpate/Error.h>

#include <fstream>
#include <system_error>

namespace palpate {

namespace fs = std::filesystem;

std::string readWholeFile(const fs::path& path, const std::string& what) {
  const auto fail = [&](const std::string& reason) {
    throw Error(ErrorCode::File, what + " \"" + path.string() + "\" cannot be read: " + reason);
  };
  std::error_code fault;
  const fs::file_status status = fs::status(path, fault);
  if (status.type() == fs::file_type::not_found) fail("there is no such file");
  if (fault) fail(fault.message());
  if (!fs::is_regular_file(status)) fail("the path names no regular file");
  std::ifstream file(path, std::ios::binary);
  if (!file.is_open()) fail("it cannot be opened");
  std::string content;
  char block[1 << 14];
  while (file.read(block, sizeof block) || file.gcount() > 0)
    content.append(block, static_cast<std::size_t>(file.gcount()));
  if (file.bad()) fail("an error while it was read");
  return content;
}

void writeWholeFile(const fs::path& path, std::string_view bytes, const std::string& what) {
  const auto fail = [&](const std::string& reason) {
    throw Error(ErrorCode::File, what + " \"" + path.string() + "\" cannot be written: " + reason);
  };
  std::error_code fault;
  const bool isLink = fs::is_symlink(path, fault);
  const fs::file_status status = fs::status(path, fault);
  const bool exists = fs::exists(status);
  if (exists && !fs::is_regular_file(status))
    fail("the path names no regular file, and is left as it is");
  if (status.type() != fs::file_type::not_found && fault) fail(fault.message());
  if (isLink && !exists) fail("the path is a symbolic link to a file that does not exist");
  fault.clear();
  const fs::path target = isLink ? fs::canonical(path, fault) : path;
  if (fault) fail(fault.message());
  if (const fs::path folder = target.parent_path();
      !folder.empty() && !fs::is_directory(folder, fault))
    fail("there is no folder \"" + folder.string() + "\"");
  if (target.filename().empty()) fail("the path names no file");
  fs::path partial = target;
  partial += ".part";
  try {
    std::ofstream file(partial, std::ios::binary);
    file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    file.close();
    if (file.good()) fs::rename(partial, target, fault);
    if (file.good() && !fault) return;
  } catch (...) {
    fs::remove(partial, fault);
    throw;
  }
  const std::string reason = fault ? fault.message() : "the file beside it could not be written";
  fs::remove(partial, fault);
  fail(reason);
}

}  // namespace palpate
