#include "eval/sweep/cell_run.h"

#include <algorithm>
#include <random>

namespace tsdfpp {
namespace {

// No two calls have the same, not even on two machines.
std::string NameOfThisRun() {
  std::random_device entropy;
  return fmt::format("{:08x}{:08x}", entropy(), entropy());
}

}  // namespace

CellMapper::CellMapper(const CellSettings& settings, const std::vector<ObjectInfo>& objects)
    : config_(*settings.Pipeline()) {
  if (settings.is_open3d()) {
    SetOpen3dThreads(1);  // workers run side by side
    open3d_ = std::make_unique<Open3dVolume>(config_.map.voxel_m,
                                             config_.map.trunc_front_voxels * config_.map.voxel_m,
                                             Open3dColour::kNone);
  } else {
    pipeline_ = std::make_unique<class Pipeline>(config_, objects);
  }
}

Expected<void> CellMapper::Process(const Frame& frame) {
  if (pipeline_) {
    TSDFPP_ASSIGN(const StepTimes step, pipeline_->Process(frame));
    times_.Add(step);
    frame_s_.push_back(step.Total_s());
  } else {
    frame_s_.push_back(open3d_->Integrate(frame));
  }
  return {};
}

SceneMeshes CellMapper::Meshes(const std::set<InstanceId>& movers) {
  SceneMeshes meshes;
  if (pipeline_) {
    meshes = MeshesOf(pipeline_->map(), movers, mesher_);
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

Expected<std::vector<CellResult>> RunCells(const SequenceVariant& variant,
                                           const std::vector<const Cell*>& cells,
                                           const std::function<void()>& progress) {
  const std::string timed_in = NameOfThisRun();
  TSDFPP_ASSIGN(VariantSource source, VariantSource::Open(variant));
  TSDFPP_ASSIGN(SceneTruth truth,
                SabotagedTruth(variant.sabotage, source.source(), variant.voxel_m));
  std::vector<ObjectInfo> names;
  for (std::size_t i = 0; i < truth.trackers().size(); ++i) {
    names.push_back(truth.surface(i).model().info);
  }
  struct Run {
    Sabotage sabotage;
    CellMapper mapper;
    LastSeenStores last_seen;
    CellResult result;
  };
  std::vector<Run> runs;
  for (const Cell* cell : cells) {
    runs.push_back({cell->settings.sabotage,
                    {cell->settings, source.info().objects},
                    MakeLastSeenStores(truth),
                    {}});
  }
  std::map<int, std::string> digests;
  for (const int index : variant.frames) {
    TSDFPP_ASSIGN(const VariantFrame both, source.Read(index));
    digests[index] = ImageDigest(both.frame);
    TSDFPP_RETURN_IF_ERROR(truth.Observe(both.truth));
    const bool evaluated =
        std::binary_search(variant.evaluated.begin(), variant.evaluated.end(), index);
    const std::set<InstanceId> movers = MoversNow(source.info(), truth);
    for (Run& run : runs) {
      TSDFPP_RETURN_IF_ERROR(run.mapper.Process(both.frame));
      if (!evaluated) continue;
      SceneMeshes meshes = run.mapper.Meshes(movers);
      SabotageMeshes(run.sabotage, meshes);
      std::optional<SceneTruth> visible;
      if (run.sabotage == Sabotage::kVisibleOnly) {
        TSDFPP_ASSIGN(visible, TruthOfRecentFrames(source.source(), truth.recent()));
      }
      CellFrame frame{index, index == variant.examined, {}, MeshDigest(meshes.scene)};
      const Evaluation evaluation =
          EvaluateMeshes(std::move(meshes), visible ? *visible : truth, names, movers,
                         run.mapper.voxel_m(), run.last_seen);
      std::vector<Measured> values = MeasureAll(evaluation, movers, run.mapper.costs());
      if (frame.examined) {
        run.result.examined = values;
        run.result.evaluation = ToJson(evaluation);
        run.result.removed = {movers.begin(), movers.end()};
      }
      values.resize(EvaluationMetricCount());
      frame.values = std::move(values);
      run.result.frames.push_back(std::move(frame));
    }
    if (progress) progress();
  }
  std::vector<CellResult> results;
  for (Run& run : runs) {
    const RunCosts costs = run.mapper.costs();
    run.result.times = costs.times ? costs.times->ToJson() : nlohmann::json(nullptr);
    for (const double seconds : costs.frame_s) run.result.frame_ms.push_back(1e3 * seconds);
    run.result.timed_in = timed_in;
    run.result.image_digests = digests;
    results.push_back(std::move(run.result));
  }
  return results;
}

}  // namespace tsdfpp
