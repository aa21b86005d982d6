// A headless OpenGL context for MuJoCo, from EGL or OSMesa.
//
// Exactly one of the two libraries is loaded, at run time: MuJoCo's loader takes eglGetProcAddress
// before OSMesaGetProcAddress, so a process that has both can use EGL only (docs/sources.md,
// "OpenGL contexts").
#pragma once

#include <memory>
#include <string>

#include "core/error.h"

namespace tsdfpp {

enum class GlBackend { kEgl, kOsmesa };

// For `tsdfpp doctor` and sequence.json.
struct GlInfo {
  std::string backend;   // "egl" or "osmesa"
  std::string platform;  // how EGL found it: "device 0", "surfaceless"; empty for OSMesa
  std::string renderer;  // GL_RENDERER
  std::string version;   // GL_VERSION
};

// What the environment asks for: MUJOCO_GL = egl (also when unset or empty) or osmesa.
// Error kUsage for any other value.
Expected<GlBackend> GlBackendFromEnvironment();

class GlContext {
 public:
  // Loads the library that MUJOCO_GL asks for and makes a context (desktop GL, compatibility
  // profile, no surface). EGL tries every device (or MUJOCO_EGL_DEVICE_ID alone), then Mesa's
  // surfaceless platform. Errors: kUsage where an environment variable is wrong or the process has
  // loaded the other library already; kEnvironment where nothing works, with what was tried and
  // what to install.
  static Expected<std::unique_ptr<GlContext>> Create();

  virtual ~GlContext() = default;
  GlContext(const GlContext&) = delete;
  GlContext& operator=(const GlContext&) = delete;

  const GlInfo& info() const { return info_; }

  // Binds the context to the calling thread, or unbinds it, so that threads may take turns.
  // Error kEnvironment where another thread holds it.
  virtual Expected<void> MakeCurrent() = 0;
  virtual void Release() = 0;
  // Waits until everything that was drawn is there (glFinish), for measurements. Bound contexts
  // only.
  void Finish() const {
    if (finish_ != nullptr) finish_();
  }

 protected:
  GlContext() = default;
  GlInfo info_;
  void (*finish_)() = nullptr;
};

}  // namespace tsdfpp
