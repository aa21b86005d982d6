#include "eval/make/frame_check.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "eval/tools/rasteriser.h"
#include "metrics/mesh_tools.h"
#include "sequence/cofusion_layout.h"

namespace tsdfpp {
namespace {

using Surfaces = std::map<InstanceId, std::unique_ptr<TruthSurface>>;

// Depth that is this factor off throughout is in another unit (or scaled).
constexpr double kUnitTolerance = 0.01;

// Where an edge runs through a pixel, the renderer's grid for vertices (1/256 pixel) may show a
// surface just beyond its end: a point off its model by that shift, stretched by the incidence. A
// tenth of a pixel is that shift at an incidence of 88 degrees; a pixel's width is z / f.
constexpr double kEdgeReach_m = 1e-3;
constexpr double kEdgeReach_px = 0.1;
// It is rare (four pixels of 480 frames of the room), so many at once are a fault.
constexpr double kEdgeShare = 1e-5;
constexpr float kStep_m = 5e-3F;
// A pose that is off shows in more pixels.
constexpr std::int64_t kFewPixels = 3;
constexpr double kMaxIncidence_deg = 80;

// Does one of the eight neighbours show another object?
bool IsBesideAnother(const cv::Mat& mask, const cv::Point& at) {
  const InstanceId id = mask.at<InstanceId>(at);
  for (int v = std::max(0, at.y - 1); v <= std::min(mask.rows - 1, at.y + 1); ++v) {
    for (int u = std::max(0, at.x - 1); u <= std::min(mask.cols - 1, at.x + 1); ++u) {
      if (mask.at<InstanceId>(v, u) != id) return true;
    }
  }
  return false;
}

// Does the depth of one of the eight neighbours leave the pixel's by a step: an edge of one object
// before another part of it?
bool IsBesideStep(const cv::Mat& depth, const cv::Point& at) {
  const float z = depth.at<float>(at);
  for (int v = std::max(0, at.y - 1); v <= std::min(depth.rows - 1, at.y + 1); ++v) {
    for (int u = std::max(0, at.x - 1); u <= std::min(depth.cols - 1, at.x + 1); ++u) {
      if (std::abs(depth.at<float>(v, u) - z) > kStep_m) return true;
    }
  }
  return false;
}

// All objects that have a pose, in the camera's frame.
TriangleMesh PlaceAll(const Surfaces& surfaces, const Frame& frame) {
  TriangleMesh all;
  const Pose T_CW = frame.T_WC.inverse();
  for (const auto& [id, surface] : surfaces) {
    Pose T_CO = T_CW;
    if (id != kBackground) {
      const auto pose = frame.T_WO.find(id);
      if (pose == frame.T_WO.end()) continue;
      T_CO = T_CW * pose->second;
    }
    const TriangleMesh& mesh = surface->model().mesh_O;
    const auto first = static_cast<std::uint32_t>(all.vertices.size());
    for (const Eigen::Vector3f& vertex : mesh.vertices) {
      all.vertices.emplace_back((T_CO * vertex.cast<double>()).cast<float>());
    }
    for (const auto& [a, b, c] : mesh.triangles) {
      all.triangles.push_back({first + a, first + b, first + c});
      all.face_ids.push_back(id);
    }
  }
  return all;
}

double Median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

Finding About(const Frame& frame, const char* check, std::string subject, std::string sentence) {
  return {check, std::move(subject), frame.index, std::move(sentence)};
}

// Pixels of one id whose points do not lie on its model where their rays meet it.
struct Doubtful {
  std::vector<Eigen::Vector3f> points_C;
  std::vector<cv::Point> pixels;
  std::vector<InstanceId> lies_on;  // what the ray hits first, if the point lies there
};

// What the models along the pixels' rays say.
struct RayCheck {
  std::map<InstanceId, Doubtful> doubtful;
  std::vector<double> ratios;  // of depths to the model's, where they disagree
  std::int64_t holes = 0;      // no depth though a model is there
  std::int64_t pixels = 0;     // with depth
};

// Measures each pixel's point against the triangle that its ray hits first, and leaves as doubtful
// what does not lie on its own object there.
RayCheck FollowRays(const Surfaces& surfaces, const Frame& frame, ResidualMeter& model) {
  const Intrinsics& k = frame.intrinsics;
  const TriangleMesh all_C = PlaceAll(surfaces, frame);
  const Raster raster = Rasterise(all_C, k, Pose::Identity());
  RayCheck rays;
  for (int v = 0; v < k.height; ++v) {
    const auto* depth = frame.depth.ptr<float>(v);
    const auto* ids = frame.mask.ptr<InstanceId>(v);
    const auto* face = raster.face.ptr<int>(v);
    for (int u = 0; u < k.width; ++u) {
      const float z = depth[u];
      if (!IsValidDepth(z)) {
        rays.holes += face[u] >= 0 ? 1 : 0;
        continue;
      }
      ++rays.pixels;
      const Eigen::Vector3f p_C(static_cast<float>(z * (u - k.cx) / k.fx),
                                static_cast<float>(z * (v - k.cy) / k.fy), z);
      InstanceId lies_on = kNoInstance;
      if (face[u] >= 0) {
        const auto t = static_cast<std::size_t>(face[u]);
        const double distance = PointTriangleDistance(p_C, Corner(all_C, t, 0), Corner(all_C, t, 1),
                                                      Corner(all_C, t, 2));
        if (distance <= kModelLimit_m) {
          lies_on = all_C.face_ids[t];
          if (lies_on == ids[u]) {
            model.Add(distance);
            continue;
          }
        }
        rays.ratios.push_back(static_cast<double>(z) / raster.depth.at<float>(v, u));
      }
      Doubtful& entry = rays.doubtful[ids[u]];
      entry.points_C.push_back(p_C);
      entry.pixels.emplace_back(u, v);
      entry.lies_on.push_back(lies_on);
    }
  }
  return rays;
}

// A pixel whose point is off the model of its mask's object.
struct OffPixel {
  InstanceId id = kNoInstance;
  double distance_m = 0;
  InstanceId lies_on = kNoInstance;  // another object's model
};

struct OffPixels {
  std::vector<OffPixel> plain;
  std::vector<OffPixel> by_edges;  // which may be the renderer's grid
};

// May the renderer's grid have put this point off its model: a little, and where an edge runs
// through its pixel or its ray grazes the surface?
bool IsByEdge(const Frame& frame, const cv::Point& pixel, float z, double distance_m,
              float incidence_cosine) {
  static const auto kLeastCosine =
      static_cast<float>(std::cos(kMaxIncidence_deg * std::numbers::pi / 180));
  const double pixel_m = z / frame.intrinsics.fx;
  return distance_m <= std::max(kEdgeReach_m, kEdgeReach_px * pixel_m) &&
         (incidence_cosine < kLeastCosine || IsBesideAnother(frame.mask, pixel) ||
          IsBesideStep(frame.depth, pixel));
}

// Measures the doubtful points against the nearest triangle of their mask's own object, which
// decides. An id without model or pose is a finding.
OffPixels MeasureDoubtful(const Surfaces& surfaces, const Frame& frame, const RayCheck& rays,
                          FrameReport& report) {
  OffPixels off;
  for (const auto& [id, entry] : rays.doubtful) {
    const auto surface = surfaces.find(id);
    const auto pose = frame.T_WO.find(id);
    if (surface == surfaces.end() || (id != kBackground && pose == frame.T_WO.end())) {
      report.findings.push_back(
          About(frame, "mask", cofusion::MaskFile(frame.index),
                fmt::format("{} pixels show id {}, which has no {}", entry.points_C.size(), id,
                            surface == surfaces.end() ? "model" : "pose in this frame")));
      continue;
    }
    const Pose T_OC = id == kBackground ? frame.T_WC : Pose(pose->second.inverse() * frame.T_WC);
    std::vector<Eigen::Vector3f> points_O;
    points_O.reserve(entry.points_C.size());
    for (const Eigen::Vector3f& p : entry.points_C) {
      points_O.emplace_back((T_OC * p.cast<double>()).cast<float>());
    }
    const NearestSurface nearest = surface->second->index_O().Nearest(points_O);
    for (std::size_t i = 0; i < points_O.size(); ++i) {
      const double distance = nearest.distance_m[i];
      if (distance <= kModelLimit_m) {
        report.model.Add(distance);
        continue;
      }
      const Eigen::Vector3f ray_O =
          (T_OC.linear() * entry.points_C[i].cast<double>().normalized()).cast<float>();
      const bool by_edge = IsByEdge(frame, entry.pixels[i], entry.points_C[i].z(), distance,
                                    std::abs(nearest.normal[i].dot(ray_O)));
      (by_edge ? off.by_edges : off.plain).push_back({id, distance, entry.lies_on[i]});
    }
  }
  return off;
}

// Leaves out the pixels beside edges, and counts them; where they are too many for the renderer's
// grid they are plainly off.
void ExcuseEdges(OffPixels& off, std::int64_t pixels, ResidualMeter& model) {
  if (static_cast<double>(off.by_edges.size()) <=
      static_cast<double>(kFewPixels) + kEdgeShare * static_cast<double>(pixels)) {
    model.Exclude(static_cast<std::int64_t>(off.by_edges.size()));
  } else {
    off.plain.insert(off.plain.end(), off.by_edges.begin(), off.by_edges.end());
  }
}

// What is wrong with the pixels of some objects.
struct OffTotal {
  std::int64_t count = 0;
  double worst_m = 0;
  std::map<InstanceId, std::int64_t> lies_on;  // another object's model
  std::int64_t on_another = 0;                 // their sum

  void Add(const OffPixel& pixel) {
    ++count;
    worst_m = std::max(worst_m, pixel.distance_m);
    if (pixel.lies_on == kNoInstance) return;
    ++lies_on[pixel.lies_on];
    ++on_another;
  }
};

std::string Millimetres(double m) { return fmt::format("{:.3g} mm", 1e3 * m); }

// All points of one object and no others are off.
Finding OneObjectIsOff(const Frame& frame, const ObjectInfo& object, const OffTotal& off) {
  return About(
      frame, "pose", cofusion::TrajectoryFile(object),
      fmt::format(
          "{} pixels of '{}' lie up to {} off its model (limit {}) and no others: {}", off.count,
          object.name, Millimetres(off.worst_m), Millimetres(kModelLimit_m),
          off.count <= kFewPixels ? "the depth there is wrong" : "its pose is not this frame's"));
}

// Puts what is off down to the masks, the depth's unit, one object's pose, or else the camera's.
void Explain(const std::vector<OffPixel>& off_pixels, const RayCheck& rays,
             const Surfaces& surfaces, const Frame& frame, std::vector<Finding>& findings) {
  std::map<InstanceId, OffTotal> off;
  OffTotal all;
  for (const OffPixel& pixel : off_pixels) {
    off[pixel.id].Add(pixel);
    all.Add(pixel);
  }
  if (2 * all.on_another > all.count) {
    for (const auto& [id, of_id] : off) {
      for (const auto& [other, count] : of_id.lies_on) {
        findings.push_back(
            About(frame, "mask", cofusion::MaskFile(frame.index),
                  fmt::format("{} pixels show id {} but their points lie on the model of {}", count,
                              id, other)));
      }
    }
    return;
  }
  const bool most_are_off = 2 * all.count > rays.pixels && !rays.ratios.empty();
  const double ratio = most_are_off ? Median(rays.ratios) : 1.0;
  if (std::abs(ratio - 1) > kUnitTolerance) {
    findings.push_back(
        About(frame, "depth", cofusion::DepthFile(frame.index),
              fmt::format(
                  "the depths are {:.4g} times those of the models: another unit, expected metres",
                  ratio)));
    return;
  }
  if (off.size() == 1 && !off.contains(kBackground)) {
    const auto& [id, of_id] = *off.begin();
    findings.push_back(OneObjectIsOff(frame, surfaces.at(id)->model().info, of_id));
    return;
  }
  findings.push_back(
      About(frame, "pose", cofusion::kCameraTrajectory,
            fmt::format(
                "{} pixels of {} objects lie up to {} off their models (limit {}): this pose or {} "
                "is not this frame's",
                all.count, off.size(), Millimetres(all.worst_m), Millimetres(kModelLimit_m),
                cofusion::DepthFile(frame.index))));
}

}  // namespace

void ResidualMeter::Add(double error_m) {
  ++residual_.checked;
  sum_m_ += error_m;
  residual_.max_m = std::max(residual_.max_m, error_m);
  const bool within = error_m <= residual_.limit_m;
  residual_.violations += within ? 0 : 1;
  const int bin =
      within ? std::min(kBins - 1, static_cast<int>(error_m / residual_.limit_m * kBins)) : kBins;
  ++bins_[static_cast<std::size_t>(bin)];
}

void ResidualMeter::Merge(const ResidualMeter& other) {
  residual_.checked += other.residual_.checked;
  residual_.excluded += other.residual_.excluded;
  residual_.violations += other.residual_.violations;
  residual_.max_m = std::max(residual_.max_m, other.residual_.max_m);
  sum_m_ += other.sum_m_;
  for (std::size_t i = 0; i < bins_.size(); ++i) bins_[i] += other.bins_[i];
}

Residual ResidualMeter::Result() const {
  Residual result = residual_;
  if (result.checked == 0) return result;
  result.mean_m = sum_m_ / static_cast<double>(result.checked);
  const std::int64_t wanted = result.checked - result.checked / 100;
  std::int64_t below = 0;
  for (int bin = 0; bin <= kBins; ++bin) {
    below += bins_[static_cast<std::size_t>(bin)];
    if (below < wanted) continue;
    result.p99_m =
        bin == kBins ? result.max_m : std::min(result.max_m, result.limit_m * (bin + 1) / kBins);
    break;
  }
  return result;
}

FrameCheck::FrameCheck(std::vector<TrueModel> models) {
  for (TrueModel& model : models) {
    const InstanceId id = model.info.id;
    surfaces_[id] = std::make_unique<TruthSurface>(std::move(model));
  }
}

FrameReport FrameCheck::Check(const Frame& frame) const {
  FrameReport report;
  const RayCheck rays = FollowRays(surfaces_, frame, report.model);
  if (rays.holes > 0) {
    report.findings.push_back(
        About(frame, "depth", cofusion::DepthFile(frame.index),
              fmt::format("{} pixels have no depth though a model is there", rays.holes)));
  }
  OffPixels off = MeasureDoubtful(surfaces_, frame, rays, report);
  ExcuseEdges(off, rays.pixels, report.model);
  for (const OffPixel& pixel : off.plain) report.model.Add(pixel.distance_m);
  if (!off.plain.empty()) Explain(off.plain, rays, surfaces_, frame, report.findings);
  return report;
}

}  // namespace tsdfpp
