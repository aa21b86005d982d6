#include "eval/report/recording_bytes.h"

#include <string_view>

#include "core/image_header.h"
#include "eval/tools/packed_mesh.h"

namespace tsdfpp {
namespace {

using nlohmann::json;

// ReadRecording has made sure of the place.
std::string_view BytesAt(const Recording& recording, const json& place) {
  return std::string_view(recording.bytes)
      .substr(place[0].get<std::size_t>(), place[1].get<std::size_t>());
}

Expected<void> CheckImages(const Recording& recording, const json& key,
                           std::initializer_list<const char*> names, const std::string& of) {
  for (const char* name : names) {
    if (!key.contains(name)) continue;  // a picture of the removal, where nothing is removed
    const auto header = ReadImageHeader(BytesAt(recording, key[name]), of);
    if (header && header->format == ImageFormat::kWebp) continue;
    return DataError("{}: '{}' is no WebP image", of, name);
  }
  return {};
}

Expected<void> CheckMeshes(const Recording& recording, const json& meshes, const std::string& of) {
  for (std::size_t i = 0; i < meshes.size(); ++i) {
    const json& mesh = meshes[i];
    if (!IsPackedMesh(BytesAt(recording, mesh["vertex_bytes"]), mesh["vertices"].get<std::size_t>(),
                      BytesAt(recording, mesh["index_bytes"]),
                      mesh["triangles"].get<std::size_t>())) {
      return DataError("{}: mesh {} cannot be unpacked, expected what docs/report.md says", of, i);
    }
  }
  return {};
}

}  // namespace

Expected<void> CheckRecordedBytes(const Recording& recording, const std::string& file) {
  TSDFPP_RETURN_IF_ERROR(CheckMeshes(recording, recording.json["truth"], file + ": the truth"));
  for (const json& key : recording.json["key_frames"]) {
    const std::string of = fmt::format("{}: key frame {}", file, key["frame"].get<int>());
    TSDFPP_RETURN_IF_ERROR(CheckImages(recording, key, {"colour", "depth", "mask"}, of));
  }
  for (const json& run : recording.json["runs"]) {
    for (const json& key : run["key_frames"]) {
      const std::string of = fmt::format("{}: key frame {} of map '{}'", file,
                                         key["frame"].get<int>(), run["folder"].get<std::string>());
      TSDFPP_RETURN_IF_ERROR(CheckImages(recording, key, {"picture", "picture_after"}, of));
      TSDFPP_RETURN_IF_ERROR(CheckMeshes(recording, key["chunks"], of));
    }
  }
  return {};
}

}  // namespace tsdfpp
