// What tests read that others made, and what may be absent. Every test that skips does so through
// TSDFPP_NEEDS, with a line "needs ..." that scripts/run_tests.sh counts at the end.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <string>

namespace tsdfpp::test {

// In the repository, so always there (tests/data/README.md).
inline std::filesystem::path CopiedData(const std::string& name) {
  return std::filesystem::path(TSDFPP_SOURCE_DIR) / "tests/data" / name;
}

// Beside the repository, where it is too large for it: absent from a clone alone.
inline std::filesystem::path SharedData(const std::string& name) {
  return std::filesystem::path(TSDFPP_SHARED_DIR) / "data" / name;
}

}  // namespace tsdfpp::test

// Ends the test here, as skipped, unless `present`. What failed before still fails.
#define TSDFPP_NEEDS(present, what) \
  if (!(present)) GTEST_SKIP() << "needs " << (what)

// The same for a file or folder of SharedData().
#define TSDFPP_NEEDS_SHARED(name)                                       \
  TSDFPP_NEEDS(std::filesystem::exists(tsdfpp::test::SharedData(name)), \
               "../shared/data/" + std::string(name))
