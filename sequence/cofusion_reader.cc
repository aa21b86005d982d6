#include "sequence/cofusion_reader.h"

#include <algorithm>
#include <array>
#include <optional>
#include <set>
#include <tuple>
#include <utility>

#include "core/files.h"
#include "core/folders.h"
#include "core/plain_name.h"
#include "core/ply.h"
#include "sequence/calibration.h"
#include "sequence/cofusion_layout.h"
#include "sequence/image_files.h"
#include "sequence/plausibility.h"
#include "sequence/sequence_json.h"
#include "sequence/text_lines.h"
#include "sequence/trajectory_file.h"

namespace tsdfpp {
namespace fs = std::filesystem;
namespace {

bool Exists(const fs::path& path) {
  std::error_code code;
  return fs::exists(path, code);
}

// First number and count of the images in colour/. Errors: none, a gap, another first number.
Expected<std::pair<int, int>> NumbersOfImages(const fs::path& folder) {
  std::set<int> numbers;
  TSDFPP_ASSIGN(const auto names, NamesIn(folder / cofusion::kColour));
  for (const std::string& name : names) {
    if (const auto number = cofusion::NumberOf(name, "Color", ".png")) numbers.insert(*number);
  }
  const std::string colour = (folder / cofusion::kColour).string();
  if (numbers.empty()) return DataError("{}: no image named Color0001.png or so", colour);
  const int first = *numbers.begin();
  if (first > 1) {
    return DataError("{}: the first image has number {}, expected 0 or 1", colour, first);
  }
  int expected = first;
  for (const int number : numbers) {
    if (number != expected) {
      return DataError("{}: no such image, though there are others up to number {}",
                       (folder / cofusion::ColourFile(expected)).string(), *numbers.rbegin());
    }
    ++expected;
  }
  return std::pair(first, static_cast<int>(numbers.size()));
}

class CofusionSource : public FrameSource {
 public:
  explicit CofusionSource(fs::path folder) : folder_(std::move(folder)) {}

  Expected<void> Open() {
    TSDFPP_ASSIGN(const Intrinsics camera, ReadCalibration(folder_ / cofusion::kCalibration));
    has_masks_ = Exists(folder_ / cofusion::kMask);
    TSDFPP_RETURN_IF_ERROR(ReadTrajectories());
    if (Exists(folder_ / cofusion::kSequence)) {
      TSDFPP_ASSIGN(SequenceRecord record, ReadSequenceJson(folder_ / cofusion::kSequence));
      if (record.info.intrinsics != camera) {
        return DataError("{}: the intrinsics differ from those in {}",
                         (folder_ / cofusion::kSequence).string(), cofusion::kCalibration);
      }
      TSDFPP_RETURN_IF_ERROR(
          CheckPossibleCamera(record.info.intrinsics, (folder_ / cofusion::kSequence).string()));
      return Adopt(record);
    }
    info_.name = NameOfFolder(folder_);
    info_.intrinsics = camera;
    TSDFPP_ASSIGN(std::tie(info_.first_index, info_.frame_count), NumbersOfImages(folder_));
    if (camera.width == 0) {
      TSDFPP_ASSIGN(const cv::Mat first,
                    ReadColour(folder_ / cofusion::ColourFile(info_.first_index), {}));
      info_.intrinsics.width = first.cols;
      info_.intrinsics.height = first.rows;
    }
    TSDFPP_RETURN_IF_ERROR(
        CheckCamera(info_.intrinsics, (folder_ / cofusion::kCalibration).string()));
    NameObjects();
    info_.has_object_poses = !objects_.empty();
    return CheckObjects(info_.objects, folder_.string());
  }

  const SequenceInfo& info() const override { return info_; }

  Expected<Frame> Read(int index) override {
    return ReadFrame(index, sensed_depth_, sensed_masks_, sensed_camera_.has_value());
  }

  bool IsSensed() const override {
    return sensed_depth_ || sensed_masks_ || sensed_camera_.has_value();
  }
  Expected<Frame> ReadTrue(int index) override { return ReadFrame(index, false, false, false); }

  bool HasTruth() const override {
    const fs::path models = folder_ / cofusion::kModels;
    if (!expected_models_.empty()) return true;
    if (!Exists(models)) return false;
    const auto names = NamesIn(models);
    return !names || std::ranges::any_of(*names, [](const std::string& name) {
      return cofusion::ObjectOf(name, "", ".ply").has_value();
    });
  }
  Expected<std::vector<TrueModel>> Truth() override {
    const fs::path models = folder_ / cofusion::kModels;
    for (const std::string& file : expected_models_) {
      if (!Exists(folder_ / file)) {
        return DataError("{}: no such model, though {} lists it", (folder_ / file).string(),
                         cofusion::kSequence);
      }
    }
    std::map<InstanceId, TrueModel> truth;
    TSDFPP_ASSIGN(const auto names, NamesIn(models));
    for (const std::string& name : names) {
      const auto file = cofusion::ObjectOf(name, "", ".ply");
      if (!file) continue;
      const auto object =
          std::find_if(info_.objects.begin(), info_.objects.end(),
                       [&](const ObjectInfo& candidate) { return candidate.id == file->id; });
      if (object == info_.objects.end()) {
        return DataError("{}: a model of object {}, which the sequence does not have",
                         (models / name).string(), file->id);
      }
      TSDFPP_ASSIGN(TrueModel model, ReadTrueModel(models / name, *object));
      if (!truth.emplace(object->id, std::move(model)).second) {
        return DataError("{}: a second model of object {}", (models / name).string(), object->id);
      }
    }
    if (truth.empty()) {
      return DataError(
          "{}: no true surfaces here (<name>-<id>.ply); the sequence can be mapped but not "
          "compared with truth",
          models.string());
    }
    std::vector<TrueModel> ordered;
    ordered.reserve(truth.size());
    for (auto& [id, model] : truth) ordered.push_back(std::move(model));
    return ordered;
  }

 private:
  Expected<Frame> ReadFrame(int index, bool sensed_depth, bool sensed_mask,
                            bool sensed_camera) const {
    const int last = info_.first_index + info_.frame_count - 1;
    if (index < info_.first_index || index > last) {
      return UsageError("frame {} is out of range, {} has frames {} to {}", index, info_.name,
                        info_.first_index, last);
    }
    Frame frame;
    frame.index = index;
    frame.time_s = (index - info_.first_index) / info_.rate_hz;
    frame.intrinsics = info_.intrinsics;
    const cv::Size size(info_.intrinsics.width, info_.intrinsics.height);
    TSDFPP_ASSIGN(frame.colour, ReadColour(folder_ / cofusion::ColourFile(index), size));
    TSDFPP_ASSIGN(frame.depth, ReadDepth(folder_ / (sensed_depth ? cofusion::SensedDepthFile(index)
                                                                 : cofusion::DepthFile(index)),
                                         size));
    if (has_masks_) {
      TSDFPP_ASSIGN(frame.mask, ReadMask(folder_ / (sensed_mask ? cofusion::SensedMaskFile(index)
                                                                : cofusion::MaskFile(index)),
                                         size));
    }
    // A sensed camera without a pose is never given the true one.
    const Trajectory& cameras = sensed_camera ? *sensed_camera_ : camera_;
    const auto camera = cameras.find(index);
    if (camera == cameras.end()) {
      return DataError("{}: no camera pose for frame {}",
                       (folder_ / (sensed_camera ? cofusion::kSensedCameraTrajectory
                                                 : cofusion::kCameraTrajectory))
                           .string(),
                       index);
    }
    frame.T_WC = camera->second;
    for (const auto& [id, trajectory] : objects_) {
      if (const auto pose = trajectory.find(index); pose != trajectory.end()) {
        frame.T_WO.emplace(id, pose->second);
      }
    }
    return frame;
  }

  Expected<void> ReadTrajectories() {
    TSDFPP_ASSIGN(camera_, ReadTrajectory(folder_ / cofusion::kCameraTrajectory));
    TSDFPP_ASSIGN(const auto names, NamesIn(folder_ / cofusion::kTrajectories));
    for (const std::string& name : names) {
      const fs::path path = folder_ / cofusion::kTrajectories / name;
      if (!name.starts_with("gt-") || !name.ends_with(".txt")) continue;
      const auto object = cofusion::ObjectOf(name, "gt-", ".txt");
      if (!object) {
        return DataError(
            "{}: the file's name does not end with an object's id, expected "
            "gt-<name>-<id>.txt",
            path.string());
      }
      if (object->id == kBackground && object->name == "cam") continue;
      TSDFPP_RETURN_IF_ERROR(CheckPlainName(object->name, path.string()));
      TSDFPP_ASSIGN(Trajectory trajectory, ReadTrajectory(path));
      if (!objects_.emplace(object->id, std::move(trajectory)).second) {
        return DataError("{}: a second trajectory of object {}", path.string(), object->id);
      }
      found_.push_back(*object);
    }
    return {};
  }

  Expected<void> Adopt(SequenceRecord& record) {
    info_ = std::move(record.info);
    info_.has_object_poses = !objects_.empty();
    for (const ObjectInfo& object : found_) {
      if (std::find_if(info_.objects.begin(), info_.objects.end(), [&](const ObjectInfo& listed) {
            return listed.id == object.id;
          }) == info_.objects.end()) {
        return DataError("{}: object {} is not listed in {}",
                         (folder_ / cofusion::TrajectoryFile(object)).string(), object.id,
                         cofusion::kSequence);
      }
    }
    for (const auto& [file, hash] : record.hashes) {
      if (file.starts_with(std::string(cofusion::kModels) + "/")) expected_models_.push_back(file);
      if (file.starts_with(std::string(cofusion::kMask) + "/")) has_masks_ = true;
      if (file.starts_with(std::string(cofusion::kSensedDepth) + "/")) sensed_depth_ = true;
      if (file.starts_with(std::string(cofusion::kSensedMask) + "/Mask")) sensed_masks_ = true;
      if (file == cofusion::kSensedCameraTrajectory) {
        TSDFPP_ASSIGN(sensed_camera_, ReadTrajectory(folder_ / file));
      }
    }
    return {};
  }

  // The objects of a set without sequence.json.
  void NameObjects() {
    std::map<InstanceId, ObjectInfo> objects;
    objects[kBackground] = {kBackground, "background", "background"};
    for (const ObjectInfo& object : found_) objects[object.id] = object;
    for (const InstanceId id : IdsInMasks()) {
      const std::string name = fmt::format("object{}", id);
      objects.try_emplace(id, ObjectInfo{id, name, ""});
    }
    // Names are unique in a sequence: of two cars the second becomes "car2", after its id.
    std::set<std::string> names;
    for (auto& [id, object] : objects) {
      while (!names.insert(object.name).second) object.name += fmt::format("{}", id);
      info_.objects.push_back(object);
    }
  }

  // An object may be seen without having a trajectory. A mask that cannot be used is Read()'s to
  // report.
  std::set<InstanceId> IdsInMasks() const {
    std::array<bool, cofusion::kMaxId + 1> seen{};
    for (int i = 0; has_masks_ && i < info_.frame_count; ++i) {
      const auto mask = ReadMask(folder_ / cofusion::MaskFile(info_.first_index + i), {});
      if (!mask) continue;
      for (const InstanceId id : cv::Mat_<InstanceId>(*mask)) seen[id] = true;
    }
    std::set<InstanceId> ids;
    for (InstanceId id = 1; id <= cofusion::kMaxId; ++id) {
      if (seen[id]) ids.insert(id);
    }
    return ids;
  }

  fs::path folder_;
  SequenceInfo info_;
  bool has_masks_ = false;
  bool sensed_depth_ = false;
  bool sensed_masks_ = false;
  Trajectory camera_;
  std::optional<Trajectory> sensed_camera_;  // where the set lists one
  std::map<InstanceId, Trajectory> objects_;
  std::vector<ObjectInfo> found_;             // of the trajectories
  std::vector<std::string> expected_models_;  // of sequence.json
};

}  // namespace

Expected<std::unique_ptr<FrameSource>> OpenCofusion(const fs::path& folder) {
  auto source = std::make_unique<CofusionSource>(folder);
  TSDFPP_RETURN_IF_ERROR(source->Open());
  return source;
}

}  // namespace tsdfpp
