#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>

#include "cli/metric.h"
#include "eval/score/evaluation.h"
#include "eval/score/surface_file.h"
#include "metrics/surface_comparison.h"

namespace tsdfpp {
namespace {

struct MetricSurfaceArguments {
  std::string reconstruction;
  std::string truth;
  std::string taus = "0.005,0.01,0.02";
  double scale = 1;
  double truth_scale = 1;
  SurfaceComparisonConfig config;
};

nlohmann::json ToJson(const DirectedDistances& distances) {
  return {{"samples", distances.samples},
          {"samples_per_cm2", tsdfpp::ToJson(distances.samples_per_cm2)},
          {"to", distances.to_triangles ? "triangles" : "points"},
          {"mean_m", distances.mean_m},
          {"median_m", distances.median_m},
          {"rmse_m", distances.rmse_m},
          {"p90_m", distances.p90_m},
          {"p95_m", distances.p95_m},
          {"max_m", distances.largest_m}};
}

nlohmann::json ToJson(const SurfaceComparison& result, const SurfaceComparisonConfig& config) {
  nlohmann::json at = nlohmann::json::array();
  for (std::size_t k = 0; k < config.thresholds_m.size(); ++k) {
    at.push_back({{"tau_m", config.thresholds_m[k]},
                  {"precision", result.accuracy.within[k]},
                  {"recall", result.completeness.within[k]},
                  {"f_score", result.f_score[k]},
                  {"facing_recall", tsdfpp::ToJson(result.facing_recall[k])}});
  }
  const EstimatorFloors& floors = result.floors;
  return {{"accuracy", ToJson(result.accuracy)},
          {"completeness", ToJson(result.completeness)},
          {"chamfer_sum_m", result.chamfer_sum_m},
          {"chamfer_mean_m", result.chamfer_mean_m},
          {"chamfer_squared_m2", result.chamfer_squared_m2},
          {"hausdorff_m", result.hausdorff_m},
          {"at", at},
          {"facing_away", tsdfpp::ToJson(result.facing_away)},
          {"floors",
           {{"accuracy_m", tsdfpp::ToJson(floors.accuracy_m)},
            {"completeness_m", tsdfpp::ToJson(floors.completeness_m)},
            {"truth_facets_m", tsdfpp::ToJson(floors.truth_facets_m)},
            {"reconstruction_facets_m", tsdfpp::ToJson(floors.reconstruction_facets_m)},
            {"rounding_m", floors.rounding_m},
            {"precision_error", floors.precision_error},
            {"recall_error", floors.recall_error}}},
          {"remarks", result.remarks}};
}

std::string Row(const char* title, const DirectedDistances& distances) {
  return fmt::format(
      "{:<14} {:>9.4f} {:>9.4f} {:>9.4f} {:>9.4f} {:>9.4f} {:>9.4f}   {} samples, to {}\n", title,
      1e3 * distances.mean_m, 1e3 * distances.median_m, 1e3 * distances.rmse_m,
      1e3 * distances.p90_m, 1e3 * distances.p95_m, 1e3 * distances.largest_m, distances.samples,
      distances.to_triangles ? "triangles" : "points");
}

std::string Text(const SurfaceComparison& result, const SurfaceComparisonConfig& config) {
  std::string text = fmt::format("{:<14} {:>9} {:>9} {:>9} {:>9} {:>9} {:>9}   (mm)\n", "", "mean",
                                 "median", "rmse", "p90", "p95", "max");
  text += Row("accuracy", result.accuracy);
  text += Row("completeness", result.completeness);
  text += fmt::format(
      "chamfer: sum of the means {:.4f} mm, their mean {:.4f} mm, sum of the mean squares {:.6g} "
      "m2; Hausdorff {:.4f} mm\n",
      1e3 * result.chamfer_sum_m, 1e3 * result.chamfer_mean_m, result.chamfer_squared_m2,
      1e3 * result.hausdorff_m);
  text += fmt::format("{:>9} {:>10} {:>10} {:>10} {:>14}\n", "tau mm", "precision", "recall", "F",
                      "facing recall");
  for (std::size_t k = 0; k < config.thresholds_m.size(); ++k) {
    const Measured& facing = result.facing_recall[k];
    text +=
        fmt::format("{:>9.4g} {:>10.4f} {:>10.4f} {:>10.4f} {:>14}\n", 1e3 * config.thresholds_m[k],
                    result.accuracy.within[k], result.completeness.within[k], result.f_score[k],
                    facing.value ? fmt::format("{:.4f}", *facing.value) : "-");
  }
  const EstimatorFloors& floors = result.floors;
  text += fmt::format(
      "floors (what equal surfaces would read): accuracy {}, completeness {}\n"
      "  facets of the truth {}, of the reconstruction {}; rounding {:.2g} mm\n"
      "  standard error of a share: precision {:.2g}, recall {:.2g}\n",
      LengthText(floors.accuracy_m), LengthText(floors.completeness_m),
      LengthText(floors.truth_facets_m), LengthText(floors.reconstruction_facets_m),
      1e3 * floors.rounding_m, floors.precision_error, floors.recall_error);
  return text;
}

Expected<CommandResult> RunSurface(const MetricSurfaceArguments& options, bool scale_is_given) {
  SurfaceComparisonConfig config = options.config;
  TSDFPP_ASSIGN(config.thresholds_m, PositiveNumbers(options.taus, "--tau"));
  std::sort(config.thresholds_m.begin(), config.thresholds_m.end());
  std::vector<std::string> remarks;  // of the files
  TSDFPP_ASSIGN(const TriangleMesh reconstruction,
                ReadSurfaceFile(options.reconstruction, options.scale, remarks));
  TSDFPP_ASSIGN(const TriangleMesh truth,
                ReadSurfaceFile(options.truth, options.truth_scale, remarks));
  TSDFPP_ASSIGN(SurfaceComparison result,
                CompareSurfaces(reconstruction, options.reconstruction, truth, options.truth,
                                scale_is_given, config));
  result.remarks.insert(result.remarks.begin(), remarks.begin(), remarks.end());
  for (const std::string& remark : result.remarks) spdlog::warn("{}", remark);
  nlohmann::json json = ToJson(result, config);
  json["reconstruction"] = options.reconstruction;
  json["truth"] = options.truth;
  json["scale"] = options.scale;
  json["truth_scale"] = options.truth_scale;
  json["seed"] = config.seed;
  return CommandResult{json, Text(result, config)};
}

}  // namespace

Run AddMetricSurface(CLI::App& app) {
  auto options = std::make_shared<MetricSurfaceArguments>();
  app.add_option("RECONSTRUCTION", options->reconstruction,
                 "Mesh or points: .ply, .obj, .stl, .glb")
      ->required();
  app.add_option("TRUTH", options->truth, "The true surface, the same")->required();
  app.add_option("--tau", options->taus, "Thresholds of precision, recall and F, metres, by commas")
      ->capture_default_str();
  CLI::Option* scale = app.add_option("--scale", options->scale,
                                      "Metres a unit of RECONSTRUCTION, 0.001 for millimetres")
                           ->check(AboveZero())
                           ->capture_default_str();
  CLI::Option* truth_scale =
      app.add_option("--truth-scale", options->truth_scale, "Metres a unit of TRUTH")
          ->check(AboveZero())
          ->capture_default_str();
  app.add_option("--density", options->config.samples_per_cm2, "Samples of a mesh a cm2")
      ->check(AboveZero())
      ->capture_default_str();
  app.add_option("--max-samples", options->config.max_samples,
                 "Most samples of a mesh: the density falls until it holds")
      ->check(WholeBetween(1, 100'000'000))
      ->capture_default_str();
  app.add_option("--seed", options->config.seed, "Of the samples")->capture_default_str();
  return [options, scale, truth_scale] {
    return RunSurface(*options, scale->count() > 0 || truth_scale->count() > 0);
  };
}

}  // namespace tsdfpp
