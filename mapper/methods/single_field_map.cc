#include "mapper/methods/single_field_map.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <cmath>
#include <limits>
#include <utility>

#include "mapper/map_reach.h"
#include "mapper/methods/cast_by_removal.h"
#include "mapper/methods/map_invariants.h"
#include "mapper/methods/map_objects.h"
#include "mapper/methods/voxel_answers.h"
#include "mapper/rays/ray_pass.h"
#include "mapper/store/volume_store.h"
#include "mapper/volume/allocation.h"
#include "mapper/volume/freeing.h"
#include "mapper/volume/pull_back.h"
#include "mapper/volume/rims.h"

namespace tsdfpp {
namespace {

constexpr const char* kField = "FIEL";
constexpr const char* kLabels = "LABL";
constexpr const char* kPoses = "POSE";

constexpr std::size_t kBlocksPerTask = 16;

std::size_t At(int i) { return static_cast<std::size_t>(i); }

}  // namespace

SingleFieldMap::SingleFieldMap(const MapConfig& config, FieldRule rule)
    : config_(config), rule_(rule), field_(config) {}

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
    return {Pose::Identity(), &field_.values().directory()};
  };
  const std::size_t blocks_before = field_.values().size();
  for (const auto& [id, indices] : BlocksAlongRays(view, config_, lattice_of)) {
    for (const Index3& index : indices) field_.AddBlock(index);
  }
  const CameraFromLattice T_CW(frame.T_WC, Pose::Identity(), true);
  const auto& blocks = field_.values().entries();
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
                    *block, *field_.labels().Find(index));
        }
      },
      tbb::simple_partitioner());
  if (rule_ == FieldRule::kGuarded && config_.rims) CompleteRims(view);
  // A frame makes no voxel unobserved; it may have made blocks in vain.
  field_.FreeEmpty(EmptyFrom(field_.values(), blocks_before,
                             [](const TsdfBlock& b) { return !b.AnyObserved(); }));
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
  if (votes.any_label_changed) labels.NoteLabels();
}

void SingleFieldMap::CompleteRims(const FrameView& frame) {
  const auto field_of = [&](InstanceId) -> std::optional<RimVolume> {
    return RimVolume{&field_.values(), Pose::Identity(), true};
  };
  const auto is_own = [&](InstanceId id, const Index3& voxel) {
    const LabelBlock* labels = field_.labels().Find(BlockOf(voxel));
    return labels != nullptr && labels->id[At(PlaceInBlock(voxel))] == id;
  };
  for (const RimBlock& rim : FindRims(frame, config_, field_of, is_own)) {
    TsdfBlock& block = field_.values().FindOrAdd(rim.index);
    LabelBlock& labels = field_.labels().FindOrAdd(rim.index);
    for (const RimValue& value : rim.voxels) {
      const std::size_t i = At(value.place);
      if (block.weight[i] > 0) continue;  // an object before this one has completed it
      FuseRim(frame, config_, value, block);
      labels.id[i] = rim.id;
      labels.confidence[i] = 1;
    }
    labels.NoteLabel(rim.id);
    block.UpdateMasks(config_.back());
  }
}

void SingleFieldMap::Remove(InstanceId id) {
  field_.FreeEmpty(field_.Vacate(id, config_.removed_voxels));
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
  move.blocks = &field_.values();
  move.is_moved = [this, id](const Index3& index) { return field_.labels().Find(index)->Has(id); };
  return move;
}

void SingleFieldMap::SetObjectPose(InstanceId id, const Pose& T_WO) {
  const auto [known, first] = T_WO_.emplace(id, T_WO);
  if (first || SameNumbers(known->second, T_WO)) return;
  const Pose T_rel = T_WO * std::exchange(known->second, T_WO).inverse();
  if (rule_ == FieldRule::kStatic) return;

  const LabelledField::Part source = field_.PartOf(id);
  const std::vector<Index3> left = field_.Vacate(id, RemovedVoxels::kUnobserved);

  const VoxelReader reader(source.values);
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
    return source.labels.Find(BlockOf(from))->confidence[At(PlaceInBlock(from))];
  };
  for (std::size_t b = 0; b < touched.size(); ++b) {
    if (arrivals[b] == nullptr) continue;
    const auto confidence = [&](std::size_t i) {
      return confidence_at(VoxelAt(touched[b], static_cast<int>(i)));
    };
    field_.Arrive(id, touched[b], *arrivals[b], rule_ == FieldRule::kKeepNearer, confidence);
  }
  field_.FreeEmpty(left);
  CheckInDebugBuilds(*this);
}

std::vector<InstanceId> SingleFieldMap::Objects() const { return field_.Objects(); }

Pose SingleFieldMap::ObjectLattice(InstanceId) const { return Pose::Identity(); }

SurfacesInBlocks SingleFieldMap::Surfaces() const {
  return {config_.voxel_m, {}, FieldSurface{&field_.values(), [this] {
                                              return field_.LabelOfVoxels();
                                            }}};
}

std::vector<RaySurface> SingleFieldMap::CastRays(const Intrinsics& camera, const Pose& T_WC,
                                                 const RayCastOptions& options) const {
  RayPass pass;
  pass.voxel_m = config_.voxel_m;
  pass.volumes.push_back({kBackground, &field_.values(), Pose::Identity(), true});
  pass.make_labels = [&] { return field_.LabelOfVoxels(); };
  RayCastOptions first = options;
  first.surfaces = 1;
  return CastByRemoval(*this, RunRayPass(pass, camera, T_WC, first), camera, T_WC, options);
}

const TsdfGrid* SingleFieldMap::GridOf(InstanceId) const { return &field_.values(); }

std::optional<VoxelValue> SingleFieldMap::ValueAt(InstanceId id,
                                                  const Eigen::Vector3i& voxel) const {
  const LabelBlock* labels = field_.labels().Find(BlockOf(ToIndex3(voxel)));
  if (labels == nullptr || labels->id[At(PlaceInBlock(ToIndex3(voxel)))] != id) {
    return std::nullopt;
  }
  return ValueOf(field_.values(), ToIndex3(voxel));
}

std::vector<Listing> SingleFieldMap::ListAt(const Eigen::Vector3i& voxel) const {
  return field_.ListedAt(ToIndex3(voxel));
}

std::vector<Eigen::Vector3i> SingleFieldMap::ObservedVoxels(InstanceId id) const {
  return SortedVoxels(field_.ObservedVoxels(id));
}

std::vector<Eigen::Vector3i> SingleFieldMap::ListedVoxels() const {
  return SortedVoxels(field_.LabelledVoxels());
}

MapMemory SingleFieldMap::Memory() const { return {field_.values().size(), field_.Bytes()}; }

Fault SingleFieldMap::FindFault() const {
  if (Fault fault = field_.FindFault()) return fault;
  if (Fault fault = FindCountFault(*this, field_.labels().size())) return fault;
  return FindListFault(*this);
}

Expected<void> SingleFieldMap::Rename(InstanceId from, InstanceId to) {
  TSDFPP_RETURN_IF_ERROR(CheckRename(from, IsKnown(from), to, IsKnown(to)));
  field_.Rename(from, to);
  if (const auto pose = T_WO_.find(from); pose != T_WO_.end()) {
    T_WO_.insert_or_assign(to, pose->second);
    T_WO_.erase(from);
  }
  CheckInDebugBuilds(*this);
  return {};
}

Expected<void> SingleFieldMap::Add(InstanceId id, const TsdfGrid& volume, const Pose& T_WL,
                                   const Pose& T_WO) {
  TSDFPP_RETURN_IF_ERROR(CheckNewId(id, IsKnown(id)));
  TSDFPP_RETURN_IF_ERROR(CheckAddition(config_, id, volume, T_WL, T_WO));
  T_WO_.insert_or_assign(id, T_WO);
  const TsdfGrid arrivals = InWorldLattice(volume, T_WL, config_);
  const auto confidence = [this](std::size_t) {
    return static_cast<std::uint16_t>(config_.moved_confidence);
  };
  for (const auto* entry : arrivals.Sorted()) {
    field_.Arrive(id, entry->index, *entry->block, rule_ == FieldRule::kKeepNearer, confidence);
  }
  CheckInDebugBuilds(*this);
  return {};
}

void SingleFieldMap::Save(Sections& sections) const {
  SaveGrid(field_.values(), sections[kField]);
  SaveLists(field_.Lists(), 1, sections[kLabels]);
  std::string& poses = sections[kPoses];
  PutBytes(static_cast<std::uint32_t>(T_WO_.size()), poses);
  for (const auto& [id, T_WO] : T_WO_) {
    PutBytes(id, poses);
    SavePose(T_WO, poses);
  }
}

Expected<void> SingleFieldMap::Load(const Sections& sections) {
  ByteReader bytes(sections.at(kField));
  TSDFPP_ASSIGN(TsdfGrid values, LoadGrid(bytes, config_));
  if (!bytes.AtEnd()) return DataError("its field has another length than it says");
  field_.SetValues(std::move(values));
  const auto is_observed = [this](InstanceId, const Index3& index, int place) {
    const TsdfBlock* block = field_.values().Find(index);
    return block != nullptr && Bit(block->observed, place);
  };
  TSDFPP_ASSIGN(const auto lists, LoadAllLists(sections, kLabels, 1, config_, is_observed));
  TSDFPP_RETURN_IF_ERROR(field_.SetLists(lists));
  ByteReader poses(sections.at(kPoses));
  const auto count = poses.Get<std::uint32_t>();
  for (std::uint32_t i = 0; i < count && poses.ok(); ++i) {
    const auto id = poses.Get<InstanceId>();
    TSDFPP_ASSIGN(const Pose T_WO, LoadPose(poses, LatticeRange(config_.voxel_m)));
    T_WO_.insert_or_assign(id, T_WO);
  }
  if (!poses.AtEnd()) return DataError("its poses have another length than they say");
  return {};
}

}  // namespace tsdfpp
