#include "mapper/map_representation.h"

#include "mapper/mesh/mesh_tools.h"

namespace tsdfpp {

TriangleMesh AllObjectsMesh(const MapRepresentation& map) {
  TriangleMesh all;
  for (const InstanceId id : map.Objects()) Append(all, map.ObjectMesh(id), id);
  return all;
}

}  // namespace tsdfpp
