#include "mapper/network/coco_classes.h"

#include <fmt/format.h>

#include <array>
#include <cstddef>
#include <string_view>

namespace tsdfpp {
namespace {

constexpr std::array<std::string_view, 80> kNames{"person",        "bicycle",      "car",
                                                  "motorcycle",    "airplane",     "bus",
                                                  "train",         "truck",        "boat",
                                                  "traffic light", "fire hydrant", "stop sign",
                                                  "parking meter", "bench",        "bird",
                                                  "cat",           "dog",          "horse",
                                                  "sheep",         "cow",          "elephant",
                                                  "bear",          "zebra",        "giraffe",
                                                  "backpack",      "umbrella",     "handbag",
                                                  "tie",           "suitcase",     "frisbee",
                                                  "skis",          "snowboard",    "sports ball",
                                                  "kite",          "baseball bat", "baseball glove",
                                                  "skateboard",    "surfboard",    "tennis racket",
                                                  "bottle",        "wine glass",   "cup",
                                                  "fork",          "knife",        "spoon",
                                                  "bowl",          "banana",       "apple",
                                                  "sandwich",      "orange",       "broccoli",
                                                  "carrot",        "hot dog",      "pizza",
                                                  "donut",         "cake",         "chair",
                                                  "couch",         "potted plant", "bed",
                                                  "dining table",  "toilet",       "tv",
                                                  "laptop",        "mouse",        "remote",
                                                  "keyboard",      "cell phone",   "microwave",
                                                  "oven",          "toaster",      "sink",
                                                  "refrigerator",  "book",         "clock",
                                                  "vase",          "scissors",     "teddy bear",
                                                  "hair drier",    "toothbrush"};
// Numbers of 1 to 90 that have no class (COCO 2017).
constexpr std::array<int, 10> kGivenUp{12, 26, 29, 30, 45, 66, 68, 69, 71, 83};

std::vector<std::string> Numbered() {
  std::vector<std::string> all;
  std::size_t name = 0;
  std::size_t given_up = 0;
  for (int number = 1; number <= 90; ++number) {
    if (given_up < kGivenUp.size() && kGivenUp[given_up] == number) {
      all.push_back(fmt::format("class {}", number - 1));
      ++given_up;
    } else {
      all.emplace_back(kNames[name++]);
    }
  }
  return all;
}

}  // namespace

const std::vector<std::string>& CocoClasses80() {
  static const std::vector<std::string> names(kNames.begin(), kNames.end());
  return names;
}

const std::vector<std::string>& CocoClasses90() {
  static const std::vector<std::string> names = Numbered();
  return names;
}

}  // namespace tsdfpp
