#include "mapper/volume/freeing.h"

#include <algorithm>

namespace tsdfpp {

void FreeUnknown(ObjectVolumes& volumes) {
  std::erase_if(volumes, [](const auto& entry) {
    const ObjectVolume& volume = entry.second;
    return volume.grid.empty() && !volume.T_WO && !volume.T_WO_birth;
  });
}

FrameFreeing::FrameFreeing(const ObjectVolumes& volumes) {
  for (const auto& [id, volume] : volumes) blocks_before_[id] = volume.grid.size();
}

void FrameFreeing::FreeEmpty(const std::vector<FusedBlock>& fused, ObjectVolumes& volumes) const {
  std::map<InstanceId, std::vector<Index3>> empty;
  for (const FusedBlock& block : fused) {
    if (block.is_empty) empty[block.id].push_back(block.index);
  }
  for (auto& [id, volume] : volumes) {
    const auto before = blocks_before_.find(id);
    std::vector<Index3>& of_object = empty[id];
    const std::vector<Index3> in_vain =
        EmptyFrom(volume.grid, before == blocks_before_.end() ? 0 : before->second,
                  [](const TsdfBlock& block) { return !block.AnyObserved(); });
    of_object.insert(of_object.end(), in_vain.begin(), in_vain.end());
    // A new block may have been filled and emptied, and then is in both.
    std::sort(of_object.begin(), of_object.end());
    of_object.erase(std::unique(of_object.begin(), of_object.end()), of_object.end());
    volume.grid.Erase(of_object);
  }
  FreeUnknown(volumes);
}

}  // namespace tsdfpp
