// The methods that there are, a row each: what command line, tables, plots, page and tests know of
// them. docs/map.md has their rules, mapper/methods/ the maps.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"

namespace tsdfpp {

// Objects that a voxel can list.
inline constexpr int kMaxLayers = 8;

enum class Method {
  kTsdf,
  kTsdfMin,
  kTsdfGuarded,
  kTsdfStatic,
  kTsdfpp,
  kTsdfppLiteral,
  kTsdfppAnchored,
  kVolumes,
  kSurfels
};

// A row has no maker: this file is below the maps, which ask it what they are, so MakeMap stands
// above them (mapper/methods/make_map.cc), where the compiler asks for every method.
struct MethodInfo {
  Method method;
  std::string_view name;
  std::string_view help;  // one line
  // The colour of its lines on light ground, "#rrggbb", and on dark, in the report and in plots.
  // Most are Okabe and Ito's.
  std::string_view on_light;
  std::string_view on_dark;
  // All objects share one field, in which a voxel has one distance and one label.
  bool one_field;
  // A pose moves values through the lattice, by resampling.
  bool moves_values;
  // Objects that a voxel lists (K), and whether a setting changes that.
  int layers;
  bool layers_can_be_set;
  // It keeps signed distances in voxels, within a band about the surface; else it lists surfaces.
  bool has_voxels = true;
};

// In the order in which lists show them.
std::span<const MethodInfo> Methods();
const MethodInfo& InfoOf(Method method);
std::vector<Method> AllMethods();
std::string_view MethodName(Method method);
bool IsOneField(Method method);
// Errors: kUsage, naming the methods there are. "anchored" and "literal" are understood as well.
Expected<Method> MethodFromName(std::string_view name);
// "tsdf, tsdf/min, ...".
std::string MethodNames();

}  // namespace tsdfpp
