// What readers say of sets whose files, or the options with them, do not fit together.
#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "sequence/export.h"
#include "sequence/open_sequence.h"
#include "tests/core/temp_folder.h"
#include "tests/sequence/box_source.h"
#include "tests/sequence/other_sets.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;
using test::BoxSource;
using test::NotesSay;
using test::TempFolder;

// A camera that is given is that of colour and depth, whatever stands on disk.
TEST(ForeignSets, ScannetTakesAGivenCameraForBothImages) {
  const TempFolder folder;
  BoxSource source(2);
  const fs::path set = folder / "scene0000_00";
  test::WriteScannet(source, set);
  SequenceOptions options;
  options.intrinsics = source.info().intrinsics;
  const auto two_sizes = OpenSequence(set, options);
  ASSERT_FALSE(two_sizes.has_value());
  EXPECT_EQ(two_sizes.error().kind, ErrorKind::kUsage);
  EXPECT_NE(two_sizes.error().message.find("depth images of 64x48, but "), std::string::npos)
      << two_sizes.error().message;
  EXPECT_NE(two_sizes.error().message.find("0.png is 128x96"), std::string::npos)
      << two_sizes.error().message;
  // Registered images, while the colour camera on disk is still that of the larger ones.
  for (const char* stem : {"0", "10"}) {
    for (const char* kind : {"color", "instance-filt"}) {
      const std::string file = (set / kind / (std::string(stem) + ".png")).string();
      const cv::Mat large = cv::imread(file, cv::IMREAD_UNCHANGED);
      cv::Mat small;
      cv::resize(large, small, {64, 48}, 0, 0, cv::INTER_NEAREST);
      ASSERT_TRUE(cv::imwrite(file, small));
    }
  }
  const auto read = OpenSequence(set, options);
  ASSERT_TRUE(read.has_value()) << read.error().message;
  for (int i = 0; i < 2; ++i) {
    const Frame was = source.Read(i).value();
    const auto is = (*read)->Read(i);
    ASSERT_TRUE(is.has_value()) << is.error().message;
    EXPECT_EQ(cv::norm(was.colour, is->colour, cv::NORM_INF), 0);
    EXPECT_EQ(cv::norm(was.mask, is->mask, cv::NORM_INF), 0);
  }
}

// Frames that end early are said to.
TEST(ForeignSets, ColoursWithoutDepthAreSaid) {
  const TempFolder folder;
  BoxSource source;
  test::WriteScannet(source, folder / "scannet");
  ASSERT_TRUE(ExportSequence(source, DatasetFormat::kSevenScenes, folder / "scenes").has_value());
  const auto notes_of = [&](const fs::path& set) {
    SequenceNotes notes;
    const auto read = OpenSequence(set, {}, &notes);
    EXPECT_TRUE(read.has_value()) << read.error().message;
    return notes;
  };
  const std::string words = "colour images have no depth image and are left out";
  EXPECT_FALSE(NotesSay(notes_of(folder / "scannet"), words));
  EXPECT_FALSE(NotesSay(notes_of(folder / "scenes"), words));
  for (const char* stem : {"40", "50"}) {
    ASSERT_TRUE(fs::remove(folder / "scannet" / "depth" / (std::string(stem) + ".png")));
  }
  ASSERT_TRUE(fs::remove(folder / "scenes" / "frame-000005.depth.png"));
  EXPECT_TRUE(NotesSay(notes_of(folder / "scannet"), "color: 2 of 6 " + words));
  EXPECT_TRUE(NotesSay(notes_of(folder / "scenes"), "scenes: 1 of 6 " + words));
}

}  // namespace
}  // namespace tsdfpp
