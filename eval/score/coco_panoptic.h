// COCO's panoptic annotations: a JSON file beside a folder of images.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "core/error.h"
#include "metrics/segmentation.h"

namespace tsdfpp {

// What each image's segments are.
struct CocoAnnotations {
  std::map<std::string, std::vector<PanopticSegment>> by_file;  // image file name
  std::map<std::string, std::string> id_of_file;
  std::map<std::string, std::string> file_of_id;
  std::map<int, bool> is_thing;  // by category
};

// Reads such a file (docs/sources.md, "Segmentation"). Errors: kData where it cannot be read, is no
// panoptic JSON, names an image twice, or has no annotations.
Expected<CocoAnnotations> ReadCocoAnnotations(const std::filesystem::path& path);

}  // namespace tsdfpp
