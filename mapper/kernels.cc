#include "mapper/kernels.h"

namespace tsdfpp {

std::string_view KernelsName(Kernels kernels) {
  return kernels == Kernels::kSimd ? "simd" : "plain";
}

Expected<Kernels> KernelsFromName(std::string_view name) {
  if (name == "simd") return Kernels::kSimd;
  if (name == "plain") return Kernels::kPlain;
  return UsageError("kernels '{}' are unknown, expected simd or plain", name);
}

void UseKernels(Kernels kernels) { kernels_detail::used.store(kernels, std::memory_order_relaxed); }

}  // namespace tsdfpp
