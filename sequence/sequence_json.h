// sequence.json: what a Co-Fusion set cannot say about itself (schema version 1).
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "core/error.h"
#include "core/frame_source.h"

namespace tsdfpp {

// What made the frames.
struct GeneratorInfo {
  std::string version;                // of the program
  std::optional<std::uint64_t> seed;  // of the sensor's noise, where there is any
  std::string sensor;                 // e.g. "none" or a noise model with its numbers
  std::string backend;                // "egl" or "osmesa"
  std::string renderer;               // GL_RENDERER
  bool operator==(const GeneratorInfo&) const = default;
};

struct SequenceRecord {
  SequenceInfo info;
  GeneratorInfo generator;
  // FNV-1a 64 of every other file's bytes, 16 hexadecimal digits, by the path in the set.
  std::map<std::string, std::string> hashes;
};

// FNV-1a, 64 bits (Fowler, Noll, Vo): finds damage, not malice.
std::uint64_t Fnv1a64(std::string_view bytes);
std::string HashText(std::string_view bytes);

std::string SequenceToJson(const SequenceRecord& record);

// Errors: kData, naming file and field: not JSON, another generator or schema version, a field that
// is missing or of another type.
Expected<SequenceRecord> ReadSequenceJson(const std::filesystem::path& path);

}  // namespace tsdfpp
