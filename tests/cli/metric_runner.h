// Runs `tsdfpp metric` in a folder of its own.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "core/ply.h"
#include "tests/cli/run_command.h"
#include "tests/core/temp_folder.h"

namespace tsdfpp::test {

class MetricRunner : public ::testing::Test {
 protected:
  CommandOutput Run(const std::vector<std::string>& arguments) {
    std::vector<std::string> all{"metric"};
    all.insert(all.end(), arguments.begin(), arguments.end());
    return RunTsdfpp(all, folder_.path());
  }
  // What --json prints; nothing but warnings may be on stderr.
  nlohmann::json Json(std::vector<std::string> arguments) {
    arguments.emplace_back("--json");
    const CommandOutput output = Run(arguments);
    EXPECT_EQ(output.exit_code, 0) << output.err;
    err_ = output.err;
    auto json = nlohmann::json::parse(output.out, nullptr, false);
    EXPECT_FALSE(json.is_discarded()) << output.out;
    return json;
  }
  void ExpectError(const std::vector<std::string>& arguments, int exit_code,
                   const std::vector<std::string>& words) {
    const CommandOutput output = Run(arguments);
    EXPECT_EQ(output.exit_code, exit_code) << output.err;
    EXPECT_EQ(output.out, "");
    EXPECT_EQ(std::count(output.err.begin(), output.err.end(), '\n'), 1) << output.err;
    for (const std::string& word : words) {
      EXPECT_NE(output.err.find(word), std::string::npos) << word << " is not in: " << output.err;
    }
  }
  std::string Write(const std::string& name, const std::string& text) {
    std::ofstream(folder_ / name, std::ios::binary) << text;
    return folder_ / name;
  }
  std::string WriteMesh(const std::string& name, const TriangleMesh& mesh) {
    EXPECT_TRUE(WritePly(folder_ / name, mesh));
    return folder_ / name;
  }

  TempFolder folder_;
  std::string err_;
};

}  // namespace tsdfpp::test
