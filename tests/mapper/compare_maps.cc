#include "tests/mapper/compare_maps.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>

#include "mapper/map_editing.h"
#include "mapper/voxel_inspection.h"

namespace tsdfpp {
namespace {

bool Before(const Eigen::Vector3i& a, const Eigen::Vector3i& b) {
  return std::make_tuple(a.z(), a.y(), a.x()) < std::make_tuple(b.z(), b.y(), b.x());
}

}  // namespace

std::string Text(const Eigen::Vector3i& voxel) {
  return fmt::format("({}, {}, {})", voxel.x(), voxel.y(), voxel.z());
}

std::string Text(const std::vector<Listing>& list) {
  std::string text = "[";
  for (const Listing& entry : list) text += fmt::format(" {}:{}", entry.id, entry.confidence);
  return text + " ]";
}

::testing::AssertionResult SameVoxels(const std::vector<Eigen::Vector3i>& actual,
                                      const std::vector<Eigen::Vector3i>& expected) {
  if (!std::is_sorted(actual.begin(), actual.end(), Before)) {
    return ::testing::AssertionFailure() << "voxels are not sorted by (z, y, x)";
  }
  if (actual == expected) return ::testing::AssertionSuccess();
  std::vector<Eigen::Vector3i> extra;
  std::vector<Eigen::Vector3i> missing;
  std::set_difference(actual.begin(), actual.end(), expected.begin(), expected.end(),
                      std::back_inserter(extra), Before);
  std::set_difference(expected.begin(), expected.end(), actual.begin(), actual.end(),
                      std::back_inserter(missing), Before);
  return ::testing::AssertionFailure()
         << actual.size() << " voxels, expected " << expected.size() << "; " << extra.size()
         << " too many" << (extra.empty() ? "" : " from " + Text(extra[0])) << ", "
         << missing.size() << " missing" << (missing.empty() ? "" : " from " + Text(missing[0]));
}

::testing::AssertionResult SameValue(const std::optional<VoxelValue>& actual,
                                     const std::optional<VoxelValue>& expected) {
  if (actual.has_value() != expected.has_value()) {
    return ::testing::AssertionFailure() << (actual ? "a value too many" : "a value missing");
  }
  if (!actual) return ::testing::AssertionSuccess();
  if (actual->distance_m != expected->distance_m) {
    return ::testing::AssertionFailure() << fmt::format("distance {:.9g}, expected {:.9g}",
                                                        actual->distance_m, expected->distance_m);
  }
  if (actual->weight != expected->weight) {
    return ::testing::AssertionFailure()
           << fmt::format("weight {:.9g}, expected {:.9g}", actual->weight, expected->weight);
  }
  for (int c = 0; c < 3; ++c) {
    if (std::abs(actual->colour[c] - expected->colour[c]) > kColourTolerance_levels) {
      return ::testing::AssertionFailure() << fmt::format("colour {} is {}, expected {}", c,
                                                          actual->colour[c], expected->colour[c]);
    }
  }
  return ::testing::AssertionSuccess();
}

SideBySide::SideBySide(Method method, const MapConfig& config, const reference::Box& box,
                       std::vector<InstanceId> ids)
    : map_(MakeMap(method, config)),
      dense_(reference::MakeDenseMap(method, config, box)),
      box_(box),
      ids_(std::move(ids)) {}

void SideBySide::SetObjectPose(InstanceId id, const Pose& T_WO) {
  map_->SetObjectPose(id, T_WO);
  dense_->SetObjectPose(id, T_WO);
  Compare(fmt::format("a pose of {}", id));
}

void SideBySide::SetPosesAndFuse(const Frame& frame, const cv::Mat& labels) {
  for (const auto& [id, T_WO] : frame.T_WO) {
    map_->SetObjectPose(id, T_WO);
    dense_->SetObjectPose(id, T_WO);
  }
  map_->Fuse(frame, labels);
  dense_->Fuse(frame, labels);
  Compare("a frame");
}

void SideBySide::Remove(InstanceId id) {
  map_->Remove(id);
  dense_->Remove(id);
  Compare(fmt::format("the removal of {}", id));
}

void SideBySide::Rename(InstanceId from, InstanceId to) {
  const auto renamed = EditingOf(*map_).Rename(from, to);
  EXPECT_TRUE(renamed.has_value()) << renamed.error().message;
  dense_->Rename(from, to);
  Compare(fmt::format("the renaming of {} to {}", from, to));
}

void SideBySide::CompareWholeBox() const {
  std::size_t different = 0;
  ForEachVoxel(box_, [&](const Eigen::Vector3i& v) {
    bool same = VoxelsOf(*map_).ListAt(v) == dense_->ListAt(v);
    for (const InstanceId id : ids_) {
      same = same && SameValue(VoxelsOf(*map_).ValueAt(id, v), dense_->ValueAt(id, v));
    }
    if (!same) ++different;
  });
  EXPECT_EQ(different, 0U) << "voxels of the box";
}

void SideBySide::Compare(const std::string& event) {
  ++events_;
  if (::testing::Test::HasFailure()) return;  // what follows a first difference says nothing
  SCOPED_TRACE(fmt::format("event {}: {}", events_, event));
  for (const InstanceId id : ids_) {
    EXPECT_TRUE(SameObject(*map_, *dense_, id));
    EXPECT_EQ(map_->ObjectLattice(id).matrix(), dense_->ObjectLattice(id).matrix()) << id;
  }
  EXPECT_TRUE(SameLists(*map_, *dense_));
  const auto fault = VoxelsOf(*map_).FindFault();
  EXPECT_FALSE(fault.has_value()) << *fault;
}

}  // namespace tsdfpp
