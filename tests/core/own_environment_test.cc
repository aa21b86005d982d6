#include "core/own_environment.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace tsdfpp {
namespace {

std::vector<std::string> Left(std::vector<std::string> variables) {
  std::vector<char*> environment;
  for (std::string& variable : variables) environment.push_back(variable.data());
  environment.push_back(nullptr);
  TakeOutOwn(environment.data());
  std::vector<std::string> left;
  for (char** variable = environment.data(); *variable != nullptr; ++variable) {
    left.emplace_back(*variable);
  }
  return left;
}

const std::string kOwn = std::string(kOwnOpenMpThreads) + "=1";

TEST(OwnEnvironment, WhatIsOursIsTakenOut) {
  EXPECT_EQ(Left({"A=1", "OMP_NUM_THREADS=1", "B=2", kOwn, "C=3"}),
            (std::vector<std::string>{"A=1", "B=2", "C=3"}));
  EXPECT_EQ(Left({kOwn, "OMP_NUM_THREADS=1"}), std::vector<std::string>{});
}

TEST(OwnEnvironment, WhatTheUserSaidStays) {
  const std::vector<std::string> users{"OMP_NUM_THREADS=4", "A=1"};
  EXPECT_EQ(Left(users), users);
  EXPECT_EQ(Left({}), std::vector<std::string>{});
  // Names that begin alike.
  EXPECT_EQ(Left({"OMP_NUM_THREADS_OF=4", kOwn}), std::vector<std::string>{"OMP_NUM_THREADS_OF=4"});
}

}  // namespace
}  // namespace tsdfpp
