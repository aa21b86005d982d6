#include "cli/map_start.h"

namespace tsdfpp {

Expected<MapStart> StartNew(const PipelineConfig& config, const SequenceArguments& source,
                            int until) {
  MapStart start;
  start.config = config;
  TSDFPP_ASSIGN(MaskedSource masked, OpenWithMasks(source));
  start.source = std::move(masked.source);
  start.mask_remark = std::move(masked.remark);
  start.info = start.source->info();
  start.first = start.info.first_index;
  const int end = start.info.first_index + start.info.frame_count - 1;
  start.last = until < 0 ? end : until;
  if (start.last < start.first || start.last > end) {
    return UsageError("--until {} is out of range: {} has frames {} to {}", start.last,
                      start.info.name, start.first, end);
  }
  start.pipeline = std::make_unique<Pipeline>(config, start.info.objects);
  return start;
}

Expected<MapStart> StartLoaded(const std::string& file, const SequenceArguments& source,
                               int until) {
  TSDFPP_ASSIGN(LoadedMap loaded, LoadMap(file));
  MappedRun run;
  if (loaded.run) {
    run = std::move(*loaded.run);
  } else {
    // Saved by another program, which had no sequence.
    run.poses = PoseSourceName(PoseSource::kGiven);
    for (const InstanceId id : loaded.map->Objects()) {
      run.objects.push_back(
          {id, id == kBackground ? "background" : fmt::format("object{}", id), ""});
    }
  }
  MapStart start;
  start.config.method = loaded.map->method();
  start.config.map = loaded.map->config();
  TSDFPP_ASSIGN(start.config.poses, PoseSourceFromName(run.poses));
  start.info.name = run.sequence;
  start.info.objects = run.objects;
  start.first = run.last_frame + 1;
  start.last = run.last_frame;
  if (!source.path.empty()) {
    TSDFPP_ASSIGN(MaskedSource masked, OpenWithMasks(source));
    start.source = std::move(masked.source);
    start.mask_remark = std::move(masked.remark);
    start.info = start.source->info();
    if (!loaded.run || start.info.name != run.sequence || start.info.objects != run.objects) {
      return UsageError("--load {} is a map of '{}', expected one of {}, '{}'", file, run.sequence,
                        source.path, start.info.name);
    }
    const int end = start.info.first_index + start.info.frame_count - 1;
    start.last = until < 0 ? end : until;
    if (start.last < start.first || start.last > end) {
      return UsageError(
          "--until {} is out of range: {} has frames up to {}, and --load {} goes to {}",
          start.last, start.info.name, end, file, run.last_frame);
    }
  } else if (until >= 0) {
    return UsageError("--until {} needs a sequence to map", until);
  }
  start.pipeline = std::make_unique<Pipeline>(start.config, run.objects, std::move(loaded.map),
                                              std::move(run.trajectories));
  return start;
}

MappedRun RunOf(const MapStart& start, int last_frame) {
  MappedRun run;
  run.sequence = start.info.name;
  run.objects = start.info.objects;
  run.poses = PoseSourceName(start.config.poses);
  run.last_frame = last_frame;
  run.trajectories = start.pipeline->trajectories();
  return run;
}

}  // namespace tsdfpp
