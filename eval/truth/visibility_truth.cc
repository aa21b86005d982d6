#include "eval/truth/visibility_truth.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "eval/tools/rasteriser.h"
#include "metrics/solid.h"
#include "metrics/surface_samples.h"

namespace tsdfpp {
namespace {

// Grows a box pixel by pixel.
struct BoxBuilder {
  int u0 = 0, v0 = 0, u1 = -1, v1 = -1;

  void Add(int u, int v) {
    if (u1 < u0) {
      u0 = u1 = u;
      v0 = v1 = v;
      return;
    }
    u0 = std::min(u0, u);
    u1 = std::max(u1, u);
    v0 = std::min(v0, v);
    v1 = std::max(v1, v);
  }
  PixelBox Box() const { return u1 < u0 ? PixelBox{} : PixelBox{u0, v0, u1 - u0 + 1, v1 - v0 + 1}; }
};

// The part of BOP's canvas, in image coordinates, in which the object can be.
PixelBox CanvasAround(const TriangleMesh& mesh_O, const Pose& T_CO, const Intrinsics& k) {
  constexpr double kBehind_m = 1e-3;
  double u0 = 2 * k.width, v0 = 2 * k.height, u1 = -k.width - 1, v1 = -k.height - 1;
  bool in_front = true;
  for (const Eigen::Vector3f& vertex : mesh_O.vertices) {
    const Eigen::Vector3d p_C = T_CO * vertex.cast<double>();
    if (p_C.z() < kBehind_m) {
      in_front = false;
      continue;
    }
    const double u = k.fx * p_C.x() / p_C.z() + k.cx;
    const double v = k.fy * p_C.y() / p_C.z() + k.cy;
    u0 = std::min(u0, u);
    u1 = std::max(u1, u);
    v0 = std::min(v0, v);
    v1 = std::max(v1, v);
  }
  if (u1 < u0) return {};
  if (!in_front) {
    u0 = -k.width;
    v0 = -k.height;
    u1 = 2 * k.width - 1;
    v1 = 2 * k.height - 1;
  }
  const int left = std::max(-k.width, static_cast<int>(std::floor(std::max(u0, -1.0 * k.width))));
  const int top = std::max(-k.height, static_cast<int>(std::floor(std::max(v0, -1.0 * k.height))));
  const int right =
      std::min(2 * k.width - 1, static_cast<int>(std::ceil(std::min(u1, 2.0 * k.width))));
  const int bottom =
      std::min(2 * k.height - 1, static_cast<int>(std::ceil(std::min(v1, 2.0 * k.height))));
  if (right < left || bottom < top) return {};
  return {left, top, right - left + 1, bottom - top + 1};
}

// The silhouette of the object alone. What the mask shows belongs to it too: the two rasterisers
// may differ where an edge runs through a pixel's centre.
void MeasureSilhouette(const TriangleMesh& mesh_O, const Frame& frame, const Pose& T_WO,
                       ObjectVisibility& out) {
  const Intrinsics& k = frame.intrinsics;
  const Pose T_OC = T_WO.inverse() * frame.T_WC;
  const PixelBox canvas = CanvasAround(mesh_O, T_OC.inverse(), k);
  BoxBuilder box;
  std::int64_t on_canvas_visible = 0;
  if (canvas.width > 0) {
    Intrinsics shifted = k;
    shifted.width = canvas.width;
    shifted.height = canvas.height;
    shifted.cx -= canvas.u;
    shifted.cy -= canvas.v;
    const Raster raster = Rasterise(mesh_O, shifted, T_OC);
    for (int y = 0; y < canvas.height; ++y) {
      const int v = y + canvas.v;
      const bool row_inside = v >= 0 && v < k.height;
      for (int x = 0; x < canvas.width; ++x) {
        const int u = x + canvas.u;
        const bool shown =
            row_inside && u >= 0 && u < k.width && frame.mask.at<InstanceId>(v, u) == out.id;
        on_canvas_visible += shown ? 1 : 0;
        if (!shown && raster.face.at<int>(y, x) < 0) continue;
        ++out.silhouette_px;
        box.Add(u, v);
      }
    }
  }
  if (on_canvas_visible < out.visible_px) {  // mask pixels beside the canvas
    const PixelBox& seen = out.visible_box;
    box.Add(seen.u, seen.v);
    box.Add(seen.u + seen.width - 1, seen.v + seen.height - 1);
    out.silhouette_px += out.visible_px - on_canvas_visible;
  }
  out.silhouette_box = box.Box();
  if (out.silhouette_px > 0) {
    out.visible_fraction =
        static_cast<double>(out.visible_px) / static_cast<double>(out.silhouette_px);
  }
}

void CountSamples(const SeenTracker& tracker, const Frame& frame, const Pose& T_WO,
                  ObjectVisibility& out) {
  const Intrinsics& k = frame.intrinsics;
  const Eigen::Isometry3f T_CO = (frame.T_WC.inverse() * T_WO).cast<float>();
  const auto& status = tracker.status();
  out.samples = static_cast<std::int64_t>(status.size());
  for (std::size_t i = 0; i < status.size(); ++i) {
    switch (status[i]) {
      case SampleStatus::kVisible:
        ++out.seen;
        break;
      case SampleStatus::kBehindItself:
        ++out.behind_itself;
        break;
      case SampleStatus::kOutside:
        ++out.outside;
        break;
      case SampleStatus::kUnmeasured:
        ++out.unmeasured;
        break;
      case SampleStatus::kBehindOther: {
        const Eigen::Vector3f p_C = T_CO * tracker.samples_O().points[i];
        const double u = k.fx * p_C.x() / p_C.z() + k.cx;
        const double v = k.fy * p_C.y() / p_C.z() + k.cy;
        const int column = std::clamp(static_cast<int>(std::floor(u + 0.5)), 0, k.width - 1);
        const int row = std::clamp(static_cast<int>(std::floor(v + 0.5)), 0, k.height - 1);
        ++out.hidden_by[frame.mask.at<InstanceId>(row, column)];
        break;
      }
    }
  }
}

std::string BoxText(const PixelBox& box) {
  return fmt::format("{},{},{},{}", box.u, box.v, box.width, box.height);
}

}  // namespace

VisibilityTruth::VisibilityTruth(const std::vector<TrueModel>& models) {
  for (const TrueModel& model : models) {
    auto mesh = std::make_shared<const TriangleMesh>(model.mesh_O);
    SampleSet samples = WithoutInner(SampleModel(model, kVisibilitySamples), Solid(*mesh));
    objects_.push_back({mesh, SeenTracker(std::move(samples), model.info.id)});
  }
  std::sort(objects_.begin(), objects_.end(),
            [](const Object& a, const Object& b) { return a.tracker.id() < b.tracker.id(); });
}

Expected<std::vector<ObjectVisibility>> VisibilityTruth::Measure(const Frame& frame) {
  std::vector<ObjectVisibility> all;
  std::map<InstanceId, std::pair<std::int64_t, BoxBuilder>> visible;
  for (int v = 0; v < frame.mask.rows; ++v) {
    const auto* ids = frame.mask.ptr<InstanceId>(v);
    for (int u = 0; u < frame.mask.cols;) {
      int end = u + 1;  // runs of one id
      while (end < frame.mask.cols && ids[end] == ids[u]) ++end;
      auto& [count, box] = visible[ids[u]];
      count += end - u;
      box.Add(u, v);
      box.Add(end - 1, v);
      u = end;
    }
  }
  for (Object& object : objects_) {
    ObjectVisibility entry;
    entry.frame = frame.index;
    entry.id = object.tracker.id();
    Pose T_WO = Pose::Identity();
    if (const auto pose = frame.T_WO.find(entry.id); pose != frame.T_WO.end()) {
      T_WO = pose->second;
    } else if (entry.id != kBackground) {
      continue;
    }
    TSDFPP_RETURN_IF_ERROR(object.tracker.Observe(frame, T_WO));
    if (const auto seen = visible.find(entry.id); seen != visible.end()) {
      entry.visible_px = seen->second.first;
      entry.visible_box = seen->second.second.Box();
    }
    if (entry.id != kBackground) MeasureSilhouette(*object.mesh_O, frame, T_WO, entry);
    CountSamples(object.tracker, frame, T_WO, entry);
    all.push_back(std::move(entry));
  }
  return all;
}

std::string VisibilityHeader() {
  return "frame,id,visible_px,visible_u,visible_v,visible_w,visible_h,silhouette_px,silhouette_u,"
         "silhouette_v,silhouette_w,silhouette_h,visible_fraction,samples,seen,behind_itself,"
         "outside,unmeasured,hidden_by\n";
}

std::string VisibilityLine(const ObjectVisibility& v) {
  std::string hidden_by;
  for (const auto& [id, count] : v.hidden_by) {
    hidden_by += fmt::format("{}{}:{}", hidden_by.empty() ? "" : ";", id, count);
  }
  return fmt::format("{},{},{},{},{},{},{:.6f},{},{},{},{},{},{}\n", v.frame, v.id, v.visible_px,
                     BoxText(v.visible_box), v.silhouette_px, BoxText(v.silhouette_box),
                     v.visible_fraction, v.samples, v.seen, v.behind_itself, v.outside,
                     v.unmeasured, hidden_by);
}

}  // namespace tsdfpp
