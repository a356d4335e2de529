#pragma once

#include <gtest/gtest.h>
#include <stdlib.h>

#include <cerrno>
#include <filesystem>
#include <fstream>
#include <string>
#include <system_error>

namespace deform {

// Tests run side by side as processes of their own: what they write lies in a
// folder that no other process has, and goes with the process.
class TemporaryFolder {
 public:
  TemporaryFolder() : path_(testing::TempDir() + "deform_XXXXXX") {
    if (mkdtemp(path_.data()) == nullptr) {
      throw std::filesystem::filesystem_error(
          path_, std::error_code(errno, std::generic_category()));
    }
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  ~TemporaryFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }

  std::string Path(const std::string& name) const { return path_ + "/" + name; }
  std::string Write(const std::string& name, const std::string& bytes) const {
    std::ofstream(Path(name), std::ios::binary) << bytes;
    return Path(name);
  }

 private:
  std::string path_;
};

// The folder of this process.
inline const TemporaryFolder& Temporary() {
  static const TemporaryFolder folder;
  return folder;
}

}  // namespace deform
