#include "tests/cli/run_command.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>

#include "core/files.h"

namespace tsdfpp::test {
namespace {

constexpr int kCannotRun = 127;

void Redirect(const std::string& file, int to) {
  const int descriptor = open(file.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
  if (descriptor < 0 || dup2(descriptor, to) < 0) _exit(kCannotRun);
}

}  // namespace

CommandOutput RunTsdfpp(const std::vector<std::string>& arguments,
                        const std::filesystem::path& scratch,
                        const std::map<std::string, std::string>& variables) {
  const std::string out = scratch / "stdout.txt";
  const std::string err = scratch / "stderr.txt";
  std::vector<std::string> words{TSDFPP_COMMAND};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  // Made before the fork: afterwards only async-signal-safe calls are allowed.
  std::vector<std::string> settings;
  for (char** variable = environ; *variable != nullptr; ++variable) {
    const std::string text = *variable;
    if (!variables.contains(text.substr(0, text.find('=')))) settings.push_back(text);
  }
  for (const auto& [name, value] : variables) settings.push_back(name + "=" + value);
  std::vector<char*> environment;
  for (std::string& setting : settings) environment.push_back(setting.data());
  environment.push_back(nullptr);

  const pid_t child = fork();
  if (child == 0) {
    Redirect(out, STDOUT_FILENO);
    Redirect(err, STDERR_FILENO);
    execve(argv[0], argv.data(), environment.data());
    _exit(kCannotRun);
  }
  CommandOutput result;
  int status = 0;
  if (child < 0 || waitpid(child, &status, 0) != child) {
    ADD_FAILURE() << "no child process";
    return result;
  }
  if (WIFEXITED(status)) result.exit_code = WEXITSTATUS(status);
  EXPECT_NE(result.exit_code, kCannotRun) << TSDFPP_COMMAND << " cannot be run";
  result.out = ReadFile(out).value_or("");
  result.err = ReadFile(err).value_or("");
  return result;
}

}  // namespace tsdfpp::test
