// The header of a PLY file: what its body holds, and how.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "core/error.h"

namespace tsdfpp {

enum class PlyScalar { kInt8, kUint8, kInt16, kUint16, kInt32, kUint32, kFloat, kDouble, kUnknown };

struct PlyProperty {
  std::string name;
  PlyScalar type = PlyScalar::kUnknown;
  PlyScalar count_type = PlyScalar::kUnknown;  // of a list
  bool is_list = false;
};

struct PlyElement {
  std::string name;
  std::size_t count = 0;
  std::vector<PlyProperty> properties;
};

struct PlyHeader {
  bool ascii = false;
  std::vector<PlyElement> elements;
  std::vector<std::string> regions;  // named in comments, of files that we wrote
  std::size_t body_at = 0;           // bytes before the body
};

// Parses the header of the file that `bytes` are. `file` begins the sentences. Errors: kData, where
// it is no PLY header that we know, or over the limits (core/limits.h).
Expected<PlyHeader> ParsePlyHeader(const std::string& file, const std::string& bytes);

}  // namespace tsdfpp
