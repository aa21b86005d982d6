#include "sim/scene/mujoco_guard.h"

#include <mujoco/mujoco.h>
#include <spdlog/spdlog.h>

#include <csetjmp>
#include <cstdio>
#include <cstdlib>
#include <mutex>

#include "core/address_space.h"

namespace tsdfpp {
namespace {

struct Guard {
  bool active = false;
  std::jmp_buf back{};
  char message[512] = {};
};

thread_local Guard guard;

[[noreturn]] void OnError(const char* message) {
  if (guard.active) {
    std::snprintf(guard.message, sizeof(guard.message), "%s", message);
    std::longjmp(guard.back, 1);
  }
  // Without memory the last words are said elsewhere (core/last_words.h).
  if (!IsOutOfAddressSpace()) std::fprintf(stderr, "MuJoCo error: %s\n", message);
  std::abort();
}

void OnWarning(const char* message) { spdlog::warn("MuJoCo: {}", message); }

}  // namespace

void InstallMujocoHandlers() {
  static std::once_flag once;
  std::call_once(once, [] {
    mju_user_error = OnError;
    mju_user_warning = OnWarning;
  });
}

Expected<void> RunGuarded(void (*function)(void*), void* argument) {
  InstallMujocoHandlers();
  guard.active = true;
  if (setjmp(guard.back) == 0) {
    function(argument);
    guard.active = false;
    return {};
  }
  guard.active = false;
  return EnvironmentError("MuJoCo failed: {}", guard.message);
}

}  // namespace tsdfpp
