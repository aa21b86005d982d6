#include "core/files.h"
#include "sequence/dataset_writers.h"
#include "sequence/image_files.h"
#include "sequence/pose_matrix.h"

namespace tsdfpp {
namespace {

constexpr std::uint16_t kGreatest = 65534;  // 65535 means none

class SevenScenesWriter : public DatasetWriter {
 public:
  SevenScenesWriter(const SequenceInfo& info, std::filesystem::path folder)
      : camera_(info.intrinsics), folder_(std::move(folder)) {}

  double depth_units_per_m() const override { return kMillimetreUnits; }

  Expected<void> Add(const Frame& frame) override {
    const std::string name = fmt::format("frame {}", frame.index);
    const auto path = [&](const char* end) {
      return folder_ / fmt::format("frame-{:06d}.{}", frame.index, end);
    };
    TSDFPP_RETURN_IF_ERROR(WriteEncoded(path("color.png"), EncodeColour(frame.colour, name)));
    const cv::Mat units = DepthToUnits(frame.depth, kMillimetreUnits, kGreatest, loss_);
    TSDFPP_RETURN_IF_ERROR(WriteEncoded(path("depth.png"), EncodePng(units, name)));
    if (!frame.mask.empty()) {
      TSDFPP_RETURN_IF_ERROR(WriteEncoded(path("mask.png"), EncodePng(frame.mask, name)));
    }
    return WriteFile(path("pose.txt"), PoseToMatrixText(frame.T_WC));
  }

  Expected<void> Finish(ExportReport&) override {
    return WriteFile(
        folder_ / "camera-intrinsics.txt",
        fmt::format("{} 0 {}\n0 {} {}\n0 0 1\n", camera_.fx, camera_.cx, camera_.fy, camera_.cy));
  }

 private:
  Intrinsics camera_;
  std::filesystem::path folder_;
};

}  // namespace

std::unique_ptr<DatasetWriter> MakeSevenScenesWriter(const SequenceInfo& info,
                                                     std::filesystem::path folder) {
  return std::make_unique<SevenScenesWriter>(info, std::move(folder));
}

}  // namespace tsdfpp
