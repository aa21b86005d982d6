#include "mapper/store/volume_store.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <bit>
#include <cmath>

#include "core/limits.h"

namespace tsdfpp {
namespace {

// Blocks that are packed together, each kind of number by itself, which compresses better.
constexpr std::size_t kBlocksPerGroup = 64;
constexpr std::size_t kIndexBytes = 3 * sizeof(std::int32_t);

void PutIndex(const Index3& index, std::string& bytes) {
  PutBytes(static_cast<std::int32_t>(index.x), bytes);
  PutBytes(static_cast<std::int32_t>(index.y), bytes);
  PutBytes(static_cast<std::int32_t>(index.z), bytes);
}

Index3 GetIndex(ByteReader& bytes) {
  Index3 index;
  index.x = bytes.Get<std::int32_t>();
  index.y = bytes.Get<std::int32_t>();
  index.z = bytes.Get<std::int32_t>();
  return index;
}

bool IsNear(const Index3& index) {
  for (const int i : {index.x, index.y, index.z}) {
    if (i < -kFurthestBlock || i > kFurthestBlock) return false;
  }
  return true;
}

// All first bytes of the numbers, then all second ones, ...
template <typename T>
void PutPlanes(const std::vector<T>& values, std::string& bytes) {
  const std::size_t at = bytes.size();
  bytes.resize(at + values.size() * sizeof(T));
  const auto* from = reinterpret_cast<const char*>(values.data());
  for (std::size_t plane = 0; plane < sizeof(T); ++plane) {
    char* to = &bytes[at] + plane * values.size();
    for (std::size_t i = 0; i < values.size(); ++i) to[i] = from[i * sizeof(T) + plane];
  }
}

template <typename T>
std::vector<T> GetPlanes(std::size_t count, ByteReader& bytes) {
  const std::string_view from = bytes.Take(count * sizeof(T));
  std::vector<T> values(bytes.ok() ? count : 0);
  auto* to = reinterpret_cast<char*>(values.data());
  for (std::size_t plane = 0; plane < sizeof(T); ++plane) {
    for (std::size_t i = 0; i < values.size(); ++i) {
      to[i * sizeof(T) + plane] = from[plane * values.size() + i];
    }
  }
  return values;
}

// The stored numbers of the observed voxels of a group of blocks.
struct GroupValues {
  std::vector<float> distance;
  std::vector<float> weight;
  std::array<std::vector<std::uint16_t>, 3> colour;
  std::vector<std::uint16_t> colour_count;
};

template <typename Function>
void ForEachObserved(const BlockMask& observed, const Function& function) {
  for (std::size_t z = 0; z < kBlockSide; ++z) {
    for (std::uint64_t bits = observed[z]; bits != 0; bits &= bits - 1) {
      function(64 * z + static_cast<std::size_t>(std::countr_zero(bits)));
    }
  }
}

std::string SaveGroup(const std::vector<const TsdfGrid::Entry*>& blocks, std::size_t first) {
  const std::size_t end = std::min(blocks.size(), first + kBlocksPerGroup);
  std::string bytes;
  GroupValues values;
  for (std::size_t b = first; b < end; ++b) PutIndex(blocks[b]->index, bytes);
  for (std::size_t b = first; b < end; ++b) {
    const TsdfBlock& block = *blocks[b]->block;
    for (const std::uint64_t slice : block.observed) PutBytes(slice, bytes);
    ForEachObserved(block.observed, [&](std::size_t i) {
      values.distance.push_back(block.distance[i]);
      values.weight.push_back(block.weight[i]);
      const FixedColour colour = block.FixedColourAt(i);
      for (std::size_t c = 0; c < 3; ++c) values.colour[c].push_back(colour[c]);
      values.colour_count.push_back(static_cast<std::uint16_t>(block.ColourCount(i)));
    });
  }
  PutPlanes(values.distance, bytes);
  PutPlanes(values.weight, bytes);
  for (const auto& channel : values.colour) PutPlanes(channel, bytes);
  PutPlanes(values.colour_count, bytes);
  return bytes;
}

using LoadedBlocks = std::vector<std::pair<Index3, std::unique_ptr<TsdfBlock>>>;

Expected<LoadedBlocks> LoadGroup(ByteReader bytes, std::size_t count, const MapConfig& config) {
  LoadedBlocks blocks(count);
  for (auto& [index, block] : blocks) index = GetIndex(bytes);
  std::vector<BlockMask> observed(count);
  std::size_t voxels = 0;
  for (BlockMask& mask : observed) {
    for (std::uint64_t& slice : mask) {
      slice = bytes.Get<std::uint64_t>();
      voxels += static_cast<std::size_t>(std::popcount(slice));
    }
    if (!Any(mask)) return DataError("a block is empty");
  }
  GroupValues values;
  values.distance = GetPlanes<float>(voxels, bytes);
  values.weight = GetPlanes<float>(voxels, bytes);
  for (auto& channel : values.colour) channel = GetPlanes<std::uint16_t>(voxels, bytes);
  values.colour_count = GetPlanes<std::uint16_t>(voxels, bytes);
  if (!bytes.AtEnd()) return DataError("a group of blocks has another length than it says");
  for (std::size_t k = 0; k < voxels; ++k) {
    const float weight = values.weight[k];
    const float distance = RoundToHalf(values.distance[k]);
    const bool good =
        config.Stores(distance, weight, values.colour_count[k]) && weight == std::floor(weight);
    if (!good) return DataError("a voxel's value is out of range");
  }
  std::size_t k = 0;
  for (std::size_t b = 0; b < count; ++b) {
    blocks[b].second = std::make_unique<TsdfBlock>();
    TsdfBlock& block = *blocks[b].second;
    ForEachObserved(observed[b], [&](std::size_t i) {
      block.distance[i] = values.distance[k];
      block.weight[i] = static_cast<std::uint8_t>(values.weight[k]);
      block.SetColour(i, {values.colour[0][k], values.colour[1][k], values.colour[2][k]},
                      values.colour_count[k]);
      ++k;
    });
    block.UpdateMasks(config.back());
  }
  return blocks;
}

}  // namespace

void SaveGrid(const TsdfGrid& grid, std::string& bytes) {
  const std::vector<const TsdfGrid::Entry*> blocks = grid.Sorted();
  std::vector<std::string> groups((blocks.size() + kBlocksPerGroup - 1) / kBlocksPerGroup);
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, groups.size(), 1),
      [&](const tbb::blocked_range<std::size_t>& range) {
        for (std::size_t g = range.begin(); g != range.end(); ++g) {
          groups[g] = SaveGroup(blocks, g * kBlocksPerGroup);
        }
      },
      tbb::simple_partitioner());
  PutBytes(static_cast<std::uint64_t>(blocks.size()), bytes);
  for (const std::string& group : groups) {
    PutBytes(static_cast<std::uint64_t>(group.size()), bytes);
    bytes += group;
  }
}

Expected<TsdfGrid> LoadGrid(ByteReader& bytes, const MapConfig& config) {
  const auto blocks = bytes.Get<std::uint64_t>();
  if (blocks > bytes.left() / kIndexBytes) return DataError("it has too few blocks");
  // A block that is nearly empty takes some fifty times its place in the file.
  TSDFPP_RETURN_IF_ERROR(CheckLimit(&Limits::map_bytes,
                                    static_cast<std::int64_t>(blocks * sizeof(TsdfBlock)),
                                    "its blocks", "bytes"));
  const std::size_t groups = (blocks + kBlocksPerGroup - 1) / kBlocksPerGroup;
  std::vector<std::string_view> group_bytes;
  for (std::size_t g = 0; g < groups; ++g) {
    const auto size = bytes.Get<std::uint64_t>();
    group_bytes.push_back(bytes.Take(size));
  }
  if (!bytes.ok()) return DataError("it ends too early");
  std::vector<Expected<LoadedBlocks>> loaded(groups);
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, groups, 1),
      [&](const tbb::blocked_range<std::size_t>& range) {
        for (std::size_t g = range.begin(); g != range.end(); ++g) {
          const std::size_t count = std::min(kBlocksPerGroup, blocks - g * kBlocksPerGroup);
          loaded[g] = LoadGroup(ByteReader(group_bytes[g]), count, config);
        }
      },
      tbb::simple_partitioner());
  TsdfGrid grid;
  for (Expected<LoadedBlocks>& group : loaded) {
    if (!group) return tl::unexpected(group.error());
    for (auto& [index, block] : *group) {
      const bool follows = grid.empty() || grid.entries().back().index < index;
      if (!IsNear(index) || !follows) return DataError("a block is out of order");
      grid.Add(index, std::move(block));
    }
  }
  return grid;
}

void SavePose(const Pose& T, std::string& bytes) {
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 4; ++c) PutBytes(T.matrix()(r, c), bytes);
  }
}

Expected<Pose> LoadPose(ByteReader& bytes, const LatticeRange& range) {
  Pose T = Pose::Identity();
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 4; ++c) T.matrix()(r, c) = bytes.Get<double>();
  }
  if (!bytes.ok()) return DataError("it ends within a pose");
  TSDFPP_RETURN_IF_ERROR(CheckRigid(T, "a"));
  if (!range.Holds(T.translation())) {
    return DataError("a pose is at {}", range.Beyond(T.translation()));
  }
  return T;
}

void SaveVolumes(const ObjectVolumes& volumes, std::string& bytes) {
  PutBytes(static_cast<std::uint32_t>(volumes.size()), bytes);
  for (const auto& [id, volume] : volumes) {
    PutBytes(id, bytes);
    for (const auto& pose : {volume.T_WO_birth, volume.T_WO}) {
      PutBytes(static_cast<std::uint8_t>(pose ? 1 : 0), bytes);
      if (pose) SavePose(*pose, bytes);
    }
    SaveGrid(volume.grid, bytes);
  }
}

Expected<ObjectVolumes> LoadVolumes(ByteReader& bytes, const MapConfig& config) {
  ObjectVolumes volumes;
  const LatticeRange range(config.voxel_m);
  std::size_t blocks = 0;
  const auto count = bytes.Get<std::uint32_t>();
  for (std::uint32_t i = 0; i < count; ++i) {
    const auto id = bytes.Get<InstanceId>();
    const bool follows = volumes.empty() || volumes.rbegin()->first < id;
    if (!bytes.ok() || !follows || id == kNoInstance) return DataError("an object is out of order");
    ObjectVolume& volume = volumes[id];
    for (auto* pose : {&volume.T_WO_birth, &volume.T_WO}) {
      const auto is_there = bytes.Get<std::uint8_t>();
      if (is_there > 1) return DataError("an object's pose is neither there nor not");
      if (is_there == 0) continue;
      TSDFPP_ASSIGN(*pose, LoadPose(bytes, range));
    }
    if (volume.T_WO_birth && !volume.T_WO) return DataError("an object has lost its pose");
    PlaceLattice(volume);
    TSDFPP_ASSIGN(volume.grid, LoadGrid(bytes, config));
    ObjectMove placement;
    placement.T = volume.T_WL;
    if (!volume.lattice_is_world) placement.blocks = &volume.grid;
    TSDFPP_RETURN_IF_ERROR(CheckMoved(range, placement, kPlacementSlack_blocks,
                                      fmt::format("object {}'s poses take a part of it to", id)));
    blocks += volume.grid.entries().size();
    TSDFPP_RETURN_IF_ERROR(CheckLimit(&Limits::map_bytes,
                                      static_cast<std::int64_t>(blocks * sizeof(TsdfBlock)),
                                      "its blocks", "bytes"));
  }
  return volumes;
}

void SaveLists(const std::vector<ListsOfBlock>& blocks, int layers, std::string& bytes) {
  PutBytes(static_cast<std::uint64_t>(blocks.size()), bytes);
  const auto stride = static_cast<std::size_t>(layers);
  for (const ListsOfBlock& block : blocks) {
    PutIndex(block.index, bytes);
    for (std::size_t layer = 0; layer < stride; ++layer) {
      for (std::size_t i = layer; i < block.entries.size(); i += stride) {
        PutBytes(block.entries[i].id, bytes);
      }
    }
    for (std::size_t layer = 0; layer < stride; ++layer) {
      for (std::size_t i = layer; i < block.entries.size(); i += stride) {
        PutBytes(block.entries[i].confidence, bytes);
      }
    }
  }
}

Expected<std::vector<ListsOfBlock>> LoadLists(ByteReader& bytes, int layers, int confidence_cap) {
  const auto stride = static_cast<std::size_t>(layers);
  const std::size_t entries = kBlockVoxels * stride;
  const std::size_t block_bytes = kIndexBytes + entries * 2 * sizeof(std::uint16_t);
  const auto count = bytes.Get<std::uint64_t>();
  if (count > bytes.left() / block_bytes) return DataError("it has too few blocks");
  std::vector<ListsOfBlock> blocks(count);
  for (std::size_t b = 0; b < count; ++b) {
    ListsOfBlock& block = blocks[b];
    block.index = GetIndex(bytes);
    block.entries.resize(entries);
    for (std::size_t layer = 0; layer < stride; ++layer) {
      for (std::size_t i = layer; i < entries; i += stride) {
        block.entries[i].id = bytes.Get<InstanceId>();
      }
    }
    for (std::size_t layer = 0; layer < stride; ++layer) {
      for (std::size_t i = layer; i < entries; i += stride) {
        block.entries[i].confidence = bytes.Get<std::int16_t>();
      }
    }
    const bool follows = b == 0 || blocks[b - 1].index < block.index;
    if (!IsNear(block.index) || !follows) return DataError("a block of lists is out of order");
    bool any = false;
    for (std::size_t i = 0; i < entries; ++i) {
      const ListEntry& entry = block.entries[i];
      const std::size_t first = i - i % stride;
      bool good = entry.confidence >= 0 && entry.confidence <= confidence_cap;
      if (entry.id == kNoInstance) {
        good = entry.confidence == 0;
      } else {
        any = true;
        good = good && (i == first || block.entries[i - 1].id != kNoInstance);
        for (std::size_t k = first; k < i; ++k) good = good && block.entries[k].id != entry.id;
      }
      if (!good) return DataError("a list is wrong");
    }
    if (!any) return DataError("a block of lists is empty");
  }
  return blocks;
}

Expected<ObjectVolumes> LoadAllVolumes(const Sections& sections, const char* name,
                                       const MapConfig& config) {
  ByteReader bytes(sections.at(name));
  TSDFPP_ASSIGN(ObjectVolumes volumes, LoadVolumes(bytes, config));
  if (!bytes.AtEnd()) return DataError("its volumes have another length than they say");
  return volumes;
}

Expected<void> CheckWorldLattices(const ObjectVolumes& volumes) {
  for (const auto& [id, volume] : volumes) {
    if (volume.T_WO_birth) {
      return DataError("object {} has a lattice of its own, expected the world's", id);
    }
  }
  return {};
}

Expected<void> CheckOwnLattices(const ObjectVolumes& volumes) {
  for (const auto& [id, volume] : volumes) {
    if (volume.T_WO && !volume.T_WO_birth) {
      return DataError("object {} has a pose and none at birth, so its lattice is nowhere", id);
    }
  }
  return {};
}

Expected<std::vector<ListsOfBlock>> LoadAllLists(
    const Sections& sections, const char* name, int layers, const MapConfig& config,
    const std::function<bool(InstanceId, const Index3&, int)>& holds) {
  ByteReader bytes(sections.at(name));
  TSDFPP_ASSIGN(std::vector<ListsOfBlock> lists, LoadLists(bytes, layers, config.confidence_cap));
  if (!bytes.AtEnd()) return DataError("its lists have another length than they say");
  for (const ListsOfBlock& of : lists) {
    for (std::size_t i = 0; i < of.entries.size(); ++i) {
      const InstanceId id = of.entries[i].id;
      if (id == kNoInstance || holds(id, of.index, static_cast<int>(i) / layers)) continue;
      return DataError("object {} is listed where it is not", id);
    }
  }
  return lists;
}

}  // namespace tsdfpp
