// The few types that every room shares. Units are metres, seconds, radians.
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <map>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

namespace tsdfpp {

// Identity of an object; 0 is the background (furniture and room), an object like the others.
using InstanceId = std::uint16_t;
inline constexpr InstanceId kBackground = 0;
inline constexpr InstanceId kNoInstance = 0xFFFF;

// A rigid transformation, named T_target_source: p_target = T_target_source * p_source.
using Pose = Eigen::Isometry3d;

using Colour = std::array<std::uint8_t, 3>;  // red, green, blue

// Pinhole camera that looks along +z, x right, y down; pixel centres are integers:
// u = fx x / z + cx. Lengths in pixels.
struct Intrinsics {
  int width = 0;
  int height = 0;
  double fx = 0;
  double fy = 0;
  double cx = 0;
  double cy = 0;
  bool operator==(const Intrinsics&) const = default;
};

struct ObjectInfo {
  InstanceId id = kBackground;
  std::string name;            // unique in a sequence, e.g. "truck"
  std::string semantic_class;  // empty where unknown
  bool operator==(const ObjectInfo&) const = default;
};

// All that a mapper sees at one instant.
struct Frame {
  int index = 0;      // the number in the sequence's file names
  double time_s = 0;  // since the first frame
  Intrinsics intrinsics;
  cv::Mat colour;  // CV_8UC3, red-green-blue order
  cv::Mat depth;   // CV_32FC1, metres along the optical axis; invalid where 0, not finite, or > 100
  cv::Mat mask;    // CV_16UC1, instance ids; may be empty (no segmentation known)
  Pose T_WC = Pose::Identity();
  std::map<InstanceId, Pose> T_WO;  // given object poses; an object may be absent
};

inline constexpr float kMaxValidDepth_m = 100.0F;

// Depth is valid where it is finite and in (0, kMaxValidDepth_m].
inline bool IsValidDepth(float depth_m) { return depth_m > 0.0F && depth_m <= kMaxValidDepth_m; }

struct TriangleMesh {
  std::vector<Eigen::Vector3f> vertices;                // metres
  std::vector<std::array<std::uint32_t, 3>> triangles;  // counter-clockwise seen from outside
  std::vector<Colour> colours;                          // per vertex, or empty
  std::vector<InstanceId> face_ids;                     // per triangle, or empty
};

// The true surface of one object, exactly as rendered.
struct TrueModel {
  ObjectInfo info;
  TriangleMesh mesh_O;                     // in the object's frame (the world's for the background)
  std::vector<std::string> regions;        // names, e.g. "table", "floor"; one at least
  std::vector<std::uint16_t> face_region;  // per triangle, an index into `regions`
};

}  // namespace tsdfpp
