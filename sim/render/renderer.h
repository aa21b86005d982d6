// Renders colour, depth and instance ids of one state of a compiled scene, off-screen.
#pragma once

#include <memory>
#include <opencv2/core.hpp>

#include "core/error.h"
#include "core/types.h"
#include "sim/render/gl_context.h"
#include "sim/scene/scene_builder.h"

namespace tsdfpp {

struct RenderedImages {
  cv::Mat colour;  // CV_8UC3, red-green-blue; empty where it was not asked for
  cv::Mat depth;   // CV_32FC1, metres along the optical axis; 0 where nothing was hit
  cv::Mat mask;    // CV_16UC1, instance ids; 0 also where nothing was hit
};

struct RenderOptions {
  // Of the colour image: four samples a pixel. Without it colours are jagged and come faster.
  bool antialias = true;
  bool operator==(const RenderOptions&) const = default;
};

// What the last Render() spent, milliseconds of wall clock.
struct RenderTimes {
  double geometry_ms = 0;   // depth and ids drawn
  double colour_ms = 0;     // colour and shadows drawn
  double read_back_ms = 0;  // both copied from GL
  double convert_ms = 0;    // to metres, instance ids, rows top-down
  double mend_ms = 0;       // pixels of slivers cast again (sliver_pixels.h)
  int mended_pixels = 0;
};

// Pixel centres are integers: pixel (u, v) shows the ray ((u - cx) / fx, (v - cy) / fy, 1).
// Depth and ids come from one pass without multisampling, which alone gives true depth; colour has
// a pass of its own with shadows and, unless told otherwise, four samples a pixel
// (docs/sources.md, "Depth of a pixel").
class Renderer {
 public:
  // Errors: those of GlContext::Create; kEnvironment where GL gives no off-screen buffer of the
  // image's size.
  static Expected<std::unique_ptr<Renderer>> Create(CompiledScene& scene,
                                                    const Intrinsics& intrinsics,
                                                    const RenderOptions& options = {});
  ~Renderer();
  Renderer(const Renderer&) = delete;
  Renderer& operator=(const Renderer&) = delete;

  // Renders the scene's present state (CompiledScene::SetPoses) seen from T_WC.
  // Errors: kEnvironment where MuJoCo or GL fails.
  Expected<RenderedImages> Render(const Pose& T_WC, bool with_colour);

  const GlInfo& gl_info() const { return gl_->info(); }
  const RenderTimes& times() const { return times_; }

 private:
  Renderer(CompiledScene& scene, const Intrinsics& intrinsics, const RenderOptions& options,
           std::unique_ptr<GlContext> gl);
  Expected<void> MakeBuffers();
  Expected<void> MakeBuffer(mjrContext& context, int samples, int shadow_size);
  Expected<void> UpdateScene(const Pose& T_WC);
  Expected<void> Draw(mjrContext& context, bool ids, unsigned char* rgb, float* depth);

  CompiledScene& scene_;
  Intrinsics intrinsics_;
  RenderOptions options_;
  RenderTimes times_;
  std::unique_ptr<GlContext> gl_;
  mjvScene visible_{};
  mjrContext id_context_{};
  mjrContext colour_context_{};
};

}  // namespace tsdfpp
