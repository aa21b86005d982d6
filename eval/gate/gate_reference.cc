#include "eval/gate/gate_reference.h"

#include <fstream>

#include "core/files.h"
#include "core/json_text.h"
#include "core/one_line.h"

namespace tsdfpp {
namespace {

nlohmann::json ToJson(const GateReference& reference) {
  nlohmann::json by_frame = nlohmann::json::object();
  for (const auto& [replicate, values] : reference.by_frame) {
    nlohmann::json& curve = by_frame[replicate] = nlohmann::json::object();
    for (const auto& [frame, value] : values) curve[std::to_string(frame)] = value;
  }
  const GateEnvironment& environment = reference.environment;
  return {{"question", reference.question},
          {"values", reference.values},
          {"map_digests", reference.map_digests},
          {"by_frame", by_frame},
          {"program", environment.program},
          {"renderer", environment.renderer},
          {"mujoco", environment.mujoco},
          {"machine", environment.machine},
          {"command", reference.command},
          {"reason", reference.reason},
          {"date", reference.date}};
}

GateReference FromJson(const nlohmann::json& json) {
  GateReference reference;
  json.at("question").get_to(reference.question);
  json.at("values").get_to(reference.values);
  json.at("map_digests").get_to(reference.map_digests);
  for (const auto& [replicate, curve] : json.at("by_frame").items()) {
    for (const auto& [frame, value] : curve.items()) {
      reference.by_frame[replicate][std::stoi(frame)] = value.get<double>();
    }
  }
  json.at("program").get_to(reference.environment.program);
  json.at("renderer").get_to(reference.environment.renderer);
  json.at("mujoco").get_to(reference.environment.mujoco);
  json.at("machine").get_to(reference.environment.machine);
  json.at("command").get_to(reference.command);
  json.at("reason").get_to(reference.reason);
  json.at("date").get_to(reference.date);
  return reference;
}

}  // namespace

bool GateEnvironment::SameBytesExpected(const GateEnvironment& other) const {
  return renderer == other.renderer && mujoco == other.mujoco && machine == other.machine;
}

std::string MachineName() {
  std::ifstream file("/proc/cpuinfo");
  for (std::string line; std::getline(file, line);) {
    const std::size_t colon = line.find(": ");
    if (line.rfind("model name", 0) == 0 && colon != std::string::npos) {
      return line.substr(colon + 2);
    }
  }
  return "unknown";
}

double MeanValue(const GateReference& reference) {
  double sum = 0;
  for (const auto& [replicate, value] : reference.values) sum += value;
  return sum / static_cast<double>(reference.values.size());
}

std::string QuestionOf(const Gate& gate) {
  const FrameChoice& frames = gate.frames;
  return fmt::format("{}: {} of {}; frames: scale {}, stride {}, every {}, until {}",
                     gate.experiment, gate.metric, ChoiceText(gate.where), frames.scale,
                     frames.stride, frames.every, frames.until);
}

Expected<References> LoadReferences(const std::filesystem::path& file) {
  std::error_code ignored;
  if (!std::filesystem::exists(file, ignored)) return References{};
  const auto read = ReadJsonObject(file);
  if (!read) {
    return DataError("{}, expected references that tsdfpp gate --update wrote",
                     read.error().message);
  }
  const nlohmann::json& json = *read;
  TSDFPP_RETURN_IF_ERROR(CheckTextsAreShowable(json, file.string()));
  try {
    if (const nlohmann::json& schema = json.at("schema"); schema != kReferencesSchema) {
      return DataError("{}: has schema {}, expected {}", file.string(), JsonShown(schema),
                       kReferencesSchema);
    }
    References references;
    for (const auto& [gate, entry] : json.at("gates").items()) {
      references[gate] = FromJson(entry);
    }
    return references;
  } catch (const std::exception& error) {
    return DataError("{}: a field is missing or wrong ({})", file.string(),
                     WithoutTag(error.what()));
  }
}

Expected<void> SaveReferences(const References& references, const std::filesystem::path& file) {
  nlohmann::json gates = nlohmann::json::object();
  for (const auto& [gate, reference] : references) gates[gate] = ToJson(reference);
  const nlohmann::json json{{"schema", kReferencesSchema}, {"gates", gates}};
  return WriteFile(file, JsonText(json, 1) + "\n");
}

std::string ReferencesDifference(const References& before, const References& after) {
  std::string text;
  for (const auto& [gate, reference] : after) {
    const auto old = before.find(gate);
    if (old == before.end()) {
      text += fmt::format("{}: new\n", gate);
      for (const auto& [replicate, value] : reference.values) {
        text += fmt::format("  {} {:.6g}\n", replicate, value);
      }
      continue;
    }
    for (const auto& [replicate, value] : reference.values) {
      const auto was = old->second.values.find(replicate);
      if (was == old->second.values.end()) {
        text += fmt::format("{} {} none -> {:.6g}\n", gate, replicate, value);
      } else if (was->second != value) {
        text += fmt::format("{} {} {:.6g} -> {:.6g} ({:+.3g})\n", gate, replicate, was->second,
                            value, value - was->second);
      }
    }
    for (const auto& [replicate, value] : old->second.values) {
      if (reference.values.contains(replicate)) continue;
      text += fmt::format("{} {} {:.6g} -> none\n", gate, replicate, value);
    }
  }
  for (const auto& [gate, reference] : before) {
    if (!after.contains(gate)) text += fmt::format("{}: gone\n", gate);
  }
  return text;
}

}  // namespace tsdfpp
