#include "eval/make/frame_journal.h"

#include <algorithm>
#include <cstdlib>
#include <nlohmann/json.hpp>

#include "core/files.h"
#include "core/folders.h"
#include "core/json_text.h"
#include "core/one_line.h"
#include "core/pose_text.h"
#include "sequence/cofusion_layout.h"

namespace tsdfpp {
namespace fs = std::filesystem;
namespace {

constexpr const char* kKey = "key.txt";

std::string ToJson(const JournalEntry& entry) {
  const WrittenFrame& frame = entry.frame;
  nlohmann::json json;
  json["index"] = frame.index;
  json["T_WC"] = PoseToText(frame.T_WC);
  json["sensed_T_WC"] =
      frame.sensed_T_WC ? nlohmann::json(PoseToText(*frame.sensed_T_WC)) : nlohmann::json(nullptr);
  json["T_WO"] = nlohmann::json::object();
  for (const auto& [id, pose] : frame.T_WO) json["T_WO"][std::to_string(id)] = PoseToText(pose);
  json["has_mask"] = frame.has_mask;
  json["hashes"] = frame.hashes;
  json["visibility"] = entry.visibility;
  json["segments"] = entry.segments;
  return JsonText(json) + "\n";
}

// Throws what nlohmann throws, and std::exception for a pose that is none.
JournalEntry FromJson(const nlohmann::json& json) {
  const auto pose = [](const nlohmann::json& text) {
    return PoseFromText(text.get<std::string>()).value();
  };
  JournalEntry entry;
  WrittenFrame& frame = entry.frame;
  frame.index = json.at("index").get<int>();
  frame.T_WC = pose(json.at("T_WC"));
  if (!json.at("sensed_T_WC").is_null()) frame.sensed_T_WC = pose(json.at("sensed_T_WC"));
  for (const auto& [id, text] : json.at("T_WO").items()) {
    frame.T_WO.emplace(static_cast<InstanceId>(std::stoi(id)), pose(text));
  }
  frame.has_mask = json.at("has_mask").get<bool>();
  frame.hashes = json.at("hashes").get<std::map<std::string, std::string>>();
  entry.visibility = json.at("visibility").get<std::string>();
  entry.segments = json.at("segments").get<std::string>();
  return entry;
}

}  // namespace

bool FrameJournal::HasKey(const std::string& key) const {
  const auto text = ReadFile(notes_ / kKey);
  return text && *text == key;
}

Expected<void> FrameJournal::WriteKey(const std::string& key) const {
  return WriteFile(notes_ / kKey, key);
}

Expected<void> FrameJournal::Add(const JournalEntry& entry) const {
  return WriteFile(notes_ / fmt::format("{:04d}.json", entry.frame.index), ToJson(entry));
}

Expected<JournalEntry> FrameJournal::Read(int index) const {
  const fs::path path = notes_ / fmt::format("{:04d}.json", index);
  TSDFPP_ASSIGN(const nlohmann::json json, ReadJsonObject(path));
  try {
    return FromJson(json);
  } catch (const std::exception& exception) {
    return DataError("{}: not a frame's entry ({})", path.string(), WithoutTag(exception.what()));
  }
}

int FrameJournal::Count() const {
  const std::vector<fs::path> files = EntriesOf(notes_);
  return static_cast<int>(std::count_if(files.begin(), files.end(), [](const fs::path& file) {
    return cofusion::NumberOf(file.filename().string(), "", ".json").has_value();
  }));
}

std::map<int, JournalEntry> FrameJournal::ReadSound() const {
  std::map<int, JournalEntry> entries;
  for (const fs::path& file : EntriesOf(notes_)) {
    if (file.extension() != ".json") continue;
    // A damaged entry is none: its frame is rendered again.
    auto entry = Read(std::atoi(file.stem().c_str()));
    if (!entry) continue;
    const auto& hashes = entry->frame.hashes;
    const bool sound = std::all_of(hashes.begin(), hashes.end(), [&](const auto& item) {
      const auto bytes = ReadFile(set_ / item.first);
      return bytes && HashText(*bytes) == item.second;
    });
    const int index = entry->frame.index;
    if (sound) entries.emplace(index, std::move(*entry));
  }
  return entries;
}

}  // namespace tsdfpp
