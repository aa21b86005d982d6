// Small helpers to build TOML values.
#pragma once

#include <toml++/toml.h>

#include <Eigen/Core>
#include <string>
#include <vector>

namespace tsdfpp {

inline toml::array TomlArray(const Eigen::Vector3d& v) { return toml::array{v.x(), v.y(), v.z()}; }
inline toml::array TomlArray(const Eigen::Vector2d& v) { return toml::array{v.x(), v.y()}; }

template <typename T>
toml::array TomlArray(const std::vector<T>& values) {
  toml::array array;
  for (const T& value : values) array.push_back(value);
  return array;
}

}  // namespace tsdfpp
