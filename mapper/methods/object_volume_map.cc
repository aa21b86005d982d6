#include "mapper/methods/object_volume_map.h"

#include <fmt/format.h>

#include <utility>

#include "mapper/index/grid_invariants.h"
#include "mapper/map_reach.h"
#include "mapper/methods/map_objects.h"
#include "mapper/methods/voxel_answers.h"
#include "mapper/rays/volume_rays.h"
#include "mapper/store/volume_store.h"
#include "mapper/volume/pull_back.h"

namespace tsdfpp {
namespace {

constexpr const char* kVolumes = "VOLS";

}  // namespace

ObjectMove ObjectVolumeMap::MoveTo(InstanceId id, const Pose& T_WO) const {
  const auto of = volumes_.find(id);
  if (of == volumes_.end()) return {};
  return MovesValues() ? MoveOfValues(of->second, T_WO) : MoveOfLattice(of->second, T_WO);
}

std::map<InstanceId, Pose> ObjectVolumeMap::MovedLattices() const {
  std::map<InstanceId, Pose> lattices;
  for (const auto& [id, volume] : volumes_) {
    if (!volume.lattice_is_world) lattices.emplace(id, volume.T_WL);
  }
  return lattices;
}

bool ObjectVolumeMap::MoveValues(InstanceId id, const Pose& T_WO,
                                 const std::function<void()>& before) {
  ObjectVolume& volume = volumes_[id];
  const std::optional<Pose> T_WO_old = std::exchange(volume.T_WO, T_WO);
  if (!T_WO_old || SameNumbers(*T_WO_old, T_WO)) return false;
  before();
  volume.grid = ResampleGrid(volume.grid, T_WO * T_WO_old->inverse(), config_.voxel_m,
                             config_.back(), config_.resampling);
  volume.revision = NewRevision();
  return true;
}

bool ObjectVolumeMap::MoveLattice(InstanceId id, const Pose& T_WO,
                                  const std::function<void()>& before) {
  ObjectVolume& volume = volumes_[id];
  const std::optional<Pose> T_WO_old = std::exchange(volume.T_WO, T_WO);
  if (!volume.T_WO_birth) volume.T_WO_birth = T_WO;
  if (!T_WO_old || SameNumbers(*T_WO_old, T_WO)) return false;
  before();
  PlaceLattice(volume);
  return true;
}

std::vector<InstanceId> ObjectVolumeMap::Objects() const {
  std::vector<InstanceId> ids;
  for (const auto& [id, volume] : volumes_) {
    if (!volume.grid.empty()) ids.push_back(id);
  }
  return ids;
}

Pose ObjectVolumeMap::ObjectLattice(InstanceId id) const {
  const auto volume = volumes_.find(id);
  return volume == volumes_.end() ? Pose::Identity() : volume->second.T_WL;
}

SurfacesInBlocks ObjectVolumeMap::Surfaces() const {
  return {config_.voxel_m, VolumeSurfaces{&volumes_, Index()}, {}};
}

std::vector<RaySurface> ObjectVolumeMap::CastRays(const Intrinsics& camera, const Pose& T_WC,
                                                  const RayCastOptions& options) const {
  return CastThroughVolumes({&volumes_, Index()}, config_.voxel_m, camera, T_WC, options);
}

const TsdfGrid* ObjectVolumeMap::GridOf(InstanceId id) const {
  Index();  // which keeps what blocks say of covers
  const auto volume = volumes_.find(id);
  return volume == volumes_.end() ? nullptr : &volume->second.grid;
}

std::optional<VoxelValue> ObjectVolumeMap::ValueAt(InstanceId id,
                                                   const Eigen::Vector3i& voxel) const {
  const auto volume = volumes_.find(id);
  if (volume == volumes_.end()) return std::nullopt;
  return ValueOf(volume->second.grid, ToIndex3(voxel));
}

std::vector<Eigen::Vector3i> ObjectVolumeMap::ObservedVoxels(InstanceId id) const {
  const auto volume = volumes_.find(id);
  if (volume == volumes_.end()) return {};
  return ObservedVoxelsOf(volume->second.grid);
}

std::vector<Listing> ObjectVolumeMap::ListAt(const Eigen::Vector3i& voxel) const {
  const GlobalIndex* index = Index();
  if (index == nullptr || !CanBeStored(ToIndex3(voxel))) return {};
  return index->ListedAt(ToIndex3(voxel));
}

Expected<void> ObjectVolumeMap::Rename(InstanceId from, InstanceId to) {
  TSDFPP_RETURN_IF_ERROR(CheckRename(from, volumes_.contains(from), to, volumes_.contains(to)));
  auto volume = volumes_.extract(from);
  volume.key() = to;
  volumes_.insert(std::move(volume));
  return {};
}

Expected<void> ObjectVolumeMap::Add(InstanceId id, const TsdfGrid& volume, const Pose& T_WL,
                                    const std::optional<Pose>& T_WO) {
  TSDFPP_RETURN_IF_ERROR(CheckNewId(id, volumes_.contains(id)));
  TSDFPP_RETURN_IF_ERROR(CheckAddition(config_, id, volume, T_WL, T_WO));
  ObjectVolume& added = volumes_[id];
  added.T_WO = T_WO;
  if (MovesValues()) {
    added.grid = InWorldLattice(volume, T_WL, config_);
    return {};
  }
  // T_WL = T_WO * T_WO(birth)^-1
  if (T_WO) added.T_WO_birth = SameNumbers(T_WL, Pose::Identity()) ? *T_WO : T_WL.inverse() * *T_WO;
  PlaceLattice(added);
  added.grid = InWorldLattice(volume, Pose::Identity(), config_);
  return {};
}

MapMemory ObjectVolumeMap::Memory() const {
  MapMemory memory;
  for (const auto& [id, volume] : volumes_) {
    memory.blocks += volume.grid.size();
    memory.bytes += BytesOf(volume.grid);
  }
  return memory;
}

void ObjectVolumeMap::Save(Sections& sections) const { SaveVolumes(volumes_, sections[kVolumes]); }

Expected<void> ObjectVolumeMap::Load(const Sections& sections) {
  TSDFPP_ASSIGN(volumes_, LoadAllVolumes(sections, kVolumes, config_));
  return MovesValues() ? CheckWorldLattices(volumes_) : CheckOwnLattices(volumes_);
}

std::optional<Pose> ObjectVolumeMap::LastPose(InstanceId id) const {
  const auto of = volumes_.find(id);
  if (of == volumes_.end()) return std::nullopt;
  const ObjectVolume& volume = of->second;
  return volume.T_WO;
}

Fault ObjectVolumeMap::FindVolumeFault(bool with_covers, std::size_t& blocks) const {
  for (const auto& [id, volume] : volumes_) {
    const bool with_cover = with_covers && volume.lattice_is_world;
    const std::string name = fmt::format("object {}", id);
    if (Fault fault = FindGridFault(name, volume.grid, config_, with_cover)) return fault;
    if (volume.lattice_is_world != SameNumbers(volume.T_WL, Pose::Identity())) {
      return fmt::format("object {}: its lattice is not where it is said to be", id);
    }
    blocks += volume.grid.size();
  }
  return std::nullopt;
}

}  // namespace tsdfpp
