// What happens where the machine, or the user, has no OpenGL.
#include "sim/render/gl_context.h"

#include <GL/gl.h>
#include <dlfcn.h>
#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace tsdfpp {
namespace {

// Makes a context and leaves the process with the error's exit code and words.
[[noreturn]] void CreateAndExit() {
  const auto context = GlContext::Create();
  if (!context) {
    std::fprintf(stderr, "%s\n", context.error().message.c_str());
    std::exit(static_cast<int>(context.error().kind));
  }
  std::fprintf(stderr, "made %s\n", (*context)->info().backend.c_str());
  std::exit(0);
}

// Each death test starts this program anew, with the environment as it then is: no library is
// loaded.
class GlContextDeathTest : public testing::Test {
 protected:
  void SetUp() override { GTEST_FLAG_SET(death_test_style, "threadsafe"); }
  void TearDown() override {
    // Backwards: a variable may have been set twice.
    for (auto entry = before_.rbegin(); entry != before_.rend(); ++entry) {
      const auto& [name, value] = *entry;
      if (value) {
        setenv(name.c_str(), value->c_str(), 1);
      } else {
        unsetenv(name.c_str());
      }
    }
  }
  void Set(const std::string& name, const std::string& value) {
    const char* old = std::getenv(name.c_str());
    before_.emplace_back(name, old == nullptr ? std::nullopt : std::optional<std::string>(old));
    setenv(name.c_str(), value.c_str(), 1);
  }

 private:
  std::vector<std::pair<std::string, std::optional<std::string>>> before_;
};

TEST_F(GlContextDeathTest, EglGivesAContext) {
  Set("MUJOCO_GL", "egl");
  EXPECT_EXIT(CreateAndExit(), testing::ExitedWithCode(0), "made egl");
}

TEST_F(GlContextDeathTest, OsmesaGivesAContext) {
  Set("MUJOCO_GL", "osmesa");
  EXPECT_EXIT(CreateAndExit(), testing::ExitedWithCode(0), "made osmesa");
}

TEST_F(GlContextDeathTest, UnknownBackend) {
  Set("MUJOCO_GL", "vulkan");
  EXPECT_EXIT(CreateAndExit(), testing::ExitedWithCode(2),
              "MUJOCO_GL is 'vulkan', expected 'egl' or 'osmesa'");
}

TEST_F(GlContextDeathTest, WrongDevice) {
  Set("MUJOCO_GL", "egl");
  Set("MUJOCO_EGL_DEVICE_ID", "first");
  EXPECT_EXIT(CreateAndExit(), testing::ExitedWithCode(2),
              "MUJOCO_EGL_DEVICE_ID is 'first', expected a device number from 0");
  Set("MUJOCO_EGL_DEVICE_ID", "31");
  EXPECT_EXIT(CreateAndExit(), testing::ExitedWithCode(2),
              "MUJOCO_EGL_DEVICE_ID is 31, but EGL has");
}

// A machine without the library: the loader finds a file of that name that is no library.
TEST_F(GlContextDeathTest, LibraryThatCannotBeLoaded) {
  const auto folder = std::filesystem::path(testing::TempDir()) / "tsdfpp_no_gl";
  std::filesystem::create_directories(folder);
  for (const char* name : {"libEGL.so.1", "libOSMesa.so.8"}) {
    std::ofstream(folder / name) << std::string(4096, 'x');
  }
  Set("LD_LIBRARY_PATH", folder.string());
  Set("MUJOCO_GL", "egl");
  EXPECT_EXIT(
      CreateAndExit(), testing::ExitedWithCode(3),
      "no OpenGL for off-screen rendering: libEGL.so.1 cannot be loaded .*; install libegl1 "
      "and libegl-mesa0, or set MUJOCO_GL=osmesa");
  Set("MUJOCO_GL", "osmesa");
  EXPECT_EXIT(CreateAndExit(), testing::ExitedWithCode(3),
              "libOSMesa.so.8 cannot be loaded .*; install libosmesa6, or set MUJOCO_GL=egl");
}

[[noreturn]] void ChangeBackendAndExit() {
  setenv("MUJOCO_GL", "osmesa", 1);
  const auto first = GlContext::Create();
  if (!first) std::exit(1);
  setenv("MUJOCO_GL", "egl", 1);
  CreateAndExit();
}

TEST_F(GlContextDeathTest, AProcessUsesOneLibrary) {
  EXPECT_EXIT(ChangeBackendAndExit(), testing::ExitedWithCode(2),
              "MUJOCO_GL changed to 'egl' after 'osmesa' was loaded: a process can use one");
}

TEST(GlContext, TellsWhatItIs) {
  const auto context = GlContext::Create();
  ASSERT_TRUE(context.has_value()) << context.error().message;
  EXPECT_FALSE((*context)->info().renderer.empty());
  // MuJoCo's lights are of the compatibility profile; the core profile knows none. (The version's
  // text names the profile in Mesa alone.)
  using GetFunction = void (*)();
  using Loader = GetFunction (*)(const char*);
  auto load = reinterpret_cast<Loader>(dlsym(RTLD_DEFAULT, "eglGetProcAddress"));
  if (load == nullptr) load = reinterpret_cast<Loader>(dlsym(RTLD_DEFAULT, "OSMesaGetProcAddress"));
  ASSERT_NE(load, nullptr);
  const auto get_integer = reinterpret_cast<void (*)(GLenum, GLint*)>(load("glGetIntegerv"));
  ASSERT_NE(get_integer, nullptr);
  ASSERT_TRUE((*context)->MakeCurrent().has_value());
  GLint lights = 0;
  get_integer(GL_MAX_LIGHTS, &lights);
  EXPECT_GE(lights, 8) << (*context)->info().version;
}

}  // namespace
}  // namespace tsdfpp
