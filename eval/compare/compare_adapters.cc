#include "eval/compare/compare_adapters.h"

#include <algorithm>

#include "core/folders.h"
#include "core/one_line.h"

namespace tsdfpp {
namespace {

// What an adapter left beside its own folder would become files of the run, or stand in their way.
void RemoveStrays(AdapterRun& run, const std::filesystem::path& out,
                  const std::vector<std::filesystem::path>& before) {
  for (const std::filesystem::path& entry : EntriesOf(out)) {
    if (entry == out / run.config.name || std::binary_search(before.begin(), before.end(), entry)) {
      continue;
    }
    std::error_code ignored;
    std::filesystem::remove_all(entry, ignored);
    run.remarks.push_back(fmt::format("{}: left {} beside its own folder, which is removed",
                                      run.config.name, Quoted(entry.filename().string())));
  }
}

// Folders nested so deep that no path leads to what is in them would be the comparison's end.
void RemoveWhatCannotBeListed(AdapterRun& run) {
  const auto files = ListFilesBelow(run.folder);
  if (files) return;
  std::error_code ignored;
  std::filesystem::remove_all(run.folder, ignored);
  std::filesystem::create_directory(run.folder, ignored);
  run.Fail({ErrorKind::kData,
            WithShownFolder(run, fmt::format("{}: what it left is removed: {}", run.config.name,
                                             files.error().message))});
}

}  // namespace

Expected<AdapterTask> TaskForAdapters(const CompareResult& result) {
  const CompareConfig& config = result.config;
  const int first = result.info.first_index;
  AdapterTask task{{}, first, result.last_frame, {}, result.movers, config.map.voxel_m, 0};
  for (int index = first; index <= result.last_frame; ++index) {
    if (IsEvaluated(result, index)) task.frames.push_back(index);
  }
  MapConfig settings = config.map;
  if (!config.profiles.empty()) {
    TSDFPP_RETURN_IF_ERROR(settings.SetProfile(config.profiles.front()));
  }
  task.truncation_m = settings.voxel_m * settings.trunc_front_voxels;
  task.truncation_back_m = settings.voxel_m * settings.trunc_back_voxels;
  return task;
}

Expected<void> RunAdapters(FrameSource& source, const AdapterTask& given, const RunFolder& folder,
                           CompareResult& result) {
  const std::filesystem::path& out = folder.path();
  std::map<DatasetFormat, std::filesystem::path> sequences;
  Expected<void> done;
  for (const AdapterConfig& adapter : result.config.adapters) {
    const DatasetFormat layout = adapter.layout;
    std::filesystem::path& sequence = sequences[layout];
    if (sequence.empty()) {
      sequence = out / fmt::format(".sequence-{}", DatasetFormatName(layout));
      std::error_code ignored;
      std::filesystem::remove_all(sequence, ignored);
      done = WriteForAdapters(source, layout, result.last_frame, sequence);
    }
    if (!done) break;
    AdapterTask task = given;
    task.sequence = sequence;
    AdapterRun& run = *result.adapters.emplace_back(std::make_unique<AdapterRun>(adapter));
    const std::vector<std::filesystem::path> before = EntriesOf(out);
    done = RunAdapter(run, task, out / adapter.name, folder.out() / adapter.name);
    if (!done) break;
    RemoveStrays(run, out, before);
    RemoveWhatCannotBeListed(run);
  }
  for (const auto& [layout, sequence] : sequences) {
    std::error_code ignored;
    std::filesystem::remove_all(sequence, ignored);
  }
  return done;
}

void ScoreAdapterTrajectories(AdapterRun& run, const std::vector<ObjectInfo>& names,
                              const std::map<InstanceId, Trajectory>& truth,
                              const Trajectory& camera) {
  const std::filesystem::path folder = run.folder / "trajectories";
  std::error_code ignored;
  if (run.failure || run.matches.empty() || !std::filesystem::exists(folder, ignored)) return;
  auto scores = EvaluateTrajectories(folder, names, run.matches.back(), truth, camera);
  if (scores) {
    run.trajectories = std::move(*scores);
  } else {
    run.Fail({scores.error().kind, WithShownFolder(run, fmt::format("{}: {}", run.config.name,
                                                                    scores.error().message))});
  }
}

}  // namespace tsdfpp
