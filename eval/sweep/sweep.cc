#include "eval/sweep/sweep.h"

#include <spdlog/spdlog.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cstdlib>
#include <map>
#include <opencv2/core.hpp>
#include <set>
#include <thread>

#include "core/files.h"
#include "core/folders.h"
#include "eval/run/folder_lock.h"
#include "eval/run/program_identity.h"
#include "eval/run/workers.h"
#include "eval/sweep/cell_run.h"
#include "eval/sweep/sweep_report.h"
#include "sim/render/gl_context.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;

// Maps that one worker holds in memory at a time; more cells of a sequence render it again.
constexpr std::size_t kMapsAtOnce = 16;

// In the folder of the results.
constexpr const char* kCells = "cells";
constexpr const char* kSequences = "sequences";

// What a worker does in one go.
struct Task {
  const SequenceVariant* variant = nullptr;
  std::vector<const Cell*> cells;
};

Expected<std::string> AskForRenderer() {
  TSDFPP_ASSIGN(Workers workers, Workers::Start(1, [](Channel& parent) -> Expected<void> {
                  TSDFPP_ASSIGN(const auto context, GlContext::Create());
                  const GlInfo& gl = context->info();
                  parent.Send(fmt::format("{}, {}, {}", gl.backend, gl.renderer, gl.version));
                  return {};
                }));
  std::string renderer;
  while (true) {
    TSDFPP_ASSIGN(const auto next, workers.Next());
    if (!next && workers.running() == 0) break;
    if (next) renderer = next->line;
  }
  return renderer;
}

std::vector<Task> TasksOf(const SweepPlan& plan, const CellStore& store) {
  std::vector<Task> tasks;
  std::set<std::string> planned;
  for (const auto& [id, variant] : plan.sequences) {
    // Those of one map stay together.
    std::vector<std::vector<const Cell*>> maps;
    std::map<std::string, std::size_t> map_of;
    for (const SweepPlan::Entry& entry : plan.entries) {
      if (entry.cell.sequence != id || !planned.insert(entry.cell.id).second) continue;
      if (store.Has(entry.cell)) continue;
      const auto [map, is_new] = map_of.try_emplace(SharedMapKey(entry.cell.settings), maps.size());
      if (is_new) maps.emplace_back();
      maps[map->second].push_back(&entry.cell);
    }
    Task task{&variant, {}};
    for (std::size_t m = 0; m < maps.size(); ++m) {
      task.cells.insert(task.cells.end(), maps[m].begin(), maps[m].end());
      if ((m + 1) % kMapsAtOnce == 0) {
        tasks.push_back(task);
        task.cells.clear();
      }
    }
    if (!task.cells.empty()) tasks.push_back(std::move(task));
  }
  // The longest first, so that no worker is left with it in the end.
  std::stable_sort(tasks.begin(), tasks.end(), [](const Task& a, const Task& b) {
    return a.variant->frames.size() * a.cells.size() > b.variant->frames.size() * b.cells.size();
  });
  return tasks;
}

Expected<void> WriteSequences(const SweepPlan& plan, const fs::path& out) {
  for (const auto& [id, variant] : plan.sequences) {
    const fs::path folder = out / kSequences / id;
    std::error_code ignored;
    if (fs::exists(folder / "scene.toml", ignored)) continue;
    for (const auto& [place, file] : variant.inputs) {
      TSDFPP_ASSIGN(const std::string bytes, ReadFile(file));
      TSDFPP_RETURN_IF_ERROR(WriteFile(folder / place, bytes));
    }
    TSDFPP_RETURN_IF_ERROR(WriteFile(folder / "scene.toml", variant.scene_text));
  }
  return {};
}

// Whether an experiment ran here before: each left its sequences first.
bool RanBefore(const fs::path& out) {
  constexpr std::size_t kIdLength = 16;
  const std::vector<fs::path> entries = EntriesOf(out / kSequences);
  return std::any_of(entries.begin(), entries.end(), [](const fs::path& entry) {
    const std::string id = entry.filename().string();
    return id.size() == kIdLength && id.find_first_not_of("0123456789abcdef") == id.npos &&
           IsThere(entry / "scene.toml");
  });
}

// Errors: kUsage where a link would lead results out of the folder, or where one of them would
// replace a file that no experiment left.
Expected<void> CheckPlaces(const SweepPlan& plan, const fs::path& out) {
  TSDFPP_RETURN_IF_ERROR(CheckWay(out, fs::path(kCells) / "any"));
  for (const auto& [id, variant] : plan.sequences) {
    const fs::path folder = fs::path(kSequences) / id;
    TSDFPP_RETURN_IF_ERROR(CheckWay(out, folder / "scene.toml"));
    for (const auto& [place, file] : variant.inputs) {
      TSDFPP_RETURN_IF_ERROR(CheckWay(out, folder / place));
    }
  }
  const bool ran_before = RanBefore(out);
  for (const char* name : kSweepFiles) {
    std::error_code failure;
    const fs::file_status there = fs::symlink_status(out / name, failure);
    if (!fs::exists(there) || (ran_before && fs::is_regular_file(there))) continue;
    return UsageError("{}: is of no earlier run and would be replaced, expected another folder",
                      (out / name).string());
  }
  return {};
}

// What killed processes were just writing (core/files.h). Beside these folders somebody else's may
// lie, and what is written there takes over its own halves.
void RemoveHalves(const fs::path& out) {
  for (const char* folder : {kCells, kSequences}) {
    const auto files = ListFilesBelow(out / folder);
    if (!files) continue;
    for (const fs::path& file : *files) {
      std::error_code ignored;
      if (file.extension() != ".part" || file.filename().string().front() != '.') continue;
      fs::remove(file, ignored);
    }
  }
}

Expected<void> Work(const std::vector<Task>& tasks, const CellStore& store, int threads,
                    Channel& parent) {
  // Several software renderers with several threads each would fight.
  setenv("LP_NUM_THREADS", "1", 0);
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism,
                                  static_cast<std::size_t>(threads));
  cv::setNumThreads(threads);
  spdlog::set_level(spdlog::level::err);
  while (const auto order = parent.Receive()) {
    const Task& task = tasks[std::strtoul(order->c_str(), nullptr, 10)];
    TSDFPP_ASSIGN(const std::vector<CellResult> results,
                  RunCells(*task.variant, task.cells, [&] { parent.Send("frame"); }));
    for (std::size_t i = 0; i < results.size(); ++i) {
      TSDFPP_RETURN_IF_ERROR(store.Write(*task.cells[i], results[i]));
    }
    parent.Send("next");
  }
  return {};
}

Expected<void> RunTasks(const std::vector<Task>& tasks, const CellStore& store,
                        const SweepOptions& options) {
  if (tasks.empty()) return {};
  const int jobs = std::clamp(options.jobs, 1, static_cast<int>(tasks.size()));
  const int cores = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  const int threads = options.threads > 0 ? options.threads : std::max(1, cores / jobs);
  TSDFPP_ASSIGN(Workers workers, Workers::Start(jobs, [&](Channel& parent) {
                  return Work(tasks, store, threads, parent);
                }));
  int total = 0;
  for (const Task& task : tasks) total += static_cast<int>(task.variant->frames.size());
  int done = 0;
  std::size_t next_task = 0;
  const auto order = [&](int worker) {
    if (next_task == tasks.size()) {
      workers.Close(worker);
    } else {
      workers.Send(worker, std::to_string(next_task++));
    }
  };
  for (int i = 0; i < jobs; ++i) order(i);
  while (true) {
    const auto next = workers.Next();
    // A signal to the whole group ends the workers as well.
    if (options.stop != nullptr && *options.stop) {
      return EnvironmentError("{}: stopped; the same command goes on from there",
                              options.out.string());
    }
    if (!next) return tl::unexpected(next.error());
    const auto& message = *next;
    if (!message) {
      if (workers.running() == 0) return {};
      continue;  // another signal
    }
    if (message->line == "next") {
      order(message->worker);
    } else if (options.progress) {
      options.progress(++done, total);
    }
  }
}

}  // namespace

Expected<SweepPlan> PlanSweep(const ExperimentConfig& config) {
  SweepPlan plan;
  plan.program = ProgramIdentity();
  VariantMaker maker(config.file.parent_path(), config.frames);
  std::vector<std::pair<PlannedCell, SequenceVariant>> planned;
  for (PlannedCell& cell : CellsOf(config)) {
    const auto in_grid = [&](const Error& error) {
      return tl::unexpected(Error{error.kind, fmt::format("{}: grid '{}': {}", config.file.string(),
                                                          cell.grid, error.message)});
    };
    // Each value is sound by itself; together they may not be.
    if (const auto map = cell.settings.Pipeline(); !map) return in_grid(map.error());
    auto variant = maker.Make(cell.settings);
    if (!variant) return in_grid(variant.error());
    planned.emplace_back(std::move(cell), std::move(*variant));
  }
  TSDFPP_ASSIGN(plan.renderer, AskForRenderer());
  for (auto& [cell, variant] : planned) {
    Cell made = MakeCell(cell.settings, variant, plan.program, plan.renderer);
    plan.sequences.try_emplace(made.sequence, std::move(variant));
    plan.entries.push_back({cell.grid, std::move(made)});
  }
  return plan;
}

Expected<SweepResult> RunSweep(const ExperimentConfig& config, const SweepOptions& options) {
  TSDFPP_ASSIGN(const SweepPlan plan, PlanSweep(config));
  TSDFPP_RETURN_IF_ERROR(MakeWritableFolder(options.out));
  TSDFPP_ASSIGN(const FolderLock lock, FolderLock::Take(options.out));
  TSDFPP_RETURN_IF_ERROR(CheckPlaces(plan, options.out));
  RemoveHalves(options.out);
  const CellStore store(options.out / kCells);
  TSDFPP_RETURN_IF_ERROR(WriteSequences(plan, options.out));
  const std::vector<Task> tasks = TasksOf(plan, store);
  TSDFPP_RETURN_IF_ERROR(RunTasks(tasks, store, options));

  SweepResult result{config, plan.program, plan.renderer, {}, plan.sequences, 0, 0};
  for (const Task& task : tasks) result.run_now += static_cast<int>(task.cells.size());
  std::set<std::string> different;
  for (const SweepPlan::Entry& entry : plan.entries) {
    TSDFPP_ASSIGN(CellResult cell, store.Read(entry.cell));
    different.insert(entry.cell.id);
    result.entries.push_back({entry.grid, entry.cell, std::move(cell)});
  }
  result.cells = static_cast<int>(different.size());
  TSDFPP_RETURN_IF_ERROR(WriteSweep(result, options.out));
  return result;
}

}  // namespace tsdfpp
