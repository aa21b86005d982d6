// A map and its dense reference side by side.
#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <type_traits>
#include <vector>

#include "mapper/map_representation.h"
#include "mapper/voxel_inspection.h"
#include "tests/reference/dense_map.h"

namespace tsdfpp {

// Colours are averaged in 8.8 fixed point, and docs/map.md leaves the last rounding to 8 bits open.
inline constexpr int kColourTolerance_levels = 1;

std::string Text(const Eigen::Vector3i& voxel);
std::string Text(const std::vector<Listing>& list);

// Says how many differ and where the first one is.
::testing::AssertionResult SameVoxels(const std::vector<Eigen::Vector3i>& actual,
                                      const std::vector<Eigen::Vector3i>& expected);
// Values bit for bit, colours to kColourTolerance_levels.
::testing::AssertionResult SameValue(const std::optional<VoxelValue>& actual,
                                     const std::optional<VoxelValue>& expected);

// Of a reference, which is no MapRepresentation: itself.
template <typename Reference>
requires(!std::is_base_of_v<MapRepresentation, Reference>) const Reference& VoxelsOf(
    const Reference& map) {
  return map;
}

// What can be asked about the voxels of two maps; `Other` is a DenseMap or a MapRepresentation.
template <typename Other>
::testing::AssertionResult SameObject(const MapRepresentation& map, const Other& other,
                                      InstanceId id) {
  const auto observed = VoxelsOf(map).ObservedVoxels(id);
  if (auto same = SameVoxels(observed, VoxelsOf(other).ObservedVoxels(id)); !same) {
    return same << " among the observed voxels of object " << id;
  }
  for (const Eigen::Vector3i& v : observed) {
    if (auto same = SameValue(VoxelsOf(map).ValueAt(id, v), VoxelsOf(other).ValueAt(id, v));
        !same) {
      return same << " at voxel " << Text(v) << " of object " << id;
    }
  }
  return ::testing::AssertionSuccess();
}

template <typename Other>
::testing::AssertionResult SameLists(const MapRepresentation& map, const Other& other) {
  const auto listed = VoxelsOf(map).ListedVoxels();
  if (auto same = SameVoxels(listed, VoxelsOf(other).ListedVoxels()); !same) {
    return same << " among the listed voxels";
  }
  std::size_t different = 0;
  std::string first;
  for (const Eigen::Vector3i& v : listed) {
    const auto actual = VoxelsOf(map).ListAt(v);
    const auto expected = VoxelsOf(other).ListAt(v);
    if (actual == expected) continue;
    if (different++ == 0) first = Text(v) + ": " + Text(actual) + ", expected " + Text(expected);
  }
  if (different == 0) return ::testing::AssertionSuccess();
  return ::testing::AssertionFailure()
         << different << " of " << listed.size() << " lists differ, first at " << first;
}

// Runs the same events on both and compares after each.
class SideBySide {
 public:
  SideBySide(Method method, const MapConfig& config, const reference::Box& box,
             std::vector<InstanceId> ids);

  void SetObjectPose(InstanceId id, const Pose& T_WO);
  // The poses of the frame first, in increasing id, then the frame; one comparison.
  void SetPosesAndFuse(const Frame& frame) { SetPosesAndFuse(frame, frame.mask); }
  void SetPosesAndFuse(const Frame& frame, const cv::Mat& labels);
  void Remove(InstanceId id);
  void Rename(InstanceId from, InstanceId to);
  // Every voxel of the box, the unobserved and unlisted ones too.
  void CompareWholeBox() const;

  const MapRepresentation& map() const { return *map_; }
  const reference::DenseMap& dense() const { return *dense_; }

 private:
  void Compare(const std::string& event);

  std::unique_ptr<MapRepresentation> map_;
  std::unique_ptr<reference::DenseMap> dense_;
  reference::Box box_;
  std::vector<InstanceId> ids_;
  int events_ = 0;
};

}  // namespace tsdfpp
