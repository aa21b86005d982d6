// Meshes of the wall with two boxes (tests/sequence/box_source.h), and what `evaluate` says of
// them.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "core/ply.h"
#include "eval/score/evaluate_meshes.h"
#include "eval/score/surface_file.h"
#include "tests/sequence/box_source.h"

namespace tsdfpp::test {

inline constexpr int kLast = 5;
inline constexpr InstanceId kLeft = 3;
inline constexpr InstanceId kRight = 8;
// Single precision at 3 m, twice: the file's rounding and the query's.
inline constexpr double kRounding_m = 2e-6;

// The true surface of each object in the world after frame `kLast`, cut finely enough that a box of
// faces selects them well.
inline std::map<InstanceId, TriangleMesh> TruthMeshes(BoxSource& source) {
  const auto frame = source.Read(kLast);
  const auto models = source.Truth();
  std::map<InstanceId, TriangleMesh> meshes;
  for (const TrueModel& model : *models) {
    TriangleMesh mesh = model.mesh_O;
    if (model.info.id != kBackground) {
      for (Eigen::Vector3f& vertex : mesh.vertices) {
        vertex = (frame->T_WO.at(model.info.id) * vertex.cast<double>()).cast<float>();
      }
    }
    meshes[model.info.id] = mesh;
  }
  return meshes;
}

inline TriangleMesh Moved(TriangleMesh mesh, const Eigen::Vector3f& by) {
  for (Eigen::Vector3f& vertex : mesh.vertices) vertex += by;
  return mesh;
}

inline TriangleMesh SceneOf(const std::map<InstanceId, TriangleMesh>& meshes, bool labelled) {
  TriangleMesh scene;
  for (const auto& [id, mesh] : meshes) {
    TriangleMesh one = mesh;
    if (labelled) one.face_ids.assign(one.triangles.size(), id);
    AppendMesh(one, scene);
  }
  return scene;
}

inline void Put(const std::filesystem::path& path, const TriangleMesh& mesh) {
  const auto written = WritePly(path, mesh);
  ASSERT_TRUE(written.has_value()) << written.error().message;
}

inline EvaluateConfig At(const std::filesystem::path& folder, std::vector<int> frames = {kLast}) {
  EvaluateConfig config;
  config.meshes = folder;
  config.frames = std::move(frames);
  config.truth.sampling.fine_per_cm2 = 1;
  config.truth.sampling.coarse_per_cm2 = 0.05;
  return config;
}

inline EvaluateResult Evaluated(const EvaluateConfig& config) {
  BoxSource source;
  auto result = RunEvaluate(source, config, {});
  if (!result) {
    ADD_FAILURE() << result.error().message;
    return {};
  }
  return std::move(*result);
}

inline Error ErrorOf(const EvaluateConfig& config) {
  BoxSource source;
  const auto result = RunEvaluate(source, config, {});
  EXPECT_FALSE(result.has_value());
  return result ? Error{} : result.error();
}

// All of it but times and how it was read.
inline nlohmann::json Scores(const EvaluatedFrame& frame) {
  nlohmann::json json = ToJson(frame.evaluation);
  json.erase("mesh_s");
  json.erase("evaluate_s");
  return json;
}

inline const ObjectScores& Of(const EvaluateResult& result, InstanceId id) {
  for (const ObjectScores& scores : result.frames.back().evaluation.objects) {
    if (scores.info.id == id) return scores;
  }
  ADD_FAILURE() << "no object " << id;
  return result.frames.back().evaluation.objects.front();
}

inline bool Says(const std::vector<std::string>& remarks, const std::string& words) {
  return std::any_of(remarks.begin(), remarks.end(), [&](const std::string& remark) {
    return remark.find(words) != std::string::npos;
  });
}

// The three objects under their own names.
inline void PutNamed(const std::filesystem::path& folder,
                     const std::map<InstanceId, TriangleMesh>& meshes) {
  Put(folder / "background-0.ply", meshes.at(kBackground));
  Put(folder / "left-3.ply", meshes.at(kLeft));
  Put(folder / "right-8.ply", meshes.at(kRight));
}

}  // namespace tsdfpp::test
