// Kept meshes against those made from scratch, byte for byte.
#pragma once

#include <gtest/gtest.h>

#include <string>

#include "mapper/map_representation.h"
#include "tests/mapper/compare_maps.h"
#include "tests/mapper/map_snapshot.h"
#include "tests/mapper/toy_scene.h"

namespace tsdfpp {

inline std::string BytesOf(const TriangleMesh& mesh) {
  std::string bytes;
  AppendMesh(mesh, bytes);
  return bytes;
}

// All meshes of a map against those of a copy, which starts without kept meshes.
inline ::testing::AssertionResult SameAsFromScratch(const MapRepresentation& map) {
  const auto copy = map.Clone();
  for (const InstanceId id : ToyIds()) {
    if (BytesOf(map.ObjectMesh(id)) != BytesOf(copy->ObjectMesh(id))) {
      return ::testing::AssertionFailure() << "mesh of object " << id;
    }
  }
  if (BytesOf(map.SceneMesh()) != BytesOf(map.Clone()->SceneMesh())) {
    return ::testing::AssertionFailure() << "scene";
  }
  return ::testing::AssertionSuccess();
}

}  // namespace tsdfpp
