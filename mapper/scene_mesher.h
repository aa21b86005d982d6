// Meshes of a map, kept between calls for whoever asks more than once: by block, and a block is
// meshed again only after a change in it or next to it (docs/meshes.md).
#pragma once

#include <memory>
#include <vector>

#include "mapper/map_representation.h"
#include "mapper/mesh/scene_changes.h"

namespace tsdfpp {

// Whoever asks owns one; the map is only read. It is given the same map each time, or another one
// of the same method and settings, such as a copy: what it gives is what the map gives from
// scratch, byte for byte. For one thread at a time; any number of them may read one map at once. A
// map whose surfaces do not lie in blocks is asked for its meshes each time.
class SceneMesher {
 public:
  SceneMesher();
  SceneMesher(SceneMesher&&) noexcept;
  SceneMesher& operator=(SceneMesher&&) noexcept;
  SceneMesher(const SceneMesher&) = delete;
  SceneMesher& operator=(const SceneMesher&) = delete;
  ~SceneMesher();

  // Brings the kept meshes in line with the map, as SceneMesh() does before it puts them together;
  // says how much there was to do.
  MeshWork Update(const MapRepresentation& map);

  // As MapRepresentation has them.
  TriangleMesh SceneMesh(const MapRepresentation& map);
  TriangleMesh ObjectMesh(const MapRepresentation& map, InstanceId id);

  // The visible scene for somebody who follows it: the parts of it that are not as they were when
  // this was last asked, all that have triangles the first time, at a cost that goes with their
  // number. By id, then block. A follower replaces what it has of an id and block by the new part,
  // and drops it where the part has no triangles; it then has the triangles of SceneMesh(), in the
  // order of ids and blocks. Of a map without blocks an object's triangles are one part, at block
  // 0.
  SceneChanges TakeSceneChanges(const MapRepresentation& map);

  // Of what is kept.
  std::size_t Bytes() const;

 private:
  struct Kept;
  std::unique_ptr<Kept> kept_;
};

// All objects with their hidden parts, by increasing id: ObjectMesh of each, with face_ids.
TriangleMesh AllObjectsMesh(const MapRepresentation& map);

}  // namespace tsdfpp
