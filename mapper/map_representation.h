// The one interface behind which the maps differ (paper III-A, III-E, III-F); the pipeline around
// it is shared, so a comparison isolates the map. The rules are in docs/map.md.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "core/types.h"
#include "mapper/map_config.h"
#include "mapper/mesh/mesh_cache.h"
#include "mapper/mesh/scene_parts.h"
#include "mapper/rays/ray_cast.h"
#include "mapper/store/section_file.h"
#include "mapper/volume/tsdf_block.h"

namespace tsdfpp {

// What a map holds about one object (or, for one field, about all) at one voxel.
struct VoxelValue {
  float distance_m = 0;  // signed, positive in front of the surface
  float weight = 0;      // observations, above 0
  Colour colour{};
};

// One entry of a voxel's list; the first entry is the active object.
struct Listing {
  InstanceId id = kNoInstance;
  int confidence = 0;  // 0 where the method keeps none
  bool operator==(const Listing&) const = default;
};

struct MapMemory {
  std::size_t blocks = 0;      // of voxel data and of lists
  std::size_t bytes = 0;       // of those blocks and their tables
  std::size_t mesh_bytes = 0;  // besides: of the meshes kept since one was asked for
};

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

  // Gives an object another id: its values, listings, votes and poses are then the new one's, and
  // the places in lists stay, but for an index that is a function of volumes and poses, where ties
  // go by id. Errors: kUsage where `from` is not in the map, `to` is (a pose given is enough), or
  // one of them is the background or no id; the map is then unchanged.
  virtual Expected<void> Rename(InstanceId from, InstanceId to) = 0;

  // Puts a volume into the map as a new object whose pose is T_WO, with the volume's lattice at
  // T_WL; it arrives as if it had moved there (docs/map.md, "Renaming and adding an object"). The
  // voxel size must be the map's, and every block must hold an observed voxel. Errors: kUsage where
  // the id is in the map (a pose given is enough), the background or no id; kData where a part
  // would lie beyond the map's range or a pose is not rigid; the map is then unchanged.
  virtual Expected<void> Add(InstanceId id, const TsdfGrid& volume, const Pose& T_WL,
                             const Pose& T_WO) = 0;

  // What SetObjectPose(id, T_WO) would move, and where to.
  virtual ObjectMove MoveTo(InstanceId id, const Pose& T_WO) const = 0;

  // T_WL of the objects whose lattice is not the world's now.
  virtual std::map<InstanceId, Pose> MovedLattices() const { return {}; }

  // A deep copy.
  virtual std::unique_ptr<MapRepresentation> Clone() const = 0;

  // Objects in the map, increasing ids, those that Remove() took out excluded.
  virtual std::vector<InstanceId> Objects() const = 0;

  // T_WL, where an object's lattice is now in the world; the identity for methods that move values.
  virtual Pose ObjectLattice(InstanceId id) const = 0;

  // Meshes are kept by block, and a block is meshed again only after a change in it or next to it.
  // So meshing, though const, is not for two threads at once; a copy of the map starts without.

  // Brings the kept meshes in line with the map, as SceneMesh() does before it puts them together;
  // says how much there was to do since the last mesh. Methods that keep none do nothing.
  virtual MeshWork UpdateMeshes() const { return {}; }

  // The whole surface of one object, hidden parts included, in the world at its current pose,
  // coloured. One-field methods give the triangles labelled so.
  virtual TriangleMesh ObjectMesh(InstanceId id) const = 0;

  // The visible scene: coloured, with face_ids.
  virtual TriangleMesh SceneMesh() const = 0;

  // The visible scene for somebody who follows it: the parts of it that are not as they were when
  // this was last asked, all that have triangles the first time, at a cost that goes with their
  // number. By id, then block. Who replaces what he has of an id and block by what he is told,
  // dropping it where it has no triangles, has the triangles of SceneMesh(), in its order where
  // parts are by id and block. A copy of the map starts anew. Call from one thread, as
  // UpdateMeshes.
  virtual SceneChanges TakeSceneChanges() const = 0;

  // The map seen from a pose: options.surfaces images, the visible scene first. The n-th surface
  // along a ray is the first one of the map without the objects of the n - 1 before it.
  virtual std::vector<RaySurface> CastRays(const Intrinsics& camera, const Pose& T_WC,
                                           const RayCastOptions& options) const = 0;

  // The object's voxel at an index of its lattice; nothing where it is unobserved. One field: the
  // voxel if it is labelled so.
  virtual std::optional<VoxelValue> ValueAt(InstanceId id, const Eigen::Vector3i& voxel) const = 0;

  // The stored voxels of the object, in its lattice (that of all, for one field); nullptr where the
  // map has none. Valid until the map changes.
  virtual const TsdfGrid* GridOf(InstanceId id) const = 0;

  // The objects listed at a global voxel, the active one first.
  virtual std::vector<Listing> ListAt(const Eigen::Vector3i& voxel) const = 0;

  // Every voxel of the lattice frame that is observed for this object, sorted by (z, y, x).
  virtual std::vector<Eigen::Vector3i> ObservedVoxels(InstanceId id) const = 0;

  // Every global voxel with a non-empty list, sorted by (z, y, x).
  virtual std::vector<Eigen::Vector3i> ListedVoxels() const = 0;

  virtual MapMemory Memory() const = 0;

  // The first thing found in what is stored that docs/map.md rules out, in a sentence; nothing
  // where all is well. Slow (mapper/methods/map_invariants.h).
  virtual std::optional<std::string> FindFault() const = 0;

  // The map's content as named sections of a file (mapper/map_file.h), always of the same names.
  virtual void Save(Sections& sections) const = 0;

  // Makes the map the saved one, bit for bit. It must have the same method and settings and be as
  // MakeMap made it; `sections` have the names that Save() gives them. Errors: kData, a fragment
  // that says what no map can hold; the map is then unusable.
  virtual Expected<void> Load(const Sections& sections) = 0;
};

// All objects with their hidden parts, by increasing id: ObjectMesh of each, with face_ids.
TriangleMesh AllObjectsMesh(const MapRepresentation& map);

// The config must be valid (MapConfig::Validate).
std::unique_ptr<MapRepresentation> MakeMap(Method method, const MapConfig& config);

}  // namespace tsdfpp
