// A cell's file is read as it was written, and not where it was edited.
#include "eval/sweep/cell.h"

#include <gtest/gtest.h>

#include <functional>
#include <string>
#include <utility>
#include <vector>

namespace tsdfpp {
namespace {

// A cell of frames 2 and 4, with figures as a run may leave them.
class StoredCell : public testing::Test {
 protected:
  void SetUp() override {
    variant_.scene_text = "scene";
    variant_.frames = {2, 4};
    variant_.evaluated = {2, 4};
    variant_.examined = 4;
    cell_ = MakeCell({}, variant_, "p", "r");
    CellResult result;
    for (std::size_t m = 0; m < SweepMetrics().size(); ++m) {
      result.examined.push_back(m % 3 == 0 ? Measured::Undefined("why " + SweepMetrics()[m].name)
                                           : Measured::Of(0.1 * static_cast<double>(m) / 3));
    }
    for (const int frame : {2, 4}) {
      result.frames.push_back({frame, frame == 4, result.examined, "abc"});
      result.frames.back().values.resize(EvaluationMetricCount());
    }
    result.removed = {1, 7};
    result.image_digests = {{2, "x"}, {4, "y"}};
    result.frame_ms = {1.5, 2};
    text_ = CellToJson(cell_, result).dump();
  }
  SequenceVariant variant_;
  Cell cell_;
  std::string text_;
};

TEST_F(StoredCell, ComesBackFromItsFile) {
  const auto back = CellFromJson(text_, cell_);
  ASSERT_TRUE(back.has_value()) << back.error().message;
  EXPECT_EQ(CellToJson(cell_, *back).dump(), text_);
  // Not of another key, not half of it.
  EXPECT_FALSE(CellFromJson(text_, MakeCell({}, variant_, "q", "r")).has_value());
  EXPECT_FALSE(CellFromJson(text_.substr(0, text_.size() / 2), cell_).has_value());
  EXPECT_FALSE(CellFromJson("{}", cell_).has_value());
  // The same cell in other words: its front truncation as a number, and another name of the scene.
  CellSettings words;
  words.scene = "another name of the same scene";
  words.trunc_front = words.Pipeline()->map.trunc_front_voxels;
  const Cell same = MakeCell(words, variant_, "p", "r");
  ASSERT_EQ(same.id, cell_.id);
  const auto other = CellFromJson(text_, same);
  EXPECT_TRUE(other.has_value()) << other.error().message;
}

// What no run can have written is no figure of any gate or plot.
TEST_F(StoredCell, IsNotReadWhereItWasEdited) {
  using nlohmann::json;
  const std::string share = "visible_completion";
  const std::vector<std::pair<const char*, std::function<void(json&)>>> edits{
      {"a share of 5",
       [&](json& c) { c["examined"][share] = c["frames"][1]["scores"][share] = 5; }},
      {"a negative share",
       [&](json& c) { c["examined"][share] = c["frames"][1]["scores"][share] = -0.5; }},
      {"a negative time", [](json& c) { c["examined"]["frame_ms"] = -1; }},
      {"other than the examined frame's", [&](json& c) { c["examined"][share] = 0.5; }},
      {"undefined here alone",
       [&](json& c) {
         c["examined"][share] = {{"value", nullptr}, {"why", "x"}};
       }},
      {"a reason without a value",
       [](json& c) {
         c["examined"][SweepMetrics().back().name] = {{"why", "x"}};
       }},
      {"no frames", [](json& c) { c["frames"] = json::array(); }},
      {"frames cut", [](json& c) { c["frames"].erase(0); }},
      {"frames doubled",
       [](json& c) {
         for (const int i : {0, 1}) c["frames"].push_back(json(c["frames"][i]));
       }},
      {"frames in another order", [](json& c) { std::swap(c["frames"][0], c["frames"][1]); }},
      {"frames a thousand later",
       [](json& c) {
         c["frames"][0]["frame"] = 1002;
         c["frames"][1]["frame"] = 1004;
       }},
      {"all examined", [](json& c) { c["frames"][0]["examined"] = true; }},
      {"none examined", [](json& c) { c["frames"][1]["examined"] = false; }},
      {"another id", [](json& c) { c["id"] = "0123456789abcdef"; }},
      {"another sequence", [](json& c) { c["sequence"] = "0123456789abcdef"; }},
      {"another method", [](json& c) { c["settings"]["method"] = "tsdf"; }},
      {"another seed", [](json& c) { c["settings"]["seed"] = 2; }},
      {"no settings", [](json& c) { c["settings"] = json::object(); }},
      {"images of no frame",
       [](json& c) {
         c["images"] = {{"2x", "x"}, {"4", "y"}};
       }},
      {"an image missing", [](json& c) { c["images"].erase("2"); }},
      {"an image too many", [](json& c) { c["images"]["6"] = "z"; }},
      {"a frame without a time", [](json& c) { c["times"]["frame_ms"] = {1.5}; }},
      {"a frame's time negative",
       [](json& c) {
         c["times"]["frame_ms"] = {1.5, -1};
       }},
  };
  for (const auto& [what, edit] : edits) {
    json edited = json::parse(text_);
    edit(edited);
    const auto read = CellFromJson(edited.dump(), cell_);
    ASSERT_FALSE(read.has_value()) << what;
    EXPECT_EQ(read.error().kind, ErrorKind::kData) << what;
    EXPECT_TRUE(read.error().message.starts_with("cell " + cell_.id + ": ")) << what;
  }
}

}  // namespace
}  // namespace tsdfpp
