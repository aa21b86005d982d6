#include "mapper/network/centre_votes.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace tsdfpp {
namespace {

// Views of the four maps.
struct CentreMaps {
  cv::Mat thing;
  cv::Mat centre;
  cv::Mat columns;
  cv::Mat rows;
};

CentreMaps MapsOf(const NetworkOutput& maps, cv::Size part) {
  const int height = maps.sides[2];
  const int width = maps.sides[3];
  const auto plane = [&](int channel) {
    // OpenCV has no view of constant values; nothing is written.
    auto* values = const_cast<float*>(maps.values) +  // NOLINT(*-const-cast)
                   static_cast<std::ptrdiff_t>(channel) * height * width;
    return cv::Mat(height, width, CV_32FC1, values)(cv::Rect(cv::Point(), part));
  };
  return {plane(0), plane(1), plane(2), plane(3)};
}

struct Centre {
  cv::Point at;
  float score = 0;
};

bool IsGreatestAround(const cv::Mat& centre, int v, int u) {
  const float value = centre.at<float>(v, u);
  const cv::Rect around(u - kCentreReach_px, v - kCentreReach_px, 2 * kCentreReach_px + 1,
                        2 * kCentreReach_px + 1);
  const cv::Rect within = around & cv::Rect(cv::Point(), centre.size());
  for (int y = within.y; y < within.y + within.height; ++y) {
    const auto* row = centre.ptr<float>(y);
    for (int x = within.x; x < within.x + within.width; ++x) {
      // Of equal ones the first is the greatest.
      const bool is_before = y < v || (y == v && x < u);
      if (row[x] > value || (is_before && row[x] == value)) return false;
    }
  }
  return true;
}

std::vector<Centre> FindCentres(const CentreMaps& maps, float least_score) {
  std::vector<Centre> centres;
  for (int v = 0; v < maps.thing.rows; ++v) {
    for (int u = 0; u < maps.thing.cols; ++u) {
      if (!(maps.thing.at<float>(v, u) > 0)) continue;
      const float score = 1 / (1 + std::exp(-maps.centre.at<float>(v, u)));
      if (score > least_score && IsGreatestAround(maps.centre, v, u)) {
        centres.push_back({{u, v}, score});
      }
    }
  }
  return centres;
}

// Of each pixel the centre's place and 1; 0 where no thing is.
cv::Mat VoteForCentres(const CentreMaps& maps, const std::vector<Centre>& centres) {
  cv::Mat votes(maps.thing.size(), CV_16UC1, cv::Scalar(0));
  for (int v = 0; v < votes.rows; ++v) {
    for (int u = 0; u < votes.cols; ++u) {
      if (!(maps.thing.at<float>(v, u) > 0)) continue;
      const cv::Point2f to(static_cast<float>(u) + maps.columns.at<float>(v, u),
                           static_cast<float>(v) + maps.rows.at<float>(v, u));
      float least = 0;
      for (std::size_t i = 0; i < centres.size(); ++i) {
        const cv::Point2f off = to - cv::Point2f(centres[i].at);
        const float distance = off.dot(off);
        auto& vote = votes.at<std::uint16_t>(v, u);
        if (vote != 0 && !(distance < least)) continue;
        vote = static_cast<std::uint16_t>(i + 1);
        least = distance;
      }
    }
  }
  return votes;
}

// `votes` in the image's size.
cv::Mat EnlargeVotes(const cv::Mat& votes, cv::Size image) {
  cv::Mat large(image, CV_16UC1);
  const auto place = [](int at, int from, int to) { return (2 * at + 1) * to / (2 * from); };
  for (int v = 0; v < image.height; ++v) {
    const auto* from = votes.ptr<std::uint16_t>(place(v, image.height, votes.rows));
    auto* to = large.ptr<std::uint16_t>(v);
    for (int u = 0; u < image.width; ++u) to[u] = from[place(u, image.width, votes.cols)];
  }
  return large;
}

}  // namespace

std::vector<Instance> InstancesOfCentres(const NetworkOutput& output, cv::Size part, cv::Size image,
                                         float least_score, const std::string& semantic_class) {
  const CentreMaps maps = MapsOf(output, part);
  std::vector<Centre> centres = FindCentres(maps, least_score);
  if (centres.size() >= kNoInstance) centres.resize(kNoInstance - 1);
  const cv::Mat votes = VoteForCentres(maps, centres);
  std::vector<int> pixels(centres.size() + 1);
  for (int v = 0; v < votes.rows; ++v) {
    const auto* row = votes.ptr<std::uint16_t>(v);
    for (int u = 0; u < votes.cols; ++u) ++pixels[row[u]];
  }
  const cv::Mat large = EnlargeVotes(votes, image);
  std::vector<cv::Rect> boxes(centres.size() + 1);
  for (int v = 0; v < large.rows; ++v) {
    const auto* row = large.ptr<std::uint16_t>(v);
    for (int u = 0; u < large.cols; ++u) boxes[row[u]] |= cv::Rect(u, v, 1, 1);
  }
  std::vector<Instance> instances;
  for (std::size_t i = 1; i < boxes.size(); ++i) {
    if (pixels[i] < kLeastThing_px || boxes[i].empty()) continue;
    const cv::Mat mask = large(boxes[i]) == static_cast<double>(i);
    instances.push_back({boxes[i], mask, semantic_class, centres[i - 1].score});
  }
  return instances;
}

}  // namespace tsdfpp
