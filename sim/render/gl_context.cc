#include "sim/render/gl_context.h"

#define EGL_NO_X11  // headers only for types and numbers: nothing is linked
#define MESA_EGL_NO_X11_HEADERS
#include <EGL/egl.h>
#include <EGL/eglext.h>
#include <GL/osmesa.h>
#include <dlfcn.h>

#include <array>
#include <charconv>
#include <cstdlib>
#include <mutex>
#include <optional>
#include <string_view>
#include <vector>

namespace tsdfpp {
namespace {

constexpr const char* kEglLibrary = "libEGL.so.1";
constexpr const char* kOsmesaLibrary = "libOSMesa.so.8";

std::string Variable(const char* name) {
  const char* value = std::getenv(name);
  return value == nullptr ? "" : value;
}

// Loads the backend's library, once a process, and refuses the other one afterwards.
Expected<void*> LoadLibraryOnce(GlBackend backend) {
  static std::mutex mutex;
  static void* library = nullptr;
  static GlBackend loaded = GlBackend::kEgl;
  const std::lock_guard lock(mutex);
  if (library != nullptr) {
    if (loaded != backend) {
      return UsageError("MUJOCO_GL changed to '{}' after '{}' was loaded: a process can use one",
                        Variable("MUJOCO_GL"), loaded == GlBackend::kEgl ? "egl" : "osmesa");
    }
    return library;
  }
  const bool is_egl = backend == GlBackend::kEgl;
  // Global, because MuJoCo looks the functions up by name in the process.
  library = dlopen(is_egl ? kEglLibrary : kOsmesaLibrary, RTLD_NOW | RTLD_GLOBAL);
  if (library == nullptr) {
    return EnvironmentError(
        "no OpenGL for off-screen rendering: {} cannot be loaded ({}); install {}, or set "
        "MUJOCO_GL={}",
        is_egl ? kEglLibrary : kOsmesaLibrary, dlerror(),
        is_egl ? "libegl1 and libegl-mesa0" : "libosmesa6", is_egl ? "osmesa" : "egl");
  }
  loaded = backend;
  return library;
}

template <typename Function>
Function Symbol(void* library, const char* name) {
  return reinterpret_cast<Function>(dlsym(library, name));
}

using GetStringFunction = const GLubyte* (*)(GLenum);

void FillInfo(GetStringFunction get_string, GlInfo& info) {
  const auto text = [&](GLenum name) {
    const GLubyte* bytes = get_string == nullptr ? nullptr : get_string(name);
    return bytes == nullptr ? std::string("unknown") : reinterpret_cast<const char*>(bytes);
  };
  info.renderer = text(GL_RENDERER);
  info.version = text(GL_VERSION);
}

// ------------------------------------------------------------------------------------------- EGL

struct Egl {
  PFNEGLGETPROCADDRESSPROC get_proc_address = nullptr;
  PFNEGLINITIALIZEPROC initialize = nullptr;
  PFNEGLCHOOSECONFIGPROC choose_config = nullptr;
  PFNEGLBINDAPIPROC bind_api = nullptr;
  PFNEGLCREATECONTEXTPROC create_context = nullptr;
  PFNEGLDESTROYCONTEXTPROC destroy_context = nullptr;
  PFNEGLMAKECURRENTPROC make_current = nullptr;
  PFNEGLGETERRORPROC get_error = nullptr;
  PFNEGLGETPLATFORMDISPLAYEXTPROC get_platform_display = nullptr;
  PFNEGLQUERYDEVICESEXTPROC query_devices = nullptr;  // null where the extension is absent

  bool Load(void* library) {
    get_proc_address = Symbol<PFNEGLGETPROCADDRESSPROC>(library, "eglGetProcAddress");
    initialize = Symbol<PFNEGLINITIALIZEPROC>(library, "eglInitialize");
    choose_config = Symbol<PFNEGLCHOOSECONFIGPROC>(library, "eglChooseConfig");
    bind_api = Symbol<PFNEGLBINDAPIPROC>(library, "eglBindAPI");
    create_context = Symbol<PFNEGLCREATECONTEXTPROC>(library, "eglCreateContext");
    destroy_context = Symbol<PFNEGLDESTROYCONTEXTPROC>(library, "eglDestroyContext");
    make_current = Symbol<PFNEGLMAKECURRENTPROC>(library, "eglMakeCurrent");
    get_error = Symbol<PFNEGLGETERRORPROC>(library, "eglGetError");
    if (get_proc_address == nullptr || initialize == nullptr || choose_config == nullptr ||
        bind_api == nullptr || create_context == nullptr || destroy_context == nullptr ||
        make_current == nullptr || get_error == nullptr) {
      return false;
    }
    get_platform_display = reinterpret_cast<PFNEGLGETPLATFORMDISPLAYEXTPROC>(
        get_proc_address("eglGetPlatformDisplayEXT"));
    query_devices =
        reinterpret_cast<PFNEGLQUERYDEVICESEXTPROC>(get_proc_address("eglQueryDevicesEXT"));
    return get_platform_display != nullptr;
  }
};

class EglContext final : public GlContext {
 public:
  EglContext(const Egl& egl, EGLDisplay display, EGLContext context, std::string platform)
      : egl_(egl), display_(display), context_(context) {
    info_.backend = "egl";
    info_.platform = std::move(platform);
  }
  ~EglContext() override {
    Release();
    // The display stays: eglTerminate would end every other context of the process.
    egl_.destroy_context(display_, context_);
  }
  EglContext(const EglContext&) = delete;
  EglContext& operator=(const EglContext&) = delete;

  Expected<void> MakeCurrent() override {
    // The bound API is a thread's own state.
    egl_.bind_api(EGL_OPENGL_API);
    if (egl_.make_current(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, context_) != EGL_TRUE) {
      return EnvironmentError("eglMakeCurrent failed on {} (EGL error {:#x})", info_.platform,
                              egl_.get_error());
    }
    if (info_.renderer.empty()) {
      FillInfo(reinterpret_cast<GetStringFunction>(egl_.get_proc_address("glGetString")), info_);
      finish_ = reinterpret_cast<void (*)()>(egl_.get_proc_address("glFinish"));
    }
    return {};
  }
  void Release() override {
    egl_.make_current(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
  }

 private:
  Egl egl_;
  EGLDisplay display_;
  EGLContext context_;
};

// One way to a display: a context on it, or why not (without a subject).
tl::expected<std::unique_ptr<GlContext>, std::string> TryEglDisplay(const Egl& egl,
                                                                    EGLenum platform, void* native,
                                                                    const std::string& name) {
  const auto fault = [&](const char* what) {
    return tl::unexpected(fmt::format("{}: {} failed ({:#x})", name, what, egl.get_error()));
  };
  EGLDisplay display = egl.get_platform_display(platform, native, nullptr);
  if (display == EGL_NO_DISPLAY) return fault("eglGetPlatformDisplay");
  if (egl.initialize(display, nullptr, nullptr) != EGL_TRUE) return fault("eglInitialize");
  if (egl.bind_api(EGL_OPENGL_API) != EGL_TRUE) return fault("eglBindAPI(OpenGL)");
  constexpr std::array<EGLint, 7> kConfig{EGL_SURFACE_TYPE, EGL_PBUFFER_BIT, EGL_RENDERABLE_TYPE,
                                          EGL_OPENGL_BIT,   EGL_RED_SIZE,    8,
                                          EGL_NONE};
  EGLConfig config = nullptr;
  EGLint count = 0;
  if (egl.choose_config(display, kConfig.data(), &config, 1, &count) != EGL_TRUE || count < 1) {
    return fault("eglChooseConfig");
  }
  EGLContext context = egl.create_context(display, config, EGL_NO_CONTEXT, nullptr);
  if (context == EGL_NO_CONTEXT) return fault("eglCreateContext");
  auto made = std::make_unique<EglContext>(egl, display, context, name);
  if (auto current = made->MakeCurrent(); !current) {
    return tl::unexpected(current.error().message);
  }
  made->Release();
  return made;
}

Expected<std::optional<int>> EglDeviceFromEnvironment() {
  const std::string text = Variable("MUJOCO_EGL_DEVICE_ID");
  if (text.empty()) return std::nullopt;
  int device = -1;
  const auto [end, status] = std::from_chars(text.data(), text.data() + text.size(), device);
  if (status != std::errc() || end != text.data() + text.size() || device < 0) {
    return UsageError("MUJOCO_EGL_DEVICE_ID is '{}', expected a device number from 0", text);
  }
  return device;
}

Expected<std::unique_ptr<GlContext>> CreateEgl(void* library) {
  TSDFPP_ASSIGN(const std::optional<int> wanted, EglDeviceFromEnvironment());
  Egl egl;
  if (!egl.Load(library)) {
    return EnvironmentError(
        "{} lacks functions of EGL 1.4 or EGL_EXT_platform_base; install "
        "libegl1 and libegl-mesa0, or set MUJOCO_GL=osmesa",
        kEglLibrary);
  }
  constexpr EGLint kMaxDevices = 32;
  std::array<EGLDeviceEXT, kMaxDevices> devices{};
  EGLint count = 0;
  if (egl.query_devices == nullptr ||
      egl.query_devices(kMaxDevices, devices.data(), &count) != EGL_TRUE) {
    count = 0;
  }
  if (wanted && *wanted >= count) {
    return UsageError("MUJOCO_EGL_DEVICE_ID is {}, but EGL has {} device(s), numbered from 0",
                      *wanted, count);
  }
  std::vector<std::string> faults;
  for (int i = 0; i < count; ++i) {
    if (wanted && *wanted != i) continue;
    auto context =
        TryEglDisplay(egl, EGL_PLATFORM_DEVICE_EXT, devices[i], fmt::format("device {}", i));
    if (context) return std::move(*context);
    faults.push_back(context.error());
  }
  if (!wanted) {
    auto context = TryEglDisplay(egl, EGL_PLATFORM_SURFACELESS_MESA,
                                 reinterpret_cast<void*>(EGL_DEFAULT_DISPLAY), "surfaceless");
    if (context) return std::move(*context);
    faults.push_back(context.error());
  }
  return EnvironmentError(
      "no OpenGL for off-screen rendering: EGL was loaded, but {}; install libegl-mesa0 and "
      "libgl1-mesa-dri, or set MUJOCO_GL=osmesa",
      fmt::join(faults, ", "));
}

// ---------------------------------------------------------------------------------------- OSMesa

struct Osmesa {
  decltype(&OSMesaCreateContextExt) create_context = nullptr;
  decltype(&OSMesaMakeCurrent) make_current = nullptr;
  decltype(&OSMesaDestroyContext) destroy_context = nullptr;
  decltype(&OSMesaGetProcAddress) get_proc_address = nullptr;

  bool Load(void* library) {
    create_context = Symbol<decltype(&OSMesaCreateContextExt)>(library, "OSMesaCreateContextExt");
    make_current = Symbol<decltype(&OSMesaMakeCurrent)>(library, "OSMesaMakeCurrent");
    destroy_context = Symbol<decltype(&OSMesaDestroyContext)>(library, "OSMesaDestroyContext");
    get_proc_address = Symbol<decltype(&OSMesaGetProcAddress)>(library, "OSMesaGetProcAddress");
    return create_context != nullptr && make_current != nullptr && destroy_context != nullptr &&
           get_proc_address != nullptr;
  }
};

class OsmesaGlContext final : public GlContext {
 public:
  OsmesaGlContext(const Osmesa& osmesa, OSMesaContext context)
      : osmesa_(osmesa), context_(context), buffer_(kSide * kSide * 4) {
    info_.backend = "osmesa";
  }
  ~OsmesaGlContext() override {
    Release();
    osmesa_.destroy_context(context_);
  }
  OsmesaGlContext(const OsmesaGlContext&) = delete;
  OsmesaGlContext& operator=(const OsmesaGlContext&) = delete;

  Expected<void> MakeCurrent() override {
    if (osmesa_.make_current(context_, buffer_.data(), GL_UNSIGNED_BYTE, kSide, kSide) != GL_TRUE) {
      return EnvironmentError("OSMesaMakeCurrent failed");
    }
    if (info_.renderer.empty()) {
      FillInfo(reinterpret_cast<GetStringFunction>(osmesa_.get_proc_address("glGetString")), info_);
      finish_ = reinterpret_cast<void (*)()>(osmesa_.get_proc_address("glFinish"));
    }
    return {};
  }
  void Release() override { osmesa_.make_current(nullptr, nullptr, 0, 0, 0); }

 private:
  // The window that OSMesa insists on; MuJoCo draws into buffers of its own.
  static constexpr int kSide = 16;

  Osmesa osmesa_;
  OSMesaContext context_;
  std::vector<unsigned char> buffer_;
};

Expected<std::unique_ptr<GlContext>> CreateOsmesa(void* library) {
  constexpr const char* kAdvice = "install libosmesa6, or set MUJOCO_GL=egl";
  Osmesa osmesa;
  if (!osmesa.Load(library)) {
    return EnvironmentError("{} lacks OSMesa's functions; {}", kOsmesaLibrary, kAdvice);
  }
  constexpr int kDepthBits = 24;
  constexpr int kStencilBits = 8;
  OSMesaContext context = osmesa.create_context(OSMESA_RGBA, kDepthBits, kStencilBits, 0, nullptr);
  if (context == nullptr) {
    return EnvironmentError("no OpenGL for off-screen rendering: OSMesaCreateContextExt failed; {}",
                            kAdvice);
  }
  auto made = std::make_unique<OsmesaGlContext>(osmesa, context);
  TSDFPP_RETURN_IF_ERROR(made->MakeCurrent());
  made->Release();
  return made;
}

}  // namespace

Expected<GlBackend> GlBackendFromEnvironment() {
  const std::string text = Variable("MUJOCO_GL");
  if (text.empty() || text == "egl") return GlBackend::kEgl;
  if (text == "osmesa") return GlBackend::kOsmesa;
  return UsageError("MUJOCO_GL is '{}', expected 'egl' or 'osmesa'", text);
}

Expected<std::unique_ptr<GlContext>> GlContext::Create() {
  TSDFPP_ASSIGN(const GlBackend backend, GlBackendFromEnvironment());
  TSDFPP_ASSIGN(void* library, LoadLibraryOnce(backend));
  return backend == GlBackend::kEgl ? CreateEgl(library) : CreateOsmesa(library);
}

}  // namespace tsdfpp
