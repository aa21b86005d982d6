#include "bench/camera_clock.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <numbers>
#include <optional>
#include <utility>

#include "bench/figure_runs.h"
#include "bench/median.h"
#include "bench/open3d_icp.h"
#include "mapper/pipeline.h"
#include "mapper/rays/ray_cast.h"
#include "metrics/relative_error.h"
#include "sequence/text_lines.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;

constexpr int kSteps = 16;  // to either side
constexpr double kStep_s = 0.005;
constexpr int kPixelStep = 4;  // of rows and columns whose depth is compared with a map's

// The stamp of the first frame, whose time is 0: that of a depth image which has its very pose.
Expected<double> StampOf(const Frame& first, const fs::path& depth_list, const TimedPoses& poses) {
  TSDFPP_ASSIGN(const std::vector<TextLine> lines, ReadTextLines(depth_list));
  for (const TextLine& line : lines) {
    const auto stamp_s = ParseNumber(line.words.front());
    const auto pose = stamp_s ? PoseAt(poses, *stamp_s) : std::nullopt;
    if (pose && pose->matrix() == first.T_WC.matrix()) return *stamp_s;
  }
  return DataError("{}: no image at whose time the first frame's pose is", depth_list.string());
}

// Millimetres, the median over every fourth pixel of every fourth row that has depth and a surface.
Expected<double> DepthBesideMap(const std::vector<Frame>& frames, const Trajectory& T_WC) {
  PipelineConfig config;
  config.segmentation = Segmentation::kNone;
  Pipeline pipeline(config, {});
  std::vector<Frame> posed;
  for (const Frame& frame : frames) {
    const auto pose = T_WC.find(frame.index);
    if (pose == T_WC.end()) continue;
    posed.push_back(frame);
    posed.back().T_WC = pose->second;
    if (auto mapped = pipeline.Process(posed.back()); !mapped) {
      return tl::unexpected(std::move(mapped.error()));
    }
  }
  std::vector<double> errors_mm;
  for (const Frame& frame : posed) {
    const cv::Mat depth =
        pipeline.map().CastRays(frame.intrinsics, frame.T_WC, {.colour = false}).front().depth;
    for (int v = 0; v < depth.rows; v += kPixelStep) {
      for (int u = 0; u < depth.cols; u += kPixelStep) {
        const float seen = frame.depth.at<float>(v, u);
        const float cast = depth.at<float>(v, u);
        if (!IsValidDepth(seen) || cast <= 0) continue;
        errors_mm.push_back(1e3 * std::abs(double{seen} - cast));
      }
    }
  }
  return errors_mm.empty() ? 0 : Median(std::move(errors_mm));
}

Trajectory TimedAt(double offset_s, const std::map<int, double>& times_s, const TimedPoses& poses) {
  Trajectory T_WC;
  for (const auto& [frame, time_s] : times_s) {
    if (const auto pose = PoseAt(poses, time_s + offset_s)) T_WC[frame] = *pose;
  }
  return T_WC;
}

// Millimetres, RMSE.
std::string AlignedPlaces(const Trajectory& T_WC, const Trajectory& truth) {
  const PosePairs pairs = PairByFrame(T_WC, truth);
  const auto alignment = AlignHorn(pairs);
  if (!alignment) return "-";
  const auto errors = PoseErrorsOf(Aligned(pairs, *alignment));
  return errors ? Cell(1e3 * errors->translation_m.rmse, 1) : "-";
}

}  // namespace

MotionErrors MotionErrorsBetween(const Trajectory& T_WC, const Trajectory& T_WC_other) {
  const RelativeErrors errors = RelativePoseErrors(PairByFrame(T_WC, T_WC_other), 1);
  const auto turns = SummariseErrors(errors.rotation_rad);
  const auto shifts = SummariseErrors(errors.translation_m);
  if (!turns || !shifts) return {};
  return {0, turns->rmse * 180 / std::numbers::pi, 1e3 * shifts->rmse};
}

MotionErrors MotionErrorsAt(double offset_s, const Trajectory& T_WC,
                            const std::map<int, double>& times_s, const TimedPoses& poses) {
  MotionErrors errors = MotionErrorsBetween(T_WC, TimedAt(offset_s, times_s, poses));
  errors.offset_s = offset_s;
  return errors;
}

MotionErrors AtBestOffset(const Trajectory& T_WC, const std::map<int, double>& times_s,
                          const TimedPoses& poses) {
  MotionErrors best = MotionErrorsAt(0, T_WC, times_s, poses);
  for (int i = -kSteps; i <= kSteps; ++i) {
    const MotionErrors errors = MotionErrorsAt(i * kStep_s, T_WC, times_s, poses);
    if (errors.turn_deg < best.turn_deg) best = errors;
  }
  return best;
}

Expected<void> JudgeClock(const std::string& recording, FrameSource& source,
                          const Intrinsics& other_camera, int until, std::vector<FoundCamera> found,
                          const std::string& out) {
  const fs::path folder = recording;
  const SequenceInfo& info = source.info();
  TSDFPP_ASSIGN(const TimedPoses poses, ReadTimedPoses(folder / "groundtruth.txt"));
  const int last = std::min(until, info.first_index + info.frame_count - 1);
  std::vector<Frame> frames;
  std::map<int, double> times_s;
  Trajectory by_open3d;
  double stamp_s = 0;
  for (int index = info.first_index; index <= last; ++index) {
    TSDFPP_ASSIGN(Frame frame, source.Read(index));
    if (frames.empty()) {
      TSDFPP_ASSIGN(stamp_s, StampOf(frame, folder / "depth.txt", poses));
      by_open3d[index] = frame.T_WC;
    } else {
      const Frame& before = frames.back();
      const Pose T_guess = before.T_WC.inverse() * frame.T_WC;
      by_open3d[index] = by_open3d.at(before.index) * MotionByOpen3dIcp(before, frame, T_guess);
    }
    times_s[index] = stamp_s + frame.time_s;
    frames.push_back(std::move(frame));
  }
  found.push_back({"Open3D's ICP", by_open3d});
  FigureTable table({"who", "from motion capture: turn deg", "shift mm", "best offset ms",
                     "at that: turn deg", "shift at that mm", "at that: places aligned mm",
                     "from Open3D's: turn deg", "depth beside the map mm"});
  const auto add = [&](const std::string& who, const Trajectory& T_WC,
                       std::vector<std::string> beside_capture) -> Expected<void> {
    TSDFPP_ASSIGN(const double beside_map_mm, DepthBesideMap(frames, T_WC));
    std::vector<std::string> row{who};
    row.insert(row.end(), beside_capture.begin(), beside_capture.end());
    row.push_back(Cell(MotionErrorsBetween(T_WC, by_open3d).turn_deg, 2));
    row.push_back(Cell(beside_map_mm, 1));
    table.Add(std::move(row));
    return {};
  };
  const std::vector<std::string> no_other(6, "-");
  const double best_s = AtBestOffset(by_open3d, times_s, poses).offset_s;
  TSDFPP_RETURN_IF_ERROR(add("motion capture as stamped", TimedAt(0, times_s, poses), no_other));
  TSDFPP_RETURN_IF_ERROR(add(fmt::format("motion capture at {:+.0f} ms", 1e3 * best_s),
                             TimedAt(best_s, times_s, poses), no_other));
  for (Frame& frame : frames) frame.intrinsics = other_camera;
  TSDFPP_RETURN_IF_ERROR(
      add(fmt::format("the same by a camera of {:g} {:g} {:g} {:g}", other_camera.fx,
                      other_camera.fy, other_camera.cx, other_camera.cy),
          TimedAt(best_s, times_s, poses), no_other));
  for (Frame& frame : frames) frame.intrinsics = info.intrinsics;
  for (const auto& [who, T_WC] : found) {
    const MotionErrors stamped = MotionErrorsAt(0, T_WC, times_s, poses);
    const MotionErrors best = AtBestOffset(T_WC, times_s, poses);
    TSDFPP_RETURN_IF_ERROR(
        add(who, T_WC,
            {Cell(stamped.turn_deg, 2), Cell(stamped.shift_mm, 1), Cell(1e3 * best.offset_s, 0),
             Cell(best.turn_deg, 2), Cell(best.shift_mm, 1),
             AlignedPlaces(T_WC, TimedAt(best.offset_s, times_s, poses))}));
  }
  return table.Write(out, "clock");
}

}  // namespace tsdfpp
