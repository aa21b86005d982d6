// sequence.json: what a Co-Fusion set cannot say about itself. Schema version 2; version 1, which
// had no certificate, is read too.
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

// How far measured values are from true ones, metres, over all pixels that were compared.
struct Residual {
  double mean_m = 0;
  double p99_m = 0;  // rounded up to a two-hundredth of the limit
  double max_m = 0;
  double limit_m = 0;           // what a sound sequence keeps to
  std::int64_t checked = 0;     // pixels compared
  std::int64_t excluded = 0;    // pixels left out: on an edge, or seen at grazing incidence
  std::int64_t violations = 0;  // pixels beyond the limit
  bool operator==(const Residual&) const = default;
};

// What the verification of a whole sequence measured (eval/make/certify.h).
struct Certificate {
  int frames = 0;              // compared with the models, the poses and each other
  int ray_frames = 0;          // compared with rays
  Residual model;              // from each pixel's point to the model of the mask's object
  Residual ray_depth;          // between depth and MuJoCo's rays
  std::int64_t wrong_ids = 0;  // pixels whose mask is not what the ray hits
  bool operator==(const Certificate&) const = default;
};

struct SequenceRecord {
  SequenceInfo info;
  GeneratorInfo generator;
  // FNV-1a 64 of every other file's bytes, 16 hexadecimal digits, by the path in the set.
  std::map<std::string, std::string> hashes;
  std::optional<Certificate> certificate = std::nullopt;
};

// FNV-1a, 64 bits (Fowler, Noll, Vo): finds damage, not malice.
std::uint64_t Fnv1a64(std::string_view bytes);
std::string HashText(std::string_view bytes);

// Whether the folder holds a sequence.json.
bool IsOurSequence(const std::filesystem::path& folder);

std::string SequenceToJson(const SequenceRecord& record);

// Errors: kData, naming file and field: not JSON, another generator or schema version, a field that
// is missing or of another type, an object whose name cannot be a file's, a name or id there twice
// (core/plain_name.h), a listed file outside of the sequence.
Expected<SequenceRecord> ReadSequenceJson(const std::filesystem::path& path);

}  // namespace tsdfpp
