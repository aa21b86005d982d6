// A reader of BOP written from its specification (docs/sources.md, "BOP") alone: it shares no code
// with ours and trusts nothing but the files.
#pragma once

#include <gtest/gtest.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

namespace tsdfpp::test {

struct BopObject {
  int obj_id = 0;
  cv::Matx33d R_m2c;
  cv::Vec3d t_mm;
  cv::Mat mask;
  cv::Mat mask_visib;
  nlohmann::json info;
};

struct BopImage {
  cv::Matx33d K;
  cv::Matx33d R_w2c;
  cv::Vec3d t_w2c_mm;
  cv::Mat bgr;
  cv::Mat depth_mm;  // CV_64FC1
  std::vector<BopObject> objects;
};

inline nlohmann::json BopJson(const std::filesystem::path& path) {
  std::ifstream in(path);
  EXPECT_TRUE(in.good()) << path;
  return nlohmann::json::parse(in);
}

template <typename Matrix>
Matrix BopNumbers(const nlohmann::json& list) {
  Matrix matrix;
  EXPECT_EQ(list.size(), static_cast<std::size_t>(Matrix::channels));
  for (int i = 0; i < Matrix::channels; ++i) {
    matrix.val[i] = list.at(static_cast<std::size_t>(i)).template get<double>();
  }
  return matrix;
}

inline BopImage ReadBopImage(const std::filesystem::path& scene, int image) {
  const std::string key = std::to_string(image);
  char name[64];
  std::snprintf(name, sizeof(name), "%06d", image);
  BopImage read;
  const auto camera = BopJson(scene / "scene_camera.json").at(key);
  read.K = BopNumbers<cv::Matx33d>(camera.at("cam_K"));
  read.R_w2c = BopNumbers<cv::Matx33d>(camera.at("cam_R_w2c"));
  read.t_w2c_mm = BopNumbers<cv::Vec3d>(camera.at("cam_t_w2c"));
  read.bgr = cv::imread((scene / "rgb" / (std::string(name) + ".png")).string());
  const cv::Mat depth =
      cv::imread((scene / "depth" / (std::string(name) + ".png")).string(), cv::IMREAD_ANYDEPTH);
  EXPECT_EQ(depth.type(), CV_16UC1);
  depth.convertTo(read.depth_mm, CV_64F, camera.at("depth_scale").get<double>());
  const auto objects = BopJson(scene / "scene_gt.json").at(key);
  const auto infos = BopJson(scene / "scene_gt_info.json").at(key);
  EXPECT_EQ(objects.size(), infos.size());
  for (std::size_t i = 0; i < objects.size(); ++i) {
    BopObject object;
    object.obj_id = objects[i].at("obj_id").get<int>();
    object.R_m2c = BopNumbers<cv::Matx33d>(objects[i].at("cam_R_m2c"));
    object.t_mm = BopNumbers<cv::Vec3d>(objects[i].at("cam_t_m2c"));
    object.info = infos[i];
    std::snprintf(name, sizeof(name), "%06d_%06d.png", image, static_cast<int>(i));
    object.mask = cv::imread((scene / "mask" / name).string(), cv::IMREAD_GRAYSCALE);
    object.mask_visib = cv::imread((scene / "mask_visib" / name).string(), cv::IMREAD_GRAYSCALE);
    read.objects.push_back(object);
  }
  return read;
}

// The vertices of a binary little-endian PLY that begins with float x, y, z, in its own unit.
inline std::vector<cv::Vec3f> BopModelVertices(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  std::size_t count = 0;
  std::string line;
  while (std::getline(in, line) && line != "end_header") {
    if (line.rfind("element vertex ", 0) == 0) count = std::stoul(line.substr(15));
  }
  std::vector<cv::Vec3f> vertices(count);
  in.read(reinterpret_cast<char*>(vertices.data()),
          static_cast<std::streamsize>(count * sizeof(cv::Vec3f)));
  EXPECT_TRUE(in.good()) << path;
  return vertices;
}

}  // namespace tsdfpp::test
