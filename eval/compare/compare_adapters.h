// Other people's mappers in a comparison (eval/adapters/): what they are asked for, how they are
// run on its frames, and what is scored besides their meshes.
#pragma once

#include "eval/compare/compare.h"
#include "eval/run/run_folder.h"

namespace tsdfpp {

// What every adapter is asked for: the frames that are evaluated, the map's voxel size, and the
// first profile's truncation. The folder of the frames is not set. Errors: kUsage, an unknown
// profile.
Expected<AdapterTask> TaskForAdapters(const CompareResult& result);

// Runs the adapters of the config, one after the other, on the frames as they are given to a
// mapper, and appends them to the result; each into its own folder below the run's. One that fails
// says so, and the others go on. Errors: those of the source; kEnvironment where the frames cannot
// be written.
Expected<void> RunAdapters(FrameSource& source, const AdapterTask& given, const RunFolder& folder,
                           CompareResult& result);

// Scores what an adapter wrote of its trajectories, if anything, against those of `truth` and the
// true `camera`. What is wrong with them is the adapter's failure.
void ScoreAdapterTrajectories(AdapterRun& run, const std::vector<ObjectInfo>& names,
                              const std::map<InstanceId, Trajectory>& truth,
                              const Trajectory& camera);

}  // namespace tsdfpp
