#include "Core/WholeFile.h"

#include <palpate/Error.h>

#include <fstream>
#include <system_error>

namespace palpate {

namespace fs = std::filesystem;

void writeWholeFile(const fs::path& path, std::string_view bytes, const std::string& what) {
  const auto fail = [&](const std::string& reason) {
    throw Error(ErrorCode::File, what + " \"" + path.string() + "\" cannot be written" + reason);
  };
  std::error_code fault;
  const bool isLink = fs::is_symlink(path, fault), exists = fs::exists(path, fault);
  if (exists && !fs::is_regular_file(path, fault))
    fail(": the path names no regular file, and is left as it is");
  if (isLink && !exists) fail(": the path is a symbolic link to a file that does not exist");
  const fs::path target = isLink ? fs::canonical(path, fault) : path;
  if (fault) fail("");
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
  fs::remove(partial, fault);
  fail("");
}

}  // namespace palpate
