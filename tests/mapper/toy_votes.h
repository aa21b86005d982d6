// The toys' small scenes, mapped with the ids that votes find.
#pragma once

#include "tests/mapper/toy_scene.h"
#include "tests/mapper/vote_world.h"

namespace tsdfpp {

// The frame of a sequence in which VoteConfig{} lets an object be born.
inline constexpr int kConfirmed = 3;

class ToyVotes : public VoteWorld {
 public:
  explicit ToyVotes(Method method = Method::kTsdfppAnchored, const VoteConfig& votes = {})
      : VoteWorld(method, ToyConfig(), votes) {}
};

inline int CountOf(const cv::Mat& labels, InstanceId id) {
  return cv::countNonZero(labels == static_cast<double>(id));
}

}  // namespace tsdfpp
