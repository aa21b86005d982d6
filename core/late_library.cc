#include "core/late_library.h"

#include <dlfcn.h>

#include "core/address_space.h"

namespace tsdfpp {
namespace {

tl::unexpected<Error> Cannot(const char* library) {
  const char* why = dlerror();
  if (IsOutOfAddressSpace()) {
    return EnvironmentError("out of memory, so '{}' cannot be loaded", library);
  }
  return EnvironmentError("'{}' cannot be loaded: {}", library, why == nullptr ? "unknown" : why);
}

}  // namespace

Expected<void*> LateFunction(const char* library, const char* function) {
  void* loaded = dlopen(library, RTLD_LAZY | RTLD_LOCAL);
  if (loaded == nullptr) return Cannot(library);
  void* address = dlsym(loaded, function);
  if (address == nullptr) return Cannot(library);
  return address;
}

}  // namespace tsdfpp
