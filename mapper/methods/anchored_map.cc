#include "mapper/methods/anchored_map.h"

#include "mapper/map_reach.h"
#include "mapper/methods/cast_by_removal.h"
#include "mapper/methods/map_invariants.h"
#include "mapper/methods/voxel_answers.h"
#include "mapper/volume/freeing.h"

namespace tsdfpp {

std::unique_ptr<MapRepresentation> AnchoredMap::Clone() const {
  Index();  // nobody refreshes what is copied
  return std::make_unique<AnchoredMap>(*this);
}

void AnchoredMap::SetObjectPose(InstanceId id, const Pose& T_WO) {
  if (!MoveLattice(id, T_WO, [&] { index_.Deactivate(id, volumes_); })) return;
  index_.Activate(id);
  CheckInDebugBuilds(*this);
}

void AnchoredMap::Fuse(const Frame& frame, const cv::Mat& labels) {
  RequireReach(*this, frame, labels);
  const FrameView view(frame, labels, config_.distances);
  const FrameFreeing freeing(volumes_);
  const std::vector<FusedBlock> fused = FuseIntoVolumes(view, config_, volumes_);
  index_.NoteFusion(fused, volumes_);
  freeing.FreeEmpty(fused, volumes_);
  Index();
  CheckInDebugBuilds(*this);
}

void AnchoredMap::Remove(InstanceId id) {
  Index();
  if (!volumes_.contains(id)) return;
  index_.Deactivate(id, volumes_);
  volumes_.erase(id);
  Index();
  CheckInDebugBuilds(*this);
}

Expected<void> AnchoredMap::Rename(InstanceId from, InstanceId to) {
  Index();
  index_.Deactivate(from, volumes_);
  Expected<void> status = ObjectVolumeMap::Rename(from, to);
  // Where that is refused the old one's lists are made again in vain.
  if (volumes_.contains(status ? to : from)) index_.Activate(status ? to : from);
  CheckInDebugBuilds(*this);
  return status;
}

Expected<void> AnchoredMap::Add(InstanceId id, const TsdfGrid& volume, const Pose& T_WL,
                                const std::optional<Pose>& T_WO) {
  TSDFPP_RETURN_IF_ERROR(ObjectVolumeMap::Add(id, volume, T_WL, T_WO));
  index_.Activate(id);
  CheckInDebugBuilds(*this);
  return {};
}

std::vector<RaySurface> AnchoredMap::CastRays(const Intrinsics& camera, const Pose& T_WC,
                                              const RayCastOptions& options) const {
  if (options.surfaces <= layers_) return ObjectVolumeMap::CastRays(camera, T_WC, options);
  // Beyond K objects the lists do not say who comes next.
  RayCastOptions listed = options;
  listed.surfaces = layers_;
  return CastByRemoval(*this, ObjectVolumeMap::CastRays(camera, T_WC, listed), camera, T_WC,
                       options);
}

std::vector<Eigen::Vector3i> AnchoredMap::ListedVoxels() const {
  return SortedVoxels(Index()->ListedVoxels());
}

MapMemory AnchoredMap::Memory() const {
  MapMemory memory = ObjectVolumeMap::Memory();
  memory.blocks += Index()->blocks();
  memory.bytes += Index()->Bytes();
  return memory;
}

Fault AnchoredMap::FindFault() const {
  std::size_t blocks = Index()->blocks();
  if (Fault fault = FindVolumeFault(true, blocks)) return fault;
  if (Fault fault = FindCountFault(*this, blocks)) return fault;
  if (Fault fault = FindListFault(*this)) return fault;
  if (Fault fault = FindCoverFault(*this, true)) return fault;
  return index_.FindFault(volumes_);
}

Expected<void> AnchoredMap::Load(const Sections& sections) {
  TSDFPP_RETURN_IF_ERROR(ObjectVolumeMap::Load(sections));
  index_.Reset(volumes_);
  Index();
  return {};
}

}  // namespace tsdfpp
