#include "cli/map_start.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <utility>

#include "cli/pose_choice.h"
#include "sequence/sequence_json.h"

namespace tsdfpp {
namespace {

// Files of calibrations have two decimals at least.
constexpr double kSameLens_px = 0.01;

// Opens the sequence and says where its masks come from.
Expected<void> OpenInto(MapStart& start, const SequenceArguments& arguments,
                        std::optional<Segmentation> segmentation) {
  TSDFPP_ASSIGN(start.source, OpenArguments(arguments));
  start.info = start.source->info();
  if (segmentation && IdsAreOfOneFrame(*segmentation)) {
    start.config.segmentation = *segmentation;
    return {};
  }
  if (segmentation == Segmentation::kNone) {
    start.config.segmentation = Segmentation::kNone;
    start.mask_remark = fmt::format(
        "{}: its masks are not read (--segmentation none), so all of it is taken for background",
        start.info.name);
    return {};
  }
  start.has_masks = true;
  // A scene has masks, and a frame of it takes long to render.
  if (std::filesystem::path(arguments.path).extension() == ".toml") return {};
  TSDFPP_ASSIGN(const Frame first, start.source->Read(start.info.first_index));
  if (!first.mask.empty()) return {};
  if (segmentation == Segmentation::kGiven) {
    return DataError("{}: has no masks, expected one for each frame, for --segmentation gt",
                     arguments.path);
  }
  start.has_masks = false;
  start.config.segmentation = Segmentation::kNone;
  start.mask_remark =
      fmt::format("{}: has no masks, so all of it is taken for background", start.info.name);
  return {};
}

// Who says which object a segment is.
Expected<void> ChooseAssociation(MapStart& start, const MapWishes& wishes) {
  const bool of_objects = start.ids_are_objects();
  const bool has_segments = start.config.segmentation != Segmentation::kNone;
  start.config.associate = wishes.associate.value_or(
      of_objects || !has_segments ? AssociationMode::kGiven : AssociationMode::kVotes);
  if (start.by_votes() || of_objects || !has_segments) return {};
  if (IdsAreOfOneFrame(start.config.segmentation)) {
    return UsageError(
        "--associate given: the ids of --segmentation {} are drawn anew in every frame, expected "
        "--associate votes",
        SegmentationName(start.config.segmentation));
  }
  return UsageError(
      "--associate given: the ids in the masks of {} are drawn anew in every frame, expected "
      "--associate votes",
      start.info.name);
}

Expected<void> ChooseVotes(MapStart& start, const MapWishes& wishes) {
  TSDFPP_RETURN_IF_ERROR(CheckVotes(wishes.votes, start.config.associate));
  if (wishes.votes) start.config.votes = *wishes.votes;
  return {};
}

// Who says where that object is.
Expected<void> ChoosePoses(MapStart& start, const MapWishes& wishes) {
  if (wishes.poses) {
    start.config.poses = *wishes.poses;
    if (start.config.poses != PoseSource::kGiven || !start.by_votes()) {
      return CheckPoses(start.config.method, start.config.poses);
    }
    return UsageError(
        "--poses gt are the poses of given ids, and --associate votes gives ids of its own: "
        "expected --poses icp or track, or --associate given");
  }
  // Of the background alone there is nothing to track.
  if (start.config.segmentation == Segmentation::kNone && !start.by_votes()) return {};
  PoseChoice choice = DefaultPoses(start.info, start.config.associate, {start.config.method});
  start.config.poses = choice.poses;
  start.pose_remark = std::move(choice.remark);
  return {};
}

// What is tracked, and how.
Expected<void> ChooseTracking(MapStart& start, const TrackWishes& wishes) {
  TSDFPP_RETURN_IF_ERROR(CheckTracking(wishes, {start.config.poses}, start.config.camera));
  start.config.tracked = wishes.tracked;
  if (wishes.config) start.config.track = *wishes.config;
  return {};
}

// Whether a map's objects are those of its sequence, and then what masks showed besides.
bool AreOfSequence(const std::vector<ObjectInfo>& objects, const std::vector<ObjectInfo>& listed) {
  return objects.size() >= listed.size() &&
         std::equal(listed.begin(), listed.end(), objects.begin()) &&
         std::all_of(objects.begin() + static_cast<std::ptrdiff_t>(listed.size()), objects.end(),
                     [](const ObjectInfo& object) {
                       return object.semantic_class.empty() &&
                              object.name.starts_with(NameOfUnlisted(object.id));
                     });
}

bool IsSameLens(const Intrinsics& a, const Intrinsics& b) {
  const auto is_near = [](double x, double y) { return std::abs(x - y) <= kSameLens_px; };
  return a.width == b.width && a.height == b.height && is_near(a.fx, b.fx) && is_near(a.fy, b.fy) &&
         is_near(a.cx, b.cx) && is_near(a.cy, b.cy);
}

std::string TextOf(const Intrinsics& k) {
  return fmt::format("{}x{} (fx {:.6g}, fy {:.6g}, cx {:.6g}, cy {:.6g})", k.width, k.height, k.fx,
                     k.fy, k.cx, k.cy);
}

// Whether the opened sequence can go on with a loaded map.
Expected<void> CheckGoesOn(const MapStart& start, const std::string& file, const MappedRun& run,
                           const std::string& path) {
  // One that another program saved is of no sequence; with votes the map's objects are its own.
  if (run.sequence.empty() || start.info.name != run.sequence ||
      (!start.by_votes() && !AreOfSequence(run.objects, start.info.objects))) {
    return UsageError("--load {} is a map of '{}', expected one of {}, '{}'", file, run.sequence,
                      path, start.info.name);
  }
  if (run.recording && !IsSameLens(run.recording->intrinsics, start.info.intrinsics)) {
    return UsageError("--load {} is a map of images of {}, expected one of {}, whose are {}", file,
                      TextOf(run.recording->intrinsics), path, TextOf(start.info.intrinsics));
  }
  if (start.by_votes() || start.ids_are_objects() ||
      start.config.segmentation == Segmentation::kNone) {
    return {};
  }
  return UsageError(
      "--load {} is a map by given ids, and the ids in the masks of {} are drawn anew in every "
      "frame, expected --segmentation none, or a map by votes",
      file, path);
}

// What is no reason to refuse: the same scene has other depth on another machine.
Expected<void> RemarkOnRecording(MapStart& start, const std::string& file, const MappedRun& run) {
  const bool is_there = run.last_frame >= start.info.first_index &&
                        run.last_frame < start.info.first_index + start.info.frame_count;
  if (run.recording && is_there) {
    TSDFPP_ASSIGN(const Frame last, start.source->Read(run.last_frame));
    if (HashOfDepth(last) != run.recording->last_depth) {
      start.load_remarks.push_back(fmt::format(
          "--load {}: frame {} of {} has another depth image than the map was made of, expected "
          "the same recording, with the same sensor",
          file, run.last_frame, start.info.name));
    }
  }
  const bool is_given = start.config.camera == CameraSource::kGiven;
  if (is_given && run.recording && run.recording->camera) {
    start.load_remarks.push_back(fmt::format(
        "--load {}: its camera was found by the map; from frame {} on it is where it is given "
        "(--camera track or refine goes on)",
        file, start.first));
  }
  if (!is_given && !run.recording) {
    start.load_remarks.push_back(fmt::format(
        "--load {}: it does not say where its camera was, so that of frame {} is taken as given",
        file, start.first));
  }
  return {};
}

// What the segments' ids stand for.
std::vector<ObjectInfo> ObjectsOfSegments(const MapStart& start) {
  return start.ids_are_objects() ? start.info.objects : std::vector<ObjectInfo>{};
}

}  // namespace

Expected<MapStart> StartNew(const PipelineConfig& config, const SequenceArguments& source,
                            const MapWishes& wishes, int until) {
  MapStart start;
  start.config = config;
  start.config.segmenter = wishes.segmenter;
  TSDFPP_RETURN_IF_ERROR(OpenInto(start, source, wishes.segmentation));
  TSDFPP_RETURN_IF_ERROR(ChooseAssociation(start, wishes));
  TSDFPP_RETURN_IF_ERROR(ChooseVotes(start, wishes));
  TSDFPP_RETURN_IF_ERROR(ChoosePoses(start, wishes));
  start.config.camera = wishes.camera;
  start.config.bleeding = wishes.bleeding;
  start.config.mask_repair = wishes.repair.mode;
  start.config.repair = wishes.repair.config;
  TSDFPP_RETURN_IF_ERROR(ChooseTracking(start, wishes.track));
  TSDFPP_RETURN_IF_ERROR(start.config.Validate());
  start.first = start.info.first_index;
  const int end = start.info.first_index + start.info.frame_count - 1;
  start.last = until < 0 ? end : until;
  if (start.last < start.first || start.last > end) {
    return UsageError("--until {} is out of range: {} has frames {} to {}", start.last,
                      start.info.name, start.first, end);
  }
  start.pipeline = std::make_unique<Pipeline>(start.config, ObjectsOfSegments(start));
  return start;
}

Expected<MapStart> StartLoaded(const std::string& file, const SequenceArguments& source,
                               const MapWishes& wishes, int until) {
  TSDFPP_ASSIGN(LoadedMap loaded, LoadMap(file));
  MappedRun run;
  if (loaded.run) {
    run = std::move(*loaded.run);
  } else {
    // Saved by another program, which had no sequence.
    run.poses = PoseSourceName(PoseSource::kGiven);
    for (const InstanceId id : loaded.map->Objects()) {
      run.objects.push_back({id, NameOfUnlisted(id), ""});
    }
  }
  MapStart start;
  start.config.method = loaded.map->method();
  start.config.map = loaded.map->config();
  start.config.associate = run.associate;
  const auto poses = PoseSourceFromName(run.poses);
  if (poses) start.config.poses = *poses;
  const auto fits = poses ? start.config.Validate() : tl::unexpected(poses.error());
  if (!fits) return DataError("{}: its run cannot go on: {}", file, fits.error().message);
  start.config.segmenter = wishes.segmenter;
  start.config.camera = wishes.camera;
  start.config.bleeding = wishes.bleeding;
  start.config.mask_repair = wishes.repair.mode;
  start.config.repair = wishes.repair.config;
  if (!source.path.empty()) TSDFPP_RETURN_IF_ERROR(ChooseVotes(start, wishes));
  TSDFPP_RETURN_IF_ERROR(CheckCamera(start.config.method, wishes.camera));
  TSDFPP_RETURN_IF_ERROR(ChooseTracking(start, wishes.track));
  const bool votes = start.by_votes();
  start.info.name = run.sequence;
  start.info.objects = run.objects;
  start.first = run.last_frame + 1;
  start.last = run.last_frame;
  if (!source.path.empty()) {
    TSDFPP_RETURN_IF_ERROR(OpenInto(start, source, wishes.segmentation));
    TSDFPP_RETURN_IF_ERROR(start.config.Validate());
    TSDFPP_RETURN_IF_ERROR(CheckGoesOn(start, file, run, source.path));
    const int end = start.info.first_index + start.info.frame_count - 1;
    start.last = until < 0 ? end : until;
    if (until < 0 && start.last < start.first) {
      return UsageError("--load {} goes to frame {}, and {} has none after it", file,
                        run.last_frame, start.info.name);
    }
    if (start.last < start.first || start.last > end) {
      return UsageError(
          "--until {} is out of range: {} has frames up to {}, and --load {} goes to {}",
          start.last, start.info.name, end, file, run.last_frame);
    }
    TSDFPP_RETURN_IF_ERROR(RemarkOnRecording(start, file, run));
  } else if (until >= 0) {
    return UsageError("--until {} needs a sequence to map", until);
  } else if (const char* option = source.Option(); option != nullptr) {
    return UsageError("{} needs a sequence to map", option);
  } else if (source.scene.IsAny()) {
    return UsageError("{} needs a scene to map", source.scene.seed ? "--seed" : "--sensor");
  } else if (wishes.track.tracked != TrackChoice::kAuto || wishes.track.config) {
    return UsageError("{} needs a sequence to map",
                      wishes.track.config ? "--track-config" : "--track");
  } else if (wishes.camera != CameraSource::kGiven) {
    return UsageError("--camera {} needs a sequence to map", CameraSourceName(wishes.camera));
  } else if (wishes.bleeding != BleedingPixels::kAuto) {
    return UsageError("--bleeding {} needs a sequence to map", BleedingPixelsName(wishes.bleeding));
  } else if (wishes.repair.mode == MaskRepairMode::kOn) {
    return UsageError("--mask-repair on needs a sequence to map");
  } else if (wishes.votes) {
    return UsageError("--vote-config needs a sequence to map");
  }
  const std::vector<ObjectInfo> nobody;
  start.pipeline = std::make_unique<Pipeline>(
      start.config, votes ? ObjectsOfSegments(start) : run.objects, std::move(loaded.map),
      std::move(run.trajectories), votes ? run.objects : nobody);
  start.recording = run.recording;
  if (run.recording && run.recording->camera) start.pipeline->GoOnFrom(*run.recording->camera);
  return start;
}

Expected<Frame> ReadToMap(const MapStart& start, int index) {
  TSDFPP_ASSIGN(Frame frame, start.source->Read(index));
  if (!start.has_masks || *start.has_masks != frame.mask.empty()) return frame;
  if (*start.has_masks) {
    return DataError("{}: frame {} has no mask and frame {} has one, expected masks for all",
                     start.info.name, index, start.info.first_index);
  }
  return DataError("{}: frame {} has a mask and frame {} has none, expected masks for all",
                   start.info.name, index, start.info.first_index);
}

std::vector<ObjectInfo> ObjectsOf(const MapStart& start) {
  std::vector<ObjectInfo> objects = start.pipeline->Objects();
  if (start.by_votes()) return objects;
  const std::vector<ObjectInfo>& listed = start.info.objects;
  std::erase_if(objects, [&](const ObjectInfo& object) {
    return std::any_of(listed.begin(), listed.end(),
                       [&](const ObjectInfo& other) { return other.id == object.id; });
  });
  std::sort(objects.begin(), objects.end(),
            [](const ObjectInfo& a, const ObjectInfo& b) { return a.id < b.id; });
  objects.insert(objects.begin(), listed.begin(), listed.end());
  return objects;
}

std::uint64_t HashOfDepth(const Frame& frame) {
  const cv::Mat depth = frame.depth.isContinuous() ? frame.depth : frame.depth.clone();
  return Fnv1a64({reinterpret_cast<const char*>(depth.data), depth.total() * depth.elemSize()});
}

MappedRun RunOf(const MapStart& start, int last_frame, std::optional<std::uint64_t> last_depth) {
  MappedRun run;
  run.sequence = start.info.name;
  run.objects = ObjectsOf(start);
  run.associate = start.config.associate;
  run.poses = PoseSourceName(start.config.poses);
  run.last_frame = last_frame;
  run.trajectories = start.pipeline->trajectories();
  run.recording = start.recording;
  if (last_depth) {
    run.recording = {start.info.intrinsics, *last_depth, start.pipeline->camera_place()};
  }
  return run;
}

}  // namespace tsdfpp
