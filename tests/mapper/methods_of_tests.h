// Which methods a test runs for.
#pragma once

#include <gtest/gtest.h>

#include <cctype>
#include <string>
#include <vector>

#include "mapper/method_info.h"

namespace tsdfpp {

// Those whose maps have voxels (MapRepresentation::inspection).
inline std::vector<Method> VoxelMethods() {
  std::vector<Method> methods;
  for (const MethodInfo& info : Methods()) {
    if (info.has_voxels) methods.push_back(info.method);
  }
  return methods;
}

// Those whose maps have a volume an object.
inline std::vector<Method> LayeredMethods() {
  std::vector<Method> methods = VoxelMethods();
  std::erase_if(methods, IsOneField);
  return methods;
}

// Whether values stay in the object's own lattice, and that moves.
inline bool MovesLattices(Method method) {
  const MethodInfo& info = InfoOf(method);
  return info.has_voxels && !info.one_field && !info.moves_values;
}

// Whether the map keeps an index; `volumes` asks each volume. The row does not say.
inline bool KeepsLists(Method method) { return method != Method::kVolumes; }

inline std::string MethodTestName(Method method) {
  std::string name(MethodName(method));
  for (char& c : name) {
    if (std::isalnum(static_cast<unsigned char>(c)) == 0) c = '_';
  }
  return name;
}

#define TSDFPP_FOR_METHODS(suite, methods)                               \
  INSTANTIATE_TEST_SUITE_P(Methods, suite, ::testing::ValuesIn(methods), \
                           [](const auto& tested) { return MethodTestName(tested.param); })
#define TSDFPP_FOR_EVERY_METHOD(suite) TSDFPP_FOR_METHODS(suite, AllMethods())
#define TSDFPP_FOR_EVERY_VOXEL_METHOD(suite) TSDFPP_FOR_METHODS(suite, VoxelMethods())

}  // namespace tsdfpp
