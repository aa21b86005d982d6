// Kept meshes against those made from scratch, byte for byte.
#pragma once

#include <gtest/gtest.h>

#include <string>

#include "mapper/scene_mesher.h"
#include "tests/mapper/compare_maps.h"
#include "tests/mapper/map_snapshot.h"
#include "tests/mapper/toy_scene.h"

namespace tsdfpp {

inline std::string BytesOf(const TriangleMesh& mesh) {
  std::string bytes;
  AppendMesh(mesh, bytes);
  return bytes;
}

// All meshes that a mesher has of a map against those that the map makes.
inline ::testing::AssertionResult SameAsFromScratch(const MapRepresentation& map,
                                                    SceneMesher& mesher) {
  for (const InstanceId id : ToyIds()) {
    if (BytesOf(mesher.ObjectMesh(map, id)) != BytesOf(map.ObjectMesh(id))) {
      return ::testing::AssertionFailure() << "mesh of object " << id;
    }
  }
  if (BytesOf(mesher.SceneMesh(map)) != BytesOf(map.SceneMesh())) {
    return ::testing::AssertionFailure() << "scene";
  }
  return ::testing::AssertionSuccess();
}

}  // namespace tsdfpp
