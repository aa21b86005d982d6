// Reads what other programs made (tests/data/README.md), for comparison with their numbers.
#pragma once

#include <gtest/gtest.h>

#include <array>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>

#include "core/types.h"
#include "metrics/association.h"
#include "tests/needs.h"

namespace tsdfpp::testing {

inline nlohmann::json ReadJson(const std::filesystem::path& path) {
  std::ifstream file(path);
  EXPECT_TRUE(file) << path;
  return file ? nlohmann::json::parse(file) : nlohmann::json();
}

// The estimated trajectories that evo and TUM's tools measured. Some are not in the repository: a
// test measures what is there, and ends with NEEDS.
inline std::filesystem::path EvoFile(const std::string& name) {
  const std::filesystem::path copied = test::CopiedData("evo_tum/" + name);
  return std::filesystem::exists(copied) ? copied : test::SharedData("metric_refs/evo_tum/" + name);
}

inline StampedTrajectory ReadTum(const std::filesystem::path& path) {
  StampedTrajectory trajectory;
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream fields(line);
    double stamp = 0;
    Eigen::Vector3d t;
    Eigen::Quaterniond q;
    fields >> stamp >> t.x() >> t.y() >> t.z() >> q.x() >> q.y() >> q.z() >> q.w();
    trajectory.emplace(stamp, Pose(Eigen::Translation3d(t) * q.normalized()));
  }
  return trajectory;
}

inline TriangleMesh ReadObj(const std::filesystem::path& path) {
  TriangleMesh mesh;
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) {
    std::istringstream fields(line);
    std::string kind;
    fields >> kind;
    if (kind == "v") {
      Eigen::Vector3f p;
      fields >> p.x() >> p.y() >> p.z();
      mesh.vertices.push_back(p);
    } else if (kind == "f") {
      std::vector<std::uint32_t> corners;
      for (std::string corner; fields >> corner;) {
        corners.push_back(static_cast<std::uint32_t>(std::stoul(corner)) - 1);
      }
      for (std::size_t k = 2; k < corners.size(); ++k) {
        mesh.triangles.push_back({corners[0], corners[k - 1], corners[k]});
      }
    }
  }
  return mesh;
}

inline Pose PoseOf(const nlohmann::json& R, const nlohmann::json& t) {
  Pose pose = Pose::Identity();
  for (Eigen::Index r = 0; r < 3; ++r) {
    for (Eigen::Index c = 0; c < 3; ++c) {
      pose.linear()(r, c) = R[static_cast<std::size_t>(r)][static_cast<std::size_t>(c)];
    }
    pose.translation()[r] = t[static_cast<std::size_t>(r)];
  }
  return pose;
}

}  // namespace tsdfpp::testing
