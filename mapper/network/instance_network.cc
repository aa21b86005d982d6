#include "mapper/instance_network.h"

#include <algorithm>
#include <cmath>
#include <mutex>
#include <opencv2/dnn.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <utility>

#include "core/one_line.h"
#include "core/quiet_stderr.h"
#include "mapper/network/centre_votes.h"
#include "mapper/network/coco_classes.h"
#include "mapper/network/mask_rcnn.h"
#include "mapper/network/own_network.h"
#include "mapper/network/quiet_opencv.h"
#include "mapper/network/yolo_masks.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;

constexpr std::uintmax_t kMostBytes = 1U << 30U;
// Of our own network: the input's width where none is said, and what its sides are multiples of.
constexpr int kOwnWidth_px = 320;
constexpr int kStride_px = 16;
constexpr int kOwnInputs = 5;
constexpr int kOwnOutputs = 4;
constexpr float kOwnLeastScore = 0.3F;
constexpr int kYoloSide_px = 640;
constexpr double kYoloGrey = 114;
constexpr const char* kOwnClass = "thing";

// What OpenCV throws, as words; it also prints that, which is kept from whoever reads stderr by
// `Quiet`: QuietOpenCv, or QuietStderr where libraries below OpenCV print, too.
template <typename Quiet, typename Function>
Expected<void> InOpenCv(std::string_view what, const Function& function) {
  const Quiet quiet;
  try {
    function();
  } catch (const cv::Exception& error) {
    return DataError("{}: {}", what, OneLine(error.err));
  }
  return {};
}

NetworkOutput OutputOf(const cv::Mat& values) {
  NetworkOutput output;
  for (int i = 0; i < values.dims; ++i) output.sides.push_back(values.size[i]);
  output.values = values.ptr<float>();
  return output;
}

// A network and its name in messages.
struct LoadedNet {
  cv::dnn::Net net;
  std::string name;
  std::vector<std::string> outputs;
};

class NetworkFinder : public InstanceFinder {
 public:
  NetworkFinder(LoadedNet loaded, NetworkFormat format, NetworkConfig config)
      : loaded_(std::move(loaded)), format_(format), config_(std::move(config)) {}

  Expected<std::vector<Instance>> Find(const Frame& frame) override {
    const bool has_colour = frame.colour.type() == CV_8UC3 && !frame.colour.empty() &&
                            frame.colour.size() == frame.depth.size();
    if (!has_colour) {
      return DataError("frame {} has no colour of the size of its depth, which a network needs",
                       frame.index);
    }
    if (frame.depth.type() != CV_32FC1) {
      return DataError("frame {}: its depth is of type {}, expected 32-bit depths (type {})",
                       frame.index, frame.depth.type(), CV_32FC1);
    }
    // The network keeps what it computes with.
    const std::lock_guard lock(mutex_);
    switch (format_) {
      case NetworkFormat::kCentres:
        return FindByCentres(frame);
      case NetworkFormat::kYolo:
        return FindByYolo(frame);
      case NetworkFormat::kAuto:
      case NetworkFormat::kMaskRcnn:
        return FindByMaskRcnn(frame);
    }
    std::abort();
  }

 private:
  // The outputs for a blob, in the order of `names`. Errors: kData.
  Expected<std::vector<cv::Mat>> Run(const Frame& frame, const cv::Mat& blob,
                                     const std::vector<std::string>& names) {
    std::vector<cv::Mat> outputs;
    TSDFPP_RETURN_IF_ERROR(InOpenCv<QuietOpenCv>(
        fmt::format("frame {}: OpenCV cannot run the network {}", frame.index, loaded_.name), [&] {
          loaded_.net.setInput(blob);
          loaded_.net.forward(outputs, names);
        }));
    for (std::size_t i = 0; i < outputs.size(); ++i) {
      if (outputs[i].type() != CV_32FC1 || !outputs[i].isContinuous()) {
        return DataError("frame {}: the network {}: its output '{}' is not of single precision",
                         frame.index, loaded_.name, names[i]);
      }
    }
    return outputs;
  }

  // The instances, or what is wrong with the network's outputs, with its name.
  Expected<std::vector<Instance>> Named(const Frame& frame,
                                        Expected<std::vector<Instance>> found) const {
    if (found) return found;
    return DataError("frame {}: the network {}: {}", frame.index, loaded_.name,
                     found.error().message);
  }

  Expected<std::vector<Instance>> FindByCentres(const Frame& frame) {
    const cv::Size image = frame.colour.size();
    const int width = config_.width > 0 ? config_.width : kOwnWidth_px;
    const int height = config_.height > 0
                           ? config_.height
                           : std::max(1, static_cast<int>(std::lround(static_cast<double>(width) *
                                                                      image.height / image.width)));
    if (height > kMostNetworkSide_px) {
      return DataError(
          "frame {}: an image of {}x{} is {}x{} for a network {} pixels wide, expected a height of "
          "{} at most: set width and height",
          frame.index, image.width, image.height, width, height, width, kMostNetworkSide_px);
    }
    const cv::Size part(width, height);
    const auto filled = [](int side) { return (side + kStride_px - 1) / kStride_px * kStride_px; };
    const cv::Mat blob = OwnInput(frame, part, {filled(width), filled(height)});
    TSDFPP_ASSIGN(const std::vector<cv::Mat> outputs, Run(frame, blob, loaded_.outputs));
    const NetworkOutput maps = OutputOf(outputs[0]);
    const std::vector<int> expected{1, kOwnOutputs, filled(height), filled(width)};
    if (maps.sides != expected) {
      return DataError("frame {}: the network {}: its maps are {}, expected {}", frame.index,
                       loaded_.name, maps.Shape(), NetworkOutput{expected, nullptr}.Shape());
    }
    const float least_score =
        config_.least_score > 0 ? static_cast<float>(config_.least_score) : kOwnLeastScore;
    const std::string& name = config_.classes.empty() ? OwnClass() : config_.classes.front();
    return InstancesOfCentres(maps, part, image, least_score, name);
  }

  static const std::string& OwnClass() {
    static const std::string name = kOwnClass;
    return name;
  }

  // Red, green and blue from 0 to 1, inverse depth in 1/m and whether there is any; `part` is the
  // frame, the rest 0.
  static cv::Mat OwnInput(const Frame& frame, cv::Size part, cv::Size input) {
    cv::Mat colour;
    cv::resize(frame.colour, colour, part, 0, 0, cv::INTER_AREA);
    cv::Mat depth;
    cv::resize(frame.depth, depth, part, 0, 0, cv::INTER_NEAREST);
    const std::array<int, 4> sides{1, kOwnInputs, input.height, input.width};
    cv::Mat blob(4, sides.data(), CV_32FC1, cv::Scalar(0));
    for (int v = 0; v < part.height; ++v) {
      for (int u = 0; u < part.width; ++u) {
        const auto at = [&](int channel) -> float& {
          return blob.ptr<float>(0, channel)[static_cast<std::ptrdiff_t>(v) * input.width + u];
        };
        const auto& rgb = colour.at<cv::Vec3b>(v, u);
        for (int c = 0; c < 3; ++c) at(c) = static_cast<float>(rgb[c]) / 255;
        const float z = depth.at<float>(v, u);
        if (!IsValidDepth(z)) continue;
        at(3) = 1 / std::max(z, 0.1F);
        at(4) = 1;
      }
    }
    return blob;
  }

  Expected<std::vector<Instance>> FindByYolo(const Frame& frame) {
    const cv::Size image = frame.colour.size();
    const cv::Size input(config_.width > 0 ? config_.width : kYoloSide_px,
                         config_.height > 0 ? config_.height : kYoloSide_px);
    const Letterbox letterbox = LetterboxOf(image, input);
    cv::Mat picture(input, CV_8UC3, cv::Scalar::all(kYoloGrey));
    cv::resize(frame.colour, picture(letterbox.place), letterbox.place.size(), 0, 0,
               cv::INTER_LINEAR);
    const cv::Mat blob = cv::dnn::blobFromImage(picture, 1.0 / 255);
    TSDFPP_ASSIGN(std::vector<cv::Mat> outputs, Run(frame, blob, loaded_.outputs));
    // Boxes have three sides, prototypes four, in whatever order.
    if (outputs[0].dims == 4) std::swap(outputs[0], outputs[1]);
    return Named(frame, InstancesOfYolo(OutputOf(outputs[0]), OutputOf(outputs[1]), letterbox,
                                        image, ClassesOr(CocoClasses80()), config_));
  }

  Expected<std::vector<Instance>> FindByMaskRcnn(const Frame& frame) {
    const cv::Size image = frame.colour.size();
    const cv::Size input(config_.width > 0 ? config_.width : image.width,
                         config_.height > 0 ? config_.height : image.height);
    // As OpenCV's sample has it: values from 0 to 255, red first.
    const cv::Mat blob = cv::dnn::blobFromImage(frame.colour, 1, input);
    TSDFPP_ASSIGN(const std::vector<cv::Mat> outputs, Run(frame, blob, loaded_.outputs));
    return Named(frame, InstancesOfMaskRcnn(OutputOf(outputs[0]), OutputOf(outputs[1]), image,
                                            ClassesOr(CocoClasses90()), config_));
  }

  const std::vector<std::string>& ClassesOr(const std::vector<std::string>& known) const {
    return config_.classes.empty() ? known : config_.classes;
  }

  std::mutex mutex_;
  LoadedNet loaded_;
  NetworkFormat format_;
  NetworkConfig config_;
};

NetworkFormat FormatOfOutputs(const std::vector<std::string>& outputs) {
  return outputs.size() == 1 ? NetworkFormat::kCentres : NetworkFormat::kYolo;
}

// Whether the format has a use for all that was set. Errors: kUsage.
Expected<void> CheckUse(NetworkFormat format, const NetworkConfig& config) {
  const NetworkConfig usual;
  const auto wrong = [&](const char* field, const char* of) {
    return UsageError("network setting '{}' is one of format {}, and the network has format {}",
                      field, of, NetworkFormatName(format));
  };
  const bool is_ours = format == NetworkFormat::kCentres;
  if (format != NetworkFormat::kMaskRcnn && config.graph != usual.graph) {
    return wrong("graph", "mask_rcnn");
  }
  if (format != NetworkFormat::kYolo && config.most_overlap != usual.most_overlap) {
    return wrong("most_overlap", "yolo");
  }
  if (is_ours && config.mask_share != usual.mask_share) {
    return wrong("mask_share", "yolo or mask_rcnn");
  }
  if (is_ours && config.classes.size() > 1) {
    return UsageError(
        "network setting 'classes' has {} names, expected one of a network of format {}",
        config.classes.size(), NetworkFormatName(format));
  }
  return {};
}

// Of an ONNX file that is loaded.
Expected<std::unique_ptr<InstanceFinder>> MakeFinder(LoadedNet loaded, NetworkConfig config) {
  loaded.net.setPreferableBackend(cv::dnn::DNN_BACKEND_OPENCV);
  loaded.net.setPreferableTarget(cv::dnn::DNN_TARGET_CPU);
  if (config.format == NetworkFormat::kMaskRcnn) {
    loaded.outputs = {"detection_out_final", "detection_masks"};
    const std::vector<std::string> layers = loaded.net.getLayerNames();
    for (const std::string& name : loaded.outputs) {
      if (std::find(layers.begin(), layers.end(), name) == layers.end()) {
        return DataError("{}: the network has no layer '{}', which Mask R-CNN has", loaded.name,
                         name);
      }
    }
    TSDFPP_RETURN_IF_ERROR(CheckUse(config.format, config));
    return std::make_unique<NetworkFinder>(std::move(loaded), config.format, std::move(config));
  }
  loaded.outputs = loaded.net.getUnconnectedOutLayersNames();
  const NetworkFormat format =
      config.format == NetworkFormat::kAuto ? FormatOfOutputs(loaded.outputs) : config.format;
  const std::size_t expected = format == NetworkFormat::kCentres ? 1 : 2;
  if (loaded.outputs.size() != expected) {
    return DataError("{}: the network has {} outputs ({}), expected {} for format {}", loaded.name,
                     loaded.outputs.size(), fmt::join(loaded.outputs, ", "), expected,
                     NetworkFormatName(format));
  }
  TSDFPP_RETURN_IF_ERROR(CheckUse(format, config));
  return std::make_unique<NetworkFinder>(std::move(loaded), format, std::move(config));
}

Expected<void> CheckNetworkFile(const fs::path& file) {
  std::error_code error;
  if (!fs::is_regular_file(file, error)) {
    return DataError("{}: there is no such file, expected a network", file.string());
  }
  const std::uintmax_t bytes = fs::file_size(file, error);
  if (error || bytes == 0 || bytes > kMostBytes) {
    return DataError("{}: the network has {} bytes, expected 1 to {}", file.string(), bytes,
                     kMostBytes);
  }
  return {};
}

}  // namespace

Expected<std::unique_ptr<InstanceFinder>> LoadInstanceNetwork(const fs::path& file,
                                                              const NetworkConfig& given) {
  NetworkConfig config = given;
  TSDFPP_RETURN_IF_ERROR(config.Validate());
  TSDFPP_RETURN_IF_ERROR(CheckNetworkFile(file));
  const bool is_tensorflow = file.extension() == ".pb";
  if (!is_tensorflow && file.extension() != ".onnx") {
    return UsageError("{}: the network's ending is '{}', expected .onnx or .pb", file.string(),
                      file.extension().string());
  }
  if (config.format == NetworkFormat::kAuto && is_tensorflow) {
    config.format = NetworkFormat::kMaskRcnn;
  }
  if ((config.format == NetworkFormat::kMaskRcnn) != is_tensorflow) {
    return UsageError("{}: format {} is that of a {} file", file.string(),
                      NetworkFormatName(config.format), is_tensorflow ? ".onnx" : ".pb");
  }
  LoadedNet loaded{{}, file.string(), {}};
  const std::string what = fmt::format("{}: OpenCV cannot read the network", file.string());
  if (is_tensorflow) {
    const fs::path graph =
        config.graph.empty() ? fs::path(file).replace_extension(".pbtxt") : fs::path(config.graph);
    TSDFPP_RETURN_IF_ERROR(CheckNetworkFile(graph));
    TSDFPP_RETURN_IF_ERROR(InOpenCv<QuietStderr>(
        what, [&] { loaded.net = cv::dnn::readNetFromTensorflow(file.string(), graph.string()); }));
  } else {
    TSDFPP_RETURN_IF_ERROR(
        InOpenCv<QuietStderr>(what, [&] { loaded.net = cv::dnn::readNetFromONNX(file.string()); }));
  }
  if (loaded.net.empty()) return DataError("{}: the network has no layers", file.string());
  return MakeFinder(std::move(loaded), std::move(config));
}

Expected<std::unique_ptr<InstanceFinder>> OwnInstanceNetwork(const NetworkConfig& given) {
  NetworkConfig config = given;
  TSDFPP_RETURN_IF_ERROR(config.Validate());
  if (config.format != NetworkFormat::kAuto && config.format != NetworkFormat::kCentres) {
    return UsageError("network setting 'format' is '{}', expected auto or centres of our own",
                      NetworkFormatName(config.format));
  }
  config.format = NetworkFormat::kCentres;
  const auto bytes = OwnNetworkFile();
  LoadedNet loaded{{}, "of tsdfpp", {}};
  TSDFPP_RETURN_IF_ERROR(InOpenCv<QuietStderr>("OpenCV cannot read our own network", [&] {
    loaded.net =
        cv::dnn::readNetFromONNX(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  }));
  return MakeFinder(std::move(loaded), std::move(config));
}

}  // namespace tsdfpp
