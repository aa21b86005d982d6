#include "mapper/methods/literal_map.h"

#include "mapper/map_reach.h"
#include "mapper/methods/cast_by_removal.h"
#include "mapper/methods/literal_fusion.h"
#include "mapper/methods/map_invariants.h"
#include "mapper/methods/voxel_answers.h"
#include "mapper/store/volume_store.h"
#include "mapper/volume/freeing.h"

namespace tsdfpp {
namespace {

constexpr const char* kLists = "LIST";

}  // namespace

std::unique_ptr<MapRepresentation> LiteralMap::Clone() const {
  return std::make_unique<LiteralMap>(*this);
}

void LiteralMap::Fuse(const Frame& frame, const cv::Mat& labels) {
  RequireReach(*this, frame, labels);
  const std::size_t blocks_before = index_.blocks().size();
  const std::vector<Index3> changed =
      FuseIntoActive(FrameView(frame, labels, config_.distances), config_, index_, volumes_);
  field_.Note(changed, index_.blocks().size());
  // A frame empties no list; it may have made blocks in vain.
  index_.blocks().Erase(EmptyFrom(index_.blocks(), blocks_before,
                                  [](const PairIndex::Block& b) { return b.IsEmpty(); }));
  FreeUnknown(volumes_);
  CheckInDebugBuilds(*this);
}

void LiteralMap::SetObjectPose(InstanceId id, const Pose& T_WO) {
  field_.NoteAll();
  std::vector<Index3> left;
  if (!MoveValues(id, T_WO, [&] { left = index_.Deactivate(id); })) return;
  index_.Activate(id, volumes_.at(id).grid);
  index_.FreeEmpty(left);
  CheckInDebugBuilds(*this);
}

void LiteralMap::Remove(InstanceId id) {
  field_.NoteAll();
  index_.FreeEmpty(index_.Deactivate(id));
  volumes_.erase(id);
  CheckInDebugBuilds(*this);
}

Expected<void> LiteralMap::Rename(InstanceId from, InstanceId to) {
  TSDFPP_RETURN_IF_ERROR(ObjectVolumeMap::Rename(from, to));
  field_.NoteAll();
  index_.Rename(from, to);
  CheckInDebugBuilds(*this);
  return {};
}

Expected<void> LiteralMap::Add(InstanceId id, const TsdfGrid& volume, const Pose& T_WL,
                               const std::optional<Pose>& T_WO) {
  TSDFPP_RETURN_IF_ERROR(ObjectVolumeMap::Add(id, volume, T_WL, T_WO));
  field_.NoteAll();
  index_.Activate(id, volumes_.at(id).grid);
  CheckInDebugBuilds(*this);
  return {};
}

SurfacesInBlocks LiteralMap::Surfaces() const {
  return {config_.voxel_m, VolumeSurfaces{&volumes_, nullptr},
          FieldSurface{&Field(), [this] { return ActiveLabels(index_); }}};
}

std::vector<RaySurface> LiteralMap::CastRays(const Intrinsics& camera, const Pose& T_WC,
                                             const RayCastOptions& options) const {
  return CastField(
      *this, Field(), [this] { return ActiveLabels(index_); }, camera, T_WC, options);
}

std::vector<Listing> LiteralMap::ListAt(const Eigen::Vector3i& voxel) const {
  if (!CanBeStored(ToIndex3(voxel))) return {};
  return index_.ListedAt(ToIndex3(voxel));
}

std::vector<Eigen::Vector3i> LiteralMap::ListedVoxels() const {
  return SortedVoxels(index_.ListedVoxels());
}

MapMemory LiteralMap::Memory() const {
  MapMemory memory = ObjectVolumeMap::Memory();
  memory.blocks += index_.blocks().size();
  memory.bytes += index_.Bytes();
  memory.derived_bytes = field_.Bytes();
  return memory;
}

Fault LiteralMap::FindFault() const {
  std::size_t blocks = index_.blocks().size();
  if (Fault fault = FindVolumeFault(false, blocks)) return fault;
  if (Fault fault = FindCountFault(*this, blocks)) return fault;
  if (Fault fault = index_.FindFault(volumes_)) return fault;
  return FindListFault(*this);
}

void LiteralMap::Save(Sections& sections) const {
  ObjectVolumeMap::Save(sections);
  SaveLists(index_.Lists(), 2, sections[kLists]);
}

Expected<void> LiteralMap::Load(const Sections& sections) {
  field_.NoteAll();
  TSDFPP_RETURN_IF_ERROR(ObjectVolumeMap::Load(sections));
  const auto is_observed = [this](InstanceId id, const Index3& index, int place) {
    const auto volume = volumes_.find(id);
    if (volume == volumes_.end()) return false;
    const TsdfBlock* block = volume->second.grid.Find(index);
    return block != nullptr && Bit(block->observed, place);
  };
  TSDFPP_ASSIGN(const auto lists, LoadAllLists(sections, kLists, 2, config_, is_observed));
  index_.SetLists(lists);
  return {};
}

}  // namespace tsdfpp
