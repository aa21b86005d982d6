#include "mapper/methods/single_field_map.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "mapper/map_reach.h"
#include "mapper/mesh/mesh_tools.h"
#include "mapper/mesh/scene_parts.h"
#include "mapper/methods/cast_by_removal.h"
#include "mapper/methods/layered_map.h"
#include "mapper/methods/map_invariants.h"
#include "mapper/rays/ray_pass.h"
#include "mapper/volume/allocation.h"
#include "mapper/volume/freeing.h"
#include "mapper/volume/pull_back.h"
#include "mapper/volume/rims.h"

namespace tsdfpp {
namespace {

constexpr std::size_t kBlocksPerTask = 16;

std::size_t At(int i) { return static_cast<std::size_t>(i); }

}  // namespace

SingleFieldMap::SingleFieldMap(const MapConfig& config, FieldRule rule)
    : config_(config), rule_(rule) {}

Method SingleFieldMap::method() const {
  switch (rule_) {
    case FieldRule::kOverwrite:
      return Method::kTsdf;
    case FieldRule::kKeepNearer:
      return Method::kTsdfMin;
    case FieldRule::kGuarded:
      return Method::kTsdfGuarded;
    case FieldRule::kStatic:
      return Method::kTsdfStatic;
  }
  std::abort();
}

std::unique_ptr<MapRepresentation> SingleFieldMap::Clone() const {
  return std::make_unique<SingleFieldMap>(*this);
}

void SingleFieldMap::Fuse(const Frame& frame, const cv::Mat& labels) {
  RequireReach(*this, frame, labels);
  const FrameView view(frame, labels);
  const auto lattice_of = [&](InstanceId) -> LatticeOfLabel {
    return {Pose::Identity(), &field_.directory()};
  };
  const std::size_t blocks_before = field_.size();
  for (const auto& [id, indices] : BlocksAlongRays(view, config_, lattice_of)) {
    for (const Index3& index : indices) {
      field_.FindOrAdd(index);
      labels_.FindOrAdd(index);
    }
  }
  const CameraFromLattice T_CW(frame.T_WC, Pose::Identity(), true);
  const auto& blocks = field_.entries();
  const std::vector<PlannedBlock> planned = PlanBlocks(
      view, blocks.size(), config_.voxel(), config_.back(), [&](std::size_t i) -> BlockCandidate {
        return {blocks[i].index, &T_CW, kNoInstance, true};
      });
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, planned.size(), kBlocksPerTask),
      [&](const tbb::blocked_range<std::size_t>& range) {
        for (std::size_t k = range.begin(); k != range.end(); ++k) {
          const auto& [index, block] = blocks[planned[k].number];
          const TsdfBlock* next =
              k + 1 == range.end() ? nullptr : blocks[planned[k + 1].number].block.get();
          FuseBlock(view, PlaceOf(T_CW, index, config_.voxel(), planned[k]), planned[k].label, next,
                    *block, *labels_.Find(index));
        }
      },
      tbb::simple_partitioner());
  if (rule_ == FieldRule::kGuarded && config_.rims) CompleteRims(view);
  // A frame makes no voxel unobserved; it may have made blocks in vain.
  FreeEmpty(EmptyFrom(field_, blocks_before, [](const TsdfBlock& b) { return !b.AnyObserved(); }));
  CheckInDebugBuilds(*this);
}

void SingleFieldMap::FuseBlock(const FrameView& frame, const BlockPlace& place, InstanceId label,
                               const TsdfBlock* next, TsdfBlock& block, LabelBlock& labels) const {
  FusionRule rule;
  rule.id = label;
  rule.one_label = label != kNoInstance;
  rule.front = config_.front();
  rule.back = config_.back();
  // Colours go wherever labels do: a triangle's label and colour are of the same observations.
  rule.colour_band = std::numeric_limits<float>::infinity();
  rule.first_colour_band = rule.colour_band;
  rule.weight_cap = static_cast<float>(config_.weight_cap);
  LabelVotes votes{labels.id.data(), labels.confidence.data(), config_.confidence_cap};
  votes.band = config_.vote_band();
  if (rule_ == FieldRule::kGuarded) votes.guard = config_.voxel();
  const FusionResult result = FuseVoxels(frame.kernel, place, rule, block, next, &votes);
  if (result.changed) block.revision = NewRevision();
  if (!votes.any_label_changed) return;
  for (const InstanceId id : labels.id) {
    if (id != kNoInstance) labels.ever |= EverBit(id);
  }
}

void SingleFieldMap::CompleteRims(const FrameView& frame) {
  const auto field_of = [&](InstanceId) -> std::optional<RimVolume> {
    return RimVolume{&field_, Pose::Identity(), true};
  };
  const auto is_own = [&](InstanceId id, const Index3& voxel) {
    const LabelBlock* labels = labels_.Find(BlockOf(voxel));
    return labels != nullptr && labels->id[At(PlaceInBlock(voxel))] == id;
  };
  for (const RimBlock& rim : FindRims(frame, config_, field_of, is_own)) {
    TsdfBlock& block = field_.FindOrAdd(rim.index);
    LabelBlock& labels = labels_.FindOrAdd(rim.index);
    for (const RimValue& value : rim.voxels) {
      const std::size_t i = At(value.place);
      if (block.weight[i] > 0) continue;  // an object before this one has completed it
      FuseRim(frame, config_, value, block);
      labels.id[i] = rim.id;
      labels.confidence[i] = 1;
    }
    labels.ever |= EverBit(rim.id);
    block.UpdateMasks(config_.back());
  }
}

void SingleFieldMap::FreeEmpty(const std::vector<Index3>& blocks) {
  std::vector<Index3> empty;
  for (const Index3& index : blocks) {
    if (!field_.Find(index)->AnyObserved()) empty.push_back(index);
  }
  field_.Erase(empty);
  labels_.Erase(empty);
}

std::vector<Index3> SingleFieldMap::Vacate(InstanceId id, RemovedVoxels become) {
  std::vector<Index3> blocks;
  for (const auto& entry : labels_.entries()) {
    LabelBlock& labels = *entry.block;
    if ((labels.ever & EverBit(id)) == 0) continue;
    TsdfBlock& block = *field_.Find(entry.index);
    bool changed = false;
    for (std::size_t i = 0; i < kBlockVoxels; ++i) {
      if (!IsObjectsVoxel(block, labels, i, id)) continue;
      block.Clear(static_cast<int>(i));
      if (become == RemovedVoxels::kFree) {
        block.distance[i] = config_.front();
        block.weight[i] = 1;
      }
      labels.id[i] = kNoInstance;
      labels.confidence[i] = 0;
      changed = true;
    }
    if (!changed) continue;
    block.UpdateMasks(config_.back());
    blocks.push_back(entry.index);
  }
  return blocks;
}

void SingleFieldMap::Remove(InstanceId id) {
  FreeEmpty(Vacate(id, config_.removed_voxels));
  T_WO_.erase(id);
  CheckInDebugBuilds(*this);
}

ObjectMove SingleFieldMap::MoveTo(InstanceId id, const Pose& T_WO) const {
  ObjectMove move;
  const auto known = T_WO_.find(id);
  if (known == T_WO_.end() || SameNumbers(known->second, T_WO) || rule_ == FieldRule::kStatic) {
    return move;
  }
  move.T = T_WO * known->second.inverse();
  move.blocks = &field_;
  move.is_moved = [this, id](const Index3& index) {
    const auto& labels = labels_.Find(index)->id;
    return std::find(labels.begin(), labels.end(), id) != labels.end();
  };
  return move;
}

void SingleFieldMap::SetObjectPose(InstanceId id, const Pose& T_WO) {
  const auto [known, first] = T_WO_.emplace(id, T_WO);
  if (first || SameNumbers(known->second, T_WO)) return;
  const Pose T_rel = T_WO * std::exchange(known->second, T_WO).inverse();
  if (rule_ == FieldRule::kStatic) return;

  // The sources: all that is observed and labelled so, free space included; and their labels.
  TsdfGrid source;
  BlockGrid<LabelBlock> source_labels;
  for (const auto* entry : labels_.Sorted()) {
    if ((entry->block->ever & EverBit(id)) == 0) continue;
    auto block = std::make_unique<TsdfBlock>(*field_.Find(entry->index));
    bool any = false;
    for (std::size_t i = 0; i < kBlockVoxels; ++i) {
      if (entry->block->id[i] != id) block->weight[i] = 0;
      any = any || block->weight[i] > 0;
    }
    if (!any) continue;
    block->UpdateMasks(config_.back());
    source.Add(entry->index, std::move(block));
    source_labels.FindOrAdd(entry->index) = *entry->block;
  }
  const std::vector<Index3> left = Vacate(id, RemovedVoxels::kUnobserved);

  const VoxelReader reader(source);
  const Pose T_inverse = T_rel.inverse();
  const std::array<double, 12> T_inverse_rows = RowsOf(T_inverse);
  const std::vector<Index3> touched = BlocksTouchedBy(reader, T_rel, config_.voxel_m);
  std::vector<std::unique_ptr<TsdfBlock>> arrivals(touched.size());
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, touched.size(), kBlocksPerTask),
      [&](const tbb::blocked_range<std::size_t>& range) {
        for (std::size_t i = range.begin(); i != range.end(); ++i) {
          auto block = std::make_unique<TsdfBlock>();
          if (ResampleBlock(reader, T_inverse_rows, config_.voxel_m, touched[i], *block,
                            config_.resampling)) {
            arrivals[i] = std::move(block);
          }
        }
      },
      tbb::simple_partitioner());
  const auto confidence_at = [&](const Index3& v) {
    const Eigen::Vector3d q =
        T_inverse * (Eigen::Vector3d(v.x, v.y, v.z) * config_.voxel_m) / config_.voxel_m;
    const auto nearest = [](double x) {  // as ResampleBlock takes it
      return static_cast<int>(std::floor(x)) +
             (static_cast<float>(x - std::floor(x)) >= 0.5F ? 1 : 0);
    };
    const Index3 from{nearest(q.x()), nearest(q.y()), nearest(q.z())};
    return source_labels.Find(BlockOf(from))->confidence[At(PlaceInBlock(from))];
  };
  for (std::size_t b = 0; b < touched.size(); ++b) {
    if (arrivals[b] == nullptr) continue;
    Arrive(id, touched[b], *arrivals[b],
           [&](std::size_t i) { return confidence_at(VoxelAt(touched[b], static_cast<int>(i))); });
  }
  FreeEmpty(left);
  CheckInDebugBuilds(*this);
}

void SingleFieldMap::Arrive(InstanceId id, const Index3& index, const TsdfBlock& arrival,
                            const std::function<std::uint16_t(std::size_t)>& confidence) {
  TsdfBlock* block = nullptr;
  LabelBlock* labels = nullptr;
  for (std::size_t i = 0; i < kBlockVoxels; ++i) {
    if (arrival.weight[i] <= 0 || !Moves(arrival.distance[i])) continue;
    if (block == nullptr) {
      block = &field_.FindOrAdd(index);
      labels = &labels_.FindOrAdd(index);
    }
    if (rule_ == FieldRule::kKeepNearer && block->weight[i] > 0 && labels->id[i] != id &&
        std::abs(block->distance[i]) <= std::abs(arrival.distance[i])) {
      continue;
    }
    block->distance[i] = arrival.distance[i];
    block->weight[i] = arrival.weight[i];
    block->SetColour(i, arrival.FixedColourAt(i), arrival.ColourCount(i));
    labels->id[i] = id;
    labels->confidence[i] = confidence(i);
    labels->ever |= EverBit(id);
  }
  if (block != nullptr) block->UpdateMasks(config_.back());
}

template <typename Function>
void SingleFieldMap::ForEachVoxel(const Function& function) const {
  for (const auto& entry : labels_.entries()) {
    const TsdfBlock& block = *field_.Find(entry.index);
    for (int place = 0; place < kBlockVoxels; ++place) {
      function(VoxelAt(entry.index, place), block.weight[At(place)] > 0,
               entry.block->id[At(place)]);
    }
  }
}

std::vector<InstanceId> SingleFieldMap::Objects() const {
  std::set<InstanceId> ids;
  for (const auto& entry : labels_.entries()) {
    const TsdfBlock& block = *field_.Find(entry.index);
    for (std::size_t i = 0; i < kBlockVoxels; ++i) {
      const InstanceId id = entry.block->id[i];
      if (id != kNoInstance && IsObjectsVoxel(block, *entry.block, i, id)) ids.insert(id);
    }
  }
  return {ids.begin(), ids.end()};
}

Pose SingleFieldMap::ObjectLattice(InstanceId) const { return Pose::Identity(); }

MeshWork SingleFieldMap::UpdateMeshes() const {
  const MeshWork work = mesh_.Update(field_, config_.voxel());
  LabelTriangles(mesh_, config_.voxel(), [&] { return LabelOfVoxels(); });
  return work;
}

TriangleMesh SingleFieldMap::SceneMesh() const {
  UpdateMeshes();
  return Join({{&mesh_}});
}

SceneChanges SingleFieldMap::TakeSceneChanges() const {
  const MeshWork work = UpdateMeshes();
  return {TakeScenePieces(mesh_, {&mesh_}), work};
}

std::vector<RaySurface> SingleFieldMap::CastRays(const Intrinsics& camera, const Pose& T_WC,
                                                 const RayCastOptions& options) const {
  RayPass pass;
  pass.voxel_m = config_.voxel_m;
  pass.volumes.push_back({kBackground, &field_, Pose::Identity(), true});
  pass.make_labels = [&] { return LabelOfVoxels(); };
  RayCastOptions first = options;
  first.surfaces = 1;
  return CastByRemoval(*this, RunRayPass(pass, camera, T_WC, first), camera, T_WC, options);
}

VoxelLabels SingleFieldMap::LabelOfVoxels() const {
  return LabelsOf(labels_,
                  [](const LabelBlock& block, std::size_t place) { return block.id[place]; });
}

TriangleMesh SingleFieldMap::ObjectMesh(InstanceId id) const {
  const TriangleMesh scene = SceneMesh();
  std::vector<std::uint8_t> keep(scene.triangles.size());
  for (std::size_t i = 0; i < keep.size(); ++i) keep[i] = scene.face_ids[i] == id ? 1 : 0;
  TriangleMesh mesh = KeepFaces(scene, keep);
  mesh.face_ids.clear();
  return mesh;
}

const TsdfGrid* SingleFieldMap::GridOf(InstanceId) const { return &field_; }

std::optional<VoxelValue> SingleFieldMap::ValueAt(InstanceId id,
                                                  const Eigen::Vector3i& voxel) const {
  const LabelBlock* labels = labels_.Find(BlockOf(ToIndex3(voxel)));
  if (labels == nullptr || labels->id[At(PlaceInBlock(ToIndex3(voxel)))] != id) {
    return std::nullopt;
  }
  return ValueOf(field_, ToIndex3(voxel));
}

std::vector<Listing> SingleFieldMap::ListAt(const Eigen::Vector3i& voxel) const {
  const LabelBlock* labels = labels_.Find(BlockOf(ToIndex3(voxel)));
  const std::size_t i = At(PlaceInBlock(ToIndex3(voxel)));
  if (labels == nullptr || labels->id[i] == kNoInstance) return {};
  return {{labels->id[i], labels->confidence[i]}};
}

std::vector<Eigen::Vector3i> SingleFieldMap::ObservedVoxels(InstanceId id) const {
  std::vector<Index3> voxels;
  ForEachVoxel([&](const Index3& v, bool observed, InstanceId label) {
    if (observed && label == id) voxels.push_back(v);
  });
  return SortedVoxels(std::move(voxels));
}

std::vector<Eigen::Vector3i> SingleFieldMap::ListedVoxels() const {
  std::vector<Index3> voxels;
  ForEachVoxel([&](const Index3& v, bool, InstanceId label) {
    if (label != kNoInstance) voxels.push_back(v);
  });
  return SortedVoxels(std::move(voxels));
}

MapMemory SingleFieldMap::Memory() const {
  return {field_.size(),
          BytesOf(field_) + field_.size() * sizeof(LabelBlock) + labels_.TableBytes(),
          mesh_.Bytes()};
}

}  // namespace tsdfpp
