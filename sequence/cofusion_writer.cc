#include "sequence/cofusion_writer.h"

#include <algorithm>
#include <set>

#include "core/files.h"
#include "core/folders.h"
#include "core/plain_name.h"
#include "core/ply.h"
#include "sequence/cofusion_layout.h"
#include "sequence/image_files.h"
#include "sequence/staging_folder.h"
#include "sequence/trajectory_file.h"

namespace tsdfpp {
namespace fs = std::filesystem;
namespace {

Expected<void> CheckImages(const SequenceInfo& info, const Frame& frame) {
  const Intrinsics& camera = info.intrinsics;
  if (frame.intrinsics != camera) {
    return DataError(
        "frame {}: the intrinsics differ from the sequence's, a Co-Fusion set has "
        "one camera",
        frame.index);
  }
  const cv::Size size(camera.width, camera.height);
  for (const auto& [what, image] : {std::pair{"colour image", &frame.colour},
                                    {"depth image", &frame.depth},
                                    {"mask", &frame.mask}}) {
    const bool needed = image != &frame.mask || !frame.mask.empty();
    if (needed && image->size() != size) {
      return DataError("frame {}: the {} is {}x{}, expected {}x{}", frame.index, what, image->cols,
                       image->rows, size.width, size.height);
    }
  }
  return {};
}

// Writes files and keeps their hashes.
class HashingWriter {
 public:
  HashingWriter(fs::path folder, std::map<std::string, std::string>& hashes)
      : folder_(std::move(folder)), hashes_(hashes) {}

  Expected<void> Add(const std::string& file, const Expected<std::string>& bytes) {
    if (!bytes) return tl::unexpected(bytes.error());
    hashes_[file] = HashText(*bytes);
    return WriteFile(folder_ / file, *bytes);
  }

 private:
  fs::path folder_;
  std::map<std::string, std::string>& hashes_;
};

// Journals, half-written files, and what an interrupted run with other settings left.
Expected<void> RemoveStrangers(const fs::path& folder, const SequenceRecord& record) {
  std::vector<fs::path> strangers;
  std::error_code code;
  TSDFPP_ASSIGN(const std::vector<fs::path> there, ListFilesBelow(folder));
  for (const fs::path& path : there) {
    const std::string file = path.lexically_relative(folder).string();
    if (file != "lock" && !record.hashes.contains(file)) strangers.push_back(path);
  }
  for (const fs::path& stranger : strangers) {
    fs::remove(stranger, code);
    if (code) {
      return EnvironmentError("{}: cannot be removed ({})", stranger.string(), code.message());
    }
    // Fails, as it should, where the folder is not empty.
    std::error_code ignored;
    if (stranger.parent_path() != folder) fs::remove(stranger.parent_path(), ignored);
  }
  return {};
}

}  // namespace

Expected<void> CheckObjectsFit(const std::vector<ObjectInfo>& objects) {
  std::set<InstanceId> ids;
  for (const ObjectInfo& object : objects) {
    if (object.id > cofusion::kMaxId) {
      return UsageError("object '{}': id {}, a Co-Fusion mask holds 0 to {}", object.name,
                        object.id, cofusion::kMaxId);
    }
    if (auto named = CheckPlainName(object.name, fmt::format("object {}", object.id)); !named) {
      return UsageError("{}", named.error().message);
    }
    if (object.id == kBackground && object.name == "cam") {
      return UsageError("object 0: the name 'cam' is the camera's in a Co-Fusion set");
    }
    if (!ids.insert(object.id).second) return UsageError("object id {} is there twice", object.id);
  }
  return {};
}

Expected<WrittenFrame> WriteCofusionFrame(const SequenceInfo& info, const Frame& frame,
                                          const std::optional<SensedImages>& sensed,
                                          const fs::path& folder) {
  TSDFPP_RETURN_IF_ERROR(CheckImages(info, frame));
  WrittenFrame written;
  written.index = frame.index;
  written.T_WC = frame.T_WC;
  written.T_WO = frame.T_WO;
  written.has_mask = !frame.mask.empty();
  const std::string name = fmt::format("frame {}", frame.index);
  HashingWriter writer(folder, written.hashes);
  TSDFPP_RETURN_IF_ERROR(
      writer.Add(cofusion::ColourFile(frame.index), EncodeColour(frame.colour, name)));
  TSDFPP_RETURN_IF_ERROR(
      writer.Add(cofusion::DepthFile(frame.index), EncodeDepth(frame.depth, name)));
  if (written.has_mask) {
    TSDFPP_RETURN_IF_ERROR(
        writer.Add(cofusion::MaskFile(frame.index), EncodeMask(frame.mask, name)));
  }
  if (sensed) {
    Frame images = frame;
    if (!sensed->depth.empty()) images.depth = sensed->depth;
    if (!sensed->mask.empty()) images.mask = sensed->mask;
    TSDFPP_RETURN_IF_ERROR(CheckImages(info, images));
    if (!sensed->depth.empty()) {
      TSDFPP_RETURN_IF_ERROR(
          writer.Add(cofusion::SensedDepthFile(frame.index), EncodeDepth(sensed->depth, name)));
    }
    if (!sensed->mask.empty()) {
      TSDFPP_RETURN_IF_ERROR(
          writer.Add(cofusion::SensedMaskFile(frame.index), EncodeMask(sensed->mask, name)));
    }
    written.sensed_T_WC = sensed->T_WC;
  }
  return written;
}

Expected<SequenceRecord> FinishCofusion(const SequenceInfo& info, const GeneratorInfo& generator,
                                        const std::vector<WrittenFrame>& frames,
                                        const std::vector<TrueModel>& models,
                                        const std::map<std::string, std::string>& more_files,
                                        const fs::path& folder) {
  SequenceRecord record;
  record.info = info;
  record.generator = generator;
  std::map<InstanceId, Trajectory> objects;
  for (const ObjectInfo& object : info.objects) objects[object.id];
  Trajectory camera;
  Trajectory sensed_camera;
  for (const WrittenFrame& frame : frames) {
    if (frame.has_mask != frames.front().has_mask) {
      return DataError("frame {}: expected a mask on every frame or on none", frame.index);
    }
    record.hashes.insert(frame.hashes.begin(), frame.hashes.end());
    camera.emplace(frame.index, frame.T_WC);
    if (frame.sensed_T_WC) sensed_camera.emplace(frame.index, *frame.sensed_T_WC);
    for (const auto& [id, T_WO] : frame.T_WO) {
      const auto object = objects.find(id);
      if (object == objects.end()) {
        return DataError("frame {}: a pose of object {}, which the sequence does not list",
                         frame.index, id);
      }
      object->second.emplace(frame.index, T_WO);
    }
  }
  HashingWriter writer(folder, record.hashes);
  const Intrinsics& k = info.intrinsics;
  TSDFPP_RETURN_IF_ERROR(
      writer.Add(cofusion::kCalibration,
                 fmt::format("{} {} {} {} {} {}\n", k.fx, k.fy, k.cx, k.cy, k.width, k.height)));
  TSDFPP_RETURN_IF_ERROR(
      writer.Add(cofusion::kCameraTrajectory, TrajectoryToText(camera, "camera")));
  if (!sensed_camera.empty()) {
    TSDFPP_RETURN_IF_ERROR(
        writer.Add(cofusion::kSensedCameraTrajectory, TrajectoryToText(sensed_camera, "camera")));
  }
  for (const ObjectInfo& object : info.objects) {
    const Trajectory& trajectory = objects.at(object.id);
    if (trajectory.empty()) continue;
    TSDFPP_RETURN_IF_ERROR(
        writer.Add(cofusion::TrajectoryFile(object), TrajectoryToText(trajectory, "object")));
  }
  for (const TrueModel& model : models) {
    const std::string file = cofusion::ModelFile(model.info);
    if (!objects.contains(model.info.id)) {
      return DataError("a true model of object {}, which the sequence does not list",
                       model.info.id);
    }
    TSDFPP_RETURN_IF_ERROR(WriteTrueModel(folder / file, model));
    TSDFPP_ASSIGN(const std::string bytes, ReadFile(folder / file));
    record.hashes[file] = HashText(bytes);
  }
  for (const auto& [file, bytes] : more_files) TSDFPP_RETURN_IF_ERROR(writer.Add(file, bytes));
  TSDFPP_RETURN_IF_ERROR(RemoveStrangers(folder, record));
  TSDFPP_RETURN_IF_ERROR(WriteFile(folder / cofusion::kSequence, SequenceToJson(record)));
  return record;
}

Expected<void> WriteCofusion(FrameSource& source, const GeneratorInfo& generator,
                             const fs::path& out, bool overwrite,
                             const ProgressCallback& progress) {
  TSDFPP_RETURN_IF_ERROR(CheckReplaceable(out, overwrite));
  const SequenceInfo& info = source.info();
  TSDFPP_RETURN_IF_ERROR(CheckObjectsFit(info.objects));
  StagingFolder staging(out);
  TSDFPP_RETURN_IF_ERROR(staging.Make());
  std::vector<WrittenFrame> frames;
  for (int i = 0; i < info.frame_count; ++i) {
    TSDFPP_ASSIGN(const Frame frame, source.Read(info.first_index + i));
    TSDFPP_ASSIGN(WrittenFrame written, WriteCofusionFrame(info, frame, {}, staging.path()));
    frames.push_back(std::move(written));
    if (progress) progress(i + 1, info.frame_count);
  }
  TSDFPP_ASSIGN(const std::vector<TrueModel> models, source.Truth());
  TSDFPP_RETURN_IF_ERROR(FinishCofusion(info, generator, frames, models, {}, staging.path()));
  TSDFPP_RETURN_IF_ERROR(CheckReplaceable(out, overwrite));
  return staging.TakeThePlace();
}

}  // namespace tsdfpp
