// Which versions of the mapper's inner loops run. Those named *_simd.cc work on vectors; beside
// each lies a *_plain.cc, which does the same voxel by voxel, pixel by pixel or ray by ray, in the
// words of docs/map.md or docs/segmentation.md: it is the specification. Both give the same bytes.
#pragma once

#include <atomic>
#include <string_view>

#include "core/error.h"

namespace tsdfpp {

enum class Kernels { kSimd, kPlain };

// "simd", "plain".
std::string_view KernelsName(Kernels kernels);
// Errors: kUsage.
Expected<Kernels> KernelsFromName(std::string_view name);

// Of this process, and of those that it forks later; vectors by default. Not to be called while
// something is mapped: a call of a kernel that has begun goes on as it began.
void UseKernels(Kernels kernels);

namespace kernels_detail {
inline std::atomic<Kernels> used{Kernels::kSimd};
}  // namespace kernels_detail

inline Kernels UsedKernels() { return kernels_detail::used.load(std::memory_order_relaxed); }
inline bool UsesPlainKernels() { return UsedKernels() == Kernels::kPlain; }

}  // namespace tsdfpp
