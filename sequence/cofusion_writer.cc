#include "sequence/cofusion_writer.h"

#include <unistd.h>

#include <algorithm>
#include <set>

#include "core/files.h"
#include "core/ply.h"
#include "sequence/cofusion_layout.h"
#include "sequence/image_files.h"
#include "sequence/trajectory_file.h"

namespace tsdfpp {
namespace fs = std::filesystem;
namespace {

// A hidden folder beside `out` that is removed again unless it took out's place.
class StagingFolder {
 public:
  explicit StagingFolder(const fs::path& out) : out_(out), path_(Sibling("part")) {}
  ~StagingFolder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  StagingFolder(const StagingFolder&) = delete;
  StagingFolder& operator=(const StagingFolder&) = delete;

  const fs::path& path() const { return path_; }

  Expected<void> Make() const {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
    return MakeWritableFolder(path_);
  }

  // An earlier folder is moved aside first, so that a failure leaves it as it was.
  Expected<void> TakeThePlace() const {
    const fs::path old = Sibling("old");
    std::error_code code;
    const bool replaces = fs::exists(out_, code);
    if (replaces) fs::rename(out_, old, code);
    if (!code) {
      fs::rename(path_, out_, code);
      std::error_code ignored;
      if (code && replaces) fs::rename(old, out_, ignored);
      if (!code) fs::remove_all(old, ignored);
    }
    if (code) {
      return EnvironmentError("{}: the folder cannot be put in place ({})", out_.string(),
                              code.message());
    }
    return {};
  }

 private:
  fs::path Sibling(const char* suffix) const {
    return out_.parent_path() /
           fmt::format(".{}.{}.{}", out_.filename().string(), getpid(), suffix);
  }

  fs::path out_;
  fs::path path_;
};

Expected<void> MayReplace(const fs::path& out, bool overwrite) {
  std::error_code code;
  if (!fs::exists(out, code)) return {};
  if (!fs::is_directory(out, code)) {
    return UsageError("{}: is a file, expected a folder to make", out.string());
  }
  if (fs::is_empty(out, code)) return {};
  const bool ours = ReadSequenceJson(out / cofusion::kSequence).has_value();
  if (!ours) {
    return UsageError(
        "{}: the folder holds something other than a sequence of ours, expected a "
        "new or an empty folder",
        out.string());
  }
  if (!overwrite) {
    return UsageError(
        "{}: already holds a sequence, expected a new folder or leave to overwrite it",
        out.string());
  }
  return {};
}

Expected<void> CheckObjects(const std::vector<ObjectInfo>& objects) {
  std::set<InstanceId> ids;
  for (const ObjectInfo& object : objects) {
    if (object.id > cofusion::kMaxId) {
      return UsageError("object '{}': id {}, a Co-Fusion mask holds 0 to {}", object.name,
                        object.id, cofusion::kMaxId);
    }
    if (object.name.empty() ||
        object.name.find_first_of(std::string("/\n\0", 3)) != object.name.npos) {
      return UsageError("object {}: the name '{}' cannot be part of a file name", object.id,
                        object.name);
    }
    if (object.id == kBackground && object.name == "cam") {
      return UsageError("object 0: the name 'cam' is the camera's in a Co-Fusion set");
    }
    if (!ids.insert(object.id).second) return UsageError("object id {} is there twice", object.id);
  }
  return {};
}

class CofusionWriter {
 public:
  CofusionWriter(const SequenceInfo& info, const GeneratorInfo& generator, fs::path folder)
      : record_{info, generator, {}}, folder_(std::move(folder)) {
    for (const ObjectInfo& object : info.objects) objects_[object.id];
  }

  Expected<void> AddFrame(const Frame& frame) {
    const SequenceInfo& info = record_.info;
    const Intrinsics& camera = info.intrinsics;
    if (frame.intrinsics != camera) {
      return DataError(
          "frame {}: the intrinsics differ from the sequence's, a Co-Fusion set has "
          "one camera",
          frame.index);
    }
    const bool has_mask = !frame.mask.empty();
    if (camera_.empty()) has_masks_ = has_mask;
    if (has_mask != has_masks_) {
      return DataError("frame {}: expected a mask on every frame or on none", frame.index);
    }
    const cv::Size size(camera.width, camera.height);
    for (const auto& [what, image] : {std::pair{"colour image", &frame.colour},
                                      {"depth image", &frame.depth},
                                      {"mask", &frame.mask}}) {
      if ((has_mask || image != &frame.mask) && image->size() != size) {
        return DataError("frame {}: the {} is {}x{}, expected {}x{}", frame.index, what,
                         image->cols, image->rows, size.width, size.height);
      }
    }
    TSDFPP_RETURN_IF_ERROR(
        Add(cofusion::ColourFile(frame.index), EncodeColour(frame.colour, FrameName(frame))));
    TSDFPP_RETURN_IF_ERROR(
        Add(cofusion::DepthFile(frame.index), EncodeDepth(frame.depth, FrameName(frame))));
    if (has_mask) {
      TSDFPP_RETURN_IF_ERROR(
          Add(cofusion::MaskFile(frame.index), EncodeMask(frame.mask, FrameName(frame))));
    }
    camera_.emplace(frame.index, frame.T_WC);
    for (const auto& [id, T_WO] : frame.T_WO) {
      const auto object = objects_.find(id);
      if (object == objects_.end()) {
        return DataError("frame {}: a pose of object {}, which the sequence does not list",
                         frame.index, id);
      }
      object->second.emplace(frame.index, T_WO);
    }
    return {};
  }

  // After the last frame.
  Expected<void> AddTheRest(const std::vector<TrueModel>& models) {
    const Intrinsics& camera = record_.info.intrinsics;
    TSDFPP_RETURN_IF_ERROR(Add(cofusion::kCalibration,
                               fmt::format("{} {} {} {} {} {}\n", camera.fx, camera.fy, camera.cx,
                                           camera.cy, camera.width, camera.height)));
    TSDFPP_RETURN_IF_ERROR(Add(cofusion::kCameraTrajectory, TrajectoryToText(camera_, "camera")));
    for (const ObjectInfo& object : record_.info.objects) {
      const Trajectory& trajectory = objects_.at(object.id);
      if (trajectory.empty()) continue;
      TSDFPP_RETURN_IF_ERROR(
          Add(cofusion::TrajectoryFile(object), TrajectoryToText(trajectory, "object")));
    }
    for (const TrueModel& model : models) {
      const std::string file = cofusion::ModelFile(model.info);
      if (!objects_.contains(model.info.id)) {
        return DataError("a true model of object {}, which the sequence does not list",
                         model.info.id);
      }
      TSDFPP_RETURN_IF_ERROR(WriteTrueModel(folder_ / file, model));
      TSDFPP_ASSIGN(const std::string bytes, ReadFile(folder_ / file));
      record_.hashes[file] = HashText(bytes);
    }
    return WriteFile(folder_ / cofusion::kSequence, SequenceToJson(record_));
  }

 private:
  static std::string FrameName(const Frame& frame) { return fmt::format("frame {}", frame.index); }

  Expected<void> Add(const std::string& file, const Expected<std::string>& bytes) {
    if (!bytes) return tl::unexpected(bytes.error());
    record_.hashes[file] = HashText(*bytes);
    return WriteFile(folder_ / file, *bytes);
  }

  SequenceRecord record_;
  fs::path folder_;
  bool has_masks_ = false;
  Trajectory camera_;
  std::map<InstanceId, Trajectory> objects_;
};

}  // namespace

Expected<void> WriteCofusion(FrameSource& source, const GeneratorInfo& generator,
                             const fs::path& out, bool overwrite,
                             const ProgressCallback& progress) {
  // An absolute path without a trailing slash has a file name and a folder it stands in.
  fs::path folder = fs::absolute(out).lexically_normal();
  if (!folder.has_filename()) folder = folder.parent_path();
  TSDFPP_RETURN_IF_ERROR(MayReplace(folder, overwrite));
  const SequenceInfo& info = source.info();
  TSDFPP_RETURN_IF_ERROR(CheckObjects(info.objects));

  const StagingFolder staging(folder);
  TSDFPP_RETURN_IF_ERROR(staging.Make());
  CofusionWriter writer(info, generator, staging.path());
  for (int i = 0; i < info.frame_count; ++i) {
    TSDFPP_ASSIGN(const Frame frame, source.Read(info.first_index + i));
    TSDFPP_RETURN_IF_ERROR(writer.AddFrame(frame));
    if (progress) progress(i + 1, info.frame_count);
  }
  TSDFPP_ASSIGN(const std::vector<TrueModel> models, source.Truth());
  TSDFPP_RETURN_IF_ERROR(writer.AddTheRest(models));
  return staging.TakeThePlace();
}

}  // namespace tsdfpp
