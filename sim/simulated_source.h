// A scene file as a stream of frames, rendered when they are read.
#pragma once

#include <filesystem>
#include <memory>

#include "core/frame_source.h"
#include "sim/config/scene_config.h"
#include "sim/motion/scene_motion.h"
#include "sim/render/gl_context.h"
#include "sim/render/renderer.h"
#include "sim/scene/scene_builder.h"
#include "sim/sensor/sensor.h"

namespace tsdfpp {

struct SimOptions {
  // Without it frames have an empty colour image and come several times as fast.
  bool render_colour = true;
  RenderOptions render{};
  // Where not empty: a folder of trajectories (trajectory_folder.h) whose poses are rendered, the
  // camera's too, in place of the scene's own motion and physics.
  std::filesystem::path poses{};
};

// What a sequence of the scene says of itself.
SequenceInfo SequenceInfoOf(const SceneConfig& config, const CompiledScene& scene);

// What a sensor saw, and what there was.
struct SensedFrame {
  Frame frame;
  SensedTruth truth;  // at the frame's time stamp
};

class SimulatedSource final : public FrameSource {
 public:
  // Bakes physics. Errors: those of CompiledScene::Compile, Renderer::Create and SceneMotion.
  static Expected<std::unique_ptr<SimulatedSource>> Open(const SceneConfig& config,
                                                         const SimOptions& options);

  const SequenceInfo& info() const override { return info_; }
  // Poses are taken through text (core/pose_text.h) and the images are rendered at the poses so
  // rounded, then sensed by the scene's sensor: a frame depends on its number alone. T_WO holds
  // every object, those at rest included.
  Expected<Frame> Read(int index) override;
  // The same frame with the truth beside it.
  Expected<SensedFrame> ReadSensed(int index);
  bool IsSensed() const override { return !(config_.sensor == SensorConfig{}); }
  // Renders nothing where the frame was the last one that Read() gave.
  Expected<Frame> ReadTrue(int index) override;
  // The compiled meshes: exactly what is rendered.
  Expected<std::vector<TrueModel>> Truth() override { return scene_.TrueModels(); }

  const SceneConfig& config() const { return config_; }
  const GlInfo& gl_info() const { return renderer_->gl_info(); }
  // Of the frame read last.
  const RenderTimes& render_times() const { return renderer_->times(); }
  // The compiled model and the state of the frame read last.
  CompiledScene& scene() { return scene_; }
  const SceneMotion& motion() const { return motion_; }

 private:
  SimulatedSource(const SceneConfig& config, const SimOptions& options, SceneMotion motion,
                  CompiledScene scene);
  // The true frame at a number, fractions included.
  Expected<Frame> RenderAt(double number);

  SceneConfig config_;
  SimOptions options_;
  SceneMotion motion_;
  CompiledScene scene_;
  std::unique_ptr<Renderer> renderer_;
  SequenceInfo info_;
  std::optional<Frame> last_true_;  // of the frame that Read() gave last, where it differs
};

}  // namespace tsdfpp
