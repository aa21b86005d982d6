#include <algorithm>
#include <cmath>
#include <set>

#include "sequence/dataset_readers.h"
#include "sequence/image_files.h"
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

// The depth images' numbers and names, by number.
Expected<std::vector<std::pair<int, std::string>>> DepthStems(const fs::path& folder) {
  std::vector<std::pair<int, std::string>> stems;
  TSDFPP_ASSIGN(const auto names, NamesIn(folder));
  for (const std::string& name : names) {
    const std::string stem = fs::path(name).stem().string();
    const auto number = ParseWholeNumber(stem);
    if (number && name.ends_with(".png")) stems.emplace_back(*number, stem);
  }
  std::sort(stems.begin(), stems.end());
  if (stems.empty()) return DataError("{}: no image named 0.png or so", folder.string());
  return stems;
}

// Colour images without a depth image, which has the same number, are left out.
Expected<void> CountColoursWithoutDepth(const fs::path& folder,
                                        const std::vector<std::pair<int, std::string>>& depths,
                                        SequenceNotes& notes) {
  std::set<std::string> stems;
  for (const auto& [number, stem] : depths) stems.insert(stem);
  TSDFPP_ASSIGN(const auto names, NamesIn(folder));
  int colours = 0;
  int lost = 0;
  for (const std::string& name : names) {
    const std::string stem = fs::path(name).stem().string();
    if (!ParseWholeNumber(stem) || !(name.ends_with(".jpg") || name.ends_with(".png"))) continue;
    ++colours;
    lost += stems.contains(stem) ? 0 : 1;
  }
  SayColoursWithoutDepth(folder, lost, colours, notes);
  return {};
}

// The depth camera, ScanNet's own where none is written; the colour camera goes into `sequence`.
Expected<Intrinsics> ReadCameras(const fs::path& folder, const SequenceOptions& options,
                                 FileSequence& sequence, SequenceNotes& notes) {
  std::error_code code;
  const fs::path depth_camera = folder / "intrinsic/intrinsic_depth.txt";
  const fs::path colour_camera = folder / "intrinsic/intrinsic_color.txt";
  if (fs::exists(depth_camera, code)) {
    TSDFPP_ASSIGN(const Intrinsics camera, ReadIntrinsicMatrix(depth_camera));
    if (fs::exists(colour_camera, code)) {
      TSDFPP_ASSIGN(sequence.colour_camera, ReadIntrinsicMatrix(colour_camera));
    }
    return camera;
  }
  if (!options.intrinsics) {
    notes.push_back(
        fmt::format("{}: no intrinsic/intrinsic_depth.txt, 577.870605 577.870605 319.5 239.5 is "
                    "taken",
                    sequence.name));
  }
  return kScannetDefault;
}

// The files of a frame; nothing where its pose is lost.
Expected<std::optional<FrameFiles>> FilesOf(const fs::path& folder, int number,
                                            const std::string& stem, bool has_ids) {
  TSDFPP_ASSIGN(const auto pose, ReadPoseOrNone(folder / "pose" / (stem + ".txt")));
  if (!pose) return std::nullopt;
  FrameFiles frame;
  frame.T_WC = *pose;
  frame.number = number;
  frame.time_s = number / kUsualRate_hz;
  frame.depth = folder / "depth" / (stem + ".png");
  TSDFPP_ASSIGN(frame.colour,
                OnlyOneOf(folder / "color" / (stem + ".jpg"), folder / "color" / (stem + ".png")));
  if (!has_ids) return frame;
  frame.ids = folder / "instance-filt" / (stem + ".png");
  std::error_code code;
  if (!fs::exists(frame.ids, code)) {
    return DataError(
        "{}: no such mask, though instance-filt/ is there; expected one for every "
        "frame",
        frame.ids.string());
  }
  return frame;
}

}  // namespace

Expected<std::unique_ptr<DatasetSource>> OpenScannet(const fs::path& folder,
                                                     const SequenceOptions& options,
                                                     SequenceNotes& notes) {
  if (options.fixed_camera) {
    return FixedCameraWithPoses(folder);
  }
  FileSequence sequence;
  sequence.format = DatasetFormat::kScannet;
  sequence.name = NameOfFolder(folder);
  sequence.rate_hz = kUsualRate_hz;
  sequence.size_source = "ScanNet's default camera";
  TSDFPP_ASSIGN(const Intrinsics camera, ReadCameras(folder, options, sequence, notes));
  TSDFPP_ASSIGN(const auto stems, DepthStems(folder / "depth"));
  TSDFPP_RETURN_IF_ERROR(CountColoursWithoutDepth(folder / "color", stems, notes));

  std::error_code code;
  sequence.has_masks = fs::is_directory(folder / "instance-filt", code);
  for (const auto& [number, stem] : stems) {
    TSDFPP_ASSIGN(auto frame, FilesOf(folder, number, stem, sequence.has_masks));
    if (!frame) continue;
    frame->camera = camera;
    sequence.frames.push_back(std::move(*frame));
  }
  if (sequence.frames.empty()) {
    return DataError("{}: the poses of all {} frames are infinite", (folder / "pose").string(),
                     stems.size());
  }
  if (const std::size_t lost = stems.size() - sequence.frames.size(); lost > 0) {
    notes.push_back(fmt::format("{}: {} of {} frames have infinite poses and are left out",
                                (folder / "pose").string(), lost, stems.size()));
  }
  return MakeFileSource(std::move(sequence), options, notes);
}

}  // namespace tsdfpp
