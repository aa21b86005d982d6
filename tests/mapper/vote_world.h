// Analytic worlds whose masks draw new ids in every frame, mapped with the ids that votes find.
#pragma once

#include <algorithm>
#include <map>
#include <memory>
#include <set>
#include <utility>
#include <vector>

#include "core/random.h"
#include "mapper/associate/voxel_votes.h"

namespace tsdfpp {

// Gives masks other ids, drawn anew in every call.
class DrawnIds {
 public:
  explicit DrawnIds(std::uint64_t seed) : seed_(seed) {}

  // The mask with an id in place of each other than the background: none twice.
  cv::Mat Of(const cv::Mat& mask) {
    std::map<InstanceId, InstanceId> drawn{{kBackground, kBackground}, {kNoInstance, kNoInstance}};
    std::set<InstanceId> used;
    cv::Mat result = mask.clone();
    for (int v = 0; v < mask.rows; ++v) {
      for (int u = 0; u < mask.cols; ++u) {
        const InstanceId id = mask.at<InstanceId>(v, u);
        while (!drawn.contains(id)) {
          const double draw = UniformDraw(seed_, 2, draws_++)[0];
          const auto other =
              static_cast<InstanceId>(1 + static_cast<int>(draw * (kNoInstance - 1)));
          if (used.insert(other).second) drawn[id] = other;
        }
        result.at<InstanceId>(v, u) = drawn[id];
      }
    }
    return result;
  }

 private:
  std::uint64_t seed_;
  std::uint64_t draws_ = 0;
};

class VoteWorld {
 public:
  VoteWorld(Method method, const MapConfig& map, const VoteConfig& votes = {})
      : map_(MakeMap(method, map)), votes_(votes) {}

  // Associates the frame's segments with the map and fuses it. An object of the map moves as the
  // true one does of which most of its pixels were when it was born.
  cv::Mat Map(const Frame& frame, const Segments& segments) {
    cv::Mat labels = votes_.Associate(frame, segments, *map_).labels;
    votes_.Accept();
    for (const auto& [id, truth] : MostOf(labels, frame.mask)) truth_of_.emplace(id, truth);
    for (const auto& [id, truth] : truth_of_) {
      const auto pose = frame.T_WO.find(truth);
      if (pose != frame.T_WO.end()) map_->SetObjectPose(id, pose->second);
    }
    map_->Fuse(frame, labels);
    return labels;
  }
  cv::Mat Map(const Frame& frame) { return Map(frame, {ids_.Of(frame.mask), {}, {}}); }

  const MapRepresentation& map() const { return *map_; }
  VoxelVotes& votes() { return votes_; }
  // The true object that an object of the map was born as.
  const std::map<InstanceId, InstanceId>& truth_of() const { return truth_of_; }
  DrawnIds& ids() { return ids_; }

  // Of each id but the background the one that most of its pixels have in the other image.
  static std::map<InstanceId, InstanceId> MostOf(const cv::Mat& labels, const cv::Mat& others) {
    std::map<InstanceId, std::map<InstanceId, int>> counts;
    for (int v = 0; v < labels.rows; ++v) {
      for (int u = 0; u < labels.cols; ++u) {
        const InstanceId id = labels.at<InstanceId>(v, u);
        if (id != kBackground && id != kNoInstance) ++counts[id][others.at<InstanceId>(v, u)];
      }
    }
    std::map<InstanceId, InstanceId> most;
    for (const auto& [id, of] : counts) {
      most[id] = std::max_element(of.begin(), of.end(), [](const auto& a, const auto& b) {
                   return a.second < b.second;
                 })->first;
    }
    return most;
  }

 private:
  std::unique_ptr<MapRepresentation> map_;
  VoxelVotes votes_;
  std::map<InstanceId, InstanceId> truth_of_;
  DrawnIds ids_{20261124};
};

}  // namespace tsdfpp
