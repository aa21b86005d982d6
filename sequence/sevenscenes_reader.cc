#include "sequence/cofusion_layout.h"
#include "sequence/dataset_readers.h"
#include "sequence/image_files.h"
#include "sequence/pose_matrix.h"
#include "sequence/text_lines.h"

namespace tsdfpp {
namespace fs = std::filesystem;
namespace {

constexpr Intrinsics kSevenScenesDefault{640, 480, 585, 585, 320, 240};
constexpr std::uint16_t kNoDepth = 65535;

}  // namespace

Expected<std::unique_ptr<DatasetSource>> OpenSevenScenes(const fs::path& folder,
                                                         const SequenceOptions& options,
                                                         SequenceNotes& notes) {
  if (options.fixed_camera) {
    return FixedCameraWithPoses(folder);
  }
  FileSequence sequence;
  sequence.format = DatasetFormat::kSevenScenes;
  sequence.name = NameOfFolder(folder);
  sequence.no_depth = kNoDepth;
  sequence.rate_hz = kUsualRate_hz;
  Intrinsics camera = kSevenScenesDefault;
  sequence.size_source = "7-Scenes' default camera";
  std::error_code code;
  if (fs::exists(folder / "camera-intrinsics.txt", code)) {
    TSDFPP_ASSIGN(camera, ReadIntrinsicMatrix(folder / "camera-intrinsics.txt"));
  } else if (!options.intrinsics) {
    notes.push_back(
        fmt::format("{}: no camera-intrinsics.txt, 585 585 320 240 is taken", sequence.name));
  }
  int masks = 0;
  int colours = 0;
  bool has_labels = false;
  TSDFPP_ASSIGN(const auto names, NamesIn(folder));
  for (const std::string& name : names) {
    has_labels |= name.ends_with(".label.png");
    colours += cofusion::NumberOf(name, "frame-", ".color.png") ||
                       cofusion::NumberOf(name, "frame-", ".color.jpg")
                   ? 1
                   : 0;
    const auto number = cofusion::NumberOf(name, "frame-", ".depth.png");
    if (!number) continue;
    const std::string stem = name.substr(0, name.size() - std::string(".depth.png").size());
    FrameFiles frame;
    frame.number = *number;
    frame.time_s = *number / kUsualRate_hz;
    frame.depth = folder / name;
    TSDFPP_ASSIGN(frame.colour,
                  OnlyOneOf(folder / (stem + ".color.png"), folder / (stem + ".color.jpg")));
    frame.camera = camera;
    TSDFPP_ASSIGN(frame.T_WC, ReadPoseMatrix(folder / (stem + ".pose.txt")));
    frame.ids = folder / (stem + ".mask.png");
    if (fs::exists(frame.ids, code)) ++masks;
    sequence.frames.push_back(std::move(frame));
  }
  if (sequence.frames.empty()) {
    return DataError("{}: no image named frame-000000.depth.png or so", folder.string());
  }
  // Every depth image has its colours.
  SayColoursWithoutDepth(folder, colours - static_cast<int>(sequence.frames.size()), colours,
                         notes);
  sequence.has_masks = masks > 0;
  for (FrameFiles& frame : sequence.frames) {
    if (masks == 0) {
      frame.ids.clear();
    } else if (!fs::exists(frame.ids, code)) {
      return DataError("{}: no such mask, though other frames have one", frame.ids.string());
    }
  }
  if (masks == 0 && has_labels) {
    notes.push_back(fmt::format(
        "{}: frame-*.label.png look like masks and are not read, expected frame-*.mask.png of ids",
        folder.string()));
  }
  return MakeFileSource(std::move(sequence), options, notes);
}

}  // namespace tsdfpp
