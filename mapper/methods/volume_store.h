// Grids, volumes and lists as bytes (docs/map.md, "The map file"). What can be derived from the
// values (masks, covers, an anchored index) is not stored; blocks are in the order of Index3, so
// that equal maps have equal bytes.
#pragma once

#include <functional>
#include <vector>

#include "core/error.h"
#include "mapper/index/voxel_list.h"
#include "mapper/map_config.h"
#include "mapper/store/byte_stream.h"
#include "mapper/volume/lattice_range.h"
#include "mapper/volume/volume_fusion.h"

namespace tsdfpp {

void SaveGrid(const TsdfGrid& grid, std::string& bytes);
// Masks are up to date but for `crossed` and `cover`. Errors: kData, a fragment such as "a block is
// out of order", for values that no map holds.
Expected<TsdfGrid> LoadGrid(ByteReader& bytes, const MapConfig& config);

void SavePose(const Pose& T, std::string& bytes);
// Errors: kData, a fragment, where it is not rigid or beyond the range.
Expected<Pose> LoadPose(ByteReader& bytes, const LatticeRange& range);

// Values, T_WO at birth and now; where the lattice is follows from these. Errors: kData, a
// fragment, also where that is beyond the range.
void SaveVolumes(const ObjectVolumes& volumes, std::string& bytes);
Expected<ObjectVolumes> LoadVolumes(ByteReader& bytes, const MapConfig& config);

// The lists of a block: kBlockVoxels lists of the same number of entries, one after the other.
struct ListsOfBlock {
  Index3 index;
  std::vector<ListEntry> entries;
};
// `blocks` in the order of Index3.
void SaveLists(const std::vector<ListsOfBlock>& blocks, int layers, std::string& bytes);
// Errors: kData, a fragment, where a block is out of order or empty, or a list has a gap, an object
// twice, or a confidence out of range.
Expected<std::vector<ListsOfBlock>> LoadLists(ByteReader& bytes, int layers, int confidence_cap);

}  // namespace tsdfpp
