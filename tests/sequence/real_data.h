// The data of others in shared/data, read in place.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <string>

namespace tsdfpp::test {

inline std::filesystem::path RealData(const std::string& name) {
  return std::filesystem::path(TSDFPP_SHARED_DIR) / "data" / name;
}

}  // namespace tsdfpp::test

#define TSDFPP_NEEDS_REAL_DATA(name)                          \
  if (!std::filesystem::exists(test::RealData(name))) {       \
    GTEST_SKIP() << "shared/data/" << name << " is not here"; \
  }
