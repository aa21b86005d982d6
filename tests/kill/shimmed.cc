#include "tests/kill/shimmed.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>

namespace tsdfpp::test {
namespace {

namespace fs = std::filesystem;

std::string BytesOfFile(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

}  // namespace

Ending RunShimmed(const std::vector<std::string>& words, const Fault& fault,
                  const fs::path& scratch) {
  const std::string count = scratch / "changes.txt";
  fs::remove(count);
  std::vector<std::string> settings{"LD_PRELOAD=" TSDFPP_KILL_SHIM,
                                    "TSDFPP_SHIM_BELOW=" + fault.below.string(),
                                    "TSDFPP_SHIM_COUNT=" + count};
  if (fault.at > 0) {
    settings.push_back("TSDFPP_SHIM_AT=" + std::to_string(fault.at));
    settings.push_back("TSDFPP_SHIM_HOW=" + fault.how);
  }
  for (char** variable = environ; *variable != nullptr; ++variable) {
    const std::string setting = *variable;
    if (!setting.starts_with("LD_PRELOAD=")) settings.push_back(setting);
  }
  // Made before the fork: afterwards only async-signal-safe calls are allowed.
  std::vector<std::string> copies = words;
  std::vector<char*> argv;
  for (std::string& word : copies) argv.push_back(word.data());
  argv.push_back(nullptr);
  std::vector<char*> environment;
  for (std::string& setting : settings) environment.push_back(setting.data());
  environment.push_back(nullptr);
  const std::string out = scratch / "stdout.txt";
  const std::string err = scratch / "stderr.txt";
  const pid_t child = fork();
  if (child == 0) {
    constexpr int kFlags = O_WRONLY | O_CREAT | O_TRUNC;
    if (dup2(open(out.c_str(), kFlags, 0600), STDOUT_FILENO) < 0 ||
        dup2(open(err.c_str(), kFlags, 0600), STDERR_FILENO) < 0) {
      _exit(127);
    }
    execve(argv[0], argv.data(), environment.data());
    _exit(127);
  }
  Ending ending;
  int status = 0;
  if (child < 0 || waitpid(child, &status, 0) != child) {
    ADD_FAILURE() << "no child process";
    return ending;
  }
  if (WIFEXITED(status)) ending.exit_code = WEXITSTATUS(status);
  if (WIFSIGNALED(status)) ending.signal = WTERMSIG(status);
  EXPECT_NE(ending.exit_code, 127) << words[0] << " cannot be run";
  ending.err = BytesOfFile(err);
  return ending;
}

int Changes(const fs::path& scratch) {
  const std::string lines = BytesOfFile(scratch / "changes.txt");
  return static_cast<int>(std::count(lines.begin(), lines.end(), '\n'));
}

std::map<std::string, std::string> ContentOf(const fs::path& folder) {
  std::map<std::string, std::string> content;
  if (!fs::exists(folder)) return content;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    const std::string name = entry.path().lexically_relative(folder).string();
    if (entry.is_symlink()) {
      content[name] = "a link";
    } else if (entry.is_directory()) {
      if (fs::is_empty(entry.path())) content[name] = "a folder";
    } else if (entry.is_regular_file()) {
      content[name] = BytesOfFile(entry.path());
    } else {
      content[name] = "odd";
    }
  }
  return content;
}

}  // namespace tsdfpp::test
