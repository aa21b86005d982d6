#include "core/limits.h"

#include <gtest/gtest.h>

#include "core/files.h"
#include "tests/core/temp_folder.h"

namespace tsdfpp {
namespace {

TEST(Limits, TextSetsThoseThatItNames) {
  EXPECT_EQ(LimitsFromText("").value(), Limits());
  Limits expected;
  expected.json_bytes = 1000;
  expected.nesting = 3;
  EXPECT_EQ(LimitsFromText("json_bytes=1000,nesting=3").value(), expected);
}

TEST(Limits, TextThatIsNotUnderstoodIsRefused) {
  for (const auto& [text, words] :
       {std::pair("json", "'json' is no name=value"),
        {"json_bytes=1,,", "'' is no name=value"},
        {"bytes=3", "'bytes=3' is no name=value"},
        {"json_bytes=", "json_bytes is '', expected a whole number from 1 to"},
        {"json_bytes=1e9", "json_bytes is '1e9'"},
        {"json_bytes=-1", "json_bytes is '-1'"},
        {"json_bytes=0", "json_bytes is '0'"},
        {"nesting=1001", "nesting is '1001', expected a whole number from 1 to 1000"},
        {"frames=99999999999999999999", "frames is '99999999999999999999'"}}) {
    const auto limits = LimitsFromText(text);
    ASSERT_FALSE(limits.has_value()) << text;
    EXPECT_EQ(limits.error().kind, ErrorKind::kUsage);
    EXPECT_TRUE(limits.error().message.starts_with("TSDFPP_LIMITS: ")) << limits.error().message;
    EXPECT_NE(limits.error().message.find(words), std::string::npos) << limits.error().message;
    EXPECT_LT(limits.error().message.size(), 500U);
  }
}

TEST(Limits, WhatIsOverOneIsNamedWithIt) {
  EXPECT_TRUE(CheckLimit(&Limits::nesting, 64, "x.json", "levels").has_value());
  const auto over = CheckLimit(&Limits::nesting, 65, "x.json", "levels");
  ASSERT_FALSE(over.has_value());
  EXPECT_EQ(over.error().kind, ErrorKind::kData);
  EXPECT_EQ(over.error().message,
            "x.json: 65 levels, over the limit of 64 (TSDFPP_LIMITS=nesting=... raises it)");
}

// The page has each limit's name, default and meaning.
TEST(Limits, ThePageSaysWhatHolds) {
  const auto page = ReadFile(TSDFPP_SOURCE_DIR "/docs/limits.md");
  ASSERT_TRUE(page.has_value());
  for (const NamedLimit& limit : AllLimits()) {
    const std::string row =
        fmt::format("| `{}` | {} | {} |", limit.name, Limits().*(limit.limit), limit.what);
    EXPECT_NE(page->find(row), std::string::npos) << "docs/limits.md lacks the row\n" << row;
  }
}

}  // namespace
}  // namespace tsdfpp
