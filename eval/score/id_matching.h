// Which true object each object of a map is, where the map's ids are its own (association by
// votes).
#pragma once

#include <map>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <set>
#include <utility>
#include <vector>

#include "core/types.h"
#include "eval/score/evaluation.h"
#include "mapper/map_representation.h"

namespace tsdfpp {

// Ids are matched by the pixels that an object of the map and a true one have shared, each once:
// what is matched stays so to the end of the sequence, right or not.
class IdMatching {
 public:
  // Counts a frame's pixels: `labels` as associated with the map, `truth` the true mask (both
  // CV_16UC1, of one size).
  void Observe(const cv::Mat& labels, const cv::Mat& truth);

  // Matches the ids that have come since the last call, those with the most pixels first: an id is
  // the true object with which it has shared most of them (the lower one of equals), unless that is
  // the background or another id is that object already. Then it is nobody's, and stays so.
  void Settle();

  // The true object; kNoInstance where the id is nobody's or was not settled. The background's is
  // the background.
  InstanceId TruthOf(InstanceId id) const;
  // The map's id of a true object; kNoInstance where it has none.
  InstanceId IdOf(InstanceId object) const;

  // Of each id the true object, null where it is nobody's, and its share of the id's pixels.
  nlohmann::json ToJson() const;

 private:
  std::map<InstanceId, std::map<InstanceId, std::int64_t>> pixels_;  // by id, then true object
  std::map<InstanceId, InstanceId> truth_of_;
};

// What MeshesOf gives of a map with the truth's ids: `movers` are true objects, and faces have the
// ids of true objects, kNoInstance where they are nobody's. `mesher` as there.
SceneMeshes MeshesOf(const MapRepresentation& map, const std::set<InstanceId>& movers,
                     const IdMatching& matching, SceneMesher& mesher);

}  // namespace tsdfpp
