// Sequences without masks: all of them is background, and some masks alone are an error.
#include "sequence/background_masks.h"

#include <gtest/gtest.h>

#include "sequence/export.h"
#include "sequence/open_sequence.h"
#include "tests/core/temp_folder.h"
#include "tests/sequence/box_source.h"
#include "tests/sequence/memory_source.h"
#include "tests/sequence/other_sets.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;
using test::BoxSource;
using test::TempFolder;

// Every format that may lack masks: what is mapped is background, and partly missing ones are
// named.
TEST(BackgroundMasks, WithoutMasksAllIsBackground) {
  const TempFolder folder;
  BoxSource source;
  const auto expect_background = [&](const fs::path& path) {
    SCOPED_TRACE(path);
    SequenceOptions options;
    options.check = false;
    auto opened = OpenSequence(path, options);
    ASSERT_TRUE(opened.has_value()) << opened.error().message;
    const int first = (*opened)->info().first_index;
    EXPECT_TRUE((*opened)->Read(first)->mask.empty());
    const auto masked = WithBackgroundMasks(std::move(*opened));
    ASSERT_TRUE(masked.has_value()) << masked.error().message;
    EXPECT_EQ(masked->remark,
              masked->source->info().name + ": has no masks, so all of it is taken for background");
    const Frame frame = masked->source->Read(first + 1).value();
    EXPECT_EQ(frame.mask.type(), CV_16UC1);
    EXPECT_EQ(frame.mask.size(), frame.depth.size());
    EXPECT_EQ(cv::countNonZero(frame.mask), 0);
  };
  const auto exported = [&](DatasetFormat format, const std::string& name) {
    EXPECT_TRUE(ExportSequence(source, format, folder / name).has_value());
    return folder / name;
  };
  fs::remove_all(exported(DatasetFormat::kTum, "tum") / "mask");
  expect_background(folder / "tum");
  fs::remove_all(exported(DatasetFormat::kKlg, "klg") / "mask");
  expect_background(folder / "klg");
  exported(DatasetFormat::kBop, "bop");
  fs::remove_all(folder / "bop/test/000000/mask");
  fs::remove_all(folder / "bop/test/000000/mask_visib");
  expect_background(folder / "bop");
  exported(DatasetFormat::kSevenScenes, "chess");
  for (int i = 0; i < 6; ++i) {
    fs::remove(folder / fmt::format("chess/frame-{:06d}.mask.png", i));
  }
  expect_background(folder / "chess");
  test::WriteScannet(source, folder / "scannet");
  fs::remove_all(folder / "scannet/instance-filt");
  expect_background(folder / "scannet");
  test::WriteReplica(source, folder / "replica");
  expect_background(folder / "replica");

  // With masks the source stays what it is.
  auto opened = OpenSequence(exported(DatasetFormat::kTum, "with")).value();
  const FrameSource* const before = opened.get();
  const auto same = WithBackgroundMasks(std::move(opened)).value();
  EXPECT_EQ(same.source.get(), before);
  EXPECT_EQ(same.remark, "");
  // Some masks are an error, in a reader of files and in one in memory.
  fs::remove(folder / "with/mask/0.033333.png");
  const auto partly = OpenSequence(folder / "with");
  ASSERT_FALSE(partly.has_value());
  EXPECT_NE(partly.error().message.find("mask/0.033333.png: no such mask"), std::string::npos)
      << partly.error().message;
  auto memory = std::make_unique<test::MemorySource>();
  memory->on_read = [](Frame& frame) -> Expected<void> {
    if (frame.index == 1) frame.mask = cv::Mat();
    return {};
  };
  const auto late = WithBackgroundMasks(std::move(memory)).value();
  const auto frame = late.source->Read(2);
  ASSERT_FALSE(frame.has_value());
  EXPECT_NE(
      frame.error().message.find("frame 2 has a mask and frame 1 has none, expected masks for all"),
      std::string::npos)
      << frame.error().message;
}

}  // namespace
}  // namespace tsdfpp
