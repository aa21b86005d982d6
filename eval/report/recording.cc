#include "eval/report/recording.h"

#include <algorithm>
#include <functional>
#include <limits>

#include "core/files.h"
#include "core/folders.h"
#include "core/json_text.h"
#include "core/plain_name.h"

namespace tsdfpp {
namespace {

using nlohmann::json;

// A number that stays itself as an int, and of which differences can be taken.
bool IsFrame(const json& number) {
  return WholeIn(number, 0, std::numeric_limits<int>::max()).has_value();
}

bool IsNumbers(const json& list) {
  return list.is_array() &&
         std::all_of(list.begin(), list.end(), [](const json& x) { return x.is_number(); });
}

bool NumbersOfLength(const json& list, std::size_t length) {
  return list.size() == length && IsNumbers(list);
}

bool IsAboveZero(const json& number) { return number.is_number() && number.get<double>() > 0; }

bool IsGrid(const json& grid) {
  return grid.is_object() && NumbersOfLength(grid.value("origin_m", json()), 3) &&
         IsAboveZero(grid.value("step_m", json()));
}

// Calls `visit` for each place [offset, length] in `bytes` that the recording names. False where a
// part that should hold places has another form.
bool ForEachPlace(json& recording, const std::function<bool(json&)>& visit) {
  const auto places = [&](json& part, std::initializer_list<const char*> names) {
    return part.is_object() && std::all_of(names.begin(), names.end(), [&](const char* name) {
             return part.contains(name) && visit(part[name]);
           });
  };
  const auto all = [](json& list, const auto& check) {
    return list.is_array() && std::all_of(list.begin(), list.end(), check);
  };
  const auto mesh = [&](json& part) {
    return places(part, {"vertex_bytes", "index_bytes"}) && part.contains("id") &&
           part["id"].is_number_unsigned() && part.contains("vertices") &&
           part["vertices"].is_number_unsigned() && part.contains("triangles") &&
           part["triangles"].is_number_unsigned() &&
           (!part.contains("grid") || IsGrid(part["grid"]));
  };
  const auto chunk = [&](json& part) {
    return mesh(part) && part.contains("layer") && part["layer"].is_string();
  };
  const auto numbered = [](const json& part) {
    return part.is_object() && part.contains("frame") && IsFrame(part["frame"]);
  };
  return all(recording["truth"], mesh) &&
         all(recording["key_frames"],
             [&](json& key) {
               return numbered(key) && places(key, {"colour", "depth", "mask"});
             }) &&
         all(recording["runs"], [&](json& run) {
           return run.is_object() && run.contains("folder") && run["folder"].is_string() &&
                  all(run["key_frames"], [&](json& key) {
                    return numbered(key) && places(key, {"picture"}) &&
                           (!key.contains("picture_after") || visit(key["picture_after"])) &&
                           all(key["chunks"], chunk);
                  });
         });
}

std::optional<std::pair<std::size_t, std::size_t>> PlaceOf(const json& place) {
  if (!place.is_array() || place.size() != 2 || !place[0].is_number_unsigned() ||
      !place[1].is_number_unsigned()) {
    return std::nullopt;
  }
  return std::pair{place[0].get<std::size_t>(), place[1].get<std::size_t>()};
}

// What the page reads besides the places.
bool HasForm(const json& recording) {
  const auto number = [&](const char* name) {
    return recording.contains(name) && recording[name].is_number();
  };
  const auto list = [&](const char* name) {
    return recording.contains(name) && recording[name].is_array() && !recording[name].empty();
  };
  const auto object_has_form = [](const json& object) {
    return object.is_object() && object.value("id", json()).is_number_unsigned() &&
           object.value("name", json()).is_string() &&
           object.value("removed", json(false)).is_boolean() &&
           NumbersOfLength(object.value("colour", json()), 3);
  };
  const auto frame_has_form = [](const json& frame) {
    return frame.is_object() && IsFrame(frame.value("frame", json())) &&
           NumbersOfLength(frame.value("T_WC", json()), 7) &&
           frame.value("T_WO", json()).is_object() &&
           std::all_of(frame["T_WO"].begin(), frame["T_WO"].end(),
                       [](const json& pose) { return NumbersOfLength(pose, 7); });
  };
  const json sequence = recording.value("sequence", json(""));
  return sequence.is_string() && CheckLabel(sequence.get<std::string>(), "sequence") &&
         number("error_step_m") && number("age_step_frames") && list("objects") && list("frames") &&
         list("key_frames") && list("runs") && recording.contains("truth") &&
         NumbersOfLength(recording.value("depth_range_m", json()), 2) &&
         std::all_of(recording["objects"].begin(), recording["objects"].end(), object_has_form) &&
         std::all_of(recording["frames"].begin(), recording["frames"].end(), frame_has_form);
}

// Lists of pairs, by object; null for one of which nothing is known.
bool IsPositionErrors(const json& errors) {
  const auto is_list = [](const json& list) {
    if (list.is_null()) return true;
    return list.is_array() && std::all_of(list.begin(), list.end(), [](const json& pair) {
             return NumbersOfLength(pair, 2);
           });
  };
  return errors.is_object() && std::all_of(errors.begin(), errors.end(), is_list);
}

// A map of a recording of which `recorded` are the key frames.
Expected<void> CheckMap(const json& run, const std::set<int>& recorded, const std::string& file) {
  const auto wrong = [&](const std::string& what) {
    return DataError("{}: map '{}' has {}", file, run["folder"].get<std::string>(), what);
  };
  for (const char* name : {"memory_mb", "track_ms", "update_poses_ms", "fuse_ms"}) {
    if (!IsNumbers(run.value(name, json()))) {
      return wrong(fmt::format("no list of numbers '{}'", name));
    }
  }
  if (!IsPositionErrors(run.value("position_error_mm", json::object()))) {
    return wrong("a 'position_error_mm' of another form, expected pairs of numbers by object");
  }
  for (const json& key : run["key_frames"]) {
    const int frame = key["frame"].get<int>();
    if (!recorded.contains(frame)) {
      return wrong(fmt::format("key frame {}, expected one that 'key_frames' has", frame));
    }
  }
  return {};
}

// What the page looks up in a recording whose parts have their forms.
Expected<void> CheckForPage(const json& recording, const std::string& file) {
  const json grid = recording.value("grid", json());
  if (!IsGrid(grid)) {
    return DataError("{}: 'grid' is {}, expected origin_m, three numbers, and step_m, above 0",
                     file, JsonShown(grid));
  }
  const json camera = recording.value("intrinsics", json());
  const auto has = [&](const char* name, const auto& check) {
    return camera.is_object() && check(camera.value(name, json()));
  };
  const auto is_number = [](const json& value) { return value.is_number(); };
  const auto is_focal_length = [](const json& value) { return value.is_number() && value != 0; };
  if (!has("width", IsAboveZero) || !has("height", IsAboveZero) || !has("fx", is_focal_length) ||
      !has("fy", is_focal_length) || !has("cx", is_number) || !has("cy", is_number)) {
    return DataError(
        "{}: 'intrinsics' is {}, expected width and height, above 0, fx and fy, not 0, cx and cy",
        file, JsonShown(camera));
  }
  std::set<int> recorded;
  for (const json& key : recording["key_frames"]) {
    const int frame = key["frame"].get<int>();
    if (!recorded.empty() && frame <= *recorded.rbegin()) {
      return DataError("{}: 'key_frames' has frame {} after {}, expected a greater one", file,
                       frame, *recorded.rbegin());
    }
    recorded.insert(frame);
  }
  for (const json& run : recording["runs"]) {
    TSDFPP_RETURN_IF_ERROR(CheckMap(run, recorded, file));
  }
  return {};
}

}  // namespace

std::vector<int> Recording::KeyFrames() const {
  std::vector<int> frames;
  for (const nlohmann::json& key : json["key_frames"]) frames.push_back(key["frame"].get<int>());
  return frames;
}

int Recording::LeastKeyFrame(const std::set<int>& keep) const {
  const std::vector<int> frames = KeyFrames();
  std::size_t least = 0;
  int least_gap = std::numeric_limits<int>::max();
  for (std::size_t i = 1; i + 1 < frames.size(); ++i) {
    const int gap = frames[i + 1] - frames[i - 1];
    if (keep.contains(frames[i]) || gap >= least_gap) continue;
    least = i;
    least_gap = gap;
  }
  if (!keep.contains(frames[least])) return frames[least];
  const auto last = std::find_if(frames.rbegin(), frames.rend(),
                                 [&](int frame) { return !keep.contains(frame); });
  return last == frames.rend() ? frames.back() : *last;
}

void Recording::DropKeyFrame(int frame) {
  const auto drop = [&](nlohmann::json& list) {
    list.erase(std::remove_if(list.begin(), list.end(),
                              [&](const nlohmann::json& key) { return key["frame"] == frame; }),
               list.end());
  };
  drop(json["key_frames"]);
  for (nlohmann::json& run : json["runs"]) drop(run["key_frames"]);
  std::string kept;
  ForEachPlace(json, [&](nlohmann::json& place) {
    const auto [offset, length] = *PlaceOf(place);
    place = nlohmann::json::array({kept.size(), length});
    kept.append(bytes, offset, length);
    return true;
  });
  bytes = std::move(kept);
}

Expected<std::optional<Recording>> ReadRecording(const std::filesystem::path& folder) {
  const std::filesystem::path path = folder / "record" / "record.json";
  if (!IsThere(path)) return std::nullopt;
  Recording recording;
  TSDFPP_ASSIGN(recording.json, ReadJsonObject(path));
  if (recording.json.value("schema", json()) != 1) {
    return DataError("{}: schema is {}, expected 1", path.string(),
                     JsonShown(recording.json.value("schema", json())));
  }
  TSDFPP_ASSIGN(recording.bytes, ReadFile(folder / "record" / "record.bin"));
  if (!HasForm(recording.json)) {
    return DataError("{} lacks something that docs/report.md names", path.string());
  }
  std::string outside;
  std::size_t named = 0;
  const bool complete = ForEachPlace(recording.json, [&](json& place) {
    const auto range = PlaceOf(place);
    if (range && range->first <= recording.bytes.size() &&
        range->second <= recording.bytes.size() - range->first) {
      named += range->second;
      // Each byte has one place; else a short file could name more than memory holds.
      if (named <= recording.bytes.size()) return true;
    }
    outside = JsonShown(place);
    return false;
  });
  if (!outside.empty()) {
    return DataError("{}: {} is no offset and length of its own in the {} bytes of record.bin",
                     path.string(), outside, recording.bytes.size());
  }
  if (!complete) {
    return DataError("{} lacks something that docs/report.md names", path.string());
  }
  TSDFPP_RETURN_IF_ERROR(CheckForPage(recording.json, path.string()));
  return recording;
}

}  // namespace tsdfpp
