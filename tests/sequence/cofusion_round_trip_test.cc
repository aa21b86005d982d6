#include <gtest/gtest.h>

#include <filesystem>
#include <opencv2/imgcodecs.hpp>

#include "core/files.h"
#include "sequence/cofusion_writer.h"
#include "sequence/open_sequence.h"
#include "tests/core/temp_folder.h"
#include "tests/sequence/memory_source.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;
using test::ExpectSame;
using test::MemorySource;
using test::SomeGenerator;
using test::TempFolder;

void ExpectRoundTrip(MemorySource& source, const fs::path& out) {
  const auto written = WriteCofusion(source, SomeGenerator(), out);
  ASSERT_TRUE(written.has_value()) << written.error().message;
  auto read = OpenSequence(out);
  ASSERT_TRUE(read.has_value()) << read.error().message;
  ExpectSame((*read)->info(), source.info());
  for (int i = 0; i < source.info().frame_count; ++i) {
    const int index = source.info().first_index + i;
    const auto frame = (*read)->Read(index);
    ASSERT_TRUE(frame.has_value()) << frame.error().message;
    ExpectSame(*frame, source.Read(index).value());
  }
}

TEST(CofusionRoundTrip, FramesAreTheSameBytes) {
  const TempFolder folder;
  MemorySource source;
  ExpectRoundTrip(source, folder / "set");
}

TEST(CofusionRoundTrip, FirstNumberZeroAndNoPlan) {
  const TempFolder folder;
  MemorySource source(3, 0);
  source.info_.reveal.reset();
  ExpectRoundTrip(source, folder / "set");
}

TEST(CofusionRoundTrip, WithoutMasks) {
  const TempFolder folder;
  MemorySource source;
  source.on_read = [](Frame& frame) {
    frame.mask.release();
    return Expected<void>();
  };
  ExpectRoundTrip(source, folder / "set/");  // a trailing slash changes nothing
  EXPECT_FALSE(fs::exists(folder / "set/mask_id"));
}

TEST(CofusionRoundTrip, TruthIsTheSame) {
  const TempFolder folder;
  MemorySource source;
  ASSERT_TRUE(WriteCofusion(source, SomeGenerator(), folder / "set").has_value());
  const auto truth = OpenSequence(folder / "set").value()->Truth();
  ASSERT_TRUE(truth.has_value()) << truth.error().message;
  ASSERT_EQ(truth->size(), source.models_.size());
  for (std::size_t i = 0; i < truth->size(); ++i) ExpectSame((*truth)[i], source.models_[i]);
}

// Of recordings of others nothing lists the models.
TEST(CofusionRoundTrip, UnreadableTruthIsNotAbsent) {
  const TempFolder folder;
  const fs::path set = folder / "set";
  MemorySource source;
  source.info_.intrinsics = {13, 7, 11.3, 11.4, 6.1, 3.1};
  ASSERT_TRUE(WriteCofusion(source, SomeGenerator(), set).has_value());
  const auto has_truth = [&] {
    const auto read = OpenSequence(set);
    EXPECT_TRUE(read.has_value()) << read.error().message;
    const bool is_readable = (*read)->Truth().has_value();
    return std::pair((*read)->HasTruth(), is_readable);
  };
  EXPECT_EQ(has_truth(), std::pair(true, true));
  fs::remove(set / "sequence.json");
  EXPECT_EQ(has_truth(), std::pair(true, true));
  const fs::path model = set / "models/car-2.ply";
  fs::resize_file(model, fs::file_size(model) / 2);
  EXPECT_EQ(has_truth(), std::pair(true, false));
  for (const auto& entry : fs::directory_iterator(set / "models")) fs::remove(entry);
  EXPECT_EQ(has_truth(), std::pair(false, false)) << "an empty folder";
  fs::remove(set / "models");
  EXPECT_EQ(has_truth(), std::pair(false, false));
}

// A set that was read and is written again is the same set, file for file.
TEST(CofusionRoundTrip, SecondGenerationIsTheSameFiles) {
  const TempFolder folder;
  MemorySource source;
  ASSERT_TRUE(WriteCofusion(source, SomeGenerator(), folder / "a").has_value());
  auto read = OpenSequence(folder / "a").value();
  ASSERT_TRUE(WriteCofusion(*read, SomeGenerator(), folder / "b").has_value());
  int files = 0;
  for (const auto& entry : fs::recursive_directory_iterator(folder / "a")) {
    if (!entry.is_regular_file()) continue;
    const fs::path name = fs::relative(entry.path(), folder / "a");
    EXPECT_EQ(ReadFile(entry.path()).value(), ReadFile(folder / "b" / name).value()) << name;
    ++files;
  }
  // Three images a frame, calibration, three trajectories, four models, sequence.json.
  EXPECT_EQ(files, 4 * 3 + 1 + 3 + 4 + 1);
}

TEST(CofusionRoundTrip, LayoutIsCofusions) {
  const TempFolder folder;
  MemorySource source;
  ASSERT_TRUE(WriteCofusion(source, SomeGenerator(), folder / "set").has_value());
  const fs::path set = folder / "set";
  for (const char* file :
       {"colour/Color0004.png", "depth_original/Depth0004.exr", "mask_id/Mask0001.png",
        "trajectories/gt-cam-0.txt", "trajectories/gt-toy-truck-1.txt", "trajectories/gt-car-2.txt",
        "models/background-0.ply", "models/mug-7.ply", "sequence.json"}) {
    EXPECT_TRUE(fs::exists(set / file)) << file;
  }
  EXPECT_EQ(ReadFile(set / "calibration.txt").value(),
            "564.3 0.3333333333333333 6.123456789012345 3.1 13 7\n");
  // What any other reader sees: 8-bit PNGs, and a 32-bit float in the EXR header ("Y", pixel type
  // 2).
  const cv::Mat mask = cv::imread((set / "mask_id/Mask0001.png").string(), cv::IMREAD_UNCHANGED);
  EXPECT_EQ(mask.type(), CV_8UC1);
  const cv::Mat colour = cv::imread((set / "colour/Color0001.png").string(), cv::IMREAD_UNCHANGED);
  ASSERT_EQ(colour.type(), CV_8UC3);
  const auto rgb = source.Read(1).value().colour.at<cv::Vec3b>(3, 5);
  EXPECT_EQ(colour.at<cv::Vec3b>(3, 5), cv::Vec3b(rgb[2], rgb[1], rgb[0]));
  const std::string exr = ReadFile(set / "depth_original/Depth0001.exr").value();
  const std::string channels("channels\0chlist\0", 16);
  const std::size_t at = exr.find(channels);
  ASSERT_NE(at, std::string::npos);
  EXPECT_EQ(exr.substr(at + channels.size() + 4, 6), std::string("Y\0\2\0\0\0", 6));
  // The car has no pose at the first frame.
  const std::string car = ReadFile(set / "trajectories/gt-car-2.txt").value();
  EXPECT_TRUE(car.starts_with("# frame tx ty tz qx qy qz qw (T_world_object)\n2 ")) << car;
}

TEST(CofusionWriter, ReportsProgress) {
  const TempFolder folder;
  MemorySource source;
  std::vector<std::pair<int, int>> calls;
  ASSERT_TRUE(
      WriteCofusion(source, SomeGenerator(), folder / "set", false, [&](int done, int total) {
        calls.emplace_back(done, total);
      }).has_value());
  EXPECT_EQ(calls, (std::vector<std::pair<int, int>>{{1, 4}, {2, 4}, {3, 4}, {4, 4}}));
}

// The sentence of a write that fails; also checks that it left nothing behind.
Error FailedWrite(MemorySource& source, const TempFolder& folder) {
  const auto result = WriteCofusion(source, SomeGenerator(), folder / "set");
  EXPECT_FALSE(result.has_value());
  EXPECT_EQ(folder.Entries(), 0) << "something was left behind";
  return result.has_value() ? Error{} : result.error();
}

TEST(CofusionWriter, InterruptedWriteLeavesNothing) {
  const TempFolder folder;
  MemorySource source;
  source.on_read = [&](Frame& frame) -> Expected<void> {
    if (frame.index == 3) return EnvironmentError("the GPU is on fire");
    EXPECT_FALSE(fs::exists(folder / "set"));
    return {};
  };
  const Error error = FailedWrite(source, folder);
  EXPECT_EQ(error.kind, ErrorKind::kEnvironment);
  EXPECT_EQ(error.message, "the GPU is on fire");
}

TEST(CofusionWriter, FramesThatDoNotFitAreNamed) {
  using Change = std::function<void(Frame&)>;
  const struct {
    Change change;
    const char* sentence;
  } cases[] = {
      {[](Frame& f) { f.mask.at<InstanceId>(0, 0) = 256; },
       "frame 2: the mask holds id 256, a Co-Fusion mask holds 0 to 255"},
      {[](Frame& f) { f.mask.release(); }, "frame 2: expected a mask on every frame or on none"},
      {[](Frame& f) { f.depth = f.depth.rowRange(0, 3); },
       "frame 2: the depth image is 13x3, expected 13x7"},
      {[](Frame& f) { f.colour = f.mask; },
       "frame 2: the colour image is 16-bit unsigned with 1 channel, expected 8-bit RGB"},
      {[](Frame& f) { f.depth = f.mask; },
       "frame 2: the depth image is 16-bit unsigned with 1 channel, expected 32-bit float with 1 "
       "channel"},
      {[](Frame& f) { f.mask = f.depth; },
       "frame 2: the mask is 32-bit float with 1 channel, expected 16-bit unsigned with 1 channel"},
      {[](Frame& f) { f.T_WO[9] = Pose::Identity(); },
       "frame 2: a pose of object 9, which the sequence does not list"},
      {[](Frame& f) { f.intrinsics.fx += 1; },
       "frame 2: the intrinsics differ from the sequence's, a Co-Fusion set has one camera"},
  };
  for (const auto& [change, sentence] : cases) {
    const TempFolder folder;
    MemorySource source;
    source.on_read = [&change = change](Frame& frame) {
      if (frame.index == 2) change(frame);
      return Expected<void>();
    };
    const Error error = FailedWrite(source, folder);
    EXPECT_EQ(error.kind, ErrorKind::kData);
    EXPECT_EQ(error.message, sentence);
  }
}

TEST(CofusionWriter, ObjectsThatDoNotFitAreNamed) {
  const struct {
    ObjectInfo object;
    const char* sentence;
  } cases[] = {
      {{256, "x", ""}, "object 'x': id 256, a Co-Fusion mask holds 0 to 255"},
      {{3, "a/b", ""},
       "object 3: the name 'a/b' holds a slash, expected one that can be a file's name"},
      {{3, "", ""}, "object 3: the name '' is empty, expected one that can be a file's name"},
      {{2, "again", ""}, "object id 2 is there twice"},
  };
  for (const auto& [object, sentence] : cases) {
    const TempFolder folder;
    MemorySource source;
    source.info_.objects.push_back(object);
    const Error error = FailedWrite(source, folder);
    EXPECT_EQ(error.kind, ErrorKind::kUsage);
    EXPECT_EQ(error.message, sentence);
  }
  const TempFolder folder;
  MemorySource source;
  source.info_.objects[0].name = "cam";
  EXPECT_EQ(FailedWrite(source, folder).message,
            "object 0: the name 'cam' is the camera's in a Co-Fusion set");
}

TEST(CofusionWriter, ReplacesOnlyItsOwnAndOnlyWhenAsked) {
  const TempFolder folder;
  MemorySource source;
  const auto write = [&](const fs::path& out, bool overwrite) {
    return WriteCofusion(source, SomeGenerator(), out, overwrite);
  };
  fs::create_directories(folder / "set");
  ASSERT_TRUE(write(folder / "set", false).has_value()) << "an empty folder may be used";

  const auto refused = write(folder / "set", false);
  ASSERT_FALSE(refused.has_value());
  EXPECT_EQ(refused.error().kind, ErrorKind::kUsage);
  EXPECT_EQ(refused.error().message,
            (folder / "set").string() +
                ": the folder already holds a sequence, expected a new or an empty folder");

  source.info_.frame_count = 2;
  ASSERT_TRUE(write(folder / "set", true).has_value());
  EXPECT_FALSE(fs::exists(folder / "set/colour/Color0003.png")) << "of the earlier sequence";

  // A failing overwrite leaves the earlier sequence as it was.
  source.on_read = [](Frame&) -> Expected<void> { return DataError("no"); };
  EXPECT_FALSE(write(folder / "set", true).has_value());
  EXPECT_EQ(OpenSequence(folder / "set").value()->info().frame_count, 2);
  source.on_read = nullptr;

  ASSERT_TRUE(WriteFile(folder / "home/thesis.txt", "precious").has_value());
  const auto foreign = write(folder / "home", true);
  ASSERT_FALSE(foreign.has_value());
  EXPECT_EQ(foreign.error().kind, ErrorKind::kUsage);
  EXPECT_EQ(foreign.error().message, (folder / "home").string() +
                                         ": the folder holds something other than a sequence of "
                                         "ours, expected a new or an empty folder");
  EXPECT_EQ(ReadFile(folder / "home/thesis.txt").value(), "precious");

  const auto file = write(folder / "home/thesis.txt", true);
  ASSERT_FALSE(file.has_value());
  EXPECT_EQ(file.error().kind, ErrorKind::kUsage);
  const auto below = write(folder / "home/thesis.txt/set", true);
  ASSERT_FALSE(below.has_value());
  EXPECT_EQ(below.error().kind, ErrorKind::kEnvironment);
  EXPECT_EQ(folder.Entries(), 2) << "set and home, nothing hidden";
}

}  // namespace
}  // namespace tsdfpp
