#include "sequence/file_source.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>

#include "core/limits.h"
#include "core/plain_name.h"
#include "sequence/image_files.h"
#include "sequence/integer_images.h"
#include "sequence/plausibility.h"
#include "sequence/resample.h"
#include "sequence/text_lines.h"

namespace tsdfpp {
namespace fs = std::filesystem;
namespace {

class FileSource : public DatasetSource {
 public:
  FileSource(FileSequence sequence, SequenceInfo info)
      : sequence_(std::move(sequence)), info_(std::move(info)) {}

  const SequenceInfo& info() const override { return info_; }

  std::vector<Pose> CameraPoses() const override {
    std::vector<Pose> poses;
    for (const FrameFiles& frame : sequence_.frames) poses.push_back(frame.T_WC);
    return poses;
  }

  std::optional<double> DepthUnitsPerMetre() const override {
    const double units = sequence_.frames.front().depth_units_per_m;
    for (const FrameFiles& frame : sequence_.frames) {
      if (frame.depth_units_per_m != units) return std::nullopt;
    }
    return units;
  }

  Expected<Frame> Read(int index) override {
    const int last = info_.first_index + info_.frame_count - 1;
    if (index < info_.first_index || index > last) {
      return UsageError("frame {} is out of range, {} has frames {} to {}", index, info_.name,
                        info_.first_index, last);
    }
    const FrameFiles& files = sequence_.frames[static_cast<std::size_t>(index - info_.first_index)];
    Frame frame;
    frame.index = index;
    frame.time_s = files.time_s - sequence_.frames.front().time_s;
    frame.intrinsics = files.camera;
    const cv::Size size(files.camera.width, files.camera.height);
    cv::Size colour_size = size;
    if (const auto& camera = sequence_.colour_camera) {
      colour_size = cv::Size(camera->width, camera->height);
    }
    TSDFPP_ASSIGN(frame.depth, ReadIntegerDepth(files.depth, size, sequence_.size_source,
                                                files.depth_units_per_m, sequence_.no_depth));
    TSDFPP_ASSIGN(frame.colour, ReadColour(files.colour, colour_size, sequence_.size_source));
    if (!files.ids.empty()) {
      TSDFPP_ASSIGN(frame.mask, ReadIds(files.ids, {}, sequence_.size_source));
      TSDFPP_RETURN_IF_ERROR(CheckImageSize(frame.mask, frame.colour.size(), sequence_.size_source,
                                            files.ids.string()));
    } else if (sequence_.has_masks) {
      TSDFPP_ASSIGN(frame.mask, Paint(files, size));
    }
    if (const auto& camera = sequence_.colour_camera) {
      Intrinsics colour = *camera;
      colour.width = frame.colour.cols;
      colour.height = frame.colour.rows;
      TSDFPP_RETURN_IF_ERROR(CheckCamera(colour, files.colour.string()));
      frame.colour = SampleColour(frame.colour, colour, files.camera);
      if (!frame.mask.empty()) frame.mask = SampleIds(frame.mask, colour, files.camera);
    }
    frame.T_WC = files.T_WC;
    frame.T_WO = files.T_WO;
    return frame;
  }

  bool HasTruth() const override { return sequence_.has_truth; }
  Expected<std::vector<TrueModel>> Truth() override {
    if (sequence_.truth) return sequence_.truth(info_);
    return DataError(
        "{}: a {} sequence has no true surfaces; it can be mapped but not compared with truth",
        info_.name, DatasetFormatName(sequence_.format));
  }

 private:
  Expected<cv::Mat> Paint(const FrameFiles& files, cv::Size size) const {
    cv::Mat ids = cv::Mat::zeros(size, CV_16UC1);
    for (const auto& [path, id] : files.masks) {
      TSDFPP_ASSIGN(const cv::Mat mask, ReadIds(path, size, sequence_.size_source));
      ids.setTo(cv::Scalar(id), mask != 0);
    }
    return ids;
  }

  FileSequence sequence_;
  SequenceInfo info_;
};

// The ids of all id images. One that cannot be used is Read()'s to report.
std::vector<InstanceId> IdsIn(const FileSequence& sequence) {
  std::vector<bool> seen(static_cast<std::size_t>(kNoInstance) + 1);
  for (const FrameFiles& frame : sequence.frames) {
    if (frame.ids.empty()) continue;
    const auto ids = ReadIds(frame.ids, {}, "");
    if (!ids) continue;
    for (const InstanceId id : cv::Mat_<InstanceId>(*ids)) seen[id] = true;
  }
  std::vector<InstanceId> ids;
  for (InstanceId id = 1; id < kNoInstance; ++id) {
    if (seen[id]) ids.push_back(id);
  }
  return ids;
}

Expected<void> SetSizes(FileSequence& sequence) {
  const bool known = std::all_of(sequence.frames.begin(), sequence.frames.end(),
                                 [](const FrameFiles& frame) { return frame.camera.width > 0; });
  if (known) return {};
  const fs::path& first = sequence.frames.front().depth;
  TSDFPP_ASSIGN(const cv::Mat depth, ReadImage(first));
  for (FrameFiles& frame : sequence.frames) {
    frame.camera.width = depth.cols;
    frame.camera.height = depth.rows;
  }
  sequence.size_source = "as " + first.filename().string();
  return {};
}

// A camera that was asked for is that of the whole frame: colours that are another camera's on disk
// are then taken as they are, which they can be where both images have one size.
Expected<void> UseOneCamera(FileSequence& sequence) {
  const FrameFiles& first = sequence.frames.front();
  TSDFPP_ASSIGN(const cv::Mat colour, ReadColour(first.colour, {}));
  if (colour.cols != first.camera.width || colour.rows != first.camera.height) {
    return UsageError(
        "{}: a camera was given for depth images of {}x{}, but {} is {}x{}, of a camera of its "
        "own: expected the cameras on disk, or colours of the depth images' size",
        sequence.name, first.camera.width, first.camera.height, first.colour.string(), colour.cols,
        colour.rows);
  }
  sequence.colour_camera.reset();
  return {};
}

}  // namespace

double RateOf(const std::vector<double>& times_s) {
  std::vector<double> steps;
  for (std::size_t i = 1; i < times_s.size(); ++i) {
    if (times_s[i] > times_s[i - 1]) steps.push_back(times_s[i] - times_s[i - 1]);
  }
  if (steps.empty()) return kUsualRate_hz;
  const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  const double rate_hz = 1 / *middle;
  return std::isfinite(rate_hz) ? rate_hz : kUsualRate_hz;
}

Pose MirroredInY(const Pose& T_WC) {
  const Eigen::DiagonalMatrix<double, 3> mirror(1, -1, 1);
  Pose mirrored = Pose::Identity();
  mirrored.linear() = mirror * T_WC.linear() * mirror;
  mirrored.translation() = mirror * T_WC.translation();
  return mirrored;
}

std::vector<ObjectInfo> NamedByIds(const std::vector<InstanceId>& ids) {
  std::vector<ObjectInfo> objects;
  objects.reserve(ids.size());
  for (const InstanceId id : ids) objects.push_back({id, fmt::format("object{}", id), ""});
  return objects;
}

Expected<std::vector<fs::path>> FindMasks(const fs::path& folder,
                                          const std::vector<std::string>& stems,
                                          SequenceNotes& notes) {
  constexpr std::array kNames{"mask", "masks"};
  std::set<std::string> filled;
  for (const char* name : kNames) {
    TSDFPP_ASSIGN(const auto there, NamesIn(folder / name));
    if (!there.empty()) filled.insert(name);
  }
  if (filled.size() == kNames.size()) {
    return DataError("{}: holds both {}/ and {}/, expected one", folder.string(), kNames[0],
                     kNames[1]);
  }
  std::map<std::string, std::size_t> frame_of;
  for (std::size_t i = 0; i < stems.size() && !filled.empty(); ++i) {
    const auto [other, is_new] = frame_of.emplace(stems[i], i);
    if (is_new) continue;
    return DataError("{}: frames {} and {} have colour images of one name, '{}', and so one mask",
                     folder.string(), other->second, i, stems[i]);
  }
  for (const std::string& name : filled) {
    std::vector<fs::path> masks;
    for (const std::string& stem : stems) {
      masks.push_back(folder / name / (stem + ".png"));
      std::error_code code;
      if (!fs::exists(masks.back(), code)) {
        return DataError("{}: no such mask, though {}/ is there; expected one for every frame",
                         masks.back().string(), name);
      }
    }
    return masks;
  }
  TSDFPP_ASSIGN(const auto names, NamesIn(folder));
  for (const std::string& name : names) {
    std::error_code code;
    const bool is_mask = name.find("mask") != name.npos || name.find("label") != name.npos ||
                         name.find("seg") != name.npos || name.find("instance") != name.npos;
    if (is_mask && fs::is_directory(folder / name, code)) {
      notes.push_back(
          fmt::format("{}: looks like masks and is not read, expected mask/<frame>.png of ids",
                      (folder / name).string()));
    }
  }
  return std::vector<fs::path>{};
}

Expected<std::unique_ptr<DatasetSource>> MakeFileSource(FileSequence sequence,
                                                        const SequenceOptions& options,
                                                        SequenceNotes& notes) {
  auto& frames = sequence.frames;
  if (frames.empty()) return DataError("{}: no frames", sequence.name);
  TSDFPP_RETURN_IF_ERROR(CheckLimit(&Limits::frames, static_cast<std::int64_t>(frames.size()),
                                    sequence.name, "frames"));
  // Names sort otherwise where their numbers have no leading zeros.
  std::stable_sort(frames.begin(), frames.end(),
                   [](const FrameFiles& a, const FrameFiles& b) { return a.number < b.number; });
  for (FrameFiles& frame : frames) {
    if (options.intrinsics) frame.camera = *options.intrinsics;
    if (options.depth_units_per_m) frame.depth_units_per_m = *options.depth_units_per_m;
    if (frame.camera.fy >= 0) continue;
    if (!frame.T_WO.empty()) {
      return UsageError("{}: a negative fy does not fit objects with poses", sequence.name);
    }
    frame.camera.fy = -frame.camera.fy;
    frame.T_WC = MirroredInY(frame.T_WC);
  }
  if (options.intrinsics && options.intrinsics->width > 0)
    sequence.size_source = "as was asked for";
  TSDFPP_RETURN_IF_ERROR(SetSizes(sequence));
  if (options.intrinsics && sequence.colour_camera) {
    TSDFPP_RETURN_IF_ERROR(UseOneCamera(sequence));
  }
  for (const FrameFiles& frame : frames) {
    TSDFPP_RETURN_IF_ERROR(
        CheckCamera(frame.camera, fmt::format("{}, frame {}", sequence.name, frame.number)));
  }

  const auto twice = std::adjacent_find(
      frames.begin(), frames.end(),
      [](const FrameFiles& a, const FrameFiles& b) { return a.number == b.number; });
  if (twice != frames.end()) {
    return DataError("{}: {} and {} are both of frame {}", sequence.name, twice->depth.string(),
                     std::next(twice)->depth.string(), twice->number);
  }

  SequenceInfo info;
  info.name = sequence.name;
  info.intrinsics = frames.front().camera;
  constexpr int kGreatestNumber = 1000000000;  // what users of the numbers can add to
  const bool gapless =
      frames.back().number <= kGreatestNumber &&
      frames.back().number - frames.front().number == static_cast<int>(frames.size()) - 1;
  info.first_index = gapless ? frames.front().number : 0;
  if (!gapless) {
    notes.push_back(fmt::format("{}: frame numbers {} to {} have gaps, the {} frames are 0 to {}",
                                sequence.name, frames.front().number, frames.back().number,
                                frames.size(), frames.size() - 1));
  }
  info.frame_count = static_cast<int>(frames.size());
  std::vector<double> times;
  times.reserve(frames.size());
  for (const FrameFiles& frame : frames) times.push_back(frame.time_s);
  info.rate_hz = sequence.rate_hz > 0 ? sequence.rate_hz : RateOf(times);
  info.has_object_poses = std::any_of(frames.begin(), frames.end(),
                                      [](const FrameFiles& frame) { return !frame.T_WO.empty(); });
  if (sequence.objects.empty()) sequence.objects = NamedByIds(IdsIn(sequence));
  info.objects.push_back({kBackground, "background", "background"});
  for (const ObjectInfo& object : sequence.objects) info.objects.push_back(object);
  TSDFPP_RETURN_IF_ERROR(CheckObjects(info.objects, sequence.name));
  if (!sequence.has_masks) notes.push_back(fmt::format("{}: no masks", sequence.name));
  return std::make_unique<FileSource>(std::move(sequence), std::move(info));
}

}  // namespace tsdfpp
