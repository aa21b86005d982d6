// Depth of an orbiting camera read in a wrong unit: what users of other systems suffer in silence.
#include <gtest/gtest.h>

#include "core/intrinsics.h"
#include "sequence/export.h"
#include "sequence/open_sequence.h"
#include "sim/load_scene.h"
#include "sim/simulated_source.h"
#include "tests/core/temp_folder.h"

namespace tsdfpp {
namespace {

TEST(WrongUnits, AreNamedOnAnExportOfOurs) {
  const test::TempFolder folder;
  const auto path = std::filesystem::path(TSDFPP_SOURCE_DIR) / "scenes" / "mini.toml";
  SceneConfig scene = LoadSceneConfig(path).value();
  scene.intrinsics = Scaled(scene.intrinsics, 0.5);
  const auto source = SimulatedSource::Open(scene, {}).value();
  const auto out = folder.path() / "tum";
  ASSERT_TRUE(ExportSequence(*source, DatasetFormat::kTum, out, {}).has_value());
  SequenceOptions options;
  options.depth_units_per_m = 5000;
  EXPECT_TRUE(OpenSequence(out, options).has_value());
  for (const double wrong : {1000, 2000, 10000}) {
    options.depth_units_per_m = wrong;
    const auto read = OpenSequence(out, options);
    ASSERT_FALSE(read.has_value()) << wrong;
    EXPECT_EQ(read.error().kind, ErrorKind::kData);
    EXPECT_NE(read.error().message.find("looks like 5000 units a metre"), std::string::npos)
        << read.error().message;
  }
}

}  // namespace
}  // namespace tsdfpp
