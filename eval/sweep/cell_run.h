// Runs cells: several mappers on the same frames, which are rendered once.
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "eval/adapters/open3d_peer.h"
#include "eval/score/id_matching.h"
#include "eval/sweep/cell.h"
#include "eval/sweep/sequence_variant.h"
#include "mapper/pipeline.h"

namespace tsdfpp {

// The mapper of a cell: ours behind the pipeline, or Open3D's volume of a static world.
class CellMapper {
 public:
  // The settings must be valid. Errors: those of OwnInstanceNetwork.
  static Expected<CellMapper> Make(const CellSettings& settings,
                                   const std::vector<ObjectInfo>& objects);

  // Maps the frame; of its truth only the mask is looked at, by the matching of ids that are the
  // map's own. Errors: those of Pipeline::Process.
  Expected<void> Process(const VariantFrame& both);
  // To be called at each evaluated frame, before its meshes: where the map's ids are its own, those
  // that came since the last call are matched with the truth's.
  void SettleIds();
  // What an evaluation looks at, after the removals that it needs, with the truth's ids. Open3D's
  // mesh has no labels.
  SceneMeshes Meshes(const std::set<InstanceId>& movers);
  RunCosts costs() const;
  double voxel_m() const { return config_.map.voxel_m; }
  // nullptr of Open3D.
  const MapRepresentation* map() const { return pipeline_ ? &pipeline_->map() : nullptr; }

 private:
  explicit CellMapper(PipelineConfig config) : config_(std::move(config)) {}
  bool HasOwnIds() const { return config_.associate == AssociationMode::kVotes; }

  PipelineConfig config_;
  std::unique_ptr<Pipeline> pipeline_;
  SceneMesher mesher_;   // of its map
  IdMatching matching_;  // with votes
  std::unique_ptr<Open3dVolume> open3d_;
  RunTimes times_;               // not of Open3D
  std::vector<double> frame_s_;  // of each frame
};

// MapKey() without what is broken of the scoring: the same of cells of the same frames that are one
// map, looked at in other ways.
std::string SharedMapKey(const CellSettings& settings);

// The results of `cells`, which all have the frames of `variant`, in their order. Those that
// have one map (SharedMapKey()) are mapped once. `progress` is called after each frame. Errors:
// those of the source; kData where a frame does not fit the truth.
Expected<std::vector<CellResult>> RunCells(const SequenceVariant& variant,
                                           const std::vector<const Cell*>& cells,
                                           const std::function<void()>& progress);

}  // namespace tsdfpp
