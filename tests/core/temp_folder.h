// A folder of its own for one test, or for all of a suite, removed at the end.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <string>

namespace tsdfpp::test {

class TempFolder {
 public:
  TempFolder() {
    const testing::UnitTest& tests = *testing::UnitTest::GetInstance();
    const auto* info = tests.current_test_info();  // nullptr in SetUpTestSuite()
    std::string name = "tsdfpp-" + std::string(tests.current_test_suite()->name()) + "-" +
                       (info == nullptr ? "all" : info->name()) + "-" + std::to_string(getpid());
    std::replace(name.begin(), name.end(), '/', '-');  // of a test with a parameter
    path_ = std::filesystem::path(testing::TempDir()) / name;
    std::filesystem::remove_all(path_);
    std::filesystem::create_directories(path_);
  }
  ~TempFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  TempFolder(const TempFolder&) = delete;
  TempFolder& operator=(const TempFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }
  std::filesystem::path operator/(const std::string& name) const { return path_ / name; }
  // How many entries lie directly in the folder, hidden ones included.
  long Entries() const {
    return std::distance(std::filesystem::directory_iterator(path_),
                         std::filesystem::directory_iterator());
  }

 private:
  std::filesystem::path path_;
};

}  // namespace tsdfpp::test
