#include <cstdio>

#include "cli/command.h"
#include "core/json_text.h"
#include "eval/make/certify.h"

namespace tsdfpp {
namespace {

struct VerifyArguments {
  std::string sequence;
  double share = CertifyOptions{}.ray_share;
  bool all = false;
};

Expected<CommandResult> RunVerify(const VerifyArguments& options, const CommonOptions& common) {
  CertifyOptions certify;
  certify.ray_share = options.all ? 1 : options.share;
  Expected<CertifyResult> result;
  {
    ProgressBar bar("verify");
    certify.progress = [&](int done, int total) { bar.Show(done, total); };
    result = Certify(options.sequence, certify);
  }
  if (!result) return tl::unexpected(result.error());
  CommandResult output{CertifyJson(*result), CertifyText(*result)};
  if (result->sound()) return output;
  // What was found is the result; that there is something decides the exit code.
  std::fputs(common.json ? (JsonText(output.json, 2) + "\n").c_str() : output.text.c_str(), stdout);
  return DataError("{}: the sequence is not sound, {} findings, the first: {}", options.sequence,
                   result->findings.size(), FindingText(result->findings.front()));
}

}  // namespace

Run AddVerify(CLI::App& app, const CommonOptions& common) {
  auto options = std::make_shared<VerifyArguments>();
  app.add_option("SEQ", options->sequence, "Sequence of ours (folder)")->required();
  CLI::Option* share =
      app.add_option("--share", options->share, "Share of the frames that are compared with rays")
          ->check(Between(0, 1))
          ->capture_default_str();
  AddFollowLinks(app);
  app.add_flag("--all", options->all, "Compare all frames with rays")->excludes(share);
  return [options, &common] { return RunVerify(*options, common); };
}

}  // namespace tsdfpp
