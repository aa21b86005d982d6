// What `tsdfpp map` begins with: an empty map and a sequence, a map from a file, or both.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "cli/sequence_options.h"
#include "mapper/map_file.h"
#include "mapper/pipeline.h"

namespace tsdfpp {

struct MapStart {
  PipelineConfig config;
  std::unique_ptr<FrameSource> source;  // none where a map alone is loaded
  std::string mask_remark;              // why all of it is taken for background, or empty
  std::optional<bool> has_masks;        // what each frame must have or lack; nothing: no matter
  SequenceInfo info;                    // of the source, or what the map's file says
  int first = 1;                        // frames to map, none where last < first
  int last = 0;
  std::unique_ptr<Pipeline> pipeline;
};

// With an empty map. `until` is the last frame, or below 0 for the sequence's. Masks are those of
// the sequence where `segmentation` is nothing and its first frame has one.
// Errors: those of OpenArguments; kUsage where `until` is out of range; kData where masks are asked
// for and there are none.
Expected<MapStart> StartNew(const PipelineConfig& config, const SequenceArguments& source,
                            std::optional<Segmentation> segmentation, int until);

// With the map in `file`; goes on after its last frame where `source` names a sequence.
// Errors: those of LoadMap and StartNew; kUsage where the sequence is another one than the map's,
// or nothing is left to map.
Expected<MapStart> StartLoaded(const std::string& file, const SequenceArguments& source,
                               std::optional<Segmentation> segmentation, int until);

// Reads a frame to be mapped. Errors: kData also where it has a mask and others have none, or the
// other way round.
Expected<Frame> ReadToMap(const MapStart& start, int index);

// What a file says beside the map, so that the run can go on.
MappedRun RunOf(const MapStart& start, int last_frame);

}  // namespace tsdfpp
