#include "sim/render/renderer.h"

#include <array>
#include <chrono>
#include <opencv2/core/utility.hpp>
#include <vector>

#include "core/quiet_stderr.h"
#include "sim/render/sliver_pixels.h"
#include "sim/scene/mujoco_guard.h"

namespace tsdfpp {
namespace {

constexpr int kColourSamples = 4;

using Clock = std::chrono::steady_clock;

double MillisecondsSince(Clock::time_point start) {
  return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

// Binds the context to this thread for the length of a scope.
class BoundContext {
 public:
  explicit BoundContext(GlContext& gl) : gl_(gl), status_(gl.MakeCurrent()) {}
  ~BoundContext() {
    if (status_) gl_.Release();
  }
  BoundContext(const BoundContext&) = delete;
  BoundContext& operator=(const BoundContext&) = delete;
  const Expected<void>& status() const { return status_; }

 private:
  GlContext& gl_;
  Expected<void> status_;
};

void SetCamera(const Pose& T_WC, const Intrinsics& k, mjvGLCamera& camera) {
  const Eigen::Vector3f position = T_WC.translation().cast<float>();
  const Eigen::Vector3f forward = T_WC.linear().col(2).cast<float>();
  const Eigen::Vector3f up = (-T_WC.linear().col(1)).cast<float>();
  std::copy_n(position.data(), 3, camera.pos);
  std::copy_n(forward.data(), 3, camera.forward);
  std::copy_n(up.data(), 3, camera.up);
  // The image's border runs half a pixel outside the outermost centres, e.g. at u = -0.5.
  camera.frustum_center = static_cast<float>(kNear_m * ((k.width - 1) / 2.0 - k.cx) / k.fx);
  camera.frustum_width = static_cast<float>(kNear_m * k.width / 2.0 / k.fx);  // half of it
  camera.frustum_top = static_cast<float>(kNear_m * (k.cy + 0.5) / k.fy);
  camera.frustum_bottom = static_cast<float>(-kNear_m * (k.height - 0.5 - k.cy) / k.fy);
  camera.frustum_near = static_cast<float>(kNear_m);
  camera.frustum_far = static_cast<float>(kFar_m);
  camera.orthographic = 0;
}

// MuJoCo 3 draws with a reversed z-buffer, 1 at the near plane and 0 at the far one:
// d = n (f - z) / (z (f - n)).
float DepthFromBuffer(float d) {
  if (d <= 0.0F) return 0.0F;
  constexpr double kSpan = kFar_m - kNear_m;
  return static_cast<float>(kNear_m * kFar_m / (kNear_m + static_cast<double>(d) * kSpan));
}

}  // namespace

Renderer::Renderer(CompiledScene& scene, const Intrinsics& intrinsics, const RenderOptions& options,
                   std::unique_ptr<GlContext> gl)
    : scene_(scene), intrinsics_(intrinsics), options_(options), gl_(std::move(gl)) {
  mjv_defaultScene(&visible_);
  mjr_defaultContext(&id_context_);
  mjr_defaultContext(&colour_context_);
  // Each geom is drawn once; nothing decorative is.
  mjv_makeScene(scene.model(), &visible_, scene.model()->ngeom + 1);
}

Renderer::~Renderer() {
  const BoundContext bound(*gl_);
  if (bound.status()) {
    mjr_freeContext(&id_context_);
    mjr_freeContext(&colour_context_);
  }
  mjv_freeScene(&visible_);
}

Expected<std::unique_ptr<Renderer>> Renderer::Create(CompiledScene& scene,
                                                     const Intrinsics& intrinsics,
                                                     const RenderOptions& options) {
  InstallMujocoHandlers();
  TSDFPP_ASSIGN(std::unique_ptr<GlContext> gl, GlContext::Create());
  std::unique_ptr<Renderer> renderer(new Renderer(scene, intrinsics, options, std::move(gl)));
  TSDFPP_RETURN_IF_ERROR(renderer->MakeBuffers());
  return renderer;
}

Expected<void> Renderer::MakeBuffers() {
  const BoundContext bound(*gl_);
  TSDFPP_RETURN_IF_ERROR(bound.status());
  const int shadow_size = scene_.model()->vis.quality.shadowsize;
  TSDFPP_RETURN_IF_ERROR(MakeBuffer(id_context_, 0, 0));
  return MakeBuffer(colour_context_, options_.antialias ? kColourSamples : 0, shadow_size);
}

Expected<void> Renderer::MakeBuffer(mjrContext& context, int samples, int shadow_size) {
  // mjr_makeContext reads these from the model and from nowhere else.
  mjModel* model = scene_.model();
  const auto quality = model->vis.quality;
  model->vis.quality.offsamples = samples;
  model->vis.quality.shadowsize = shadow_size;
  const auto status = RunGuarded([&] {
    mjr_makeContext(model, &context, mjFONTSCALE_50);
    mjr_setBuffer(mjFB_OFFSCREEN, &context);
  });
  model->vis.quality = quality;
  TSDFPP_RETURN_IF_ERROR(status);
  if (context.currentBuffer != mjFB_OFFSCREEN || context.offWidth < intrinsics_.width ||
      context.offHeight < intrinsics_.height) {
    return EnvironmentError("{} gives an off-screen buffer of {}x{}, the image needs {}x{}",
                            gl_->info().renderer, context.offWidth, context.offHeight,
                            intrinsics_.width, intrinsics_.height);
  }
  // Asked for explicitly: the other mapping loses the precision of the reversed buffer.
  context.readDepthMap = mjDEPTH_ZEROFAR;
  return {};
}

Expected<void> Renderer::UpdateScene(const Pose& T_WC) {
  mjvOption option;
  mjv_defaultOption(&option);
  mjvCamera camera;
  mjv_defaultCamera(&camera);
  const auto status = RunGuarded([&] {
    mjv_updateScene(scene_.model(), scene_.data(), &option, nullptr, &camera,
                    mjCAT_STATIC | mjCAT_DYNAMIC, &visible_);
  });
  TSDFPP_RETURN_IF_ERROR(status);
  if (visible_.ngeom != scene_.model()->ngeom || visible_.status != 0) {
    // With no geom mjr_render would leave the last picture standing; with too many it drops some.
    return EnvironmentError("MuJoCo shows {} geoms of {}", visible_.ngeom, scene_.model()->ngeom);
  }
  for (mjvGLCamera& eye : visible_.camera) SetCamera(T_WC, intrinsics_, eye);
  for (const int off : {mjRND_REFLECTION, mjRND_SKYBOX, mjRND_FOG, mjRND_HAZE}) {
    visible_.flags[off] = 0;
  }
  return {};
}

Expected<void> Renderer::Draw(mjrContext& context, bool ids, unsigned char* rgb, float* depth) {
  const mjrRect viewport{0, 0, intrinsics_.width, intrinsics_.height};
  visible_.flags[mjRND_SEGMENT] = static_cast<mjtByte>(ids);
  visible_.flags[mjRND_IDCOLOR] = static_cast<mjtByte>(ids);
  visible_.flags[mjRND_SHADOW] = static_cast<mjtByte>(!ids);
  int gl_error = 0;
  // LLVM, which makes the code of a software renderer, says so itself where it finds no memory.
  const QuietStderr quiet;
  const auto start = Clock::now();
  TSDFPP_RETURN_IF_ERROR(RunGuarded([&] {
    mjr_setBuffer(mjFB_OFFSCREEN, &context);
    mjr_render(viewport, &visible_, &context);
  }));
  // Reading would wait for the same.
  gl_->Finish();
  (ids ? times_.geometry_ms : times_.colour_ms) += MillisecondsSince(start);
  const auto drawn = Clock::now();
  TSDFPP_RETURN_IF_ERROR(RunGuarded([&] {
    mjr_readPixels(rgb, depth, viewport, &context);
    gl_error = mjr_getError();
  }));
  times_.read_back_ms += MillisecondsSince(drawn);
  if (gl_error != 0) return EnvironmentError("OpenGL error {:#x} while rendering", gl_error);
  return {};
}

Expected<RenderedImages> Renderer::Render(const Pose& T_WC, bool with_colour) {
  const BoundContext bound(*gl_);
  TSDFPP_RETURN_IF_ERROR(bound.status());
  TSDFPP_RETURN_IF_ERROR(UpdateScene(T_WC));
  times_ = {};

  cv::Mat segment(intrinsics_.height, intrinsics_.width, CV_8UC3);
  cv::Mat buffer(intrinsics_.height, intrinsics_.width, CV_32FC1);
  TSDFPP_RETURN_IF_ERROR(Draw(id_context_, true, segment.data, buffer.ptr<float>()));

  // A drawn colour is segid + 1, and 0 where nothing was drawn.
  std::vector<InstanceId> instance(static_cast<std::size_t>(visible_.ngeom) + 1, kBackground);
  for (int i = 0; i < visible_.ngeom; ++i) {
    const mjvGeom& geom = visible_.geoms[i];
    instance.at(static_cast<std::size_t>(geom.segid) + 1) =
        scene_.geoms()[static_cast<std::size_t>(geom.objid)].id;
  }
  const auto read = Clock::now();
  RenderedImages images;
  images.depth.create(segment.size(), CV_32FC1);
  images.mask.create(segment.size(), CV_16UC1);
  for (int v = 0; v < segment.rows; ++v) {
    // OpenGL's rows run bottom-up.
    const auto* rgb = segment.ptr<unsigned char>(segment.rows - 1 - v);
    const auto* d = buffer.ptr<float>(segment.rows - 1 - v);
    auto* depth = images.depth.ptr<float>(v);
    auto* mask = images.mask.ptr<InstanceId>(v);
    for (int u = 0; u < segment.cols; ++u) {
      const std::size_t colour = rgb[3 * u] + 256U * rgb[3 * u + 1] + 65536U * rgb[3 * u + 2];
      if (colour >= instance.size()) {
        return EnvironmentError("{} drew an instance colour of {} where {} exist",
                                gl_->info().renderer, colour, instance.size() - 1);
      }
      mask[u] = instance[colour];
      depth[u] = DepthFromBuffer(d[u]);
    }
  }
  times_.convert_ms += MillisecondsSince(read);
  const auto converted = Clock::now();
  times_.mended_pixels = MendSliverPixels(scene_, intrinsics_, T_WC, images.depth, images.mask);
  times_.mend_ms = MillisecondsSince(converted);
  if (with_colour) {
    cv::Mat bottom_up(intrinsics_.height, intrinsics_.width, CV_8UC3);
    TSDFPP_RETURN_IF_ERROR(Draw(colour_context_, false, bottom_up.data, nullptr));
    const auto coloured = Clock::now();
    cv::flip(bottom_up, images.colour, 0);
    times_.convert_ms += MillisecondsSince(coloured);
  }
  return images;
}

}  // namespace tsdfpp
