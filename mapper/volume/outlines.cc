#include "mapper/volume/outlines.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

namespace tsdfpp {
namespace {

// A cube's corners are within its diagonal of a point in it: 1.8 voxels, and the rounding of
// pixels.
constexpr double kRimReach_voxels = 2;

// An object that is farther than this in front of what is beside it in the image ends there: what
// its surface goes on to is out of sight, and nobody knows whether it does.
constexpr float kInFront_voxels = 2;

// Outlines that reach farther (with everyday images none does) are stamped all at once: one by one
// they would each go over much of the image.
constexpr int kWideReach_px = 256;

struct PixelBox {
  int left, right, top, bottom;  // inclusive
};

// Sets `near` at the pixels of this label that are in any of the boxes, in one pass over all.
void StampBoxes(const std::vector<PixelBox>& boxes, std::uint16_t own, const FrameView& frame,
                std::vector<std::uint8_t>& near) {
  // Of how many boxes more a pixel is in than the one to its left, and than the row above says.
  const auto columns = static_cast<std::size_t>(frame.width) + 1;
  std::vector<std::int32_t> steps(columns * (static_cast<std::size_t>(frame.height) + 1), 0);
  const auto at = [&](int column, int row) -> std::int32_t& {
    return steps[static_cast<std::size_t>(row) * columns + static_cast<std::size_t>(column)];
  };
  for (const PixelBox& box : boxes) {
    ++at(box.left, box.top);
    --at(box.right + 1, box.top);
    --at(box.left, box.bottom + 1);
    ++at(box.right + 1, box.bottom + 1);
  }
  std::vector<std::int32_t> above(columns, 0);
  std::size_t pixel = 0;
  for (int row = 0; row < frame.height; ++row) {
    std::int32_t boxes_here = 0;
    for (int column = 0; column < frame.width; ++column, ++pixel) {
      std::int32_t& step = above[static_cast<std::size_t>(column)];
      step += at(column, row);
      boxes_here += step;
      if (boxes_here > 0 && frame.kernel.label[pixel] == own) near[pixel] = 1;
    }
  }
}

// Marks the pixels within reach of an outline of their own object.
class OutlineReach {
 public:
  OutlineReach(const FrameView& frame, double voxel_m)
      : frame_(frame),
        reach_px_(kRimReach_voxels * voxel_m * std::max(frame.intrinsics.fx, frame.intrinsics.fy)),
        in_front_m_(static_cast<float>(kInFront_voxels * voxel_m)),
        near_(static_cast<std::size_t>(frame.width) * static_cast<std::size_t>(frame.height), 0) {}

  // What is within reach of a pixel that has another object `beside` it.
  void Add(std::size_t pixel, std::size_t beside) {
    const auto width = static_cast<std::size_t>(frame_.width);
    const float* depth = frame_.kernel.depth;
    if (!frame_.IsUsable(pixel) || !frame_.IsUsable(beside)) return;
    if (depth[pixel] + in_front_m_ < depth[beside]) return;
    const int u = static_cast<int>(pixel % width);
    const int v = static_cast<int>(pixel / width);
    const std::uint16_t own = frame_.kernel.label[pixel];
    const auto reach =
        static_cast<int>(std::min(std::ceil(reach_px_ / double{depth[pixel]}), double{1 << 14}));
    const PixelBox box{std::max(0, u - reach), std::min(frame_.width - 1, u + reach),
                       std::max(0, v - reach), std::min(frame_.height - 1, v + reach)};
    if (reach >= kWideReach_px) {
      wide_[own].push_back(box);
    } else {
      StampBox(box, own);
    }
  }

  // One byte a pixel.
  std::vector<std::uint8_t> Take() {
    for (const auto& [own, boxes] : wide_) StampBoxes(boxes, own, frame_, near_);
    return std::move(near_);
  }

 private:
  void StampBox(const PixelBox& box, std::uint16_t own) {
    const int count = box.right - box.left + 1;
    for (int row = box.top; row <= box.bottom; ++row) {
      // Written so that compilers make vectors of it.
      const std::size_t first =
          static_cast<std::size_t>(row) * static_cast<std::size_t>(frame_.width) +
          static_cast<std::size_t>(box.left);
      const std::uint16_t* others = frame_.kernel.label + first;
      std::uint8_t* out = near_.data() + first;
      for (int i = 0; i < count; ++i) {
        out[i] = static_cast<std::uint8_t>(out[i] | static_cast<std::uint8_t>(others[i] == own));
      }
    }
  }

  const FrameView& frame_;
  double reach_px_;
  float in_front_m_;
  std::vector<std::uint8_t> near_;
  std::map<std::uint16_t, std::vector<PixelBox>> wide_;  // by label
};

// Outlines run through a tile, or along its right or lower side.
bool MayHaveOutlines(const FrameView& frame, int column, int row) {
  const int columns = frame.tiles_per_row;
  const int rows = static_cast<int>(frame.tiles.size()) / columns;
  const auto tile = [&](int dx, int dy) -> const Tile& {
    const int x = std::min(column + dx, columns - 1);
    const int y = std::min(row + dy, rows - 1);
    return frame.tiles[static_cast<std::size_t>(y * columns + x)];
  };
  const Tile& own = tile(0, 0);
  const auto is_as_own = [&](const Tile& of) {
    return of.least_label == own.least_label && of.greatest_label == own.least_label;
  };
  return !(is_as_own(own) && is_as_own(tile(1, 0)) && is_as_own(tile(0, 1)));
}

void AddOutlinesOfTile(const FrameView& frame, int column, int row, OutlineReach& reach) {
  const auto width = static_cast<std::size_t>(frame.width);
  const std::uint16_t* label = frame.kernel.label;
  for (int v = row * kTile_px; v < std::min((row + 1) * kTile_px, frame.height); ++v) {
    for (int u = column * kTile_px; u < std::min((column + 1) * kTile_px, frame.width); ++u) {
      const std::size_t pixel = static_cast<std::size_t>(v) * width + static_cast<std::size_t>(u);
      if (u + 1 < frame.width && label[pixel] != label[pixel + 1]) {
        reach.Add(pixel, pixel + 1);
        reach.Add(pixel + 1, pixel);
      }
      if (v + 1 < frame.height && label[pixel] != label[pixel + width]) {
        reach.Add(pixel, pixel + width);
        reach.Add(pixel + width, pixel);
      }
    }
  }
}

}  // namespace

std::vector<std::uint8_t> PixelsAtOutlines(const FrameView& frame, double voxel_m) {
  OutlineReach reach(frame, voxel_m);
  const int columns = frame.tiles_per_row;
  const int rows = static_cast<int>(frame.tiles.size()) / columns;
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      if (MayHaveOutlines(frame, column, row)) AddOutlinesOfTile(frame, column, row, reach);
    }
  }
  return reach.Take();
}

}  // namespace tsdfpp
