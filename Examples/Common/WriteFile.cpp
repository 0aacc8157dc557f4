#include "WriteFile.h"

#include <palpate/Error.h>

#include <fstream>
#include <unistd.h>

namespace palpate::scenes {

void writeWhole(const std::filesystem::path& path, const std::string& content) {
  std::error_code fault;
  if (std::filesystem::exists(path, fault) && !std::filesystem::is_regular_file(path, fault))
    throw Error(ErrorCode::File, "\"" + path.string() + "\" is no regular file.");
  std::filesystem::path partial = path;
  partial += ".part";
  std::ofstream file(partial, std::ios::binary);
  file << content;
  file.close();
  if (file.good()) std::filesystem::rename(partial, path, fault);
  if (file.good() && !fault) return;
  std::error_code ignored;
  std::filesystem::remove(partial, ignored);
  throw Error(ErrorCode::File, "The file \"" + path.string() + "\" cannot be written.");
}

void makeFolder(const std::filesystem::path& folder) {
  std::error_code fault;
  std::filesystem::create_directories(folder, fault);
  if (fault || access(folder.c_str(), W_OK | X_OK) != 0) {
    throw Error(ErrorCode::File,
                "The folder \"" + folder.string() + "\" cannot be made or written to.");
  }
}

}  // namespace palpate::scenes
