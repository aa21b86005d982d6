// Binary little-endian PLY: positions in metres, colours per vertex, `object_id` and `region` per
// face.
#pragma once

#include <filesystem>

#include "core/error.h"
#include "core/types.h"

namespace tsdfpp {

// Errors: kEnvironment where the file cannot be written.
Expected<void> WritePly(const std::filesystem::path& path, const TriangleMesh& mesh);

// Reads binary little-endian or ASCII PLY with float or double positions; polygons are cut into
// triangles, strips of triangles refused. Errors: kData, naming the file and what is wrong.
Expected<TriangleMesh> ReadPly(const std::filesystem::path& path);

// The same with the regions of a true model: `comment region <index> <name>` lines and a `region`
// number per face.
Expected<void> WriteTrueModel(const std::filesystem::path& path, const TrueModel& model);
// `info` is the caller's; a file without regions gets one, named after the object. Errors: those of
// ReadPly; kData where a position is farther than kFarthest_m (core/farthest.h).
Expected<TrueModel> ReadTrueModel(const std::filesystem::path& path, const ObjectInfo& info);

}  // namespace tsdfpp
