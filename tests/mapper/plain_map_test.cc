// Whole maps by the plain kernels: the saved bytes, meshes and images of those by vectors.
#include <gtest/gtest.h>

#include "mapper/map_file.h"
#include "tests/mapper/every_method.h"
#include "tests/mapper/kernel_twins.h"
#include "tests/mapper/map_snapshot.h"

namespace tsdfpp {
namespace {

class PlainMap : public EveryMethodTest {};
TSDFPP_FOR_EVERY_VOXEL_METHOD(PlainMap);  // others use no kernels

std::string BytesOf(const std::vector<RaySurface>& surfaces) {
  std::string bytes;
  for (const RaySurface& surface : surfaces) {
    for (const cv::Mat& image : {surface.depth, surface.normal, surface.colour, surface.id}) {
      bytes.append(reinterpret_cast<const char*>(image.data), image.total() * image.elemSize());
    }
  }
  return bytes;
}

// Frames with a driven brick, a removal on the way, two surfaces along each ray.
struct Outcome {
  std::string saved;
  std::string snapshot;  // with the meshes
  std::string images;
};
Outcome OutcomeOf(Method method, const MapConfig& config) {
  const auto map = MakeMap(method, config);
  Outcome outcome;
  const Intrinsics camera{61, 45, 50.0, 51.0, 30.5, 22.0};  // tiles that do not fill the image
  RayCastOptions options;
  options.surfaces = 2;
  for (int i = 0; i < 3; ++i) {
    SetPosesThenFuse(*map, DriveFrame(i));
    outcome.images += BytesOf(map->CastRays(camera, CircleCamera(0.4 + i), options));
    if (i == 1) map->Remove(kTray);
  }
  outcome.saved = MapToBytes(*map).value();
  outcome.snapshot = SnapshotOf(*map, ToyIds());
  return outcome;
}

void ExpectTheSameMaps(Method method, const MapConfig& config) {
  const Outcome by_vectors = OutcomeOf(method, config);
  const PlainKernels plain;
  const Outcome plainly = OutcomeOf(method, config);
  EXPECT_GT(plainly.snapshot.size(), 100000U);
  EXPECT_TRUE(plainly.saved == by_vectors.saved);
  EXPECT_TRUE(plainly.snapshot == by_vectors.snapshot);
  EXPECT_TRUE(plainly.images == by_vectors.images);
}

TEST_P(PlainMap, IsTheSameToTheByte) { ExpectTheSameMaps(GetParam(), ToyConfig()); }

// The settings that choose other kernels, or other ways through them.
TEST_P(PlainMap, IsTheSameWithOtherSettings) {
  MapConfig config = ToyConfig(2);
  config.resampling = Resampling::kObserved;
  config.colour_whole_band = true;
  config.weight_cap = 2;  // full after two frames
  config.vote_band_voxels = 2;
  ExpectTheSameMaps(GetParam(), config);
}

TEST(PlainKernelsTest, NamesAreReadAsTheyAreWritten) {
  for (const Kernels kernels : {Kernels::kSimd, Kernels::kPlain}) {
    EXPECT_EQ(KernelsFromName(KernelsName(kernels)), kernels);
  }
  const auto unknown = KernelsFromName("fast");
  ASSERT_FALSE(unknown.has_value());
  EXPECT_EQ(unknown.error().kind, ErrorKind::kUsage);
  EXPECT_EQ(unknown.error().message, "kernels 'fast' are unknown, expected simd or plain");
  EXPECT_EQ(UsedKernels(), Kernels::kSimd) << "vectors are the default";
}

}  // namespace
}  // namespace tsdfpp
