#include "sim/simulated_source.h"

#include <algorithm>
#include <utility>

#include "core/pose_text.h"
#include "sim/load_scene.h"
#include "sim/render/shutter.h"

namespace tsdfpp {

namespace {

// Colour is as sensed: there is no other on disk (eval/make/generate.h).
Frame TrueFrame(const SensedFrame& sensed) {
  Frame frame = sensed.frame;
  frame.depth = sensed.truth.depth;
  frame.mask = sensed.truth.mask;
  frame.T_WC = sensed.truth.T_WC;
  return frame;
}

}  // namespace

SequenceInfo SequenceInfoOf(const SceneConfig& config, const CompiledScene& scene) {
  SequenceInfo info;
  info.name = config.name;
  info.intrinsics = config.intrinsics;
  info.first_index = kFirstFrame;
  info.frame_count = config.frames;
  info.rate_hz = config.rate_hz;
  info.objects = scene.objects();
  info.mask_ids_are_objects = !DrawsEveryId(config.sensor.masks);
  if (config.experiment) {
    RevealPlan plan;
    plan.frame = config.experiment->reveal_frame;
    for (const std::string& name : config.experiment->removed) {
      const auto object = std::find_if(config.objects.begin(), config.objects.end(),
                                       [&](const SceneObject& o) { return o.name == name; });
      plan.removed.push_back(object->id);
    }
    std::sort(plan.removed.begin(), plan.removed.end());
    info.reveal = std::move(plan);
  }
  return info;
}

SimulatedSource::SimulatedSource(const SceneConfig& config, const SimOptions& options,
                                 SceneMotion motion, CompiledScene scene)
    : config_(config),
      options_(options),
      motion_(std::move(motion)),
      scene_(std::move(scene)),
      info_(SequenceInfoOf(config_, scene_)) {}

Expected<std::unique_ptr<SimulatedSource>> SimulatedSource::Open(const SceneConfig& config,
                                                                 const SimOptions& options) {
  TSDFPP_ASSIGN(CompiledScene scene, CompiledScene::Compile(config));
  TSDFPP_ASSIGN(SceneMotion motion, options.poses.empty()
                                        ? SceneMotion::Make(config)
                                        : SceneMotion::FromFolder(config, options.poses));
  std::unique_ptr<SimulatedSource> source(
      new SimulatedSource(config, options, std::move(motion), std::move(scene)));
  // The renderer refers to the scene, which stays where the source is.
  TSDFPP_ASSIGN(source->renderer_,
                Renderer::Create(source->scene_, config.intrinsics, options.render));
  return source;
}

Expected<Frame> SimulatedSource::RenderAt(double number) {
  Frame frame;
  frame.time_s = (number - kFirstFrame) / config_.rate_hz;
  frame.intrinsics = config_.intrinsics;
  frame.T_WC = PoseThroughText(motion_.T_WC(number));
  for (const auto& [id, T_WO] : motion_.T_WO(number)) {
    frame.T_WO.emplace(id, PoseThroughText(T_WO));
  }
  scene_.SetPoses(frame.T_WO);
  TSDFPP_ASSIGN(RenderedImages images, renderer_->Render(frame.T_WC, options_.render_colour));
  frame.colour = std::move(images.colour);
  frame.depth = std::move(images.depth);
  frame.mask = std::move(images.mask);
  return frame;
}

Expected<SensedFrame> SimulatedSource::ReadSensed(int index) {
  const int last = kFirstFrame + config_.frames - 1;
  if (index < kFirstFrame || index > last) {
    return UsageError("frame {} is out of range: scene '{}' has frames {} to {}", index,
                      config_.name, kFirstFrame, last);
  }
  SensedFrame sensed;
  const ShutterConfig& shutter = config_.sensor.shutter;
  std::vector<Frame> sub_frames;
  if (HasShutter(shutter)) {
    for (const double at_s : SubFrameTimes(shutter)) {
      TSDFPP_ASSIGN(Frame sub_frame, RenderAt(index + at_s * config_.rate_hz));
      sub_frames.push_back(std::move(sub_frame));
    }
  }
  // Rendered last, so that the compiled scene is left in the state of the frame's time stamp.
  TSDFPP_ASSIGN(sensed.frame, RenderAt(index));
  sensed.frame.index = index;
  const Frame truth = sensed.frame;
  if (!sub_frames.empty()) ApplyShutter(shutter, sub_frames, sensed.frame);
  TSDFPP_ASSIGN(sensed.truth, ApplySensor(config_.sensor, config_.seed, info_, sensed.frame));
  sensed.truth.colour = truth.colour;
  sensed.truth.depth = truth.depth;
  sensed.truth.mask = truth.mask;
  return sensed;
}

Expected<Frame> SimulatedSource::Read(int index) {
  TSDFPP_ASSIGN(SensedFrame sensed, ReadSensed(index));
  last_true_.reset();
  if (IsSensed()) last_true_ = TrueFrame(sensed);
  return std::move(sensed.frame);
}

Expected<Frame> SimulatedSource::ReadTrue(int index) {
  if (!IsSensed()) return Read(index);
  if (last_true_ && last_true_->index == index) return *std::exchange(last_true_, std::nullopt);
  TSDFPP_ASSIGN(const SensedFrame sensed, ReadSensed(index));
  return TrueFrame(sensed);
}

}  // namespace tsdfpp
