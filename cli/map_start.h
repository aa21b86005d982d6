// What `tsdfpp map` begins with: an empty map and a sequence, a map from a file, or both.
#pragma once

#include <memory>
#include <string>

#include "cli/sequence_options.h"
#include "mapper/map_file.h"
#include "mapper/pipeline.h"

namespace tsdfpp {

struct MapStart {
  PipelineConfig config;
  std::unique_ptr<FrameSource> source;  // none where a map alone is loaded; frames have masks
  std::string mask_remark;              // that the sequence has none of its own, or empty
  SequenceInfo info;                    // of the source, or what the map's file says
  int first = 1;                        // frames to map, none where last < first
  int last = 0;
  std::unique_ptr<Pipeline> pipeline;
};

// With an empty map. `until` is the last frame, or below 0 for the sequence's.
// Errors: those of OpenWithMasks; kUsage where `until` is out of range.
Expected<MapStart> StartNew(const PipelineConfig& config, const SequenceArguments& source,
                            int until);

// With the map in `file`; goes on after its last frame where `source` names a sequence.
// Errors: those of LoadMap and OpenWithMasks; kUsage where the sequence is another one than the
// map's, or nothing is left to map.
Expected<MapStart> StartLoaded(const std::string& file, const SequenceArguments& source, int until);

// What a file says beside the map, so that the run can go on.
MappedRun RunOf(const MapStart& start, int last_frame);

}  // namespace tsdfpp
