// The map's methods once more, from docs/map.md alone: dense arrays, one thread, no cleverness. The
// fast code has to give the same voxels.
//
// Where docs/map.md leaves a choice, this is what the references take:
// - A pixel labelled kNoInstance counts as invalid depth: it neither fuses, votes nor contradicts.
// - h is MapConfig::voxel_m in double wherever a position is double, and voxel() in "Observation".
// - F, B are front(), back() in float where stored values are compared; in allocation, in double.
// - `tsdf`: what a move vacates and a removal clears are "the object's voxels"; with
//   `moved_voxels = "near_surface"` free space labelled o stays. ValueAt and ObservedVoxels go by
//   the label alone, whatever D.
// - An interpolated colour with no coloured corner is black with n = 0.
// - A closed cube is decided by the double q; coefficients by the float fraction.
// - Removal forgets the object's poses too: a later one is its pose at birth again.
// - 8.8 colours are rounded to the nearest of 8 bits.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "mapper/map_representation.h"
#include "mapper/voxel_inspection.h"
#include "tests/reference/dense_volume.h"

namespace tsdfpp::reference {

// The pose at birth and now, for every object that was given one.
class PoseBook {
 public:
  // T_WO(new) * T_WO(old)^-1; nothing for a first pose or one whose numbers are the old one's.
  std::optional<Pose> Update(InstanceId id, const Pose& T_WO);
  void Forget(InstanceId id) { poses_.erase(id); }
  void Rename(InstanceId from, InstanceId to) {
    if (const auto found = poses_.find(from); found != poses_.end()) {
      poses_.insert_or_assign(to, found->second);
      poses_.erase(from);
    }
  }
  // T_WO(now) * T_WO(birth)^-1, exactly the identity where the numbers are equal.
  Pose Lattice(InstanceId id) const;

 private:
  struct Poses {
    Pose birth;
    Pose now;
  };
  std::map<InstanceId, Poses> poses_;
};

// The same meaning as in MapRepresentation, function by function.
class DenseMap {
 public:
  virtual ~DenseMap() = default;
  virtual void SetObjectPose(InstanceId id, const Pose& T_WO) = 0;
  virtual void Fuse(const Frame& frame, const cv::Mat& labels) = 0;
  virtual void Remove(InstanceId id) = 0;
  // `from` is in the map, `to` is not.
  virtual void Rename(InstanceId from, InstanceId to) = 0;
  virtual Pose ObjectLattice(InstanceId) const { return Pose::Identity(); }
  virtual std::optional<VoxelValue> ValueAt(InstanceId id, const Eigen::Vector3i& voxel) const = 0;
  virtual std::vector<Listing> ListAt(const Eigen::Vector3i& voxel) const = 0;
  virtual std::vector<Eigen::Vector3i> ObservedVoxels(InstanceId id) const = 0;
  virtual std::vector<Eigen::Vector3i> ListedVoxels() const = 0;
  // The cubes in which marching cubes makes triangles for this object's mesh, in its lattice; for
  // one field those of the whole field, whatever the id.
  virtual std::vector<Eigen::Vector3i> CrossedCubesOf(InstanceId id) const = 0;
};

// All that happens has to stay inside `box` (in the lattice of every object), whose bounds are
// those of whole blocks; what leaves it aborts.
std::unique_ptr<DenseMap> MakeDenseMap(Method method, const MapConfig& config, const Box& box);

// The one field's variants by name.
std::unique_ptr<DenseMap> MakeDenseTsdf(Method method, const MapConfig& config, const Box& box);
std::unique_ptr<DenseMap> MakeDenseTsdfpp(const MapConfig& config, const Box& box);
std::unique_ptr<DenseMap> MakeDenseLiteral(const MapConfig& config, const Box& box);
std::unique_ptr<DenseMap> MakeDenseAnchored(const MapConfig& config, const Box& box, int layers);

// A voxel as the interface gives it.
std::optional<VoxelValue> AsValue(const DenseVoxel& voxel);

using List = std::vector<Listing>;
void TakeOff(InstanceId id, List& list);
bool IsListed(InstanceId id, const List& list);
std::vector<Eigen::Vector3i> NonEmpty(const DenseGrid<List>& lists);

}  // namespace tsdfpp::reference
