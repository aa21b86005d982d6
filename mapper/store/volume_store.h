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
#include "mapper/store/section_file.h"
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
// Those of a whole section.
Expected<ObjectVolumes> LoadAllVolumes(const Sections& sections, const char* name,
                                       const MapConfig& config);
// Of methods that move values, whose objects have no pose at birth to place a lattice by. Errors:
// kData, a fragment.
Expected<void> CheckWorldLattices(const ObjectVolumes& volumes);
// Of methods that move lattices: the first pose is the one at birth. Errors: kData, a fragment.
Expected<void> CheckOwnLattices(const ObjectVolumes& volumes);

// `blocks` in the order of Index3.
void SaveLists(const std::vector<ListsOfBlock>& blocks, int layers, std::string& bytes);
// Errors: kData, a fragment, where a block is out of order or empty, or a list has a gap, an object
// twice, or a confidence out of range.
Expected<std::vector<ListsOfBlock>> LoadLists(ByteReader& bytes, int layers, int confidence_cap);
// Those of a whole section; `holds(id, block, place)` has to be true of every listing.
Expected<std::vector<ListsOfBlock>> LoadAllLists(
    const Sections& sections, const char* name, int layers, const MapConfig& config,
    const std::function<bool(InstanceId, const Index3&, int)>& holds);

}  // namespace tsdfpp
