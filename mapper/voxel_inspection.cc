#include "mapper/voxel_inspection.h"

#include <cstdlib>

#include "mapper/map_representation.h"

namespace tsdfpp {

const VoxelInspection& VoxelsOf(const MapRepresentation& map) {
  const VoxelInspection* voxels = map.inspection();
  if (voxels == nullptr) std::abort();
  return *voxels;
}

Expected<const VoxelInspection*> AskForVoxels(const MapRepresentation& map,
                                              std::string_view needed_for) {
  const VoxelInspection* voxels = map.inspection();
  if (voxels != nullptr) return voxels;
  return UsageError("a map of method '{}' has no voxels, which {} needs", MethodName(map.method()),
                    needed_for);
}

}  // namespace tsdfpp
