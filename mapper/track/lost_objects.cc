#include "mapper/track/lost_objects.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "mapper/map_editing.h"
#include "mapper/track/sdf_registration.h"
#include "mapper/volume/fusion_kernels.h"

namespace tsdfpp {
namespace {

// Of a voxel's centre from the surface, in voxels, to stand for it.
constexpr float kBeside_voxels = 0.75F;
// Depth that is off by less than so many voxels is that of the surface.
constexpr double kMargin_voxels = 3;
// The same where the model has just been registered.
constexpr double kFoundMargin_voxels = 1.5;
// An object is not in its place where so many of its voxels are seen through, and more of them than
// are matched.
constexpr int kLeastThrough = 30;
// Of the voxels that are seen, one in so many may be seen through at the right place: outlines are
// a voxel or two off.
constexpr double kMostThrough = 0.1;
// Of a segment's points that lie where the model was observed, on its surface at the right place.
constexpr double kLeastOnSurface = 0.95;
// Of all of a segment's points, where the model was observed: what shows another side fits in too
// many places.
constexpr double kLeastObserved = 0.5;
// A segment of fewer may be of anything.
constexpr std::size_t kLeastPoints = 150;
// More are not needed to say where it is.
constexpr int kMostPoints = 1000;
// A segment that comes nearer to the picture's edge goes on outside.
constexpr int kEdge_px = 3;

// Places all around.
constexpr int kViews = 60;
constexpr int kTurns = 12;  // of each view about its axis
constexpr std::size_t kPointsToTry = 100;
constexpr double kFarthest_voxels = 5;  // a point farther from the surface costs no more
constexpr double kUnobserved = 0.35;
constexpr double kBeside =
    0.6;  // of the root of the points' mean squared distance from their middle
constexpr std::size_t kRegistered = 20;
// Against a place for each radian that the object would have turned: of places that fit alike, as
// those of a box do, the one it has turned least to.
constexpr double kPerTurn = 0.05;
constexpr int kAgain = 4;              // where the search has not settled
constexpr double kSameTurn_rad = 0.5;  // places that differ by less register to the same one

// A model's surface, voxel by voxel.
struct Surface {
  std::vector<Eigen::Vector3d> points_L;
  std::vector<Eigen::Vector3d> normals_L;
};

Surface SurfaceOf(const TsdfGrid& model, const SurfaceReader& reader, double voxel_m) {
  constexpr std::size_t kMost = 1500;
  std::vector<Eigen::Vector3d> all;
  for (const auto* entry : model.Sorted()) {
    const TsdfBlock& block = *entry->block;
    if (!block.AnyNegative()) continue;
    for (int i = 0; i < kBlockVoxels; ++i) {
      const auto place = static_cast<std::size_t>(i);
      const float d = block.distance[place];
      if (block.weight[place] == 0 || std::abs(d) > kBeside_voxels * voxel_m) continue;
      const Index3 v = VoxelAt(entry->index, i);
      all.emplace_back(voxel_m * Eigen::Vector3d(v.x, v.y, v.z));
    }
  }
  Surface surface;
  const std::size_t count = std::min(kMost, all.size());
  for (std::size_t k = 0; k < count; ++k) {
    const Eigen::Vector3d& p_L = all[k * all.size() / count];
    const SurfaceSample at = reader.At(p_L);
    if (!at.has_slope) continue;
    surface.normals_L.push_back(at.normal_L().cast<double>());
    surface.points_L.push_back(p_L - double{at.distance_m()} * surface.normals_L.back());
  }
  return surface;
}

// Directions all around, evenly: a spiral (Saff and Kuijlaars 1997).
Eigen::Vector3d Direction(int i) {
  const double z = 1 - (2 * i + 1.0) / kViews;
  const double angle = i * std::numbers::pi * (3 - std::sqrt(5));
  const double r = std::sqrt(1 - z * z);
  return {r * std::cos(angle), r * std::sin(angle), z};
}

// The centroid of what can be seen along a direction, but for what the model hides of itself.
std::optional<Eigen::Vector3d> CentreSeen(const Surface& surface, const Eigen::Vector3d& along_L) {
  constexpr double kFlattest = 0.2;  // cosine
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  int count = 0;
  for (std::size_t i = 0; i < surface.points_L.size(); ++i) {
    if (surface.normals_L[i].dot(along_L) > -kFlattest) continue;
    sum += surface.points_L[i];
    ++count;
  }
  if (count == 0) return std::nullopt;
  return sum / count;
}

struct Place {
  Pose T_LC = Pose::Identity();
  double cost = 0;
};

// What a segment's points say against a place, at most 1 each.
double CostOf(const SurfaceReader& reader, const std::vector<SegmentPoint>& points,
              std::size_t stride, const Pose& T_LC, double voxel_m) {
  double cost = 0;
  for (std::size_t i = 0; i < points.size(); i += stride) {
    const SurfaceSample at = reader.At(T_LC * points[i].p_C.cast<double>());
    if (!at.is_observed) {
      cost += kUnobserved;
    } else if (!at.has_slope) {
      cost += 1;  // in what was seen to be free
    } else {
      cost += std::min(1.0, std::abs(at.distance_m()) / (kFarthest_voxels * voxel_m));
    }
  }
  return cost;
}

// All places, the best first. The model may lack the side that the segment shows, so what can be
// seen of it is laid beside the segment's middle, too.
std::vector<Place> PlacesAround(const Surface& surface, const SurfaceReader& reader,
                                const std::vector<SegmentPoint>& points, double voxel_m) {
  Eigen::Vector3d centre_C = Eigen::Vector3d::Zero();
  for (const SegmentPoint& point : points) centre_C += point.p_C.cast<double>();
  centre_C /= static_cast<double>(points.size());
  double squares = 0;
  for (const SegmentPoint& point : points) {
    squares += (point.p_C.cast<double>() - centre_C).squaredNorm();
  }
  const double beside_m = kBeside * std::sqrt(squares / static_cast<double>(points.size()));
  const std::size_t stride = std::max<std::size_t>(1, points.size() / kPointsToTry);
  std::vector<std::vector<Place>> by_view(kViews);
  tbb::parallel_for(0, kViews, [&](int view) {
    const Eigen::Vector3d along_L = Direction(view);
    const auto centre_L = CentreSeen(surface, along_L);
    if (!centre_L) return;
    const Eigen::Quaterniond to_view =
        Eigen::Quaterniond::FromTwoVectors(centre_C.normalized(), along_L);
    for (int turn = 0; turn < kTurns; ++turn) {
      const Eigen::AngleAxisd about(2 * std::numbers::pi * turn / kTurns, along_L);
      Place best;
      best.cost = std::numeric_limits<double>::infinity();
      for (int beside = 0; beside < 27; ++beside) {
        const Eigen::Vector3d shift(beside % 3 - 1, beside / 3 % 3 - 1, beside / 9 - 1);
        Place place;
        place.T_LC.linear() = (about * to_view).toRotationMatrix();
        place.T_LC.translation() = *centre_L + beside_m * shift - place.T_LC.linear() * centre_C;
        place.cost = CostOf(reader, points, stride, place.T_LC, voxel_m);
        if (place.cost < best.cost) best = place;
      }
      by_view[static_cast<std::size_t>(view)].push_back(best);
    }
  });
  std::vector<Place> places;
  for (const auto& of : by_view) places.insert(places.end(), of.begin(), of.end());
  std::stable_sort(places.begin(), places.end(),
                   [](const Place& a, const Place& b) { return a.cost < b.cost; });
  return places;
}

// The best ones that differ.
std::vector<Pose> BestOf(const std::vector<Place>& places) {
  std::vector<Pose> best;
  for (const Place& place : places) {
    const bool is_near = std::ranges::any_of(best, [&](const Pose& other) {
      const Eigen::Matrix3d turn = other.linear().transpose() * place.T_LC.linear();
      return Eigen::AngleAxisd(turn).angle() < kSameTurn_rad;
    });
    if (is_near) continue;
    best.push_back(place.T_LC);
    if (best.size() == kRegistered) break;
  }
  return best;
}

bool IsElsewhere(const ModelSight& sight) {
  return sight.through >= kLeastThrough && sight.through > sight.matched;
}

bool IsInPlace(const ModelSight& sight) {
  return sight.matched > 0 && sight.through <= kMostThrough * (sight.through + sight.matched);
}

bool ReachesTheEdge(const std::vector<int>& pixels, const cv::Size& size) {
  return std::ranges::any_of(pixels, [&](int pixel) {
    const int v = pixel / size.width;
    const int u = pixel % size.width;
    return std::min({u, v, size.width - 1 - u, size.height - 1 - v}) < kEdge_px;
  });
}

}  // namespace

ModelSight LookAtModel(const Frame& frame, const TsdfGrid& model, const Pose& T_WL, double voxel_m,
                       double margin_m) {
  ModelSight sight;
  const Pose T_CL = frame.T_WC.inverse() * T_WL;
  const Intrinsics& camera = frame.intrinsics;
  for (const auto& entry : model.entries()) {
    const TsdfBlock& block = *entry.block;
    if (!block.AnyNegative()) continue;
    for (int i = 0; i < kBlockVoxels; ++i) {
      const auto place = static_cast<std::size_t>(i);
      const float d = block.distance[place];
      if (block.weight[place] == 0 || std::abs(d) > kBeside_voxels * voxel_m) continue;
      const Index3 voxel = VoxelAt(entry.index, i);
      const Eigen::Vector3d p_C = T_CL * (voxel_m * Eigen::Vector3d(voxel.x, voxel.y, voxel.z));
      if (!(p_C.z() > double{kNearest_m})) continue;
      const double u = std::floor(camera.fx * p_C.x() / p_C.z() + camera.cx + 0.5);
      const double v = std::floor(camera.fy * p_C.y() / p_C.z() + camera.cy + 0.5);
      if (!(u >= 1 && v >= 1 && u < camera.width - 1 && v < camera.height - 1)) continue;
      // Of the pixels around, for outlines are a pixel off.
      bool is_known = false;
      bool is_matched = false;
      bool is_farther = true;
      for (int b = -1; b <= 1; ++b) {
        for (int a = -1; a <= 1; ++a) {
          const float z = frame.depth.at<float>(static_cast<int>(v) + b, static_cast<int>(u) + a);
          if (!IsValidDepth(z)) continue;
          is_known = true;
          is_matched = is_matched || std::abs(double{z} - p_C.z()) <= margin_m;
          is_farther = is_farther && double{z} > p_C.z() + margin_m;
        }
      }
      if (!is_known) continue;
      if (is_matched) {
        ++sight.matched;
      } else if (is_farther) {
        ++sight.through;
      } else {
        ++sight.hidden;
      }
    }
  }
  return sight;
}

std::optional<FoundModel> FindModel(const Frame& frame, const std::vector<SegmentPoint>& points,
                                    const TsdfGrid& model, const Pose& T_WL_last, double voxel_m,
                                    const SdfTrackConfig& config) {
  if (points.size() < kLeastPoints) return std::nullopt;
  const SurfaceReader reader(model, voxel_m);
  const Surface surface = SurfaceOf(model, reader, voxel_m);
  std::optional<FoundModel> found;
  double least = std::numeric_limits<double>::infinity();
  for (const Pose& seed : BestOf(PlacesAround(surface, reader, points, voxel_m))) {
    SdfRegistration task{&reader, points, voxel_m, frame.intrinsics};
    task.T_LC_expected = seed;
    SdfRegistrationResult result = RegisterToDistances(task, config);
    task.is_near = true;
    for (int again = 0; again < kAgain && !result.converged; ++again) {
      task.T_LC_expected = result.T_LC;
      result = RegisterToDistances(task, config);
    }
    const DistanceCounts& counts = result.counts;
    if (counts.observed < kLeastObserved * counts.points) continue;
    if (counts.inliers < kLeastOnSurface * counts.observed) continue;
    const double share = static_cast<double>(counts.inliers) / counts.points;
    const double margin_m =
        kFoundMargin_voxels * voxel_m + kNoiseDeviations * config.Axial_m(points.front().p_C.z());
    const Pose T_WL = frame.T_WC * result.T_LC.inverse();
    const ModelSight sight = LookAtModel(frame, model, T_WL, voxel_m, margin_m);
    if (!IsInPlace(sight)) continue;
    const Eigen::Matrix3d turn = T_WL_last.linear().transpose() * T_WL.linear();
    const double against = static_cast<double>(sight.through) / (sight.through + sight.matched) +
                           counts.deviation_m / voxel_m +
                           kPerTurn * Eigen::AngleAxisd(turn).angle();
    if (!(against < least)) continue;
    least = against;
    found = FoundModel{result.T_LC, share};
  }
  return found;
}

std::vector<InstanceId> LostObjects::NotInPlace(
    const Frame& frame, const MapRepresentation& map, const ObjectPoses& T_WO,
    const std::map<InstanceId, TrackStatus>& seen) const {
  std::vector<InstanceId> lost;
  const double voxel_m = map.config().voxel_m;
  for (const auto& [id, pose] : T_WO) {
    const auto status = seen.find(id);
    if (status != seen.end() && status->second != TrackStatus::kFrozen) continue;
    const std::optional<ObjectModel> model = ModelOf(map, id);
    if (!model) continue;
    if (IsElsewhere(
            LookAtModel(frame, *model->grid, model->T_WL, voxel_m, kMargin_voxels * voxel_m))) {
      lost.push_back(id);
    }
  }
  return lost;
}

void LostObjects::Keep(InstanceId id, const MapRepresentation& map, const Pose& T_WO) {
  const std::optional<ObjectModel> model = ModelOf(map, id);
  if (!model) return;
  kept_.insert_or_assign(id, Kept{*model->grid, model->T_WL, T_WO, map.config().voxel_m});
}

std::optional<LostObjects::Found> LostObjects::Find(InstanceId id, const Frame& frame,
                                                    const std::vector<int>& pixels) const {
  const Kept& kept = kept_.at(id);
  if (ReachesTheEdge(pixels, frame.depth.size())) return std::nullopt;
  SdfTrackConfig config = config_;
  config.max_points = std::min(config.max_points, kMostPoints);
  const auto points = SegmentPointsOf(frame, pixels, kept.voxel_m, config);
  const auto found = FindModel(frame, points, kept.volume, kept.T_WL, kept.voxel_m, config_);
  if (!found) return std::nullopt;
  return Found{id, frame.T_WC * found->T_LC.inverse() * kept.T_WL.inverse() * kept.T_WO,
               found->on_surface};
}

std::optional<LostObjects::Found> LostObjects::FindAny(const Frame& frame,
                                                       const std::vector<int>& pixels) const {
  std::optional<Found> best;
  for (const auto& [id, kept] : kept_) {
    const std::optional<Found> found = Find(id, frame, pixels);
    if (found && (!best || found->on_surface > best->on_surface)) best = found;
  }
  return best;
}

Expected<void> LostObjects::PutBack(InstanceId id, const Pose& T_WO, MapRepresentation& map) const {
  const Kept& kept = kept_.at(id);
  const Pose T_WL = T_WO * kept.T_WO.inverse() * kept.T_WL;
  return EditingOf(map).Add(id, kept.volume, T_WL, T_WO);
}

ObjectPoses LostObjects::LastPoses() const {
  ObjectPoses poses;
  for (const auto& [id, kept] : kept_) poses[id] = kept.T_WO;
  return poses;
}

}  // namespace tsdfpp
