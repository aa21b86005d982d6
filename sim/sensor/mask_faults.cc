#include "sim/sensor/mask_faults.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <map>
#include <numbers>
#include <set>

#include "core/random.h"
#include "sim/render/parallel_rows.h"

namespace tsdfpp {
namespace {

struct Offset {
  int du = 0;
  int dv = 0;
  int square = 0;
};

// All pixels around one within a distance, nearest first, itself left out.
std::vector<Offset> Disc(int radius) {
  std::vector<Offset> offsets;
  for (int dv = -radius; dv <= radius; ++dv) {
    for (int du = -radius; du <= radius; ++du) {
      const int square = du * du + dv * dv;
      if (square > 0 && square <= radius * radius) offsets.push_back({du, dv, square});
    }
  }
  std::stable_sort(offsets.begin(), offsets.end(),
                   [](const Offset& a, const Offset& b) { return a.square < b.square; });
  return offsets;
}

bool Contains(const std::vector<InstanceId>& ids, InstanceId id) {
  return std::find(ids.begin(), ids.end(), id) != ids.end();
}

InstanceId IdAt(const cv::Mat& mask, int u, int v) { return mask.at<std::uint16_t>(v, u); }

bool Inside(const cv::Mat& mask, int u, int v) {
  return u >= 0 && v >= 0 && u < mask.cols && v < mask.rows;
}

// Calls pixel_function(u, v) for each pixel at most `margin` from the box around these objects.
template <typename PixelFunction>
void ForPixelsNear(const cv::Mat& mask, const std::vector<InstanceId>& objects, int margin,
                   const PixelFunction& pixel_function) {
  int left = mask.cols;
  int right = -1;
  int top = mask.rows;
  int bottom = -1;
  for (int v = 0; v < mask.rows; ++v) {
    const auto* row = mask.ptr<std::uint16_t>(v);
    for (int u = 0; u < mask.cols; ++u) {
      if (row[u] == kBackground || !Contains(objects, row[u])) continue;
      left = std::min(left, u);
      right = std::max(right, u);
      top = std::min(top, v);
      bottom = std::max(bottom, v);
    }
  }
  if (right < 0) return;
  top = std::max(0, top - margin);
  bottom = std::min(mask.rows - 1, bottom + margin);
  left = std::max(0, left - margin);
  right = std::min(mask.cols - 1, right + margin);
  ParallelRows(bottom - top + 1, [&](int row) {
    for (int u = left; u <= right; ++u) pixel_function(u, top + row);
  });
}

std::vector<InstanceId> ObjectsIn(const cv::Mat& mask) {
  std::set<InstanceId> ids;
  for (int v = 0; v < mask.rows; ++v) {
    const auto* row = mask.ptr<std::uint16_t>(v);
    for (int u = 0; u < mask.cols; ++u) {
      if (row[u] != kBackground && (u == 0 || row[u] != row[u - 1])) ids.insert(row[u]);
    }
  }
  return {ids.begin(), ids.end()};
}

void Replace(cv::Mat& mask, InstanceId from, InstanceId to) {
  for (int v = 0; v < mask.rows; ++v) {
    auto* row = mask.ptr<std::uint16_t>(v);
    std::replace(row, row + mask.cols, from, to);
  }
}

// The draws of a fault that began in this frame.
std::array<double, 4> FaultDraw(std::uint64_t seed, SensorStream stream, int start,
                                InstanceId object) {
  // Starts before frame 0 have keys of their own too.
  return UniformDraw(seed, stream, static_cast<std::uint64_t>(static_cast<std::int64_t>(start)),
                     object);
}

// One frame's faults, step by step.
class MaskFaults {
 public:
  MaskFaults(const MaskFaultConfig& config, std::uint64_t seed, int frame, const cv::Mat& mask)
      : config_(config), seed_(seed), frame_(frame), mask_(mask.clone()) {
    present_ = ObjectsIn(mask_);
    for (const InstanceId id : present_) object_of_[id] = id;
  }

  void Apply() {
    for (const InstanceId id : With(config_.missing, kStreamMaskMissing)) Drop(id);
    Shrink();
    Grow();
    for (const InstanceId id : With(config_.split, kStreamMaskSplit)) Split(id);
    Merge();
    for (const InstanceId id : With(config_.flicker, kStreamMaskFlicker)) Flicker(id);
  }

  SensedMask Result(const std::vector<ObjectInfo>& objects) const {
    SensedMask sensed;
    sensed.mask = mask_;
    for (const InstanceId id : ObjectsIn(mask_)) {
      const InstanceId object = object_of_.at(id);
      sensed.segments.push_back({id, object, ClassOf(object, objects)});
    }
    return sensed;
  }

 private:
  std::optional<int> Start(const FaultTiming& timing, SensorStream stream, InstanceId id) const {
    return FaultStart(timing, seed_, stream, frame_, id);
  }

  // Those of the objects still in the mask that have this fault now.
  std::vector<InstanceId> With(const FaultTiming& timing, SensorStream stream) const {
    std::vector<InstanceId> objects;
    for (const InstanceId id : present_) {
      if (Start(timing, stream, id)) objects.push_back(id);
    }
    return objects;
  }

  void Drop(InstanceId id) {
    Replace(mask_, id, kBackground);
    present_.erase(std::find(present_.begin(), present_.end(), id));
  }

  void Shrink() {
    const auto objects = With(config_.undershoot.timing, kStreamMaskUndershoot);
    if (!objects.empty()) mask_ = ShrinkMasks(mask_, objects, config_.undershoot.pixels);
  }

  void Grow() {
    const auto objects = With(config_.bleed.timing, kStreamMaskBleed);
    if (!objects.empty()) mask_ = GrowMasks(mask_, objects, config_.bleed.pixels);
  }

  // An id that nothing in this frame has, the same one for the whole of a fault unless two faults
  // draw the same.
  InstanceId Invent(double uniform) const {
    const int drawn = static_cast<int>(uniform * kInventedIds);
    for (int taken = 0; taken < kInventedIds; ++taken) {
      const auto id = static_cast<InstanceId>(kFirstInventedId + (drawn + taken) % kInventedIds);
      if (!object_of_.contains(id)) return id;
    }
    std::abort();
  }

  void Split(InstanceId id) {
    const auto draw =
        FaultDraw(seed_, kStreamMaskSplit, *Start(config_.split, kStreamMaskSplit, id), id);
    const InstanceId part = Invent(draw[2]);
    mask_ = SplitMask(mask_, id, draw[1] * std::numbers::pi, part);
    object_of_[part] = id;
  }

  void Merge() {
    // Each object's group is named by its lowest id.
    std::map<InstanceId, InstanceId> group;
    for (const InstanceId id : present_) group[id] = id;
    for (const InstanceId id : With(config_.merged.timing, kStreamMaskMerged)) {
      const InstanceId other = TouchingObject(mask_, id, config_.merged.pixels, present_);
      if (other == kNoInstance) continue;
      const InstanceId a = group[id];
      const InstanceId b = group[other];
      for (auto& [member, name] : group) {
        if (name == a || name == b) name = std::min(a, b);
      }
    }
    for (const auto& [member, name] : group) {
      if (member == name) continue;
      Replace(mask_, member, name);
      present_.erase(std::find(present_.begin(), present_.end(), member));
    }
  }

  void Flicker(InstanceId id) {
    const auto draw =
        FaultDraw(seed_, kStreamMaskFlicker, *Start(config_.flicker, kStreamMaskFlicker, id), id);
    const InstanceId other = Invent(draw[1]);
    Replace(mask_, id, other);
    object_of_[other] = id;
  }

  std::string ClassOf(InstanceId object, const std::vector<ObjectInfo>& objects) const {
    std::string own;
    std::set<std::string> others;
    for (const ObjectInfo& info : objects) {
      if (info.id == object) own = info.semantic_class;
      if (info.id != kBackground && !info.semantic_class.empty()) {
        others.insert(info.semantic_class);
      }
    }
    const auto start = Start(config_.wrong_class, kStreamMaskWrongClass, object);
    if (!start) return own;
    others.erase(own);
    if (others.empty()) return "";
    const double draw = FaultDraw(seed_, kStreamMaskWrongClass, *start, object)[1];
    return *std::next(others.begin(), static_cast<int>(draw * static_cast<double>(others.size())));
  }

  const MaskFaultConfig& config_;
  std::uint64_t seed_;
  int frame_;
  cv::Mat mask_;
  std::vector<InstanceId> present_;             // true objects that the mask still names
  std::map<InstanceId, InstanceId> object_of_;  // of true and invented ids
};

}  // namespace

int InventionsAnObject(const MaskFaultConfig& config) {
  return (config.split.rate > 0 ? 1 : 0) + (config.flicker.rate > 0 ? 1 : 0);
}

bool DrawsEveryId(const MaskFaultConfig& config) { return config.flicker.rate >= 1; }

std::optional<int> FaultStart(const FaultTiming& timing, std::uint64_t seed, SensorStream stream,
                              int frame, InstanceId object) {
  if (timing.rate <= 0) return std::nullopt;
  const double begins = 1 - std::pow(1 - timing.rate, 1.0 / timing.frames);
  for (int start = frame; start > frame - timing.frames; --start) {
    if (FaultDraw(seed, stream, start, object)[0] < begins) return start;
  }
  return std::nullopt;
}

cv::Mat ShrinkMasks(const cv::Mat& mask, const std::vector<InstanceId>& objects, int pixels) {
  cv::Mat result = mask.clone();
  const std::vector<Offset> disc = Disc(pixels);
  ForPixelsNear(mask, objects, 0, [&](int u, int v) {
    const InstanceId id = IdAt(mask, u, v);
    if (id == kBackground || !Contains(objects, id)) return;
    if (std::any_of(disc.begin(), disc.end(), [&](const Offset& offset) {
          return Inside(mask, u + offset.du, v + offset.dv) &&
                 IdAt(mask, u + offset.du, v + offset.dv) != id;
        })) {
      result.at<std::uint16_t>(v, u) = kBackground;
    }
  });
  return result;
}

cv::Mat GrowMasks(const cv::Mat& mask, const std::vector<InstanceId>& objects, int pixels) {
  cv::Mat result = mask.clone();
  const std::vector<Offset> disc = Disc(pixels);
  ForPixelsNear(mask, objects, pixels, [&](int u, int v) {
    if (Contains(objects, IdAt(mask, u, v))) return;
    InstanceId nearest = kNoInstance;
    int square = 0;
    for (const Offset& offset : disc) {
      if (nearest != kNoInstance && offset.square > square) break;
      if (!Inside(mask, u + offset.du, v + offset.dv)) continue;
      const InstanceId id = IdAt(mask, u + offset.du, v + offset.dv);
      if (id == kBackground || id >= nearest || !Contains(objects, id)) continue;
      nearest = id;
      square = offset.square;
    }
    if (nearest != kNoInstance) result.at<std::uint16_t>(v, u) = nearest;
  });
  return result;
}

cv::Mat SplitMask(const cv::Mat& mask, InstanceId object, double angle, InstanceId part) {
  std::vector<cv::Point> pixels;
  cv::Point2d sum(0, 0);
  for (int v = 0; v < mask.rows; ++v) {
    for (int u = 0; u < mask.cols; ++u) {
      if (IdAt(mask, u, v) != object) continue;
      pixels.emplace_back(u, v);
      sum += cv::Point2d(u, v);
    }
  }
  cv::Mat result = mask.clone();
  const double count = static_cast<double>(pixels.size());
  std::size_t moved = 0;
  for (const cv::Point& pixel : pixels) {
    const double side =
        std::cos(angle) * (pixel.y - sum.y / count) - std::sin(angle) * (pixel.x - sum.x / count);
    if (side <= 0) continue;
    result.at<std::uint16_t>(pixel) = part;
    ++moved;
  }
  return moved == pixels.size() ? mask.clone() : result;
}

InstanceId TouchingObject(const cv::Mat& mask, InstanceId object, int pixels,
                          std::span<const InstanceId> others) {
  const std::vector<Offset> disc = Disc(pixels);
  std::map<InstanceId, int> contact;
  for (int v = 0; v < mask.rows; ++v) {
    for (int u = 0; u < mask.cols; ++u) {
      const InstanceId id = IdAt(mask, u, v);
      if (id == object || !std::binary_search(others.begin(), others.end(), id)) continue;
      if (std::any_of(disc.begin(), disc.end(), [&](const Offset& offset) {
            return Inside(mask, u + offset.du, v + offset.dv) &&
                   IdAt(mask, u + offset.du, v + offset.dv) == object;
          })) {
        ++contact[id];
      }
    }
  }
  InstanceId touching = kNoInstance;
  for (const auto& [id, count] : contact) {
    if (touching == kNoInstance || count > contact[touching]) touching = id;
  }
  return touching;
}

SensedMask SenseMask(const MaskFaultConfig& config, std::uint64_t seed, int frame,
                     const cv::Mat& mask, const std::vector<ObjectInfo>& objects) {
  CV_Assert(mask.type() == CV_16UC1);
  MaskFaults faults(config, seed, frame, mask);
  if (config != MaskFaultConfig{}) faults.Apply();
  return faults.Result(objects);
}

}  // namespace tsdfpp
