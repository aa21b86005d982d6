// A comparison as small as one can be that a report is made of.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "core/files.h"
#include "eval/picture/record_images.h"
#include "eval/tools/packed_mesh.h"
#include "tests/core/temp_folder.h"

namespace tsdfpp::test {

// The bytes of a recording, and the places in it.
class RecordedBytes {
 public:
  // A white WebP image of `length` bytes: what comes after its own is passed over.
  nlohmann::json Image(std::size_t length) {
    std::string image = WebpBytes(cv::Mat(6, 8, CV_8UC3, cv::Scalar::all(255)), true).value();
    while (image.size() < length) image += static_cast<char>(image.size() * 37 % 251);
    return Add(image);
  }

  nlohmann::json Triangle(const char* layer) {
    TriangleMesh mesh;
    mesh.vertices = {{0, 0, 1}, {0.1F, 0, 1}, {0, 0.1F, 1}};
    mesh.triangles = {{0, 1, 2}};
    const PackedMesh packed = Pack(mesh, {}, PositionGrid{});
    return {{"id", 0U},
            {"vertices", packed.vertices},
            {"triangles", packed.triangles},
            {"layer", layer},
            {"vertex_bytes", Add(packed.vertex_bytes)},
            {"index_bytes", Add(packed.index_bytes)}};
  }

  const std::string& bytes() const { return bytes_; }

 private:
  nlohmann::json Add(const std::string& bytes) {
    nlohmann::json place = nlohmann::json::array({bytes_.size(), bytes.size()});
    bytes_ += bytes;
    return place;
  }

  std::string bytes_;
};

// What `tsdfpp compare --record` could have written, with these key frames.
inline void WriteTinyRun(const std::filesystem::path& folder,
                         const std::vector<int>& key_frames = {8, 16}) {
  using nlohmann::json;
  const json run{{"title", "tsdf, paper, given poses"},
                 {"folder", "tsdf_paper_gt"},
                 {"method", "tsdf"},
                 {"profile", "paper"},
                 {"poses", "gt"}};
  const json summary{{"schema", 1},
                     {"generator", "tsdfpp"},
                     {"version", "0.1.0"},
                     {"command", "c"},
                     {"sequence", "tiny"},
                     {"first_frame", 1},
                     {"last_frame", key_frames.back()},
                     {"every", 8},
                     {"cores", 2},
                     {"read_s", 1.5},
                     {"total_s", 2.5},
                     {"removed", {1}},
                     {"reveal_frame", nullptr},
                     {"runs", {run}}};
  ASSERT_TRUE(WriteFile(folder / "summary.json", summary.dump()));
  ASSERT_TRUE(
      WriteFile(folder / "frames.csv", "frame,method,profile,poses,x\n8,tsdf,paper,gt,1\n"));
  RecordedBytes bytes;
  json keys = json::array();
  json run_keys = json::array();
  json frames = json::array();
  for (const int frame : key_frames) {
    frames.push_back({{"frame", frame}, {"T_WC", {0, 0, 0, 0, 0, 0, 1}}, {"T_WO", json::object()}});
    keys.push_back({{"frame", frame},
                    {"colour", bytes.Image(3000)},
                    {"depth", bytes.Image(2000)},
                    {"mask", bytes.Image(500)}});
    run_keys.push_back({{"frame", frame},
                        {"picture", bytes.Image(4000)},
                        {"picture_after", bytes.Image(4000)},
                        {"chunks", {bytes.Triangle("common"), bytes.Triangle("hole")}}});
  }
  const std::vector<double> of_frames(key_frames.size(), 1.5);
  const json recorded_run{{"folder", "tsdf_paper_gt"}, {"memory_mb", of_frames},
                          {"track_ms", of_frames},     {"update_poses_ms", of_frames},
                          {"fuse_ms", of_frames},      {"position_error_mm", json::object()},
                          {"key_frames", run_keys}};
  const json intrinsics{{"width", 8}, {"height", 6}, {"fx", 7.5},
                        {"fy", 7.5},  {"cx", 4},     {"cy", 3}};
  const json record{{"schema", 1},
                    {"grid", {{"origin_m", {0, 0, 0}}, {"step_m", 0.001}}},
                    {"intrinsics", intrinsics},
                    {"error_step_m", 0.0002},
                    {"age_step_frames", 1},
                    {"depth_range_m", {0.5, 3}},
                    {"objects", {{{"id", 0U}, {"name", "background"}, {"colour", {1, 2, 3}}}}},
                    {"frames", frames},
                    {"truth", {bytes.Triangle("truth")}},
                    {"key_frames", keys},
                    {"runs", {recorded_run}}};
  ASSERT_TRUE(WriteFile(folder / "record" / "record.json", record.dump()));
  ASSERT_TRUE(WriteFile(folder / "record" / "record.bin", bytes.bytes()));
}

inline std::string Text(const std::filesystem::path& file) { return ReadFile(file).value_or(""); }

class Report : public testing::Test {
 protected:
  void SetUp() override { WriteTinyRun(Run()); }
  std::filesystem::path Run() const { return folder_ / "run"; }
  std::filesystem::path Copy(const std::string& name) const {
    std::filesystem::path copy = folder_ / name;
    std::filesystem::copy(Run(), copy, std::filesystem::copy_options::recursive);
    return copy;
  }

 private:
  TempFolder folder_;
};

}  // namespace tsdfpp::test
