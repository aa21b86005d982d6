// What side-by-side measures on, shared by it and Open3D's process.
#pragma once

#include <string>
#include <vector>

#include "core/error.h"
#include "core/frame_source.h"

namespace tsdfpp {

// Frames are made, then mapped in a row: a map that takes turns with others, or with the renderer,
// at each frame pays for what they leave in the caches, which a mapper on a robot does not.
inline constexpr int kFramesInARow = 8;

struct SideBySideCase {
  std::string name;
  std::string title;
  double voxel_m = 0;
  double truncation_voxels = 0;  // in front and behind, of all maps
  bool one_object = false;       // the first object's pixels alone
};

// "1cm" (band of 10 voxels), "5mm" (6 voxels), "2mm" (6 voxels, the first object alone).
const std::vector<SideBySideCase>& SideBySideCases();

// Those of these names. kUsage for a name that there is not.
Expected<std::vector<SideBySideCase>> CasesNamed(const std::vector<std::string>& names);

// From frame `first` on, as many as are mapped in a row, before `last`. Errors: the source's.
Expected<std::vector<Frame>> ReadFramesInARow(FrameSource& source, const SideBySideCase& of,
                                              int first, int last);

}  // namespace tsdfpp
