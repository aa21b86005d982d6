#include <cmath>
#include <map>

#include "core/files.h"
#include "core/pose_text.h"
#include "sequence/calibration.h"
#include "sequence/dataset_writers.h"
#include "sequence/image_files.h"

namespace tsdfpp {
namespace {

class TumWriter : public DatasetWriter {
 public:
  TumWriter(const SequenceInfo& info, std::filesystem::path folder)
      : camera_(info.intrinsics), folder_(std::move(folder)) {}

  double depth_units_per_m() const override { return kTumExportUnits; }

  Expected<void> Add(const Frame& frame) override {
    const std::string stamp = fmt::format("{:.6f}", frame.time_s);
    const std::string name = fmt::format("frame {}", frame.index);
    if (!std::isfinite(frame.time_s)) {
      return DataError("{}: its time is {} s, expected a finite one", name, frame.time_s);
    }
    // Files are called by their times.
    const auto [other, is_new] = frame_at_.try_emplace(stamp, frame.index);
    if (!is_new) {
      return DataError("{}: its time is that of frame {}, {} s, expected another", name,
                       other->second, stamp);
    }
    const std::string colour = fmt::format("rgb/{}.png", stamp);
    const std::string depth = fmt::format("depth/{}.png", stamp);
    TSDFPP_RETURN_IF_ERROR(WriteEncoded(folder_ / colour, EncodeColour(frame.colour, name)));
    const cv::Mat units = DepthToUnits(frame.depth, kTumExportUnits, 65535, loss_);
    TSDFPP_RETURN_IF_ERROR(WriteEncoded(folder_ / depth, EncodePng(units, name)));
    if (!frame.mask.empty()) {
      TSDFPP_RETURN_IF_ERROR(
          WriteEncoded(folder_ / fmt::format("mask/{}.png", stamp), EncodePng(frame.mask, name)));
    }
    colours_ += fmt::format("{} {}\n", stamp, colour);
    depths_ += fmt::format("{} {}\n", stamp, depth);
    pairs_ += fmt::format("{} {} {} {}\n", stamp, colour, stamp, depth);
    poses_ += fmt::format("{} {}\n", stamp, PoseToText(frame.T_WC));
    return {};
  }

  Expected<void> Finish(ExportReport&) override {
    const std::string list = "# timestamp filename\n";
    TSDFPP_RETURN_IF_ERROR(WriteFile(folder_ / "rgb.txt", "# color images\n" + list + colours_));
    TSDFPP_RETURN_IF_ERROR(WriteFile(folder_ / "depth.txt", "# depth maps\n" + list + depths_));
    TSDFPP_RETURN_IF_ERROR(WriteFile(folder_ / "associations.txt", pairs_));
    TSDFPP_RETURN_IF_ERROR(WriteFile(folder_ / "groundtruth.txt",
                                     "# ground truth trajectory\n"
                                     "# timestamp tx ty tz qx qy qz qw\n" +
                                         poses_));
    return WriteFile(folder_ / "calibration.txt", CalibrationToText(camera_));
  }

 private:
  Intrinsics camera_;
  std::filesystem::path folder_;
  std::map<std::string, int> frame_at_;  // by time
  std::string colours_;
  std::string depths_;
  std::string pairs_;
  std::string poses_;
};

}  // namespace

std::unique_ptr<DatasetWriter> MakeTumWriter(const SequenceInfo& info,
                                             std::filesystem::path folder) {
  return std::make_unique<TumWriter>(info, std::move(folder));
}

}  // namespace tsdfpp
