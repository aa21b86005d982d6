// A dense, bounded array of voxels, and the cubes around a voxel.
#pragma once

#include <Eigen/Core>
#include <cstdio>
#include <cstdlib>
#include <vector>

namespace tsdfpp::reference {

// The references are bounded: all that a test does has to fit, and what does not fit aborts.
[[noreturn]] inline void BoxTooSmall(const Eigen::Vector3i& voxel) {
  std::fprintf(stderr, "the reference's box is too small for voxel (%d, %d, %d)\n", voxel.x(),
               voxel.y(), voxel.z());
  std::abort();
}

// Voxels low .. high, both included.
struct Box {
  Eigen::Vector3i low = Eigen::Vector3i::Zero();
  Eigen::Vector3i high = Eigen::Vector3i::Zero();

  bool Contains(const Eigen::Vector3i& v) const {
    return (v.array() >= low.array()).all() && (v.array() <= high.array()).all();
  }
  // On the outermost layer, where a write means that the box may have clipped something.
  bool AtRim(const Eigen::Vector3i& v) const {
    return (v.array() == low.array()).any() || (v.array() == high.array()).any();
  }
};

// Calls function(voxel) in the order (z, y, x).
template <typename Function>
void ForEachVoxel(const Box& box, Function&& function) {
  for (int z = box.low.z(); z <= box.high.z(); ++z) {
    for (int y = box.low.y(); y <= box.high.y(); ++y) {
      for (int x = box.low.x(); x <= box.high.x(); ++x) function(Eigen::Vector3i(x, y, z));
    }
  }
}

template <typename T>
class DenseGrid {
 public:
  explicit DenseGrid(const Box& box)
      : box_(box),
        size_(box.high - box.low + Eigen::Vector3i::Ones()),
        values_(static_cast<std::size_t>(size_.x()) * size_.y() * size_.z()) {}

  const Box& box() const { return box_; }

  // The default value outside the box.
  const T& operator()(const Eigen::Vector3i& v) const {
    static const T kOutside{};
    return box_.Contains(v) ? values_[Index(v)] : kOutside;
  }
  T& At(const Eigen::Vector3i& v) {
    if (!box_.Contains(v)) BoxTooSmall(v);
    return values_[Index(v)];
  }

 private:
  std::size_t Index(const Eigen::Vector3i& v) const {
    const Eigen::Vector3i r = v - box_.low;
    return (static_cast<std::size_t>(r.z()) * size_.y() + r.y()) * size_.x() + r.x();
  }

  Box box_;
  Eigen::Vector3i size_;
  std::vector<T> values_;
};

// Corner 0..7 of the cube named `cube`: bit 0 is x, bit 1 is y, bit 2 is z.
inline Eigen::Vector3i CubeCorner(const Eigen::Vector3i& cube, int corner) {
  return cube + Eigen::Vector3i(corner & 1, (corner >> 1) & 1, (corner >> 2) & 1);
}

}  // namespace tsdfpp::reference
