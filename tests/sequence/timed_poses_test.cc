// Poses by their times: lines that repeat or go back, and what lies between two of them.
#include "sequence/timed_poses.h"

#include <gtest/gtest.h>

#include <fstream>

#include "core/files.h"
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

// As in TUM's own fr2/desk. associate.py keeps a dictionary by time, so the last line counts.
TEST(TimedPoses, ATimeThatStandsTwiceIsRemarkedOn) {
  const TempFolder folder;
  const fs::path file = folder / "groundtruth.txt";
  const auto write = [&](const std::string& lines) {
    std::ofstream(file) << "# ground truth trajectory\n# timestamp tx ty tz qx qy qz qw\n" << lines;
  };
  write(
      "1.0 1 0 0 0 0 0 1\n1.50 2 0 0 0 0 0 1\n1.5 3 0 0 0 0 0 1\n1.5 4 0 0 0 0 0 1\n"
      "2.0 5 0 0 0 0 0 1\n2.0 5 0 0 0 0 0 1\n");
  std::vector<std::string> remarks;
  const auto poses = ReadTimedPoses(file, &remarks);
  ASSERT_TRUE(poses.has_value()) << poses.error().message;
  ASSERT_EQ(poses->size(), 3U);
  EXPECT_EQ(poses->at(1.0).translation().x(), 1);
  EXPECT_EQ(poses->at(1.5).translation().x(), 4);
  EXPECT_EQ(poses->at(2.0).translation().x(), 5);
  EXPECT_EQ(remarks,
            (std::vector<std::string>{
                file.string() +
                ": lines that repeat the time of an earlier one: 3, 2 of them with another "
                "pose, the first is line 5 (time 1.5); of a time the last line counts"}));

  write("2.0 1 0 0 0 0 0 1\n1.0 2 0 0 0 0 0 1\n3.0 3 0 0 0 0 0 1\n2.5 4 0 0 0 0 0 1\n");
  remarks.clear();
  const auto sorted = ReadTimedPoses(file, &remarks);
  ASSERT_TRUE(sorted.has_value()) << sorted.error().message;
  EXPECT_EQ(sorted->begin()->second.translation().x(), 2);
  EXPECT_EQ(remarks, (std::vector<std::string>{
                         file.string() +
                         ": lines that go back in time: 2, the first is line 4 (1.0 after 2.0); "
                         "poses are taken in the order of their times"}));

  write("1 0 0 0 0 0 0 1\n2 0 0 0 0 0 0 1\n");
  remarks.clear();
  EXPECT_TRUE(ReadTimedPoses(file, &remarks).has_value());
  EXPECT_TRUE(remarks.empty()) << remarks.front();

  // A recording with such a file opens, and its notes say so.
  BoxSource source(4);
  const fs::path set = folder / "desk";
  ASSERT_TRUE(ExportSequence(source, DatasetFormat::kTum, set).has_value());
  std::string text = ReadFile(set / "groundtruth.txt").value();
  const std::string last = text.substr(text.rfind('\n', text.size() - 2) + 1);
  std::ofstream(set / "groundtruth.txt") << text << last;
  SequenceNotes notes;
  const auto read = OpenSequence(set, {}, &notes);
  ASSERT_TRUE(read.has_value()) << read.error().message;
  EXPECT_TRUE(NotesSay(notes, "lines that repeat the time of an earlier one: 1, 0 of them"));
  EXPECT_LT((read.value()->Read(3)->T_WC.matrix() - source.Read(3)->T_WC.matrix()).norm(), 1e-8);
}

TEST(TimedPoses, PosesAreInterpolatedOnlyAcrossShortGaps) {
  TimedPoses poses;
  for (const double t : {1.0, 1.05, 2.0}) {
    poses[t] = Pose::Identity();
    poses[t].translation().x() = t;
  }
  const auto x = [&](double t) {
    const auto pose = PoseAt(poses, t);
    return pose ? pose->translation().x() : -1;
  };
  EXPECT_EQ(x(1.05), 1.05);
  EXPECT_NEAR(x(1.03), 1.03, 1e-12);
  EXPECT_EQ(x(1.06), 1.05) << "the nearest, within 20 ms";
  EXPECT_EQ(x(1.08), -1) << "in a gap of 0.95 s";
  EXPECT_EQ(x(1.985), 2.0);
  EXPECT_EQ(x(0.985), 1.0);
  EXPECT_EQ(x(0.97), -1);
  EXPECT_EQ(x(2.03), -1);
}

}  // namespace
}  // namespace tsdfpp
