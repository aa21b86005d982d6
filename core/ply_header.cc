#include "core/ply_header.h"

#include <sstream>

#include "core/limits.h"
#include "core/plain_name.h"

namespace tsdfpp {
namespace {

PlyScalar ScalarOf(const std::string& name) {
  if (name == "char" || name == "int8") return PlyScalar::kInt8;
  if (name == "uchar" || name == "uint8") return PlyScalar::kUint8;
  if (name == "short" || name == "int16") return PlyScalar::kInt16;
  if (name == "ushort" || name == "uint16") return PlyScalar::kUint16;
  if (name == "int" || name == "int32") return PlyScalar::kInt32;
  if (name == "uint" || name == "uint32") return PlyScalar::kUint32;
  if (name == "float" || name == "float32") return PlyScalar::kFloat;
  if (name == "double" || name == "float64") return PlyScalar::kDouble;
  return PlyScalar::kUnknown;
}

// The lines of a header; `words` stands behind the first word.
Expected<void> ReadFormat(const std::string& file, std::istringstream& words, PlyHeader& header) {
  std::string word = "format";  // shown where nothing follows
  words >> word;
  if (word != "ascii" && word != "binary_little_endian") {
    return DataError("{}: PLY format '{}', expected ascii or binary_little_endian", file, word);
  }
  header.ascii = word == "ascii";
  return {};
}

// Of the comments those that name the regions of our own files.
Expected<void> ReadComment(const std::string& file, std::istringstream& words, PlyHeader& header) {
  std::string word;
  std::size_t index = 0;
  std::string name;
  if (!(words >> word && word == "region" && words >> index &&
        std::getline(words >> std::ws, name))) {
    return {};
  }
  if (index != header.regions.size()) {
    return DataError("{}: region comments are not numbered 0, 1, ...", file);
  }
  TSDFPP_RETURN_IF_ERROR(CheckLabel(name, fmt::format("{}: region {}", file, index)));
  header.regions.push_back(name);
  return {};
}

Expected<void> ReadElement(const std::string& file, const std::string& line, std::size_t most,
                           std::istringstream& words, PlyHeader& header) {
  PlyElement element;
  if (!(words >> element.name >> element.count) || element.count > most) {
    return DataError("{}: PLY element line '{}' cannot be read", file, line);
  }
  TSDFPP_RETURN_IF_ERROR(CheckLimit(&Limits::mesh_elements,
                                    static_cast<std::int64_t>(element.count), file,
                                    "elements of one kind"));
  header.elements.push_back(element);
  return {};
}

Expected<void> ReadProperty(const std::string& file, const std::string& line,
                            std::istringstream& words, PlyHeader& header) {
  PlyProperty property;
  std::string word = "property";
  words >> word;
  if (word == "list") {
    property.is_list = true;
    words >> word;
    property.count_type = ScalarOf(word);
    words >> word;
  }
  property.type = ScalarOf(word);
  if (header.elements.empty() || !(words >> property.name) ||
      property.type == PlyScalar::kUnknown ||
      (property.is_list && property.count_type == PlyScalar::kUnknown)) {
    return DataError("{}: PLY property line '{}' cannot be read", file, line);
  }
  header.elements.back().properties.push_back(property);
  return {};
}

}  // namespace

Expected<PlyHeader> ParsePlyHeader(const std::string& file, const std::string& bytes) {
  PlyHeader header;
  bool first = true;
  while (true) {
    const std::size_t at = header.body_at;
    const std::size_t end = bytes.find('\n', at);
    if (end == std::string::npos) return DataError("{}: not a PLY file: no end_header", file);
    std::string line = bytes.substr(at, end - at);
    if (!line.empty() && line.back() == '\r') line.pop_back();
    header.body_at = end + 1;
    std::istringstream words(line);
    std::string word;
    words >> word;
    if (first) {
      if (word != "ply") return DataError("{}: not a PLY file: it does not begin with 'ply'", file);
      first = false;
    } else if (word == "format") {
      TSDFPP_RETURN_IF_ERROR(ReadFormat(file, words, header));
    } else if (word == "comment") {
      TSDFPP_RETURN_IF_ERROR(ReadComment(file, words, header));
    } else if (word == "element") {
      TSDFPP_RETURN_IF_ERROR(ReadElement(file, line, bytes.size(), words, header));
    } else if (word == "property") {
      TSDFPP_RETURN_IF_ERROR(ReadProperty(file, line, words, header));
    } else if (word == "end_header") {
      return header;
    }
  }
}

}  // namespace tsdfpp
