#include "eval/make/frame_check.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "eval/tools/rasteriser.h"
#include "metrics/mesh_tools.h"
#include "sequence/cofusion_layout.h"

namespace tsdfpp {
namespace {

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
TriangleMesh PlaceAll(const std::map<InstanceId, std::unique_ptr<TruthSurface>>& surfaces,
                      const Frame& frame) {
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

// What is wrong with the pixels of one object.
struct FrameCheck::OffPixels {
  std::int64_t count = 0;
  double worst_m = 0;
  std::map<InstanceId, std::int64_t> lies_on;  // another object's model
};

FrameCheck::FrameCheck(std::vector<TrueModel> models) {
  for (TrueModel& model : models) {
    const InstanceId id = model.info.id;
    surfaces_[id] = std::make_unique<TruthSurface>(std::move(model));
  }
}

FrameReport FrameCheck::Check(const Frame& frame) const {
  const Intrinsics& k = frame.intrinsics;
  const TriangleMesh all_C = PlaceAll(surfaces_, frame);
  const Raster raster = Rasterise(all_C, k, Pose::Identity());

  FrameReport report;
  struct Doubtful {
    std::vector<Eigen::Vector3f> points_C;
    std::vector<cv::Point> pixels;
    std::vector<InstanceId> lies_on;  // what the ray hits first, if the point lies there
  };
  std::map<InstanceId, Doubtful> doubtful;
  struct OffPixel {
    InstanceId id = kNoInstance;
    double distance_m = 0;
    InstanceId lies_on = kNoInstance;
  };
  std::vector<OffPixel> off_pixels;
  std::vector<OffPixel> by_edges;
  std::vector<double> ratios;  // of depths to the model's, where they disagree
  std::int64_t holes = 0;
  std::int64_t pixels = 0;
  for (int v = 0; v < k.height; ++v) {
    const auto* depth = frame.depth.ptr<float>(v);
    const auto* ids = frame.mask.ptr<InstanceId>(v);
    const auto* face = raster.face.ptr<int>(v);
    for (int u = 0; u < k.width; ++u) {
      const float z = depth[u];
      if (!IsValidDepth(z)) {
        holes += face[u] >= 0 ? 1 : 0;
        continue;
      }
      ++pixels;
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
            report.model.Add(distance);
            continue;
          }
        }
        ratios.push_back(static_cast<double>(z) / raster.depth.at<float>(v, u));
      }
      Doubtful& entry = doubtful[ids[u]];
      entry.points_C.push_back(p_C);
      entry.pixels.emplace_back(u, v);
      entry.lies_on.push_back(lies_on);
    }
  }
  const auto add = [&](const char* check, std::string subject, std::string sentence) {
    report.findings.push_back({check, std::move(subject), frame.index, std::move(sentence)});
  };
  if (holes > 0) {
    add("depth", cofusion::DepthFile(frame.index),
        fmt::format("{} pixels have no depth though a model is there", holes));
  }
  // The nearest triangle of the mask's own object decides.
  const auto least_cosine =
      static_cast<float>(std::cos(kMaxIncidence_deg * std::numbers::pi / 180));
  for (const auto& [id, entry] : doubtful) {
    const auto surface = surfaces_.find(id);
    const auto pose = frame.T_WO.find(id);
    const auto count = static_cast<std::int64_t>(entry.points_C.size());
    if (surface == surfaces_.end() || (id != kBackground && pose == frame.T_WO.end())) {
      add("mask", cofusion::MaskFile(frame.index),
          fmt::format("{} pixels show id {}, which has no {}", count, id,
                      surface == surfaces_.end() ? "model" : "pose in this frame"));
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
      const OffPixel pixel{id, distance, entry.lies_on[i]};
      if (distance <= kModelLimit_m) {
        report.model.Add(distance);
        continue;
      }
      const Eigen::Vector3f ray_O =
          (T_OC.linear() * entry.points_C[i].cast<double>().normalized()).cast<float>();
      const bool grazing = std::abs(nearest.normal[i].dot(ray_O)) < least_cosine;
      const double pixel_m = entry.points_C[i].z() / k.fx;
      const bool by_edge = distance <= std::max(kEdgeReach_m, kEdgeReach_px * pixel_m) &&
                           (grazing || IsBesideAnother(frame.mask, entry.pixels[i]) ||
                            IsBesideStep(frame.depth, entry.pixels[i]));
      (by_edge ? by_edges : off_pixels).push_back(pixel);
    }
  }
  if (static_cast<double>(by_edges.size()) <=
      static_cast<double>(kFewPixels) + kEdgeShare * static_cast<double>(pixels)) {
    report.model.Exclude(static_cast<std::int64_t>(by_edges.size()));
  } else {
    off_pixels.insert(off_pixels.end(), by_edges.begin(), by_edges.end());
  }
  std::map<InstanceId, OffPixels> off;
  for (const OffPixel& pixel : off_pixels) {
    report.model.Add(pixel.distance_m);
    OffPixels& o = off[pixel.id];
    ++o.count;
    o.worst_m = std::max(o.worst_m, pixel.distance_m);
    if (pixel.lies_on != kNoInstance) ++o.lies_on[pixel.lies_on];
  }
  if (off.empty()) return report;

  std::int64_t all_off = 0;
  std::int64_t on_another = 0;
  double worst = 0;
  for (const auto& [id, o] : off) {
    all_off += o.count;
    worst = std::max(worst, o.worst_m);
    for (const auto& [other, count] : o.lies_on) on_another += count;
  }
  const auto millimetres = [](double m) { return fmt::format("{:.3g} mm", 1e3 * m); };
  if (2 * on_another > all_off) {
    for (const auto& [id, o] : off) {
      for (const auto& [other, count] : o.lies_on) {
        add("mask", cofusion::MaskFile(frame.index),
            fmt::format("{} pixels show id {} but their points lie on the model of {}", count, id,
                        other));
      }
    }
    return report;
  }
  if (const double ratio = 2 * all_off > pixels && !ratios.empty() ? Median(ratios) : 1.0;
      std::abs(ratio - 1) > kUnitTolerance) {
    add("depth", cofusion::DepthFile(frame.index),
        fmt::format("the depths are {:.4g} times those of the models: another unit, expected "
                    "metres",
                    ratio));
    return report;
  }
  if (off.size() == 1 && !off.contains(kBackground)) {
    const auto& [id, o] = *off.begin();
    const ObjectInfo& object = surfaces_.at(id)->model().info;
    add("pose", cofusion::TrajectoryFile(object),
        fmt::format(
            "{} pixels of '{}' lie up to {} off its model (limit {}) and no others: {}", o.count,
            object.name, millimetres(o.worst_m), millimetres(kModelLimit_m),
            o.count <= kFewPixels ? "the depth there is wrong" : "its pose is not this frame's"));
    return report;
  }
  add("pose", cofusion::kCameraTrajectory,
      fmt::format(
          "{} pixels of {} objects lie up to {} off their models (limit {}): this pose or {} "
          "is not this frame's",
          all_off, off.size(), millimetres(worst), millimetres(kModelLimit_m),
          cofusion::DepthFile(frame.index)));
  return report;
}

}  // namespace tsdfpp
