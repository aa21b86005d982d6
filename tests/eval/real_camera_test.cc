// The camera of a real recording, found by the room that it shows.
#include <gtest/gtest.h>

#include "mapper/pipeline.h"
#include "metrics/trajectory.h"
#include "sequence/open_sequence.h"
#include "tests/needs.h"

namespace tsdfpp {
namespace {

// Of motion capture, whose time stamps and a rolling shutter are in it: two voxels.
constexpr double kMost_m = 0.04;
constexpr double kVoxel_m = 0.02;

// Poses beside the first are wrong on purpose, so that none of them can have been looked at.
TEST(RealCamera, IsFoundAlongAWholeRecordingFromItsFirstPoseAlone) {
  TSDFPP_NEEDS_SHARED("tum_fr1_rpy_subset");
  const auto source = OpenSequence(test::SharedData("tum_fr1_rpy_subset"), {});
  ASSERT_TRUE(source.has_value()) << source.error().message;
  const SequenceInfo& info = (*source)->info();
  PipelineConfig config;
  config.method = Method::kTsdfppAnchored;
  config.map.voxel_m = kVoxel_m;
  config.segmentation = Segmentation::kNone;
  config.camera = CameraSource::kTrack;
  Pipeline pipeline(config, info.objects);
  Trajectory truth;
  for (int i = 0; i < info.frame_count; ++i) {
    Frame frame = (*source)->Read(info.first_index + i).value();
    truth[frame.index] = frame.T_WC;
    if (i > 0) frame.T_WC.translation().x() += 1 + i;
    ASSERT_TRUE(pipeline.Process(frame).has_value());
  }
  EXPECT_EQ(pipeline.camera_log().lost, 0);
  const PosePairs pairs = PairByFrame(pipeline.camera_log().T_WC, truth);
  ASSERT_EQ(pairs.size(), static_cast<std::size_t>(info.frame_count));
  EXPECT_LT(SummariseErrors(TranslationErrors_m(pairs))->rmse, kMost_m);
}

}  // namespace
}  // namespace tsdfpp
