// write_run OUT FILE ...: a run that leaves these files in OUT, each with its name and the run's in
// it, and a summary.json.
#include <cstdio>

#include "core/files.h"
#include "eval/run/run_folder.h"

namespace tsdfpp {
namespace {

Expected<void> WriteRun(const std::vector<std::string>& words) {
  TSDFPP_ASSIGN(RunFolder run, RunFolder::Begin(words[1], "write_run"));
  for (std::size_t i = 2; i < words.size(); ++i) {
    TSDFPP_RETURN_IF_ERROR(
        WriteFile(run.path() / words[i], words[i] + " of " + words.back() + "\n"));
  }
  TSDFPP_RETURN_IF_ERROR(
      WriteFile(run.path() / "summary.json", nlohmann::json{{"run", run.id()}}.dump()));
  return run.Commit();
}

}  // namespace
}  // namespace tsdfpp

int main(int argc, char** argv) {
  if (argc < 3) return 2;
  const auto done = tsdfpp::WriteRun({argv, argv + argc});
  if (!done) std::fprintf(stderr, "write_run: %s\n", done.error().message.c_str());
  return done ? 0 : static_cast<int>(done.error().kind);
}
