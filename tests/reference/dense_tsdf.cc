// docs/map.md, "`tsdf`: one field", and its variants `tsdf/min`, `tsdf/guarded` and `tsdf/static`.
#include <algorithm>
#include <cmath>
#include <set>
#include <vector>

#include "tests/reference/dense_map.h"

namespace tsdfpp::reference {
namespace {

struct Ownership {
  InstanceId label = kNoInstance;
  int confidence = 0;
};

class DenseTsdf : public DenseMap {
 public:
  DenseTsdf(Method method, const MapConfig& config, const Box& box)
      : method_(method), config_(config), field_(box), owners_(box) {}

  void SetObjectPose(InstanceId id, const Pose& T_WO) override {
    const auto T_rel = poses_.Update(id, T_WO);
    if (T_rel && method_ != Method::kTsdfStatic) Move(id, *T_rel);
    field_.FreeEmptyBlocks();
  }

  void Fuse(const Frame& frame, const cv::Mat& labels) override {
    const Pose T_WL = Pose::Identity();
    Allocate(
        frame, labels, T_WL, config_, [](InstanceId) { return true; }, field_.blocks);
    const View view(frame, labels, T_WL, config_);
    field_.blocks.ForEachVoxelOfBlocks([&](const Eigen::Vector3i& v) {
      const std::optional<Seen> seen = view.Look(v);
      if (!seen || (method_ == Method::kTsdfGuarded && IsGuarded(v, *seen))) return;
      FuseSeen(*seen, config_, field_.grid.At(v), true);
      const bool votes = std::abs(seen->s) <= config_.vote_band();
      if (votes && InBand(seen->s, config_)) Vote(seen->label, owners_.At(v));
    });
    if (method_ == Method::kTsdfGuarded && config_.rims) CompleteFieldRims(frame, labels);
    field_.FreeEmptyBlocks();
  }

  void Remove(InstanceId id) override {
    for (const Eigen::Vector3i& v : ObjectVoxels(id)) {
      Vacate(v);
      if (config_.removed_voxels == RemovedVoxels::kFree) {
        field_.grid.At(v).distance = config_.front();
        field_.grid.At(v).weight = 1;
      }
    }
    poses_.Forget(id);
    field_.FreeEmptyBlocks();
  }

  void Rename(InstanceId from, InstanceId to) override {
    ForEachVoxel(field_.grid.box(), [&](const Eigen::Vector3i& v) {
      if (owners_(v).label == from) owners_.At(v).label = to;
    });
    poses_.Rename(from, to);
  }

  std::optional<VoxelValue> ValueAt(InstanceId id, const Eigen::Vector3i& v) const override {
    if (owners_(v).label != id) return std::nullopt;
    return AsValue(field_.grid(v));
  }

  std::vector<Listing> ListAt(const Eigen::Vector3i& v) const override {
    const Ownership& owner = owners_(v);
    if (owner.label == kNoInstance) return {};
    return {{owner.label, owner.confidence}};
  }

  std::vector<Eigen::Vector3i> ObservedVoxels(InstanceId id) const override {
    std::vector<Eigen::Vector3i> voxels;
    ForEachVoxel(field_.grid.box(), [&](const Eigen::Vector3i& v) {
      if (IsSource(id, v)) voxels.push_back(v);
    });
    return voxels;
  }

  std::vector<Eigen::Vector3i> ListedVoxels() const override {
    std::vector<Eigen::Vector3i> voxels;
    ForEachVoxel(field_.grid.box(), [&](const Eigen::Vector3i& v) {
      if (owners_(v).label != kNoInstance) voxels.push_back(v);
    });
    return voxels;
  }

  std::vector<Eigen::Vector3i> CrossedCubesOf(InstanceId) const override {
    return CrossedCubes(field_.grid);
  }

 private:
  bool IsGuarded(const Eigen::Vector3i& v, const Seen& seen) const {
    const InstanceId owner = owners_(v).label;
    const bool is_another = owner != kNoInstance && owner != seen.label;
    return is_another && field_.grid(v).distance <= config_.voxel() && seen.s < 0;
  }

  // Every object's rims go on from what is labelled so before any of them; the least id is first.
  void CompleteFieldRims(const Frame& frame, const cv::Mat& labels) {
    std::set<InstanceId> ids;
    for (int v = 0; v < labels.rows; ++v) {
      for (int u = 0; u < labels.cols; ++u) ids.insert(labels.at<std::uint16_t>(v, u));
    }
    ids.erase(kNoInstance);
    const auto is_free = [&](const Eigen::Vector3i& v) { return !field_.grid(v).observed(); };
    std::vector<std::pair<InstanceId, RimVoxel>> rims;
    for (const InstanceId id : ids) {
      DenseGrid<DenseVoxel> own(field_.grid.box());
      for (const Eigen::Vector3i& v : ObservedVoxels(id)) own.At(v) = field_.grid(v);
      for (const RimVoxel& rim :
           RimsOf(id, frame, labels, Pose::Identity(), config_, own, is_free)) {
        rims.emplace_back(id, rim);
      }
    }
    for (const auto& [id, rim] : rims) {
      if (!is_free(rim.voxel)) continue;
      field_.grid.At(rim.voxel) = rim.value;
      field_.blocks.AddBlockOf(rim.voxel);
      owners_.At(rim.voxel) = {id, 1};
    }
  }

  void Vote(InstanceId m, Ownership& owner) const {
    if (owner.label == kNoInstance) {
      owner = {m, 1};
    } else if (owner.label == m) {
      owner.confidence = std::min(owner.confidence + 1, config_.confidence_cap);
    } else if (--owner.confidence <= 0) {
      owner = {m, 1};
    }
  }

  void Vacate(const Eigen::Vector3i& v) {
    field_.grid.At(v) = DenseVoxel{};
    owners_.At(v) = Ownership{};
  }

  bool IsSource(InstanceId id, const Eigen::Vector3i& v) const {
    return owners_(v).label == id && field_.grid(v).observed();
  }

  bool GoesAlong(const DenseVoxel& voxel) const {
    return config_.moved_voxels == MovedVoxels::kAll || voxel.distance <= config_.voxel();
  }

  std::vector<Eigen::Vector3i> ObjectVoxels(InstanceId id) const {
    std::vector<Eigen::Vector3i> voxels;
    for (const Eigen::Vector3i& v : ObservedVoxels(id)) {
      if (GoesAlong(field_.grid(v))) voxels.push_back(v);
    }
    return voxels;
  }

  void Move(InstanceId id, const Pose& T_rel) {
    struct Write {
      Eigen::Vector3i voxel;
      DenseVoxel value;
      int confidence;
    };
    std::vector<Write> writes;
    const Pose T_rel_inverse = T_rel.inverse();
    ForEachVoxel(field_.grid.box(), [&](const Eigen::Vector3i& v) {
      const Eigen::Vector3d q = SourcePoint(T_rel_inverse, v, config_.voxel_m);
      const Neighbourhood place(q);
      std::array<DenseVoxel, 8> corners;
      for (int i = 0; i < 8; ++i) {
        const Eigen::Vector3i corner = CubeCorner(place.base, i);
        if (IsSource(id, corner)) corners[i] = field_.grid(corner);
      }
      const auto value = InterpolateVoxel(place, corners, config_.resampling);
      if (!value || !GoesAlong(*value)) return;
      const Eigen::Vector3i nearest = CubeCorner(place.base, NearestCorner(place));
      writes.push_back({v, *value, owners_(nearest).confidence});
    });
    // Vacating first and writing then leaves the same as clearing the old voxels that were not
    // written; `tsdf/min` has to look at the vacated field.
    for (const Eigen::Vector3i& v : ObjectVoxels(id)) Vacate(v);
    for (const Write& write : writes) {
      const DenseVoxel& there = field_.grid(write.voxel);
      if (method_ == Method::kTsdfMin && there.observed() && owners_(write.voxel).label != id &&
          !(std::abs(there.distance) > std::abs(write.value.distance))) {
        continue;
      }
      if (field_.grid.box().AtRim(write.voxel)) BoxTooSmall(write.voxel);
      field_.grid.At(write.voxel) = write.value;
      owners_.At(write.voxel) = {id, write.confidence};
      field_.blocks.AddBlockOf(write.voxel);
    }
  }

  Method method_;
  MapConfig config_;
  DenseVolume field_;
  DenseGrid<Ownership> owners_;
  PoseBook poses_;
};

}  // namespace

std::unique_ptr<DenseMap> MakeDenseTsdf(Method method, const MapConfig& config, const Box& box) {
  return std::make_unique<DenseTsdf>(method, config, box);
}

}  // namespace tsdfpp::reference
