#include "core/toml_reader.h"

#include <gtest/gtest.h>

#include <functional>

#include "core/files.h"
#include "tests/core/temp_folder.h"

namespace tsdfpp {
namespace {

// The sentence that `read` earns on `text`; empty where there is no fault.
std::string Sentence(const std::string& text, const std::function<void(TomlReader&)>& read) {
  const auto table = ParseToml(text, "s.toml");
  if (!table) return table.error().message;
  TomlReader reader(*table, "s.toml");
  read(reader);
  const auto result = reader.Finish();
  if (result) return "";
  EXPECT_EQ(result.error().kind, ErrorKind::kUsage);
  return result.error().message;
}

template <typename T>
std::string SentenceOf(const std::string& text, bool required = false) {
  return Sentence(text, [&](TomlReader& reader) {
    T value{};
    reader.Get("a", value, required);
  });
}

TEST(TomlReader, ReadsEveryType) {
  bool b = false;
  int i = 0;
  std::int64_t wide = 0;
  double d = 0;
  double whole = 0;
  std::string s;
  Eigen::Vector3d v = Eigen::Vector3d::Zero();
  std::vector<double> numbers;
  std::vector<std::string> strings;
  std::string sub;
  std::vector<std::string> many;
  EXPECT_EQ(Sentence("b = true\ni = -3\nwide = 9007199254740993\nd = 1.5\nwhole = 2\ns = \"x\"\nv "
                     "= [1, 2.5, -3]\n"
                     "numbers = [4]\nstrings = [\"p\", \"q\"]\n[t]\nk = \"in\"\n"
                     "[[m]]\nk = \"m0\"\n[[m]]\nk = \"m1\"\n",
                     [&](TomlReader& reader) {
                       reader.Get("b", b).Get("i", i).Get("wide", wide).Get("d", d);
                       reader.Get("whole", whole).Get("s", s);
                       reader.Get("v", v).Get("numbers", numbers).Get("strings", strings);
                       TomlReader(*reader.Table("t"), "s.toml", "t").Get("k", sub);
                       for (const toml::table* table : reader.Tables("m")) {
                         TomlReader(*table, "s.toml", "m").Get("k", many.emplace_back());
                       }
                     }),
            "");
  EXPECT_TRUE(b);
  EXPECT_EQ(i, -3);
  EXPECT_EQ(wide, 9007199254740993) << "which no double holds";
  EXPECT_EQ(d, 1.5);
  EXPECT_EQ(whole, 2);
  EXPECT_EQ(s, "x");
  EXPECT_EQ(v, Eigen::Vector3d(1, 2.5, -3));
  EXPECT_EQ(numbers, std::vector<double>{4});
  EXPECT_EQ(strings, (std::vector<std::string>{"p", "q"}));
  EXPECT_EQ(sub, "in");
  EXPECT_EQ(many, (std::vector<std::string>{"m0", "m1"}));
}

TEST(TomlReader, AbsentKeyKeepsTheDefault) {
  int i = 7;
  EXPECT_EQ(Sentence("",
                     [&](TomlReader& reader) {
                       reader.Get("a", i);
                       EXPECT_EQ(reader.Table("t"), nullptr);
                       EXPECT_TRUE(reader.Tables("m").empty());
                     }),
            "");
  EXPECT_EQ(i, 7);
}

TEST(TomlReader, WrongTypesAreNamed) {
  EXPECT_EQ(SentenceOf<bool>("\na = 1"), "s.toml:2: 'a' is an integer, expected true or false");
  EXPECT_EQ(SentenceOf<int>("a = 1.0"),
            "s.toml:1: 'a' is a floating-point number, expected a whole number");
  EXPECT_EQ(SentenceOf<int>("a = 3000000000"),
            "s.toml:1: 'a' is 3000000000, too large for a whole number here");
  EXPECT_EQ(SentenceOf<double>("a = \"1\""), "s.toml:1: 'a' is a string, expected a finite number");
  EXPECT_EQ(SentenceOf<double>("a = nan"), "s.toml:1: 'a' is not a finite number");
  EXPECT_EQ(SentenceOf<std::string>("a = [1]"), "s.toml:1: 'a' is an array, expected a string");
  EXPECT_EQ(SentenceOf<std::vector<double>>("a = 1"),
            "s.toml:1: 'a' is an integer, expected an array of numbers");
  EXPECT_EQ(SentenceOf<std::vector<double>>("a = [1, \"x\"]"),
            "s.toml:1: 'a' holds a string, expected an array of finite numbers");
  EXPECT_EQ(SentenceOf<std::vector<std::string>>("a = true"),
            "s.toml:1: 'a' is a boolean, expected an array of strings");
  EXPECT_EQ(SentenceOf<std::vector<std::string>>("a = [\"x\", 1]"),
            "s.toml:1: 'a' holds an integer, expected an array of strings");
  EXPECT_EQ(SentenceOf<Eigen::Vector3d>("a = [1, 2]"), "s.toml:1: 'a' has 2 numbers, expected 3");
  EXPECT_EQ(SentenceOf<Eigen::Vector3d>("a = 1"),
            "s.toml:1: 'a' is an integer, expected an array of numbers");
  EXPECT_EQ(Sentence("a = 1", [](TomlReader& reader) { reader.Table("a"); }),
            "s.toml:1: 'a' is an integer, expected a table");
  EXPECT_EQ(Sentence("a = [1]", [](TomlReader& reader) { reader.Tables("a"); }),
            "s.toml:1: 'a' is an array, expected an array of tables");
}

TEST(TomlReader, RequiredKeysAreNamed) {
  EXPECT_EQ(SentenceOf<int>("", true), "s.toml:1: 'a' is missing");
  EXPECT_EQ(SentenceOf<Eigen::Vector3d>("", true), "s.toml:1: 'a' is missing");
  EXPECT_EQ(Sentence("", [](TomlReader& reader) { reader.Table("t", true); }),
            "s.toml:1: 't' is missing");
  EXPECT_EQ(Sentence("", [](TomlReader& reader) { reader.Tables("m", true); }),
            "s.toml:1: 'm' is missing");
}

TEST(TomlReader, UnknownKeysAreNamedWithTheirPath) {
  EXPECT_EQ(SentenceOf<int>("a = 1\nb = 2"), "s.toml:2: 'b' is not a known key here");
  const auto table = ParseToml("[x.y]\na = 1\nbb = 2", "s.toml").value();
  const TomlReader root(table, "s.toml");
  int a = 0;
  TomlReader inner(*table["x"]["y"].as_table(), "s.toml", "x.y");
  inner.Get("a", a);
  EXPECT_EQ(inner.Finish().error().message, "s.toml:3: 'x.y.bb' is not a known key here");
  TomlReader missing(*table["x"]["y"].as_table(), "s.toml", "x.y");
  missing.Get("c", a, true);
  EXPECT_EQ(missing.Finish().error().message, "s.toml:1: 'x.y.c' is missing");
}

TEST(TomlReader, TheFirstFaultIsKept) {
  EXPECT_EQ(Sentence("a = 1\nb = 2\nc = 3",
                     [](TomlReader& reader) {
                       int value = 0;
                       reader.Get("b", value);
                       reader.Fault("b", "must be odd");
                       bool other = false;
                       reader.Get("a", other);
                     }),
            "s.toml:2: 'b' must be odd");
}

TEST(TomlReader, FilesThatAreNotTomlAreNamedWithTheirPlace) {
  const test::TempFolder folder;
  const auto missing = ParseTomlFile(folder / "none.toml");
  ASSERT_FALSE(missing.has_value());
  EXPECT_EQ(missing.error().kind, ErrorKind::kUsage);
  EXPECT_EQ(missing.error().message, (folder / "none.toml").string() + ": no such file");
  ASSERT_TRUE(WriteFile(folder / "bad.toml", "a = 1\nb = = 2\n").has_value());
  const auto bad = ParseTomlFile(folder / "bad.toml");
  ASSERT_FALSE(bad.has_value());
  EXPECT_EQ(bad.error().kind, ErrorKind::kUsage);
  EXPECT_TRUE(
      bad.error().message.starts_with((folder / "bad.toml").string() + ":2:5: not valid TOML: "))
      << bad.error().message;
}

// toml++ destroys tables within tables with a place on the stack for each.
TEST(TomlDepth, IsLimitedBeforeAnythingIsMade) {
  const auto dotted = [](int depth) {
    std::string key = "a";
    for (int i = 1; i < depth; ++i) key += ".a";
    return key;
  };
  const auto said = [](const std::string& text) {
    const auto table = ParseToml(text, "x.toml");
    if (table) return std::string();
    EXPECT_EQ(table.error().kind, ErrorKind::kUsage);
    return table.error().message;
  };
  constexpr int kMany = 200'000;
  std::string within;
  for (int i = 0; i < 200; ++i) within += "{" + dotted(60) + " = ";
  for (const std::string& text :
       {"[" + dotted(kMany) + "]\n", dotted(kMany) + " = 1\n", "[[" + dotted(kMany) + "]]\n",
        "x = {" + dotted(kMany) + " = 1}\n", "x = " + std::string(kMany, '['), "x = " + within,
        "s = '''\n[\n'''\n[" + dotted(kMany) + "]\n",
        // Quotes before the end are the string's own, and what follows is on the same line.
        "x = [\"\"\"y\"\"\"\", {" + dotted(kMany) + " = 1}]\n",
        "x = ['''y''''', {" + dotted(kMany) + " = 1}]\n"}) {
    EXPECT_NE(said(text).find("tables and lists within one another, over the limit of 64"),
              std::string::npos)
        << said(text);
  }
  EXPECT_EQ(said("[" + dotted(60) + "]\n" + dotted(60) + " = [[1.5, 2.5], [3.5]]\n"), "");
  // Dots and brackets in strings and comments are text.
  const std::string dots(1000, '.');
  const std::string brackets(1000, '[');
  for (const std::string& text : {dots + brackets, "\\\"" + brackets}) {
    EXPECT_EQ(said("s = \"" + text + "\"\n"), "") << text.substr(0, 9);
  }
  EXPECT_EQ(said("# " + dots + brackets + "\ns = '" + dots + brackets + "'\n"), "");
  EXPECT_EQ(said("s = \"\"\"\n" + brackets + "\n\"\"\"\nt = '''\n" + brackets + "'''\n"), "");
}

// By default toml++ writes a string of several lines between three quotes, also one that has three.
TEST(TomlText, ReadsBackAsItWas) {
  const std::vector<std::string> parts{"\r",   "\t",   "'",        "'''", "\"", "\"\"\"", "\\",
                                       "\x01", "\x7f", "\xc3\xa9", "#",   "]",  "="};
  for (const char* end : {"", "\n"}) {
    toml::array strings;
    for (const std::string& a : parts) {
      for (const std::string& b : parts) {
        for (const std::string& c : parts) strings.push_back(fmt::format("{}{}{}{}", a, b, end, c));
      }
    }
    const toml::table written{{"strings", strings}, {"none", ""}, {"number", 1e-300}};
    const auto read = ParseToml(TomlText(written), "text");
    ASSERT_TRUE(read.has_value()) << read.error().message;
    EXPECT_TRUE(*read == written);
  }
}

}  // namespace
}  // namespace tsdfpp
