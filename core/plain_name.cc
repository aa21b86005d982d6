#include "core/plain_name.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <set>
#include <string>

#include "core/one_line.h"

namespace tsdfpp {
namespace {

// What Windows takes for a device, whatever follows a dot.
bool IsDeviceName(std::string_view name) {
  std::string stem(name.substr(0, name.find('.')));
  while (stem.ends_with(' ')) stem.pop_back();
  std::transform(stem.begin(), stem.end(), stem.begin(),
                 [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
  constexpr std::array<std::string_view, 6> kDevices = {"CON", "PRN",    "AUX",
                                                        "NUL", "CONIN$", "CONOUT$"};
  if (std::find(kDevices.begin(), kDevices.end(), stem) != kDevices.end()) return true;
  return stem.size() == 4 && (stem.starts_with("COM") || stem.starts_with("LPT")) &&
         std::isdigit(static_cast<unsigned char>(stem.back())) != 0;
}

// What is wrong with text that is to be shown; empty where it is fine.
std::string_view FaultOfText(std::string_view text) {
  if (text.size() > kMostNameBytes) return "is longer than 100 bytes";
  if (!IsUtf8(text)) return "is not UTF-8";
  if (HasControl(text)) return "holds a control character";
  return {};
}

std::string_view FaultOfName(std::string_view name) {
  if (name.empty()) return "is empty";
  if (const std::string_view fault = FaultOfText(name); !fault.empty()) return fault;
  if (name.find_first_of("/\\") != std::string_view::npos) return "holds a slash";
  if (name.front() == '.' || name.front() == '-') return "begins with a dot or a dash";
  if (name.back() == '.' || name.back() == ' ') return "ends with a dot or a blank";
  if (IsDeviceName(name)) return "is the name of a device";
  return {};
}

}  // namespace

Expected<void> CheckPlainName(std::string_view name, std::string_view what) {
  const std::string_view fault = FaultOfName(name);
  if (fault.empty()) return {};
  return DataError("{}: the name {} {}, expected one that can be a file's name", what, Quoted(name),
                   fault);
}

Expected<void> CheckLabel(std::string_view label, std::string_view what) {
  const std::string_view fault = FaultOfText(label);
  if (fault.empty()) return {};
  return DataError("{} {} {}", what, Quoted(label), fault);
}

Expected<void> CheckObjects(const std::vector<ObjectInfo>& objects, std::string_view where) {
  std::set<InstanceId> ids;
  std::set<std::string_view> names;
  for (const ObjectInfo& object : objects) {
    const std::string what = fmt::format("{}: object {}", where, object.id);
    if (object.id == kNoInstance) {
      return DataError("{}: the id {} stands for no object, expected one below", what, kNoInstance);
    }
    TSDFPP_RETURN_IF_ERROR(CheckPlainName(object.name, what));
    TSDFPP_RETURN_IF_ERROR(CheckLabel(object.semantic_class, what + ": the class"));
    if (!ids.insert(object.id).second) return DataError("{}: its id is there twice", what);
    if (!names.insert(object.name).second) {
      return DataError("{}: its name {} is another object's too", what, Quoted(object.name));
    }
  }
  return {};
}

}  // namespace tsdfpp
