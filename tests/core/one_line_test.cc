#include "core/one_line.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace tsdfpp {
namespace {

TEST(OneLine, KeepsWhatIsFine) {
  for (const char* text : {"", "plain", "größe 1 µm", "日本語", "a'b \"c\" \\d"}) {
    EXPECT_EQ(OneLine(text), text);
  }
}

TEST(OneLine, ShowsControlBytesAndBytesThatAreNoText) {
  EXPECT_EQ(OneLine("a\nb\tc\r"), "a b c\\x0d");
  EXPECT_EQ(OneLine(std::string_view("a\0b", 3)), "a\\x00b");
  EXPECT_EQ(OneLine("\x1b[31mred\x7f"), "\\x1b[31mred\\x7f");
  // C1 as UTF-8, a lone continuation, a cut and an overlong form, a surrogate, beyond U+10FFFF.
  EXPECT_EQ(OneLine("\xc2\x9b"), "\\xc2\\x9b");
  EXPECT_EQ(OneLine("a\x80z"), "a\\x80z");
  EXPECT_EQ(OneLine("\xe2\x82"), "\\xe2\\x82");
  EXPECT_EQ(OneLine("\xc0\xaf"), "\\xc0\\xaf");
  EXPECT_EQ(OneLine("\xed\xa0\x80"), "\\xed\\xa0\\x80");
  EXPECT_EQ(OneLine("\xf4\x90\x80\x80"), "\\xf4\\x90\\x80\\x80");
}

TEST(OneLine, LosesItsMiddleWhereItIsTooLong) {
  const std::string text = "begin" + std::string(100, 'x') + "end";
  const std::string line = OneLine(text, 30);
  EXPECT_EQ(line.size(), 30U);
  EXPECT_TRUE(line.starts_with("begin"));
  EXPECT_TRUE(line.ends_with("end"));
  EXPECT_NE(line.find(" ... "), std::string::npos);
  EXPECT_EQ(OneLine(std::string(30, 'x'), 30), std::string(30, 'x'));
}

TEST(OneLine, NeverCutsACharacter) {
  // Characters of two, three and four bytes, and bytes that grow, at every length.
  for (const std::string& piece : {std::string("é"), std::string("日"), std::string("😀"),
                                   std::string("\xff"), std::string("aé日")}) {
    std::string text;
    for (int i = 0; i < 3000; ++i) text += piece;
    for (std::size_t most = 0; most < 60; ++most) {
      const std::string line = OneLine(text, most);
      EXPECT_LE(line.size(), most);
      EXPECT_TRUE(IsUtf8(line)) << most << ": " << line;
      EXPECT_FALSE(HasControl(line));
    }
  }
}

TEST(OneLine, ALibrarysTagIsLeftOut) {
  try {
    static_cast<void>(nlohmann::json::object().at("x"));
    FAIL();
  } catch (const nlohmann::json::exception& error) {
    EXPECT_EQ(WithoutTag(error.what()), "key 'x' not found");
  }
  EXPECT_EQ(WithoutTag("[1] of mine"), "[1] of mine");
  EXPECT_EQ(WithoutTag("[json."), "[json.");
}

TEST(OneLine, InMarkdownItIsTextAlone) {
  EXPECT_EQ(InMarkdown("Toys, at up to 1 m/s."), "Toys, at up to 1 m/s.");
  EXPECT_EQ(InMarkdown("a | b\n<script>"), "a \\| b \\<script\\>");
}

TEST(OneLine, MessagesStayUnderFiveHundredBytes) {
  EXPECT_LT(std::string("tsdfpp: ").size() + OneLine(std::string(1 << 20, '\x01')).size(), 500U);
}

}  // namespace
}  // namespace tsdfpp
