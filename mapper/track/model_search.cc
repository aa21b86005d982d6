#include "mapper/track/model_search.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>
#include <numbers>

#include "mapper/track/appearance.h"
#include "mapper/track/model_sight.h"
#include "mapper/track/sdf_registration.h"

namespace tsdfpp {
namespace {

// Places all around: views of the model, turns of each about its axis, and shifts.
constexpr int kViews = 60;
constexpr int kTurns = 12;
constexpr std::size_t kPointsToTry = 60;
constexpr double kFarthest_voxels = 5;  // a point farther from the surface costs no more
constexpr double kUnobserved = 0.35;    // what one costs where the model was not observed
// Of the root of the points' mean squared distance from their middle.
constexpr double kShift = 0.6;

// The best of them, and those turned as the object was last, are registered with few points ...
constexpr std::size_t kRoughly = 40;
constexpr std::size_t kRoughPoints = 250;
constexpr int kRoughIterations = 10;
constexpr double kSameTurn_rad = 0.4;  // places that differ by less register to the same one
constexpr double kSameShift = 0.5;     // of the points' radius
// ... and those of the best scores with all.
constexpr std::size_t kExactly = 8;
constexpr int kAgain = 2;  // where the search has not settled

// The score. A point that is off the surface, or a voxel that is not there, weighs as much as so
// many that are where they should be.
constexpr double kWrong = 2;
constexpr std::size_t kPointsToScore = 1000;
constexpr double kMargin_voxels = 1.5;
// Colours of a surface in other light: chromaticity, and brightness as a ratio.
constexpr double kSameChroma = 0.07;
constexpr double kSameBrightness = 1.8;
// Against a place for each radian that the object would have turned, where places look the same.
constexpr double kPerTurn = 0.05;
// Places look the same where so much of the model's surface lies on itself.
constexpr double kSameSurface = 0.9;
constexpr double kLeastObserved = 0.5;

constexpr double kLeastScore = 0.35;
constexpr double kLeastLead = 0.1;

// A model's surface, voxel by voxel.
struct Surface {
  std::vector<Eigen::Vector3d> points_L;
  std::vector<Eigen::Vector3d> normals_L;
};

Surface SurfaceOf(const TsdfGrid& model, const SurfaceReader& reader, double voxel_m) {
  constexpr std::size_t kMost = 800;
  std::vector<Eigen::Vector3d> all;
  for (const auto* entry : model.Sorted()) {
    ForEachSurfaceVoxel(*entry, voxel_m, [&](std::size_t /*place*/, const Index3& v) {
      all.emplace_back(voxel_m * Eigen::Vector3d(v.x, v.y, v.z));
    });
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

// The centroid of what can be seen along a direction, but for what the model hides of itself; of
// all of it where the model lacks that side.
Eigen::Vector3d CentreSeen(const Surface& surface, const Eigen::Vector3d& along_L) {
  constexpr double kFlattest = 0.2;        // cosine
  constexpr std::size_t kLeastShare = 20;  // one in so many
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  Eigen::Vector3d all = Eigen::Vector3d::Zero();
  std::size_t count = 0;
  for (std::size_t i = 0; i < surface.points_L.size(); ++i) {
    all += surface.points_L[i];
    if (surface.normals_L[i].dot(along_L) > -kFlattest) continue;
    sum += surface.points_L[i];
    ++count;
  }
  if (count * kLeastShare < surface.points_L.size()) {
    return all / static_cast<double>(surface.points_L.size());
  }
  return sum / static_cast<double>(count);
}

struct Place {
  Pose T_LC = Pose::Identity();
  double cost = std::numeric_limits<double>::infinity();
};

bool CostsLess(const Place& a, const Place& b) { return a.cost < b.cost; }

class Search {
 public:
  Search(const ModelSearch& search, const SdfTrackConfig& config)
      : search_(search),
        config_(config),
        reader_(*search.model, search.voxel_m),
        voxels_(*search.model),
        surface_(SurfaceOf(*search.model, reader_, search.voxel_m)) {
    const std::vector<SegmentPoint>& points = *search.points;
    for (const SegmentPoint& point : points) centre_C_ += point.p_C.cast<double>();
    centre_C_ /= static_cast<double>(points.size());
    double squares = 0;
    for (const SegmentPoint& point : points) {
      squares += (point.p_C.cast<double>() - centre_C_).squaredNorm();
    }
    radius_m_ = std::sqrt(squares / static_cast<double>(points.size()));
    rough_points_ = Thinned(kRoughPoints);
  }

  std::optional<FoundModel> Find() const {
    if (surface_.points_L.empty()) return std::nullopt;
    std::vector<Place> seeds = Distinct(PlacesAround(), kRoughly);
    std::ranges::copy(PlacesAsItWas(), std::back_inserter(seeds));
    std::vector<Place> exact = Registered(Distinct(Registered(seeds, true), kExactly), false);
    std::erase_if(exact, [](const Place& place) { return !std::isfinite(place.cost); });
    if (exact.empty()) return std::nullopt;
    std::stable_sort(exact.begin(), exact.end(), CostsLess);
    return BestOf(exact);
  }

 private:
  std::vector<SegmentPoint> Thinned(std::size_t most) const {
    const std::vector<SegmentPoint>& points = *search_.points;
    const std::size_t count = std::min(most, points.size());
    std::vector<SegmentPoint> thinned;
    for (std::size_t i = 0; i < count; ++i) thinned.push_back(points[i * points.size() / count]);
    return thinned;
  }

  // What a few of the points say against a place, at most 1 each.
  double RoughCost(const Pose& T_LC) const {
    const std::size_t stride = std::max<std::size_t>(1, rough_points_.size() / kPointsToTry);
    double cost = 0;
    int count = 0;
    for (std::size_t i = 0; i < rough_points_.size(); i += stride) {
      const SurfaceSample at = reader_.At(T_LC * rough_points_[i].p_C.cast<double>());
      ++count;
      if (!at.is_observed) {
        cost += kUnobserved;
      } else if (at.distance_m() < 0) {
        cost +=
            std::min(kUnobserved, double{-at.distance_m()} / (kFarthest_voxels * search_.voxel_m));
      } else if (!at.has_slope) {
        cost += 1;  // in what was seen to be free
      } else {
        cost +=
            std::min(1.0, double{std::abs(at.distance_m())} / (kFarthest_voxels * search_.voxel_m));
      }
    }
    return cost / count;
  }

  // The model turned like this: what is seen of it at the middle of the points, and shifted.
  std::array<Place, 7> Shifted(const Eigen::Matrix3d& R_LC, const Eigen::Vector3d& centre_L) const {
    constexpr std::array<std::array<double, 3>, 7> kShifts{
        {{0, 0, 0}, {1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}}};
    std::array<Place, 7> places;
    for (std::size_t i = 0; i < places.size(); ++i) {
      places[i].T_LC.linear() = R_LC;
      places[i].T_LC.translation() =
          centre_L +
          kShift * radius_m_ * Eigen::Vector3d(kShifts[i][0], kShifts[i][1], kShifts[i][2]) -
          R_LC * centre_C_;
    }
    return places;
  }

  // Turned as it was last.
  std::array<Place, 7> PlacesAsItWas() const {
    const Eigen::Matrix3d R_LC =
        search_.T_WL_last.linear().transpose() * search_.frame->T_WC.linear();
    return Shifted(R_LC, CentreSeen(surface_, R_LC * centre_C_.normalized()));
  }

  // Of each view and turn the shift that costs the least.
  std::vector<Place> PlacesAround() const {
    std::vector<Place> places(std::size_t{kViews} * kTurns);
    tbb::parallel_for(0, kViews, [&](int view) {
      const Eigen::Vector3d along_L = Direction(view);
      const Eigen::Vector3d centre_L = CentreSeen(surface_, along_L);
      const Eigen::Quaterniond to_view =
          Eigen::Quaterniond::FromTwoVectors(centre_C_.normalized(), along_L);
      for (int turn = 0; turn < kTurns; ++turn) {
        const Eigen::AngleAxisd about(2 * std::numbers::pi * turn / kTurns, along_L);
        std::array<Place, 7> shifted = Shifted((about * to_view).toRotationMatrix(), centre_L);
        for (Place& place : shifted) place.cost = RoughCost(place.T_LC);
        places[static_cast<std::size_t>(view * kTurns + turn)] =
            *std::ranges::min_element(shifted, CostsLess);
      }
    });
    return places;
  }

  bool IsSame(const Place& a, const Place& b) const {
    const Eigen::Matrix3d turn = a.T_LC.linear().transpose() * b.T_LC.linear();
    return Eigen::AngleAxisd(turn).angle() < kSameTurn_rad &&
           (a.T_LC * centre_C_ - b.T_LC * centre_C_).norm() < kSameShift * radius_m_;
  }

  // The best ones that differ, at most so many, the best first.
  std::vector<Place> Distinct(std::vector<Place> places, std::size_t most) const {
    std::stable_sort(places.begin(), places.end(), CostsLess);
    std::vector<Place> distinct;
    for (const Place& place : places) {
      if (distinct.size() == most) break;
      if (!std::isfinite(place.cost)) continue;
      if (std::ranges::none_of(distinct, [&](const Place& o) { return IsSame(o, place); })) {
        distinct.push_back(place);
      }
    }
    return distinct;
  }

  // Each registered; it costs its score, negated, or infinity where it does not settle.
  std::vector<Place> Registered(const std::vector<Place>& seeds, bool is_rough) const {
    SdfTrackConfig config = config_;
    // What was measured at a grazing angle is seen from elsewhere now, and may fall along any ray.
    config.max_slope = config.certain_slope = 0;
    if (is_rough) {
      config.coarse_points = config.middle_points = static_cast<int>(kRoughPoints);
      config.max_iterations = kRoughIterations;
    }
    std::vector<Place> places(seeds.size());
    tbb::parallel_for(std::size_t{0}, seeds.size(), [&](std::size_t i) {
      SdfRegistration task{&reader_, is_rough ? rough_points_ : *search_.points, search_.voxel_m,
                           search_.frame->intrinsics};
      task.T_LC_expected = seeds[i].T_LC;
      task.is_near = !is_rough;
      SdfRegistrationResult result = RegisterToDistances(task, config);
      task.is_near = true;
      for (int again = 0; !is_rough && again < kAgain && !result.converged; ++again) {
        task.T_LC_expected = result.T_LC;
        result = RegisterToDistances(task, config);
      }
      places[i].T_LC = result.T_LC;
      // A rough search need not have settled.
      if (is_rough || result.converged) places[i].cost = -Score(result.T_LC);
    });
    return places;
  }

  // 1 where a point's colour is the model's there, -1 where it is not, 0 where nothing is known.
  int ColourSays(const SegmentPoint& point, const Eigen::Vector3d& p_L) const {
    if (search_.frame->colour.empty()) return 0;
    const Eigen::Vector3d scaled = p_L / search_.voxel_m;
    const Index3 voxel{static_cast<int>(std::lround(scaled.x())),
                       static_cast<int>(std::lround(scaled.y())),
                       static_cast<int>(std::lround(scaled.z()))};
    const TsdfBlock* block = voxels_.BlockAt(BlockOf(voxel));
    if (block == nullptr) return 0;
    const auto place = static_cast<std::size_t>(PlaceInBlock(voxel));
    if (block->ColourCount(place) == 0) return 0;
    const FixedColour fixed = block->FixedColourAt(place);
    const auto& pixel = search_.frame->colour.at<cv::Vec3b>(point.pixel);
    const Chromatic a = ChromaticOf(RgbOf(pixel));
    const Chromatic b = ChromaticOf({fixed[0] / 256.0, fixed[1] / 256.0, fixed[2] / 256.0});
    const double chroma = std::hypot(a.first - b.first, a.second - b.second);
    const double ratio = std::max(a.sum, b.sum) / std::min(a.sum, b.sum);
    return chroma <= kSameChroma && ratio <= kSameBrightness ? 1 : -1;
  }

  double Score(const Pose& T_LC) const {
    const std::vector<SegmentPoint>& points = *search_.points;
    const std::size_t stride = std::max<std::size_t>(1, points.size() / kPointsToScore);
    double sum = 0;
    int count = 0;
    for (std::size_t i = 0; i < points.size(); i += stride) {
      ++count;
      const Eigen::Vector3d p_L = T_LC * points[i].p_C.cast<double>();
      const SurfaceSample at = reader_.At(p_L);
      if (!at.is_observed) continue;
      const double limit_m = config_.inlier_voxels * search_.voxel_m +
                             kNoiseDeviations * config_.Axial_m(points[i].p_C.z());
      // Behind what was seen of it the other side of a thin thing may be.
      if (double{at.distance_m()} < -limit_m) continue;
      if (!at.has_slope || double{at.distance_m()} > limit_m) {
        sum -= kWrong;
        continue;
      }
      const int colour = ColourSays(points[i], p_L);
      sum += colour == 0 ? 0.5 : colour;
    }
    const double margin_m = kMargin_voxels * search_.voxel_m +
                            kNoiseDeviations * config_.Axial_m(points.front().p_C.z());
    const Pose T_WL = search_.frame->T_WC * T_LC.inverse();
    const ModelSight sight = LookAtModel(*search_.frame, *search_.model, T_WL, search_.voxel_m,
                                         margin_m, search_.may_be);
    const int wrong = sight.through + sight.beside;
    const int seen = wrong + sight.matched;
    if (seen == 0) return -kWrong;
    return sum / count - kWrong * wrong / seen;
  }

  bool LooksTheSame(const Pose& a, const Pose& b) const {
    const Pose T_BA = b * a.inverse();
    std::size_t observed = 0;
    std::size_t on_surface = 0;
    for (const Eigen::Vector3d& p_L : surface_.points_L) {
      const SurfaceSample at = reader_.At(T_BA * p_L);
      if (!at.is_observed) continue;
      ++observed;
      if (at.has_slope && double{std::abs(at.distance_m())} < kMargin_voxels * search_.voxel_m) {
        ++on_surface;
      }
    }
    return static_cast<double>(observed) >=
               kLeastObserved * static_cast<double>(surface_.points_L.size()) &&
           static_cast<double>(on_surface) >= kSameSurface * static_cast<double>(observed);
  }

  double TurnTo(const Pose& T_LC) const {
    const Eigen::Matrix3d R_WL = (search_.frame->T_WC * T_LC.inverse()).linear();
    return Eigen::AngleAxisd(search_.T_WL_last.linear().transpose() * R_WL).angle();
  }

  // `places` by score, the best first.
  FoundModel BestOf(const std::vector<Place>& places) const {
    FoundModel found;
    found.other_score = -kWrong;
    double best = -std::numeric_limits<double>::infinity();
    for (const Place& place : places) {
      const double score = -place.cost;
      if (&place != &places.front() && !LooksTheSame(places.front().T_LC, place.T_LC)) {
        found.other_score = std::max(found.other_score, score);
        continue;
      }
      const double with_turn = score - kPerTurn * TurnTo(place.T_LC);
      if (!(with_turn > best)) continue;
      best = with_turn;
      found.T_LC = place.T_LC;
      found.score = score;
    }
    return found;
  }

  const ModelSearch& search_;
  const SdfTrackConfig& config_;
  SurfaceReader reader_;
  VoxelReader voxels_;
  Surface surface_;
  Eigen::Vector3d centre_C_ = Eigen::Vector3d::Zero();
  double radius_m_ = 0;
  std::vector<SegmentPoint> rough_points_;
};

}  // namespace

std::optional<FoundModel> FindModel(const ModelSearch& search, const SdfTrackConfig& config) {
  if (search.points->size() < kLeastSearchedPoints) return std::nullopt;
  return Search(search, config).Find();
}

bool IsCertain(const FoundModel& found) {
  return found.score >= kLeastScore && found.score >= found.other_score + kLeastLead;
}

}  // namespace tsdfpp
