#include <nlohmann/json.hpp>

#include "core/folders.h"
#include "core/json_text.h"
#include "sequence/cofusion_layout.h"
#include "sequence/dataset_readers.h"
#include "sequence/image_files.h"
#include "sequence/pose_matrix.h"
#include "sequence/text_lines.h"

namespace tsdfpp {
namespace fs = std::filesystem;
namespace {

struct ReplicaCamera {
  Intrinsics camera;
  double units_per_m = 0;
};

Expected<ReplicaCamera> ReadCameraJson(const fs::path& path) {
  TSDFPP_ASSIGN(const nlohmann::json json, ReadJsonObject(path));
  try {
    const auto& camera = json.contains("camera") ? json.at("camera") : json;
    const auto side = [&](const char* key) {
      constexpr int kMostSide = 1 << 20;  // beyond any image
      return static_cast<int>(WholeIn(camera.at(key), 1, kMostSide).value_or(0));
    };
    const ReplicaCamera read{
        {side("w"), side("h"), camera.at("fx").get<double>(), camera.at("fy").get<double>(),
         camera.at("cx").get<double>(), camera.at("cy").get<double>()},
        camera.at("scale").get<double>()};
    if (!(read.units_per_m > 0) || read.camera.width <= 0 || read.camera.height <= 0) {
      return DataError("{}: w, h and scale must be over 0, w and h whole numbers", path.string());
    }
    return read;
  } catch (const nlohmann::json::exception&) {
    return DataError("{}: expected numbers w h fx fy cx cy scale", path.string());
  }
}

}  // namespace

Expected<std::unique_ptr<DatasetSource>> OpenReplica(const fs::path& folder,
                                                     const SequenceOptions& options,
                                                     SequenceNotes& notes) {
  if (options.fixed_camera) {
    return FixedCameraWithPoses(folder);
  }
  std::error_code code;
  fs::path params = folder / "cam_params.json";
  if (!fs::exists(params, code)) {
    params = AbsolutePath(folder / "").lexically_normal().parent_path().parent_path() /
             "cam_params.json";
  }
  ReplicaCamera camera;
  if (fs::exists(params, code) || !options.intrinsics || !options.depth_units_per_m) {
    TSDFPP_ASSIGN(camera, ReadCameraJson(params));
  }
  FileSequence sequence;
  sequence.format = DatasetFormat::kReplica;
  sequence.name = NameOfFolder(folder);
  sequence.size_source = params.filename().string();
  sequence.rate_hz = kUsualRate_hz;

  const fs::path trajectory = folder / "traj.txt";
  TSDFPP_ASSIGN(const std::vector<TextLine> lines, ReadTextLines(trajectory));
  TSDFPP_ASSIGN(const auto names, NamesIn(folder / "results"));
  for (const std::string& name : names) {
    const auto number = cofusion::NumberOf(name, "depth", ".png");
    if (!number) continue;
    if (static_cast<std::size_t>(*number) >= lines.size()) {
      return DataError("{}: {} poses, none for {}", trajectory.string(), lines.size(), name);
    }
    const TextLine& line = lines[static_cast<std::size_t>(*number)];
    const std::string where = fmt::format("{}:{}", trajectory.string(), line.number);
    std::vector<double> numbers;
    for (const std::string& word : line.words) {
      const auto value = ParseNumber(word);
      if (!value) return DataError("{}: '{}' is not a number", where, word);
      numbers.push_back(*value);
    }
    FrameFiles frame;
    frame.number = *number;
    frame.time_s = *number / kUsualRate_hz;
    frame.depth = folder / "results" / name;
    const std::string stem = fmt::format("frame{:06d}", *number);
    TSDFPP_ASSIGN(frame.colour, OnlyOneOf(folder / "results" / (stem + ".jpg"),
                                          folder / "results" / (stem + ".png")));
    frame.camera = camera.camera;
    frame.depth_units_per_m = camera.units_per_m;
    TSDFPP_ASSIGN(frame.T_WC, PoseFromNumbers(numbers, where));
    sequence.frames.push_back(std::move(frame));
  }
  if (sequence.frames.empty()) {
    return DataError("{}: no image named depth000000.png or so", (folder / "results").string());
  }
  if (sequence.frames.size() != lines.size()) {
    return DataError("{}: {} poses, but {} depth images in results/", trajectory.string(),
                     lines.size(), sequence.frames.size());
  }
  return MakeFileSource(std::move(sequence), options, notes);
}

}  // namespace tsdfpp
