// The one interface behind which the maps differ (paper III-A, III-E, III-F); the pipeline around
// it is shared, so a comparison isolates the map. What only some maps can do is asked for: see the
// end of the class. The rules are in docs/map.md.
#pragma once

#include <memory>
#include <vector>

#include "core/types.h"
#include "mapper/map_config.h"
#include "mapper/rays/ray_cast.h"

namespace tsdfpp {

class BlockMoves;
class BlockSurfaces;
class MapEditing;
class MapPersistence;
class VoxelInspection;

struct MapMemory {
  std::size_t blocks = 0;         // of voxel data and of lists
  std::size_t bytes = 0;          // of those blocks and their tables
  std::size_t derived_bytes = 0;  // besides: of what was made from them when it was read
};

// Functions that are const change nothing that anybody can see: any number of threads may call them
// at once, of one map that nobody changes meanwhile.
class MapRepresentation {
 public:
  virtual ~MapRepresentation() = default;

  virtual Method method() const = 0;
  virtual const MapConfig& config() const = 0;

  // Paper III-E. The first pose given to an object is its pose at birth and moves nothing; nor does
  // one whose numbers equal the last. Objects must be given in increasing id within a frame. Poses
  // and what they move must be such as CheckReach() lets pass (mapper/map_reach.h).
  virtual void SetObjectPose(InstanceId id, const Pose& T_WO) = 0;

  // Paper III-F. Fuses depth, colour and labels (CV_16UC1, object ids as associated with the map;
  // pixels kNoInstance are left out) of a frame, whose own mask is not read. Aborts where
  // CheckFrameForm() or CheckReach() refuse it (mapper/map_reach.h).
  virtual void Fuse(const Frame& frame, const cv::Mat& labels) = 0;

  // Takes the object out of the map; unknown ids change nothing.
  virtual void Remove(InstanceId id) = 0;

  // A deep copy.
  virtual std::unique_ptr<MapRepresentation> Clone() const = 0;

  // Objects in the map, increasing ids, those that Remove() took out excluded.
  virtual std::vector<InstanceId> Objects() const = 0;

  // T_WL, where an object's lattice is now in the world; the identity for methods that move values.
  virtual Pose ObjectLattice(InstanceId id) const = 0;

  // Meshes are made from scratch here. Whoever asks again and again owns a SceneMesher
  // (mapper/scene_mesher.h), which keeps them and makes what changed.

  // The whole surface of one object, hidden parts included, in the world at its current pose,
  // coloured. One-field methods give the triangles labelled so.
  virtual TriangleMesh ObjectMesh(InstanceId id) const = 0;

  // The visible scene: coloured, with face_ids.
  virtual TriangleMesh SceneMesh() const = 0;

  // The map seen from a pose: options.surfaces images, the visible scene first. The n-th surface
  // along a ray is the first one of the map without the objects of the n - 1 before it.
  virtual std::vector<RaySurface> CastRays(const Intrinsics& camera, const Pose& T_WC,
                                           const RayCastOptions& options) const = 0;

  virtual MapMemory Memory() const = 0;

  // What only some maps can do; nullptr from the others. A caller that needs one tells its user in
  // a sentence that the map lacks it. Programs ask for the first two (mapper/voxel_inspection.h,
  // mapper/map_editing.h); for the others SaveMap(), CheckReach() and SceneMesher do.
  virtual const VoxelInspection* inspection() const { return nullptr; }
  virtual MapEditing* editing() { return nullptr; }
  virtual const MapPersistence* persistence() const { return nullptr; }
  virtual MapPersistence* persistence() { return nullptr; }
  virtual const BlockMoves* block_moves() const { return nullptr; }
  virtual const BlockSurfaces* block_surfaces() const { return nullptr; }
};

// The config must be valid (MapConfig::Validate).
std::unique_ptr<MapRepresentation> MakeMap(Method method, const MapConfig& config);

}  // namespace tsdfpp
