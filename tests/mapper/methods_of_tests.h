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
