#include <fmt/format.h>

#include "cli/command.h"
#include "sequence/cofusion_writer.h"
#include "sim/simulated_source.h"

namespace tsdfpp {

Run AddGenerate(CLI::App& app, const CommonOptions&) {
  struct Options {
    std::string scene;
    std::string out;
    bool overwrite = false;
  };
  auto options = std::make_shared<Options>();
  app.add_option("SCENE", options->scene, "Scene file (.toml)")->required();
  app.add_option("--out", options->out, "Folder of the new sequence")->required();
  app.add_flag("--overwrite", options->overwrite, "Replace an earlier sequence of ours");
  return [options]() -> Expected<CommandResult> {
    TSDFPP_ASSIGN(const SceneConfig scene, LoadSceneConfig(options->scene));
    TSDFPP_ASSIGN(auto source, SimulatedSource::Open(scene, {}));
    GeneratorInfo generator;
    generator.version = TSDFPP_VERSION;
    generator.sensor = "none";
    generator.backend = source->gl_info().backend;
    generator.renderer = source->gl_info().renderer;
    {
      ProgressBar bar("generate");
      TSDFPP_RETURN_IF_ERROR(WriteCofusion(*source, generator, options->out, options->overwrite,
                                           [&](int done, int total) { bar.Show(done, total); }));
    }
    const SequenceInfo& info = source->info();
    return CommandResult{
        {{"scene", info.name},
         {"frames", info.frame_count},
         {"out", options->out},
         {"backend", generator.backend},
         {"renderer", generator.renderer}},
        fmt::format("{}: {} frames of {} ({}, {})\n", options->out, info.frame_count, info.name,
                    generator.backend, generator.renderer)};
  };
}

}  // namespace tsdfpp
