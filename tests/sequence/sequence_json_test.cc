#include "sequence/sequence_json.h"

#include <gtest/gtest.h>

#include "core/files.h"
#include "tests/core/temp_folder.h"
#include "tests/sequence/memory_source.h"

namespace tsdfpp {
namespace {

using test::MemorySource;
using test::SomeGenerator;
using test::TempFolder;

SequenceRecord SomeRecord() {
  SequenceRecord record;
  record.info = MemorySource().info();
  record.generator = SomeGenerator();
  record.hashes = {{"colour/Color0001.png", "00000000000000ff"}};
  return record;
}

// The values published with the algorithm (isthe.com/chongo/tech/comp/fnv, test vectors).
TEST(SequenceJson, HashesAreFnv1a64) {
  EXPECT_EQ(HashText(""), "cbf29ce484222325");
  EXPECT_EQ(HashText("a"), "af63dc4c8601ec8c");
  EXPECT_EQ(HashText("foobar"), "85944171f73967e8");
}

TEST(SequenceJson, RoundTripKeepsEverything) {
  const TempFolder folder;
  for (const bool sparse : {false, true}) {
    SequenceRecord record = SomeRecord();
    if (sparse) {
      record.info.reveal.reset();
      record.generator.seed.reset();
      record.hashes.clear();
    }
    ASSERT_TRUE(WriteFile(folder / "s.json", SequenceToJson(record)).has_value());
    const auto read = ReadSequenceJson(folder / "s.json");
    ASSERT_TRUE(read.has_value()) << read.error().message;
    test::ExpectSame(read->info, record.info);
    EXPECT_EQ(read->generator, record.generator);
    EXPECT_EQ(read->hashes, record.hashes);
  }
}

// What masks' ids stand for is said only where it is not the objects.
TEST(SequenceJson, SaysThatMaskIdsAreOfOneFrame) {
  const TempFolder folder;
  SequenceRecord record = SomeRecord();
  EXPECT_EQ(SequenceToJson(record).find("mask_ids"), std::string::npos);
  for (const bool of_objects : {true, false}) {
    record.info.mask_ids_are_objects = of_objects;
    ASSERT_TRUE(WriteFile(folder / "s.json", SequenceToJson(record)).has_value());
    const auto read = ReadSequenceJson(folder / "s.json");
    ASSERT_TRUE(read.has_value()) << read.error().message;
    EXPECT_EQ(read->info.mask_ids_are_objects, of_objects);
  }
}

// Replaces the first `from` in our own file by `to` and returns what the reader says.
std::string SentenceAfter(const std::string& from, const std::string& to) {
  const TempFolder folder;
  std::string text = SequenceToJson(SomeRecord());
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  text.replace(at, from.size(), to);
  EXPECT_TRUE(WriteFile(folder / "s.json", text).has_value());
  const auto read = ReadSequenceJson(folder / "s.json");
  if (read) return "";
  EXPECT_EQ(read.error().kind, ErrorKind::kData);
  const std::string file = (folder / "s.json").string() + ": ";
  EXPECT_TRUE(read.error().message.starts_with(file)) << read.error().message;
  return read.error().message.substr(file.size());
}

TEST(SequenceJson, BadFilesAreNamed) {
  EXPECT_EQ(SentenceAfter("{", "["), "not a JSON object");
  EXPECT_EQ(SentenceAfter("\"generator\": \"tsdfpp\"", "\"generator\": \"other\""),
            "'generator' is not \"tsdfpp\"");
  EXPECT_EQ(SentenceAfter("\"schema_version\": 2", "\"schema_version\": 3"),
            "'schema_version' is 3, this program reads 1 to 2");
  EXPECT_EQ(SentenceAfter("\"frame_count\": 4", "\"frame_count\": 0"),
            "expected a rate_hz of 1e-06 to 1e+09, frame_count over 0 and first_index 0 or more");
  for (const auto& [from, to, word] : {std::tuple("\"rate_hz\"", "\"rate\"", "rate_hz"),
                                       {"\"id\": 1", "\"id\": 70001", "70001"},
                                       {"\"name\": \"car\"", "\"name\": 3", "string"},
                                       {"\"fnv1a64\"", "\"md5\"", "fnv1a64"}}) {
    const std::string sentence = SentenceAfter(from, to);
    EXPECT_TRUE(sentence.starts_with("a field is missing or of another type (")) << sentence;
    EXPECT_NE(sentence.find(word), std::string::npos) << sentence;
  }
}

// Copying or printing it as deep as this overflows the stack.
TEST(SequenceJson, DepthAndNumbersAreLimited) {
  const std::string deep = std::string(200'000, '[') + std::string(200'000, ']');
  for (const char* field : {"\"schema_version\": 2", "\"seed\": 7", "\"rate_hz\": 12.5"}) {
    const std::string name(field, std::string(field).find(':'));
    std::string text = SequenceToJson(SomeRecord());
    const std::size_t at = text.find(name);
    ASSERT_NE(at, std::string::npos) << name;
    text.replace(at + name.size() + 2, text.find('\n', at) - at - name.size() - 3, deep);
    const TempFolder folder;
    ASSERT_TRUE(WriteFile(folder / "s.json", text).has_value());
    const auto read = ReadSequenceJson(folder / "s.json");
    ASSERT_FALSE(read.has_value());
    EXPECT_NE(read.error().message.find("lists and objects within one another, over the limit"),
              std::string::npos)
        << read.error().message;
  }
  for (const auto& [count, words] :
       {std::pair("2147483647", "frame_count is 2147483647, expected a whole number from 0 to"),
        {"4294967297", "frame_count is 4294967297"},
        {"1e300", "frame_count is 1e+300"},
        {"-1", "frame_count is -1"},
        {"\"4\"", "frame_count is \"4\""}}) {
    const std::string sentence =
        SentenceAfter("\"frame_count\": 4", fmt::format("\"frame_count\": {}", count));
    EXPECT_NE(sentence.find(words), std::string::npos) << sentence;
    EXPECT_LT(sentence.size(), 300U);
  }
  EXPECT_NE(SentenceAfter("\"width\": 13", "\"width\": 1").find("width is 1, expected a whole"),
            std::string::npos);
  EXPECT_NE(SentenceAfter("\"width\": 13", "\"width\": 30000").find("width is 30000"),
            std::string::npos);
  EXPECT_NE(SentenceAfter("\"fx\": 564.3", "\"fx\": 0.0").find("expected finite intrinsics"),
            std::string::npos);
}

// The list is read file by file when the sequence is verified.
TEST(SequenceJson, ListedFilesAreInside) {
  for (const auto& [file, fault] : {std::pair("/dev/zero", "is absolute"),
                                    {"../../etc/passwd", "holds '..'"},
                                    {"models/../../x", "holds '..'"},
                                    {"", "is empty"}}) {
    const std::string sentence =
        SentenceAfter("\"colour/Color0001.png\"", fmt::format("\"{}\"", file));
    EXPECT_EQ(sentence, fmt::format("'fnv1a64': the path '{}' {}, expected one inside the data's "
                                    "folder",
                                    file, fault));
  }
}

// Names become file names of what map and compare write.
TEST(SequenceJson, NamesThatEscapeAreRefused) {
  for (const auto& [name, fault] : {std::pair("../../../pwned", "holds a slash"),
                                    {"/pwned", "holds a slash"},
                                    {"..", "begins with a dot or a dash"},
                                    {"", "is empty"},
                                    {"a\\nb", "holds a control character"},
                                    {"a\\u0001", "holds a control character"},
                                    {"NUL", "is the name of a device"}}) {
    const std::string sentence =
        SentenceAfter("\"name\": \"car\"", fmt::format("\"name\": \"{}\"", name));
    EXPECT_TRUE(sentence.starts_with("object 2: the name '")) << sentence;
    EXPECT_NE(sentence.find(fault), std::string::npos) << sentence;
    EXPECT_EQ(sentence.find('\n'), std::string::npos) << sentence;
  }
  const std::string long_name(300, 'n');
  EXPECT_NE(SentenceAfter("\"name\": \"car\"", "\"name\": \"" + long_name + "\"")
                .find("is longer than 100 bytes"),
            std::string::npos);
  EXPECT_EQ(SentenceAfter("\"id\": 1", "\"id\": 0"), "object 0: its id is there twice");
  EXPECT_EQ(SentenceAfter("\"name\": \"car\"", "\"name\": \"background\""),
            "object 2: its name 'background' is another object's too");
}

}  // namespace
}  // namespace tsdfpp
