#include "sim/simulated_source.h"

#include <algorithm>
#include <utility>

#include "core/pose_text.h"

namespace tsdfpp {

SimulatedSource::SimulatedSource(const SceneConfig& config, const SimOptions& options,
                                 CompiledScene scene)
    : config_(config), options_(options), motion_(config), scene_(std::move(scene)) {
  info_.name = config.name;
  info_.intrinsics = config.intrinsics;
  info_.first_index = kFirstFrame;
  info_.frame_count = config.frames;
  info_.rate_hz = config.rate_hz;
  info_.objects = scene_.objects();
  if (config.experiment) {
    RevealPlan plan;
    plan.frame = config.experiment->reveal_frame;
    for (const std::string& name : config.experiment->removed) {
      const auto object = std::find_if(config.objects.begin(), config.objects.end(),
                                       [&](const SceneObject& o) { return o.name == name; });
      plan.removed.push_back(object->id);
    }
    std::sort(plan.removed.begin(), plan.removed.end());
    info_.reveal = std::move(plan);
  }
}

Expected<std::unique_ptr<SimulatedSource>> SimulatedSource::Open(const SceneConfig& config,
                                                                 const SimOptions& options) {
  TSDFPP_ASSIGN(CompiledScene scene, CompiledScene::Compile(config));
  std::unique_ptr<SimulatedSource> source(new SimulatedSource(config, options, std::move(scene)));
  // The renderer refers to the scene, which stays where the source is.
  TSDFPP_ASSIGN(source->renderer_, Renderer::Create(source->scene_, config.intrinsics));
  return source;
}

Expected<Frame> SimulatedSource::Read(int index) {
  const int last = kFirstFrame + config_.frames - 1;
  if (index < kFirstFrame || index > last) {
    return UsageError("frame {} is out of range: scene '{}' has frames {} to {}", index,
                      config_.name, kFirstFrame, last);
  }
  Frame frame;
  frame.index = index;
  frame.time_s = (index - kFirstFrame) / config_.rate_hz;
  frame.intrinsics = config_.intrinsics;
  frame.T_WC = PoseThroughText(motion_.T_WC(index));
  for (const auto& [id, T_WO] : motion_.T_WO(index)) frame.T_WO.emplace(id, PoseThroughText(T_WO));
  scene_.SetPoses(frame.T_WO);
  TSDFPP_ASSIGN(RenderedImages images, renderer_->Render(frame.T_WC, options_.render_colour));
  frame.colour = std::move(images.colour);
  frame.depth = std::move(images.depth);
  frame.mask = std::move(images.mask);
  return frame;
}

Expected<std::unique_ptr<FrameSource>> OpenScene(const std::filesystem::path& toml,
                                                 const SimOptions& options) {
  TSDFPP_ASSIGN(const SceneConfig config, LoadSceneConfig(toml));
  TSDFPP_ASSIGN(std::unique_ptr<SimulatedSource> source, SimulatedSource::Open(config, options));
  return source;
}

}  // namespace tsdfpp
