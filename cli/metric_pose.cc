#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <numbers>
#include <optional>

#include "cli/metric.h"
#include "eval/score/evaluation.h"
#include "eval/score/surface_file.h"
#include "metrics/association.h"
#include "metrics/object_pose.h"
#include "metrics/trajectory_report.h"
#include "sequence/timed_poses.h"

namespace tsdfpp {
namespace {

struct MetricPoseArguments {
  std::string model;
  std::string truth;
  std::string estimate;
  std::string camera;
  std::string symmetries;
  bool anchor = false;
  double scale = 1;
  double greatest_m = kGreatestAucError_m;
  double max_difference_s = kMaxStampDifference_s;
  std::size_t most_points = 2000;
};

// "z:180".
Expected<Pose> SymmetryFromText(const std::string& word) {
  const std::string axes = "xyz";
  const std::size_t axis = word.empty() ? std::string::npos : axes.find(word.front());
  double degrees = 0;
  const char* const end = word.data() + word.size();
  const bool shaped = axis != std::string::npos && word.size() > 2 && word[1] == ':';
  if (shaped) {
    const auto [at, status] = std::from_chars(word.data() + 2, end, degrees);
    if (status == std::errc() && at == end && std::isfinite(degrees)) {
      return Pose(Eigen::AngleAxisd(degrees * std::numbers::pi / 180,
                                    Eigen::Vector3d::Unit(static_cast<Eigen::Index>(axis))));
    }
  }
  return UsageError("--symmetry '{}': expected an axis of the model and degrees, e.g. z:180", word);
}

Expected<Intrinsics> CameraFromText(const std::string& text) {
  std::vector<double> numbers;
  for (const std::string& word : SplitList(text)) {
    double number = 0;
    const auto [end, status] = std::from_chars(word.data(), word.data() + word.size(), number);
    if (status == std::errc() && end == word.data() + word.size()) numbers.push_back(number);
  }
  const auto finite = [](double number) { return std::isfinite(number); };
  if (numbers.size() != 4 || SplitList(text).size() != 4 || !(numbers[0] > 0 && numbers[1] > 0) ||
      !std::all_of(numbers.begin(), numbers.end(), finite)) {
    return UsageError("--camera '{}': expected fx,fy,cx,cy in pixels", text);
  }
  return Intrinsics{0, 0, numbers[0], numbers[1], numbers[2], numbers[3]};
}

// At most this many of the points, evenly along their order; 0 for all.
std::vector<Eigen::Vector3f> Thinned(const std::vector<Eigen::Vector3f>& points, std::size_t most) {
  if (most == 0 || points.size() <= most) return points;
  std::vector<Eigen::Vector3f> kept;
  for (std::size_t i = 0; i < most; ++i) kept.push_back(points[i * points.size() / most]);
  return kept;
}

// One measure over all true poses; the ones without an estimate are undefined.
struct Series {
  const char* name;
  const char* unit;
  double in_unit;  // what the number is multiplied with for the text
  std::vector<Measured> errors;
  std::string gap;  // the first estimate at which it is undefined, and why
};

std::size_t CountOfDefined(const std::vector<Measured>& errors) {
  return static_cast<std::size_t>(std::count_if(
      errors.begin(), errors.end(), [](const Measured& error) { return error.value.has_value(); }));
}

Measured MeanOfDefined(const std::vector<Measured>& errors) {
  double sum = 0;
  int count = 0;
  for (const Measured& error : errors) {
    if (!error.value) continue;
    sum += *error.value;
    ++count;
  }
  return count == 0 ? Measured::Undefined("defined at no pose") : Measured::Of(sum / count);
}

Measured LargestOfDefined(const std::vector<Measured>& errors) {
  std::optional<double> largest;
  for (const Measured& error : errors) {
    if (error.value) largest = std::max(largest.value_or(0), *error.value);
  }
  return largest ? Measured::Of(*largest) : Measured::Undefined("defined at no pose");
}

// What is measured, as the options name it.
struct PoseInputs {
  std::optional<Intrinsics> camera;
  std::vector<Pose> symmetries;
  std::size_t model_points = 0;
  std::vector<Eigen::Vector3f> points;  // of these
  TimedPoses truth;
  TimedPoses estimate;
  std::vector<std::string> remarks;  // of the files
};

Expected<PoseInputs> ReadInputs(const MetricPoseArguments& options) {
  PoseInputs inputs;
  if (!options.camera.empty()) {
    TSDFPP_ASSIGN(inputs.camera, CameraFromText(options.camera));
  }
  for (const std::string& word : SplitList(options.symmetries)) {
    TSDFPP_ASSIGN(const Pose symmetry, SymmetryFromText(word));
    inputs.symmetries.push_back(symmetry);
  }
  TSDFPP_ASSIGN(const TriangleMesh model,
                ReadSurfaceFile(options.model, options.scale, inputs.remarks));
  if (model.vertices.empty()) return DataError("{}: holds no vertices", options.model);
  inputs.model_points = model.vertices.size();
  inputs.points = Thinned(model.vertices, options.most_points);
  TSDFPP_ASSIGN(inputs.truth, ReadTimedPoses(options.truth, &inputs.remarks));
  TSDFPP_ASSIGN(inputs.estimate, ReadTimedPoses(options.estimate, &inputs.remarks));
  return inputs;
}

// The errors of all true poses that have an estimate.
struct PoseErrors {
  std::vector<Series> series = {{"ADD", "mm", 1e3, {}, {}},         {"ADD-S", "mm", 1e3, {}, {}},
                                {"MSSD", "mm", 1e3, {}, {}},        {"MSPD", "px", 1, {}, {}},
                                {"translation", "mm", 1e3, {}, {}}, {"rotation", "deg", 1, {}, {}}};
  nlohmann::json frames = nlohmann::json::array();
  std::size_t found = 0;  // estimates

  // `errors` in the order of the series.
  void Add(double stamp_s, const std::array<Measured, 6>& errors) {
    ++found;
    for (std::size_t k = 0; k < series.size(); ++k) {
      series[k].errors.push_back(errors[k]);
      if (errors[k].value || !series[k].gap.empty()) continue;
      series[k].gap = fmt::format("the first at {} s: {}", stamp_s, errors[k].why_not);
    }
    frames.push_back({{"t", stamp_s},
                      {"add_m", ToJson(errors[0])},
                      {"add_s_m", ToJson(errors[1])},
                      {"mssd_m", ToJson(errors[2])},
                      {"mspd_px", ToJson(errors[3])},
                      {"translation_m", ToJson(errors[4])},
                      {"rotation_deg", ToJson(errors[5])}});
  }

  void AddMissing() {
    for (Series& one : series) one.errors.push_back(Measured::Undefined("no estimate"));
  }
};

std::array<Measured, 6> ErrorsOfPose(const PoseInputs& inputs, const Pose& T_estimate,
                                     const Pose& T_true) {
  const PosePairs pair = {{0}, {T_estimate}, {T_true}};
  return {AddError_m(inputs.points, T_estimate, T_true),
          AddSymmetricError_m(inputs.points, T_estimate, T_true),
          Mssd_m(inputs.points, T_estimate, T_true, inputs.symmetries),
          inputs.camera
              ? Mspd_px(inputs.points, T_estimate, T_true, *inputs.camera, inputs.symmetries)
              : Measured::Undefined("MSPD needs --camera"),
          Measured::Of(TranslationErrors_m(pair)[0]),
          Measured::Of(RotationErrors_rad(pair)[0] * 180 / std::numbers::pi)};
}

// Compares each true pose with the estimate nearest in time, where no other true pose is nearer to
// that: an estimate counts once.
PoseErrors MeasurePoses(const PoseInputs& inputs, const MetricPoseArguments& options) {
  PoseErrors errors;
  Pose C = Pose::Identity();  // from the true object frame to the estimate's
  for (const auto& [stamp_s, T_true] : inputs.truth) {
    const auto nearest = NearestInTime(inputs.estimate, stamp_s);
    if (std::abs(nearest->first - stamp_s) > options.max_difference_s ||
        NearestInTime(inputs.truth, nearest->first)->first != stamp_s) {
      errors.AddMissing();
      continue;
    }
    if (options.anchor && errors.found == 0) C = nearest->second.inverse() * T_true;
    errors.Add(stamp_s, ErrorsOfPose(inputs, nearest->second * C, T_true));
  }
  return errors;
}

// An estimate that a measure says nothing of may be the worst: that mean and max lack it is said.
std::vector<std::string> RemarksOn(const PoseErrors& errors) {
  std::vector<std::string> remarks;
  for (const Series& one : errors.series) {
    const std::size_t defined = CountOfDefined(one.errors);
    if (defined == 0 || defined == errors.found) continue;
    remarks.push_back(
        fmt::format("{} is undefined at {} of {} estimates, which its mean and max lack, {}",
                    one.name, errors.found - defined, errors.found, one.gap));
  }
  return remarks;
}

// Adds the mean and the largest error of a measure to the JSON, and returns its line.
std::string AddSeries(const Series& one, std::size_t found, bool has_camera, nlohmann::json& json) {
  const Measured mean = MeanOfDefined(one.errors);
  const Measured largest = LargestOfDefined(one.errors);
  const std::size_t defined = CountOfDefined(one.errors);
  const std::string key = fmt::format("{}_{}", one.name, one.in_unit == 1 ? one.unit : "m");
  json["mean"][key] = ToJson(mean);
  json["max"][key] = ToJson(largest);
  json["defined"][key] = defined;
  if (!mean.value) {
    return fmt::format("{:<12} undefined: {}\n", one.name,
                       has_camera ? mean.why_not : "MSPD needs --camera");
  }
  return fmt::format("{:<12} {:>12.4f} {:>12.4f} {}{}\n", one.name, one.in_unit * *mean.value,
                     one.in_unit * *largest.value, one.unit,
                     defined < found ? fmt::format(" (of {} of {})", defined, found) : "");
}

Expected<CommandResult> RunPose(const MetricPoseArguments& options) {
  TSDFPP_ASSIGN(const PoseInputs inputs, ReadInputs(options));
  const PoseErrors errors = MeasurePoses(inputs, options);
  if (errors.found == 0) {
    return DataError("{}: none of its {} poses is within {} s of one of {}", options.estimate,
                     inputs.estimate.size(), options.max_difference_s, options.truth);
  }
  std::vector<std::string> remarks = inputs.remarks;
  for (const std::string& remark : RemarksOn(errors)) remarks.push_back(remark);
  const Measured auc_add = AreaUnderCurve(errors.series[0].errors, options.greatest_m);
  const Measured auc_add_s = AreaUnderCurve(errors.series[1].errors, options.greatest_m);
  nlohmann::json json = {{"model", options.model},
                         {"points", inputs.points.size()},
                         {"model_points", inputs.model_points},
                         {"reference_poses", inputs.truth.size()},
                         {"found", errors.found},
                         {"anchored", options.anchor},
                         {"auc_limit_m", options.greatest_m},
                         {"auc_add", ToJson(auc_add)},
                         {"auc_add_s", ToJson(auc_add_s)},
                         {"frames", errors.frames},
                         {"remarks", remarks}};
  std::string text =
      fmt::format("{} of {} true poses have an estimate; {} of the model's {} points\n",
                  errors.found, inputs.truth.size(), inputs.points.size(), inputs.model_points);
  text += fmt::format("{:<12} {:>12} {:>12}\n", "", "mean", "max");
  for (const Series& one : errors.series) {
    text += AddSeries(one, errors.found, inputs.camera.has_value(), json);
  }
  text += fmt::format("AUC to {} m: ADD {}, ADD-S {}\n", options.greatest_m, ShareText(auc_add),
                      ShareText(auc_add_s));
  for (const std::string& remark : remarks) spdlog::warn("{}", remark);
  return CommandResult{json, text};
}

}  // namespace

Run AddMetricPose(CLI::App& app) {
  auto options = std::make_shared<MetricPoseArguments>();
  app.add_option("MODEL", options->model, "The object's mesh or points: .ply, .obj, .stl, .glb")
      ->required();
  app.add_option("REF", options->truth, "True poses: lines t tx ty tz qx qy qz qw")->required();
  app.add_option("EST", options->estimate, "Estimated poses, the same")->required();
  app.add_option("--scale", options->scale, "Metres a unit of MODEL, 0.001 for millimetres")
      ->check(AboveZero())
      ->capture_default_str();
  app.add_option("--max-diff", options->max_difference_s,
                 "Most seconds between a true pose and its estimate")
      ->check(NotNegative())
      ->capture_default_str();
  app.add_flag("--anchor", options->anchor,
               "The estimate's object frame is of its own choice: fit it at the first pose");
  app.add_option("--auc", options->greatest_m, "Upper end of the area under the curve, metres")
      ->check(AboveZero())
      ->capture_default_str();
  app.add_option("--points", options->most_points, "Most points of the model; 0 for all")
      ->check(WholeBetween(0, 1'000'000))
      ->capture_default_str();
  app.add_option("--symmetry", options->symmetries,
                 "Turns of the model that change nothing, for MSSD and MSPD: AXIS:DEGREES,...");
  app.add_option("--camera", options->camera,
                 "For MSPD: fx,fy,cx,cy in pixels; the poses are then the camera's");
  return [options] { return RunPose(*options); };
}

}  // namespace tsdfpp
