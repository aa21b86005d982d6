#include "core/plain_name.h"

#include <gtest/gtest.h>

#include "core/one_line.h"

namespace tsdfpp {
namespace {

TEST(PlainName, TakesNamesThatFilesCanHave) {
  for (const char* name : {"a", "truck", "obj_000001", "a b", "blue ball", "x.y", "größe", "日本",
                           "a-b", "com", "com10", "console", "nullify", "_", "0"}) {
    const auto status = CheckPlainName(name, "x");
    EXPECT_TRUE(status.has_value()) << status.error().message;
  }
  EXPECT_TRUE(CheckPlainName(std::string(100, 'n'), "x").has_value());
}

TEST(PlainName, RefusesWhatEscapesOrCannotBeAFile) {
  const std::pair<std::string, const char*> cases[] = {
      {"", "is empty"},
      {std::string(101, 'n'), "is longer than 100 bytes"},
      {"../../../pwned", "holds a slash"},
      {"/etc/passwd", "holds a slash"},
      {"a/b", "holds a slash"},
      {"a\\b", "holds a slash"},
      {".", "begins with a dot or a dash"},
      {"..", "begins with a dot or a dash"},
      {".hidden", "begins with a dot or a dash"},
      {"-rf", "begins with a dot or a dash"},
      {"a.", "ends with a dot or a blank"},
      {"a ", "ends with a dot or a blank"},
      {"a\nb", "holds a control character"},
      {std::string("a\0b", 3), "holds a control character"},
      {"\x01", "holds a control character"},
      {"a\x7f", "holds a control character"},
      {"a\xc2\x85"
       "b",
       "holds a control character"},
      {"\xff", "is not UTF-8"},
      {"a\xe2\x82", "is not UTF-8"},
      {"CON", "is the name of a device"},
      {"nul", "is the name of a device"},
      {"aux.ply", "is the name of a device"},
      {"Com1", "is the name of a device"},
      {"lpt9.tar.gz", "is the name of a device"}};
  for (const auto& [name, fault] : cases) {
    const auto status = CheckPlainName(name, "s.json: object 3");
    ASSERT_FALSE(status.has_value()) << Quoted(name);
    EXPECT_EQ(status.error().kind, ErrorKind::kData);
    EXPECT_EQ(
        status.error().message,
        fmt::format("s.json: object 3: the name {} {}, expected one that can be a file's name",
                    Quoted(name), fault));
    EXPECT_FALSE(HasControl(status.error().message));
    EXPECT_TRUE(IsUtf8(status.error().message));
    EXPECT_LT(status.error().message.size(), 400U);
  }
}

TEST(PlainName, LabelsAreTextOfOneLine) {
  for (const char* label : {"", "toy car", "a/b", ".."}) {
    EXPECT_TRUE(CheckLabel(label, "x").has_value()) << label;
  }
  for (const std::string& label :
       {std::string("a\nb"), std::string("\xff"), std::string(101, 'c')}) {
    EXPECT_FALSE(CheckLabel(label, "x").has_value()) << label;
  }
}

TEST(PlainName, ObjectsAreThereOnce) {
  const auto sentence = [](const std::vector<ObjectInfo>& objects) {
    const auto status = CheckObjects(objects, "here");
    return status ? std::string() : status.error().message;
  };
  EXPECT_EQ(sentence({}), "");
  EXPECT_EQ(sentence({{0, "background", ""}, {65534, "last", "toy"}}), "");
  EXPECT_EQ(sentence({{3, "a", ""}, {3, "b", ""}}), "here: object 3: its id is there twice");
  EXPECT_EQ(sentence({{3, "a", ""}, {4, "a", ""}}),
            "here: object 4: its name 'a' is another object's too");
  EXPECT_EQ(sentence({{65535, "a", ""}}),
            "here: object 65535: the id 65535 stands for no object, expected one below");
  EXPECT_EQ(
      sentence({{3, "../x", ""}}),
      "here: object 3: the name '../x' holds a slash, expected one that can be a file's name");
  EXPECT_EQ(sentence({{3, "a", "x\ny"}}),
            "here: object 3: the class 'x y' holds a control character");
}

}  // namespace
}  // namespace tsdfpp
