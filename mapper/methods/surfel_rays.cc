#include "mapper/methods/surfel_rays.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <limits>

#include "mapper/methods/surfel_splats.h"

namespace tsdfpp {
namespace {

constexpr std::size_t kSurfelsPerTask = 1024;

// A disc, and what an image shows of it.
struct Disc {
  const Surfel* surfel = nullptr;
  InstanceId id = kNoInstance;
  const Pose* T_WL = nullptr;
};

// Where a ray meets an object first.
struct Hit {
  double depth = std::numeric_limits<double>::infinity();
  std::uint32_t disc = 0;
  InstanceId id = kNoInstance;
};

// Keeps the nearest hit of each object, as many as there is room for, nearest first. Discs come by
// id and place, so that of equal depths the first one stays. An object that was pushed out by
// others comes back with a nearer hit, so the order in which discs come does not matter.
void Insert(const Hit& hit, Hit* first, Hit* end) {
  Hit* place = first;
  while (place != end && !(hit.depth < place->depth)) {
    if (place->id == hit.id) return;
    ++place;
  }
  if (place == end) return;
  Hit* gone = std::find_if(place, end - 1, [&](const Hit& other) { return other.id == hit.id; });
  std::move_backward(place, gone, gone + 1);
  *place = hit;
}

class SurfelCast {
 public:
  SurfelCast(const SurfelObjects& objects, const Intrinsics& camera, const Pose& T_WC,
             const RayCastOptions& options)
      : camera_(camera), T_WC_(T_WC), options_(options), rays_(camera) {
    for (const auto& [id, object] : objects) {
      for (const Surfel& surfel : object.surfels) {
        if (surfel.is_stable()) discs_.push_back({&surfel, id, &object.T_WL});
      }
    }
    PlaceDiscs();
  }

  std::vector<RaySurface> Run() {
    for (int i = 0; i < options_.surfaces; ++i) {
      RaySurface surface;
      surface.depth = cv::Mat::zeros(camera_.height, camera_.width, CV_32FC1);
      surface.normal = cv::Mat::zeros(camera_.height, camera_.width, CV_32FC3);
      surface.id = cv::Mat(camera_.height, camera_.width, CV_16UC1, cv::Scalar(kNoInstance));
      if (options_.colour) {
        surface.colour = cv::Mat::zeros(camera_.height, camera_.width, CV_8UC3);
      }
      surfaces_.push_back(surface);
    }
    const SplatBands bands(splats_, camera_.height);
    tbb::parallel_for(
        tbb::blocked_range<std::size_t>(0, bands.size(), 1),
        [&](const tbb::blocked_range<std::size_t>& range) {
          for (std::size_t band = range.begin(); band != range.end(); ++band) CastIn(bands, band);
        },
        tbb::simple_partitioner());
    return std::move(surfaces_);
  }

 private:
  void PlaceDiscs() {
    splats_.resize(discs_.size());
    const Pose T_CW = T_WC_.inverse();
    tbb::parallel_for(
        tbb::blocked_range<std::size_t>(0, discs_.size(), kSurfelsPerTask),
        [&](const tbb::blocked_range<std::size_t>& range) {
          for (std::size_t i = range.begin(); i != range.end(); ++i) {
            const Surfel& surfel = *discs_[i].surfel;
            const Pose& T_WL = *discs_[i].T_WL;
            const Eigen::Vector3d centre_W = T_WL * surfel.centre.cast<double>();
            const Eigen::Vector3d normal_W = T_WL.linear() * surfel.normal.cast<double>();
            splats_[i] = SplatOf(T_CW * centre_W, T_CW.linear() * normal_W,
                                 static_cast<double>(surfel.radius_m), camera_);
          }
        },
        tbb::simple_partitioner());
  }

  void CastIn(const SplatBands& bands, std::size_t band) {
    const auto width = static_cast<std::size_t>(camera_.width);
    const auto count = static_cast<std::size_t>(options_.surfaces);
    const double nearest_m = options_.NearestDepth_m();
    const std::size_t first_row = SplatBands::FirstRow(band);
    const std::size_t end_row = bands.EndRow(band);
    std::vector<Hit> hits((end_row - first_row) * width * count);
    for (const std::uint32_t* i = bands.begin(band); i != bands.end(band); ++i) {
      const Splat& splat = splats_[*i];
      for (std::size_t v = std::max<std::size_t>(splat.v0, first_row);
           v < std::min<std::size_t>(splat.v1, end_row); ++v) {
        Hit* place = hits.data() + ((v - first_row) * width + splat.u0) * count;
        for (std::size_t u = splat.u0; u < splat.u1; ++u, place += count) {
          const double depth = splat.DepthAlong(rays_.At(u, v));
          if (depth == 0 || depth < nearest_m) continue;
          Insert({depth, *i, discs_[*i].id}, place, place + count);
        }
      }
    }
    const Hit* hit = hits.data();
    for (std::size_t v = first_row; v < end_row; ++v) {
      for (std::size_t u = 0; u < width; ++u) {
        for (std::size_t n = 0; n < count; ++n, ++hit) {
          if (hit->id != kNoInstance) Show(*hit, static_cast<int>(u), static_cast<int>(v), n);
        }
      }
    }
  }

  void Show(const Hit& hit, int u, int v, std::size_t n) {
    const Disc& disc = discs_[hit.disc];
    RaySurface& surface = surfaces_[n];
    surface.depth.at<float>(v, u) = static_cast<float>(hit.depth);
    surface.id.at<InstanceId>(v, u) = hit.id;
    const Eigen::Vector3f normal_W =
        (disc.T_WL->linear() * disc.surfel->normal.cast<double>()).cast<float>();
    surface.normal.at<cv::Vec3f>(v, u) = {normal_W.x(), normal_W.y(), normal_W.z()};
    if (!options_.colour) return;
    const Colour colour = disc.surfel->Rounded();
    surface.colour.at<cv::Vec3b>(v, u) = {colour[0], colour[1], colour[2]};
  }

  Intrinsics camera_;
  Pose T_WC_;
  RayCastOptions options_;
  PixelRays rays_;
  std::vector<Disc> discs_;
  std::vector<Splat> splats_;  // of each disc
  std::vector<RaySurface> surfaces_;
};

}  // namespace

std::vector<RaySurface> CastSurfels(const SurfelObjects& objects, const Intrinsics& camera,
                                    const Pose& T_WC, const RayCastOptions& options) {
  return SurfelCast(objects, camera, T_WC, options).Run();
}

}  // namespace tsdfpp
