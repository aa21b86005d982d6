#include <cmath>
#include <fstream>

#include "core/files.h"
#include "core/pose_text.h"
#include "sequence/calibration.h"
#include "sequence/dataset_writers.h"
#include "sequence/image_files.h"
#include "sequence/klg_layout.h"

namespace tsdfpp {
namespace {

// Depth packed by zlib; colour raw, which every reader of the format takes and which loses nothing.
class KlgWriter : public DatasetWriter {
 public:
  KlgWriter(const SequenceInfo& info, std::filesystem::path folder)
      : info_(info), folder_(std::move(folder)) {}

  double depth_units_per_m() const override { return kMillimetreUnits; }

  Expected<void> Add(const Frame& frame) override {
    if (!out_.is_open()) {
      out_.open(folder_ / kRecording, std::ios::binary);
      Put(static_cast<std::int32_t>(info_.frame_count));
    }
    constexpr double kMostSeconds = 9e12;  // as microseconds in 64 bits
    if (!(std::abs(frame.time_s) < kMostSeconds)) {
      return DataError("frame {}: its time, {} s, does not fit a klg file", frame.index,
                       frame.time_s);
    }
    const auto time_us = static_cast<std::int64_t>(std::llround(frame.time_s * 1e6));
    const std::string name = fmt::format("frame {}", frame.index);
    if (count_ > 0 && time_us <= last_us_) {
      return DataError("{}: its time, {} us, is not after that of the frame before", name, time_us);
    }
    last_us_ = time_us;
    const cv::Mat units = DepthToUnits(frame.depth, kMillimetreUnits, 65535, loss_);
    const std::string raw = BytesOf(units);
    std::string depth = Deflate(raw);
    // Readers take this very length for raw depth.
    if (depth.size() >= raw.size()) depth = raw;
    const std::string colour = BytesOf(frame.colour);
    Put(time_us);
    Put(static_cast<std::int32_t>(depth.size()));
    Put(static_cast<std::int32_t>(colour.size()));
    out_.write(depth.data(), static_cast<std::streamsize>(depth.size()));
    out_.write(colour.data(), static_cast<std::streamsize>(colour.size()));
    if (!out_) return EnvironmentError("{}: cannot be written", (folder_ / kRecording).string());
    if (!frame.mask.empty()) {
      TSDFPP_RETURN_IF_ERROR(WriteEncoded(folder_ / fmt::format("mask/{:06d}.png", count_),
                                          EncodePng(frame.mask, name)));
    }
    poses_ +=
        fmt::format("{}.{:06d} {}\n", time_us / 1000000, time_us % 1000000, PoseToText(frame.T_WC));
    ++count_;
    return {};
  }

  Expected<void> Finish(ExportReport&) override {
    out_.close();
    if (!out_) return EnvironmentError("{}: cannot be written", (folder_ / kRecording).string());
    TSDFPP_RETURN_IF_ERROR(
        WriteFile(folder_ / "groundtruth.txt", "# t tx ty tz qx qy qz qw\n" + poses_));
    return WriteFile(folder_ / "calibration.txt", CalibrationToText(info_.intrinsics));
  }

 private:
  static constexpr const char* kRecording = "sequence.klg";

  template <typename T>
  void Put(T value) {
    out_.write(reinterpret_cast<const char*>(&value), sizeof(T));
  }

  static std::string BytesOf(const cv::Mat& image) {
    const auto row_bytes = static_cast<std::size_t>(image.cols) * image.elemSize();
    std::string bytes;
    for (int y = 0; y < image.rows; ++y) {
      bytes.append(reinterpret_cast<const char*>(image.ptr(y)), row_bytes);
    }
    return bytes;
  }

  SequenceInfo info_;
  std::filesystem::path folder_;
  std::ofstream out_;
  int count_ = 0;
  std::int64_t last_us_ = 0;
  std::string poses_;
};

}  // namespace

std::unique_ptr<DatasetWriter> MakeKlgWriter(const SequenceInfo& info,
                                             std::filesystem::path folder) {
  return std::make_unique<KlgWriter>(info, std::move(folder));
}

}  // namespace tsdfpp
