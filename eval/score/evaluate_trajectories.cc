#include "eval/score/evaluate_trajectories.h"

#include <algorithm>

#include "core/data_folder.h"
#include "eval/score/evaluation.h"
#include "sequence/trajectory_file.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;

constexpr const char* kCamera = "camera";
constexpr const char* kPoses = "poses-";

// The object that a file is about: as the meshes were matched, else by the sequence's own names.
InstanceId ObjectOf(std::string stem, const std::vector<ObjectInfo>& objects,
                    const std::vector<PartMatch>& matches) {
  if (stem.starts_with(kPoses)) stem = stem.substr(std::string_view(kPoses).size());
  ScenePart part = PartOfName(stem);
  // "3" alone is a label.
  if (part.id == kNoInstance) {
    const ScenePart number = PartOfName("x-" + stem);
    if (number.id != kNoInstance) part = {"", "", number.id};
  }
  for (const PartMatch& match : matches) {
    const bool name = part.name.empty() || part.name == match.part.name;
    const bool id = part.id == kNoInstance || part.id == match.part.id;
    if (name && id) return match.object;
  }
  for (const ObjectInfo& object : objects) {
    const bool name = part.name.empty() || part.name == object.name;
    const bool id = part.id == kNoInstance || part.id == object.id;
    if (name && id) return object.id;
  }
  return kNoInstance;
}

nlohmann::json SummaryJson(const std::optional<ErrorSummary>& summary) {
  if (!summary) return ToJson(Measured::Undefined("no camera trajectory was given"));
  return {{"rmse", summary->rmse},
          {"mean", summary->mean},
          {"median", summary->median},
          {"max", summary->largest}};
}

// The folder's trajectories, by name.
Expected<std::vector<fs::path>> ListTrajectories(const fs::path& folder) {
  std::error_code failure;
  if (!fs::is_directory(folder, failure)) {
    return UsageError("--trajectories {}: no such folder", folder.string());
  }
  TSDFPP_RETURN_IF_ERROR(CheckLinksBelow(folder));
  std::vector<fs::path> files;
  for (fs::directory_iterator entry(folder, failure), end; !failure && entry != end;
       entry.increment(failure)) {
    if (entry->path().extension() == ".txt") files.push_back(entry->path());
  }
  if (failure) return DataError("{}: cannot be read as a folder", folder.string());
  std::sort(files.begin(), files.end());
  if (files.empty()) {
    return DataError("{}: holds no trajectory, expected <name>-<id>.txt", folder.string());
  }
  return files;
}

Expected<PosePairs> PairsOf(const fs::path& file, const Trajectory& estimate,
                            const Trajectory& truth) {
  PosePairs pairs = PairByFrame(estimate, truth);
  if (pairs.size() > 0) return pairs;
  return DataError("{}: has no frame in common with the sequence's, expected frame numbers",
                   file.string());
}

Expected<void> ScoreCamera(const fs::path& file, const Trajectory& estimate,
                           const Trajectory& camera, TrajectoryEvaluation& out) {
  TSDFPP_ASSIGN(const PosePairs pairs, PairsOf(file, estimate, camera));
  if (const auto errors = PoseErrorsOf(pairs)) {
    out.camera_m = errors->translation_m;
    out.camera_deg = errors->rotation_deg;
    out.camera_frames = pairs.size();
  }
  return {};
}

struct ObjectEstimate {
  fs::path file;
  Trajectory poses;
};

// `camera_estimate`: the camera as the mapper has it, where it wrote that, else as it is.
Expected<void> ScoreObject(InstanceId id, const ObjectEstimate& estimate, const Trajectory& truth,
                           const Trajectory& camera_estimate, const Trajectory& camera,
                           TrajectoryEvaluation& out) {
  TSDFPP_ASSIGN(const PosePairs pairs, PairsOf(estimate.file, estimate.poses, truth));
  const int first = pairs.frames.front();
  if (!camera_estimate.contains(first) || !camera.contains(first)) {
    return DataError("{}: begins at frame {}, of which there is no camera pose",
                     estimate.file.string(), first);
  }
  out.objects[id] =
      ScoreObjectTrajectory(estimate.poses, truth, camera_estimate.at(first), camera.at(first));
  return {};
}

}  // namespace

Expected<TrajectoryEvaluation> EvaluateTrajectories(const fs::path& folder,
                                                    const std::vector<ObjectInfo>& objects,
                                                    const std::vector<PartMatch>& matches,
                                                    const std::map<InstanceId, Trajectory>& truth,
                                                    const Trajectory& camera) {
  TSDFPP_ASSIGN(const std::vector<fs::path> files, ListTrajectories(folder));
  TrajectoryEvaluation out;
  Trajectory camera_estimate = camera;
  std::map<InstanceId, ObjectEstimate> estimates;
  for (const fs::path& file : files) {
    TSDFPP_ASSIGN(Trajectory estimate, ReadTrajectory(file));
    const std::string stem = file.stem().string();
    if (stem == kCamera) {
      TSDFPP_RETURN_IF_ERROR(ScoreCamera(file, estimate, camera, out));
      camera_estimate = std::move(estimate);
      continue;
    }
    const InstanceId id = ObjectOf(stem, objects, matches);
    if (id == kNoInstance) {
      out.remarks.push_back(
          fmt::format("{}: is of no object of the sequence and is left out", file.string()));
      continue;
    }
    if (!estimates.emplace(id, ObjectEstimate{file, std::move(estimate)}).second) {
      return DataError("{}: is of object {}, as is {}", file.string(), id,
                       estimates.at(id).file.string());
    }
  }
  for (const auto& [id, estimate] : estimates) {
    const auto true_one = truth.find(id);
    if (true_one != truth.end()) {
      TSDFPP_RETURN_IF_ERROR(
          ScoreObject(id, estimate, true_one->second, camera_estimate, camera, out));
    } else if (id != kBackground) {
      // The background has no pose; whoever writes one says nothing wrong.
      out.remarks.push_back(
          fmt::format("{}: the sequence has no pose of object {}", estimate.file.string(), id));
    }
  }
  return out;
}

nlohmann::json ToJson(const TrajectoryEvaluation& evaluation) {
  nlohmann::json json{{"camera_frames", evaluation.camera_frames},
                      {"camera_translation_m", SummaryJson(evaluation.camera_m)},
                      {"camera_rotation_deg", SummaryJson(evaluation.camera_deg)},
                      {"objects", nlohmann::json::object()},
                      {"remarks", evaluation.remarks}};
  for (const auto& [id, scores] : evaluation.objects) {
    json["objects"][std::to_string(id)] = ToJson(scores);
  }
  return json;
}

}  // namespace tsdfpp
