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

// An area that the true surfaces do not account for.
Measured GhostCm2(const Evaluation& evaluation, const Measured& m2) {
  return KnowsBackground(evaluation) ? Cm2(m2) : Measured::Undefined(kNoTrueBackground);
}

ObjectScores Unknown() {
  const Measured undefined = Measured::Undefined(kNoTrueBackground);
  ObjectScores scores;
  scores.preserved.preservation_behind_other = undefined;
  scores.preserved.retention_behind_other = undefined;
  scores.preserved.hole_area_cm2 = undefined;
  for (HiddenScores& hidden : scores.preserved.by_cause) hidden.any_label = undefined;
  scores.visible_completion = undefined;
  scores.accuracy.distance.rmse_m = undefined;
  scores.label_purity = undefined;
  return scores;
}

}  // namespace

const ObjectScores& TableOf(const Evaluation& evaluation) {
  static const ObjectScores unknown = Unknown();
  return KnowsBackground(evaluation) ? evaluation.objects.front() : unknown;
}

std::string ColumnText(const EvaluationColumn& column, const Movers& movers,
                       const Evaluation& evaluation) {
  const Measured value = column.value(movers, evaluation);
  if (!value.value) return "-";
  std::string text = fmt::format("{:.{}f}", *value.value, column.decimals);
  const Measured error = column.error ? column.error(evaluation) : Measured{};
  if (!error.value) return text;
  // One digit more than the value has, while the error is that small.
  return fmt::format("{} ±{:.{}f}", text, *error.value, column.decimals + (*error.value < 10));
}

// Longer than a page: it is a table, a row a metric.
const std::vector<EvaluationColumn>& EvaluationColumns() {
  static const std::vector<EvaluationColumn> columns{
      {"kept", "table_preservation_behind_other", "hidden table kept", "", Better::kHigher, 3,
       "occlusion preservation: share, by area, of the table's samples hidden "
       "behind another object that are reconstructed after the removal",
       [](const Movers&, const Evaluation& e) {
         return TableOf(e).preserved.preservation_behind_other;
       }},
      {"retention",
       "table_retention_behind_other",
       "retention of the hidden table",
       "",
       Better::kHigher,
       3,
       "share of the hidden table that is kept over the share that was "
       "reconstructed when an evaluation last saw those samples: it isolates "
       "forgetting from never having mapped; above 1 where the map gained. Empty "
       "until such samples exist",
       [](const Movers&, const Evaluation& e) {
         return TableOf(e).preserved.retention_behind_other;
       },
       {},
       true},
      {"hole cm2", "table_hole_area_cm2", "hole in the table", "cm²", Better::kLower, 0,
       "area of the table hidden behind another object x the share of it that is "
       "not kept",
       [](const Movers&, const Evaluation& e) { return TableOf(e).preserved.hole_area_cm2; }},
      {"visible", "visible_completion", "visible completion", "", Better::kHigher, 3,
       "share of all that is seen and visible now that the visible scene, "
       "nothing removed, has",
       [](const Movers&, const Evaluation& e) { return e.visible_completion; }},
      {"table", "table_visible_completion", "visible completion of the table", "", Better::kHigher,
       3,
       "share of the table that is seen and visible now and that the visible "
       "scene, nothing removed, has",
       [](const Movers&, const Evaluation& e) { return TableOf(e).visible_completion; }},
      {"movers", "movers_completion", "completion of the moving objects", "", Better::kHigher, 3,
       "completion of the moving objects over all that was seen of them, mean", MoversCompletion},
      {"ghost cm2", "ghost_area_cm2", "ghost area", "cm²", Better::kLower, 0,
       "reconstructed area farther than tau from every current true surface, "
       "outside the solids, in space that was seen to be free "
       "(`metrics/ghosts.h`)",
       [](const Movers&, const Evaluation& e) {
         return GhostCm2(e, Measured::Of(e.ghost_area_m2));
       },
       [](const Evaluation& e) { return GhostCm2(e, Measured::Of(e.ghost_error_m2)); }},
      {"ghost after", "revealed_ghost_area_cm2", "ghost area after the removal", "cm²",
       Better::kLower, 0,
       "reconstructed area after the removal, farther than tau from every current "
       "true surface, outside the solids, in space that is known to be free: seen "
       "so, or where a removed object was (in its solid or within tau of its "
       "surface, at its last pose)",
       [](const Movers&, const Evaluation& e) { return GhostCm2(e, e.revealed_ghost_area_m2); },
       [](const Evaluation& e) { return GhostCm2(e, e.revealed_ghost_error_m2); }},
      {"unseen after", "revealed_unseen_area_cm2", "surface in unseen space after the removal",
       "cm²", Better::kLower, 0,
       "reconstructed area after the removal, farther than tau from every current "
       "true surface, outside the solids, in the space that is not known to be "
       "free: behind things, outside all images, or where something moved away unseen. In truth "
       "nothing is there, but nobody has seen that, so no map can know",
       [](const Movers&, const Evaluation& e) { return GhostCm2(e, e.revealed_unseen_area_m2); },
       [](const Evaluation& e) { return GhostCm2(e, e.revealed_unseen_error_m2); }},
      {"sane", "sanity_all", "right pixels", "", Better::kHigher, 3,
       "share of mapped pixels for which the visible scene, cast from the "
       "camera, has the true depth within a voxel and the true id; pixels "
       "within max(2, ceil(1.5 f voxel / z)) of a depth or id edge are left "
       "out, and so are those at an incidence over 75° and those that the two "
       "frames before did not see. An unlabelled or hidden surface fails",
       [](const Movers&, const Evaluation& e) { return e.sanity.all; }},
      {"sane least", "sanity_least", "right pixels of the worst object", "", Better::kHigher, 3,
       "the least share of right pixels over the whole image and each object",
       [](const Movers&, const Evaluation& e) { return LeastSanity(e); }},
      {"seam", "seam_share", "missing background beside objects", "", Better::kLower, 4,
       "of the background's pixels in the border that `sanity_all` leaves out "
       "around the objects' outlines, the share at which the visible scene, cast from "
       "the camera, has nothing, or something more than a voxel behind the true "
       "depth. Asked are pixels that the two frames before saw as well, at an "
       "incidence under 75°. Where the border is also that of a step in the "
       "background itself (the table's rim before the floor), pixels are "
       "counted apart, in `summary.json` alone (`seams`: `elsewhere`): every "
       "map rounds such edges, and they would drown the ring around the objects",
       [](const Movers&, const Evaluation& e) { return e.seams.beside_objects.share; }},
      {"seam cm2", "seam_area_cm2", "ring of missing background around objects", "cm²",
       Better::kLower, 1,
       "the area of true surface that the missing pixels of `seam_share` see, "
       "each z^2 / (f_x f_y |n d|), with n the surface's normal and d = ((x - c_x) / f_x, (y - "
       "c_y) / "
       "f_y, 1): its footprint over the cosine of incidence",
       [](const Movers&, const Evaluation& e) {
         const SeamScore& seams = e.seams.beside_objects;
         return seams.share.value ? Measured::Of(kCm2PerM2 * seams.area_m2) : seams.share;
       }},
      {"bulge", "bulge_share", "background beside objects hidden by bulges", "", Better::kLower, 4,
       "of the pixels that `seam_share` asks, the share at which the cast has "
       "something more than a voxel in front of the true depth: an object "
       "that is too large, or a surface that was made up. What closes a seam "
       "must not pay with bulges",
       [](const Movers&, const Evaluation& e) { return e.seams.beside_objects.in_front; }},
      {"kept any label", "table_preservation_any_label", "hidden table kept under any label", "",
       Better::kHigher, 3,
       "share of the hidden table that is kept, with faces of any label: surface "
       "that was kept under another object's name counts",
       [](const Movers&, const Evaluation& e) {
         return TableOf(e).preserved.by_cause.front().any_label;
       }},
      {"purity", "table_label_purity", "purity of the table", "", Better::kHigher, 3,
       "share, after the removal, of the area that the map calls background "
       "whose nearest true surface is the background's; the truth keeps all "
       "that the world has, so the crust of a removed car under the table's "
       "name is impure",
       [](const Movers&, const Evaluation& e) { return TableOf(e).label_purity; }},
  };
  return columns;
}

}  // namespace tsdfpp
