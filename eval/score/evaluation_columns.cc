#include "eval/score/evaluation_columns.h"

#include <fmt/format.h>

#include "core/units.h"

namespace tsdfpp {
namespace {

using Movers = std::set<InstanceId>;

// Mean, over the moving objects, of their completion.
Measured MoversCompletion(const Movers& movers, const Evaluation& evaluation) {
  double sum = 0;
  int count = 0;
  for (const ObjectScores& object : evaluation.objects) {
    if (!movers.contains(object.info.id) || !object.preserved.completion.value) continue;
    sum += *object.preserved.completion.value;
    ++count;
  }
  return count == 0 ? Measured::Undefined("no moving object was seen") : Measured::Of(sum / count);
}

// The least share of right pixels of the whole image and of any object.
Measured LeastSanity(const Evaluation& evaluation) {
  Measured least = evaluation.sanity.all;
  for (const auto& [id, share] : evaluation.sanity.by_object) {
    if (share.value && (!least.value || *share.value < *least.value)) least = share;
  }
  return least;
}

Measured Cm2(const Measured& m2) { return m2.value ? Measured::Of(kCm2PerM2 * *m2.value) : m2; }

}  // namespace

std::string ColumnText(const EvaluationColumn& column, const Movers& movers,
                       const Evaluation& evaluation) {
  const Measured value = column.value(movers, evaluation);
  if (!value.value) return "-";
  const std::string text = fmt::format("{:.{}f}", *value.value, column.decimals);
  const Measured error = column.error ? column.error(evaluation) : Measured{};
  if (!error.value) return text;
  // One digit more than the value has, while the error is that small.
  return fmt::format("{} ±{:.{}f}", text, *error.value, column.decimals + (*error.value < 10));
}

const std::vector<EvaluationColumn>& EvaluationColumns() {
  static const std::vector<EvaluationColumn> columns{
      {"kept", "table_preservation_behind_other",
       [](const Movers&, const Evaluation& e) {
         return e.objects.front().preserved.preservation_behind_other;
       },
       3},
      {"retention", "table_retention_behind_other",
       [](const Movers&, const Evaluation& e) {
         return e.objects.front().preserved.retention_behind_other;
       },
       3},
      {"hole cm2", "table_hole_area_cm2",
       [](const Movers&, const Evaluation& e) { return e.objects.front().preserved.hole_area_cm2; },
       0},
      {"visible", "visible_completion",
       [](const Movers&, const Evaluation& e) { return e.visible_completion; }, 3},
      {"table", "table_visible_completion",
       [](const Movers&, const Evaluation& e) { return e.objects.front().visible_completion; }, 3},
      {"movers", "movers_completion", MoversCompletion, 3},
      {"ghost cm2", "ghost_area_cm2",
       [](const Movers&, const Evaluation& e) { return Measured::Of(kCm2PerM2 * e.ghost_area_m2); },
       0, [](const Evaluation& e) { return Measured::Of(kCm2PerM2 * e.ghost_error_m2); }},
      {"ghost after", "revealed_ghost_area_cm2",
       [](const Movers&, const Evaluation& e) { return Cm2(e.revealed_ghost_area_m2); }, 0,
       [](const Evaluation& e) { return Cm2(e.revealed_ghost_error_m2); }},
      {"unseen after", "revealed_unseen_area_cm2",
       [](const Movers&, const Evaluation& e) { return Cm2(e.revealed_unseen_area_m2); }, 0,
       [](const Evaluation& e) { return Cm2(e.revealed_unseen_error_m2); }},
      {"sane", "sanity_all", [](const Movers&, const Evaluation& e) { return e.sanity.all; }, 3},
      {"sane least", "sanity_least",
       [](const Movers&, const Evaluation& e) { return LeastSanity(e); }, 3},
      {"seam", "seam_share",
       [](const Movers&, const Evaluation& e) { return e.seams.beside_objects.share; }, 4},
      {"seam cm2", "seam_area_cm2",
       [](const Movers&, const Evaluation& e) {
         return Measured::Of(1e4 * e.seams.beside_objects.area_m2);
       },
       1},
      {"bulge", "bulge_share",
       [](const Movers&, const Evaluation& e) { return e.seams.beside_objects.in_front; }, 4},
      {"kept any label", "table_preservation_any_label",
       [](const Movers&, const Evaluation& e) {
         return e.objects.front().preserved.by_cause.front().any_label;
       },
       3},
      {"purity", "table_label_purity",
       [](const Movers&, const Evaluation& e) { return e.objects.front().label_purity; }, 3},
  };
  return columns;
}

}  // namespace tsdfpp
