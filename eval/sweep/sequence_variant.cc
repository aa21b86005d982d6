#include "eval/sweep/sequence_variant.h"

#include <algorithm>
#include <charconv>
#include <cstring>
#include <numbers>

#include "core/files.h"
#include "core/intrinsics.h"
#include "core/pose_text.h"
#include "core/random.h"
#include "sequence/sequence_json.h"
#include "sim/load_scene.h"
#include "sim/scene/scene_inputs.h"
#include "sim/sensor/mask_faults.h"

namespace tsdfpp {
namespace {

constexpr int kFirst = kFirstFrame;

void MultiplyRates(MaskFaultConfig& masks, double factor) {
  for (FaultTiming* timing :
       {&masks.missing, &masks.undershoot.timing, &masks.bleed.timing, &masks.split,
        &masks.merged.timing, &masks.flicker, &masks.wrong_class}) {
    timing->rate *= factor;
  }
}

Expected<void> SetSensor(const CellSettings& settings, SensorConfig& sensor) {
  const bool reads_masks = settings.segmentation == CellSettings().segmentation;
  if (settings.sensor != "scene") {
    TSDFPP_ASSIGN(sensor, SensorPresetNamed(settings.sensor));
    if (!reads_masks && !(sensor.masks == MaskFaultConfig{})) {
      return UsageError("sensor '{}' has mask faults, but segmentation '{}' reads no masks",
                        settings.sensor, settings.segmentation);
    }
  }
  if (!reads_masks && settings.mask_faults > 0) {
    return UsageError("mask_faults is {}, but segmentation '{}' reads no masks, expected 0",
                      settings.mask_faults, settings.segmentation);
  }
  if (settings.noise != 1) {
    if (sensor.depth.model == DepthModel::kExact) {
      return UsageError("noise is {}, but sensor '{}' has exact depth: name another sensor",
                        settings.noise, settings.sensor);
    }
    sensor.depth.noise_scale *= settings.noise;
  }
  if (settings.mask_faults > 0) {
    if (!(sensor.masks == MaskFaultConfig{})) {
      return UsageError("mask_faults is {}, but sensor '{}' has mask faults of its own",
                        settings.mask_faults, settings.sensor);
    }
    TSDFPP_ASSIGN(const SensorConfig mild, SensorPresetNamed("masks_mild"));
    sensor.masks = mild.masks;
    MultiplyRates(sensor.masks, settings.mask_faults);
  }
  if (settings.camera_error > 0) {
    if (!(sensor.camera_pose == CameraPoseConfig{})) {
      return UsageError("camera_error is {}, but sensor '{}' has pose errors of its own",
                        settings.camera_error, settings.sensor);
    }
    TSDFPP_ASSIGN(const SensorConfig drift, SensorPresetNamed("pose_drift"));
    sensor.camera_pose = {drift.camera_pose.drift_m * settings.camera_error,
                          drift.camera_pose.drift_deg * settings.camera_error,
                          drift.camera_pose.jitter_m * settings.camera_error,
                          drift.camera_pose.jitter_deg * settings.camera_error};
  }
  if (DrawsEveryId(sensor.masks)) {
    return UsageError(
        "its sensor draws the ids of masks anew in every frame, and experiments take them for "
        "those "
        "of objects: expected another sensor; `tsdfpp compare` associates them by votes");
  }
  return ValidateSensorConfig(sensor);
}

Expected<void> KeepObjects(int count, SceneConfig& scene) {
  if (count == 0) return {};
  if (count > static_cast<int>(scene.objects.size())) {
    return UsageError("objects is {}, but the scene has {}", count, scene.objects.size());
  }
  scene.objects.resize(static_cast<std::size_t>(count));
  if (!scene.experiment) return {};
  std::erase_if(scene.experiment->removed, [&](const std::string& name) {
    return std::none_of(scene.objects.begin(), scene.objects.end(),
                        [&](const SceneObject& object) { return object.name == name; });
  });
  return {};
}

Expected<void> ChooseFrames(const FrameChoice& choice, const CellSettings& settings,
                            SequenceVariant& variant) {
  const SceneConfig& scene = variant.scene;
  const int end = kFirst + scene.frames - 1;
  const auto reveal =
      scene.experiment ? std::optional(scene.experiment->reveal_frame) : std::nullopt;
  int last = end;
  if (choice.until == "reveal") {
    last = reveal.value_or(end);
  } else if (choice.until != "end") {
    std::from_chars(choice.until.data(), choice.until.data() + choice.until.size(), last);
    if (last < kFirst || last > end) {
      return UsageError("frames.until is {}, but the scene has frames {} to {}", choice.until,
                        kFirst, end);
    }
  }
  variant.examined = reveal && *reveal <= last ? *reveal : last;
  if (settings.fuse_until > last) {
    return UsageError("fuse_until is {}, but the last frame is {}", settings.fuse_until, last);
  }
  // Counted from the examined frame, so that any stride has it.
  const int step = choice.stride * settings.speed;
  for (int frame = kFirst + (variant.examined - kFirst) % step; frame <= last; frame += step) {
    variant.frames.push_back(frame);
    const int away = std::abs(frame - variant.examined) / step;
    const bool at = choice.every > 0 && away % choice.every == 0;
    if (at || frame == variant.examined || frame + step > last) {
      variant.evaluated.push_back(frame);
    }
  }
  if (variant.frames.size() < 2) {
    return UsageError("of {} frames every {}-th is used, which leaves {}, expected 2 or more",
                      last - kFirst + 1, step, variant.frames.size());
  }
  return {};
}

Pose Disturbed(const Pose& T_WO, double error, std::uint64_t seed, int frame, InstanceId id) {
  const auto a = static_cast<std::uint64_t>(frame);
  const auto shift = GaussianDraw(seed, kObjectErrorStream, a, 2U * id);
  const auto turn = GaussianDraw(seed, kObjectErrorStream, a, 2U * id + 1U);
  const Eigen::Vector3d axis_angle = Eigen::Vector3d(turn[0], turn[1], turn[2]) *
                                     (error * kObjectErrorUnit_deg * std::numbers::pi / 180);
  Pose T_O = Pose::Identity();
  T_O.translation() = Eigen::Vector3d(shift[0], shift[1], shift[2]) * (error * kObjectErrorUnit_m);
  const double angle = axis_angle.norm();
  if (angle > 0) T_O.linear() = Eigen::AngleAxisd(angle, axis_angle / angle).toRotationMatrix();
  return PoseThroughText(T_WO * T_O);
}

// Of images that were shared: new ones take their places.
void Blind(Frame& frame) {
  frame.depth = cv::Mat(frame.depth.size(), CV_32FC1, cv::Scalar(0));
  frame.mask = cv::Mat(frame.mask.size(), CV_16UC1, cv::Scalar(kNoInstance));
}

}  // namespace

bool SequenceVariant::IsEvaluated(int frame) const {
  return std::binary_search(evaluated.begin(), evaluated.end(), frame);
}

std::string SequenceVariant::Key() const {
  std::string key = fmt::format("fuse_until {}\nobject_error {}\nframes", fuse_until, object_error);
  for (const int frame : frames) key += fmt::format(" {}", frame);
  key += fmt::format("\nexamined {} of", examined);
  for (const int frame : evaluated) key += fmt::format(" {}", frame);
  if (sabotage != Sabotage::kNone) {
    key += fmt::format("\nsabotage {} {}", SabotageName(sabotage), voxel_m);
  }
  return key + "\n" + scene_text;
}

void SetSabotage(const CellSettings& settings, SequenceVariant& variant) {
  if (IsOfSequence(settings.sabotage)) variant.sabotage = settings.sabotage;
  if (settings.sabotage == Sabotage::kTruthShifted) variant.voxel_m = settings.voxel_m;
}

Expected<SequenceVariant> VariantMaker::Make(const CellSettings& settings) {
  const auto key = std::pair(settings.scene, settings.seed);
  auto known = scenes_.find(key);
  if (known == scenes_.end()) {
    TSDFPP_ASSIGN(SceneConfig loaded, LoadSceneConfig(folder_ / settings.scene, settings.seed));
    known = scenes_.emplace(key, std::move(loaded)).first;
  }
  SequenceVariant variant;
  variant.scene = known->second;
  variant.fuse_until = settings.fuse_until;
  variant.object_error = settings.object_error;
  SetSabotage(settings, variant);
  const auto fit = [&]() -> Expected<void> {
    TSDFPP_RETURN_IF_ERROR(KeepObjects(settings.objects, variant.scene));
    TSDFPP_RETURN_IF_ERROR(SetSensor(settings, variant.scene.sensor));
    return ChooseFrames(choice_, settings, variant);
  };
  if (auto fits = fit(); !fits) {
    return UsageError("scene {}: {}", settings.scene, fits.error().message);
  }
  variant.scene.intrinsics = Scaled(variant.scene.intrinsics, choice_.scale);
  TSDFPP_ASSIGN(SceneInputs inputs, CollectInputs(variant.scene));
  variant.scene_text = SceneToToml(inputs.config);
  for (const auto& [place, file] : inputs.files) {
    TSDFPP_ASSIGN(const std::string bytes, ReadFile(file));
    variant.scene_text += fmt::format("# {} {}\n", place, HashText(bytes));
  }
  variant.inputs = std::move(inputs.files);
  return variant;
}

Expected<VariantSource> VariantSource::Open(const SequenceVariant& variant) {
  TSDFPP_ASSIGN(auto source, SimulatedSource::Open(variant.scene, {}));
  return VariantSource(variant, std::move(source));
}

Expected<VariantFrame> VariantSource::Read(int index) {
  VariantFrame both;
  TSDFPP_RETURN_IF_ERROR(sabotage_.Prepare(*source_, index));
  TSDFPP_ASSIGN(both.frame, source_->Read(index));
  both.truth = both.frame;
  if (source_->IsSensed()) {
    TSDFPP_ASSIGN(both.truth, source_->ReadTrue(index));
  }
  sabotage_.Apply(info(), both.frame);
  if (variant_->object_error > 0) {
    for (auto& [id, T_WO] : both.frame.T_WO) {
      if (id == kBackground) continue;
      T_WO = Disturbed(T_WO, variant_->object_error, variant_->scene.seed, index, id);
    }
  }
  if (variant_->fuse_until > 0 && index > variant_->fuse_until) {
    Blind(both.frame);
    Blind(both.truth);
  }
  return both;
}

}  // namespace tsdfpp
