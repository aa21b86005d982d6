// The bytes of a .klg recording (Logger2, ElasticFusion, Co-Fusion; docs/sources.md, "Recordings in
// .klg"): int32 frame count; a frame: int64 time in microseconds, int32 depth bytes, int32 colour
// bytes, depth, colour. Little-endian.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "core/error.h"

namespace tsdfpp {

struct KlgEntry {
  std::int64_t time_us = 0;
  std::uint64_t depth_offset = 0;  // in the file
  std::uint32_t depth_bytes = 0;
  std::uint32_t colour_bytes = 0;
};

struct KlgIndex {
  std::vector<KlgEntry> entries;
  std::uint64_t bytes_after = 0;  // what follows the last frame
};

// Walks the frames' headers. Errors: kData: no frames, a frame that is cut short or whose sizes
// cannot be, times that run backwards.
Expected<KlgIndex> ReadKlgIndex(const std::filesystem::path& path);

// zlib's stream of `bytes`, or the error that `what` unpacks to another size than `expected_bytes`.
Expected<std::string> Inflate(const std::string& bytes, std::size_t expected_bytes,
                              const std::string& what);
std::string Deflate(const std::string& bytes);

}  // namespace tsdfpp
