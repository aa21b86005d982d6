// Runs an experiment: every cell once, in worker processes, and goes on where an earlier run
// stopped.
#pragma once

#include <atomic>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "eval/sweep/cell.h"
#include "eval/sweep/experiment.h"

namespace tsdfpp {

struct SweepOptions {
  std::filesystem::path out;
  int jobs = 1;     // worker processes, one a sequence at a time
  int threads = 0;  // of each worker; 0: the cores, shared among them
  // Set by a signal handler to stop. The handler must be installed without SA_RESTART.
  const std::atomic<bool>* stop = nullptr;
  // Frames that were mapped, of all that are to be mapped.
  std::function<void(int done, int total)> progress;
};

// An experiment whose cells are all there.
struct SweepResult {
  ExperimentConfig config;
  std::string program;
  std::string renderer;
  struct Entry {
    std::string grid;
    Cell cell;
    CellResult result;
  };
  std::vector<Entry> entries;                        // in the order of CellsOf(config)
  std::map<std::string, SequenceVariant> sequences;  // by Cell::sequence
  int cells = 0;                                     // different ones
  int run_now = 0;                                   // of those, made by this call
};

// The cells of an experiment and the sequences that they need.
struct SweepPlan {
  std::string program;
  std::string renderer;
  struct Entry {
    std::string grid;
    Cell cell;
  };
  std::vector<Entry> entries;                        // in the order of CellsOf
  std::map<std::string, SequenceVariant> sequences;  // by Cell::sequence
};

// Renders nothing, but asks a child process what would render. Call it while the process has one
// thread. Errors: kUsage, naming experiment and grid, where a setting does not fit a scene; those
// of scenes; kEnvironment where nothing renders.
Expected<SweepPlan> PlanSweep(const ExperimentConfig& config);

// Runs what is not yet below `options.out`: cells/<id>.json a cell, sequences/<id>/scene.toml a
// sequence (with its inputs). Each file is whole or not there. Then writes what
// eval/sweep/sweep_report.h says. Call it while the process has one thread.
// Errors: those of PlanSweep; kUsage where a link would lead results out of the folder, or one of
// them would replace a file that no experiment left; kEnvironment where it was stopped, a worker
// died, the disk refuses, or another process works in the folder; those of RunCells.
Expected<SweepResult> RunSweep(const ExperimentConfig& config, const SweepOptions& options);

}  // namespace tsdfpp
