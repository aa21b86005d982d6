#include "mapper/method_info.h"

#include <array>
#include <cstdlib>

namespace tsdfpp {
namespace {

constexpr auto kMethods = std::to_array<MethodInfo>(
    {{Method::kTsdf, "tsdf", "one field, in which an object's voxels move with it", "#000000",
      "#f0f0f0", true, true, 1, false},
     {Method::kTsdfMin, "tsdf/min", "one field, in which the nearer surface stays", "#8a6100",
      "#c9a27e", true, true, 1, false},
     {Method::kTsdfGuarded, "tsdf/guarded",
      "one field, in which a voxel at a surface takes nothing from behind another's", "#882255",
      "#e58bb4", true, true, 1, false},
     {Method::kTsdfStatic, "tsdf/static", "one field, in which nothing moves", "#777777", "#a8a8a8",
      true, false, 1, false},
     {Method::kTsdfpp, "tsdf++", "layers, in a careful reading of the paper", "#0072b2", "#56b4e9",
      false, true, 2, true},
     {Method::kTsdfppLiteral, "tsdf++/literal", "layers, with the paper's sentences at their word",
      "#e69f00", "#f0c14d", false, true, 2, false},
     {Method::kTsdfppAnchored, "tsdf++/anchored",
      "layers over volumes that stay in their objects' own frames", "#d55e00", "#ff8a4c", false,
      false, 4, true},
     {Method::kVolumes, "volumes", "a volume for each object in its own frame, and no index",
      "#009e73", "#2fcfa0", false, false, kMaxLayers, false},
     {Method::kSurfels, "surfels",
      "a list of discs for each object in its own frame, and no voxels", "#6a3fb5", "#b79bff",
      false, false, kMaxLayers, false, false}});

}  // namespace

std::span<const MethodInfo> Methods() { return kMethods; }

const MethodInfo& InfoOf(Method method) {
  for (const MethodInfo& info : kMethods) {
    if (info.method == method) return info;
  }
  std::abort();
}

std::vector<Method> AllMethods() {
  std::vector<Method> methods;
  methods.reserve(kMethods.size());
  for (const MethodInfo& info : kMethods) methods.push_back(info.method);
  return methods;
}

std::string_view MethodName(Method method) { return InfoOf(method).name; }

bool IsOneField(Method method) { return InfoOf(method).one_field; }

Expected<Method> MethodFromName(std::string_view name) {
  for (const MethodInfo& info : kMethods) {
    if (info.name == name || (!name.empty() && info.name == fmt::format("tsdf++/{}", name))) {
      return info.method;
    }
  }
  return UsageError("method '{}' is unknown, expected one of {}", name, MethodNames());
}

std::string MethodNames() {
  std::string names;
  for (const MethodInfo& info : kMethods) {
    names += fmt::format("{}{}", names.empty() ? "" : ", ", info.name);
  }
  return names;
}

}  // namespace tsdfpp
