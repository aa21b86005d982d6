#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <fstream>
#include <set>

#include "core/data_folder.h"
#include "core/files.h"
#include "core/folders.h"
#include "core/limits.h"
#include "core/one_line.h"
#include "core/plain_name.h"
#include "sequence/calibration.h"
#include "sequence/dataset_readers.h"
#include "sequence/image_files.h"
#include "sequence/integer_images.h"
#include "sequence/klg_layout.h"
#include "sequence/plausibility.h"
#include "sequence/text_lines.h"
#include "sequence/timed_poses.h"

namespace tsdfpp {
namespace fs = std::filesystem;
namespace {

constexpr double kKlgUnitsPerMetre = 1000;
// ElasticFusion's and Co-Fusion's default.
constexpr Intrinsics kKlgDefault{640, 480, 528, 528, 320, 240};

class KlgSource : public DatasetSource {
 public:
  Expected<void> Open(const fs::path& file, const SequenceOptions& options, SequenceNotes& notes) {
    file_ = file;
    TSDFPP_RETURN_IF_ERROR(CheckRegularFile(file));
    in_.open(file, std::ios::binary);
    TSDFPP_ASSIGN(KlgIndex index, ReadKlgIndex(file));
    TSDFPP_RETURN_IF_ERROR(CheckLimit(
        &Limits::frames, static_cast<std::int64_t>(index.entries.size()), file.string(), "frames"));
    if (index.bytes_after > 0) {
      notes.push_back(fmt::format("{}: {} bytes follow the last of its {} frames", file.string(),
                                  index.bytes_after, index.entries.size()));
    }
    const fs::path folder = AbsolutePath(file).parent_path();
    TSDFPP_RETURN_IF_ERROR(CheckBeside(folder));
    TSDFPP_RETURN_IF_ERROR(SetCamera(folder, options, notes));
    TSDFPP_RETURN_IF_ERROR(SetPoses(folder, index, options, notes));
    if (entries_.empty()) {
      return DataError("{}: no frame of {} is within its times",
                       (folder / "groundtruth.txt").string(), file.filename().string());
    }
    info_.name = OneLine(file.stem().string(), kMostNameBytes);
    info_.first_index = 0;
    info_.frame_count = static_cast<int>(entries_.size());
    std::vector<double> times;
    for (const KlgEntry& entry : entries_) times.push_back(Seconds(entry));
    info_.rate_hz = RateOf(times);
    std::vector<std::string> stems;
    for (const int number : numbers_) stems.push_back(fmt::format("{:06d}", number));
    TSDFPP_ASSIGN(masks_, FindMasks(folder, stems, notes));
    if (masks_.empty()) notes.push_back(fmt::format("{}: no masks", info_.name));
    info_.has_object_poses = false;
    info_.objects = {{kBackground, "background", "background"}};
    for (ObjectInfo& object : NamedByIds(Ids())) info_.objects.push_back(std::move(object));
    return {};
  }

  const SequenceInfo& info() const override { return info_; }
  std::vector<Pose> CameraPoses() const override { return T_WC_; }
  std::optional<double> DepthUnitsPerMetre() const override { return units_per_m_; }

  Expected<Frame> Read(int index) override {
    if (index < 0 || index >= info_.frame_count) {
      return UsageError("frame {} is out of range, {} has frames 0 to {}", index, info_.name,
                        info_.frame_count - 1);
    }
    const auto i = static_cast<std::size_t>(index);
    const KlgEntry& entry = entries_[i];
    const cv::Size size(info_.intrinsics.width, info_.intrinsics.height);
    const auto pixels =
        static_cast<std::size_t>(size.width) * static_cast<std::size_t>(size.height);
    const std::string name = fmt::format("{}, frame {}", file_.string(), numbers_[i]);
    std::string depth(entry.depth_bytes, '\0');
    std::string colour(entry.colour_bytes, '\0');
    in_.clear();
    in_.seekg(static_cast<std::streamoff>(entry.depth_offset));
    if (!in_.read(depth.data(), static_cast<std::streamsize>(depth.size())) ||
        !in_.read(colour.data(), static_cast<std::streamsize>(colour.size()))) {
      return DataError("{}: cannot be read", name);
    }
    if (depth.size() != 2 * pixels) {
      TSDFPP_ASSIGN(depth, Inflate(depth, 2 * pixels, name + ": the depth"));
    }
    Frame frame;
    frame.index = index;
    frame.time_s = Seconds(entry) - Seconds(entries_.front());
    frame.intrinsics = info_.intrinsics;
    cv::Mat units(size, CV_16UC1);
    std::memcpy(units.data, depth.data(), depth.size());
    frame.depth = DepthFromUnits(units, units_per_m_);
    if (colour.size() == 3 * pixels) {
      frame.colour.create(size, CV_8UC3);
      std::memcpy(frame.colour.data, colour.data(), colour.size());
    } else {
      TSDFPP_ASSIGN(frame.colour, DecodeColour(colour, name + ": the colour"));
      // Logger2 gives red for blue to its encoder, and whoever reads its recordings turns them.
      const cv::Mat turned = frame.colour.clone();
      const std::array<int, 6> from_to{0, 2, 1, 1, 2, 0};
      cv::mixChannels(&turned, 1, &frame.colour, 1, from_to.data(), 3);
      TSDFPP_RETURN_IF_ERROR(
          CheckImageSize(frame.colour, size, size_source_, name + ": the colour"));
    }
    if (!masks_.empty()) {
      TSDFPP_ASSIGN(frame.mask, ReadIds(masks_[i], size, size_source_));
    }
    frame.T_WC = T_WC_[i];
    return frame;
  }

  bool HasTruth() const override { return false; }
  Expected<std::vector<TrueModel>> Truth() override {
    return DataError(
        "{}: a klg sequence has no true surfaces; it can be mapped but not compared with truth",
        info_.name);
  }

 private:
  // Of what lies beside the recording only what is read may not lead out of the folder: it may be
  // one of many things.
  static Expected<void> CheckBeside(const fs::path& folder) {
    const DataFolder data(folder);
    for (const char* name : {"calibration.txt", "groundtruth.txt", "mask", "masks"}) {
      TSDFPP_ASSIGN(const fs::path beside, data.Find(name));
      std::error_code code;
      if (fs::is_directory(beside, code)) TSDFPP_RETURN_IF_ERROR(CheckLinksBelow(beside));
    }
    return {};
  }

  static double Seconds(const KlgEntry& entry) { return static_cast<double>(entry.time_us) / 1e6; }

  Expected<void> SetCamera(const fs::path& folder, const SequenceOptions& options,
                           SequenceNotes& notes) {
    std::error_code code;
    Intrinsics camera = kKlgDefault;
    size_source_ = "klg's default camera";
    if (options.intrinsics) {
      camera = *options.intrinsics;
      size_source_ = "as was asked for";
    } else if (fs::exists(folder / "calibration.txt", code)) {
      TSDFPP_ASSIGN(camera, ReadCalibration(folder / "calibration.txt"));
      size_source_ = "calibration.txt";
      if (camera.width == 0) {
        size_source_ = "klg's default size";
        notes.push_back(fmt::format("{}: calibration.txt has no width and height, {}x{} is taken",
                                    file_.string(), kKlgDefault.width, kKlgDefault.height));
      }
    } else {
      notes.push_back(fmt::format(
          "{}: no calibration.txt beside it, 528 528 320 240 at 640x480 is taken", file_.string()));
    }
    if (camera.width == 0) {
      camera.width = kKlgDefault.width;
      camera.height = kKlgDefault.height;
    }
    mirrored_ = camera.fy < 0;
    camera.fy = std::abs(camera.fy);
    units_per_m_ = options.depth_units_per_m.value_or(kKlgUnitsPerMetre);
    info_.intrinsics = camera;
    // Images have no headers here: their size is the camera's.
    TSDFPP_RETURN_IF_ERROR(CheckLimit(&Limits::image_side, std::max(camera.width, camera.height),
                                      file_.string(), "pixels along a side of the image"));
    TSDFPP_RETURN_IF_ERROR(CheckLimit(&Limits::image_pixels,
                                      std::int64_t{camera.width} * camera.height, file_.string(),
                                      "pixels in the image"));
    return CheckCamera(camera, file_.string());
  }

  Expected<void> SetPoses(const fs::path& folder, const KlgIndex& index,
                          const SequenceOptions& options, SequenceNotes& notes) {
    const fs::path file = folder / "groundtruth.txt";
    std::error_code code;
    const bool known = fs::exists(file, code);
    TSDFPP_RETURN_IF_ERROR(RemarkOnPoseOffset(file, options.pose_offset_s, notes));
    if (known && options.fixed_camera) {
      return FixedCameraWithPoses(file);
    }
    if (!known && !options.fixed_camera) {
      return DataError(
          "{}: a .klg holds no camera poses, expected groundtruth.txt (t tx ty tz qx qy qz qw) "
          "beside it, or leave to take the camera as fixed",
          file_.string());
    }
    TimedPoses poses;
    if (known) {
      TSDFPP_ASSIGN(poses, ReadTimedPoses(file, &notes));
    }
    for (std::size_t i = 0; i < index.entries.size(); ++i) {
      Pose T_WC = Pose::Identity();
      if (known) {
        const auto pose = PoseAt(poses, Seconds(index.entries[i]) + options.pose_offset_s);
        if (!pose) continue;
        T_WC = mirrored_ ? MirroredInY(*pose) : *pose;
      }
      numbers_.push_back(static_cast<int>(i));
      entries_.push_back(index.entries[i]);
      T_WC_.push_back(T_WC);
    }
    if (entries_.size() < index.entries.size()) {
      notes.push_back(
          fmt::format("{}: {} of {} frames have no camera pose near their time and are left out",
                      file.string(), index.entries.size() - entries_.size(), index.entries.size()));
    }
    return {};
  }

  // A mask that cannot be used is Read()'s to report.
  std::vector<InstanceId> Ids() const {
    std::set<InstanceId> ids;
    for (const fs::path& path : masks_) {
      const auto mask = ReadIds(path, {}, "");
      if (!mask) continue;
      for (const InstanceId id : cv::Mat_<InstanceId>(*mask)) ids.insert(id);
    }
    ids.erase(kBackground);
    ids.erase(kNoInstance);
    return {ids.begin(), ids.end()};
  }

  fs::path file_;
  std::ifstream in_;
  SequenceInfo info_;
  std::string size_source_;
  double units_per_m_ = kKlgUnitsPerMetre;
  bool mirrored_ = false;
  std::vector<int> numbers_;  // of the frames in the file
  std::vector<KlgEntry> entries_;
  std::vector<Pose> T_WC_;
  std::vector<fs::path> masks_;
};

}  // namespace

Expected<std::unique_ptr<DatasetSource>> OpenKlg(const fs::path& path,
                                                 const SequenceOptions& options,
                                                 SequenceNotes& notes) {
  std::error_code code;
  fs::path file = path;
  if (fs::is_directory(path, code)) {
    std::vector<std::string> recordings;
    TSDFPP_ASSIGN(const auto names, NamesIn(path));
    for (const std::string& name : names) {
      if (name.ends_with(".klg")) recordings.push_back(name);
    }
    if (recordings.size() != 1) {
      return DataError("{}: {} .klg files in it, expected one, or the path of one", path.string(),
                       recordings.size());
    }
    file = path / recordings.front();
  }
  auto source = std::make_unique<KlgSource>();
  TSDFPP_RETURN_IF_ERROR(source->Open(file, options, notes));
  return source;
}

}  // namespace tsdfpp
