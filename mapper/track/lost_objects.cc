#include "mapper/track/lost_objects.h"

#include <algorithm>
#include <memory>
#include <set>
#include <utility>

#include "mapper/map_editing.h"
#include "mapper/map_reach.h"
#include "mapper/track/model_sight.h"
#include "mapper/track/object_model.h"

namespace tsdfpp {
namespace {

// Depth that is off by less than so many voxels is that of the surface, or of what is in contact.
constexpr double kMargin_voxels = 3;
// An object is not in its place where so many of its voxels are seen not to be there, and more of
// them than are matched.
constexpr int kLeastGone = 20;
// Of these and the matched, seen through: a segment may show the object in its place together with
// something else, through which nothing is seen. What was moved a little hides most of its old
// place itself.
constexpr double kLeastThrough = 0.04;
// What a segment has of an object's colours to be looked at as it, and to be it by its looks alone,
// which it must have by so much more than others have of it.
constexpr double kLeastAlike = 0.3;
constexpr double kLeastLikeness = 0.5;
constexpr double kLeastLead = 0.1;
constexpr int kEvery_frames = 3;
// Searches in one frame, of objects on trial, then of the pairs of segments and objects that are
// the most alike, known segments first: of a room there may be dozens of pieces with an object's
// colours.
constexpr int kMostSearches = 8;

// 255 at the pixels, else 0.
cv::Mat MaskOf(const LoosePixels& pixels, const cv::Size& size) {
  cv::Mat mask = cv::Mat::zeros(size, CV_8UC1);
  for (const int pixel : pixels)
    mask.at<std::uint8_t>(pixel / size.width, pixel % size.width) = 255;
  return mask;
}

bool IsAlike(const Appearance& segment, const Appearance& model, double voxel_m) {
  return IsOfSize(segment, model, voxel_m) && ColoursInCommon(segment, model) >= kLeastAlike;
}

// Whether some of the model should be in the picture and is not: it is hidden, or gone.
bool IsPartlyUnseen(const Frame& frame, const ObjectModel& model, double voxel_m) {
  const ModelSight sight =
      LookAtModel(frame, *model.grid, model.T_WL, voxel_m, kMargin_voxels * voxel_m);
  return sight.hidden + sight.through >= kLeastGone;
}

}  // namespace

std::vector<InstanceId> LostObjects::NotInPlace(const Frame& frame, const MapRepresentation& map,
                                                const ObjectPoses& T_WO_asked,
                                                std::span<const LoosePixels> loose) const {
  std::vector<InstanceId> lost;
  const double voxel_m = map.config().voxel_m;
  cv::Mat may_be(frame.depth.size(), CV_8UC1, cv::Scalar(255));
  for (const LoosePixels& pixels : loose) {
    for (const int pixel : pixels) {
      may_be.at<std::uint8_t>(pixel / may_be.cols, pixel % may_be.cols) = 0;
    }
  }
  for (const auto& [id, pose] : T_WO_asked) {
    const std::optional<ObjectModel> model = ModelOf(map, id);
    if (!model) continue;
    const ModelSight sight =
        LookAtModel(frame, *model->grid, model->T_WL, voxel_m, kMargin_voxels * voxel_m, may_be);
    const int gone = sight.through + sight.beside;
    const bool is_seen_through =
        sight.through > 0 && sight.through >= kLeastThrough * (gone + sight.matched);
    if (gone >= kLeastGone && gone > sight.matched && is_seen_through) lost.push_back(id);
  }
  return lost;
}

void LostObjects::Keep(InstanceId id, const MapRepresentation& map, const Pose& T_WO) {
  const std::optional<ObjectModel> model = ModelOf(map, id);
  if (!model) return;
  const double voxel_m = map.config().voxel_m;
  kept_.insert_or_assign(
      id, Kept{*model->grid, AppearanceOf(*model->grid, voxel_m), model->T_WL, T_WO, voxel_m});
}

void LostObjects::GiveUpUnsure(const Frame& frame,
                               const std::map<InstanceId, LoosePixels>& pixels_of,
                               const MapRepresentation& map, const ObjectPoses& T_WO) {
  for (const auto& [id, frozen] : unsure_) {
    const auto pose = T_WO.find(id);
    const auto pixels = pixels_of.find(id);
    if (frozen < config_.return_frames || pose == T_WO.end() || pixels == pixels_of.end()) continue;
    const SegmentLook look = LookAtSegment(frame, pixels->second, map.config().voxel_m, config_);
    if (Has(id) || !look.is_large || look.is_at_edge) continue;
    Keep(id, map, pose->second);
    if (const auto kept = kept_.find(id); kept != kept_.end()) {
      kept->second.is_given_up = true;
      kept->second.is_missing = false;
    }
  }
}

void LostObjects::Watch(const std::map<InstanceId, TrackStatus>& seen) {
  for (const auto& [id, status] : seen) {
    const auto unsure = unsure_.find(id);
    if (unsure == unsure_.end()) continue;
    if (status == TrackStatus::kFrozen) {
      ++unsure->second;
    } else {
      unsure_.erase(unsure);
    }
  }
}

std::vector<InstanceId> LostObjects::Ids() const {
  std::vector<InstanceId> ids;
  ids.reserve(kept_.size());
  for (const auto& [id, kept] : kept_) ids.push_back(id);
  return ids;
}

Associator::MayBeMissing LostObjects::Awaited(const Frame& frame,
                                              const MapRepresentation& map) const {
  // Of the map's objects, as soon as one is asked for.
  const auto of_map = std::make_shared<std::map<InstanceId, Appearance>>();
  return [this, &frame, &map, of_map](const LoosePixels& pixels,
                                      const std::vector<InstanceId>& unseen) {
    if (kept_.empty() && unseen.empty()) return false;
    const double voxel_m = map.config().voxel_m;
    const SegmentLook look = LookAtSegment(frame, pixels, voxel_m, config_);
    if (!look.is_large) return false;
    const auto may_be = [&](const Appearance& model) {
      return look.IsWhole() ? IsAlike(look.appearance, model, voxel_m)
                            : ColoursInCommon(look.appearance, model) >= kLeastAlike;
    };
    const auto is_kept = [&](const auto& entry) { return may_be(entry.second.appearance); };
    if (std::ranges::any_of(kept_, is_kept)) return true;
    return std::ranges::any_of(unseen, [&](InstanceId id) {
      const auto [appearance, is_new] = of_map->try_emplace(id);
      const std::optional<ObjectModel> model = is_new ? ModelOf(map, id) : std::nullopt;
      if (model && IsPartlyUnseen(frame, *model, voxel_m)) {
        appearance->second = AppearanceOf(*model->grid, voxel_m);
      }
      return appearance->second.points > 0 && may_be(appearance->second);
    });
  };
}

LostObjects::Return LostObjects::Find(InstanceId id, const Kept& kept, const Frame& frame,
                                      const LoosePixels& pixels, const SegmentLook& look,
                                      std::size_t segment) const {
  if (look.points.size() >= kLeastSearchedPoints) {
    const ModelSearch search{&frame,       &look.points, MaskOf(pixels, frame.depth.size()),
                             &kept.volume, kept.T_WL,    kept.voxel_m};
    if (const auto found = FindModel(search, config_)) {
      const bool is_certain = IsCertain(*found);
      return {id, segment, frame.T_WC * found->T_LC.inverse() * kept.T_WL.inverse() * kept.T_WO,
              !is_certain, is_certain ? kept.model : PlacedModel::kOther};
    }
  }
  const Eigen::Vector3d way_W =
      frame.T_WC * look.appearance.middle - kept.T_WL * kept.appearance.middle;
  return {id, segment, Eigen::Translation3d(way_W) * kept.T_WO, true};
}

std::vector<LostObjects::Return> LostObjects::FindAgain(const Frame& frame,
                                                        std::span<const Segment> segments) {
  std::vector<Return> returns;
  if (kept_.empty()) return returns;
  std::vector<SegmentLook> looks;
  for (const Segment& segment : segments) {
    looks.push_back(LookAtSegment(frame, segment.pixels, kept_.begin()->second.voxel_m, config_));
  }
  // Who is like whom, the most alike first.
  struct Pair {
    double alike = 0;
    InstanceId id = kNoInstance;
    std::size_t segment = 0;
    std::optional<Return> searched{};  // what came of a search, which is made once
  };
  std::vector<Pair> pairs;
  for (std::size_t s = 0; s < segments.size(); ++s) {
    if (!looks[s].is_large || looks[s].is_at_edge) continue;
    for (const auto& [id, kept] : kept_) {
      if (segments[s].id != kNoInstance && segments[s].id != id) continue;
      const bool is_given = segments[s].id == id;
      if (!is_given && !IsAlike(looks[s].appearance, kept.appearance, kept.voxel_m)) continue;
      pairs.push_back(
          {is_given ? 2 : ColoursInCommon(looks[s].appearance, kept.appearance), id, s});
    }
  }
  std::ranges::stable_sort(pairs, [&](const Pair& a, const Pair& b) {
    const bool a_is_known = segments[a.segment].is_known;
    return a_is_known == segments[b.segment].is_known ? a.alike > b.alike : a_is_known;
  });
  std::set<InstanceId> taken_ids;
  std::set<std::size_t> taken_segments;
  const auto take = [&](const Return& found) {
    taken_ids.insert(found.id);
    taken_segments.insert(found.segment);
    returns.push_back(found);
  };
  const auto search = [&](Pair& pair) -> const Return& {
    if (!pair.searched) {
      ++searches_;
      pair.searched = Find(pair.id, kept_.at(pair.id), frame, segments[pair.segment].pixels,
                           looks[pair.segment], pair.segment);
    }
    return *pair.searched;
  };
  for (Pair& pair : pairs) {
    const auto recalled = recalled_.find(pair.id);
    if (recalled == recalled_.end() || segments[pair.segment].id != pair.id) continue;
    pair.searched = recalled->second.found;
    pair.searched->segment = pair.segment;
  }
  std::set<InstanceId> searched;
  std::set<InstanceId> waiting;  // for their turn
  for (Pair& pair : pairs) {
    const Kept& kept = kept_.at(pair.id);
    if (kept.is_given_up && segments[pair.segment].id == pair.id) {
      take({pair.id, pair.segment, kept.T_WO, true});
      continue;
    }
    if (taken_ids.contains(pair.id) || taken_segments.contains(pair.segment)) continue;
    if (kept.frames_asked % kEvery_frames != 0) continue;
    if (!pair.searched && searches_ >= kMostSearches) {
      waiting.insert(pair.id);
      continue;
    }
    searched.insert(pair.id);
    const Return& found = search(pair);
    if (!found.begins_anew) take(found);
  }
  std::set<InstanceId> asked;
  for (const Pair& pair : pairs) {
    const bool waits = waiting.contains(pair.id) && !searched.contains(pair.id);
    if (!waits && asked.insert(pair.id).second) ++kept_.at(pair.id).frames_asked;
  }
  // Of the others, by their looks.
  std::erase_if(pairs, [&](const Pair& pair) { return !segments[pair.segment].may_begin; });
  std::set<InstanceId> waited;
  for (Pair& pair : pairs) {
    Kept& kept = kept_.at(pair.id);
    if (taken_ids.contains(pair.id) || !waited.insert(pair.id).second) continue;
    ++kept.frames_in_sight;
    const int wait = config_.return_frames * (looks[pair.segment].is_covered ? 2 : 1);
    const int over = kept.frames_in_sight - wait;
    if (over <= 0 || over % kEvery_frames != 1) continue;
    if (taken_segments.contains(pair.segment)) continue;
    const bool is_clear = std::ranges::none_of(pairs, [&](const Pair& other) {
      const bool is_rival = (other.id == pair.id) != (other.segment == pair.segment);
      return is_rival && !taken_ids.contains(other.id) && !taken_segments.contains(other.segment) &&
             other.alike > pair.alike - kLeastLead;
    });
    if (pair.alike < kLeastLikeness || !is_clear) continue;
    if (!pair.searched && searches_ >= kMostSearches) {
      --kept.frames_in_sight;  // it is its turn in the next frame
      continue;
    }
    take(search(pair));
  }
  // What was found, but has no segment any more, stays as it began anew.
  for (auto& [id, recalled] : recalled_) {
    if (taken_ids.contains(id)) continue;
    kept_.erase(id);
    on_trial_.insert_or_assign(id, std::move(recalled.trial));
  }
  recalled_.clear();
  searches_ = 0;
  return returns;
}

Expected<void> LostObjects::PutBack(const Return& found, MapRepresentation& map,
                                    ObjectPoses& T_WO) const {
  const Kept& kept = kept_.at(found.id);
  const Pose T_WL = found.T_WO * kept.T_WO.inverse() * kept.T_WL;
  if (found.begins_anew) {
    if (kept.is_in_map) map.Remove(found.id);
  } else if (kept.is_in_map) {
    TSDFPP_RETURN_IF_ERROR(CheckAddition(map.config(), found.id, kept.volume, T_WL, found.T_WO));
    map.SetObjectPose(found.id, found.T_WO);
  } else {
    map.Remove(found.id);
    TSDFPP_RETURN_IF_ERROR(EditingOf(map).Add(found.id, kept.volume, T_WL, found.T_WO));
  }
  T_WO[found.id] = found.T_WO;
  return {};
}

std::vector<InstanceId> LostObjects::TakeOut(const std::vector<InstanceId>& found,
                                             MapRepresentation& map, ObjectPoses& T_WO) {
  for (const InstanceId id : found) {
    const auto kept = kept_.find(id);
    const bool begins_anew = !ModelOf(map, id);
    // What was given up had its chance.
    if (kept->second.is_given_up) {
      on_trial_.erase(id);
    } else if (begins_anew) {
      on_trial_.insert_or_assign(id, Trial{std::move(kept->second)});
    }
    kept_.erase(kept);
    unsure_[id] = 0;
  }
  std::vector<InstanceId> lost;
  for (auto& [id, kept] : kept_) {
    if (!kept.is_in_map) continue;
    kept.is_in_map = kept.is_given_up = false;
    kept.is_missing = true;
    if (const auto trial = on_trial_.find(id); trial != on_trial_.end()) {
      KeepAsItWas(id, trial->second.before);
      on_trial_.erase(trial);
    }
    unsure_.erase(id);
    map.Remove(id);
    T_WO.erase(id);
    lost.push_back(id);
  }
  return lost;
}

void LostObjects::AskTrials(const Frame& frame,
                            const std::map<InstanceId, LoosePixels>& pixels_of) {
  std::vector<InstanceId> asked;
  for (const auto& [id, trial] : on_trial_) {
    if (pixels_of.contains(id) && trial.frames_seen % kEvery_frames == 0) asked.push_back(id);
  }
  // All have their turn.
  std::rotate(asked.begin(), std::ranges::upper_bound(asked, last_trial_), asked.end());
  searches_ = 0;
  for (const InstanceId id : asked) {
    const auto trial = on_trial_.find(id);
    const Kept& before = trial->second.before;
    const LoosePixels& pixels = pixels_of.at(id);
    const SegmentLook look = LookAtSegment(frame, pixels, before.voxel_m, config_);
    if (!look.is_large || look.is_at_edge) continue;
    if (++searches_ > kMostSearches) break;
    last_trial_ = id;
    Return found = Find(id, before, frame, pixels, look, 0);
    if (found.begins_anew) continue;
    KeepAsItWas(id, before);
    Kept& kept = kept_.at(id);
    kept.is_missing = false;
    found.model = kept.model;
    recalled_.insert_or_assign(id, Recalled{std::move(trial->second), found});
    on_trial_.erase(trial);
  }
}

void LostObjects::KeepAsItWas(InstanceId id, const Kept& kept) {
  const auto entry = kept_.insert_or_assign(id, kept).first;
  entry->second.is_in_map = false;
  entry->second.is_missing = true;
  entry->second.frames_asked = entry->second.frames_in_sight = 0;
  entry->second.model = PlacedModel::kOther;
}

std::vector<InstanceId> LostObjects::TakeBack(const std::map<InstanceId, TrackStatus>& seen,
                                              MapRepresentation& map, ObjectPoses& T_WO) {
  std::vector<InstanceId> taken;
  for (auto trial = on_trial_.begin(); trial != on_trial_.end();) {
    const InstanceId id = trial->first;
    const bool is_seen = seen.contains(id);
    int& frames = is_seen ? trial->second.frames_seen : trial->second.frames_unseen;
    if (++frames < config_.return_frames) {
      ++trial;
      continue;
    }
    if (!is_seen) {
      KeepAsItWas(id, trial->second.before);
      unsure_.erase(id);
      map.Remove(id);
      T_WO.erase(id);
      taken.push_back(id);
    }
    trial = on_trial_.erase(trial);
  }
  return taken;
}

void LostObjects::Undo(const std::vector<InstanceId>& found, MapRepresentation& map,
                       ObjectPoses& T_WO) {
  for (const InstanceId id : found) {
    Kept& kept = kept_.at(id);
    // The tracker may have seen another one, in the frame that is undone.
    kept.model = PlacedModel::kOther;
    map.Remove(id);
    T_WO.erase(id);
    if (!kept.is_in_map) continue;
    // A place that it had, and that the map took before.
    if (EditingOf(map).Add(id, kept.volume, kept.T_WL, kept.T_WO)) T_WO[id] = kept.T_WO;
  }
  std::erase_if(kept_, [](const auto& entry) { return entry.second.is_in_map; });
}

}  // namespace tsdfpp
