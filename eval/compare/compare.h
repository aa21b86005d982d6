// The paper's experiment (section IV): several maps of the same frames, evaluated on the way and
// after a removal.
#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "eval/adapters/adapter.h"
#include "eval/picture/map_output.h"
#include "eval/score/evaluation.h"
#include "eval/score/id_matching.h"
#include "mapper/pipeline.h"

namespace tsdfpp {

struct CompareConfig {
  std::vector<Method> methods{Method::kTsdf, Method::kTsdfpp, Method::kTsdfppAnchored};
  std::vector<std::string> profiles{"paper", "close"};
  // Of our maps; adapters get the sequence's masks.
  Segmentation segmentation = Segmentation::kGiven;
  SegmenterParts segmenter{};
  // Nothing: votes, unless the segments' ids are the truth's.
  std::optional<AssociationMode> associate;
  VoteConfig votes{};
  CameraSource camera = CameraSource::kGiven;
  BleedingPixels bleeding = BleedingPixels::kAuto;
  MaskRepairMode mask_repair = MaskRepairMode::kOff;
  MaskRepairConfig repair{};
  std::vector<PoseSource> poses{PoseSource::kGiven};
  // Of poses that are tracked: which objects, and by signed distances how (and how the camera is).
  TrackChoice tracked = TrackChoice::kAuto;
  SdfTrackConfig track;
  MapConfig map;  // truncation is the profile's
  IcpConfig icp;
  int every = 10;  // frames between evaluations; the reveal and the last frame are always evaluated
  // "reveal" stops at the reveal frame (the last one where the sequence has none), "end" goes on to
  // the last frame without removal, a number stops there.
  std::string until = "reveal";
  // Writes each map's meshes at every evaluated frame below `<folder>/frames`, as `tsdfpp evaluate`
  // reads them (eval/score/mesh_folder.h).
  bool keep_meshes = false;
  // Other mappers, which get the same frames. They have one voxel size and truncation: the map's,
  // and the first profile's in front of the surface.
  std::vector<AdapterConfig> adapters;
  TruthOptions truth;
  // Said wherever scores are shown, e.g. what stands in for true surfaces; may be empty.
  std::string truth_note;
  bool record = false;  // what `tsdfpp report` shows in 3-D, below record/ (docs/report.md)
};

// Whether the ids of the segments are the truth's.
bool IdsAreObjects(const CompareConfig& config, const SequenceInfo& info);

// What the config says; else by votes where ids of segments are of one frame alone.
AssociationMode AssociationOf(const CompareConfig& config, const SequenceInfo& info);

// What is known of a run besides its scores, until its last evaluation: later frames do not count.
struct RunNotes {
  RunTimes times;
  CameraLog camera;
  std::map<InstanceId, Trajectory> trajectories;  // by the map's ids
  nlohmann::json matched_ids;                     // with votes
  std::int64_t process_growth_bytes = 0;
};

// One map of the comparison.
struct CompareRun {
  CompareRun(const PipelineConfig& config, std::string profile_name,
             const std::vector<ObjectInfo>& objects, const SceneTruth& truth);

  PipelineConfig config;
  std::string profile;
  Pipeline pipeline;
  SceneMesher mesher;   // of its map
  IdMatching matching;  // with votes
  LastSeenStores last_seen;
  RunTimes times;
  std::int64_t process_growth_bytes = 0;  // of resident memory while this map worked
  std::vector<Evaluation> evaluations;    // meshes kept only where pictures need them
  std::vector<MapMemory> memory;          // at each of them
  RunNotes notes;

  // Takes down the map's size and the notes, at each evaluation.
  void TakeNotes();

  // The map's id of a true object, kNoInstance where it has none.
  InstanceId IdOf(InstanceId object) const {
    return config.associate == AssociationMode::kVotes ? matching.IdOf(object) : object;
  }

  // "tsdf++/anchored, close, given poses", and as a folder's name.
  std::string Title() const;
  std::string FolderName() const;
};

// A map that could not be finished: the others go on without it.
struct FailedRun {
  std::string title;
  std::string folder;
  int frame = 0;  // at which it failed
  Error error;
};

struct CompareResult {
  SequenceInfo info;
  CompareConfig config;
  std::string run;  // what run.json calls this run (eval/run/run_folder.h)
  int last_frame = 0;
  std::optional<int> reveal_frame;
  std::set<InstanceId> movers;
  std::unique_ptr<SceneTruth> truth;              // as at the last frame
  Trajectory camera;                              // true, by frame
  std::vector<std::unique_ptr<CompareRun>> runs;  // that were finished
  std::vector<FailedRun> failed;
  // Why the frames ended before `last_frame` of the plan; results are those until then.
  std::optional<Error> stopped;
  std::vector<std::unique_ptr<AdapterRun>> adapters;  // failed ones among them
  double read_s = 0;                                  // rendering or reading
  double total_s = 0;
};

// Whether the maps are evaluated at a frame: every `every`-th, the reveal, the last.
bool IsEvaluated(const CompareResult& result, int frame);

// Called after each frame.
using CompareProgress = std::function<void(int done, int total)>;

// Errors: those of the source; kUsage where `until` is no frame of it or the config is wrong; kData
// where a frame has no mask; kEnvironment where `out` cannot be written or another process has it.
// A map or an adapter that fails is reported, and the others go on; a frame that cannot be had ends
// the frames, and what was evaluated before is kept (`failed` and `stopped` of the result); an
// error is returned where nothing is left to show. What it writes appears below `out` at the end,
// all together: meshes, pictures, summary.json, frames.csv, report.html and run.json.
Expected<CompareResult> RunCompare(FrameSource& source, const CompareConfig& config,
                                   const std::filesystem::path& out, const std::string& command,
                                   const CompareProgress& progress);

}  // namespace tsdfpp
