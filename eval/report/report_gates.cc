#include "eval/report/report_gates.h"

#include "core/data_folder.h"
#include "core/folders.h"
#include "core/json_text.h"
#include "eval/gate/gate_report.h"
#include "eval/tools/base64.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

Expected<void> CheckTexts(const json& object, std::initializer_list<const char*> names,
                          const std::string& where) {
  for (const char* name : names) {
    if (!object.is_object() || !object.contains(name) || !object[name].is_string()) {
      return DataError("{}'{}' is missing or no text", where, name);
    }
  }
  return {};
}

Expected<void> CheckGates(const json& gates, const std::string& file) {
  for (const json& gate : gates) {
    TSDFPP_RETURN_IF_ERROR(CheckTexts(gate, {"name", "verdict", "of", "cells", "bounds_because"},
                                      file + ": a gate's "));
    if (!gate.contains("bounds") || !gate["bounds"].is_object() || !gate.contains("mean")) {
      return DataError("{}: gate '{}' has no bounds or no mean", file,
                       gate["name"].get<std::string>());
    }
  }
  return {};
}

// What the page reads without asking whether it is there.
Expected<void> Check(const json& results, const std::string& file) {
  if (results.value("schema", json()) != kGatesSchema) {
    return DataError("{}: schema is {}, expected {}", file,
                     JsonShown(results.value("schema", json())), kGatesSchema);
  }
  TSDFPP_RETURN_IF_ERROR(CheckTexts(results, {"profile", "sabotage", "program"}, file + ": "));
  for (const char* name : {"controls", "gates", "sabotages"}) {
    if (!results.contains(name) || !results[name].is_array()) {
      return DataError("{}: '{}' is missing or no list", file, name);
    }
  }
  TSDFPP_RETURN_IF_ERROR(CheckGates(results["gates"], file));
  for (const json& control : results["controls"]) {
    TSDFPP_RETURN_IF_ERROR(
        CheckTexts(control, {"name", "verdict", "metric"}, file + ": a control's "));
    for (const char* name : {"greatest_spread", "allowed_spread"}) {
      if (!control.contains(name) || !control[name].is_number()) {
        return DataError("{}: a control's '{}' is missing or no number", file, name);
      }
    }
  }
  for (const json& sabotage : results["sabotages"]) {
    TSDFPP_RETURN_IF_ERROR(CheckTexts(sabotage, {"name", "words"}, file + ": a sabotage's "));
    if (!sabotage.contains("caught") || !sabotage["caught"].is_boolean() ||
        !sabotage.contains("gates") || !sabotage["gates"].is_array()) {
      return DataError("{}: sabotage '{}' does not say whether it was caught, and by what", file,
                       sabotage["name"].get<std::string>());
    }
    TSDFPP_RETURN_IF_ERROR(CheckGates(sabotage["gates"], file));
  }
  return {};
}

}  // namespace

Expected<json> ReadGateResults(const std::filesystem::path& file) {
  TSDFPP_ASSIGN(json results, ReadJsonObject(file));
  TSDFPP_RETURN_IF_ERROR(Check(results, file.string()));
  json pictures = json::object();
  const fs::path folder = AbsolutePath(file).parent_path();
  for (const json& gate : results["gates"]) {
    const json explanation = gate.value("explanation", json());
    const json picture = explanation.is_object() ? explanation.value("picture", json()) : json();
    const std::string name = picture.is_string() ? picture.get<std::string>() : "";
    // A file of that folder and no other.
    if (name.empty() || fs::path(name).filename() != name) continue;
    // No link leads elsewhere: its bytes would be in the page.
    const auto path = fs::path(kGatePictures) / name;
    std::error_code code;
    if (!fs::exists(fs::symlink_status(folder / path, code))) continue;
    TSDFPP_ASSIGN(const std::string bytes, DataFolder(folder).Read(path.string()));
    pictures[gate["name"].get<std::string>()] = "data:image/png;base64," + Base64(bytes);
  }
  results["pictures"] = std::move(pictures);
  return results;
}

}  // namespace tsdfpp
