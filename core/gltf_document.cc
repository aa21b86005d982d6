#include "core/gltf_document.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "core/gltf_format.h"
#include "core/json_text.h"

namespace tsdfpp::gltf {

using nlohmann::json;

namespace {

std::size_t BytesOf(int component_type) {
  switch (component_type) {
    case kInt8:
    case kUint8:
      return 1;
    case kInt16:
    case kUint16:
      return 2;
    case kUint32:
    case kFloat:
      return 4;
    default:
      return 0;
  }
}

template <typename T>
double Load(const char* from) {
  T value;
  std::memcpy(&value, from, sizeof(T));
  return static_cast<double>(value);
}

std::size_t ComponentsOf(const std::string& type) {
  if (type == "SCALAR") return 1;
  if (type == "VEC2") return 2;
  if (type == "VEC3") return 3;
  if (type == "VEC4") return 4;
  return 0;  // matrices hold nothing that is read here
}

}  // namespace

double Elements::At(std::size_t element, std::size_t component) const {
  const char* from = data + element * stride + component * BytesOf(component_type);
  switch (component_type) {
    case kInt8:
      return Load<std::int8_t>(from);
    case kUint8:
      return Load<std::uint8_t>(from);
    case kInt16:
      return Load<std::int16_t>(from);
    case kUint16:
      return Load<std::uint16_t>(from);
    case kUint32:
      return Load<std::uint32_t>(from);
    default:
      return Load<float>(from);
  }
}

Expected<std::optional<std::size_t>> Document::Whole(const json& object, const char* key,
                                                     std::size_t most,
                                                     const std::string& where) const {
  const auto found = object.find(key);
  if (found == object.end()) return std::nullopt;
  if (!found->is_number_unsigned() || found->get<std::uint64_t>() > most) {
    return DataError("{}: {}: '{}' is {}, expected a whole number from 0 to {}", file_, where, key,
                     JsonShown(*found), most);
  }
  return found->get<std::size_t>();
}

Expected<std::size_t> Document::Needed(const json& object, const char* key, std::size_t most,
                                       const std::string& where) const {
  TSDFPP_ASSIGN(const auto number, Whole(object, key, most, where));
  if (!number) return DataError("{}: {} has no '{}'", file_, where, key);
  return *number;
}

Expected<std::optional<std::vector<double>>> Document::Numbers(const json& object, const char* key,
                                                               std::size_t length,
                                                               const std::string& where) const {
  const auto found = object.find(key);
  if (found == object.end()) return std::nullopt;
  std::vector<double> numbers;
  if (found->is_array()) {
    for (const json& number : *found) {
      if (number.is_number()) numbers.push_back(number.get<double>());
    }
  }
  if (numbers.size() != length || found->size() != length ||
      !std::all_of(numbers.begin(), numbers.end(), [](double x) { return std::isfinite(x); })) {
    return DataError("{}: {}: '{}' is not a list of {} numbers", file_, where, key, length);
  }
  return numbers;
}

Expected<const json*> Document::Item(const char* array, std::size_t index,
                                     const std::string& where) const {
  const auto list = root_.find(array);
  if (list == root_.end() || !list->is_array() || index >= list->size() ||
      !(*list)[index].is_object()) {
    return DataError("{}: {} names number {} of '{}', which is not there", file_, where, index,
                     array);
  }
  return &(*list)[index];
}

// The header and the chunks: the JSON, and the body where there is one.
Expected<void> Document::Parse(std::string bytes) {
  bytes_ = std::move(bytes);
  const auto word = [&](std::size_t at) {
    std::uint32_t value = 0;
    std::memcpy(&value, bytes_.data() + at, sizeof(value));
    return value;
  };
  if (bytes_.size() < kHeaderBytes || word(0) != kMagic) {
    return DataError("{}: not a .glb file: it does not begin with 'glTF'", file_);
  }
  if (word(4) != kVersion) {
    return DataError("{}: glTF version {}, expected {}", file_, word(4), kVersion);
  }
  if (word(8) != bytes_.size()) {
    return DataError("{}: {} bytes long, but its header says {}", file_, bytes_.size(), word(8));
  }
  std::string_view text;
  std::size_t at = kHeaderBytes;
  for (std::size_t chunk = 0; at < bytes_.size(); ++chunk) {
    if (bytes_.size() - at < kChunkHeaderBytes ||
        bytes_.size() - at - kChunkHeaderBytes < word(at)) {
      return DataError("{}: chunk {} is cut off", file_, chunk);
    }
    const std::uint32_t type = word(at + 4);
    const std::string_view content(bytes_.data() + at + kChunkHeaderBytes, word(at));
    if (chunk == 0 && type == kJsonChunk) text = content;
    if (chunk == 1 && type == kBinaryChunk) body_ = content;
    at += kChunkHeaderBytes + content.size();
  }
  TSDFPP_ASSIGN(root_, ParseJsonObject(text, file_ + ": its first chunk"));
  return {};
}

Expected<Elements> Document::Accessor(std::size_t index) const {
  constexpr auto kMost = std::numeric_limits<std::uint32_t>::max();
  const std::string where = fmt::format("accessor {}", index);
  TSDFPP_ASSIGN(const json* accessor, Item("accessors", index, "a primitive"));
  Elements elements;
  TSDFPP_ASSIGN(elements.count, Needed(*accessor, "count", kMost, where));
  TSDFPP_ASSIGN(const std::size_t component_type, Needed(*accessor, "componentType", kMost, where));
  elements.component_type = static_cast<int>(std::min<std::size_t>(component_type, 1U << 20U));
  const std::size_t size = BytesOf(elements.component_type);
  if (size == 0) {
    return DataError("{}: {}: unknown componentType {}", file_, where, component_type);
  }
  const auto type = accessor->find("type");
  if (type != accessor->end() && type->is_string()) {
    elements.components = ComponentsOf(type->get<std::string>());
  }
  if (elements.components == 0) {
    return DataError("{}: {}: its 'type' is none of SCALAR, VEC2, VEC3, VEC4", file_, where);
  }
  if (accessor->contains("sparse") || !accessor->contains("bufferView")) {
    return DataError("{}: {} is sparse or has no bufferView, which is not understood", file_,
                     where);
  }
  const auto normalized = accessor->find("normalized");
  elements.normalized = normalized != accessor->end() && *normalized == json(true);

  TSDFPP_ASSIGN(const std::size_t view_index, Needed(*accessor, "bufferView", kMost, where));
  TSDFPP_ASSIGN(const json* view, Item("bufferViews", view_index, where));
  const std::string view_where = fmt::format("bufferView {}", view_index);
  TSDFPP_ASSIGN(const std::size_t buffer_index, Needed(*view, "buffer", kMost, view_where));
  TSDFPP_ASSIGN(const json* buffer, Item("buffers", buffer_index, view_where));
  if (buffer_index != 0 || buffer->contains("uri")) {
    return DataError("{}: {} is not in the file's own body", file_, view_where);
  }
  TSDFPP_ASSIGN(const auto view_offset, Whole(*view, "byteOffset", kMost, view_where));
  TSDFPP_ASSIGN(const std::size_t view_length, Needed(*view, "byteLength", kMost, view_where));
  TSDFPP_ASSIGN(const auto stride, Whole(*view, "byteStride", 252, view_where));
  TSDFPP_ASSIGN(const auto offset, Whole(*accessor, "byteOffset", kMost, where));
  if (view_offset.value_or(0) + view_length > body_.size()) {
    return DataError("{}: {} reaches beyond the file's body of {} bytes", file_, view_where,
                     body_.size());
  }
  const std::size_t element = elements.components * size;
  elements.stride = stride.value_or(element);
  const std::size_t needed =
      elements.count == 0 ? 0
                          : offset.value_or(0) + (elements.count - 1) * elements.stride + element;
  if (elements.stride < element || needed > view_length) {
    return DataError("{}: {} reaches beyond its bufferView of {} bytes", file_, where, view_length);
  }
  elements.data = body_.data() + view_offset.value_or(0) + offset.value_or(0);
  return elements;
}

}  // namespace tsdfpp::gltf
