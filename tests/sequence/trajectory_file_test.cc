#include "sequence/trajectory_file.h"

#include <gtest/gtest.h>

#include "core/files.h"
#include "tests/core/temp_folder.h"

namespace tsdfpp {
namespace {

using test::TempFolder;

TEST(TrajectoryFile, ReadsCommentsBlankLinesGapsAndNoFinalNewline) {
  const TempFolder folder;
  ASSERT_TRUE(WriteFile(folder / "t.txt",
                        "# frame tx ty tz qx qy qz qw\r\n\n  10 1 2 3 0 0 0 1\r\n"
                        "\t7\t-1 0 0.5 1 0 0 0\n   # aside\n8 0 0 0 0 0 0 1")
                  .has_value());
  const auto trajectory = ReadTrajectory(folder / "t.txt");
  ASSERT_TRUE(trajectory.has_value()) << trajectory.error().message;
  ASSERT_EQ(trajectory->size(), 3U);
  EXPECT_EQ(trajectory->at(10).translation(), Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(trajectory->at(10).linear(), Eigen::Matrix3d::Identity());
  EXPECT_EQ(trajectory->at(7).linear(), Eigen::Matrix3d(Eigen::Vector3d(1, -1, -1).asDiagonal()));
  EXPECT_EQ(trajectory->at(8).matrix(), Eigen::Matrix4d::Identity());
}

TEST(TrajectoryFile, BadLinesAreNamed) {
  const TempFolder folder;
  const struct {
    const char* text;
    const char* sentence;
  } cases[] = {
      {"1 0 0 0 0 0 0 1\nx 0 0 0 0 0 0 1\n",
       ":2: the line does not begin with a whole frame number"},
      {"1.5 0 0 0 0 0 0 1\n", ":1: the line does not begin with a whole frame number"},
      {"99999999999 0 0 0 0 0 0 1\n", ":1: the line does not begin with a whole frame number"},
      {"\n1 0 0 0 0 0 0\n",
       ":2: '0 0 0 0 0 0' is not a pose: expected seven numbers tx ty tz qx qy qz qw"},
      {"1\n", ":1: '' is not a pose: expected seven numbers tx ty tz qx qy qz qw"},
      {"1 0 0 0 0 0 0 2\n",
       ":1: '0 0 0 0 0 0 2' is not a pose: the quaternion's length is 2.000000, not 1"},
      {"3 0 0 0 0 0 0 1\n3 0 0 0 0 0 0 1\n", ":2: frame 3 has a second pose"},
  };
  for (const auto& [text, sentence] : cases) {
    ASSERT_TRUE(WriteFile(folder / "t.txt", text).has_value());
    const auto trajectory = ReadTrajectory(folder / "t.txt");
    ASSERT_FALSE(trajectory.has_value()) << text;
    EXPECT_EQ(trajectory.error().kind, ErrorKind::kData);
    EXPECT_EQ(trajectory.error().message, (folder / "t.txt").string() + sentence);
  }
}

}  // namespace
}  // namespace tsdfpp
