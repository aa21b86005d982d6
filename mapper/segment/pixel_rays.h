// The rays of a camera's pixels, and rows of images in parallel.
#pragma once

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/partitioner.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/types.h"

namespace tsdfpp {

// The ray of pixel (u, v) is (x[u], y[v], 1).
struct PixelRays {
  std::vector<float> x;
  std::vector<float> y;
  float per_x = 0;        // fx
  float per_y = 0;        // fy
  float pixel_width = 0;  // the greater of a pixel's width and height at 1 m, m
};

inline PixelRays RaysOf(const Intrinsics& k) {
  PixelRays rays;
  for (int u = 0; u < k.width; ++u) rays.x.push_back(static_cast<float>((u - k.cx) / k.fx));
  for (int v = 0; v < k.height; ++v) rays.y.push_back(static_cast<float>((v - k.cy) / k.fy));
  rays.per_x = static_cast<float>(k.fx);
  rays.per_y = static_cast<float>(k.fy);
  rays.pixel_width = static_cast<float>(1 / std::min(k.fx, k.fy));
  return rays;
}

// Calls of_row(v) for each row, in parallel; each call writes only what is its own.
template <typename OfRow>
void ForEachRow(int rows, const OfRow& of_row) {
  constexpr int kRows = 16;  // of a task
  tbb::parallel_for(
      tbb::blocked_range<int>(0, rows, kRows),
      [&](const tbb::blocked_range<int>& range) {
        for (int v = range.begin(); v < range.end(); ++v) of_row(v);
      },
      tbb::simple_partitioner());
}

// Calls of_strip(strip, first row, the row after the last) for each of kRowStrips strips, in
// parallel: for sums of a strip's own, which are as many for any number of threads.
inline constexpr int kRowStrips = 8;
template <typename OfStrip>
void ForEachStrip(int rows, const OfStrip& of_strip) {
  tbb::parallel_for(0, kRowStrips, [&](int strip) {
    const auto row = [&](int i) { return static_cast<int>(std::int64_t{rows} * i / kRowStrips); };
    of_strip(static_cast<std::size_t>(strip), row(strip), row(strip + 1));
  });
}

}  // namespace tsdfpp
