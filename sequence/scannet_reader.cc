#include <algorithm>
#include <cmath>

#include "sequence/dataset_readers.h"
#include "sequence/pose_matrix.h"
#include "sequence/text_lines.h"

namespace tsdfpp {
namespace fs = std::filesystem;
namespace {

constexpr Intrinsics kScannetDefault{640, 480, 577.870605, 577.870605, 319.5, 239.5};

// ScanNet marks frames that its reconstruction lost with infinite poses.
Expected<std::optional<Pose>> ReadPoseOrNone(const fs::path& path) {
  TSDFPP_ASSIGN(const std::vector<double> numbers, ReadNumbers(path));
  if (std::any_of(numbers.begin(), numbers.end(), [](double n) { return !std::isfinite(n); })) {
    return std::nullopt;
  }
  TSDFPP_ASSIGN(const Pose pose, PoseFromNumbers(numbers, path.string()));
  return pose;
}

// The image "<stem>" with the first of the extensions that is there.
fs::path ImageOf(const fs::path& folder, const std::string& stem) {
  std::error_code code;
  const fs::path png = folder / (stem + ".png");
  return fs::exists(png, code) ? png : folder / (stem + ".jpg");
}

}  // namespace

Expected<std::unique_ptr<DatasetSource>> OpenScannet(const fs::path& folder,
                                                     const SequenceOptions& options,
                                                     SequenceNotes& notes) {
  FileSequence sequence;
  sequence.format = DatasetFormat::kScannet;
  sequence.name = NameOfFolder(folder);
  sequence.rate_hz = kUsualRate_hz;
  std::error_code code;
  Intrinsics camera = kScannetDefault;
  sequence.size_source = "ScanNet's default camera";
  const fs::path depth_camera = folder / "intrinsic/intrinsic_depth.txt";
  const fs::path colour_camera = folder / "intrinsic/intrinsic_color.txt";
  if (fs::exists(depth_camera, code)) {
    TSDFPP_ASSIGN(camera, ReadIntrinsicMatrix(depth_camera));
    if (fs::exists(colour_camera, code)) {
      TSDFPP_ASSIGN(sequence.colour_camera, ReadIntrinsicMatrix(colour_camera));
    }
  } else if (!options.intrinsics) {
    notes.push_back(
        fmt::format("{}: no intrinsic/intrinsic_depth.txt, 577.870605 577.870605 319.5 239.5 is "
                    "taken",
                    sequence.name));
  }
  std::vector<std::pair<int, std::string>> stems;  // sorted by number, not by name
  TSDFPP_ASSIGN(const auto names, NamesIn(folder / "depth"));
  for (const std::string& name : names) {
    const std::string stem = fs::path(name).stem().string();
    const auto number = ParseWholeNumber(stem);
    if (number && name.ends_with(".png")) stems.emplace_back(*number, stem);
  }
  std::sort(stems.begin(), stems.end());
  if (stems.empty())
    return DataError("{}: no image named 0.png or so", (folder / "depth").string());

  const bool has_ids = fs::is_directory(folder / "instance-filt", code);
  int lost = 0;
  for (const auto& [number, stem] : stems) {
    FrameFiles frame;
    TSDFPP_ASSIGN(const auto pose, ReadPoseOrNone(folder / "pose" / (stem + ".txt")));
    if (!pose) {
      ++lost;
      continue;
    }
    frame.T_WC = *pose;
    frame.number = number;
    frame.time_s = number / kUsualRate_hz;
    frame.depth = folder / "depth" / (stem + ".png");
    frame.colour = ImageOf(folder / "color", stem);
    if (has_ids) {
      frame.ids = folder / "instance-filt" / (stem + ".png");
      if (!fs::exists(frame.ids, code)) {
        return DataError(
            "{}: no such mask, though instance-filt/ is there; expected one for every "
            "frame",
            frame.ids.string());
      }
    }
    frame.camera = camera;
    sequence.frames.push_back(std::move(frame));
  }
  sequence.has_masks = has_ids;
  if (sequence.frames.empty()) {
    return DataError("{}: the poses of all {} frames are infinite", (folder / "pose").string(),
                     stems.size());
  }
  if (lost > 0) {
    notes.push_back(fmt::format("{}: {} of {} frames have infinite poses and are left out",
                                (folder / "pose").string(), lost, stems.size()));
  }
  return MakeFileSource(std::move(sequence), options, notes);
}

}  // namespace tsdfpp
