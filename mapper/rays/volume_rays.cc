#include "mapper/rays/volume_rays.h"

#include <algorithm>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include "mapper/mesh/mesh_tools.h"
#include "mapper/rays/ray_pass.h"

namespace tsdfpp {
namespace {

constexpr double kLargestTable = 1U << 23U;  // blocks, 16 MiB

// Which object alone claims solid in each block of the world's lattice, or that several do: where
// nobody but an object itself does, nothing can hide its surfaces.
class Claims {
 public:
  Claims(const ObjectVolumes& volumes, double voxel_m) : voxel_m_(voxel_m) {
    std::vector<std::pair<Index3, InstanceId>> claims;
    for (const auto& [id, volume] : volumes) {
      if (volume.lattice_is_world) {
        for (const auto& entry : volume.grid.entries()) {
          if (entry.block->AnyNegative()) claims.emplace_back(entry.index, id);
        }
      } else {
        const VoxelReader reader(volume.grid);
        for (const Index3& block : BlocksTouchedBy(reader, volume.T_WL, voxel_m, true)) {
          claims.emplace_back(block, id);
        }
      }
    }
    if (claims.empty()) return;
    any_ = true;
    low_ = high_ = claims.front().first;
    for (const auto& [index, id] : claims) {
      low_ = {std::min(low_.x, index.x), std::min(low_.y, index.y), std::min(low_.z, index.z)};
      high_ = {std::max(high_.x, index.x), std::max(high_.y, index.y), std::max(high_.z, index.z)};
    }
    const double size =
        (high_.x - low_.x + 1.0) * (high_.y - low_.y + 1.0) * (high_.z - low_.z + 1.0);
    if (size > kLargestTable) return;
    table_.resize(static_cast<std::size_t>(size), kNobody);
    for (const auto& [index, id] : claims) {
      std::int32_t& owner = table_[PlaceOf(index)];
      owner = owner == kNobody || owner == id ? id : kSeveral;
    }
  }

  // Whether another object than the volume's claims solid in a box of voxels of its lattice, or
  // within two voxels of it: as far as a look-up point and the voxel nearest to it may be.
  bool Contested(const RayVolume& volume, const Index3& low, const Index3& high) const {
    constexpr double kReach_voxels = 2;
    Eigen::AlignedBox3d box;
    for (int i = 0; i < 8; ++i) {
      const Eigen::Vector3d corner((i & 1) != 0 ? high.x : low.x, (i & 2) != 0 ? high.y : low.y,
                                   (i & 4) != 0 ? high.z : low.z);
      box.extend(volume.lattice_is_world
                     ? corner
                     : Eigen::Vector3d(volume.T_WL * (corner * voxel_m_) / voxel_m_));
    }
    const auto block_of = [](double voxel) { return static_cast<int>(std::floor(voxel)) >> 3; };
    const Index3 first{block_of(box.min().x() - kReach_voxels),
                       block_of(box.min().y() - kReach_voxels),
                       block_of(box.min().z() - kReach_voxels)};
    const Index3 last{block_of(box.max().x() + kReach_voxels),
                      block_of(box.max().y() + kReach_voxels),
                      block_of(box.max().z() + kReach_voxels)};
    if (table_.empty()) return any_;
    for (int z = std::max(first.z, low_.z); z <= std::min(last.z, high_.z); ++z) {
      for (int y = std::max(first.y, low_.y); y <= std::min(last.y, high_.y); ++y) {
        for (int x = std::max(first.x, low_.x); x <= std::min(last.x, high_.x); ++x) {
          const std::int32_t owner = table_[PlaceOf({x, y, z})];
          if (owner != kNobody && owner != volume.id) return true;
        }
      }
    }
    return false;
  }

 private:
  // No ids.
  static constexpr std::int32_t kNobody = -1;
  static constexpr std::int32_t kSeveral = -2;

  std::size_t PlaceOf(const Index3& block) const {
    const auto along = [](int at, int low) { return static_cast<std::size_t>(at - low); };
    return (along(block.z, low_.z) * along(high_.y + 1, low_.y) + along(block.y, low_.y)) *
               along(high_.x + 1, low_.x) +
           along(block.x, low_.x);
  }

  double voxel_m_;
  Index3 low_;
  Index3 high_;
  bool any_ = false;
  std::vector<std::int32_t> table_;  // the claimant's id; empty where the box is too large
};

// The first one that is not left out, or kNoInstance.
InstanceId FirstOf(const std::vector<Listing>& list, std::span<const InstanceId> without) {
  for (const Listing& entry : list) {
    if (std::find(without.begin(), without.end(), entry.id) == without.end()) return entry.id;
  }
  return kNoInstance;
}

// Points' distances in the objects' volumes.
class VolumeDistances {
 public:
  VolumeDistances(const ObjectVolumes& volumes, double voxel_m) : voxel_m_(voxel_m) {
    for (const auto& [id, volume] : volumes) {
      if (volume.grid.empty()) continue;
      readers_.emplace(
          id, Reader{VoxelReader(volume.grid), volume.lattice_is_world, volume.T_WL.inverse()});
    }
  }

  std::optional<float> At(InstanceId id, const Eigen::Vector3f& p_W) const {
    const Reader& of = readers_.at(id);
    const Eigen::Vector3d p = p_W.cast<double>();
    return DistanceAt(FindCorners(
        of.reader, (of.lattice_is_world ? p : Eigen::Vector3d(of.T_LW * p)) / voxel_m_));
  }

 private:
  struct Reader {
    VoxelReader reader;
    bool lattice_is_world;
    Pose T_LW;
  };
  double voxel_m_;
  std::map<InstanceId, Reader> readers_;
};

// What a worker asks which surfaces are hidden: those that lie inside the object that is active
// there.
class HiddenSearch {
 public:
  HiddenSearch(const GlobalIndex& index, const VolumeDistances& distances, float voxel)
      : index_(&index), distances_(&distances), voxel_(voxel) {}

  void operator()(std::span<HiddenQuery> queries, std::span<const InstanceId> without) {
    LookUpAll(queries);
    for (std::size_t i = 0; i < queries.size(); ++i) {
      const auto& [v, place] = looked_up_[i];
      if (place == nullptr) continue;
      const InstanceId active = without.empty() ? *place : FirstOf(index_->ListedAt(v), without);
      if (active == kNoInstance || active == queries[i].id) continue;
      const auto distance = distances_->At(active, queries[i].look_up_W);
      queries[i].hidden = distance && *distance < -voxel_;
    }
  }

 private:
  struct LookUp {
    Index3 voxel;
    const InstanceId* active = nullptr;  // in the index; nullptr where nothing is listed
  };

  // All places first, so that their memory is on its way when it is read; one after another is in
  // the same block.
  void LookUpAll(std::span<const HiddenQuery> queries) {
    looked_up_.clear();
    Index3 block;
    const InstanceId* ids = index_->ActiveIn(block);
    for (const HiddenQuery& query : queries) {
      const Index3 v = NearestVoxel(query.look_up_W, voxel_);
      if (BlockOf(v) != block) {
        block = BlockOf(v);
        ids = index_->ActiveIn(block);
      }
      const InstanceId* place = ids == nullptr ? nullptr : ids + PlaceInBlock(v);
      __builtin_prefetch(place);
      looked_up_.push_back({v, place});
    }
  }

  const GlobalIndex* index_;
  const VolumeDistances* distances_;
  float voxel_;
  std::vector<LookUp> looked_up_;
};

std::vector<RaySurface> CastEachAlone(const ObjectVolumes& volumes, double voxel_m,
                                      const Intrinsics& camera, const Pose& T_WC,
                                      const RayCastOptions& options) {
  RayPass pass;
  pass.voxel_m = voxel_m;
  pass.each_alone = true;
  for (const auto& [id, volume] : volumes) {
    pass.volumes.push_back({id, &volume.grid, volume.T_WL, volume.lattice_is_world});
  }
  return RunRayPass(pass, camera, T_WC, options);
}

}  // namespace

std::vector<RaySurface> CastThroughVolumes(const VolumeSurfaces& surfaces, double voxel_m,
                                           const Intrinsics& camera, const Pose& T_WC,
                                           const RayCastOptions& options) {
  const ObjectVolumes& volumes = *surfaces.volumes;
  if (surfaces.index == nullptr) {
    return CastEachAlone(volumes, voxel_m, camera, T_WC, options);
  }
  const GlobalIndex& index = *surfaces.index;
  RayPass pass;
  pass.voxel_m = voxel_m;
  for (const auto& [id, volume] : volumes) {
    if (volume.grid.empty()) continue;
    pass.volumes.push_back({id, &volume.grid, volume.T_WL, volume.lattice_is_world});
  }
  const Claims claims(volumes, voxel_m);
  if (pass.volumes.size() > 1) {
    pass.contested = [&](const RayVolume& volume, const Index3& low, const Index3& high) {
      return claims.Contested(volume, low, high);
    };
  }
  const VolumeDistances distances(volumes, voxel_m);
  pass.make_hidden = [&]() -> RayPass::Hidden {
    return HiddenSearch(index, distances, static_cast<float>(voxel_m));
  };
  return RunRayPass(pass, camera, T_WC, options);
}

}  // namespace tsdfpp
