#include "eval/make/scene_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "core/encode_image.h"
#include "core/files.h"
#include "core/one_line.h"
#include "sim/load_scene.h"
#include "sim/scene_list.h"
#include "sim/simulated_source.h"

namespace tsdfpp {
namespace fs = std::filesystem;
namespace {

constexpr const char* kPage = "scenes.md";
constexpr const char* kPictures = "pictures";
constexpr const char* kScenes = "scenes";
constexpr std::array<double, 3> kMoments{0.12, 0.5, 0.88};  // shares of the sequence
constexpr int kPictureWidth_px = 320;
constexpr int kSheetWidth_px = 256;  // of one picture on the sheet
constexpr int kSheetColumns = 4;
constexpr int kCaption_px = 26;
constexpr int kGap_px = 6;
constexpr int kJpegQuality = 85;
// By which a page is known as ours.
constexpr std::string_view kMadeBy = "Made by `tsdfpp generate --page docs`.";

cv::Mat Shrunk(const cv::Mat& image, int width) {
  cv::Mat small;
  cv::resize(image, small, {width, std::max(1, image.rows * width / image.cols)}, 0, 0,
             cv::INTER_AREA);
  return small;
}

Expected<void> WriteJpeg(const cv::Mat& rgb, const fs::path& path) {
  cv::Mat bgr;
  cv::cvtColor(rgb, bgr, cv::COLOR_RGB2BGR);
  TSDFPP_ASSIGN(const std::string bytes,
                EncodeImage(bgr, ".jpg", path.string(), {cv::IMWRITE_JPEG_QUALITY, kJpegQuality}));
  return WriteFile(path, bytes);
}

// Pictures are named by their scenes.
Expected<void> CheckNamesDiffer(const std::vector<SceneFile>& files) {
  std::map<std::string_view, const SceneFile*> named;
  for (const SceneFile& file : files) {
    const auto [first, is_new] = named.try_emplace(file.name, &file);
    if (!is_new) {
      return UsageError("{}: 'name' is '{}', as in {}, expected another for each scene of a page",
                        file.path.string(), file.name, first->second->path.string());
    }
  }
  return {};
}

// Nothing is written where a link leads, and nobody else's page is replaced.
Expected<void> CheckPlaceOfPage(const fs::path& out) {
  std::error_code failure;
  for (const fs::path& folder : {out / kPictures, out / kPictures / kScenes}) {
    if (fs::is_symlink(folder, failure)) {
      return UsageError("{}: is a link, expected a folder or nothing", folder.string());
    }
  }
  const fs::path page = out / kPage;
  if (!fs::exists(fs::symlink_status(page, failure))) return {};
  const auto text = ReadFile(page);
  if (text && text->find(kMadeBy) != std::string::npos) return {};
  return UsageError(
      "{}: is no page of generate --page and would be replaced, expected it elsewhere",
      page.string());
}

// The pictures next to each other.
cv::Mat Strip(const std::vector<cv::Mat>& pictures) {
  const cv::Size one = pictures.front().size();
  const int count = static_cast<int>(pictures.size());
  cv::Mat strip(one.height, count * one.width + (count - 1) * kGap_px, CV_8UC3,
                cv::Scalar::all(255));
  for (int i = 0; i < count; ++i) {
    pictures[static_cast<std::size_t>(i)].copyTo(
        strip({i * (one.width + kGap_px), 0, one.width, one.height}));
  }
  return strip;
}

// The middle picture of each scene with its name, kSheetColumns a row.
cv::Mat Sheet(const std::vector<std::pair<std::string, cv::Mat>>& scenes) {
  int height = 0;
  for (const auto& [name, picture] : scenes) height = std::max(height, picture.rows);
  const int cell = height + kCaption_px + kGap_px;
  const int rows = (static_cast<int>(scenes.size()) + kSheetColumns - 1) / kSheetColumns;
  cv::Mat sheet(rows * cell, kSheetColumns * (kSheetWidth_px + kGap_px), CV_8UC3,
                cv::Scalar::all(255));
  for (std::size_t i = 0; i < scenes.size(); ++i) {
    const auto& [name, picture] = scenes[i];
    const int x = static_cast<int>(i) % kSheetColumns * (kSheetWidth_px + kGap_px);
    const int y = static_cast<int>(i) / kSheetColumns * cell;
    picture.copyTo(sheet({x, y + kCaption_px, picture.cols, picture.rows}));
    cv::putText(sheet, name, {x + 2, y + kCaption_px - 8}, cv::FONT_HERSHEY_SIMPLEX, 0.55,
                cv::Scalar::all(30), 1, cv::LINE_AA);
  }
  return sheet;
}

}  // namespace

Expected<void> WriteScenePage(const fs::path& scenes, const fs::path& out,
                              const std::function<void(int, int)>& progress) {
  TSDFPP_ASSIGN(const std::vector<SceneFile> files, SceneFiles(scenes));
  TSDFPP_RETURN_IF_ERROR(CheckNamesDiffer(files));
  TSDFPP_RETURN_IF_ERROR(CheckPlaceOfPage(out));
  const fs::path pictures = out / kPictures / kScenes;
  TSDFPP_RETURN_IF_ERROR(MakeWritableFolder(pictures));
  std::string page = fmt::format(
      "# The scenes\n\nEach isolates one difficulty. The keys of a scene file are explained in "
      "[scene-files.md](scene-files.md); the pictures\nshow frames at 12, 50 and 88 % of each. "
      "{}\n\n![All scenes](pictures/scenes.jpg)\n\n"
      "| scene | what it is for | frames | image | objects | pictures "
      "|\n|---|---|---|---|---|---|\n",
      kMadeBy);
  std::vector<std::pair<std::string, cv::Mat>> sheet;
  for (std::size_t i = 0; i < files.size(); ++i) {
    const SceneFile& file = files[i];
    progress(static_cast<int>(i), static_cast<int>(files.size()));
    TSDFPP_ASSIGN(const SceneConfig config, LoadSceneConfig(file.path));
    TSDFPP_ASSIGN(auto source, SimulatedSource::Open(config, {}));
    std::vector<cv::Mat> strip;
    for (const double moment : kMoments) {
      const int frame = source->info().first_index + static_cast<int>(moment * (file.frames - 1));
      TSDFPP_ASSIGN(const Frame seen, source->Read(frame));
      strip.push_back(Shrunk(seen.colour, kPictureWidth_px));
      if (strip.size() == 2) sheet.emplace_back(file.name, Shrunk(seen.colour, kSheetWidth_px));
    }
    TSDFPP_RETURN_IF_ERROR(WriteJpeg(Strip(strip), pictures / (file.name + ".jpg")));
    page += fmt::format(
        "| `{}` | {} | {} at {:g} Hz | {}x{} | {}{} | ![{}](pictures/scenes/{}.jpg) |\n", file.name,
        InMarkdown(file.purpose), file.frames, file.rate_hz, file.width, file.height,
        config.objects.size(), file.random ? " (drawn by `--seed`)" : "", file.name, file.name);
  }
  progress(static_cast<int>(files.size()), static_cast<int>(files.size()));
  TSDFPP_RETURN_IF_ERROR(WriteJpeg(Sheet(sheet), out / kPictures / "scenes.jpg"));
  return WriteFile(out / kPage, page);
}

}  // namespace tsdfpp
