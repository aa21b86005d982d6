// What docs/map.md promises of stored blocks at any time ("What always holds"), checked slowly and
// independently of the code that keeps it up.
#pragma once

#include <fmt/format.h>

#include <optional>
#include <string>

#include "mapper/map_config.h"
#include "mapper/volume/tsdf_block.h"

namespace tsdfpp {

// A sentence, or nothing where all is well.
using Fault = std::optional<std::string>;

// "(x, y, z)", of a block or a voxel.
std::string BlockText(const Index3& index);

// Blocks: found where they are, none empty, values in range, masks those of the values; `crossed`
// and `cover` too where `with_cover`. `name` begins the sentence.
Fault FindGridFault(const std::string& name, const TsdfGrid& grid, const MapConfig& config,
                    bool with_cover);

// Blocks are found where they are.
template <typename Block>
Fault FindHashFault(const std::string& name, const BlockGrid<Block>& grid) {
  for (const auto& entry : grid.entries()) {
    if (grid.Find(entry.index) != entry.block.get()) {
      return fmt::format("{}: block {} is not found", name, BlockText(entry.index));
    }
  }
  return std::nullopt;
}

// docs/map.md, "Cover": whether a volume covers the point q, in voxels of its lattice.
bool CoversPoint(const TsdfGrid& grid, const Eigen::Vector3d& q, float back);

// The trilinear distance at q, in voxels of the lattice; nothing where a corner that counts is
// unobserved. Metres.
std::optional<float> DistanceAtPoint(const TsdfGrid& grid, const Eigen::Vector3d& q);

}  // namespace tsdfpp
