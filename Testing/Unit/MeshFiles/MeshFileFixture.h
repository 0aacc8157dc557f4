#pragma once

#include <palpate/Error.h>
#include <palpate/MeshFiles.h>

#include "Common/FailingAllocation.h"
#include "Common/Sanitized.h"
#include "Common/TemporaryFolder.h"

#include <gtest/gtest.h>

#include <bit>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>
#include <utility>
#include <vector>

namespace palpate::testing {

/// A value's bytes in a file.
template <class T>
std::string bytes(T value, bool bigEndian = false) {
  std::string text(sizeof value, '\0');
  std::memcpy(text.data(), &value, sizeof value);
  const bool isReversed = bigEndian != (std::endian::native == std::endian::big);
  return isReversed ? std::string(text.rbegin(), text.rend()) : text;
}

/// Numbers one after another, as int32, uint64, float and double.
class Binary {
 public:
  explicit Binary(bool bigEndian = false) : m_bigEndian(bigEndian) {}
  Binary& ints(std::initializer_list<std::int32_t> values) { return add(values); }
  Binary& sizes(std::initializer_list<std::uint64_t> values) { return add(values); }
  Binary& point(const Eigen::Vector3d& p) { return add(p); }
  Binary& coarse(const Eigen::Vector3d& p) { return add(Eigen::Vector3f(p.cast<float>())); }
  Binary& text(const std::string& words) {
    content += words;
    return *this;
  }
  std::string content;

 private:
  template <class Values>
  Binary& add(const Values& values) {
    for (const auto value : values) content += bytes(value, m_bigEndian);
    return *this;
  }
  bool m_bigEndian;
};

inline std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.rfind(from);
  EXPECT_NE(at, std::string::npos) << from;
  return at == std::string::npos ? text : text.replace(at, from.size(), to);
}

inline std::string repeated(const std::string& text, std::size_t bytes) {
  std::string all;
  while (all.size() < bytes) all += text;
  return all;
}

/// What reading a file took.
struct ReadOutcome {
  MeshArrays mesh;
  std::string refusal;   ///< empty if it was read
  std::size_t peak = 0;  ///< bytes at once
};

inline ReadOutcome outcomeOf(const std::string& name, const std::string& content) {
  const TemporaryFolder folder;  // tests of this file run at the same time, in processes
  const std::filesystem::path path = folder.path / name;
  std::ofstream(path, std::ios::binary) << content;
  ReadOutcome outcome;
  FailingAllocation::arm(0);
  try {
    outcome.mesh = readMeshFile(path);
  } catch (const Error& error) {
    FailingAllocation::disarm();
    outcome.refusal = error.what();
  }
  FailingAllocation::disarm();
  outcome.peak = FailingAllocation::peakBytes();
  return outcome;
}

/// A folder for the files of one test.
class MeshFileFixture : public ::testing::Test {
 protected:
  std::filesystem::path write(const std::string& name, const std::string& content) const {
    std::filesystem::remove(folder / name);  // a file truncated and written again goes to the disk
    std::ofstream(folder / name, std::ios::binary) << content;
    return folder / name;
  }

  MeshArrays read(const std::string& name, const std::string& content,
                  const MeshReadSettings& settings = {}) const {
    return readMeshFile(write(name, content), settings);
  }

  /// The message of the error, which must name the file. Empty if the file is read.
  std::string refusal(const std::filesystem::path& path) const {
    try {
      readMeshFile(path);
      return "";
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::File);
      EXPECT_NE(std::string(error.what()).find(path.string()), std::string::npos) << error.what();
      return error.what();
    }
  }
  std::string refusal(const std::string& name, const std::string& content) const {
    return refusal(write(name, content));
  }

  void expectRefused(const std::string& name, const std::string& content,
                     const std::string& reason) const {
    EXPECT_NE(refusal(name, content).find(reason), std::string::npos)
        << name << ": expected \"" << reason << "\" in \"" << refusal(name, content) << "\"";
  }

  using Files = std::vector<std::pair<std::string, std::string>>;  ///< names and contents

  /// The beginning of a file of each length is refused, or isComplete(name, mesh) holds.
  template <class F>
  void expectTruncatedRefused(const Files& files, F&& isComplete,
                              const MeshReadSettings& settings = {}) const {
    for (const auto& [name, content] : files)
      for (std::size_t length = 0; length < content.size(); ++length) try {
          const MeshArrays mesh = read(name, content.substr(0, length), settings);
          EXPECT_TRUE(isComplete(name, mesh)) << name << " " << length;
        } catch (const Error& error) {
          EXPECT_EQ(error.code(), ErrorCode::File);
        }
  }
  /// With any byte changed, a file is refused, or its elements have vertices.
  void expectDamagedRefused(const Files& files) const {
    for (const auto& [name, content] : files)
      for (std::size_t at = 0; at < content.size(); at += kShareOfCases)
        for (const char damage : {'\0', '9', '-', '\xff'}) {
          std::string damaged = content;
          damaged[at] = damage;
          try {
            const MeshArrays mesh = read(name, damaged);
            const auto expectVertices = [&](const auto& elements) {
              for (const auto& element : elements)
                for (const std::uint32_t v : element) EXPECT_LT(v, mesh.positions.size());
            };
            expectVertices(mesh.triangles), expectVertices(mesh.tetrahedra);
          } catch (const Error& error) {
            EXPECT_EQ(error.code(), ErrorCode::File);
          }
        }
  }

  const TemporaryFolder temporary;
  const std::filesystem::path& folder = temporary.path;
};

}  // namespace palpate::testing
