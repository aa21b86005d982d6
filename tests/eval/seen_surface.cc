#include "tests/eval/seen_surface.h"

#include <cstdlib>
#include <filesystem>

#include "eval/run/open_source.h"
#include "metrics/visibility.h"

namespace tsdfpp {
Expected<FrameSet> ReadFrames(const std::string& scene, int step, int last) {
  const auto path = std::filesystem::path(TSDFPP_SOURCE_DIR) / "scenes" / (scene + ".toml");
  TSDFPP_ASSIGN(auto source, OpenSource(path));
  FrameSet set;
  set.info = source->info();
  const int end = last > 0 ? last : set.info.first_index + set.info.frame_count - 1;
  for (int index = set.info.first_index; index <= end; index += step) {
    TSDFPP_ASSIGN(Frame frame, source->Read(index));
    set.frames.push_back(std::move(frame));
  }
  TSDFPP_ASSIGN(set.models, source->Truth());
  return set;
}

SampleSet SeenSamples(const TriangleMesh& mesh_W, const std::vector<Frame>& frames,
                      double margin_m) {
  VisibilityConfig config;
  config.margin_m = margin_m;
  SeenTracker tracker(SampleMesh(mesh_W, 1, 1), kBackground, config);
  for (Frame frame : frames) {
    // A new image: assigning zeros() would write into the mask that the copy shares.
    frame.mask = cv::Mat(frame.depth.size(), CV_16UC1, cv::Scalar(0));
    // Images and masks of one source always fit.
    if (!tracker.Observe(frame, Pose::Identity())) std::abort();
  }
  const SampleSet& all = tracker.samples_O();
  SampleSet seen;
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (!tracker.Seen(i)) continue;
    seen.points.push_back(all.points[i]);
    seen.normals.push_back(all.normals[i]);
    seen.region.push_back(all.region[i]);
    seen.triangle.push_back(all.triangle[i]);
    seen.area_m2.push_back(all.area_m2[i]);
  }
  return seen;
}

double MeanIn(const Eigen::AlignedBox3f& box_W, const std::vector<Eigen::Vector3f>& points_W,
              const std::vector<float>& values) {
  double sum = 0;
  std::size_t count = 0;
  for (std::size_t i = 0; i < points_W.size(); ++i) {
    if (!box_W.contains(points_W[i])) continue;
    sum += values[i];
    ++count;
  }
  return sum / static_cast<double>(count);
}

}  // namespace tsdfpp
