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

// Images whose clock runs behind that of the poses: the same set with other stamps of the poses is
// the reference. An offset between two poses is interpolated.
TEST(TimedPoses, AnOffsetIsThatOfAnotherClock) {
  constexpr double kOffset_s = 0.25;
  constexpr double kSpeed_mps = 0.125;  // along x, in numbers that are exact
  const TempFolder folder;
  BoxSource source(4);
  for (const DatasetFormat format : {DatasetFormat::kTum, DatasetFormat::kKlg}) {
    const fs::path set = folder / DatasetFormatName(format);
    ASSERT_TRUE(ExportSequence(source, format, set).has_value());
    const fs::path opened = format == DatasetFormat::kKlg ? set / "sequence.klg" : set;
    const auto stamped = [&](double first_s) {
      std::ofstream file(set / "groundtruth.txt");
      for (int i = 0; i < 64; ++i) {
        const double since_s = i / 64.;
        file << fmt::format("{} {} 0 0 0 0 0 1\n", first_s + since_s, kSpeed_mps * since_s);
      }
    };
    const auto places = [&](double offset_s, SequenceNotes* notes) {
      std::vector<double> x;
      SequenceOptions options;
      options.check = false;
      options.pose_offset_s = offset_s;
      const auto read = OpenSequence(opened, options, notes);
      EXPECT_TRUE(read.has_value()) << read.error().message;
      for (int i = 0; read && i < 4; ++i)
        x.push_back(read.value()->Read(i)->T_WC.translation().x());
      return x;
    };
    stamped(0);
    SequenceNotes notes;
    const std::vector<double> offset = places(kOffset_s, &notes);
    EXPECT_TRUE(NotesSay(notes, "groundtruth.txt: read 0.25 s after the images' times"));
    stamped(-kOffset_s);
    notes.clear();
    const std::vector<double> by_other_stamps = places(0, &notes);
    EXPECT_FALSE(NotesSay(notes, "the images' times"));
    ASSERT_EQ(offset.size(), 4U);
    ASSERT_EQ(by_other_stamps.size(), 4U);
    for (std::size_t i = 0; i < offset.size(); ++i) {
      EXPECT_NEAR(offset[i], by_other_stamps[i], 1e-12);
      EXPECT_NEAR(offset[i], kSpeed_mps * (kOffset_s + static_cast<double>(i) / 30), 1e-6);
    }

    fs::remove(set / "groundtruth.txt");
    SequenceOptions none;
    none.fixed_camera = true;
    none.pose_offset_s = kOffset_s;
    const auto without = OpenSequence(opened, none);
    ASSERT_FALSE(without.has_value());
    EXPECT_EQ(without.error().kind, ErrorKind::kUsage);
    EXPECT_EQ(without.error().message,
              (set / "groundtruth.txt").string() +
                  ": no such file, expected no offset of poses without it");
  }

  const fs::path set = folder / "bop";
  ASSERT_TRUE(ExportSequence(source, DatasetFormat::kBop, set).has_value());
  SequenceOptions options;
  options.pose_offset_s = kOffset_s;
  const auto bop = OpenSequence(set, options);
  ASSERT_FALSE(bop.has_value());
  EXPECT_EQ(bop.error().kind, ErrorKind::kUsage);
  EXPECT_TRUE(bop.error().message.ends_with(
      "a bop set has poses of frames, not of times, expected no offset of them"))
      << bop.error().message;
}

}  // namespace
}  // namespace tsdfpp
