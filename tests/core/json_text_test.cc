#include "core/json_text.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "core/files.h"
#include "core/one_line.h"
#include "tests/core/temp_folder.h"

namespace tsdfpp {
namespace {

using nlohmann::json;

std::string Nested(int depth, char open = '[', char close = ']') {
  return std::string(static_cast<std::size_t>(depth), open) +
         std::string(static_cast<std::size_t>(depth), close);
}

TEST(JsonText, WhatIsWrittenIsRead) {
  const json value{{"a", 1}, {"b", {1.5, "x\n\"", nullptr, true}}, {"c", json::object()}};
  EXPECT_EQ(ParseJson(JsonText(value), "x").value(), value);
  EXPECT_EQ(ParseJsonObject(JsonText(value, 2), "x").value(), value);
  EXPECT_EQ(JsonText(nlohmann::ordered_json{{"b", 1}, {"a", 2}}), "{\"b\":1,\"a\":2}");
}

TEST(JsonText, WhatIsNoJsonHasASentence) {
  for (const char* text : {"", "{", "{\"a\":}", "nul", "{\"a\":1e999}", "{\"a\":\"\xff\"}"}) {
    const auto any = ParseJson(text, "x.json");
    ASSERT_FALSE(any.has_value()) << text;
    EXPECT_EQ(any.error().message, "x.json: not JSON");
    EXPECT_EQ(any.error().kind, ErrorKind::kData);
  }
  EXPECT_EQ(ParseJsonObject("[1]", "x.json").error().message, "x.json: not a JSON object");
  EXPECT_EQ(ParseJsonObject("3", "x.json").error().message, "x.json: not a JSON object");
}

// A reader would else go by one of two answers.
TEST(JsonText, MembersAreThereOnce) {
  for (const char* text : {R"({"a":1,"a":2})", R"([{"b":{"a":1,"\u0061":1}}])"}) {
    const auto twice = ParseJson(text, "x.json");
    ASSERT_FALSE(twice.has_value()) << text;
    EXPECT_EQ(twice.error().message, "x.json: an object has 'a' twice");
    EXPECT_EQ(twice.error().kind, ErrorKind::kData);
  }
  EXPECT_TRUE(ParseJson(R"([{"a":{"a":[{"a":1}]},"b":"a"},{"a":1}])", "x.json").has_value());
  EXPECT_EQ(ParseJson(R"({"a":1,"a":2)", "x.json").error().message, "x.json: not JSON");
}

// With the square of their number these would take longer than CTest lets a test take.
TEST(JsonText, AListOfManyObjectsTakesItsLength) {
  constexpr int kElements = 1'000'000;
  const std::string element = "{\"a\":1}";
  std::string text = "[" + element;
  for (int i = 1; i < kElements; ++i) text += "," + element;
  text += "]";
  const auto value = ParseJson(text, "x.json");
  ASSERT_TRUE(value.has_value());
  EXPECT_EQ(value->size(), kElements);
}

// As deep as this, copying, printing and comparing overflow the stack.
TEST(JsonText, DepthIsLimitedBeforeAnythingIsMade) {
  for (const std::string& text :
       {Nested(200'000), "{\"schema_version\": " + Nested(200'000) + "}", std::string(200'000, '['),
        "{\"s\": \"" + std::string(100, ']') + "\", \"a\": " + Nested(200'000) + "}"}) {
    const auto value = ParseJson(text, "x.json");
    ASSERT_FALSE(value.has_value());
    EXPECT_NE(value.error().message.find("lists and objects within one another, over the limit of "
                                         "64 (TSDFPP_LIMITS=nesting=... raises it)"),
              std::string::npos)
        << value.error().message;
  }
  EXPECT_TRUE(ParseJson(Nested(64), "x").has_value());
  EXPECT_FALSE(ParseJson(Nested(65), "x").has_value());
  // Brackets in strings are text.
  EXPECT_TRUE(ParseJson("\"" + std::string(1000, '[') + "\"", "x").has_value());
  EXPECT_TRUE(ParseJson("\"\\\"" + std::string(1000, '[') + "\"", "x").has_value());
  Limits limits;
  limits.nesting = 1000;
  SetLimits(limits);
  const auto deep = ParseJson(Nested(1000), "x");
  SetLimits({});
  ASSERT_TRUE(deep.has_value());
  EXPECT_EQ(JsonText(json(*deep)).size(), 2000U);
}

TEST(JsonText, SizeIsLimited) {
  Limits limits;
  limits.json_bytes = 10;
  SetLimits(limits);
  const auto value = ParseJson("[1,2,3,4,5]", "x.json");
  SetLimits({});
  ASSERT_FALSE(value.has_value());
  EXPECT_EQ(value.error().message,
            "x.json: 11 bytes of JSON, over the limit of 10 (TSDFPP_LIMITS=json_bytes=... raises "
            "it)");
}

TEST(JsonText, BytesThatAreNoTextAreReplaced) {
  const json value{{"a\xff", "b\xe2\x82"}, {"c", "\x80"}};
  const std::string text = JsonText(value);
  EXPECT_TRUE(IsUtf8(text));
  EXPECT_TRUE(ParseJson(text, "x").has_value()) << text;
  EXPECT_EQ(JsonShown(json(std::string(1000, 'x'))).size(), 100U);
}

TEST(JsonText, NumbersThatDoNotFitAreNone) {
  const auto whole = [](const char* text) {
    return WholeIn(ParseJson(text, "x").value(), -5, 2'147'483'647);
  };
  EXPECT_EQ(whole("7"), 7);
  EXPECT_EQ(whole("-5"), -5);
  EXPECT_EQ(whole("2147483647"), 2'147'483'647);
  for (const char* text : {"-6", "2147483648", "4294967297", "18446744073709551615",
                           "-9223372036854775808", "1e300", "7.0", "\"7\"", "null", "[7]"}) {
    EXPECT_EQ(whole(text), std::nullopt) << text;
  }
}

TEST(JsonText, FilesAreNamed) {
  const test::TempFolder folder;
  ASSERT_TRUE(WriteFile(folder / "a.json", "{\"x\": 1}").has_value());
  EXPECT_EQ(ReadJsonObject(folder / "a.json").value()["x"], 1);
  EXPECT_EQ(ReadJsonObject(folder / "b.json").error().message,
            (folder / "b.json").string() + ": no such file");
}

}  // namespace
}  // namespace tsdfpp
