#include "eval/report/report_video.h"

#include <algorithm>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <set>

#include "core/data_folder.h"
#include "core/decode_image.h"
#include "core/files.h"
#include "core/json_text.h"
#include "core/plain_name.h"
#include "eval/compare/report_record.h"
#include "eval/report/film_file.h"
#include "eval/report/recording.h"
#include "eval/run/compare_names.h"
#include "eval/run/run_folder.h"

namespace tsdfpp {
namespace {

constexpr int kRate_hz = 30;
constexpr int kCellWidth = 416;
constexpr int kGap = 8;
constexpr int kTitle = 26;
constexpr int kColumns = 3;
constexpr std::size_t kTextPlace = 2;    // the free place after the panels of the camera
constexpr int kFade = 8;                 // output frames from one still to the next, at most
constexpr double kBody_s = 12;           // the growing maps, at least this long
constexpr int kMostHold = 45;            // output frames a still
constexpr int kReveal = 45;              // output frames of the removal
constexpr int kLast = 90;                // and of what it leaves
const cv::Scalar kPaper(248, 250, 251);  // blue, green, red, as all images here
const cv::Scalar kInk(31, 29, 29);

struct Panel {
  std::string title;
  std::string still;  // StillName's first part
};

void Write(cv::Mat& image, const std::string& text, cv::Point at, double size, int thickness = 1) {
  cv::putText(image, text, at, cv::FONT_HERSHEY_SIMPLEX, size, kInk, thickness, cv::LINE_AA);
}

class Film {
 public:
  Film(std::vector<Panel> panels, cv::Size cell) : panels_(std::move(panels)), cell_(cell) {
    const int rows = (static_cast<int>(panels_.size()) + kColumns - 1) / kColumns;
    // H.264 takes even sizes.
    size_ = {kGap + kColumns * (cell_.width + kGap), kGap + rows * (kTitle + cell_.height + kGap)};
    size_.width += size_.width % 2;
    size_.height += size_.height % 2;
  }

  cv::Size size() const { return size_; }

  // An image a panel; an empty one leaves its place free, for the lines of text.
  cv::Mat Compose(const std::vector<cv::Mat>& images, const std::vector<std::string>& lines) const {
    cv::Mat page(size_, CV_8UC3, kPaper);
    for (std::size_t i = 0; i < panels_.size(); ++i) {
      const cv::Point corner = CornerOf(i);
      Write(page, panels_[i].title, corner + cv::Point(0, kTitle - 9), 0.5, 1);
      if (images[i].empty()) continue;
      cv::Mat small;
      cv::resize(images[i], small, cell_, 0, 0, cv::INTER_AREA);
      small.copyTo(page(cv::Rect(corner + cv::Point(0, kTitle), cell_)));
    }
    cv::Point at = CornerOf(kTextPlace) + cv::Point(12, kTitle + 34);
    for (std::size_t i = 0; i < lines.size(); ++i) {
      Write(page, lines[i], at, i == 0 ? 0.8 : 0.55, i == 0 ? 2 : 1);
      at.y += i == 0 ? 38 : 26;
    }
    return page;
  }

 private:
  cv::Point CornerOf(std::size_t i) const {
    const int column = static_cast<int>(i) % kColumns;
    const int row = static_cast<int>(i) / kColumns;
    return {kGap + column * (cell_.width + kGap), kGap + row * (kTitle + cell_.height + kGap)};
  }

  std::vector<Panel> panels_;
  cv::Size cell_;
  cv::Size size_;
};

Expected<cv::Mat> ReadStill(const std::filesystem::path& path) {
  return ReadImageFile(path, DecodeAs::kColour);
}

std::string StillFile(const std::string& what, int frame) {
  return "record/stills/" + StillName(what, frame);
}

std::string FrameLine(int frame) { return fmt::format("frame {}", frame); }

cv::Mat Between(const cv::Mat& from, const cv::Mat& to, double share) {
  cv::Mat mixed;
  cv::addWeighted(from, 1 - share, to, share, 0, mixed);
  return mixed;
}

// Errors: kData, saying what to do, where files of the recording are of another run than the
// summary.
Expected<void> CheckRecordedRun(const std::filesystem::path& run,
                                const std::set<std::string>& files) {
  const auto read = ReadJsonObject(run / kSummaryFile);
  const nlohmann::json summary = read ? *read : nlohmann::json();
  return CheckOneRun(run, RunOfSummary(summary), files);
}

std::string TitleOf(const nlohmann::json& run) {
  std::string title = run["folder"].get<std::string>();
  std::replace(title.begin(), title.end(), '_', ' ');
  return title;
}

// What is filmed: a recording, the frames that it has stills of, and what the film shows of each.
struct Footage {
  std::filesystem::path run;
  Recording recording;
  std::vector<int> stills;
  std::vector<Panel> panels;  // the camera's, then a map's each

  // The files of the stills, by their paths in the run's folder.
  std::set<std::string> StillFiles() const {
    std::set<std::string> files;
    for (const int frame : stills) {
      for (const Panel& panel : panels) {
        if (!panel.still.empty()) files.insert(StillFile(panel.still, frame));
      }
    }
    return files;
  }

  std::string Sequence() const { return recording.json.value("sequence", ""); }

  // An image a panel; an empty one for the free place.
  Expected<std::vector<cv::Mat>> ImagesAt(int frame) const {
    std::vector<cv::Mat> images;
    for (const Panel& panel : panels) {
      images.emplace_back();
      if (panel.still.empty()) continue;
      TSDFPP_ASSIGN(images.back(), ReadStill(run / StillFile(panel.still, frame)));
    }
    return images;
  }

  // The names of what is removed, between commas.
  std::string Removed() const {
    std::string removed;
    for (const nlohmann::json& object : recording.json["objects"]) {
      if (!object.value("removed", false)) continue;
      removed += (removed.empty() ? "" : ", ") + object.value("name", "");
    }
    return removed;
  }

  // The last images with the maps after the removal, as the recording's last key frame that has
  // them shows them.
  Expected<std::vector<cv::Mat>> AfterRemoval(const std::vector<cv::Mat>& last) const {
    std::vector<cv::Mat> images = last;
    const nlohmann::json& runs = recording.json["runs"];
    for (std::size_t r = 0; r < runs.size(); ++r) {
      const nlohmann::json& keys = runs[r]["key_frames"];
      if (keys.empty() || !keys.back().contains("picture_after")) continue;
      const nlohmann::json& place = keys.back()["picture_after"];
      // ReadRecording has made sure of the place.
      const std::string_view encoded =
          std::string_view(recording.bytes)
              .substr(place[0].get<std::size_t>(), place[1].get<std::size_t>());
      const std::string where =
          fmt::format("{}: the picture of map '{}' after the removal of frame {}",
                      (run / "record" / "record.bin").string(), panels[kColumns + r].still,
                      keys.back()["frame"].get<int>());
      TSDFPP_ASSIGN(images[kColumns + r], DecodeImage(encoded, where, DecodeAs::kColour));
    }
    return images;
  }
};

// Errors: kData, the run has no recording with stills, or it is broken.
Expected<Footage> ReadFootage(const std::filesystem::path& run) {
  TSDFPP_RETURN_IF_ERROR(CheckLinksBelow(run));
  TSDFPP_RETURN_IF_ERROR(CheckRecordedRun(run, {"record/record.json", "record/record.bin"}));
  TSDFPP_ASSIGN(std::optional<Recording> recording, ReadRecording(run));
  if (!recording || !recording->json.contains("stills") || !recording->json["stills"].is_array() ||
      recording->json["stills"].empty()) {
    return DataError("'{}' has no recording to film, expected what tsdfpp compare --record writes",
                     run.string());
  }
  Footage footage{run, std::move(*recording), {}, {{"camera", "colour"}, {"objects", "mask"}, {}}};
  for (const nlohmann::json& still : footage.recording.json["stills"]) {
    const auto frame = WholeIn(still, 0, std::numeric_limits<int>::max());
    if (!frame || (!footage.stills.empty() && *frame <= footage.stills.back())) {
      return DataError("'{}': a still is {}, expected frames' numbers, each greater than the last",
                       run.string(), JsonShown(still));
    }
    footage.stills.push_back(static_cast<int>(*frame));
  }
  for (const nlohmann::json& each : footage.recording.json["runs"]) {
    footage.panels.push_back({TitleOf(each), each["folder"].get<std::string>()});
    // Part of the stills' file names.
    TSDFPP_RETURN_IF_ERROR(CheckPlainName(footage.panels.back().still,
                                          fmt::format("'{}': a map's folder", run.string())));
  }
  TSDFPP_RETURN_IF_ERROR(CheckRecordedRun(run, footage.StillFiles()));
  return footage;
}

// The page that the growing maps end with, and its images.
struct LastPage {
  std::vector<cv::Mat> images;
  cv::Mat page;
};

// The maps as they grow, a still after the other.
Expected<LastPage> ShowGrowth(const Footage& footage, const Film& film, FilmFile& out) {
  const int hold =
      std::clamp(static_cast<int>(kBody_s * kRate_hz / static_cast<double>(footage.stills.size())),
                 2, kMostHold);
  const int fade = std::min(kFade, hold / 2);
  LastPage last;
  for (const int frame : footage.stills) {
    TSDFPP_ASSIGN(last.images, footage.ImagesAt(frame));
    const cv::Mat page = film.Compose(last.images, {footage.Sequence(), FrameLine(frame)});
    for (int i = 0; i < hold; ++i) {
      out.Show(!last.page.empty() && i < fade ? Between(last.page, page, (i + 1.0) / fade) : page);
    }
    last.page = page;
  }
  return last;
}

// What the removal leaves of them, where something is removed.
Expected<void> ShowRemoval(const Footage& footage, const Film& film, const LastPage& before,
                           FilmFile& out) {
  const std::string removed = footage.Removed();
  if (removed.empty()) return {};
  TSDFPP_ASSIGN(const std::vector<cv::Mat> after, footage.AfterRemoval(before.images));
  const cv::Mat page = film.Compose(after, {footage.Sequence(), FrameLine(footage.stills.back()),
                                            "taken out of the maps:", removed});
  for (int i = 0; i < kReveal; ++i) out.Show(Between(before.page, page, (i + 1.0) / kReveal));
  for (int i = 0; i < kLast; ++i) out.Show(page);
  return {};
}

}  // namespace

Expected<ReportVideo> WriteReportVideo(const std::filesystem::path& run,
                                       const std::filesystem::path& file) {
  TSDFPP_ASSIGN(const Footage footage, ReadFootage(run));
  TSDFPP_ASSIGN(const std::vector<cv::Mat> first, footage.ImagesAt(footage.stills.front()));
  const Film film(footage.panels,
                  {kCellWidth, std::max(1, kCellWidth * first[0].rows / first[0].cols)});
  FilmFile out(file);
  TSDFPP_RETURN_IF_ERROR(out.Open(film.size(), kRate_hz));
  TSDFPP_ASSIGN(const LastPage grown, ShowGrowth(footage, film, out));
  TSDFPP_RETURN_IF_ERROR(ShowRemoval(footage, film, grown, out));
  TSDFPP_RETURN_IF_ERROR(out.Finish());
  return ReportVideo{out.frames(), film.size().width, film.size().height,
                     static_cast<double>(out.frames()) / kRate_hz};
}

}  // namespace tsdfpp
