// Makes one frame of one cell of an experiment again, from what its results say.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "eval/sweep/cell.h"

namespace tsdfpp {

struct ReplayOptions {
  std::filesystem::path result;  // an experiment's folder or its results.json
  std::string cell;              // an id, or the beginning of one
  int frame = 0;
  std::filesystem::path out;
  std::function<void(int done, int total)> progress;
};

struct ReplayResult {
  CellSettings settings;
  std::string cell;
  int frames = 0;  // that were mapped
  // The frame's images and poses, and the map's visible scene at the last evaluated frame up to it
  // (none: nothing was evaluated yet), are those of the original run.
  std::optional<int> compared_map_frame;
  std::string image_digest;
  std::string map_digest;          // of the visible scene at the frame itself
  std::vector<std::string> files;  // below `out`, without run.json
};

// Maps the sequence up to the frame and writes below `out`: camera/colour.png, depth.exr (metres)
// and mask.png (16 bits) as the mapper got them; views/ (eval/picture/map_views.h) with two
// surfaces along each ray; slice.png, slice-distance.exr and slice-id.png
// (eval/picture/map_slice.h), through the first removed object or, without one, the point that the
// camera looks at; scene.ply; replay.json. Of Open3D's map, which has no lists, no views and no
// slice. The same cell and frame give the same bytes. All of it is one run (eval/run/run_folder.h),
// which takes an earlier one's place. Errors: kUsage where the results have no such cell or the
// cell no such frame; kData where results are unusable, or where what was made again is not what
// the original run had: this program or this machine's renderer differs, which the sentence says:
// nothing is written then; those of RunFolder.
Expected<ReplayResult> Replay(const ReplayOptions& options);

}  // namespace tsdfpp
