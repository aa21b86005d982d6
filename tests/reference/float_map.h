// `tsdf`, `tsdf/static` and `tsdf++` of docs/map.md once more, with floating-point weights and
// distances: what weights that no byte holds would change. Plain, one thread; sparse only so that a
// whole scene fits. With FloatConfig::half_distances and byte_weights and every weight 1 they are
// the production maps, bit for bit. Colours are left out: no score reads them.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "mapper/map_representation.h"
#include "mapper/voxel_inspection.h"
#include "tests/reference/float_voxel.h"

namespace tsdfpp::reference {

// What of one field moves with an object: the voxels that are observed, labelled so, and
enum class FieldMoves {
  kAll,   // nothing else: free space labelled o moves too
  kNear,  // have a distance of at most one voxel; a destination is written where its is as well
  kNone,  // none: poses are ignored. A removal clears all labelled voxels, as with kAll
};

// Functions are those of MapRepresentation, but for what is said.
class FloatMap {
 public:
  virtual ~FloatMap() = default;
  virtual void SetObjectPose(InstanceId id, const Pose& T_WO) = 0;
  virtual void Fuse(const Frame& frame, const cv::Mat& labels) = 0;
  virtual void Remove(InstanceId id) = 0;
  virtual std::unique_ptr<FloatMap> Clone() const = 0;
  // Without colours.
  virtual TriangleMesh SceneMesh() const = 0;
  virtual std::optional<FloatVoxel> ValueAt(InstanceId id, const Eigen::Vector3i& voxel) const = 0;
  virtual std::vector<Listing> ListAt(const Eigen::Vector3i& voxel) const = 0;
  virtual std::vector<Eigen::Vector3i> ObservedVoxels(InstanceId id) const = 0;
  virtual std::vector<Eigen::Vector3i> ListedVoxels() const = 0;
  // Every observed voxel of every volume.
  virtual void ForEachObserved(const std::function<void(const FloatVoxel&)>& function) const = 0;
};

std::unique_ptr<FloatMap> MakeFloatTsdf(const FloatConfig& config, FieldMoves moves);
// K = 2, resampling `all`, contradiction, no rims.
std::unique_ptr<FloatMap> MakeFloatTsdfpp(const FloatConfig& config);

}  // namespace tsdfpp::reference
