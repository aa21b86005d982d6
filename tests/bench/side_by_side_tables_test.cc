// What the page of side-by-side says, from times that are worked out by hand.
#include "bench/side_by_side_tables.h"

#include <gtest/gtest.h>

#include <sstream>

namespace tsdfpp {
namespace {

// A run of three frames with this median and this worst one.
SpeedRun RunOf(double median_ms, double worst_ms, std::size_t megabytes = 0) {
  return {{median_ms, worst_ms, median_ms / 2}, megabytes * 1'000'000};
}

TEST(SideBySideTables, MediansAreOverRunsNotFrames) {
  // Pooled, the frames' median would be 2.
  const Speed speed{"a", "", {{{2, 2, 2, 2, 2, 2}, 0}, {{4}, 0}, {{10, 20, 1}, 0}}};
  EXPECT_EQ(speed.MedianMs(), 4);
  EXPECT_EQ(speed.WorstMs(), 4);
}

// Run by run: a run in which the machine was half as fast slows both and changes no ratio.
TEST(SideBySideTables, RatiosAreTakenWithinARun) {
  const Speed peer{"peer", "", {RunOf(40, 50), RunOf(80, 90), RunOf(44, 50)}};
  const Speed ours{"ours", "", {RunOf(10, 11), RunOf(20, 21), RunOf(10, 11)}};
  const TimesFaster faster = CompareSpeeds(peer, ours);
  EXPECT_EQ(faster.median, 4);
  ASSERT_TRUE(faster.interval.has_value());
  // Of three values a bootstrap's median is the largest in 7 of 27 resamples, the least in 20.
  EXPECT_EQ(faster.interval->low, 4);
  EXPECT_EQ(faster.interval->high, 4.4);
}

TEST(SideBySideTables, OneRunHasNoInterval) {
  const TimesFaster faster =
      CompareSpeeds({"peer", "", {RunOf(30, 50)}}, {"ours", "", {RunOf(10, 11)}});
  EXPECT_EQ(faster.median, 3);
  EXPECT_FALSE(faster.interval.has_value());
}

CaseSpeeds TwoThreadCounts() {
  const SideBySideCase of{"1cm", "1 cm, band of 10 voxels", 0.01, 10, false};
  const Speed blocks8{"VoxelBlockGrid 8", "asleep", {RunOf(60, 70, 77)}};
  ThreadSpeeds one{{{"Scalable", "alone", {RunOf(100, 120, 400)}},
                    {"VoxelBlockGrid 8", "alone", {RunOf(120, 140, 77)}}},
                   {{"tsdf++", "", {RunOf(20, 25, 40)}}},
                   {{"tsdf++", "", {RunOf(10, 12, 34)}}}};
  ThreadSpeeds two{{{"Scalable", "asleep", {RunOf(90, 95, 400)}},
                    blocks8,
                    {"Scalable", "spinning", {RunOf(70, 75, 400)}},
                    {"VoxelBlockGrid 8", "spinning", {RunOf(66, 75, 77)}}},
                   {{"tsdf++", "", {RunOf(12, 15, 40)}}},
                   {{"tsdf++", "", {RunOf(6, 8, 34)}}}};
  return {of, {{1, one}, {2, two}}};
}

// The fastest of Open3D's volumes is another one for each number of threads, and a row has the
// faster way of waiting.
TEST(SideBySideTables, EachRowIsHeldAgainstTheFastestPeer) {
  std::vector<std::string> lines;
  std::istringstream text(CaseTable(TwoThreadCounts()));
  for (std::string line; std::getline(text, line);) lines.push_back(line);
  ASSERT_EQ(lines.size(), 7U);
  EXPECT_EQ(lines[2],
            "| Scalable | 100.0 | 120.0 | 1.00 | - | - | 70.0 | 75.0 | 0.86 | - | - | 400 | - |");
  EXPECT_EQ(lines[3],
            "| VoxelBlockGrid 8 | 120.0 | 140.0 | 0.83 | - | - | 60.0 | 70.0 | 1.00 | - | - | 77 | "
            "- |");
  EXPECT_EQ(lines[4],
            "| `tsdf++` | 20.0 | 25.0 | 5.0 | 10.0 | 10.0 | 12.0 | 15.0 | 5.0 | 6.0 | 10.0 | 40 | "
            "34 |");
  EXPECT_EQ(lines[6],
            "Open3D's fastest, that of the ratios: 1 T: Scalable, alone; 2 T: VoxelBlockGrid 8, "
            "asleep.");
}

TEST(SideBySideTables, TheSummaryIsOfTheMostThreads) {
  EXPECT_EQ(SummaryTable({TwoThreadCounts()}),
            "| 2 threads | 1 cm, band of 10 voxels: equal work | fusion alone, as shipped |\n"
            "|---|---|---|\n"
            "| Open3D's fastest | 60.0 ms (VoxelBlockGrid 8) | - |\n"
            "| `tsdf++` | 12.0 ms, 5.0 | 6.0 ms, 10.0 |\n");
}

}  // namespace
}  // namespace tsdfpp
