#include "eval/score/mesh_matching.h"

#include <algorithm>

#include "eval/score/evaluation.h"
#include "metrics/accuracy.h"
#include "metrics/mesh_tools.h"

namespace tsdfpp {
namespace {

constexpr std::size_t kSamplesAPart = 5000;

// What a part's samples say of where it lies.
struct PartOverlap {
  double area_m2 = 0;
  std::map<InstanceId, double> area_of;  // within reach, by the object that is nearest
  double near_m2 = 0;                    // within reach of any
  double away_m2 = 0;                    // of that, what faces away from the true surface
  float nearest_m = std::numeric_limits<float>::infinity();
};

PartOverlap Measure(const TriangleMesh& part, const SceneTruth& truth, double reach_m) {
  const std::vector<PlacedTruth> placed = truth.PlacedWithout({});
  const SampleSet samples = SampleReconstruction(part, {1, kSamplesAPart, 1});
  const NearestTruth nearest = FindNearestTruth(samples.points, placed);
  PartOverlap overlap;
  std::map<InstanceId, std::vector<std::size_t>> near;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const auto area = static_cast<double>(samples.area_m2[i]);
    overlap.area_m2 += area;
    overlap.nearest_m = std::min(overlap.nearest_m, nearest.distance_m[i]);
    if (!(static_cast<double>(nearest.distance_m[i]) <= reach_m)) continue;
    overlap.area_of[nearest.object[i]] += area;
    overlap.near_m2 += area;
    near[nearest.object[i]].push_back(i);
  }
  for (const PlacedTruth& one : placed) {
    const std::vector<std::size_t>& here = near[one.surface->id()];
    const Pose T_OW = one.T_WO.inverse();
    std::vector<Eigen::Vector3f> points_O;
    points_O.reserve(here.size());
    for (const std::size_t i : here) {
      points_O.push_back((T_OW * samples.points[i].cast<double>()).cast<float>());
    }
    const NearestSurface found = one.surface->index_O().Nearest(points_O);
    for (std::size_t k = 0; k < here.size(); ++k) {
      const Eigen::Vector3f normal_O =
          (T_OW.linear() * samples.normals[here[k]].cast<double>()).cast<float>();
      if (found.normal[k].dot(normal_O) < 0) {
        overlap.away_m2 += static_cast<double>(samples.area_m2[here[k]]);
      }
    }
  }
  return overlap;
}

// The object of this name and label, where the sequence has it.
const ObjectInfo* Named(const ScenePart& part, const std::vector<ObjectInfo>& objects,
                        std::string& how) {
  for (const ObjectInfo& object : objects) {
    const bool label = part.id == object.id && part.id != kNoInstance;
    const bool name = !part.name.empty() && part.name == object.name;
    // A name that is another's is not overruled by a number.
    if (name && (label || part.id == kNoInstance)) {
      how = "name";
      return &object;
    }
    if (label && part.name.empty()) {
      how = "label";
      return &object;
    }
  }
  return nullptr;
}

const ObjectInfo* Find(const std::vector<ObjectInfo>& objects, InstanceId id) {
  const auto found = std::find_if(objects.begin(), objects.end(),
                                  [&](const ObjectInfo& object) { return object.id == id; });
  return found == objects.end() ? nullptr : &*found;
}

void RemarkOnWhole(const std::string& source, const PartOverlap& whole, double reach_m,
                   std::vector<std::string>& remarks) {
  if (whole.near_m2 <= 0) {
    remarks.push_back(fmt::format(
        "{}: no part of it is within {:.3g} m of a true surface, the nearest is {:.4g} m away. Is "
        "it in the sequence's world frame and in metres? Nothing is aligned before it is measured",
        source, reach_m, whole.nearest_m));
  } else if (whole.away_m2 > 0.5 * whole.near_m2) {
    remarks.push_back(fmt::format(
        "{}: {:.0f} % of what is near the truth faces the other way. Are its faces flipped? A "
        "surface that faces away by 60 degrees or more does not count as reconstructed",
        source, 100 * whole.away_m2 / whole.near_m2));
  }
}

struct Largest {
  InstanceId id = kNoInstance;
  double area_m2 = 0;
};

// The object on which most of a part lies.
Largest LargestOf(const PartOverlap& overlap) {
  Largest best;
  for (const auto& [id, area] : overlap.area_of) {
    if (area > best.area_m2) best.id = id;
    best.area_m2 = std::max(best.area_m2, area);
  }
  return best;
}

// The object that a part is, or nullptr; says in `match` how it was found.
const ObjectInfo* ObjectOf(PartMatch& match, const PartOverlap& overlap, const Largest& best,
                           const std::vector<ObjectInfo>& objects, MatchMode mode) {
  if (mode == MatchMode::kNames) {
    const ObjectInfo* named = Named(match.part, objects, match.how);
    if (named != nullptr) return named;
    // A label that says "no object" is believed, too.
    if (match.part.id == kNoInstance && match.part.name.empty()) return nullptr;
  }
  if (!(best.area_m2 >= kLeastShare * overlap.area_m2)) return nullptr;
  const ObjectInfo* object = Find(objects, best.id);
  if (object != nullptr) match.how = "overlap";
  return object;
}

// Matches one part, and remarks on a name that speaks against where the part lies.
PartMatch MatchOf(const ScenePart& part, const PartOverlap& overlap,
                  const std::vector<ObjectInfo>& objects, MatchMode mode,
                  std::vector<std::string>& remarks) {
  const Largest best = LargestOf(overlap);
  PartMatch match{part, kNoInstance, "", "nothing", overlap.area_m2, {}};
  const ObjectInfo* object = ObjectOf(match, overlap, best, objects, mode);
  if (object != nullptr) {
    match.object = object->id;
    match.object_name = object->name;
  }
  const auto own = overlap.area_of.find(object != nullptr ? object->id : best.id);
  const double own_area = own == overlap.area_of.end() ? 0 : own->second;
  match.share = overlap.area_m2 > 0 ? Measured::Of(own_area / overlap.area_m2)
                                    : Measured::Undefined("its faces have no area");
  if (object != nullptr && match.how != "overlap" && best.id != object->id &&
      best.area_m2 > overlap.area_m2 / 2 && own_area < kLeastShare * overlap.area_m2) {
    const ObjectInfo* other = Find(objects, best.id);
    remarks.push_back(fmt::format(
        "{} counts as {} ({}), but {:.0f} % of it lies on {} ({}). If names and labels are the "
        "mapper's own, give --match overlap",
        match.part.source, object->name, object->id, 100 * best.area_m2 / overlap.area_m2,
        other == nullptr ? "an object without a name" : other->name, best.id));
  }
  return match;
}

// Objects that the sequence has shown and that no part is.
void RemarkOnMissing(const std::string& source, const SceneTruth& truth,
                     const std::vector<ObjectInfo>& objects, MatchedScene& out) {
  for (const SeenTracker& tracker : truth.trackers()) {
    const bool there =
        std::any_of(out.matches.begin(), out.matches.end(),
                    [&](const PartMatch& match) { return match.object == tracker.id(); });
    const ObjectInfo* object = Find(objects, tracker.id());
    if (there || object == nullptr) continue;
    out.remarks.push_back(
        fmt::format("{}: nothing of it is {} ({})", source, object->name, object->id));
  }
}

}  // namespace

Expected<MatchMode> MatchModeFromName(const std::string& name) {
  if (name == "names") return MatchMode::kNames;
  if (name == "overlap") return MatchMode::kOverlap;
  return UsageError("--match is '{}', expected names or overlap", name);
}

MatchedScene MatchScene(const LoadedScene& scene, const SceneTruth& truth,
                        const std::vector<ObjectInfo>& objects, double voxel_m, MatchMode mode) {
  const double reach_m = kReachVoxels * voxel_m;
  MatchedScene out;
  PartOverlap whole;
  if (scene.parts.empty()) whole = Measure(scene.mesh, truth, reach_m);
  for (std::size_t p = 0; p < scene.parts.size(); ++p) {
    const PartOverlap overlap =
        Measure(FacesOf(scene.mesh, static_cast<InstanceId>(p)), truth, reach_m);
    whole.area_m2 += overlap.area_m2;
    whole.near_m2 += overlap.near_m2;
    whole.away_m2 += overlap.away_m2;
    whole.nearest_m = std::min(whole.nearest_m, overlap.nearest_m);
    out.matches.push_back(MatchOf(scene.parts[p], overlap, objects, mode, out.remarks));
  }
  RemarkOnWhole(scene.source, whole, reach_m, out.remarks);
  if (!scene.parts.empty()) RemarkOnMissing(scene.source, truth, objects, out);
  out.mesh = scene.mesh;
  for (InstanceId& label : out.mesh.face_ids) label = out.matches[label].object;
  return out;
}

TriangleMesh WithMatches(const LoadedScene& scene, const std::vector<PartMatch>& matches,
                         const SceneTruth& truth, const std::vector<ObjectInfo>& objects,
                         double voxel_m, MatchMode mode, std::vector<std::string>& remarks) {
  std::vector<InstanceId> labels;
  for (std::size_t p = 0; p < scene.parts.size(); ++p) {
    const ScenePart& part = scene.parts[p];
    const auto same = std::find_if(matches.begin(), matches.end(), [&](const PartMatch& match) {
      return match.part.name == part.name && match.part.id == part.id;
    });
    if (same != matches.end()) {
      labels.push_back(same->object);
      continue;
    }
    const PartOverlap overlap =
        Measure(FacesOf(scene.mesh, static_cast<InstanceId>(p)), truth, kReachVoxels * voxel_m);
    labels.push_back(MatchOf(part, overlap, objects, mode, remarks).object);
  }
  TriangleMesh mesh = scene.mesh;
  for (InstanceId& label : mesh.face_ids) label = labels[label];
  return mesh;
}

nlohmann::json ToJson(const std::vector<PartMatch>& matches) {
  nlohmann::json json = nlohmann::json::array();
  for (const PartMatch& match : matches) {
    nlohmann::json one{{"part", match.part.source},
                       {"how", match.how},
                       {"area_m2", match.area_m2},
                       {"share", ToJson(match.share)}};
    one["object"] =
        match.object == kNoInstance ? nlohmann::json(nullptr) : nlohmann::json(match.object);
    one["name"] = match.object_name;
    json.push_back(one);
  }
  return json;
}

}  // namespace tsdfpp
