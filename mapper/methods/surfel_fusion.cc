#include "mapper/methods/surfel_fusion.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "mapper/methods/surfel_pixels.h"
#include "mapper/methods/surfel_splats.h"

namespace tsdfpp {
namespace {

constexpr std::size_t kSurfelsPerTask = 1024;
constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();

struct Placed {
  SurfelObject* object = nullptr;
  InstanceId id = kNoInstance;
  std::size_t first = 0;  // of its surfels, in the order of all
  Pose T_CL = Pose::Identity();
};

template <typename Do>
void ForSurfels(std::size_t count, const Do& work) {
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, count, kSurfelsPerTask),
      [&](const tbb::blocked_range<std::size_t>& range) {
        for (std::size_t i = range.begin(); i != range.end(); ++i) work(i);
      },
      tbb::simple_partitioner());
}

class SurfelFusion {
 public:
  SurfelFusion(const Frame& frame, const cv::Mat& labels, const MapConfig& config,
               std::uint32_t now, SurfelObjects& objects)
      : pixels_(frame, labels, config.voxel_m),
        width_(static_cast<std::size_t>(frame.intrinsics.width)),
        height_(static_cast<std::size_t>(frame.intrinsics.height)),
        T_WC_(frame.T_WC),
        slack_m_(kSurfelSlack_voxels * config.voxel_m),
        weight_cap_(config.weight_cap),
        now_(now),
        objects_(&objects),
        nearest_(width_ * height_, kNone),
        is_taken_(width_ * height_, 0) {}

  void Run() {
    PlaceSurfels();
    FindNearest();
    ForSurfels(splats_.size(), [&](std::size_t i) { Update(i); });
    Clean();
    AddMissing();
  }

 private:
  std::size_t PixelAt(std::size_t u, std::size_t v) const { return v * width_ + u; }
  Surfel& SurfelAt(std::size_t i) {
    const Placed& of = placed_[owner_[i]];
    return of.object->surfels[i - of.first];
  }

  // All surfels as the camera sees them, object by object.
  void PlaceSurfels() {
    std::size_t count = 0;
    for (auto& [id, object] : *objects_) {
      Placed placed{&object, id, count, T_WC_.inverse()};
      if (!object.lattice_is_world) placed.T_CL = T_WC_.inverse() * object.T_WL;
      owner_.insert(owner_.end(), object.surfels.size(),
                    static_cast<std::uint32_t>(placed_.size()));
      placed_.push_back(placed);
      count += object.surfels.size();
    }
    splats_.resize(count);
    fate_.resize(count, Fate::kUnseen);
    ForSurfels(count, [&](std::size_t i) {
      const Pose& T_CL = placed_[owner_[i]].T_CL;
      const Surfel& surfel = SurfelAt(i);
      const Eigen::Vector3d centre_C = T_CL * surfel.centre.cast<double>();
      splats_[i] = SplatOf(centre_C, T_CL.linear() * surfel.normal.cast<double>(),
                           static_cast<double>(surfel.radius_m), pixels_.camera());
      if (centre_C.z() < kNearestSeen_m) splats_[i].u1 = splats_[i].u0;
    });
  }

  // Whether a pixel with a normal lies on the disc.
  bool IsOn(const Splat& splat, std::size_t u, std::size_t v, double* distance2) const {
    const Eigen::Vector3d ray = pixels_.rays().At(u, v);
    const double depth = splat.DepthAlong(ray, distance2);
    if (depth == 0) return false;
    const double apart_m = static_cast<double>(pixels_.depth(u, v)) - depth;
    return apart_m * apart_m * ray.squaredNorm() <= slack_m_ * slack_m_;
  }

  bool HasNormal(std::size_t u, std::size_t v) const {
    return pixels_.normal(u, v) != Eigen::Vector3f::Zero();
  }

  // The index map: of each pixel, which surfel of its object it is fused with.
  void FindNearest() {
    const SplatBands bands(splats_, pixels_.camera().height);
    const double least_cosine = std::cos(kMostSurfelTurn_deg * std::numbers::pi / 180);
    const auto find_in = [&](std::size_t band) {
      const std::size_t first_row = SplatBands::FirstRow(band);
      const std::size_t end_row = bands.EndRow(band);
      std::vector<double> least2((end_row - first_row) * width_,
                                 std::numeric_limits<double>::infinity());
      for (const std::uint32_t* i = bands.begin(band); i != bands.end(band); ++i) {
        const Splat& splat = splats_[*i];
        const InstanceId id = placed_[owner_[*i]].id;
        for (std::size_t v = std::max<std::size_t>(splat.v0, first_row);
             v < std::min<std::size_t>(splat.v1, end_row); ++v) {
          for (std::size_t u = splat.u0; u < splat.u1; ++u) {
            if (pixels_.label(u, v) != id || !HasNormal(u, v)) continue;
            double apart2 = 0;
            if (!IsOn(splat, u, v, &apart2)) continue;
            is_taken_[PixelAt(u, v)] = 1;
            if (pixels_.normal(u, v).cast<double>().dot(splat.normal_C) < least_cosine) continue;
            double& least = least2[PixelAt(u, v - first_row)];
            if (apart2 >= least) continue;
            least = apart2;
            nearest_[PixelAt(u, v)] = *i;
          }
        }
      }
    };
    tbb::parallel_for(
        tbb::blocked_range<std::size_t>(0, bands.size(), 1),
        [&](const tbb::blocked_range<std::size_t>& range) {
          for (std::size_t band = range.begin(); band != range.end(); ++band) find_in(band);
        },
        tbb::simple_partitioner());
  }

  // What a surfel's pixels in this frame say together.
  struct Sighting {
    int pixels = 0;
    double offset_m = 0;  // sums
    Eigen::Vector3d normal_C = Eigen::Vector3d::Zero();
    std::array<int, 3> colour{};
    double radius_m = std::numeric_limits<double>::infinity();  // the least
  };

  Sighting SightingOf(std::size_t i) const {
    Sighting seen;
    const Splat& splat = splats_[i];
    for (std::size_t v = splat.v0; v < splat.v1; ++v) {
      for (std::size_t u = splat.u0; u < splat.u1; ++u) {
        if (nearest_[PixelAt(u, v)] != i) continue;
        ++seen.pixels;
        seen.offset_m += (pixels_.PointAt(u, v) - splat.centre_C).dot(splat.normal_C);
        seen.normal_C += pixels_.normal(u, v).cast<double>();
        const cv::Vec3b colour = pixels_.colour(u, v);
        for (int c = 0; c < 3; ++c) seen.colour[static_cast<std::size_t>(c)] += colour[c];
        seen.radius_m = std::min(seen.radius_m, pixels_.RadiusAt(u, v));
      }
    }
    return seen;
  }

  // Confidence-weighted averages of a surfel and what this frame says of it.
  void Update(std::size_t i) {
    if (splats_[i].u0 == splats_[i].u1) return;
    const Sighting seen = SightingOf(i);
    if (seen.pixels == 0) return;
    fate_[i] = Fate::kSeen;
    Surfel& surfel = SurfelAt(i);
    const double share = 1.0 / (std::min<int>(surfel.confidence, weight_cap_) + 1);
    const Eigen::Vector3d normal = surfel.normal.cast<double>();
    const double step_m = seen.offset_m / seen.pixels * share;
    surfel.centre = (surfel.centre.cast<double>() + step_m * normal).cast<float>();
    const Eigen::Vector3d seen_L =
        placed_[owner_[i]].T_CL.linear().transpose() * seen.normal_C.normalized();
    surfel.normal = (normal + share * (seen_L - normal)).normalized().cast<float>();
    for (std::size_t c = 0; c < 3; ++c) {
      const double old = surfel.colour[c];
      const double mean = 256.0 * seen.colour[c] / seen.pixels;
      surfel.colour[c] = static_cast<std::uint16_t>(old + (mean - old) * share + 0.5);
    }
    surfel.radius_m = std::min(surfel.radius_m, static_cast<float>(seen.radius_m));
    if (surfel.confidence < std::numeric_limits<std::uint16_t>::max()) ++surfel.confidence;
  }

  // Whether the frame sees past the place of a surfel that no pixel confirmed: the pixel there and
  // those around it show something more than the slack behind it (Keller et al. 2013, section 4.3).
  bool IsSeenThrough(const Splat& splat) const {
    const Eigen::Vector3d& q = splat.centre_C;
    if (q.z() < kNearestSeen_m) return false;
    const Intrinsics& k = pixels_.camera();
    const double u = std::floor(k.fx * q.x() / q.z() + k.cx + 0.5);
    const double v = std::floor(k.fy * q.y() / q.z() + k.cy + 0.5);
    if (!(u >= 0 && u < k.width && v >= 0 && v < k.height)) return false;
    const auto is_past = [&](std::size_t at_u, std::size_t at_v) {
      return (static_cast<double>(pixels_.depth(at_u, at_v)) - q.z()) *
                 pixels_.rays().At(at_u, at_v).norm() >
             slack_m_;
    };
    const auto at_u = static_cast<std::size_t>(u);
    const auto at_v = static_cast<std::size_t>(v);
    if (!pixels_.IsUsable(at_u, at_v) || !is_past(at_u, at_v)) return false;
    for (std::size_t y = at_v - std::min<std::size_t>(at_v, 1); y < std::min(at_v + 2, height_);
         ++y) {
      for (std::size_t x = at_u - std::min<std::size_t>(at_u, 1); x < std::min(at_u + 2, width_);
           ++x) {
        if (pixels_.IsUsable(x, y) && !is_past(x, y)) return false;
      }
    }
    return true;
  }

  void Clean() {
    ForSurfels(splats_.size(), [&](std::size_t i) {
      const Surfel& surfel = SurfelAt(i);
      const bool is_late = !surfel.is_stable() && now_ - surfel.born >= kFramesToBeStable;
      if (is_late || (fate_[i] == Fate::kUnseen && IsSeenThrough(splats_[i]))) {
        fate_[i] = Fate::kGone;
      }
    });
    for (const Placed& placed : placed_) {
      std::vector<Surfel>& surfels = placed.object->surfels;
      std::size_t kept = 0;
      for (std::size_t k = 0; k < surfels.size(); ++k) {
        if (fate_[placed.first + k] != Fate::kGone) surfels[kept++] = surfels[k];
      }
      surfels.resize(kept);
      if (surfels.capacity() - kept > kept / 2 + kRoom) surfels.shrink_to_fit();
    }
  }

  // A surfel for each pixel that lies on none of its object, by rows: one that was added just
  // before counts.
  void AddMissing() {
    for (std::size_t v = 0; v < height_; ++v) {
      for (std::size_t u = 0; u < width_; ++u) {
        if (is_taken_[PixelAt(u, v)] == 0 && HasNormal(u, v)) Add(u, v);
      }
    }
  }

  void Add(std::size_t u, std::size_t v) {
    const InstanceId id = pixels_.label(u, v);
    SurfelObject& object = (*objects_)[id];
    const Pose T_LC = object.lattice_is_world ? T_WC_ : Pose(object.T_WL.inverse() * T_WC_);
    const Eigen::Vector3d centre_C = pixels_.PointAt(u, v);
    const Eigen::Vector3d normal_C = pixels_.normal(u, v).cast<double>();
    const cv::Vec3b colour = pixels_.colour(u, v);
    Surfel surfel;
    surfel.centre = (T_LC * centre_C).cast<float>();
    surfel.normal = (T_LC.linear() * normal_C).cast<float>();
    surfel.radius_m = static_cast<float>(pixels_.RadiusAt(u, v));
    for (int c = 0; c < 3; ++c) {
      surfel.colour[static_cast<std::size_t>(c)] = static_cast<std::uint16_t>(256 * colour[c]);
    }
    surfel.confidence = 1;
    surfel.born = now_;
    // Memory is counted, so lists do not double.
    std::vector<Surfel>& surfels = object.surfels;
    if (surfels.size() == surfels.capacity())
      surfels.reserve(surfels.size() + surfels.size() / 8 + kRoom);
    surfels.push_back(surfel);

    const Splat splat = SplatOf(centre_C, normal_C, pixels_.Reach(centre_C.z()), pixels_.camera());
    for (std::size_t y = splat.v0; y < splat.v1; ++y) {
      for (std::size_t x = splat.u0; x < splat.u1; ++x) {
        std::uint8_t& is_taken = is_taken_[PixelAt(x, y)];
        if (is_taken == 0 && pixels_.label(x, y) == id && HasNormal(x, y) &&
            IsOn(splat, x, y, nullptr)) {
          is_taken = 1;
        }
      }
    }
    is_taken_[PixelAt(u, v)] = 1;
  }

  static constexpr std::size_t kRoom = 256;  // surfels that a list has room for besides
  enum class Fate : std::uint8_t { kUnseen, kSeen, kGone };

  SurfelPixels pixels_;
  std::size_t width_;
  std::size_t height_;
  Pose T_WC_;
  double slack_m_;
  int weight_cap_;
  std::uint32_t now_;
  SurfelObjects* objects_;
  std::vector<Placed> placed_;
  std::vector<std::uint32_t> owner_;    // of each surfel, a place in placed_
  std::vector<Splat> splats_;           // of each surfel
  std::vector<Fate> fate_;              // of each surfel
  std::vector<std::uint32_t> nearest_;  // of each pixel, a surfel or kNone
  std::vector<std::uint8_t> is_taken_;  // of each pixel, whether it lies on a surfel
};

}  // namespace

void FuseIntoSurfels(const Frame& frame, const cv::Mat& labels, const MapConfig& config,
                     std::uint32_t now, SurfelObjects& objects) {
  SurfelFusion(frame, labels, config, now, objects).Run();
}

}  // namespace tsdfpp
