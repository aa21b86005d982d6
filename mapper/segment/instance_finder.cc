#include "mapper/segment/instance_finder.h"

#include <cstddef>

namespace tsdfpp {
namespace {

// By which a mean of scores may be more than 1.
constexpr float kRounding = 1e-4F;

// Nothing where it is one, else what it has and what was expected.
std::string FaultOf(const Instance& instance, cv::Size image) {
  const cv::Rect& box = instance.box;
  const bool is_inside = box.x >= 0 && box.width >= 0 && box.width <= image.width &&
                         box.x <= image.width - box.width && box.y >= 0 && box.height >= 0 &&
                         box.height <= image.height && box.y <= image.height - box.height;
  if (!is_inside) {
    return fmt::format("a box of {} x {} pixels at ({}, {}), expected one in the image of {} x {}",
                       box.width, box.height, box.x, box.y, image.width, image.height);
  }
  const cv::Mat& mask = instance.mask;
  if (mask.size() != box.size() || mask.type() != CV_8UC1) {
    return fmt::format("a mask of {} x {} pixels and type {}, expected {} x {} of 8UC1", mask.cols,
                       mask.rows, cv::typeToString(mask.type()), box.width, box.height);
  }
  if (instance.semantic_class.empty()) return "no class, expected one";
  if (!(instance.score >= 0 && instance.score <= 1 + kRounding)) {
    return fmt::format("a score of {}, expected 0 to 1", instance.score);
  }
  return "";
}

}  // namespace

Expected<std::vector<Instance>> FindInstances(InstanceFinder& finder, const Frame& frame) {
  TSDFPP_ASSIGN(std::vector<Instance> instances, finder.Find(frame));
  constexpr std::size_t kMost = kNoInstance - 1;
  if (instances.size() > kMost) {
    return DataError("frame {}: the network found {} instances, expected {} at most", frame.index,
                     instances.size(), kMost);
  }
  for (std::size_t i = 0; i < instances.size(); ++i) {
    const std::string fault = FaultOf(instances[i], frame.depth.size());
    if (fault.empty()) continue;
    return DataError("frame {}: instance {} of {} that the network found has {}", frame.index,
                     i + 1, instances.size(), fault);
  }
  return instances;
}

}  // namespace tsdfpp
