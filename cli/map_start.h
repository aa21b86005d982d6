// What `tsdfpp map` begins with: an empty map and a sequence, a map from a file, or both.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "cli/mapping_options.h"
#include "cli/sequence_options.h"
#include "mapper/map_file.h"
#include "mapper/pipeline.h"

namespace tsdfpp {

// What was asked for beside a config; nothing: as the sequence is.
struct MapWishes {
  std::optional<Segmentation> segmentation;
  SegmenterParts segmenter{};
  std::optional<AssociationMode> associate;
  std::optional<VoteConfig> votes;
  CameraSource camera = CameraSource::kGiven;
  BleedingPixels bleeding = BleedingPixels::kAuto;
  RepairWishes repair;
  std::optional<PoseSource> poses;
  TrackWishes track;
};

struct MapStart {
  PipelineConfig config;
  std::unique_ptr<FrameSource> source;       // none where a map alone is loaded
  std::string mask_remark;                   // why all of it is taken for background, or empty
  std::string pose_remark;                   // why poses are tracked unasked, or empty
  std::vector<std::string> load_remarks;     // why a loaded map may not go on well
  std::optional<MappedRecording> recording;  // what the loaded map's file says of it
  std::optional<bool> has_masks;  // what each frame must have or lack; nothing: no matter
  SequenceInfo info;              // of the source, or what the map's file says
  int first = 1;                  // frames to map, none where last < first
  int last = 0;
  std::unique_ptr<Pipeline> pipeline;

  int frames() const { return last - first + 1; }  // to map
  // Whether the segments' ids are those of the sequence's objects.
  bool ids_are_objects() const {
    return info.mask_ids_are_objects && !IdsAreOfOneFrame(config.segmentation);
  }
  // Whether the map's objects are its own, found by votes.
  bool by_votes() const { return config.associate == AssociationMode::kVotes; }
};

// With an empty map. `until` is the last frame, or below 0 for the sequence's. Where nothing is
// wished, masks are those of the sequence if its first frame has one, association is by votes if
// the segments' ids are of one frame alone, and poses are DefaultPoses(); the config's
// association and poses are not looked at.
// Errors: those of OpenArguments; kUsage where `until` is out of range, ids of one frame are to be
// those of objects, given poses are to go with votes, the method has not what poses are to be
// tracked by, or what is wished of tracking does not fit the poses; kData where masks are asked for
// and there are none.
Expected<MapStart> StartNew(const PipelineConfig& config, const SequenceArguments& source,
                            const MapWishes& wishes, int until);

// With the map in `file`; goes on after its last frame where `source` names a sequence. Of `wishes`
// only segmentation, votes, bleeding, repair, camera and tracking are looked at, as the file has
// the rest. Errors: those of LoadMap and StartNew; kUsage where the sequence is another one than
// the map's (its name, objects, images' size or lens), ids of one frame would be those of objects,
// or nothing is left to map; kData where what the file says does not go together. What may be
// meant is said in `load_remarks`: another depth image of the map's last frame, a camera whose
// place nobody knows or asks for.
Expected<MapStart> StartLoaded(const std::string& file, const SequenceArguments& source,
                               const MapWishes& wishes, int until);

// Reads a frame to be mapped. Errors: kData also where it has a mask and others have none, or the
// other way round.
Expected<Frame> ReadToMap(const MapStart& start, int index);

// The objects of the map: those of the sequence and then, by id, those that masks showed besides;
// or with votes the map's own.
std::vector<ObjectInfo> ObjectsOf(const MapStart& start);

// Of MappedRecording.
std::uint64_t HashOfDepth(const Frame& frame);

// What a file says beside the map, so that the run can go on. `last_depth` is the last frame's;
// nothing where none was mapped.
MappedRun RunOf(const MapStart& start, int last_frame, std::optional<std::uint64_t> last_depth);

}  // namespace tsdfpp
