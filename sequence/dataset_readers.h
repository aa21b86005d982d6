// Readers of other datasets' layouts. What each expects, its units and defaults: docs/datasets.md.
//
// All add to `notes` what they assume or leave out. Errors: kData, naming the file (and line), what
// was found and what was expected; kUsage where an option does not fit the dataset.
#pragma once

#include <filesystem>
#include <memory>

#include "sequence/file_source.h"
#include "sequence/sequence_options.h"

namespace tsdfpp {

// TUM RGB-D: rgb.txt, depth.txt, groundtruth.txt; associations.txt or associated.txt (either image
// first) replaces the search for the depth image nearest in time (kAssociationLimit_s); frames are
// in the order of the depth images' times; poses are interpolated at the depth image's time
// (timed_poses.h); frames without one are left out. mask/<stem of the colour image>.png holds ids.
// Default: 5000 units a metre, 525 525 319.5 239.5 at 640x480.
Expected<std::unique_ptr<DatasetSource>> OpenTum(const std::filesystem::path& folder,
                                                 const SequenceOptions& options,
                                                 SequenceNotes& notes);

// A scene folder of BOP (scene_camera.json...), or a folder with just one of them two levels below.
// An object's instances keep their ids from image to image by the nearest pose in the world; where
// an object has one instance its id is obj_id.
Expected<std::unique_ptr<DatasetSource>> OpenBop(const std::filesystem::path& folder,
                                                 const SequenceOptions& options,
                                                 SequenceNotes& notes);

// A .klg file of Co-Fusion or ElasticFusion, or a folder with just one. calibration.txt (fx fy cx
// cy [w h]), groundtruth.txt (TUM) and mask/%06d.png beside it are read. Default: 1000 units a
// metre, 528 528 320 240 at 640x480.
Expected<std::unique_ptr<DatasetSource>> OpenKlg(const std::filesystem::path& path,
                                                 const SequenceOptions& options,
                                                 SequenceNotes& notes);

// ScanNet as SensReader extracts it: color/, depth/, pose/, intrinsic/, instance-filt/. Frames with
// infinite poses are left out; colours and ids are sampled at the depth image's pixels. Default:
// 1000 units a metre, 577.870605 577.870605 319.5 239.5 at 640x480.
Expected<std::unique_ptr<DatasetSource>> OpenScannet(const std::filesystem::path& folder,
                                                     const SequenceOptions& options,
                                                     SequenceNotes& notes);

// Replica as NICE-SLAM lays it out: results/, traj.txt, cam_params.json here or one folder up.
Expected<std::unique_ptr<DatasetSource>> OpenReplica(const std::filesystem::path& folder,
                                                     const SequenceOptions& options,
                                                     SequenceNotes& notes);

// 7-Scenes: frame-%06d.{color.png|jpg,depth.png,pose.txt}, any subset of numbers;
// camera-intrinsics.txt; frame-%06d.mask.png of ids where we wrote them. Depth 0 and 65535 are
// invalid. Default: 1000 units a metre, 585 585 320 240 at 640x480.
Expected<std::unique_ptr<DatasetSource>> OpenSevenScenes(const std::filesystem::path& folder,
                                                         const SequenceOptions& options,
                                                         SequenceNotes& notes);

// Says, if there are any, how many of a folder's colour images are left out.
inline void SayColoursWithoutDepth(const std::filesystem::path& folder, int lost, int colours,
                                   SequenceNotes& notes) {
  if (lost <= 0) return;
  notes.push_back(fmt::format("{}: {} of {} colour images have no depth image and are left out",
                              folder.string(), lost, colours));
}

// kUsage, of `place`, which has camera poses though --fixed-camera was given.
inline tl::unexpected<Error> FixedCameraWithPoses(const std::filesystem::path& place) {
  return UsageError("{}: has camera poses, expected none where the camera is to be taken as fixed",
                    place.string());
}

}  // namespace tsdfpp
