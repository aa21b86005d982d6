// The settings of networks that find instances (docs/segmentation.md, "Networks").
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"
#include "core/toml_reader.h"

namespace tsdfpp {

// What a network takes and gives.
enum class NetworkFormat {
  kAuto,      // by the file's ending and its outputs' names
  kCentres,   // our own: colour and depth to things, their centres and the way there
  kYolo,      // YOLO's heads for segments, v5 and v8: boxes, scores and weights of prototypes
  kMaskRcnn,  // TensorFlow's Mask R-CNN as OpenCV reads it: detection_out_final, detection_masks
};

// "auto", "centres", "yolo" or "mask_rcnn". Errors: kUsage.
Expected<NetworkFormat> NetworkFormatFromName(std::string_view name);
std::string_view NetworkFormatName(NetworkFormat format);

// Of a network's input: greatest width and height.
inline constexpr int kMostNetworkSide_px = 4096;

struct NetworkConfig {
  NetworkFormat format = NetworkFormat::kAuto;
  std::vector<std::string> classes{};  // names by number; none: those of COCO, or "thing"; of
                                       // centres one
  std::string graph{};         // the .pbtxt of mask_rcnn; none: beside the network, with its name
  int width = 0;               // of the input, pixels; 0: the format's own
  int height = 0;              // 0: the format's own, or by the frame's shape
  double least_score = 0;      // what is less sure is no instance; 0: the format's own
  double most_overlap = 0.45;  // of yolo: of two boxes of a class that share more the less sure
                               // one goes
  double mask_share = 0.5;     // of yolo and mask_rcnn: a pixel with less of a mask is not the
                               // instance's
  int every = 1;               // the network sees every n-th frame
  // Of kFull (mapper/segment/joined_segments.h):
  int latency = 0;  // frames after which instances are known, while the network runs beside them;
                    // 0: the frame waits for it; at most `every`
  bool gives_way = false;     // with latency: the network has one thread, where nobody else wants a
                              // core; false: all cores, as urgently as the frames
  double join_overlap = 0.8;  // tau_overlap of paper III-B
  double join_iou = 0.5;      // 1: never by this
  double mask_score = 0.7;    // an instance that is less sure needs segments
  bool unknown_objects = false;  // segments that no instance claims are objects, as in III-B

  // Errors: kUsage, naming the field, what was found and what was expected.
  Expected<void> Validate() const;
  // Reads one table strictly; `where` names the file in errors.
  static Expected<NetworkConfig> FromToml(const toml::table& table, const std::string& where);
  toml::table ToToml() const;
  bool operator==(const NetworkConfig&) const = default;
};

}  // namespace tsdfpp
