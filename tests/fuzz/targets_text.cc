// The doors that others use: text as JSON and TOML, the headers of images, poses as text.
#include <nlohmann/json.hpp>

#include "core/decode_image.h"
#include "core/json_text.h"
#include "core/pose_text.h"
#include "core/toml_reader.h"
#include "sequence/timed_poses.h"
#include "sequence/trajectory_file.h"
#include "sim/config/trajectory_folder.h"
#include "tests/fuzz/complaint.h"
#include "tests/fuzz/file_set.h"
#include "tests/fuzz/target.h"

namespace tsdfpp::fuzz {
namespace {

namespace fs = std::filesystem;

bool ReadJsonText(std::string_view input) {
  constexpr const char* kWhere = "some.json";
  const auto json = ParseJson(input, kWhere);
  (void)Accepted(ParseJsonObject(input, kWhere), kWhere);
  if (!Accepted(json, kWhere)) return false;
  const std::string written = JsonText(*json, 2);
  const auto again = ParseJson(written, kWhere);
  Require(again.has_value(), again ? "" : "what was written is refused: " + again.error().message);
  Require(JsonText(*again, 2) == written, "what was written is read as something else");
  constexpr std::size_t kMostShown = 100;
  Require(JsonShown(*json).size() <= kMostShown, "a value that is too long to be shown");
  (void)WholeIn(*json, -5, 5);
  return true;
}

bool ReadTomlText(std::string_view input) {
  constexpr const char* kWhere = "some.toml";
  const auto table = ParseToml(input, kWhere);
  if (!Accepted(table, kWhere)) return false;
  // Each key as each type: getters say what is wrong.
  TomlReader reader(*table, kWhere);
  for (const auto& [key, node] : *table) {
    bool yes = false;
    int whole = 0;
    double number = 0;
    std::string text;
    Eigen::Vector3d vector = Eigen::Vector3d::Zero();
    std::vector<double> numbers;
    std::vector<std::string> texts;
    const std::string_view name = key.str();
    TomlReader of_key(*table, kWhere);
    of_key.Get(name, yes).Get(name, whole).Get(name, number).Get(name, text);
    (void)Accepted(of_key.Finish(), kWhere);
    TomlReader of_list(*table, kWhere);
    of_list.Get(name, vector).Get(name, numbers).Get(name, texts);
    (void)of_list.Table(name);
    (void)of_list.Tables(name);
    (void)Accepted(of_list.Finish(), kWhere);
    (void)reader.Table(name);
  }
  (void)Accepted(reader.Finish(), kWhere);
  return true;
}

bool ReadImageInput(std::string_view input) {
  const fs::path path = WriteOne("image", input);
  const auto header = ReadImageHeader(input, path.string());
  const auto image = ReadImageFile(path);
  const bool accepted = Accepted(image, path.string());
  if (!Accepted(header, path.string())) {
    Require(!accepted, "pixels without a header");
    return false;
  }
  return accepted;
}

// Poses by frame, by time, and as a scene's recorded camera.
bool ReadPoses(std::string_view input) {
  const fs::path path = WriteOne("poses.txt", input);
  const auto by_frame = ReadTrajectory(path);
  std::vector<std::string> remarks;
  const auto by_time = ReadTimedPoses(path, &remarks);
  const auto recorded = ReadTumTrajectory(path);
  (void)Accepted(recorded, path.string());
  if (recorded) (void)PoseAt(std::vector<Pose>{recorded->front().pose, recorded->back().pose}, 0.3);
  if (Accepted(by_time, path.string())) {
    Require(!by_time->empty(), "no poses, and no error");
    const double middle_s = (by_time->begin()->first + by_time->rbegin()->first) / 2;
    if (const auto pose = PoseAt(*by_time, middle_s)) (void)PoseToText(*pose);
  }
  if (!Accepted(by_frame, path.string())) return false;
  const std::string text = TrajectoryToText(*by_frame, "thing");
  const auto again = ReadTrajectory(WriteOne("poses.txt", text));
  Require(again.has_value() || by_frame->empty(),
          again ? "" : "what was written is refused: " + again.error().message);
  if (again) {
    Require(TrajectoryToText(*again, "thing") == text, "a second trip through text changes it");
  }
  return true;
}

}  // namespace

void AddTextTargets(std::vector<Target>& targets) {
  targets.push_back({"json", "some.json", ReadJsonText, {"core/json_text.cc", "core/one_line.cc"}});
  targets.push_back({"toml", "some.toml", ReadTomlText, {"core/toml_reader.cc"}});
  targets.push_back(
      {"image", "image", ReadImageInput, {"core/image_header.cc", "core/exr_header.cc"}});
  targets.push_back({"trajectory",
                     "poses.txt",
                     ReadPoses,
                     {"core/pose_text.cc", "sequence/trajectory_file.cc", "sequence/timed_poses.cc",
                      "sequence/text_lines.cc", "sim/config/trajectory_folder.cc"}});
}

}  // namespace tsdfpp::fuzz
