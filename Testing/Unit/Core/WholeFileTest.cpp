#include "Core/WholeFile.h"

#include "Common/ExpectRefused.h"
#include "Common/TemporaryFolder.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <string>

namespace palpate {
namespace {

namespace fs = std::filesystem;

using testing::contentOf;

class WholeFile : public ::testing::Test {
 protected:
  fs::path in(const char* name) const { return m_folder.path / name; }
  std::size_t count() const { return m_folder.fileCount(); }
  void expectRefused(const fs::path& path) const {
    const std::size_t before = count();
    testing::expectRefused(ErrorCode::File, "the file \"" + path.string() + "\" cannot be",
                           [&] { writeWholeFile(path, "new", "the file"); });
    EXPECT_EQ(count(), before);
  }

 private:
  const testing::TemporaryFolder m_folder;
};

TEST_F(WholeFile, ReplacesAFileAndLeavesNoOther) {
  for (const std::string& content : {std::string("first"), std::string("a\0b\n", 4)}) {
    writeWholeFile(in("file"), content, "the file");
    EXPECT_EQ(contentOf(in("file")), content);
    EXPECT_EQ(count(), 1u);
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
        std::pair(fs::path("/proc/self/mem"), "an error")}) {
    const auto read = [&, &file = path] { readWholeFile(file, "the file"); };
    testing::expectRefused(ErrorCode::File,
                           "the file \"" + path.string() + "\" cannot be read: ", read);
    testing::expectRefused(ErrorCode::File, reason, read);
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
