// What the glTF 2.0 specification asks of a .glb file, read from it alone (sections 3.5 to 3.9 and
// 4), for files that hold nothing but triangles.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <vector>

namespace tsdfpp::test {

class GlbValidator {
 public:
  explicit GlbValidator(const std::string& bytes) : bytes_(bytes) { Validate(); }

  const std::vector<std::string>& faults() const { return faults_; }
  const nlohmann::json& document() const { return document_; }

  // Component `c` of element `i` of an accessor, raw.
  template <typename T>
  T At(std::size_t accessor, std::size_t i, std::size_t c) const {
    const auto& a = document_["accessors"][accessor];
    const auto& view = document_["bufferViews"][a["bufferView"].get<std::size_t>()];
    const std::size_t components = ComponentsOf(a["type"]);
    const std::size_t stride = view.value("byteStride", components * sizeof(T));
    T value;
    std::memcpy(&value,
                body_.data() + view.value("byteOffset", 0U) + a.value("byteOffset", 0U) +
                    i * stride + c * sizeof(T),
                sizeof(T));
    return value;
  }

 private:
  static std::size_t ComponentsOf(const std::string& type) {
    return type == "SCALAR" ? 1 : (type == "VEC3" ? 3 : (type == "VEC4" ? 4 : 0));
  }

  void Check(bool ok, const std::string& fault) {
    if (!ok) faults_.push_back(fault);
  }
  std::uint32_t Word(std::size_t at) const {
    std::uint32_t word = 0;
    if (at + 4 <= bytes_.size()) {
      for (std::size_t i = 0; i < 4; ++i) {
        word |= static_cast<std::uint32_t>(static_cast<unsigned char>(bytes_[at + i])) << (8 * i);
      }
    }
    return word;
  }

  void Validate() {
    Check(bytes_.size() >= 20, "shorter than a header and a chunk");
    Check(bytes_.substr(0, 4) == "glTF", "magic");
    Check(Word(4) == 2, "version");
    Check(Word(8) == bytes_.size(), "total length");
    Check(bytes_.size() % 4 == 0, "total length is not aligned");
    const std::uint32_t json_length = Word(12);
    Check(json_length % 4 == 0, "the JSON chunk is not aligned");
    Check(bytes_.substr(16, 4) == "JSON", "the first chunk is not JSON");
    if (20 + json_length > bytes_.size()) return Check(false, "the JSON chunk is cut");
    const std::string text = bytes_.substr(20, json_length);
    document_ = nlohmann::json::parse(text, nullptr, false);
    if (!document_.is_object()) return Check(false, "the JSON cannot be parsed");
    Check(text[0] == '{', "the JSON does not begin at once");
    Check(text.find_last_not_of(' ') == text.rfind('}'), "padding of JSON is not spaces");
    const std::size_t at = 20 + json_length;
    if (at < bytes_.size()) {
      Check(Word(at) % 4 == 0, "the BIN chunk is not aligned");
      Check(bytes_.substr(at + 4, 4) == std::string("BIN\0", 4), "the second chunk is not BIN");
      Check(at + 8 + Word(at) == bytes_.size(), "the BIN chunk does not end the file");
      body_ = bytes_.substr(at + 8);
    }
    Check(document_["asset"]["version"] == "2.0", "asset.version");
    for (const auto& [key, value] : document_.items()) {
      Check(!value.is_array() || !value.empty(), "empty array: " + key);
    }
    if (document_.contains("buffers")) ValidateBuffer();
    ValidateNodes();
    if (document_.contains("meshes")) {
      for (const auto& mesh : document_["meshes"]) ValidateMesh(mesh);
    }
  }

  void ValidateBuffer() {
    Check(document_["buffers"].size() == 1, "several buffers");
    const auto& buffer = document_["buffers"][0];
    const std::size_t length = buffer["byteLength"];
    Check(!buffer.contains("uri"), "the buffer is outside the file");
    Check(length >= 1 && length <= body_.size() && body_.size() <= length + 3, "buffer.byteLength");
    for (const auto& view : document_["bufferViews"]) {
      Check(view["buffer"] == 0, "bufferView.buffer");
      Check(view["byteLength"].get<std::size_t>() >= 1, "bufferView.byteLength");
      Check(view.value("byteOffset", 0U) + view["byteLength"].get<std::size_t>() <= length,
            "a bufferView reaches beyond the buffer");
    }
  }

  void ValidateNodes() {
    const std::size_t count = document_["nodes"].size();
    std::vector<int> parents(count, 0);
    for (const auto& node : document_["nodes"]) {
      Check(!node.contains("children") || !node["children"].empty(), "node.children is empty");
      for (const auto& child : node.value("children", nlohmann::json::array())) {
        if (child.get<std::size_t>() >= count) return Check(false, "node.children");
        ++parents[child.get<std::size_t>()];
      }
      if (node.contains("mesh")) {
        Check(node["mesh"].get<std::size_t>() < document_["meshes"].size(), "node.mesh");
      }
      if (!node.contains("matrix")) continue;
      Check(!node.contains("rotation") && !node.contains("translation") && !node.contains("scale"),
            "a matrix and TRS");
      const std::vector<double> m = node["matrix"];
      Check(m.size() == 16 && m[3] == 0 && m[7] == 0 && m[11] == 0 && m[15] == 1, "node.matrix");
      for (std::size_t a = 0; a < 3; ++a) {
        const std::size_t b = (a + 1) % 3;
        double dot = 0;
        for (std::size_t row = 0; row < 3; ++row) dot += m[4 * a + row] * m[4 * b + row];
        Check(std::abs(dot) < 1e-9, "node.matrix is skewed");
      }
    }
    for (const int number : parents) Check(number <= 1, "a node with several parents");
    Check(document_["scene"].get<std::size_t>() < document_["scenes"].size(), "scene");
    for (const auto& scene : document_["scenes"]) {
      Check(!scene["nodes"].empty(), "scene.nodes is empty");
      for (const auto& root : scene["nodes"]) {
        Check(root.get<std::size_t>() < count && parents[root.get<std::size_t>()] == 0,
              "scene.nodes is not a root");
      }
    }
  }

  // The accessor, checked for what all have in common.
  const nlohmann::json& Accessor(std::size_t index, std::size_t component_bytes, int target) {
    const auto& accessor = document_["accessors"].at(index);
    const std::size_t count = accessor["count"];
    const std::size_t element = ComponentsOf(accessor["type"]) * component_bytes;
    const auto& view = document_["bufferViews"].at(accessor["bufferView"].get<std::size_t>());
    const std::size_t stride = view.value("byteStride", element);
    const std::size_t offset = accessor.value("byteOffset", 0U);
    Check(element > 0, "accessor.type");
    Check(count >= 1, "accessor.count");
    Check(offset % component_bytes == 0 &&
              (offset + view.value("byteOffset", 0U)) % component_bytes == 0,
          "an accessor is not aligned to its components");
    Check(offset + stride * (count - 1) + element <= view["byteLength"].get<std::size_t>(),
          "an accessor reaches beyond its bufferView");
    Check(view.value("target", target) == target, "bufferView.target");
    if (target == 34962) {
      Check(stride % 4 == 0 && offset % 4 == 0 && view.value("byteOffset", 0U) % 4 == 0,
            "vertex data is not aligned to 4 bytes");
    } else {
      Check(!view.contains("byteStride"), "indices with a stride");
    }
    Check(view_target_.emplace(accessor["bufferView"].get<std::size_t>(), target).first->second ==
              target,
          "a bufferView for vertices and indices");
    return accessor;
  }

  void ValidateMesh(const nlohmann::json& mesh) {
    Check(!mesh["primitives"].empty(), "mesh.primitives is empty");
    for (const auto& primitive : mesh["primitives"]) {
      Check(primitive.value("mode", 4) == 4, "primitive.mode");
      if (primitive.contains("material")) {
        Check(primitive["material"].get<std::size_t>() < document_["materials"].size(),
              "primitive.material");
      }
      const std::size_t position = primitive["attributes"]["POSITION"];
      const auto& positions = Accessor(position, 4, 34962);
      Check(positions["componentType"] == 5126 && positions["type"] == "VEC3", "POSITION's type");
      const std::size_t count = positions["count"];
      for (std::size_t c = 0; c < 3; ++c) {
        float low = At<float>(position, 0, c);
        float high = low;
        for (std::size_t i = 0; i < count; ++i) {
          const float p = At<float>(position, i, c);
          Check(std::isfinite(p), "a position is not finite");
          low = std::min(low, p);
          high = std::max(high, p);
        }
        Check(positions["min"].size() == 3 && positions["max"].size() == 3 &&
                  positions["min"][c].get<float>() == low &&
                  positions["max"][c].get<float>() == high,
              "POSITION's min and max are not those of the data");
      }
      if (primitive["attributes"].contains("COLOR_0")) {
        const std::size_t colour = primitive["attributes"]["COLOR_0"];
        const auto& colours = Accessor(colour, 2, 34962);
        Check(colours["componentType"] == 5123 && colours["normalized"] == true &&
                  (colours["type"] == "VEC3" || colours["type"] == "VEC4"),
              "COLOR_0's type");
        Check(colours["count"] == count, "COLOR_0's count");
      }
      const std::size_t index = primitive["indices"];
      const auto& indices = Accessor(index, 4, 34963);
      Check(indices["componentType"] == 5125 && indices["type"] == "SCALAR", "indices' type");
      Check(!indices.value("normalized", false), "indices are normalized");
      Check(indices["count"].get<std::size_t>() % 3 == 0, "no whole number of triangles");
      for (std::size_t i = 0; i < indices["count"].get<std::size_t>(); ++i) {
        Check(At<std::uint32_t>(index, i, 0) < count, "an index names no vertex");
      }
    }
  }

  std::string bytes_;
  std::string body_;
  nlohmann::json document_;
  std::map<std::size_t, int> view_target_;
  std::vector<std::string> faults_;
};

}  // namespace tsdfpp::test
