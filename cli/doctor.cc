#include <fmt/format.h>
#include <mujoco/mujoco.h>
#include <open3d/Open3DConfig.h>
#include <pcl/pcl_config.h>

#include <Eigen/Core>
#include <cstdlib>
#include <opencv2/core/version.hpp>
#include <thread>

#include "cli/command.h"
#include "core/json_text.h"
#include "eval/adapters/child_process.h"
#include "sim/render/gl_context.h"

namespace tsdfpp {

Run AddDoctor(CLI::App&, const CommonOptions& common) {
  return [&common]() -> Expected<CommandResult> {
    const unsigned cores = std::thread::hardware_concurrency();
    nlohmann::json json{{"tsdfpp", TSDFPP_VERSION},
                        {"cores", cores},
                        {"mujoco", mj_versionString()},
                        {"opencv", CV_VERSION},
                        {"pcl", PCL_VERSION_PRETTY},
                        {"open3d", OPEN3D_VERSION},
                        {"eigen", fmt::format("{}.{}.{}", EIGEN_WORLD_VERSION, EIGEN_MAJOR_VERSION,
                                              EIGEN_MINOR_VERSION)}};
    std::string text = fmt::format(
        "tsdfpp   {}\ncores    {}\nMuJoCo   {}\nOpenCV   {}\nPCL      {}\nOpen3D   {}\nEigen    "
        "{}\n",
        TSDFPP_VERSION, cores, mj_versionString(), CV_VERSION, PCL_VERSION_PRETTY, OPEN3D_VERSION,
        json["eigen"].get<std::string>());
    json["children"] = ChildControl();
    text += fmt::format("adapters ended by {}\n", json["children"].get<std::string>());
    auto gl = GlContext::Create();
    if (!gl) {
      // The rest of what is known is worth printing, and then the fault decides the exit code.
      json["gl"] = nullptr;
      std::fputs(common.json ? (JsonText(json, 2) + "\n").c_str() : text.c_str(), stdout);
      return tl::unexpected(gl.error());
    }
    const GlInfo& info = (*gl)->info();
    json["gl"] = {{"backend", info.backend},
                  {"platform", info.platform},
                  {"renderer", info.renderer},
                  {"version", info.version}};
    text +=
        fmt::format("GL       {}{}{}, {}, {}\nNothing is missing.\n", info.backend,
                    info.platform.empty() ? "" : " ", info.platform, info.renderer, info.version);
    return CommandResult{json, text};
  };
}

}  // namespace tsdfpp
