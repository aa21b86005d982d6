#include "mapper/track/view_terms.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "core/pixel_ray.h"
#include "core/robust_deviation.h"
#include "mapper/track/model_sight.h"

namespace tsdfpp {
namespace {

// Fewer say nothing.
constexpr std::size_t kLeastPoints = 20;
// Of grey values, a pixel: what changes less is known to no part of a pixel.
constexpr double kLeastContrast = 3;
// Where a smaller share of a segment's points has that, it is seams and shadows, which do not go
// along.
constexpr double kLeastContrastShare = 0.1;
// An outline of whole pixels is known no better than this, grey values no better than that.
constexpr double kLeastDeviation_px = 0.3;
constexpr double kLeastDeviation_grey = 1.5;
// Outlines further from a rim than this are not its.
constexpr double kFarthestRim_px = 12;
// A rim is seen from its own side where the sine of the way there is more than this.
constexpr double kFarthestAside = 0.005;
// Of the model's surface.
constexpr std::size_t kFreeSpacePoints = 500;
constexpr double kFreeSpaceMargin_voxels = 1;
// Gains of light that are taken for real.
constexpr double kLeastGain = 0.4;
constexpr double kMostGain = 2.5;
// What is further from a line than so many medians has no part in it.
constexpr double kNear_medians = 3;

// Of a slope over pixels, over the point.
Eigen::Vector3d SlopeOverPoint(const Intrinsics& camera, const Eigen::Vector3d& p_C,
                               const Eigen::Vector2d& slope) {
  const double per_z = 1 / p_C.z();
  const double x = slope.x() * camera.fx * per_z;
  const double y = slope.y() * camera.fy * per_z;
  return {x, y, -(x * p_C.x() + y * p_C.y()) * per_z};
}

std::vector<Eigen::Vector3d> Moved(const Pose& T, const std::vector<Eigen::Vector3d>& points) {
  std::vector<Eigen::Vector3d> moved;
  moved.reserve(points.size());
  for (const Eigen::Vector3d& p : points) moved.push_back(T * p);
  return moved;
}

// Points of the keyframe, and the segment as the frame shows it.
class KeyTerm : public PointTerm {
 public:
  KeyTerm(const ViewTermParts& parts, const std::vector<Eigen::Vector3d>& points_C, double weight)
      : PointTerm(Moved(parts.T_LC_key, points_C), weight),
        view_(parts.view),
        camera_(parts.frame->intrinsics) {}

 protected:
  const SegmentView& view() const { return *view_; }
  const Intrinsics& camera() const { return camera_; }

 private:
  const SegmentView* view_;
  Intrinsics camera_;
};

// Where a rim of the object is beside the outline of its segment, pixels.
class OutlineTerm : public KeyTerm {
 public:
  OutlineTerm(const ViewTermParts& parts, double weight)
      : KeyTerm(parts, parts.key->rim_C, weight), key_(parts.key), T_LC_key_(parts.T_LC_key) {}

 private:
  void Prepare(const Pose& T_LC) override {
    camera_key_ = T_LC_key_.inverse() * T_LC.translation();
  }
  bool IsFit(std::size_t point, const Eigen::Vector3d& p_C) const override {
    const Eigen::Vector3d to_camera = (camera_key_ - key_->rim_C[point]).normalized();
    return to_camera.dot(key_->rim_side_C[point]) <= kFarthestAside &&
           view().IsOutlineOf(PixelOf(camera(), p_C), p_C.z());
  }
  PointSight At(std::size_t /*point*/, const Eigen::Vector3d& p_C) const override {
    if (!(p_C.z() > 0)) return {};
    const ImageValue at = view().OutlineAt(PixelOf(camera(), p_C));
    if (!at.is_known || std::abs(at.value) > kFarthestRim_px) return {};
    return {true, at.value, SlopeOverPoint(camera(), p_C, at.slope)};
  }
  double LeastDeviation(double /*distance_m*/) const override { return kLeastDeviation_px; }

  const KeyView* key_;
  Pose T_LC_key_;
  Eigen::Vector3d camera_key_ = Eigen::Vector3d::Zero();  // now, in the keyframe's frame
};

// How grey a point of the object is beside what it was, but for one gain and offset of all.
class ColourTerm : public KeyTerm {
 public:
  ColourTerm(const ViewTermParts& parts, double weight)
      : KeyTerm(parts, parts.key->patch_C, weight), grey_(&parts.key->patch_grey) {}

 private:
  // The line through the pairs of grey values, twice, the second time by what is near it.
  void Prepare(const Pose& T_LC) override {
    gain_ = 1;
    offset_ = 0;
    std::vector<std::pair<double, double>> pairs;
    const Pose T_CL = T_LC.inverse();
    for (std::size_t i = 0; i < points_L().size(); ++i) {
      const Eigen::Vector3d p_C = T_CL * points_L()[i];
      const PointSight sight = At(i, p_C);
      if (!sight.is_seen || !IsFit(i, p_C)) continue;
      pairs.emplace_back(sight.r + (*grey_)[i], (*grey_)[i]);
    }
    FitLine(pairs, std::numeric_limits<double>::infinity());
    std::vector<double> sizes;
    sizes.reserve(pairs.size());
    for (const auto& [now, then] : pairs) sizes.push_back(std::abs(gain_ * now + offset_ - then));
    FitLine(pairs, kNear_medians * std::max(MiddleOne(std::move(sizes)), kLeastDeviation_grey));
  }
  void FitLine(const std::vector<std::pair<double, double>>& pairs, double most) {
    double count = 0;
    double now_sum = 0;
    double then_sum = 0;
    double squares = 0;
    double products = 0;
    for (const auto& [now, then] : pairs) {
      if (std::abs(gain_ * now + offset_ - then) > most) continue;
      ++count;
      now_sum += now;
      then_sum += then;
      squares += now * now;
      products += now * then;
    }
    if (count == 0) return;
    const double spread = squares - now_sum * now_sum / count;
    const double common = products - now_sum * then_sum / count;
    gain_ = spread > 0 ? std::clamp(common / spread, kLeastGain, kMostGain) : 1;
    offset_ = (then_sum - gain_ * now_sum) / count;
  }
  bool IsFit(std::size_t /*point*/, const Eigen::Vector3d& p_C) const override {
    return view().IsAtDepth(PixelOf(camera(), p_C), p_C.z());
  }
  PointSight At(std::size_t point, const Eigen::Vector3d& p_C) const override {
    if (!(p_C.z() > 0)) return {};
    const ImageValue at = view().GreyAt(PixelOf(camera(), p_C));
    if (!at.is_known) return {};
    return {true, gain_ * at.value + offset_ - (*grey_)[point],
            SlopeOverPoint(camera(), p_C, gain_ * at.slope)};
  }
  double LeastDeviation(double /*distance_m*/) const override { return kLeastDeviation_grey; }

  const std::vector<double>* grey_;
  double gain_ = 1;
  double offset_ = 0;
};

// How far a point of the model is before all depth around its pixel, metres, as a negative number.
class FreeSpaceTerm : public PointTerm {
 public:
  FreeSpaceTerm(const ViewTermParts& parts, std::vector<Eigen::Vector3d> points_L,
                const SdfTrackConfig& config)
      : PointTerm(std::move(points_L), config.free_space_weight),
        depth_(parts.frame->depth),
        camera_(parts.frame->intrinsics),
        config_(config),
        margin_m_(kFreeSpaceMargin_voxels * parts.voxel_m) {}

 private:
  PointSight At(std::size_t /*point*/, const Eigen::Vector3d& p_C) const override {
    if (!(p_C.z() > 0)) return {};
    const Eigen::Vector2d pixel = PixelOf(camera_, p_C);
    const double u = std::floor(pixel.x() + 0.5);
    const double v = std::floor(pixel.y() + 0.5);
    if (!(u >= 1 && v >= 1 && u < depth_.cols - 1 && v < depth_.rows - 1)) return {};
    float nearest_m = kMaxValidDepth_m;
    for (int b = static_cast<int>(v) - 1; b <= static_cast<int>(v) + 1; ++b) {
      for (int a = static_cast<int>(u) - 1; a <= static_cast<int>(u) + 1; ++a) {
        const float depth_m = depth_.at<float>(b, a);
        if (!IsValidDepth(depth_m)) return {};
        nearest_m = std::min(nearest_m, depth_m);
      }
    }
    const double margin_m = margin_m_ + kNoiseDeviations * config_.Axial_m(p_C.z());
    const double r = p_C.z() - double{nearest_m} + margin_m;
    if (r >= 0) return {true};
    return {true, r, Eigen::Vector3d::UnitZ()};
  }
  // An error of so many metres counts as one of a distance.
  double LeastDeviation(double distance_m) const override { return distance_m; }

  cv::Mat depth_;
  Intrinsics camera_;
  SdfTrackConfig config_;
  double margin_m_;
};

// On the model's surface, at even steps among its surface voxels.
std::vector<Eigen::Vector3d> SurfacePoints(const TsdfGrid& model, const SurfaceReader& reader,
                                           double voxel_m) {
  std::vector<Index3> voxels;
  for (const auto& entry : model.entries()) {
    ForEachSurfaceVoxel(entry, voxel_m, [&](std::size_t /*place*/, const Index3& voxel) {
      voxels.push_back(voxel);
    });
  }
  std::vector<Eigen::Vector3d> points_L;
  const std::size_t count = std::min(kFreeSpacePoints, voxels.size());
  for (std::size_t i = 0; i < count; ++i) {
    const Index3& voxel = voxels[i * voxels.size() / count];
    const Eigen::Vector3d p_L = voxel_m * Eigen::Vector3d(voxel.x, voxel.y, voxel.z);
    const SurfaceSample at = reader.At(p_L);
    if (!at.has_slope) continue;
    points_L.emplace_back(p_L - double{at.distance_m()} * at.normal_L().cast<double>());
  }
  return points_L;
}

}  // namespace

KeyView KeyViewOf(const SegmentView& view, const std::vector<SegmentPoint>& points,
                  const Intrinsics& camera, const SdfTrackConfig& config) {
  KeyView key;
  if (config.outline_weight > 0) {
    for (const RimPoint& point : view.Rim()) {
      const Eigen::Vector3d ray = PixelRay(camera, point.pixel.x(), point.pixel.y());
      const Eigen::Vector3d aside(point.outwards.x(), point.outwards.y(), 0);
      key.rim_C.emplace_back(point.depth_m * ray);
      key.rim_side_C.emplace_back((aside - aside.dot(ray) / ray.squaredNorm() * ray).normalized());
    }
  }
  if (config.colour_weight <= 0 || !view.HasGrey()) return key;
  struct Patch {
    Eigen::Vector3d p_C;
    double grey;
  };
  std::vector<Patch> patches;
  for (const SegmentPoint& point : points) {
    const ImageValue at = view.GreyAt({point.pixel.x, point.pixel.y});
    if (at.is_known && at.slope.norm() >= kLeastContrast) {
      patches.push_back({point.p_C.cast<double>(), at.value});
    }
  }
  if (static_cast<double>(patches.size()) <
      kLeastContrastShare * static_cast<double>(points.size())) {
    return key;
  }
  const std::size_t count =
      std::min(patches.size(), static_cast<std::size_t>(config.colour_points));
  for (std::size_t i = 0; i < count; ++i) {
    const Patch& patch = patches[i * patches.size() / count];
    key.patch_C.push_back(patch.p_C);
    key.patch_grey.push_back(patch.grey);
  }
  return key;
}

std::vector<std::unique_ptr<PointTerm>> ViewTermsOf(const ViewTermParts& parts,
                                                    const SdfTrackConfig& config) {
  std::vector<std::unique_ptr<PointTerm>> terms;
  if (config.free_space_weight > 0) {
    auto points_L = SurfacePoints(*parts.model, *parts.reader, parts.voxel_m);
    if (points_L.size() >= kLeastPoints) {
      terms.push_back(std::make_unique<FreeSpaceTerm>(parts, std::move(points_L), config));
    }
  }
  if (parts.key != nullptr && config.colour_weight > 0 && parts.view->HasGrey() &&
      parts.key->patch_C.size() >= kLeastPoints) {
    terms.push_back(std::make_unique<ColourTerm>(parts, config.colour_weight));
  }
  return terms;
}

std::unique_ptr<PointTerm> OutlineTermOf(const ViewTermParts& parts, const SdfTrackConfig& config) {
  if (config.outline_weight <= 0 || parts.key == nullptr ||
      parts.key->rim_C.size() < kLeastPoints) {
    return nullptr;
  }
  return std::make_unique<OutlineTerm>(parts, config.outline_weight);
}

}  // namespace tsdfpp
