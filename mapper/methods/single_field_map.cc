// Longer than the other recipes: four methods in one, which has no object volumes to answer for it.
#include "mapper/methods/single_field_map.h"

#include <cstdlib>
#include <utility>

#include "mapper/map_reach.h"
#include "mapper/methods/cast_by_removal.h"
#include "mapper/methods/field_fusion.h"
#include "mapper/methods/field_motion.h"
#include "mapper/methods/map_invariants.h"
#include "mapper/methods/map_objects.h"
#include "mapper/methods/voxel_answers.h"
#include "mapper/store/volume_store.h"

namespace tsdfpp {
namespace {

constexpr const char* kField = "FIEL";
constexpr const char* kLabels = "LABL";
constexpr const char* kPoses = "POSE";

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
  const FrameView view(frame, labels, config_.distances);
  FuseIntoField(view, config_, rule_ == FieldRule::kGuarded, field_);
  CheckInDebugBuilds(*this);
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
  MoveInField(id, T_rel, config_, rule_ == FieldRule::kKeepNearer, field_);
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
  return CastField(
      *this, field_.values(), [this] { return field_.LabelOfVoxels(); }, camera, T_WC, options);
}

const TsdfGrid* SingleFieldMap::GridOf(InstanceId) const { return &field_.values(); }

std::optional<VoxelValue> SingleFieldMap::ValueAt(InstanceId id,
                                                  const Eigen::Vector3i& voxel) const {
  if (!CanBeStored(ToIndex3(voxel))) return std::nullopt;
  const LabelBlock* labels = field_.labels().Find(BlockOf(ToIndex3(voxel)));
  if (labels == nullptr || labels->id[At(PlaceInBlock(ToIndex3(voxel)))] != id) {
    return std::nullopt;
  }
  return ValueOf(field_.values(), ToIndex3(voxel));
}

std::vector<Listing> SingleFieldMap::ListAt(const Eigen::Vector3i& voxel) const {
  if (!CanBeStored(ToIndex3(voxel))) return {};
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
                                   const std::optional<Pose>& T_WO) {
  TSDFPP_RETURN_IF_ERROR(CheckNewId(id, IsKnown(id)));
  TSDFPP_RETURN_IF_ERROR(CheckAddition(config_, id, volume, T_WL, T_WO));
  if (T_WO) T_WO_.insert_or_assign(id, *T_WO);
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

std::optional<Pose> SingleFieldMap::LastPose(InstanceId id) const {
  const auto pose = T_WO_.find(id);
  return pose == T_WO_.end() ? std::nullopt : std::optional<Pose>(pose->second);
}

}  // namespace tsdfpp
