// Sets that are spoilt and what reading them says.
#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <nlohmann/json.hpp>
#include <regex>
#include <string>
#include <vector>

#include "core/files.h"
#include "sequence/export.h"
#include "sequence/open_sequence.h"
#include "tests/core/temp_folder.h"
#include "tests/sequence/box_source.h"
#include "tests/sequence/foreign_set.h"

namespace tsdfpp::test {

namespace fs = std::filesystem;

struct Case {
  std::function<void(const fs::path&)> spoil;
  std::string sentence;
};

// "@/<file><rest>".
inline std::string In(const std::string& file, const std::string& rest) {
  return fmt::format("@/{}{}", file, rest);
}

inline auto Text(const std::string& file, const std::string& text) {
  return [=](const fs::path& set) { ASSERT_TRUE(WriteFile(set / file, text).has_value()); };
}
inline auto Image(const std::string& file, const cv::Mat& image) {
  return [=](const fs::path& set) { WriteImage(set / file, image); };
}
inline auto Remove(const std::string& file) {
  return [=](const fs::path& set) { ASSERT_GT(fs::remove_all(set / file), 0U) << file; };
}
inline auto Copy(const std::string& from, const std::string& to) {
  return [=](const fs::path& set) { fs::copy(set / from, set / to, fs::copy_options::recursive); };
}
// The first half of the file is left.
inline auto Cut(const std::string& file) {
  return [=](const fs::path& set) { fs::resize_file(set / file, fs::file_size(set / file) / 2); };
}
inline auto Bytes(const std::string& file, std::size_t offset, const std::string& bytes) {
  return [=](const fs::path& set) {
    std::string all = ReadFile(set / file).value();
    ASSERT_LE(offset + bytes.size(), all.size());
    all.replace(offset, bytes.size(), bytes);
    ASSERT_TRUE(WriteFile(set / file, all).has_value());
  };
}
inline auto Json(const std::string& file, const std::function<void(nlohmann::json&)>& change) {
  return [=](const fs::path& set) {
    auto json = nlohmann::json::parse(ReadFile(set / file).value());
    change(json);
    ASSERT_TRUE(WriteFile(set / file, json.dump()).has_value());
  };
}

// '@' for the set's folder, "UP" for the one above it, '?' for numbers that depend on how well zlib
// packed.
inline std::string Strip(const std::string& said, const std::string& folder) {
  const auto all = [](const std::string& text, const std::string& from, const char* to) {
    return std::regex_replace(text, std::regex(from), to);
  };
  std::string message = all(said, folder, "@");
  message = all(message, fs::path(folder).parent_path().string(), "UP");
  message = all(message, "(frame 3 of 4, at byte) [0-9]+", "$1 ?");
  message = all(message, "(frame 2 of 3: it needs) [0-9]+", "$1 ?");
  return all(message, "[0-9]+ are left", "? are left");
}

// What opening and then reading all frames and the truth says. "" where all is well.
inline std::string FirstSentence(const fs::path& set) {
  const auto strip = [&](const Error& error) {
    EXPECT_EQ(error.kind, ErrorKind::kData) << error.message;
    return Strip(error.message, set.string());
  };
  const auto source = OpenSequence(set);
  if (!source) return strip(source.error());
  const SequenceInfo& info = (*source)->info();
  for (int i = 0; i < info.frame_count; ++i) {
    const auto frame = (*source)->Read(info.first_index + i);
    if (!frame) return strip(frame.error());
  }
  return "";
}

inline void CheckAll(const std::function<void(FrameSource&, const fs::path&)>& write,
                     const std::vector<Case>& cases) {
  BoxSource source(3);
  for (const Case& test_case : cases) {
    const TempFolder folder;
    const fs::path set = folder / "set";
    write(source, set);
    ASSERT_EQ(FirstSentence(set), "") << "sound before it is spoilt";
    test_case.spoil(set);
    EXPECT_EQ(FirstSentence(set), test_case.sentence);
  }
}

inline auto Exported(DatasetFormat format) {
  return [format](FrameSource& source, const fs::path& set) {
    ASSERT_TRUE(ExportSequence(source, format, set).has_value());
  };
}

inline const cv::Mat kSmallDepth(24, 32, CV_16UC1, cv::Scalar(1500));
inline const cv::Mat kByteDepth(48, 64, CV_8UC1, cv::Scalar(150));
inline const cv::Mat kColourDepth(48, 64, CV_8UC3, cv::Scalar::all(150));
inline const cv::Mat kSmallColour(24, 32, CV_8UC3, cv::Scalar::all(9));
inline const cv::Mat kSmallMask(24, 32, CV_16UC1, cv::Scalar(1));

}  // namespace tsdfpp::test
