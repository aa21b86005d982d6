#include "eval/score/coco_panoptic.h"

#include <fmt/format.h>

#include <limits>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "core/json_text.h"
#include "core/one_line.h"

namespace tsdfpp {
namespace {

// Throws where it is none: nlohmann's own conversion wraps what does not fit.
int IdOf(const nlohmann::json& json) {
  const auto id = WholeIn(json, 0, std::numeric_limits<int>::max());
  if (!id) throw std::out_of_range(fmt::format("{} is no id", JsonShown(json)));
  return static_cast<int>(*id);
}

// 0 or 1, also as false or true. Throws where it is neither number nor one of these.
bool IsFlagged(const nlohmann::json& object, const char* key, int otherwise) {
  const nlohmann::json flag = object.value(key, nlohmann::json(otherwise));
  if (flag.is_boolean()) return flag.get<bool>();
  const int number = IdOf(flag);
  if (number > 1) {
    throw std::out_of_range(fmt::format("'{}' is {}, expected 0 or 1", key, JsonShown(flag)));
  }
  return number == 1;
}

}  // namespace

Expected<CocoAnnotations> ReadCocoAnnotations(const std::filesystem::path& path) {
  TSDFPP_ASSIGN(const nlohmann::json json, ReadJsonObject(path));
  CocoAnnotations out;
  try {
    const nlohmann::json categories = json.value("categories", nlohmann::json::array());
    const nlohmann::json& annotations = json.at("annotations");
    for (const auto& [name, list] :
         {std::pair("categories", &categories), std::pair("annotations", &annotations)}) {
      if (!list->is_array()) throw std::out_of_range(fmt::format("'{}' is no list", name));
    }
    for (const auto& category : categories) {
      const auto id = IdOf(category.at("id"));
      if (!out.is_thing.emplace(id, IsFlagged(category, "isthing", 1)).second) {
        throw std::out_of_range(fmt::format("category {} is there twice", id));
      }
    }
    for (const auto& annotation : annotations) {
      const std::string file = annotation.at("file_name");
      const std::string id = JsonText(annotation.at("image_id"));
      if (out.by_file.contains(file) || out.file_of_id.contains(id)) {
        throw std::out_of_range(
            fmt::format("image {} or file {} is there twice", id, Quoted(file)));
      }
      std::vector<PanopticSegment>& segments = out.by_file[file];
      out.id_of_file[file] = id;
      out.file_of_id[id] = file;
      for (const auto& info : annotation.at("segments_info")) {
        segments.push_back(
            {IdOf(info.at("id")), IdOf(info.at("category_id")), IsFlagged(info, "iscrowd", 0)});
      }
    }
  } catch (const std::exception& error) {
    return DataError("{}: is no panoptic JSON as COCO's: {}", path.string(),
                     WithoutTag(error.what()));
  }
  if (out.by_file.empty()) return DataError("{}: has no annotations", path.string());
  return out;
}

}  // namespace tsdfpp
