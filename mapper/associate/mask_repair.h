// Labels of a frame made right by its depth and by what the map holds, before they are fused (after
// paper III-C). Masks are wrong: they miss an object, bleed over its outline, join two, give
// another id. Any map gets the same rules, and reads its own surfaces; what was fused under a wrong
// label is taken out again where an object has a volume of its own.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <utility>
#include <vector>

#include "core/types.h"
#include "mapper/associate/contested_cells.h"
#include "mapper/associate/mask_repair_config.h"
#include "mapper/associate/new_surface.h"
#include "mapper/associate/object_cells.h"
#include "mapper/associate/object_lookup.h"
#include "mapper/map_representation.h"
#include "mapper/segment/surface_maps.h"

namespace tsdfpp {

class MaskRepair {
 public:
  // Who says that a label of which the map has nothing is an object.
  enum class Births {
    kConfirmed,  // association, which has held it back until it was sure
    kCounted,    // the frames in which it is there, as for any new surface
  };
  // The config must be valid.
  explicit MaskRepair(const MaskRepairConfig& config, Births births = Births::kCounted)
      : config_(config),
        new_surface_(config.confirm_frames,
                     births == Births::kConfirmed ? 1 : config.confirm_frames,
                     config.forget_frames) {}

  // The frame's segments (CV_16UC1) with outlines set right: a point that does not go on from its
  // own segment's surface, but does from that of another one beside it, gets that one's id
  // (mapper/associate/outline_surfaces.h). `depth` says how noisy the frame's depth is. To be
  // called first of each frame.
  cv::Mat SetOutlines(const Frame& frame, const cv::Mat& ids, double voxel_m,
                      const DepthSegmentsConfig& depth = {});

  // The labels (CV_16UC1, ids of the map's objects) that are to be fused instead of `labels`, which
  // are the segments after SetOutlines() as associated, once the map's objects have the frame's
  // poses, T_WO. In this order:
  //  1. *Taking out.* Cells of a voxel on an object's surface that frames gave to others more often
  //     than to it are taken out of the object (mapper/associate/take_out.h). Points say so that
  //     are within take_voxels of it, and whose segment SetOutlines() did not change. Nothing is
  //     said of the `unplaced`: objects that the frame does not show to be where their pose says.
  //  2. *Known surfaces.* A point is explained by an object to whose surface it is near:
  //     keep_voxels for the label's own, take_voxels for another one's, where that is its own in at
  //     least half of the frames that disputed it. It becomes that of the likeliest: weight times
  //     that share times exp(-distance^2 / 2 sigma_voxels^2), and own_factor for the label's own.
  //     Ties go to the lower id.
  //  3. *Unknown ids.* Where the map has no surface of a label, and more than half of its points
  //     became one object's in step 2 (not the background's), the others do, too.
  //  4. *New surface.* What is left is of no label (kNoInstance: not fused) until its place has had
  //     that label in confirm_frames frames (mapper/associate/new_surface.h), and where
  //     SetOutlines() saw that it goes on from neither side.
  // Pixels without valid depth keep their label, and kNoInstance stays. The same for any number of
  // threads.
  cv::Mat Repair(const Frame& frame, const cv::Mat& labels, const std::map<InstanceId, Pose>& T_WO,
                 const std::set<InstanceId>& unplaced, MapRepresentation& map);

 private:
  // Of a label and an object: points with that label which became the object's.
  using Explained = std::map<std::pair<InstanceId, InstanceId>, std::int64_t>;

  // What a frame's points say. `of_calm` are those of objects' own points in cells that no frame
  // has disputed before: they count where this one is the first.
  struct Testimonies {
    std::vector<Testimony> said;
    std::vector<Testimony> of_calm;
  };

  // A frame on its way. Of `labels` those are the map's own word where `is_open` is 0.
  struct Work {
    const Frame& frame;
    const std::set<InstanceId>& unplaced;
    cv::Mat labels;
    cv::Mat is_open;  // CV_8UC1
    Explained explained;
    Testimonies said;
  };

  // Of a tile of 32 pixels, into `work`'s images and what is returned.
  struct OfTile {
    Explained explained;
    Testimonies said;
  };
  OfTile ExplainTile(const ObjectLookup& lookup, const ObjectCells& cells, const cv::Rect& tile,
                     Work& work) const;
  void Explain(const ObjectLookup& lookup, const ObjectCells& cells, Work& work);
  std::optional<InstanceId> LikeliestOf(const ObjectLookup& lookup,
                                        std::span<const ObjectLookup::Distance> distances,
                                        const ObjectCells& cells, const Eigen::Vector3d& p_W,
                                        InstanceId label) const;
  void Testify(const ObjectLookup& lookup, std::span<const ObjectLookup::Distance> distances,
               const ObjectCells& cells, const std::set<InstanceId>& unplaced,
               const Eigen::Vector3d& p_W, InstanceId label, Testimonies& said) const;

  MaskRepairConfig config_;
  SurfaceMapper surfaces_;
  cv::Mat is_doubtful_;  // of the frame, CV_8UC1, as in OutlineLabels
  cv::Mat is_changed_;   // by SetOutlines()
  ContestedCells contested_;
  NewSurface new_surface_;
};

}  // namespace tsdfpp
