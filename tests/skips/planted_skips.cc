// Tests that are skipped on purpose, for run_tests_test.sh.
#include <gtest/gtest.h>

#include <iostream>

#include "tests/needs.h"

namespace tsdfpp {
namespace {

TEST(Planted, Passes) {}

TEST(Planted, NeedsAFolder) {
  TSDFPP_NEEDS_SHARED("meshes");
  FAIL() << "went on without it";
}

TEST(Planted, NeedsItToo) { TSDFPP_NEEDS_SHARED("meshes"); }

TEST(Planted, NeedsATool) {
  // More than ctest keeps of the output of a test that passes.
  std::cout << std::string(5000, 'x') << std::endl;
  TSDFPP_NEEDS(true, "nothing");
  TSDFPP_NEEDS(false, "a tool");
}

TEST(Planted, DoesNotSay) { GTEST_SKIP(); }

// What failed before it has a need still fails.
TEST(Failing, ThenNeeds) {
  EXPECT_TRUE(false);
  TSDFPP_NEEDS(false, "a tool");
}

}  // namespace
}  // namespace tsdfpp
