#include "eval/sweep/cell_run.h"

#include <algorithm>
#include <random>

#include "mapper/instance_network.h"

namespace tsdfpp {
namespace {

// No two calls have the same, not even on two machines.
std::string NameOfThisRun() {
  std::random_device entropy;
  return fmt::format("{:08x}{:08x}", entropy(), entropy());
}

}  // namespace

Expected<CellMapper> CellMapper::Make(const CellSettings& settings,
                                      const std::vector<ObjectInfo>& objects) {
  CellMapper mapper(*settings.Pipeline());
  PipelineConfig& config = mapper.config_;
  if (settings.is_open3d()) {
    SetOpen3dThreads(1);  // workers run side by side
    mapper.open3d_ = std::make_unique<Open3dVolume>(
        config.map.voxel_m, config.map.trunc_front_voxels * config.map.voxel_m,
        Open3dColour::kNone);
    return mapper;
  }
  if (UsesNetwork(config.segmentation)) {
    TSDFPP_ASSIGN(config.segmenter.finder, OwnInstanceNetwork(config.segmenter.network));
  }
  mapper.pipeline_ = std::make_unique<class Pipeline>(
      config, mapper.HasOwnIds() ? std::vector<ObjectInfo>{} : objects);
  return mapper;
}

Expected<void> CellMapper::Process(const VariantFrame& both) {
  if (pipeline_) {
    TSDFPP_ASSIGN(const StepTimes step, pipeline_->Process(both.frame));
    times_.Add(step);
    frame_s_.push_back(step.Total_s());
    if (HasOwnIds() && !both.truth.mask.empty()) {
      matching_.Observe(pipeline_->labels(), both.truth.mask);
    }
  } else {
    frame_s_.push_back(open3d_->Integrate(both.frame));
  }
  return {};
}

void CellMapper::SettleIds() {
  if (HasOwnIds()) matching_.Settle();
}

SceneMeshes CellMapper::Meshes(const std::set<InstanceId>& movers) {
  SceneMeshes meshes;
  if (pipeline_) {
    meshes = HasOwnIds() ? MeshesOf(pipeline_->map(), movers, matching_, mesher_)
                         : MeshesOf(pipeline_->map(), movers, mesher_);
    times_.mesh_s.push_back(meshes.mesh_s);
  } else {
    meshes.scene = open3d_->Triangles();
    meshes.labelled = false;
  }
  return meshes;
}

RunCosts CellMapper::costs() const {
  if (!pipeline_) return {std::nullopt, frame_s_, open3d_->OccupiedBytes()};
  return {times_, frame_s_, pipeline_->map().Memory().bytes};
}

namespace {

// A cell while its frames go by.
struct CellRun {
  Sabotage sabotage;
  std::size_t mapper;  // which
  LastSeenStores last_seen;
  CellResult result;
};

// The truth that cells are evaluated against at the frame that it has seen last.
struct TruthNow {
  const SequenceVariant& variant;
  VariantSource& source;
  const SceneTruth& truth;
  std::vector<ObjectInfo> names;
  std::set<InstanceId> movers;
};

// `meshes` are the mapper's.
Expected<void> EvaluateCell(CellRun& run, const CellMapper& mapper, SceneMeshes meshes, int index,
                            const TruthNow& now) {
  SabotageMeshes(run.sabotage, meshes);
  std::optional<SceneTruth> visible;
  if (run.sabotage == Sabotage::kVisibleOnly) {
    TSDFPP_ASSIGN(visible, TruthOfRecentFrames(now.source.source(), now.truth.recent()));
  }
  CellFrame frame{index, index == now.variant.examined, {}, MeshDigest(meshes.scene)};
  const Evaluation evaluation =
      EvaluateMeshes(std::move(meshes), visible ? *visible : now.truth, now.names, now.movers,
                     mapper.voxel_m(), run.last_seen);
  std::vector<Measured> values = MeasureAll(evaluation, now.movers, mapper.costs());
  if (frame.examined) {
    run.result.examined = values;
    run.result.evaluation = ToJson(evaluation);
    run.result.removed = {now.movers.begin(), now.movers.end()};
  }
  values.resize(EvaluationMetricCount());
  frame.values = std::move(values);
  run.result.frames.push_back(std::move(frame));
  return {};
}

// What is known of a cell once all frames went by.
CellResult Finished(CellRun& run, const RunCosts& costs,
                    const std::map<int, std::string>& image_digests, const std::string& timed_in) {
  run.result.times = costs.times ? costs.times->ToJson() : nlohmann::json(nullptr);
  for (const double seconds : costs.frame_s) run.result.frame_ms.push_back(1e3 * seconds);
  run.result.timed_in = timed_in;
  run.result.image_digests = image_digests;
  return std::move(run.result);
}

}  // namespace

std::string SharedMapKey(const CellSettings& settings) {
  CellSettings mapped = settings;
  if (IsOfScoring(mapped.sabotage)) mapped.sabotage = Sabotage::kNone;
  return MapKey(mapped);
}

Expected<std::vector<CellResult>> RunCells(const SequenceVariant& variant,
                                           const std::vector<const Cell*>& cells,
                                           const std::function<void()>& progress) {
  const std::string timed_in = NameOfThisRun();
  TSDFPP_ASSIGN(VariantSource source, VariantSource::Open(variant));
  TSDFPP_ASSIGN(SceneTruth truth,
                SabotagedTruth(variant.sabotage, source.source(), variant.voxel_m));
  TruthNow now{variant, source, truth, {}, {}};
  for (std::size_t i = 0; i < truth.trackers().size(); ++i) {
    now.names.push_back(truth.surface(i).model().info);
  }
  std::vector<CellMapper> mappers;
  std::vector<CellRun> runs;
  std::map<std::string, std::size_t> mapper_of;
  for (const Cell* cell : cells) {
    const auto [mapper, is_new] =
        mapper_of.try_emplace(SharedMapKey(cell->settings), mappers.size());
    if (is_new) {
      TSDFPP_ASSIGN(CellMapper made, CellMapper::Make(cell->settings, source.info().objects));
      mappers.push_back(std::move(made));
    }
    runs.push_back({cell->settings.sabotage, mapper->second, MakeLastSeenStores(truth), {}});
  }
  std::map<int, std::string> digests;
  for (const int index : variant.frames) {
    TSDFPP_ASSIGN(const VariantFrame both, source.Read(index));
    digests[index] = ImageDigest(both.frame);
    TSDFPP_RETURN_IF_ERROR(truth.Observe(both.truth));
    const bool evaluated = variant.IsEvaluated(index);
    now.movers = MoversNow(source.info(), truth);
    for (std::size_t m = 0; m < mappers.size(); ++m) {
      TSDFPP_RETURN_IF_ERROR(mappers[m].Process(both));
      if (!evaluated) continue;
      mappers[m].SettleIds();
      const SceneMeshes meshes = mappers[m].Meshes(now.movers);
      for (CellRun& run : runs) {
        if (run.mapper != m) continue;
        TSDFPP_RETURN_IF_ERROR(EvaluateCell(run, mappers[m], meshes, index, now));
      }
    }
    if (progress) progress();
  }
  std::vector<CellResult> results;
  results.reserve(runs.size());
  for (CellRun& run : runs) {
    results.push_back(Finished(run, mappers[run.mapper].costs(), digests, timed_in));
  }
  return results;
}

}  // namespace tsdfpp
