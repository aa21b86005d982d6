// Turns MuJoCo's fatal errors into values. Left alone, mju_error prints "Press Enter to exit",
// waits for input and writes MUJOCO_LOG.TXT (docs/sources.md, "Fatal errors").
#pragma once

#include <type_traits>

#include "core/error.h"

namespace tsdfpp {

// Installs mju_user_error and mju_user_warning, once a process. A warning is logged; an error
// outside RunGuarded is printed and aborts.
void InstallMujocoHandlers();

// Runs function(argument). Error kEnvironment, with MuJoCo's words, where MuJoCo raised a fatal
// error: then the call was left in the middle and what it worked on must not be used again.
Expected<void> RunGuarded(void (*function)(void*), void* argument);

// The same for a callable. It must own nothing that needs a destructor: an error jumps out of it.
template <typename Callable>
Expected<void> RunGuarded(Callable&& callable) {
  using Type = std::remove_reference_t<Callable>;
  return RunGuarded([](void* argument) { (*static_cast<Type*>(argument))(); }, &callable);
}

}  // namespace tsdfpp
