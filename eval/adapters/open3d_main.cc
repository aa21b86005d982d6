// tsdfpp_open3d scalable|voxelblockgrid SEQUENCE OUT FRAMES VOXEL TRUNCATION: Open3D's volumes as
// adapters (docs/adapters.md), in a process of their own since they may abort or hang.
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>
#include <string>

#include "core/files.h"
#include "core/guard.h"
#include "core/json_text.h"
#include "core/ply.h"
#include "eval/adapters/open3d_peer.h"
#include "eval/adapters/voxel_block_grid.h"
#include "sequence/cofusion_reader.h"

namespace tsdfpp {
namespace {

constexpr int kBlockSide = 16;  // of VoxelBlockGrid, its default

struct Arguments {
  std::string method;
  std::filesystem::path sequence;
  std::filesystem::path out;
  std::set<int> frames;
  double voxel_m = 0;
  double truncation_m = 0;
};

Expected<Arguments> Parse(int argc, char** argv) {
  constexpr int kWords = 7;
  if (argc != kWords) {
    return UsageError("expected METHOD SEQUENCE OUT FRAMES VOXEL TRUNCATION, found {} words",
                      argc - 1);
  }
  Arguments arguments{argv[1], argv[2], argv[3], {}, std::atof(argv[5]), std::atof(argv[6])};
  if (arguments.method != "scalable" && arguments.method != "voxelblockgrid") {
    return UsageError("method is '{}', expected scalable or voxelblockgrid", arguments.method);
  }
  std::istringstream words(argv[4]);
  for (std::string word; std::getline(words, word, ',');) {
    arguments.frames.insert(std::atoi(word.c_str()));
  }
  if (arguments.frames.empty() || !(arguments.voxel_m > 0) || !(arguments.truncation_m > 0)) {
    return UsageError(
        "FRAMES '{}', VOXEL '{}', TRUNCATION '{}': expected frames by commas and "
        "lengths above 0",
        argv[4], argv[5], argv[6]);
  }
  return arguments;
}

Expected<void> Map(const Arguments& arguments) {
  TSDFPP_ASSIGN(auto source, OpenCofusion(arguments.sequence));
  std::unique_ptr<Open3dVolume> scalable;
  std::unique_ptr<VoxelBlockGridPeer> grid;
  if (arguments.method == "scalable") {
    scalable = std::make_unique<Open3dVolume>(arguments.voxel_m, arguments.truncation_m);
  } else {
    grid =
        std::make_unique<VoxelBlockGridPeer>(arguments.voxel_m, arguments.truncation_m, kBlockSide);
  }
  nlohmann::json timing{{"frame_ms", nlohmann::json::array()}};
  const int first = source->info().first_index;
  for (int index = first; index < first + source->info().frame_count; ++index) {
    TSDFPP_ASSIGN(const Frame frame, source->Read(index));
    const auto start = std::chrono::steady_clock::now();
    if (scalable) {
      scalable->Integrate(frame);
    } else {
      grid->Integrate(frame);
    }
    timing["frame_ms"].push_back(
        std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start)
            .count());
    if (!arguments.frames.contains(index)) continue;
    TSDFPP_RETURN_IF_ERROR(
        WritePly(arguments.out / "meshes" / fmt::format("{:06d}", index) / "scene.ply",
                 scalable ? scalable->Triangles() : grid->Triangles()));
  }
  return WriteFile(arguments.out / "timing.json", JsonText(timing) + "\n");
}

int Run(int argc, char** argv) {
  const auto arguments = Parse(argc, argv);
  const Expected<void> done = arguments ? Map(*arguments) : tl::unexpected(arguments.error());
  if (done) return 0;
  PrintError("tsdfpp_open3d", done.error().message);
  return static_cast<int>(done.error().kind);
}

}  // namespace
}  // namespace tsdfpp

int main(int argc, char** argv) {
  return tsdfpp::GuardedMain("tsdfpp_open3d", [&] { return tsdfpp::Run(argc, argv); });
}
