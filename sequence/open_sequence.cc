#include "sequence/open_sequence.h"

#include <algorithm>
#include <cstdlib>

#include "core/data_folder.h"
#include "core/folders.h"
#include "sequence/bop_layout.h"
#include "sequence/cofusion_layout.h"
#include "sequence/cofusion_reader.h"
#include "sequence/dataset_readers.h"
#include "sequence/plausibility.h"
#include "sequence/text_lines.h"
#include "sequence/trajectory_file.h"

namespace tsdfpp {
namespace fs = std::filesystem;
namespace {

bool Exists(const fs::path& path) {
  std::error_code code;
  return fs::exists(path, code);
}

// Of a folder that cannot be read the reader says so.
std::vector<std::string> NamesOrNone(const fs::path& folder) {
  return NamesIn(folder).value_or(std::vector<std::string>());
}

bool HoldsBopScene(const fs::path& folder) {
  if (Exists(folder / bop::kCamera)) return true;
  for (const std::string& split : NamesOrNone(folder)) {
    for (const std::string& scene : NamesOrNone(folder / split)) {
      if (Exists(folder / split / scene / bop::kCamera)) return true;
    }
  }
  return false;
}

bool LooksLike(const fs::path& path, DatasetFormat format) {
  const auto any_name = [&](const char* prefix, const char* suffix) {
    const auto names = NamesOrNone(path);
    return std::any_of(names.begin(), names.end(), [&](const std::string& name) {
      return name.starts_with(prefix) && name.ends_with(suffix);
    });
  };
  switch (format) {
    case DatasetFormat::kCofusion:
      return cofusion::IsCofusion(path);
    case DatasetFormat::kTum:
      return Exists(path / "associations.txt") || Exists(path / "associated.txt") ||
             (Exists(path / "rgb.txt") && Exists(path / "depth.txt"));
    case DatasetFormat::kBop:
      return HoldsBopScene(path);
    case DatasetFormat::kKlg:
      return path.extension() == ".klg" || any_name("", ".klg");
    case DatasetFormat::kScannet:
      return Exists(path / "color") && Exists(path / "depth") && Exists(path / "pose");
    case DatasetFormat::kReplica:
      return Exists(path / "traj.txt") && Exists(path / "results");
    case DatasetFormat::kSevenScenes:
      return any_name("frame-", ".depth.png");
  }
  return false;
}

// What LooksLike() looks for, in words.
const char* MarksOf(DatasetFormat format) {
  switch (format) {
    case DatasetFormat::kCofusion:
      return "calibration.txt and colour/";
    case DatasetFormat::kTum:
      return "rgb.txt and depth.txt";
    case DatasetFormat::kBop:
      return "scene_camera.json";
    case DatasetFormat::kKlg:
      return "a .klg";
    case DatasetFormat::kScannet:
      return "color/, depth/ and pose/";
    case DatasetFormat::kReplica:
      return "traj.txt and results/";
    case DatasetFormat::kSevenScenes:
      return "frame-*.depth.png";
  }
  return "";
}

Expected<DatasetFormat> DetectFormat(const fs::path& path) {
  const std::vector<DatasetFormat> fitting = DetectFormats(path);
  if (fitting.size() == 1) return fitting.front();
  if (fitting.empty()) {
    std::string marks;
    for (const DatasetFormat format : AllDatasetFormats()) {
      if (!marks.empty()) marks += format == AllDatasetFormats().back() ? ", or " : ", ";
      marks += fmt::format("{} ({})", MarksOf(format), DatasetFormatName(format));
    }
    return DataError("{}: not a sequence; expected {}", path.string(), marks);
  }
  std::string names;
  for (const DatasetFormat format : fitting) {
    names += fmt::format("{}{}", names.empty() ? "" : ", ", DatasetFormatName(format));
  }
  return UsageError("{}: several formats fit ({}), expected --dataset to say which", path.string(),
                    names);
}

Expected<std::unique_ptr<FrameSource>> OpenCofusionSet(const fs::path& folder,
                                                       const SequenceOptions& options) {
  if (options.intrinsics || options.depth_units_per_m || options.fixed_camera) {
    return UsageError(
        "{}: a Co-Fusion set has its own calibration, metres and camera poses, expected no others",
        folder.string());
  }
  TSDFPP_ASSIGN(auto source, OpenCofusion(folder));
  if (options.check && !Exists(folder / cofusion::kSequence)) {
    TSDFPP_ASSIGN(const Trajectory camera, ReadTrajectory(folder / cofusion::kCameraTrajectory));
    std::vector<Pose> T_WC;
    const SequenceInfo& info = source->info();
    for (int i = 0; i < info.frame_count; ++i) {
      const auto pose = camera.find(info.first_index + i);
      if (pose == camera.end()) return source;  // Read() says so
      T_WC.push_back(pose->second);
    }
    TSDFPP_RETURN_IF_ERROR(CheckFrames(*source, T_WC, std::nullopt));
  }
  return source;
}

Expected<std::unique_ptr<DatasetSource>> OpenOthers(const fs::path& path, DatasetFormat format,
                                                    const SequenceOptions& options,
                                                    SequenceNotes& notes) {
  switch (format) {
    case DatasetFormat::kTum:
      return OpenTum(path, options, notes);
    case DatasetFormat::kBop:
      return OpenBop(path, options, notes);
    case DatasetFormat::kKlg:
      return OpenKlg(path, options, notes);
    case DatasetFormat::kScannet:
      return OpenScannet(path, options, notes);
    case DatasetFormat::kReplica:
      return OpenReplica(path, options, notes);
    case DatasetFormat::kSevenScenes:
      return OpenSevenScenes(path, options, notes);
    case DatasetFormat::kCofusion:  // has one of its own
      break;
  }
  std::abort();
}

}  // namespace

std::vector<DatasetFormat> DetectFormats(const fs::path& path) {
  std::vector<DatasetFormat> fitting;
  for (const DatasetFormat format : AllDatasetFormats()) {
    if (LooksLike(path, format)) fitting.push_back(format);
  }
  return fitting;
}

std::vector<fs::path> PlacesBeside(const fs::path& path) {
  const fs::path folder = AbsolutePath(path / "").lexically_normal().parent_path();
  if (IsFolder(path)) {
    if (Exists(path / bop::kCamera)) {
      return {folder.parent_path().parent_path() / fs::path(bop::kModelsInfo).parent_path()};
    }
    if (Exists(path / "traj.txt")) return {folder.parent_path() / "cam_params.json"};
    return {};
  }
  std::vector<fs::path> places;
  if (path.extension() != ".klg") return places;
  for (const char* name : {"calibration.txt", "groundtruth.txt", "mask", "masks"}) {
    places.push_back(folder.parent_path() / name);
  }
  return places;
}

Expected<std::unique_ptr<FrameSource>> OpenSequence(const fs::path& path,
                                                    const SequenceOptions& options,
                                                    SequenceNotes* notes) {
  std::error_code code;
  if (!fs::exists(path, code)) return UsageError("{}: no such folder", path.string());
  if (!fs::is_directory(path, code) && path.extension() != ".klg") {
    return UsageError("{}: is a file, expected the folder of a sequence or a .klg", path.string());
  }
  DatasetFormat format{};
  if (options.format) {
    format = *options.format;
  } else {
    TSDFPP_ASSIGN(format, DetectFormat(path));
  }
  const bool timed = format == DatasetFormat::kTum || format == DatasetFormat::kKlg;
  if (options.pose_offset_s != 0 && !timed) {
    return UsageError("{}: a {} set has poses of frames, not of times, expected no offset of them",
                      path.string(), DatasetFormatName(format));
  }
  if (fs::is_directory(path, code)) TSDFPP_RETURN_IF_ERROR(CheckLinksBelow(path));
  if (format == DatasetFormat::kCofusion) return OpenCofusionSet(path, options);
  SequenceNotes unheard;
  TSDFPP_ASSIGN(auto source, OpenOthers(path, format, options, notes ? *notes : unheard));
  if (options.check) {
    TSDFPP_RETURN_IF_ERROR(
        CheckFrames(*source, source->CameraPoses(), source->DepthUnitsPerMetre()));
  }
  return source;
}

}  // namespace tsdfpp
