// record/record.json and record/record.bin of a comparison (docs/report.md), read and checked.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "core/error.h"

namespace tsdfpp {

struct Recording {
  nlohmann::json json;
  std::string bytes;  // meshes and images, at the places that `json` names

  std::vector<int> KeyFrames() const;

  // The key frame that would be missed least: the one whose neighbours are nearest to each other,
  // but neither the last nor one of `keep` as long as there are others. There must be two at least.
  int LeastKeyFrame(const std::set<int>& keep) const;

  // Takes a key frame out, with its bytes; nothing happens where there is none of this number.
  void DropKeyFrame(int frame);
};

// Nothing where `folder` has no recording. Errors: kData where the recording is incomplete, names
// bytes that it does not have, or has not the form that it should have.
Expected<std::optional<Recording>> ReadRecording(const std::filesystem::path& folder);

}  // namespace tsdfpp
