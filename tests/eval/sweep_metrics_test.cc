// The table of metrics: a row each, whole, and what the page says.
#include "eval/sweep/sweep_metrics.h"

#include <gtest/gtest.h>

#include <regex>
#include <set>
#include <string>
#include <type_traits>

#include "core/files.h"

namespace tsdfpp {
namespace {

static_assert(!std::is_default_constructible_v<Direction>);
static_assert(!std::is_default_constructible_v<SweepMetric>);
static_assert(!std::is_default_constructible_v<EvaluationColumn>);

TEST(SweepMetrics, EveryRowIsWhole) {
  std::set<std::string> names;
  for (const SweepMetric& metric : SweepMetrics()) {
    EXPECT_TRUE(names.insert(metric.name).second) << metric.name << " is there twice";
    EXPECT_NE(metric.words, "") << metric.name;
    EXPECT_NE(metric.words, metric.name);
    EXPECT_GT(metric.definition.size(), 20U) << metric.name;
    EXPECT_EQ(metric.definition.find('\n'), std::string::npos) << metric.name;
  }
  EXPECT_EQ(MetricsJson().size(), SweepMetrics().size());
  EXPECT_EQ(FindMetric("seam_share")->better, Better::kLower);
  EXPECT_EQ(FindMetric("movers_completion")->better, Better::kHigher);
  EXPECT_EQ(FindMetric("map_mb")->better, Better::kLower);
}

TEST(SweepMetrics, ASharesMostIsOne) {
  EXPECT_EQ(MostOf(*FindMetric("table_preservation_behind_other")), 1);
  EXPECT_EQ(MostOf(*FindMetric("table_retention_behind_other")), std::nullopt) << "a ratio";
  EXPECT_EQ(MostOf(*FindMetric("table_hole_area_cm2")), std::nullopt) << "it has a unit";
}

// In the report a definition stands alone.
TEST(SweepMetrics, ADefinitionDoesNotPointAtAnother) {
  const std::regex pointer("\\bthe same\\b|^as kept|\\bthat share\\b");
  for (const EvaluationColumn& column : EvaluationColumns()) {
    EXPECT_FALSE(std::regex_search(column.definition, pointer)) << column.csv;
  }
}

// Of four times the two in the middle count, not the lower of them alone.
TEST(SweepMetrics, AStepsMedianIsAMedian) {
  RunTimes times;
  times.fuse_s = {0.008, 0.001, 0.004, 0.002};
  const auto fuse_ms = [&] {
    return MeasureAll({}, {}, {times, {}, std::nullopt})[MetricIndex("fuse_ms")].value.value();
  };
  EXPECT_DOUBLE_EQ(fuse_ms(), 3);
  times.fuse_s.push_back(0.005);
  EXPECT_DOUBLE_EQ(fuse_ms(), 4);
}

// What is lost has no distance; what nobody tells apart is not the moving object's.
TEST(SweepMetrics, TheMoversDistanceIsOfThoseThatAreThere) {
  Evaluation evaluation;
  evaluation.objects.resize(3);
  for (InstanceId id = 0; id < 3; ++id) evaluation.objects[id].info.id = id;
  evaluation.objects[1].accuracy.distance.rmse_m = Measured::Of(0.001);
  evaluation.objects[2].accuracy.distance.rmse_m = Measured::Undefined("it has no face");
  const auto off_mm = [&] {
    return MeasureAll(evaluation, {1, 2}, RunCosts{})[MetricIndex("movers_accuracy_rmse_mm")];
  };
  EXPECT_EQ(off_mm().value, 1.0);
  evaluation.labelled = false;
  EXPECT_EQ(off_mm().value, std::nullopt);
  EXPECT_EQ(off_mm().why_not, "the mesh has no labels");
}

TEST(SweepMetrics, TheTablesDistanceIsOfTheBackgroundAlone) {
  Evaluation evaluation;
  evaluation.objects.resize(1);
  evaluation.objects[0].accuracy.distance.rmse_m = Measured::Of(0.001);
  const auto off_mm = [&] {
    return MeasureAll(evaluation, {}, RunCosts{})[MetricIndex("table_accuracy_rmse_mm")];
  };
  EXPECT_EQ(off_mm().value, 1.0);
  evaluation.objects[0].info.id = 1;
  EXPECT_EQ(off_mm().value, std::nullopt);
  EXPECT_EQ(off_mm().why_not, "no true background is known");
}

// The first object of others' sets is no table.
TEST(SweepMetrics, HaveNoTableAndNoGhostsWithoutATrueBackground) {
  Evaluation evaluation;
  ObjectScores& car = evaluation.objects.emplace_back();
  car.info.id = 1;
  car.preserved.completion = Measured::Of(0.5);
  car.preserved.preservation_behind_other = Measured::Of(0.6);
  car.preserved.retention_behind_other = Measured::Of(0.6);
  car.preserved.hole_area_cm2 = Measured::Of(7);
  for (auto& cause : car.preserved.by_cause) cause.any_label = Measured::Of(0.6);
  car.visible_completion = Measured::Of(0.8);
  car.label_purity = Measured::Of(0.9);
  evaluation.ghost_area_m2 = 0.01;
  evaluation.revealed_ghost_area_m2 = Measured::Of(0.01);
  evaluation.revealed_unseen_area_m2 = Measured::Of(0.01);
  int undefined = 0;
  for (const EvaluationColumn& column : EvaluationColumns()) {
    if (!column.csv.starts_with("table_") && column.csv.find("ghost") == std::string::npos &&
        column.csv.find("unseen") == std::string::npos) {
      continue;
    }
    const Measured measured = column.value({}, evaluation);
    EXPECT_EQ(measured.value, std::nullopt) << column.csv;
    EXPECT_EQ(measured.why_not, "no true background is known") << column.csv;
    ++undefined;
  }
  EXPECT_EQ(undefined, 9);
  const std::vector<Measured> all = MeasureAll(evaluation, {1}, RunCosts{});
  EXPECT_EQ(all[MetricIndex("movers_completion")].value, 0.5);
  evaluation.objects.clear();  // these are written as they are
  const auto written = ToJson(evaluation);
  EXPECT_EQ(written["ghost_area_m2"]["why"], "no true background is known");
  EXPECT_EQ(written["revealed_unseen_area_m2"]["why"], "no true background is known");
}

TEST(SweepMetrics, ThePageIsMadeOfIt) {
  const std::string page = ReadFile(TSDFPP_SOURCE_DIR "/docs/metrics.md").value();
  EXPECT_NE(page.find(MetricsMarkdown()), std::string::npos)
      << "make it anew: /usr/bin/python3 scripts/pages.py make metric-list";
}

}  // namespace
}  // namespace tsdfpp
