#include "Core/WholeFile.h"

#include <palpate/Error.h>

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

namespace palpate {
namespace {

namespace fs = std::filesystem;

class WholeFile : public ::testing::Test {
 protected:
  WholeFile() { fs::create_directories(m_folder); }
  ~WholeFile() override { fs::remove_all(m_folder); }

  fs::path in(const char* name) const { return m_folder / name; }
  std::ptrdiff_t count() const { return std::distance(fs::directory_iterator(m_folder), {}); }
  static std::string contentOf(const fs::path& path) {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
  }
  void expectRefused(const fs::path& path) const {
    const std::ptrdiff_t before = count();
    try {
      writeWholeFile(path, "new", "the file");
      ADD_FAILURE() << path;
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::File);
      EXPECT_NE(std::string(error.what()).find("the file \"" + path.string() + "\" cannot be"),
                std::string::npos)
          << error.what();
    }
    EXPECT_EQ(count(), before);
  }

 private:
  const fs::path m_folder =
      fs::temp_directory_path() / ("palpate-whole-file-" + std::to_string(getpid()));
};

TEST_F(WholeFile, ReplacesAFileAndLeavesNoOther) {
  for (const std::string& content : {std::string("first"), std::string("a\0b\n", 4)}) {
    writeWholeFile(in("file"), content, "the file");
    EXPECT_EQ(contentOf(in("file")), content);
    EXPECT_EQ(count(), 1);
  }
}

TEST_F(WholeFile, IsReadOrRefusedWithTheReason) {
  writeWholeFile(in("file"), std::string_view("a\0b", 3), "the file");
  EXPECT_EQ(readWholeFile(in("file"), "the file"), std::string("a\0b", 3));
  ASSERT_EQ(mkfifo(in("pipe").c_str(), 0600), 0);
  fs::create_symlink(in("nothing"), in("link"));
  for (const auto& [path, reason] :
       {std::pair(in("none"), "there is no such file"),
        std::pair(in("link"), "there is no such file"), std::pair(in(""), "no regular file"),
        std::pair(in("pipe"), "no regular file"),
        std::pair(fs::path("/dev/null"), "no regular file"),
        std::pair(fs::path("/proc/self/mem"), "an error")})
    try {
      readWholeFile(path, "the file");
      ADD_FAILURE() << path;
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::File);
      EXPECT_NE(
          std::string(error.what()).find("the file \"" + path.string() + "\" cannot be read: "),
          std::string::npos);
      EXPECT_NE(std::string(error.what()).find(reason), std::string::npos) << error.what();
    }
}

TEST_F(WholeFile, LeavesWhatIsNoRegularFile) {
  ASSERT_EQ(mkfifo(in("pipe").c_str(), 0600), 0);
  expectRefused(in("pipe"));
  EXPECT_TRUE(fs::is_fifo(in("pipe")));
  expectRefused("/dev/null");
  EXPECT_TRUE(fs::is_character_file("/dev/null"));
  fs::create_symlink("/dev/null", in("device"));
  expectRefused(in("device"));
  EXPECT_TRUE(fs::is_symlink(in("device")));
  fs::create_directory(in("folder"));
  expectRefused(in("folder"));
  expectRefused(in("missing") / "file");
}

TEST_F(WholeFile, WritesTheFileThatALinkNames) {
  writeWholeFile(in("file"), "old", "the file");
  fs::create_symlink("file", in("link"));
  writeWholeFile(in("link"), "new", "the file");
  EXPECT_TRUE(fs::is_symlink(in("link")));
  EXPECT_EQ(contentOf(in("file")), "new");
  fs::create_symlink("nothing", in("dangling"));
  expectRefused(in("dangling"));
  EXPECT_TRUE(fs::is_symlink(in("dangling")));
}

}  // namespace
}  // namespace palpate
