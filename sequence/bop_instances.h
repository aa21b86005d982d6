// Which instance of an object is which from image to image: scene_gt.json does not say.
#pragma once

#include <map>
#include <vector>

#include "core/error.h"
#include "core/types.h"

namespace tsdfpp::bop {

struct Instance {
  int obj_id = 0;
  int place = 0;  // in the image's list: the GTID of its masks
  Pose T_CO = Pose::Identity();
  InstanceId id = kNoInstance;
};

struct Image {
  Pose T_WC = Pose::Identity();
  std::vector<Instance> instances;
};

// Sets the ids of all instances and returns obj_id by id. An object that never has two instances in
// one image has its obj_id as id. Of others the first instance has it, further ones the next free
// ids after all obj_ids. An instance continues the one whose last pose in the world was nearest
// (metres + kTurnWeight_m * radians), the nearest pairs first. Errors: kData where ids run out.
Expected<std::map<InstanceId, int>> AssignIds(std::map<int, Image>& images);

inline constexpr double kTurnWeight_m = 0.05;

}  // namespace tsdfpp::bop
