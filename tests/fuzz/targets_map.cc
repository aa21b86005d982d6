// Saved maps, behind their checksums and compression (tests/fuzz/mutate.h packs them again).
#include "mapper/map_file.h"
#include "mapper/voxel_inspection.h"
#include "tests/fuzz/complaint.h"
#include "tests/fuzz/target.h"

namespace tsdfpp::fuzz {
namespace {

constexpr const char* kMapFile = "map.tsdf";

bool ReadMap(std::string_view input) {
  const auto loaded = MapFromBytes(input, kMapFile);
  if (!Accepted(loaded, kMapFile)) return false;
  const MapRepresentation& map = *loaded->map;
  const auto fault = VoxelsOf(map).FindFault();
  Require(!fault, "a map with a fault: " + fault.value_or(""));
  const MappedRun* const run = loaded->run ? &*loaded->run : nullptr;
  const std::string bytes = MapToBytes(map, run).value();
  const auto again = MapFromBytes(bytes, kMapFile);
  Require(again.has_value(), again ? "" : "what was saved is refused: " + again.error().message);
  Require(MapToBytes(*again->map, run).value() == bytes,
          "what was saved is loaded as something else");
  // What `tsdfpp map --from` and `evaluate` do first.
  const TriangleMesh scene = map.SceneMesh();
  for (const auto& triangle : scene.triangles) {
    for (const std::uint32_t vertex : triangle) {
      Require(vertex < scene.vertices.size(), "a triangle of a vertex that there is not");
    }
  }
  for (const InstanceId id : map.Objects()) {
    (void)map.ObjectMesh(id);
    (void)map.ObjectLattice(id);
  }
  return true;
}

}  // namespace

void AddMapTargets(std::vector<Target>& targets) {
  targets.push_back({"map",
                     kMapFile,
                     ReadMap,
                     {"mapper/map_file.cc", "mapper/store/section_file.cc",
                      "mapper/store/volume_store.cc", "mapper/methods/object_volume_map.cc",
                      "mapper/methods/tsdfpp_map.cc", "mapper/methods/literal_map.cc",
                      "mapper/methods/single_field_map.cc", "mapper/methods/labelled_field.cc",
                      "mapper/index/pair_index.cc", "mapper/index/voting_index.cc"}});
}

}  // namespace tsdfpp::fuzz
