// Prints what one evaluation costs on this machine: a room of 4 m x 4 m with a table, two cars
// and four toys, a mesh of 300,000 triangles, before and after a removal. Not a test: times vary.
#include <chrono>
#include <cstdio>
#include <memory>

#include "metrics/accuracy.h"
#include "metrics/ghosts.h"
#include "metrics/mesh_tools.h"
#include "metrics/preservation.h"
#include "tests/metrics/test_scenes.h"

namespace tsdfpp {
namespace {

constexpr double kVoxel_m = 0.01;

class Stopwatch {
 public:
  void Lap(const char* what) {
    const auto now = std::chrono::steady_clock::now();
    const double ms = std::chrono::duration<double, std::milli>(now - last_).count();
    std::printf("  %-52s %7.1f ms\n", what, ms);
    total_ms_ += ms;
    last_ = std::chrono::steady_clock::now();
  }
  double total_ms() const { return total_ms_; }

 private:
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
  double total_ms_ = 0;
};

// The camera looks straight down from 1.5 m above the table, which lies at z = 0.
TriangleMesh Toy(int cells) {
  return testing::Box({-0.1F, -0.06F, 0.001F}, {0.1F, 0.06F, 0.1F}, cells);
}
Pose ToyPose(int toy) { return Pose(Eigen::Translation3d(0.25 * toy - 0.75, 0.1 * (toy % 3), 0)); }

Frame Look() {
  Frame frame = testing::CastFrame(
      [](double x, double y) {
        for (int toy = 0; toy < 6; ++toy) {
          const Eigen::Vector3d t = ToyPose(toy).translation();
          // Upside down: the camera's y is the world's -y.
          if (std::abs(1.4 * x - t.x()) < 0.1 && std::abs(-1.4 * y - t.y()) < 0.06) {
            return testing::Hit{1.4, static_cast<InstanceId>(toy + 1)};
          }
        }
        const bool table = std::abs(1.5 * x) < 0.8 && std::abs(1.5 * y) < 0.45;
        return testing::Hit{table ? 1.5 : 2.2, kBackground};
      },
      {960, 540, 564.3, 564.3, 479.5, 269.5});
  frame.T_WC = Pose(Eigen::Translation3d(0, 0, 1.5) *
                    Eigen::AngleAxisd(std::numbers::pi, Eigen::Vector3d::UnitX()));
  return frame;
}

TrueModel Room() {
  TrueModel room =
      testing::Model(kBackground, testing::Box({-0.8F, -0.45F, -0.03F}, {0.8F, 0.45F, 0}));
  room.regions = {"table", "floor", "wall"};
  const auto add = [&](const TriangleMesh& mesh, std::uint16_t region) {
    testing::Append(room.mesh_O, mesh);
    room.face_region.resize(room.mesh_O.triangles.size(), region);
  };
  add(testing::Box({-2, -2, -0.75F}, {2, 2, -0.7F}), 1);
  add(testing::Box({-2, 2, -0.7F}, {2, 2.1F, 1.8F}), 2);
  add(testing::Box({-2.1F, -2, -0.7F}, {-2, 2, 1.8F}), 2);
  return room;
}

// Triangles of half a voxel square, 1 mm off the truth.
TriangleMesh Reconstruction() {
  TriangleMesh mesh = testing::Sheet({-0.8F, -0.45F, 0.001F}, {1.6F, 0, 0}, {0, 0.9F, 0}, 120);
  testing::Append(mesh, testing::Sheet({-2, -2, -0.699F}, {4, 0, 0}, {0, 4, 0}, 280));
  testing::Append(mesh, testing::Sheet({-2, 1.999F, -0.7F}, {4, 0, 0}, {0, 0, 2.5F}, 170));
  testing::Append(mesh, testing::Sheet({-1.999F, -2, -0.7F}, {0, 4, 0}, {0, 0, 2.5F}, 60));
  testing::Label(mesh, kBackground);
  for (int toy = 0; toy < 6; ++toy) {
    TriangleMesh one = Toy(20);
    one.vertices = TransformPoints(ToyPose(toy), one.vertices);
    testing::Label(one, static_cast<InstanceId>(toy + 1));
    testing::Append(mesh, one);
  }
  return mesh;
}

int Run() {
  Stopwatch setup;
  std::printf("once a scene\n");
  std::vector<std::unique_ptr<TruthSurface>> truths;
  truths.push_back(std::make_unique<TruthSurface>(Room()));
  for (int toy = 0; toy < 6; ++toy) {
    truths.push_back(
        std::make_unique<TruthSurface>(testing::Model(static_cast<InstanceId>(toy + 1), Toy(20))));
  }
  std::vector<SeenTracker> trackers;
  std::vector<PlacedTruth> placed;
  std::size_t samples = 0;
  for (std::size_t o = 0; o < truths.size(); ++o) {
    trackers.emplace_back(SampleModel(truths[o]->model(), {}), truths[o]->id());
    placed.push_back(
        {truths[o].get(), o == 0 ? Pose::Identity() : ToyPose(static_cast<int>(o) - 1)});
    samples += trackers.back().samples_O().size();
  }
  setup.Lap("true surfaces and samples");

  const Frame frame = Look();
  FreeSpace space;
  std::printf("a frame, %zu samples\n", samples);
  for (int i = 0; i < 3; ++i) {
    Stopwatch watch;
    for (std::size_t o = 0; o < trackers.size(); ++o) {
      if (!trackers[o].Observe(frame, placed[o].T_WO)) return 1;
    }
    watch.Lap("visibility of all samples");
    space.Observe(frame);
    watch.Lap("free space");
  }

  const TriangleMesh mesh = Reconstruction();
  std::vector<LastSeenStore> stores;
  for (const auto& tracker : trackers) stores.emplace_back(tracker.samples_O().size());
  const std::array<double, 3> thresholds = {0.5 * kVoxel_m, kVoxel_m, 2 * kVoxel_m};
  std::printf("an evaluation, %zu triangles\n", mesh.triangles.size());
  Stopwatch watch;
  for (std::size_t o = 0; o < 3; ++o) {  // the background and both cars
    const TriangleMesh own = FacesOf(mesh, truths[o]->id());
    const SurfaceIndex index(own);
    const Selection seen = SelectSeen(trackers[o], SelectAll(trackers[o].samples_O()));
    const SampleMatch match =
        MatchSamples(trackers[o].samples_O(), seen, placed[o].T_WO, index, thresholds[2]);
    const Selection reconstructed = Reconstructed(match, kVoxel_m);
    stores[o].Update(reconstructed, SelectSeenWith(trackers[o], SampleStatus::kVisible, seen));
    ScorePreservation(trackers[o], seen, reconstructed, stores[o]);
    CompletionDistances(trackers[o].samples_O(), seen, match);
    watch.Lap(o == 0 ? "completion, preservation: background" : "completion, preservation: a car");
    const SampleSet sampled = SampleReconstruction(own, {});
    ScoreAccuracy(sampled, placed[o], std::nullopt, thresholds);
    watch.Lap("accuracy");
    ScoreLabelPurity(sampled, truths[o]->id(), placed);
    watch.Lap("label purity");
  }
  ScoreGhosts(mesh, placed, {}, kVoxel_m, space);
  watch.Lap("ghosts");
  // After the cars' removal: the table behind them, and ghosts.
  const Selection table = SelectRegion(trackers[0].samples_O(), 0);
  const SurfaceIndex background(FacesOf(mesh, kBackground));
  const SampleMatch revealed =
      MatchSamples(trackers[0].samples_O(), SelectHidden(trackers[0], table), Pose::Identity(),
                   background, kVoxel_m);
  ScorePreservation(trackers[0], table, Reconstructed(revealed, kVoxel_m), stores[0]);
  watch.Lap("after removal: preservation of the table");
  const std::vector<PlacedTruth> cars(placed.begin() + 1, placed.begin() + 3);
  std::vector<PlacedTruth> stay = placed;
  stay.erase(stay.begin() + 1, stay.begin() + 3);
  ScoreGhosts(FacesWithout(mesh, {1, 2}), stay, cars, kVoxel_m, space);
  watch.Lap("after removal: ghosts");
  std::printf("  %-52s %7.1f ms\n", "sum", watch.total_ms());
  return 0;
}

}  // namespace
}  // namespace tsdfpp

int main() { return tsdfpp::Run(); }
