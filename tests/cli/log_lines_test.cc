#include "cli/log_lines.h"

#include <gtest/gtest.h>
#include <spdlog/spdlog.h>

#include <cstdio>
#include <memory>

#include "core/quiet_stderr.h"

namespace tsdfpp {
namespace {

TEST(LogLines, AreOneEachAndHeardWhereALibraryIsNot) {
  testing::internal::CaptureStderr();
  const auto before = spdlog::default_logger();
  LogOneLineEach();
  {
    const QuietStderr quiet;
    std::fputs("LLVM ERROR: out of memory\n", stderr);
    spdlog::warn("of\nours");
  }
  spdlog::set_default_logger(before);
  const std::string said = testing::internal::GetCapturedStderr();
  EXPECT_TRUE(said.starts_with("warning: of") && said.ends_with("ours\n")) << said;
  EXPECT_EQ(said.find('\n'), said.size() - 1) << said;
}

}  // namespace
}  // namespace tsdfpp
