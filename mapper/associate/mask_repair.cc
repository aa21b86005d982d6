#include "mapper/associate/mask_repair.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <mutex>

#include "core/pixel_ray.h"
#include "mapper/associate/outline_surfaces.h"
#include "mapper/associate/take_out.h"

namespace tsdfpp {
namespace {

constexpr int kTile_px = 32;
// An outline's step is at least so high.
constexpr double kOutlineStep_voxels = 0.5;
// Frames that gave a place on a surface to its object, of all that disputed it: with less the
// surface says nothing, and the logarithm of none is that of this.
constexpr double kOwnShare = 0.5;
constexpr double kLeastShare = 0.01;

Eigen::Vector3d PointAt(const Frame& frame, int v, int u) {
  const double z = frame.depth.at<float>(v, u);
  return frame.T_WC * (z * PixelRay(frame.intrinsics, u, v));
}

// 255 where a pixel has a label and depth.
cv::Mat LabelledPixels(const Frame& frame, const cv::Mat& labels) {
  cv::Mat is_labelled(labels.size(), CV_8UC1);
  for (int v = 0; v < labels.rows; ++v) {
    const auto* label = labels.ptr<InstanceId>(v);
    const auto* depth = frame.depth.ptr<float>(v);
    auto* row = is_labelled.ptr<std::uint8_t>(v);
    for (int u = 0; u < labels.cols; ++u) {
      row[u] = label[u] != kNoInstance && IsValidDepth(depth[u]) ? 255 : 0;
    }
  }
  return is_labelled;
}

// Calls of(v, u) for each pixel where `image` (CV_8UC1) is not 0, by rows.
template <typename Of>
void ForEachIn(const cv::Mat& image, const Of& of) {
  for (int v = 0; v < image.rows; ++v) {
    const auto* row = image.ptr<std::uint8_t>(v);
    for (int u = 0; u < image.cols; ++u) {
      if (row[u] != 0) of(v, u);
    }
  }
}

// The other points of labels that the map has no surface of become those of the object that most of
// their points became.
void FollowExplained(const ObjectLookup& lookup,
                     const std::map<std::pair<InstanceId, InstanceId>, std::int64_t>& explained,
                     const cv::Mat& is_open, cv::Mat& labels) {
  std::map<InstanceId, std::int64_t> points;
  ForEachIn(is_open, [&](int v, int u) { ++points[labels.at<InstanceId>(v, u)]; });
  for (const auto& [pair, count] : explained) points[pair.first] += count;
  std::map<InstanceId, InstanceId> meant;
  for (const auto& [pair, count] : explained) {
    const auto& [label, object] = pair;
    if (object == kBackground || lookup.NumberOf(label)) continue;
    if (2 * count > points[label]) meant[label] = object;
  }
  if (meant.empty()) return;
  ForEachIn(is_open, [&](int v, int u) {
    InstanceId& label = labels.at<InstanceId>(v, u);
    if (const auto object = meant.find(label); object != meant.end()) label = object->second;
  });
}

}  // namespace

std::optional<InstanceId> MaskRepair::LikeliestOf(const ObjectLookup& lookup,
                                                  std::span<const ObjectLookup::Distance> distances,
                                                  const ObjectCells& cells,
                                                  const Eigen::Vector3d& p_W,
                                                  InstanceId label) const {
  std::optional<InstanceId> likeliest;
  double most = 0;
  for (const auto& [object, voxels, weight] : distances) {
    const InstanceId id = lookup.ids()[object];
    const bool is_own = id == label;
    if (voxels > (is_own ? config_.keep_voxels : config_.take_voxels)) continue;
    double share = 1;
    if (contested_.HasAny(id)) {
      if (const auto cell = cells.CellOf(id, p_W)) share = contested_.ShareOf(id, *cell);
    }
    if (!is_own && share < kOwnShare) continue;
    const double sigmas = voxels / config_.sigma_voxels;
    const double likelihood = std::log(weight) + std::log(std::max(share, kLeastShare)) -
                              sigmas * sigmas / 2 + (is_own ? std::log(config_.own_factor) : 0);
    if (likeliest && likelihood <= most) continue;
    likeliest = id;
    most = likelihood;
  }
  return likeliest;
}

void MaskRepair::Testify(const ObjectLookup& lookup,
                         std::span<const ObjectLookup::Distance> distances,
                         const ObjectCells& cells, const std::set<InstanceId>& unplaced,
                         const Eigen::Vector3d& p_W, InstanceId label, Testimonies& said) const {
  for (const auto& [object, voxels, weight] : distances) {
    const InstanceId id = lookup.ids()[object];
    if (unplaced.contains(id)) continue;
    const bool is_own = id == label;
    if (voxels > config_.take_voxels) continue;
    const auto cell = cells.CellOf(id, p_W);
    if (!cell) continue;
    const bool is_calm = is_own && !contested_.IsContested(id, *cell);
    (is_calm ? said.of_calm : said.said).push_back({id, *cell, is_own, weight});
  }
}

MaskRepair::OfTile MaskRepair::ExplainTile(const ObjectLookup& lookup, const ObjectCells& cells,
                                           const cv::Rect& tile, Work& work) const {
  OfTile of_tile;
  std::vector<Eigen::Vector3d> points_W;
  std::vector<cv::Point> pixels;
  for (int v = tile.y; v < tile.y + tile.height; ++v) {
    for (int u = tile.x; u < tile.x + tile.width; ++u) {
      if (work.is_open.at<std::uint8_t>(v, u) == 0) continue;
      const Eigen::Vector3d p_W = PointAt(work.frame, v, u);
      if (!cells.CellOf(kBackground, p_W)) continue;
      points_W.push_back(p_W);
      pixels.emplace_back(u, v);
    }
  }
  if (points_W.empty()) return of_tile;
  const std::vector<std::size_t> around = lookup.Around(points_W);
  std::vector<ObjectLookup::Distance> distances;
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    lookup.Distances(points_W[i], around, distances);
    InstanceId& label = work.labels.at<InstanceId>(pixels[i]);
    if (is_changed_.at<std::uint8_t>(pixels[i]) == 0) {
      Testify(lookup, distances, cells, work.unplaced, points_W[i], label, of_tile.said);
    }
    const auto object = LikeliestOf(lookup, distances, cells, points_W[i], label);
    if (!object) continue;
    ++of_tile.explained[{label, *object}];
    label = *object;
    work.is_open.at<std::uint8_t>(pixels[i]) = 0;
  }
  return of_tile;
}

void MaskRepair::Explain(const ObjectLookup& lookup, const ObjectCells& cells, Work& work) {
  const cv::Rect all(0, 0, work.labels.cols, work.labels.rows);
  const int columns = (all.width + kTile_px - 1) / kTile_px;
  const int rows = (all.height + kTile_px - 1) / kTile_px;
  std::mutex mutex;
  tbb::parallel_for(0, rows * columns, [&](int i) {
    const cv::Rect tile(i % columns * kTile_px, i / columns * kTile_px, kTile_px, kTile_px);
    const OfTile of_tile = ExplainTile(lookup, cells, tile & all, work);
    const std::lock_guard lock(mutex);
    for (const auto& [pair, count] : of_tile.explained) work.explained[pair] += count;
    const auto append = [](const std::vector<Testimony>& from, std::vector<Testimony>& to) {
      to.insert(to.end(), from.begin(), from.end());
    };
    append(of_tile.said.said, work.said.said);
    append(of_tile.said.of_calm, work.said.of_calm);
  });
  std::vector<Testimony>& said = work.said.said;
  std::vector<Testimony> disputed = said;
  std::sort(disputed.begin(), disputed.end(), IsOfLowerCell);
  std::ranges::copy_if(work.said.of_calm, std::back_inserter(said), [&](const Testimony& own) {
    return std::binary_search(disputed.begin(), disputed.end(), own, IsOfLowerCell);
  });
  contested_.Add(std::move(said));
}

cv::Mat MaskRepair::SetOutlines(const Frame& frame, const cv::Mat& ids, double voxel_m,
                                const DepthSegmentsConfig& depth) {
  const SurfaceMaps& maps = surfaces_.Compute(frame.depth, frame.intrinsics, depth);
  OutlineLabels outlines =
      LabelsByOutline(maps, frame.depth, ids, static_cast<float>(kOutlineStep_voxels * voxel_m));
  is_doubtful_ = outlines.is_doubtful;
  is_changed_ = outlines.labels != ids;
  return outlines.labels;
}

cv::Mat MaskRepair::Repair(const Frame& frame, const cv::Mat& labels,
                           const std::map<InstanceId, Pose>& T_WO,
                           const std::set<InstanceId>& unplaced, MapRepresentation& map) {
  const double voxel_m = map.config().voxel_m;
  const ObjectCells voxels(T_WO, voxel_m);
  for (const auto& [object, cells] : contested_.TakeLost()) {
    const auto pose = T_WO.find(object);
    TakeOut(cells, voxel_m, object,
            pose == T_WO.end() ? std::nullopt : std::optional<Pose>(pose->second), map);
  }
  const ObjectLookup lookup(map, ObjectLookup::Of::kObjectsAndBackground);
  Work work{frame, unplaced, labels.clone(), LabelledPixels(frame, labels), {}, {}};
  Explain(lookup, voxels, work);
  FollowExplained(lookup, work.explained, work.is_open, work.labels);

  std::vector<cv::Point> pixels;
  std::vector<NewPoint> points;
  ForEachIn(work.is_open, [&](int v, int u) {
    if (is_doubtful_.at<std::uint8_t>(v, u) != 0) {
      work.labels.at<InstanceId>(v, u) = kNoInstance;
      return;
    }
    pixels.emplace_back(u, v);
    points.push_back({work.labels.at<InstanceId>(v, u), PointAt(frame, v, u)});
  });
  const ObjectCells cells(T_WO, config_.cell_voxels * voxel_m);
  const std::vector<bool> is_confirmed = new_surface_.Confirm(points, cells, lookup);
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    if (!is_confirmed[i]) work.labels.at<InstanceId>(pixels[i]) = kNoInstance;
  }
  return work.labels;
}

}  // namespace tsdfpp
