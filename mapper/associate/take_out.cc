#include "mapper/associate/take_out.h"

#include <algorithm>
#include <cstdlib>

#include "mapper/map_editing.h"
#include "mapper/volume/object_volume.h"
#include "mapper/voxel_inspection.h"

namespace tsdfpp {
namespace {

// Clears the voxels whose centres are within `reach` voxels of `centre` along each axis. Blocks of
// which something was cleared are added to `changed`.
void ClearBox(const Eigen::Vector3d& centre, double reach, TsdfGrid& grid,
              std::vector<Index3>& changed) {
  const Index3 low = FloorOf(centre - Eigen::Vector3d::Constant(reach - 1));
  const Index3 high = FloorOf(centre + Eigen::Vector3d::Constant(reach));
  for (int z = low.z; z <= high.z; ++z) {
    for (int y = low.y; y <= high.y; ++y) {
      for (int x = low.x; x <= high.x; ++x) {
        const Index3 voxel{x, y, z};
        TsdfBlock* block = grid.Find(BlockOf(voxel));
        if (block == nullptr) continue;
        const int place = PlaceInBlock(voxel);
        if (!(block->weight[static_cast<std::size_t>(place)] > 0)) continue;
        block->Clear(place);
        changed.push_back(BlockOf(voxel));
      }
    }
  }
}

}  // namespace

void TakeOut(const std::vector<Index3>& cells, double cell_m, InstanceId object,
             const std::optional<Pose>& T_WO, MapRepresentation& map) {
  const VoxelInspection* voxels = map.inspection();
  MapEditing* editing = map.editing();
  if (object == kBackground || voxels == nullptr || editing == nullptr) return;
  if (IsOneField(map.method())) return;
  const TsdfGrid* stored = voxels->GridOf(object);
  if (stored == nullptr || cells.empty()) return;

  TsdfGrid grid = *stored;
  const Pose T_WL = map.ObjectLattice(object);
  const Pose T_LO = T_WL.inverse() * T_WO.value_or(Pose::Identity());
  const double voxel_m = map.config().voxel_m;
  const double reach = cell_m / voxel_m / 2 + kBesideCell_voxels;
  std::vector<Index3> changed;
  for (const Index3& cell : cells) {
    const Eigen::Vector3d centre_O =
        (Eigen::Vector3d(cell.x, cell.y, cell.z) + Eigen::Vector3d::Constant(0.5)) * cell_m;
    ClearBox(T_LO * centre_O / voxel_m, reach, grid, changed);
  }
  if (changed.empty()) return;
  std::sort(changed.begin(), changed.end());
  changed.erase(std::unique(changed.begin(), changed.end()), changed.end());
  std::vector<Index3> empty;
  for (const Index3& index : changed) {
    TsdfBlock* block = grid.Find(index);
    block->UpdateMasks(map.config().back());
    if (!block->AnyObserved()) empty.push_back(index);
  }
  grid.Erase(empty);
  map.Remove(object);
  if (grid.empty()) {
    // What the frame still brings of it is at that pose.
    if (T_WO) map.SetObjectPose(object, *T_WO);
    return;
  }
  // Poses and place are those that the map had: nothing of it can be refused.
  if (!editing->Add(object, grid, T_WL, T_WO)) std::abort();
}

}  // namespace tsdfpp
