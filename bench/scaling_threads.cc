// One thread and two, and how far the slowest frames are from the middle one.
#include <tbb/global_control.h>

#include <array>

#include "bench/clocks.h"
#include "bench/figure_runs.h"
#include "bench/scaling.h"
#include "bench/scaling_runs.h"
#include "mapper/scene_mesher.h"

namespace tsdfpp {
namespace {

constexpr int kThreadsFrames = 128;  // the cars start at frame 20
constexpr int kThreadsWarmUp = 10;   // frames
constexpr int kCastEvery = 8;        // frames
constexpr int kMeshEvery = 32;
constexpr std::array<int, 2> kThreads{1, 2};

struct Step {
  const char* name;
  std::vector<Times> runs;  // one for each run
};

// The steps of a frame, by run and frame.
struct Steps {
  std::array<Step, 5> steps{{{"update poses", {}},
                             {"fuse", {}},
                             {"poses and fusion", {}},
                             {"ray cast", {}},
                             {"scene mesh from scratch", {}}}};

  void StartRun() {
    for (Step& step : steps) step.runs.emplace_back();
  }
  void Add(std::size_t step, double ms) { steps[step].runs.back().ms.push_back(ms); }
};

void RunOnce(Method method, const MapConfig& config, const Footage& footage, int threads,
             Steps& steps) {
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism,
                                  static_cast<std::size_t>(threads));
  Pipeline pipeline = ScalingPipeline(method, config, footage.info.objects);
  RayCastOptions cast;
  cast.colour = false;
  steps.StartRun();
  int number = 0;
  for (const Frame& frame : footage.frames) {
    const StepTimes times = pipeline.Process(frame).value();
    if (++number <= kThreadsWarmUp) continue;
    steps.Add(0, 1e3 * times.update_poses_s);
    steps.Add(1, 1e3 * times.fuse_s);
    steps.Add(2, 1e3 * (times.update_poses_s + times.fuse_s));
    if (number % kCastEvery == 0) {
      const double start = WallMilliseconds();
      pipeline.map().CastRays(frame.intrinsics, frame.T_WC, cast);
      steps.Add(3, WallMilliseconds() - start);
    }
    if (number % kMeshEvery == 0) {
      SceneMesher from_scratch;
      const double start = WallMilliseconds();
      from_scratch.SceneMesh(pipeline.map());
      steps.Add(4, WallMilliseconds() - start);
    }
  }
}

// The run whose worst frame is the least times its median.
const Times& BestRun(const std::vector<Times>& runs) {
  return *std::min_element(runs.begin(), runs.end(), [](const Times& a, const Times& b) {
    return a.Worst() / a.Median() < b.Worst() / b.Median();
  });
}

}  // namespace

Expected<void> MeasureThreads(const ScalingOptions& options) {
  TSDFPP_ASSIGN(const Footage footage, Film({kMovingScene, 1, 1, kThreadsFrames, {}}));
  TSDFPP_ASSIGN(const MapConfig config, ScalingConfig());
  FigureTable table({"map", "step", "1 thread ms", "2 threads ms", "times faster"});
  FigureTable spread({"map", "median ms", "p99 ms", "worst ms", "worst over median"});
  for (const Method method : kScalingMethods) {
    const std::string name(MethodName(method));
    std::array<Steps, kThreads.size()> by_threads;
    // In turn, so that what else the machine does meets both.
    for (int run = 0; run < options.runs; ++run) {
      for (std::size_t t = 0; t < kThreads.size(); ++t) {
        RunOnce(method, config, footage, kThreads[t], by_threads[t]);
      }
    }
    for (std::size_t s = 0; s < by_threads[0].steps.size(); ++s) {
      const double one_ms = LeastOf(by_threads[0].steps[s].runs).Median();
      const double two_ms = LeastOf(by_threads[1].steps[s].runs).Median();
      table.Add({name, by_threads[0].steps[s].name, Cell(one_ms, 2), Cell(two_ms, 2),
                 Cell(one_ms / two_ms, 2)});
    }
    const Times& best = BestRun(by_threads[1].steps[2].runs);
    spread.Add({name, Cell(best.Median(), 2), Cell(best.Quantile(0.99), 2), Cell(best.Worst(), 2),
                Cell(best.Worst() / best.Median(), 2)});
  }
  TSDFPP_RETURN_IF_ERROR(table.Write(options.out, "threads"));
  return spread.Write(options.out, "spread");
}

}  // namespace tsdfpp
