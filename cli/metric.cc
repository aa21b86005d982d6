#include "cli/metric.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <map>
#include <memory>

#include "core/files.h"
#include "core/ply.h"
#include "sim/mesh_files.h"

namespace tsdfpp {

Expected<TriangleMesh> ReadSurfaceFile(const std::filesystem::path& path, double scale) {
  std::string ending = path.extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  TriangleMesh mesh;
  if (ending == ".ply") {
    TSDFPP_ASSIGN(mesh, ReadPly(path));
  } else if (ending == ".obj" || ending == ".stl") {
    TSDFPP_ASSIGN(const std::string bytes, ReadFile(path));
    TSDFPP_ASSIGN(const RawMesh raw,
                  ending == ".obj" ? ReadObj(path, bytes) : ReadStl(path, bytes));
    for (const Eigen::Vector3d& vertex : raw.vertices) {
      mesh.vertices.emplace_back(vertex.cast<float>());
    }
    for (const RawTriangle& triangle : raw.triangles) mesh.triangles.push_back(triangle.vertex);
  } else {
    return UsageError("{}: a surface is expected to be a .ply, .obj or .stl file", path.string());
  }
  for (Eigen::Vector3f& vertex : mesh.vertices) {
    vertex = (scale * vertex.cast<double>()).cast<float>();
    if (!vertex.allFinite()) {
      return DataError("{}: at scale {} a position is too large for single precision",
                       path.string(), scale);
    }
  }
  return mesh;
}

std::string LengthText(const Measured& metres) {
  if (!metres.value) return "undefined: " + metres.why_not;
  return fmt::format("{:.4f} mm", 1e3 * *metres.value);
}

std::string ShareText(const Measured& share) {
  if (!share.value) return "undefined: " + share.why_not;
  return fmt::format("{:.4f}", *share.value);
}

Expected<std::vector<double>> PositiveNumbers(const std::string& text, const std::string& option) {
  std::vector<double> numbers;
  for (const std::string& word : SplitList(text)) {
    double number = 0;
    const auto [end, status] = std::from_chars(word.data(), word.data() + word.size(), number);
    if (status != std::errc() || end != word.data() + word.size() || !(number > 0) ||
        !std::isfinite(number)) {
      return UsageError("{} '{}': expected numbers above 0 between commas, found '{}'", option,
                        text, word);
    }
    numbers.push_back(number);
  }
  if (numbers.empty()) return UsageError("{} is empty, expected a number at least", option);
  return numbers;
}

Run AddMetric(CLI::App& app, const CommonOptions&) {
  app.require_subcommand(1);
  const auto runs = std::make_shared<std::map<const CLI::App*, Run>>();
  const auto add = [&](const char* name, const char* help, const auto& function) {
    CLI::App* command = app.add_subcommand(name, help);
    // --json and --threads belong to `metric`, and may stand behind its subcommands.
    command->fallthrough();
    command->footer("--json and --threads as for every subcommand.");
    (*runs)[command] = function(*command);
  };
  add("trajectory", "Compare two trajectories (TUM files): APE and RPE", AddMetricTrajectory);
  add("surface", "Compare two surfaces (meshes or points): accuracy, completeness, F-score",
      AddMetricSurface);
  add("panoptic", "Compare two folders of segmented images: PQ, STQ, IoU", AddMetricPanoptic);
  add("pose", "Compare an object's poses at its model's points: ADD, ADD-S, MSSD, MSPD, AUC",
      AddMetricPose);
  return [&app, runs] { return runs->at(app.get_subcommands().front())(); };
}

}  // namespace tsdfpp
