// Frames whose images are files of their own: what the TUM, BOP, ScanNet, Replica and 7-Scenes
// readers have in common.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "core/frame_source.h"
#include "sequence/sequence_options.h"

namespace tsdfpp {

// A dataset of another's, which knows all its camera poses without reading images.
class DatasetSource : public FrameSource {
 public:
  // T_WC of each frame in order.
  virtual std::vector<Pose> CameraPoses() const = 0;
  // Depth values in a metre where depth is integers of one unit throughout.
  virtual std::optional<double> DepthUnitsPerMetre() const = 0;
};

struct FrameFiles {
  int number = 0;     // in the file names
  double time_s = 0;  // on any clock
  std::filesystem::path colour;
  std::filesystem::path depth;
  std::filesystem::path ids;  // an image of ids, or empty
  // Black and white images of single objects in the order in which they are painted.
  std::vector<std::pair<std::filesystem::path, InstanceId>> masks;
  Intrinsics camera;  // of the depth image; width 0 is any size
  double depth_units_per_m = 1000;
  Pose T_WC = Pose::Identity();
  std::map<InstanceId, Pose> T_WO;
};

struct FileSequence {
  DatasetFormat format = DatasetFormat::kTum;
  std::string name;
  std::string size_source;  // where the camera's size is from, for errors
  std::vector<FrameFiles> frames;
  std::vector<ObjectInfo> objects;  // without the background; found in the id images where empty
  bool has_masks = false;
  std::uint16_t no_depth = 0;  // a depth value, beside 0, that means none
  double rate_hz = 0;          // 0: from the frames' times
  // Where colour and id images are another camera's at the same place (ScanNet): they are sampled
  // at the depth image's pixels, colours bilinearly, ids at the nearest pixel.
  std::optional<Intrinsics> colour_camera;
  bool has_truth = false;  // files of true surfaces are there
  // The true surfaces; where absent Truth() says that the format has none.
  std::function<Expected<std::vector<TrueModel>>(const SequenceInfo&)> truth;
};

// A source of these frames. Frames are numbered as their files are where no number is left out,
// else 0, 1, 2...; time_s begins with 0. The camera's missing size is that of the first depth image
// and holds for all frames. Errors: kData where there is no frame, or two of a number, the first
// depth image cannot be read, a camera is implausible (sequence/plausibility.h); kUsage where
// intrinsics with a negative fy meet objects, or where intrinsics were given and the colours are
// those of another camera, of another size.
Expected<std::unique_ptr<DatasetSource>> MakeFileSource(FileSequence sequence,
                                                        const SequenceOptions& options,
                                                        SequenceNotes& notes);

// Frames a second where a dataset does not say when they were taken.
inline constexpr double kUsualRate_hz = 30;

// 1 over the median step; kUsualRate_hz where there is none.
double RateOf(const std::vector<double>& times_s);

// Mirrors the world and the camera in y: T_WC of a camera whose image has y upwards becomes that of
// one with y downwards.
Pose MirroredInY(const Pose& T_WC);

// Objects named "object<id>" for ids that have no name.
std::vector<ObjectInfo> NamedByIds(const std::vector<InstanceId>& ids);

// The mask files of a folder "mask/" (or "masks/") in `folder`, one for each of `stems`, e.g.
// "mask/000001.png"; none where there is no such folder, with a note on other folders that look as
// if they held masks. Errors: kData where an image of the folder is missing.
Expected<std::vector<std::filesystem::path>> FindMasks(const std::filesystem::path& folder,
                                                       const std::vector<std::string>& stems,
                                                       SequenceNotes& notes);

}  // namespace tsdfpp
