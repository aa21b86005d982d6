#include "eval/run/mask_folder.h"

#include <algorithm>
#include <charconv>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>

#include "core/data_folder.h"
#include "core/folders.h"
#include "core/limits.h"
#include "sequence/integer_images.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;

constexpr const char* kClass = "thing";

enum class MaskKind { kIds, kInstance, kInstanceInFolder };

struct NamedMask {
  MaskKind kind = MaskKind::kIds;
  int frame = 0;
  int instance = 0;
  fs::path file;
};

bool IsDigit(char c) { return c >= '0' && c <= '9'; }

// The digits at the end of `text`, which are taken off it; nothing where there are none. Errors:
// kData, naming `file`: more digits than a frame's number has, or a time's behind its point.
Expected<std::optional<int>> TakeNumber(std::string_view& text, const fs::path& file) {
  std::size_t begin = text.size();
  while (begin > 0 && IsDigit(text[begin - 1])) --begin;
  if (begin == text.size()) return std::nullopt;
  const std::string_view digits = text.substr(begin);
  text.remove_suffix(digits.size());
  if (text.ends_with('.')) {
    return DataError("{}: is named after a time, expected the number of a frame", file.string());
  }
  int number = 0;
  if (std::from_chars(digits.data(), digits.data() + digits.size(), number).ec != std::errc()) {
    return DataError("{}: {} is no number of a frame", file.string(), digits);
  }
  return number;
}

// What the name says; nothing where it has no number at its end. Errors: those of TakeNumber.
Expected<std::optional<NamedMask>> NameOf(const fs::path& file) {
  const std::string name = file.stem().string();
  std::string_view stem = name;
  TSDFPP_ASSIGN(const std::optional<int> last, TakeNumber(stem, file));
  if (!last) return std::nullopt;
  if (!stem.ends_with('_')) return NamedMask{MaskKind::kIds, *last, 0, file};
  stem.remove_suffix(1);
  TSDFPP_ASSIGN(const std::optional<int> frame, TakeNumber(stem, file));
  if (!frame) return NamedMask{MaskKind::kIds, *last, 0, file};
  return NamedMask{MaskKind::kInstance, *frame, *last, file};
}

// The images in a folder that is named after a frame; none where it is not. `others` are images
// that hold no ids.
Expected<std::vector<NamedMask>> MasksIn(const fs::path& folder, std::vector<NamedMask>& others) {
  std::vector<NamedMask> masks;
  const std::string name = folder.filename().string();
  if (name.find_first_not_of("0123456789.") != std::string::npos) return masks;
  std::string_view digits = name;
  TSDFPP_ASSIGN(const std::optional<int> frame, TakeNumber(digits, folder));
  if (!frame || !digits.empty()) return masks;
  TSDFPP_ASSIGN(const std::vector<fs::path> files, ListFolder(folder));
  for (const fs::path& file : files) {
    const IdEnding ending = IdEndingOf(file);
    if (ending == IdEnding::kNone) continue;
    std::vector<NamedMask>& images = ending == IdEnding::kIds ? masks : others;
    images.push_back({MaskKind::kInstanceInFolder, *frame, static_cast<int>(images.size()), file});
  }
  return masks;
}

// A frame whose only image is passed over would have no instance, and nobody would know. Beside the
// mask that it belongs to it may be a picture for people.
Expected<void> CheckPassedOver(const std::vector<NamedMask>& masks,
                               const std::vector<NamedMask>& others) {
  std::set<std::pair<int, std::string>> there;  // frames, and names in them
  for (const NamedMask& mask : masks) {
    there.emplace(mask.frame, "");
    there.emplace(mask.frame, mask.file.stem().string());
  }
  for (const NamedMask& other : others) {
    const std::string name =
        other.kind == MaskKind::kIds ? std::string() : other.file.stem().string();
    if (there.contains({other.frame, name})) continue;
    return DataError(
        "{}: is of frame {} and does not hold ids exactly, expected a mask of that name as .png, "
        ".pgm, .ppm, .pbm, .pnm, .tif, .tiff or .bmp",
        other.file.string(), other.frame);
  }
  return {};
}

Expected<std::vector<NamedMask>> ListMasks(const fs::path& folder) {
  std::vector<NamedMask> masks;
  std::vector<NamedMask> others;
  TSDFPP_ASSIGN(const std::vector<fs::path> entries, ListFolder(folder));
  for (const fs::path& entry : entries) {
    if (IsFolder(entry)) {
      TSDFPP_ASSIGN(const std::vector<NamedMask> inside, MasksIn(entry, others));
      masks.insert(masks.end(), inside.begin(), inside.end());
      continue;
    }
    const IdEnding ending = IdEndingOf(entry);
    if (ending == IdEnding::kNone) continue;
    Expected<std::optional<NamedMask>> named = NameOf(entry);
    if (!named && ending == IdEnding::kIds) return tl::unexpected(named.error());
    if (named && *named) (ending == IdEnding::kIds ? masks : others).push_back(std::move(**named));
  }
  TSDFPP_RETURN_IF_ERROR(CheckPassedOver(masks, others));
  return masks;
}

// Whether two masks of a frame that follow each other have one number (1_3.png and 01_3.png), or
// are of two folders (1/ and 01/).
bool IsThereTwice(const NamedMask& a, const NamedMask& b) {
  return a.kind == MaskKind::kInstance ? a.instance == b.instance
                                       : a.file.parent_path() != b.file.parent_path();
}

// The instance of the pixels that are not 0 in `is_there`; nothing where there are none.
std::optional<Instance> InstanceOf(const cv::Mat& is_there) {
  cv::Rect box;
  for (int v = 0; v < is_there.rows; ++v) {
    const auto* row = is_there.ptr<std::uint8_t>(v);
    for (int u = 0; u < is_there.cols; ++u) {
      if (row[u] != 0) box |= cv::Rect(u, v, 1, 1);
    }
  }
  if (box.empty()) return std::nullopt;
  const double share =
      static_cast<double>(cv::countNonZero(is_there)) / static_cast<double>(is_there.total());
  return Instance{box, is_there(box).clone(), kClass, static_cast<float>(1 - share)};
}

// Masks are data: where many are spread over the image their boxes are far more than it.
Expected<void> CheckBoxes(const Frame& frame, const fs::path& folder, std::int64_t pixels) {
  return CheckLimit(
      &Limits::image_pixels, pixels,
      fmt::format("frame {}: {}: the boxes of its masks", frame.index, folder.string()), "pixels");
}

Expected<std::vector<Instance>> InstancesOfIds(const cv::Mat& ids, const Frame& frame,
                                               const fs::path& folder) {
  std::map<InstanceId, cv::Rect> boxes;
  for (int v = 0; v < ids.rows; ++v) {
    const auto* row = ids.ptr<InstanceId>(v);
    for (int u = 0; u < ids.cols; ++u) {
      if (row[u] != kBackground && row[u] != kNoInstance) boxes[row[u]] |= cv::Rect(u, v, 1, 1);
    }
  }
  std::int64_t pixels = 0;
  for (const auto& [id, box] : boxes) pixels += box.area();
  TSDFPP_RETURN_IF_ERROR(CheckBoxes(frame, folder, pixels));
  std::vector<Instance> instances;
  instances.reserve(boxes.size());
  for (const auto& [id, box] : boxes) {
    instances.push_back({box, ids(box) == static_cast<double>(id), kClass, 1});
  }
  return instances;
}

}  // namespace

Expected<std::unique_ptr<MaskFolder>> MaskFolder::Open(const fs::path& folder) {
  TSDFPP_ASSIGN(std::vector<NamedMask> masks, ListMasks(folder));
  if (masks.empty()) {
    return DataError(
        "{}: has no image that is named after a frame, expected masks such as 000012.png, "
        "000012_000003.png or 12/3.png",
        folder.string());
  }
  std::stable_sort(masks.begin(), masks.end(), [](const NamedMask& a, const NamedMask& b) {
    return std::pair(a.frame, a.instance) < std::pair(b.frame, b.instance);
  });
  std::unique_ptr<MaskFolder> opened(new MaskFolder(folder));
  opened->is_of_ids_ = masks.front().kind == MaskKind::kIds;
  const NamedMask* before = nullptr;
  for (const NamedMask& mask : masks) {
    if (mask.kind != masks.front().kind) {
      return DataError("{}: {} and {} are masks of different kinds, expected one kind",
                       folder.string(), masks.front().file.string(), mask.file.string());
    }
    std::vector<fs::path>& files = opened->files_[mask.frame];
    if (opened->is_of_ids_ && !files.empty()) {
      return DataError("{} and {} are both the ids of frame {}, expected one image",
                       files.front().string(), mask.file.string(), mask.frame);
    }
    if (!files.empty() && IsThereTwice(*before, mask)) {
      return DataError("{} and {} are both of frame {}, expected one of the two",
                       files.back().string(), mask.file.string(), mask.frame);
    }
    files.push_back(mask.file);
    before = &mask;
  }
  return opened;
}

Expected<std::vector<Instance>> MaskFolder::Find(const Frame& frame) {
  const int first = files_.begin()->first;
  const int last = files_.rbegin()->first;
  if (frame.index < first || frame.index > last) {
    return DataError("frame {}: {} has masks of frames {} to {}", frame.index, folder_.string(),
                     first, last);
  }
  std::vector<Instance> instances;
  const auto files = files_.find(frame.index);
  if (files == files_.end()) return instances;
  if (files->second.size() >= kNoInstance) {
    return DataError("frame {}: {} has {} masks of it, expected {} at most", frame.index,
                     folder_.string(), files->second.size(), kNoInstance - 1);
  }
  const DataFolder folder(folder_);
  std::int64_t pixels = 0;
  for (const fs::path& file : files->second) {
    TSDFPP_RETURN_IF_ERROR(folder.CheckLinks(file));
    const auto ids = ReadIds(file, frame.depth.size(), "the frame's depth");
    if (!ids) return DataError("frame {}: {}", frame.index, ids.error().message);
    if (is_of_ids_) return InstancesOfIds(*ids, frame, folder_);
    auto instance = InstanceOf(*ids != 0);
    if (!instance) continue;
    pixels += instance->box.area();
    TSDFPP_RETURN_IF_ERROR(CheckBoxes(frame, folder_, pixels));
    instances.push_back(std::move(*instance));
  }
  return instances;
}

}  // namespace tsdfpp
