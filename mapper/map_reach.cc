#include "mapper/map_reach.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <functional>

#include "core/farthest.h"
#include "core/pixel_ray.h"
#include "mapper/block_moves.h"
#include "mapper/volume/lattice_range.h"

namespace tsdfpp {
namespace {

// As those that files may have (docs/limits.md): normals and smoothing look at a pixel beside.
constexpr int kLeastSide_px = 2;

// Lattices of objects in which a frame is fused, and the map's, which is the world's.
using Lattices = std::map<InstanceId, Pose>;

// The ends of the part of a pixel's ray that is looked at, in the camera's frame.
struct RayEnds {
  Eigen::Vector3d near_C;
  Eigen::Vector3d far_C;
};

RayEnds EndsOfRay(const Intrinsics& k, double u, double v, double depth_m,
                  const MapConfig& config) {
  const Eigen::Vector3d ray = PixelRay(k, u, v);
  const double range_m = depth_m * ray.norm();
  const Eigen::Vector3d unit = ray.normalized();
  const double front_m = config.trunc_front_voxels * config.voxel_m;
  const double back_m = config.trunc_back_voxels * config.voxel_m;
  return {unit * std::max(0.0, range_m - front_m), unit * (range_m + back_m)};
}

// Whether all that the camera could see, as far as depth is valid, is in the range of a lattice.
bool HoldsView(const LatticeRange& range, const Frame& frame, const Pose& T_LC,
               const MapConfig& config) {
  if (!range.Holds(T_LC.translation())) return false;
  const Intrinsics& k = frame.intrinsics;
  // Along a ray the last point is at most this far along the optical axis.
  const double depth_m = double{kMaxValidDepth_m} + config.trunc_back_voxels * config.voxel_m;
  for (int i = 0; i < 4; ++i) {
    const double u = (i & 1) != 0 ? k.width - 1 : 0;
    const double v = (i & 2) != 0 ? k.height - 1 : 0;
    const Eigen::Vector3d ray = PixelRay(k, u, v);
    if (!range.Holds(T_LC * (depth_m * ray))) return false;
  }
  return true;
}

// Whether what the camera could see lies in the range of each lattice.
bool HoldsAll(const LatticeRange& range, const Frame& frame, const Lattices& T_WL,
              const MapConfig& config) {
  return HoldsView(range, frame, frame.T_WC, config) &&
         std::all_of(T_WL.begin(), T_WL.end(), [&](const auto& lattice) {
           return HoldsView(range, frame, lattice.second.inverse() * frame.T_WC, config);
         });
}

// What a pixel shows beyond the range of its label's lattice.
struct PixelBeyond {
  int v = 0;
  int u = 0;
  InstanceId id = kNoInstance;
  Eigen::Vector3d p_L;
};

// `visit` says whether to go on.
void ForEachBeyond(const LatticeRange& range, const Frame& frame, const cv::Mat& labels,
                   const Lattices& T_WL, const MapConfig& config,
                   const std::function<bool(const PixelBeyond&)>& visit) {
  InstanceId last = kNoInstance;
  Pose T_LC = Pose::Identity();
  for (int v = 0; v < labels.rows; ++v) {
    const auto* depth = frame.depth.ptr<float>(v);
    const auto* label = labels.ptr<InstanceId>(v);
    for (int u = 0; u < labels.cols; ++u) {
      const InstanceId id = label[u];
      if (id == kNoInstance || !IsValidDepth(depth[u])) continue;
      if (id != last) {
        const auto lattice = T_WL.find(id);
        T_LC = lattice == T_WL.end() ? frame.T_WC : Pose(lattice->second.inverse() * frame.T_WC);
        last = id;
      }
      const RayEnds ends = EndsOfRay(frame.intrinsics, u, v, depth[u], config);
      for (const Eigen::Vector3d& p_C : {ends.near_C, ends.far_C}) {
        const Eigen::Vector3d p_L = T_LC * p_C;
        if (range.Holds(p_L)) continue;
        if (!visit({v, u, id, p_L})) return;
        break;
      }
    }
  }
}

Expected<void> CheckPixels(const LatticeRange& range, const Frame& frame, const cv::Mat& labels,
                           const Lattices& T_WL, const MapConfig& config) {
  Expected<void> status;
  ForEachBeyond(range, frame, labels, T_WL, config, [&](const PixelBeyond& pixel) {
    status = DataError(
        "frame {}: pixel ({}, {}) shows object {} at {}{}", frame.index, pixel.u, pixel.v, pixel.id,
        T_WL.contains(pixel.id) ? "a place that in the object's own lattice is " : "",
        range.Beyond(pixel.p_L));
    return false;
  });
  return status;
}

Expected<void> CheckTranslation(const LatticeRange& range, const Pose& T, const std::string& what) {
  if (range.Holds(T.translation())) return {};
  return DataError("{} {}", what, range.Beyond(T.translation()));
}

Expected<void> CheckFarthest(const Pose& T, const std::string& what) {
  const double far_m = T.translation().cwiseAbs().maxCoeff();
  if (far_m <= kFarthest_m) return {};
  return DataError("{} is {:g} m from the origin along an axis, expected at most {:g}", what, far_m,
                   kFarthest_m);
}

// The camera, and what its pixels can show.
Expected<void> CheckFarthestSeen(const Frame& frame) {
  TSDFPP_RETURN_IF_ERROR(
      CheckFarthest(frame.T_WC, fmt::format("frame {}: the camera", frame.index)));
  const Intrinsics& k = frame.intrinsics;
  const double aside_m =
      double{kMaxValidDepth_m} *
      std::max({std::abs(k.cx) / k.fx, std::abs(k.cy) / k.fy, std::abs(k.width - k.cx) / k.fx,
                std::abs(k.height - k.cy) / k.fy});
  if (aside_m <= kFarthest_m) return {};
  return DataError(
      "frame {}: its camera with focal lengths ({:g}, {:g}) and the middle ({:g}, {:g}) sees up to "
      "{:g} m aside, expected at most {:g}",
      frame.index, k.fx, k.fy, k.cx, k.cy, aside_m, kFarthest_m);
}

}  // namespace

namespace {

// Whether it is of the camera's size and of the type.
Expected<void> CheckImageForm(const Frame& frame, const char* name, const cv::Mat& image, int type,
                              const char* type_name) {
  const Intrinsics& k = frame.intrinsics;
  if (image.type() == type && image.size() == cv::Size(k.width, k.height)) return {};
  return DataError("frame {}: its {} image is {}x{} (type {}), expected {}x{} of {} (type {})",
                   frame.index, name, image.cols, image.rows, image.type(), k.width, k.height,
                   type_name, type);
}

}  // namespace

Expected<void> CheckFrameForm(const Frame& frame) {
  const Intrinsics& k = frame.intrinsics;
  const auto number = [](double x) { return std::isfinite(x); };
  if (k.width < kLeastSide_px || k.height < kLeastSide_px || !(k.fx > 0) || !(k.fy > 0) ||
      !number(k.fx) || !number(k.fy) || !number(k.cx) || !number(k.cy)) {
    return DataError(
        "frame {}: its camera has {}x{} pixels, focal lengths ({:g}, {:g}) and the middle "
        "({:g}, {:g}), expected {} pixels a side at least and focal lengths above 0",
        frame.index, k.width, k.height, k.fx, k.fy, k.cx, k.cy, kLeastSide_px);
  }
  TSDFPP_RETURN_IF_ERROR(CheckImageForm(frame, "colour", frame.colour, CV_8UC3, "8-bit colours"));
  TSDFPP_RETURN_IF_ERROR(CheckImageForm(frame, "depth", frame.depth, CV_32FC1, "32-bit depths"));
  if (frame.index < 0) {
    return DataError("frame {}: its number is negative, expected 0 or more", frame.index);
  }
  return CheckRigid(frame.T_WC, fmt::format("frame {}: the camera's", frame.index));
}

Expected<void> CheckFrameForm(const Frame& frame, const cv::Mat& labels) {
  TSDFPP_RETURN_IF_ERROR(CheckFrameForm(frame));
  return CheckImageForm(frame, "mask", labels, CV_16UC1, "16-bit ids");
}

Expected<void> CheckReach(const MapRepresentation& map, const Frame& frame, const cv::Mat& labels,
                          const std::map<InstanceId, Pose>& T_WO) {
  const MapConfig& config = map.config();
  const LatticeRange range(config.voxel_m);
  const BlockMoves* moves = map.block_moves();
  Lattices T_WL;
  if (moves != nullptr) T_WL = moves->MovedLattices();
  for (const auto& [id, pose] : T_WO) {
    const std::string what = fmt::format("frame {}: object {}", frame.index, id);
    if (id == kNoInstance) return DataError("{} has a pose and is none", what);
    TSDFPP_RETURN_IF_ERROR(CheckRigid(pose, what + "'s"));
    if (moves == nullptr) {
      TSDFPP_RETURN_IF_ERROR(CheckFarthest(pose, what));
      continue;
    }
    TSDFPP_RETURN_IF_ERROR(CheckTranslation(range, pose, what + " is posed at"));
    const ObjectMove move = moves->MoveTo(id, pose);
    TSDFPP_RETURN_IF_ERROR(CheckMoved(range, move, 0, what + "'s pose takes a part of it to"));
    T_WL.insert_or_assign(id, move.T_WL);
  }
  if (moves == nullptr) return CheckFarthestSeen(frame);
  std::erase_if(T_WL, [](const auto& lattice) {
    return lattice.second.matrix() == Pose::Identity().matrix();
  });
  TSDFPP_RETURN_IF_ERROR(
      CheckTranslation(range, frame.T_WC, fmt::format("frame {}: the camera is at", frame.index)));
  if (HoldsAll(range, frame, T_WL, config)) return {};
  return CheckPixels(range, frame, labels, T_WL, config);
}

cv::Mat WithoutBeyond(const MapRepresentation& map, const Frame& frame, const cv::Mat& labels) {
  const BlockMoves* moves = map.block_moves();
  if (moves == nullptr) return labels;
  const MapConfig& config = map.config();
  const LatticeRange range(config.voxel_m);
  const Lattices T_WL = moves->MovedLattices();
  if (HoldsAll(range, frame, T_WL, config)) return labels;
  cv::Mat held = labels.clone();
  ForEachBeyond(range, frame, labels, T_WL, config, [&](const PixelBeyond& pixel) {
    held.at<InstanceId>(pixel.v, pixel.u) = kNoInstance;
    return true;
  });
  return held;
}

namespace {

Expected<void> CheckValues(const MapConfig& config, const TsdfGrid& volume,
                           const std::string& what) {
  for (const TsdfGrid::Entry& entry : volume.entries()) {
    const TsdfBlock& block = *entry.block;
    for (std::size_t i = 0; i < kBlockVoxels; ++i) {
      if (block.weight[i] == 0) continue;
      const float distance = block.distance[i];
      if (config.Stores(distance, block.weight[i], block.ColourCount(i))) {
        continue;
      }
      return DataError(
          "{}'s volume has a voxel of distance {} m, weight {} and {} colours, expected {} m to {} "
          "m and at most {}, as the map's have",
          what, distance, int{block.weight[i]}, block.ColourCount(i), -config.back(),
          config.front(), config.weight_cap);
    }
  }
  return {};
}

}  // namespace

Expected<void> CheckAddition(const MapConfig& config, InstanceId id, const TsdfGrid& volume,
                             const Pose& T_WL, const std::optional<Pose>& T_WO) {
  const LatticeRange range(config.voxel_m);
  const std::string what = fmt::format("object {}", id);
  if (T_WO) TSDFPP_RETURN_IF_ERROR(CheckRigid(*T_WO, what + "'s"));
  TSDFPP_RETURN_IF_ERROR(CheckRigid(T_WL, what + "'s lattice's"));
  if (!T_WO && T_WL.matrix() != Pose::Identity().matrix()) {
    return UsageError("{} has no pose and a lattice of its own, expected that of the world", what);
  }
  if (T_WO) {
    TSDFPP_RETURN_IF_ERROR(CheckTranslation(range, *T_WO, what + " is posed at"));
    // The pose at birth is kept too, where the lattice stays the object's own.
    const Pose T_LO = T_WL.inverse() * *T_WO;
    TSDFPP_RETURN_IF_ERROR(
        CheckTranslation(range, T_LO, what + "'s pose in its own lattice is at"));
    TSDFPP_RETURN_IF_ERROR(CheckRigid(T_LO, what + "'s, in its own lattice, whose"));
  }
  TSDFPP_RETURN_IF_ERROR(CheckValues(config, volume, what));
  ObjectMove move;
  move.blocks = &volume;
  TSDFPP_RETURN_IF_ERROR(CheckMoved(range, move, 0, what + "'s volume has a part at"));
  move.T = T_WL;
  return CheckMoved(range, move, 0, what + "'s lattice takes a part of it to");
}

void RequireReach(const MapRepresentation& map, const Frame& frame, const cv::Mat& labels) {
  Expected<void> status = CheckFrameForm(frame, labels);
  if (status) status = CheckReach(map, frame, labels, {});
  if (status) return;
  std::fprintf(stderr, "tsdfpp: %s\n", status.error().message.c_str());
  std::abort();
}

}  // namespace tsdfpp
