#include "mapper/methods/map_invariants.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "mapper/index/cover.h"
#include "mapper/methods/anchored_map.h"
#include "mapper/methods/literal_map.h"
#include "mapper/methods/single_field_map.h"
#include "mapper/methods/tsdfpp_map.h"

namespace tsdfpp {
namespace {

// Of interpolated values, which may leave their range by that share.
constexpr float kRounding = 1e-5F;

// Beyond, the check takes longer than what it checks by far.
[[maybe_unused]] constexpr std::size_t kMostBlocksInDebugBuilds = 1000;

std::size_t At(int i) { return static_cast<std::size_t>(i); }

std::string Text(const Index3& v) { return fmt::format("({}, {}, {})", v.x, v.y, v.z); }

Index3 IndexOf(const Eigen::Vector3i& v) { return {v.x(), v.y(), v.z()}; }

struct Corner {
  bool observed = false;
  float distance = 0;
};

Corner CornerAt(const TsdfGrid& grid, const Index3& voxel) {
  const TsdfBlock* block = grid.Find(BlockOf(voxel));
  const std::size_t i = At(PlaceInBlock(voxel));
  if (block == nullptr || !(block->weight[i] > 0)) return {};
  return {true, block->distance[i]};
}

bool IsCrossed(const TsdfGrid& grid, const Index3& cube) {
  bool below = false;
  bool above = false;
  for (int i = 0; i < 8; ++i) {
    const Corner corner = CornerAt(grid, cube + Index3{i & 1, (i >> 1) & 1, i >> 2});
    if (!corner.observed) return false;
    (corner.distance < 0 ? below : above) = true;
  }
  return below && above;
}

Fault FindVoxelFault(const TsdfBlock& block, std::size_t i, const MapConfig& config) {
  const int weight = block.weight[i];
  const float distance = block.distance[i];
  const int colours = block.ColourCount(i);
  if (weight == 0) {
    const FixedColour none{};
    if (distance != 0 || colours != 0 || block.FixedColourAt(i) != none) {
      return fmt::format("is unobserved and holds distance {}, {} colours", distance, colours);
    }
    return std::nullopt;
  }
  const bool weighs = weight > 0 && weight <= config.weight_cap;
  if (!weighs || colours > config.weight_cap) {
    return fmt::format("has weight {} and {} colours, expected up to {}", weight, colours,
                       config.weight_cap);
  }
  const float slack = kRounding * config.front();
  if (!(distance >= -config.back() - slack && distance <= config.front() + slack)) {
    return fmt::format("has distance {}, expected {} to {}", distance, -config.back(),
                       config.front());
  }
  return std::nullopt;
}

// Objects whose listings need volumes that cover, in the lattice that `T_LW` leads to.
Fault FindCoverFault(const VoxelMap& map, const MapConfig& config, bool by_distance) {
  for (const Eigen::Vector3i& v : map.ListedVoxels()) {
    std::optional<std::pair<float, InstanceId>> last;
    for (const Listing& listing : map.ListAt(v)) {
      const Pose T_WL = map.ObjectLattice(listing.id);
      const Eigen::Vector3d voxel = v.cast<double>();
      const Eigen::Vector3d q =
          SameNumbers(T_WL, Pose::Identity())
              ? voxel
              : Eigen::Vector3d((T_WL.inverse() * (voxel * config.voxel_m)) / config.voxel_m);
      const TsdfGrid& grid = *map.GridOf(listing.id);
      if (!CoversPoint(grid, q, config.back())) {
        return fmt::format("object {} is listed at voxel {} and does not cover it", listing.id,
                           Text(IndexOf(v)));
      }
      const std::pair<float, InstanceId> now{DistanceAtPoint(grid, q).value(), listing.id};
      if (by_distance && last && now < *last) {
        return fmt::format("object {} is listed at voxel {} behind object {}, which is less near",
                           listing.id, Text(IndexOf(v)), last->second);
      }
      last = now;
    }
  }
  return std::nullopt;
}

template <typename Block>
Fault FindHashFault(const std::string& name, const BlockGrid<Block>& grid) {
  for (const auto& entry : grid.entries()) {
    if (grid.Find(entry.index) != entry.block.get()) {
      return fmt::format("{}: block {} is not found", name, Text(entry.index));
    }
  }
  return std::nullopt;
}

}  // namespace

void CheckInDebugBuilds([[maybe_unused]] const VoxelMap& map) {
#ifndef NDEBUG
  if (map.Memory().blocks > kMostBlocksInDebugBuilds) return;
  if (const Fault fault = map.FindFault()) {
    std::fprintf(stderr, "tsdfpp: %s\n", fault->c_str());
    std::abort();
  }
#endif
}

bool CoversPoint(const TsdfGrid& grid, const Eigen::Vector3d& q, float back) {
  const Index3 base{static_cast<int>(std::floor(q.x())), static_cast<int>(std::floor(q.y())),
                    static_cast<int>(std::floor(q.z()))};
  // Like the interpolation's, fractions are of single precision.
  const std::array<bool, 3> on_plane{static_cast<float>(q.x() - base.x) == 0,
                                     static_cast<float>(q.y() - base.y) == 0,
                                     static_cast<float>(q.z() - base.z) == 0};
  for (int i = 0; i < 8; ++i) {
    const Index3 below{i & 1, (i >> 1) & 1, i >> 2};
    if ((below.x != 0 && !on_plane[0]) || (below.y != 0 && !on_plane[1]) ||
        (below.z != 0 && !on_plane[2])) {
      continue;
    }
    if (IsCrossed(grid, {base.x - below.x, base.y - below.y, base.z - below.z})) return true;
  }
  const auto distance = DistanceAtPoint(grid, q);
  return distance && *distance < 0 && *distance >= -back;
}

std::optional<float> DistanceAtPoint(const TsdfGrid& grid, const Eigen::Vector3d& q) {
  const Index3 base{static_cast<int>(std::floor(q.x())), static_cast<int>(std::floor(q.y())),
                    static_cast<int>(std::floor(q.z()))};
  const std::array<float, 3> f{static_cast<float>(q.x() - base.x),
                               static_cast<float>(q.y() - base.y),
                               static_cast<float>(q.z() - base.z)};
  std::array<float, 8> distance{};
  for (int i = 0; i < 8; ++i) {
    bool counts = true;
    for (int axis = 0; axis < 3; ++axis) {
      counts = counts && (((i >> axis) & 1) != 0 ? f[At(axis)] != 0 : f[At(axis)] != 1);
    }
    if (!counts) continue;
    const Corner corner = CornerAt(grid, base + Index3{i & 1, (i >> 1) & 1, i >> 2});
    if (!corner.observed) return std::nullopt;
    distance[At(i)] = corner.distance;
  }
  return Trilinear(distance, f);
}

namespace {

Fault FindCubeFault(const std::string& name, const TsdfGrid& grid) {
  for (const auto& [index, block] : grid.entries()) {
    for (int place = 0; place < kBlockVoxels; ++place) {
      const Index3 voxel = VoxelAt(index, place);
      if (Bit(block->crossed, place) == IsCrossed(grid, voxel)) continue;
      return fmt::format("{}: whether the cube of voxel {} is crossed is wrong", name, Text(voxel));
    }
  }
  return std::nullopt;
}

}  // namespace

Fault FindGridFault(const std::string& name, const TsdfGrid& grid, const MapConfig& config,
                    bool with_cover) {
  if (Fault fault = FindHashFault(name, grid)) return fault;
  for (const auto& [index, block] : grid.entries()) {
    bool any = false;
    for (int place = 0; place < kBlockVoxels; ++place) {
      const std::size_t i = At(place);
      const float distance = block->distance[i];
      const bool observed = block->weight[i] > 0;
      const Index3 voxel = VoxelAt(index, place);
      any = any || observed;
      if (const Fault fault = FindVoxelFault(*block, i, config)) {
        return fmt::format("{}: voxel {} {}", name, Text(voxel), *fault);
      }
      const bool negative = observed && distance < 0;
      const bool right = Bit(block->observed, place) == observed &&
                         Bit(block->negative, place) == negative &&
                         Bit(block->band, place) == (negative && distance >= -config.back()) &&
                         (!Bit(block->full, place) || block->weight[i] == config.weight_cap);
      if (!right) return fmt::format("{}: the masks of voxel {} are wrong", name, Text(voxel));
      const Eigen::Vector3d q(voxel.x, voxel.y, voxel.z);
      if (with_cover && Bit(block->cover, place) != CoversPoint(grid, q, config.back())) {
        return fmt::format("{}: the cover of voxel {} is wrong", name, Text(voxel));
      }
    }
    if (!any) return fmt::format("{}: block {} is empty", name, Text(index));
    for (std::size_t z = 0; z < block->colours.size(); ++z) {
      if (block->colours[z] == nullptr) continue;
      const auto& count = block->colours[z]->count;
      if (std::all_of(count.begin(), count.end(), [](auto n) { return n == 0; })) {
        return fmt::format("{}: block {} keeps slice {} of colours with no voxel with a colour",
                           name, Text(index), z);
      }
    }
  }
  return with_cover ? FindCubeFault(name, grid) : std::nullopt;
}

Fault FindListFault(const VoxelMap& map) {
  const std::vector<InstanceId> objects = map.Objects();
  const MapConfig& config = map.config();
  const int layers = LayersOf(map.method(), config);
  const int confidence_cap = std::max(config.confidence_cap, config.moved_confidence);
  // Then labels of one field stay on the free space of objects that left.
  const bool labels_stay =
      IsOneField(map.method()) && config.moved_voxels == MovedVoxels::kNearSurface;
  for (const Eigen::Vector3i& v : map.ListedVoxels()) {
    const std::vector<Listing> list = map.ListAt(v);
    const std::string at = Text(IndexOf(v));
    if (list.empty()) return fmt::format("voxel {} is listed with no object", at);
    if (static_cast<int>(list.size()) > layers) {
      return fmt::format("voxel {} lists {} objects, expected up to {}", at, list.size(), layers);
    }
    for (std::size_t i = 0; i < list.size(); ++i) {
      for (std::size_t k = 0; k < i; ++k) {
        if (list[k].id == list[i].id) {
          return fmt::format("voxel {} lists object {} twice", at, list[i].id);
        }
      }
      if (list[i].confidence < 0 || list[i].confidence > confidence_cap) {
        return fmt::format("voxel {} has confidence {}, expected 0 to {}", at, list[i].confidence,
                           confidence_cap);
      }
      if (!labels_stay && !std::binary_search(objects.begin(), objects.end(), list[i].id)) {
        return fmt::format("voxel {} lists object {}, which is not in the map", at, list[i].id);
      }
    }
  }
  return std::nullopt;
}

Fault FindCountFault(const VoxelMap& map, std::size_t blocks) {
  const std::size_t counted = map.Memory().blocks;
  if (counted == blocks) return std::nullopt;
  return fmt::format("the map counts {} blocks and has {}", counted, blocks);
}

Fault LayeredMap::FindVolumeFault(bool with_covers, std::size_t& blocks) const {
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

Fault LayeredMap::FindFault() const {
  std::size_t blocks = 0;
  if (Fault fault = FindVolumeFault(false, blocks)) return fault;
  if (Fault fault = FindCountFault(*this, blocks)) return fault;
  if (Fault fault = FindListFault(*this)) return fault;
  return FindCoverFault(*this, config_, true);
}

Fault TsdfppMap::FindFault() const {
  std::size_t blocks = index_.size();
  if (Fault fault = FindVolumeFault(true, blocks)) return fault;
  if (Fault fault = FindHashFault("the index", index_)) return fault;
  if (Fault fault = FindCountFault(*this, blocks)) return fault;
  for (const auto& [index, lists] : index_.entries()) {
    if (IsEmpty(*lists)) return fmt::format("block {} of the index is empty", Text(index));
    if (lists->ids.size() % kBlockVoxels != 0 || lists->confidences.size() != lists->ids.size() ||
        lists->ids.size() > static_cast<std::size_t>(kBlockVoxels * layers_)) {
      return fmt::format("block {} of the index has {} listings", Text(index), lists->ids.size());
    }
    ListBlock shortest = *lists;
    FreeEmptyLayers(shortest);
    if (shortest.ids.size() != lists->ids.size()) {
      return fmt::format("block {} of the index has a layer that lists nothing", Text(index));
    }
    for (std::size_t i = kBlockVoxels; i < lists->ids.size(); ++i) {
      const InstanceId before = lists->ids[i - kBlockVoxels];
      if (before == kNoInstance && lists->ids[i] != kNoInstance) {
        return fmt::format("a list in block {} of the index has a gap", Text(index));
      }
    }
    for (int place = 0; place < kBlockVoxels; ++place) {
      const ListEntry active = lists->At(At(place));
      // A vote there would be passed over.
      if (Bit(lists->settled, place) &&
          (active.id != lists->settled_id || active.confidence < config_.confidence_cap)) {
        return fmt::format("voxel {} is taken for settled and is not", Text(VoxelAt(index, place)));
      }
    }
  }
  if (Fault fault = FindListFault(*this)) return fault;
  return FindCoverFault(*this, config_, false);
}

Fault AnchoredMap::FindFault() const {
  RefreshIndex();
  std::size_t blocks = index_.size();
  if (Fault fault = FindVolumeFault(true, blocks)) return fault;
  if (Fault fault = FindHashFault("the index", index_)) return fault;
  if (Fault fault = FindCountFault(*this, blocks)) return fault;
  if (Fault fault = FindListFault(*this)) return fault;
  if (Fault fault = FindCoverFault(*this, config_, true)) return fault;
  AnchoredMap rebuilt(*this);
  rebuilt.index_ = {};
  rebuilt.reach_.clear();
  for (const auto& [id, volume] : volumes_) rebuilt.moved_.push_back(id);
  rebuilt.RefreshIndex();
  for (const auto& [index, ids] : rebuilt.index_.entries()) {
    const IndexBlock* of = index_.Find(index);
    if (of == nullptr || *of != *ids) {
      return fmt::format("block {} of the index is not what volumes and poses make it",
                         Text(index));
    }
  }
  if (rebuilt.index_.size() == index_.size()) return std::nullopt;
  return fmt::format("the index has {} blocks, volumes and poses make {}", index_.size(),
                     rebuilt.index_.size());
}

Fault LiteralMap::FindFault() const {
  std::size_t blocks = lists_.size();
  for (const auto& [id, volume] : volumes_) {
    const std::string name = fmt::format("object {}", id);
    if (Fault fault = FindGridFault(name, volume.grid, config_, false)) return fault;
    blocks += volume.grid.size();
  }
  if (Fault fault = FindHashFault("the lists", lists_)) return fault;
  if (Fault fault = FindCountFault(*this, blocks)) return fault;
  for (const auto& [index, lists] : lists_.entries()) {
    if (lists->IsEmpty()) return fmt::format("block {} of lists is empty", Text(index));
    for (int place = 0; place < kBlockVoxels; ++place) {
      const InstanceId active = lists->active[At(place)].id;
      const InstanceId inactive = lists->inactive[At(place)].id;
      const Index3 voxel = VoxelAt(index, place);
      if (active == kNoInstance && inactive != kNoInstance) {
        return fmt::format("voxel {} has an inactive object and no active one", Text(voxel));
      }
      for (const InstanceId id : {active, inactive}) {
        if (id == kNoInstance) continue;
        const auto volume = volumes_.find(id);
        if (volume == volumes_.end() || !CornerAt(volume->second.grid, voxel).observed) {
          return fmt::format("object {} is listed at voxel {} and is unobserved there", id,
                             Text(voxel));
        }
      }
    }
  }
  return FindListFault(*this);
}

Fault SingleFieldMap::FindFault() const {
  if (Fault fault = FindGridFault("the field", field_, config_, false)) return fault;
  if (Fault fault = FindHashFault("the labels", labels_)) return fault;
  if (Fault fault = FindCountFault(*this, labels_.size())) return fault;
  for (const auto& [index, labels] : labels_.entries()) {
    const TsdfBlock* block = field_.Find(index);
    if (block == nullptr) return fmt::format("block {} of labels has no field", Text(index));
    for (int place = 0; place < kBlockVoxels; ++place) {
      const std::size_t i = At(place);
      const bool labelled = labels->id[i] != kNoInstance;
      const bool remembered = !labelled || (labels->ever & EverBit(labels->id[i])) != 0;
      if (labelled != (labels->confidence[i] > 0) || (labelled && block->weight[i] <= 0) ||
          !remembered) {
        return fmt::format("the label of voxel {} is wrong", Text(VoxelAt(index, place)));
      }
    }
  }
  return FindListFault(*this);
}

}  // namespace tsdfpp
