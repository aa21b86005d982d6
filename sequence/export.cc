#include "sequence/export.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "core/files.h"
#include "sequence/dataset_writers.h"
#include "sequence/file_source.h"
#include "sequence/image_files.h"
#include "sequence/staging_folder.h"

namespace tsdfpp {
namespace {

Expected<std::unique_ptr<DatasetWriter>> MakeWriter(DatasetFormat format, const SequenceInfo& info,
                                                    const std::filesystem::path& folder,
                                                    std::vector<TrueModel> models) {
  switch (format) {
    case DatasetFormat::kTum:
      return MakeTumWriter(info, folder);
    case DatasetFormat::kBop:
      return MakeBopWriter(info, folder, std::move(models));
    case DatasetFormat::kKlg:
      return MakeKlgWriter(info, folder);
    case DatasetFormat::kSevenScenes:
      return MakeSevenScenesWriter(info, folder);
    default:
      return UsageError("export to {} is not known, expected tum, bop, klg or 7scenes",
                        DatasetFormatName(format));
  }
}

Expected<void> CheckFrame(const Frame& frame, const SequenceInfo& info, DatasetFormat format,
                          bool with_mask) {
  // BOP alone has a camera for each image.
  if (frame.intrinsics != info.intrinsics && format != DatasetFormat::kBop) {
    return DataError("frame {}: the intrinsics differ from the sequence's, {} has one camera",
                     frame.index, DatasetFormatName(format));
  }
  if (frame.mask.empty() == with_mask) {
    return DataError("frame {}: expected a mask on every frame or on none", frame.index);
  }
  const cv::Size size(frame.intrinsics.width, frame.intrinsics.height);
  const std::string name = fmt::format("frame {}", frame.index);
  for (const cv::Mat* image : {&frame.colour, &frame.depth, &frame.mask}) {
    if (image == &frame.mask && !with_mask) continue;
    TSDFPP_RETURN_IF_ERROR(CheckImageSize(*image, size, "as its intrinsics say", name));
  }
  if (frame.colour.type() != CV_8UC3 || frame.depth.type() != CV_32FC1 ||
      (with_mask && frame.mask.type() != CV_16UC1)) {
    return DataError("{}: images of other types than a frame's", name);
  }
  return {};
}

void SayWhatIsLost(const SequenceInfo& info, DatasetFormat format, bool has_models, bool has_poses,
                   bool with_mask, double off_s, const DepthLoss& loss, double units_per_m,
                   ExportReport& report) {
  auto& left_out = report.left_out;
  if (format != DatasetFormat::kBop) {
    if (info.objects.size() > 1) left_out.emplace_back("names and classes of objects");
    if (has_poses) left_out.emplace_back("poses of objects");
    if (has_models) left_out.emplace_back("true surfaces");
    if (with_mask && !info.mask_ids_are_objects) {
      left_out.emplace_back(
          "that the masks' ids are of one frame alone: it is to be mapped with --associate votes");
    }
  }
  if (info.reveal) left_out.emplace_back("the reveal plan");
  const bool timed = format == DatasetFormat::kTum || format == DatasetFormat::kKlg;
  constexpr double kRate_hz = 30;
  constexpr double kRateTolerance_hz = 1e-6;
  if (!timed && std::abs(info.rate_hz - kRate_hz) > kRateTolerance_hz) {
    left_out.push_back(fmt::format("times: {:g} frames a second, 30 are taken", info.rate_hz));
  } else if (constexpr double kMost_s = 1e-3; !timed && off_s > kMost_s) {
    left_out.push_back(
        fmt::format("times: 30 frames a second are taken, up to {:.3g} s off", off_s));
  }
  if (timed && info.first_index != 0) {
    left_out.push_back(fmt::format("frame numbers: the first is 0, not {}", info.first_index));
  }
  if (loss.too_far > 0) {
    left_out.push_back(fmt::format("depth of {} pixels over {:.2f} m, written as invalid",
                                   loss.too_far, 65535 / units_per_m));
  }
  if (loss.too_near > 0) {
    left_out.push_back(fmt::format("depth of {} pixels under {:g} m, written as invalid",
                                   loss.too_near, 0.5 / units_per_m));
  }
}

}  // namespace

Expected<void> WriteEncoded(const std::filesystem::path& path, const Expected<std::string>& bytes) {
  if (!bytes) return tl::unexpected(bytes.error());
  return WriteFile(path, *bytes);
}

Expected<ExportReport> ExportSequence(FrameSource& source, DatasetFormat format,
                                      const std::filesystem::path& out,
                                      const std::function<void(int, int)>& progress,
                                      const std::atomic<bool>* stop) {
  const SequenceInfo& info = source.info();
  std::vector<TrueModel> truth;
  if (source.HasTruth()) {
    TSDFPP_ASSIGN(truth, source.Truth());
  }
  const bool has_models = !truth.empty();
  TSDFPP_RETURN_IF_ERROR(CheckReplaceable(out, false));
  StagingFolder staging(out);
  TSDFPP_ASSIGN(const auto writer, MakeWriter(format, info, staging.path(), std::move(truth)));
  TSDFPP_RETURN_IF_ERROR(staging.Make());
  bool with_mask = false;
  bool has_poses = false;
  double first_s = 0;
  double off_s = 0;  // from thirty frames a second
  for (int i = 0; i < info.frame_count; ++i) {
    TSDFPP_ASSIGN(Frame frame, source.Read(info.first_index + i));
    if (source.IsSensed() && format == DatasetFormat::kBop) {
      // Its masks and poses are annotations.
      TSDFPP_ASSIGN(const Frame true_frame, source.ReadTrue(frame.index));
      frame.mask = true_frame.mask;
      frame.T_WC = true_frame.T_WC;
    }
    if (stop != nullptr && *stop) {
      return EnvironmentError("{}: stopped after {} of {} frames; nothing is kept", out.string(), i,
                              info.frame_count);
    }
    if (i == 0) with_mask = !frame.mask.empty();
    if (i == 0) first_s = frame.time_s;
    has_poses |= !frame.T_WO.empty();
    off_s = std::max(off_s, std::abs(frame.time_s - first_s - i / kUsualRate_hz));
    TSDFPP_RETURN_IF_ERROR(CheckFrame(frame, info, format, with_mask));
    TSDFPP_RETURN_IF_ERROR(writer->Add(frame));
    if (progress) progress(i + 1, info.frame_count);
  }
  ExportReport report;
  report.frames = info.frame_count;
  report.depth_bound_m = 0.5 / writer->depth_units_per_m();
  TSDFPP_RETURN_IF_ERROR(writer->Finish(report));
  SayWhatIsLost(info, format, has_models, has_poses, with_mask, off_s, writer->loss(),
                writer->depth_units_per_m(), report);
  if (source.IsSensed()) {
    report.left_out.emplace_back(
        format == DatasetFormat::kBop
            ? "the masks and camera poses that the sensor gave: BOP's are the true ones"
            : "the truth: depth, masks and camera poses are those that the sensor gave");
  }
  TSDFPP_RETURN_IF_ERROR(CheckReplaceable(out, false));
  TSDFPP_RETURN_IF_ERROR(staging.TakeThePlace());
  return report;
}

}  // namespace tsdfpp
