#include "mapper/methods/tsdfpp_map.h"

#include "mapper/map_reach.h"
#include "mapper/methods/cast_by_removal.h"
#include "mapper/methods/map_invariants.h"
#include "mapper/methods/voxel_answers.h"
#include "mapper/store/volume_store.h"
#include "mapper/volume/freeing.h"

namespace tsdfpp {
namespace {

constexpr const char* kLists = "LIST";

}  // namespace

std::unique_ptr<MapRepresentation> TsdfppMap::Clone() const {
  return std::make_unique<TsdfppMap>(*this);
}

void TsdfppMap::SetObjectPose(InstanceId id, const Pose& T_WO) {
  std::vector<Index3> left;
  if (!MoveValues(id, T_WO, [&] { left = index_.Deactivate(id, volumes_.at(id).grid); })) return;
  index_.Activate(id, volumes_.at(id).grid);
  index_.FreeEmptyLists(left);
  CheckInDebugBuilds(*this);
}

void TsdfppMap::Fuse(const Frame& frame, const cv::Mat& labels) {
  RequireReach(*this, frame, labels);
  const FrameView view(frame, labels, config_.distances);
  const FrameFreeing freeing(volumes_);
  BlockVotes votes;
  const std::vector<FusedBlock> fused = FuseIntoVolumes(view, config_, volumes_, &votes);
  index_.Update(fused, UpdateCovers(fused, volumes_));
  freeing.FreeEmpty(fused, volumes_);
  CheckInDebugBuilds(*this);
}

void TsdfppMap::Remove(InstanceId id) {
  const auto removed = volumes_.extract(id);
  if (removed.empty()) return;
  index_.Remove(id, removed.mapped().grid, volumes_);
  CheckInDebugBuilds(*this);
}

Expected<void> TsdfppMap::Rename(InstanceId from, InstanceId to) {
  TSDFPP_RETURN_IF_ERROR(ObjectVolumeMap::Rename(from, to));
  index_.Rename(from, to, volumes_.at(to).grid);
  CheckInDebugBuilds(*this);
  return {};
}

Expected<void> TsdfppMap::Add(InstanceId id, const TsdfGrid& volume, const Pose& T_WL,
                              const std::optional<Pose>& T_WO) {
  TSDFPP_RETURN_IF_ERROR(ObjectVolumeMap::Add(id, volume, T_WL, T_WO));
  index_.Activate(id, volumes_.at(id).grid);
  CheckInDebugBuilds(*this);
  return {};
}

std::vector<RaySurface> TsdfppMap::CastRays(const Intrinsics& camera, const Pose& T_WC,
                                            const RayCastOptions& options) const {
  if (!config_.relist_on_removal) return ObjectVolumeMap::CastRays(camera, T_WC, options);
  // A removal lists objects that the lists do not know of.
  RayCastOptions first = options;
  first.surfaces = 1;
  return CastByRemoval(*this, ObjectVolumeMap::CastRays(camera, T_WC, first), camera, T_WC,
                       options);
}

std::vector<Eigen::Vector3i> TsdfppMap::ListedVoxels() const {
  return SortedVoxels(index_.ListedVoxels());
}

MapMemory TsdfppMap::Memory() const {
  MapMemory memory = ObjectVolumeMap::Memory();
  memory.blocks += index_.blocks();
  memory.bytes += index_.Bytes();
  return memory;
}

Fault TsdfppMap::FindFault() const {
  std::size_t blocks = index_.blocks();
  if (Fault fault = FindVolumeFault(true, blocks)) return fault;
  if (Fault fault = FindCountFault(*this, blocks)) return fault;
  if (Fault fault = index_.FindFault()) return fault;
  if (Fault fault = FindListFault(*this)) return fault;
  return FindCoverFault(*this, false);
}

void TsdfppMap::Save(Sections& sections) const {
  ObjectVolumeMap::Save(sections);
  SaveLists(index_.Lists(), layers_, sections[kLists]);
}

Expected<void> TsdfppMap::Load(const Sections& sections) {
  TSDFPP_RETURN_IF_ERROR(ObjectVolumeMap::Load(sections));
  for (const auto& [id, volume] : volumes_) RenewCovers(volume.grid);
  const auto covers = [this](InstanceId id, const Index3& index, int place) {
    const auto volume = volumes_.find(id);
    if (volume == volumes_.end()) return false;
    const TsdfBlock* block = volume->second.grid.Find(index);
    return block != nullptr && Bit(block->cover, place);
  };
  TSDFPP_ASSIGN(const auto lists, LoadAllLists(sections, kLists, layers_, config_, covers));
  index_.SetLists(lists);
  return {};
}

}  // namespace tsdfpp
