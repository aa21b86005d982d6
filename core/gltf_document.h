// The JSON and the body of a .glb file, and access to both that trusts nothing in them.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"

namespace tsdfpp::gltf {

// What an accessor points at: `count` elements of `components` numbers.
struct Elements {
  const char* data = nullptr;
  std::size_t count = 0;
  std::size_t components = 0;
  std::size_t stride = 0;
  int component_type = 0;
  bool normalized = false;

  // As stored; integers are not scaled.
  double At(std::size_t element, std::size_t component) const;
};

// A file in memory. Errors are kData and begin with the file's name; `where` says in which part of
// the document the fault is.
class Document {
 public:
  explicit Document(std::string file) : file_(std::move(file)) {}
  Document(const Document&) = delete;
  Document& operator=(const Document&) = delete;

  // Takes the header and the chunks apart.
  Expected<void> Parse(std::string bytes);

  const std::string& file() const { return file_; }
  const nlohmann::json& root() const { return root_; }

  // The number under a key: a whole one from 0 to `most`; nothing where the key is absent.
  Expected<std::optional<std::size_t>> Whole(const nlohmann::json& object, const char* key,
                                             std::size_t most, const std::string& where) const;
  // The same where it must be there.
  Expected<std::size_t> Needed(const nlohmann::json& object, const char* key, std::size_t most,
                               const std::string& where) const;
  // The numbers of a list of this length; nothing where the key is absent.
  Expected<std::optional<std::vector<double>>> Numbers(const nlohmann::json& object,
                                                       const char* key, std::size_t length,
                                                       const std::string& where) const;
  // Element `index` of a top-level list.
  Expected<const nlohmann::json*> Item(const char* array, std::size_t index,
                                       const std::string& where) const;
  // The elements that an accessor points at, all of them inside the body.
  Expected<Elements> Accessor(std::size_t index) const;

 private:
  std::string file_;
  std::string bytes_;
  std::string_view body_;
  nlohmann::json root_;
};

}  // namespace tsdfpp::gltf
