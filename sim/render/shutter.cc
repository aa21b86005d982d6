#include "sim/render/shutter.h"

#include <algorithm>
#include <cmath>

#include "sim/render/linear_light.h"
#include "sim/render/parallel_rows.h"

namespace tsdfpp {
namespace {

double Span_s(const ShutterConfig& config) { return config.exposure_s + config.readout_s; }

// The images' weighted mean of one row, in linear light. Where one image has all the weight, its
// bytes.
void ExposeRow(std::span<const cv::Mat> images, const std::vector<double>& weights, int row,
               cv::Mat& result) {
  const auto& light_of = LevelToLight();
  auto* out = result.ptr<std::uint8_t>(row);
  for (int i = 0; i < 3 * result.cols; ++i) {
    double light = 0;
    bool same = true;
    int level = -1;
    for (std::size_t k = 0; k < images.size(); ++k) {
      if (weights[k] == 0) continue;
      const int here = images[k].ptr<std::uint8_t>(row)[i];
      same = same && (level < 0 || level == here);
      level = here;
      light += weights[k] * light_of[static_cast<std::size_t>(here)];
    }
    out[i] = static_cast<std::uint8_t>(same ? level : std::lround(LightToLevel(light)));
  }
}

}  // namespace

std::vector<double> SubFrameTimes(const ShutterConfig& config) {
  std::vector<double> times;
  for (int i = 0; i < config.sub_frames; ++i) {
    times.push_back(Span_s(config) * ((i + 0.5) / config.sub_frames - 0.5));
  }
  return times;
}

double RowTime(const ShutterConfig& config, int row, int height) {
  return config.readout_s * ((row + 0.5) / height - 0.5);
}

int RowSubFrame(const ShutterConfig& config, int row, int height) {
  if (Span_s(config) == 0) return 0;
  const double share = RowTime(config, row, height) / Span_s(config) + 0.5;
  return std::clamp(static_cast<int>(share * config.sub_frames), 0, config.sub_frames - 1);
}

std::vector<double> RowWeights(const ShutterConfig& config, int row, int height) {
  std::vector<double> weights(static_cast<std::size_t>(config.sub_frames), 0.0);
  if (config.exposure_s == 0) {
    weights[static_cast<std::size_t>(RowSubFrame(config, row, height))] = 1;
    return weights;
  }
  const double start = RowTime(config, row, height) - config.exposure_s / 2;
  const double slice = Span_s(config) / config.sub_frames;
  for (std::size_t i = 0; i < weights.size(); ++i) {
    const double slice_start = slice * static_cast<double>(i) - Span_s(config) / 2;
    const double overlap =
        std::min(start + config.exposure_s, slice_start + slice) - std::max(start, slice_start);
    weights[i] = std::max(0.0, overlap / config.exposure_s);
  }
  return weights;
}

cv::Mat BlurColour(std::span<const cv::Mat> images) {
  CV_Assert(!images.empty());
  cv::Mat result(images.front().size(), CV_8UC3);
  const std::vector<double> weights(images.size(), 1.0 / static_cast<double>(images.size()));
  for (const cv::Mat& image : images) {
    CV_Assert(image.type() == CV_8UC3 && image.size() == result.size());
  }
  ParallelRows(result.rows, [&](int row) { ExposeRow(images, weights, row, result); });
  return result;
}

cv::Mat ExposeColour(const ShutterConfig& config, std::span<const cv::Mat> images) {
  CV_Assert(static_cast<int>(images.size()) == config.sub_frames);
  cv::Mat result(images.front().size(), CV_8UC3);
  for (const cv::Mat& image : images) {
    CV_Assert(image.type() == CV_8UC3 && image.size() == result.size());
  }
  ParallelRows(result.rows, [&](int row) {
    ExposeRow(images, RowWeights(config, row, result.rows), row, result);
  });
  return result;
}

cv::Mat ReadOutRows(const ShutterConfig& config, std::span<const cv::Mat> images) {
  CV_Assert(static_cast<int>(images.size()) == config.sub_frames);
  cv::Mat result(images.front().size(), images.front().type());
  for (int row = 0; row < result.rows; ++row) {
    const cv::Mat& image = images[static_cast<std::size_t>(RowSubFrame(config, row, result.rows))];
    CV_Assert(image.type() == result.type() && image.size() == result.size());
    image.row(row).copyTo(result.row(row));
  }
  return result;
}

void ApplyShutter(const ShutterConfig& config, std::span<const Frame> sub_frames, Frame& frame) {
  CV_Assert(static_cast<int>(sub_frames.size()) == config.sub_frames);
  const auto images_of = [&](cv::Mat Frame::*image) {
    std::vector<cv::Mat> images;
    for (const Frame& sub_frame : sub_frames) images.push_back(sub_frame.*image);
    return images;
  };
  if (!frame.colour.empty()) frame.colour = ExposeColour(config, images_of(&Frame::colour));
  if (!frame.depth.empty()) frame.depth = ReadOutRows(config, images_of(&Frame::depth));
  if (!frame.mask.empty()) frame.mask = ReadOutRows(config, images_of(&Frame::mask));
}

}  // namespace tsdfpp
