#include "eval/report/report_video.h"

#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>
#include <optional>

#include "core/decode_image.h"
#include "core/files.h"
#include "core/json_text.h"
#include "core/plain_name.h"
#include "core/quiet_stderr.h"
#include "eval/compare/report_record.h"
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

// A file that goes away unless it was renamed.
struct Temporary {
  std::filesystem::path path;
  ~Temporary() {
    std::error_code ignored;
    std::filesystem::remove(path, ignored);
  }
};

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

std::string FrameLine(int frame) { return fmt::format("frame {}", frame); }

cv::Mat Between(const cv::Mat& from, const cv::Mat& to, double share) {
  cv::Mat mixed;
  cv::addWeighted(from, 1 - share, to, share, 0, mixed);
  return mixed;
}

}  // namespace

// An MP4 file is a row of boxes, each a length and four letters. One that was cut has none called
// "moov", which is written last, or one that is longer than what is there.
bool IsWholeVideo(std::string_view bytes) {
  constexpr std::size_t kHead = 8;
  bool has_index = false;
  while (!bytes.empty()) {
    if (bytes.size() < kHead) return false;
    const auto number = [&](std::size_t from, std::size_t count) {
      std::uint64_t value = 0;
      for (std::size_t i = from; i < from + count; ++i) {
        value = value << 8U | static_cast<unsigned char>(bytes[i]);
      }
      return value;
    };
    std::uint64_t length = number(0, 4);
    // 1: the length is in eight bytes behind; 0, to the end of the file, is what was never filled
    // in.
    if (length == 1 && bytes.size() >= 2 * kHead) length = number(kHead, kHead);
    if (length < kHead || length > bytes.size()) return false;
    has_index = has_index || bytes.substr(4, 4) == "moov";
    bytes.remove_prefix(length);
  }
  return has_index;
}

namespace {

// A file in memory that a library can open by a name: it says nothing where it could not write.
class MemoryFile {
 public:
  MemoryFile()
      : descriptor_(memfd_create("tsdfpp-film", MFD_CLOEXEC)),
        failure_(descriptor_ < 0 ? errno : 0) {}
  ~MemoryFile() {
    if (descriptor_ >= 0) close(descriptor_);
  }
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;
  bool is_open() const { return descriptor_ >= 0; }
  int failure() const { return failure_; }  // as errno
  Expected<std::string> Read() const {
    std::string bytes;
    std::array<char, 65536> block{};
    while (true) {
      const ssize_t count =
          pread(descriptor_, block.data(), block.size(), static_cast<off_t>(bytes.size()));
      if (count < 0 && errno == EINTR) continue;
      if (count < 0) return EnvironmentError("a film cannot be read ({})", std::strerror(errno));
      if (count == 0) return bytes;
      bytes.append(block.data(), static_cast<std::size_t>(count));
    }
  }
  std::string path() const { return fmt::format("/proc/{}/fd/{}", getpid(), descriptor_); }

 private:
  int descriptor_;
  int failure_;
};

std::string HiddenName(const std::filesystem::path& file) {
  return fmt::format(".{}.", file.filename().string());
}

// Links to the memory of processes that were killed.
void RemoveDeadLinks(const std::filesystem::path& file) {
  const std::filesystem::path folder = file.has_parent_path() ? file.parent_path() : ".";
  std::vector<std::filesystem::path> dead;
  std::error_code failure;
  for (std::filesystem::directory_iterator entry(folder, failure), end; !failure && entry != end;
       entry.increment(failure)) {
    const std::string name = entry->path().filename().string();
    std::error_code unknown;
    if (name.starts_with(HiddenName(file)) && name.ends_with(".mp4") &&
        std::filesystem::is_symlink(entry->symlink_status(unknown)) &&
        !std::filesystem::exists(entry->path(), unknown)) {
      dead.push_back(entry->path());
    }
  }
  for (const std::filesystem::path& link : dead) std::filesystem::remove(link, failure);
}

// The film while it is written. OpenCV does not say whether what it wrote got anywhere, so it
// writes to memory. It knows the format by the name's end, so a link there has one.
class FilmFile {
 public:
  explicit FilmFile(const std::filesystem::path& file)
      : file_(file),
        link_{file.parent_path() / fmt::format("{}{}.mp4", HiddenName(file), getpid())} {}

  // Errors: kEnvironment, the folder refuses or there is no encoder.
  Expected<void> Open(cv::Size size) {
    if (file_.has_parent_path()) TSDFPP_RETURN_IF_ERROR(MakeWritableFolder(file_.parent_path()));
    if (!memory_.is_open()) return Cannot(std::strerror(memory_.failure()));
    RemoveDeadLinks(file_);
    std::error_code failure;
    std::filesystem::create_symlink(memory_.path(), link_.path, failure);
    if (failure) return Cannot(failure.message());
    quiet_.emplace();  // the encoder prints what it chose, and its threads what they lack
    writer_.open(link_.path.string(), cv::CAP_FFMPEG, cv::VideoWriter::fourcc('a', 'v', 'c', '1'),
                 kRate_hz, size);
    if (writer_.isOpened()) return {};
    return EnvironmentError(
        "cannot write H.264 to '{}': the folder refuses, or OpenCV has no encoder for it",
        file_.string());
  }

  void Show(const cv::Mat& page) {
    writer_.write(page);
    ++frames_;
  }

  int frames() const { return frames_; }

  // Errors: kEnvironment, the film is not whole or cannot be written.
  Expected<void> Finish() {
    writer_.release();
    // The encoder goes on after an error, with another film, and OpenCV says nothing of it.
    const std::string words = quiet_ ? quiet_->Words() : "";
    quiet_.reset();
    if (words.find("[error]") != std::string::npos) {
      return Cannot("its encoder says '" + words + "'");
    }
    TSDFPP_ASSIGN(const std::string bytes, memory_.Read());
    if (!IsWholeVideo(bytes)) {
      return Cannot(fmt::format("the video is cut off after {} bytes", bytes.size()));
    }
    return WriteFile(file_, bytes);
  }

 private:
  tl::unexpected<Error> Cannot(const std::string& why) const {
    return EnvironmentError("cannot write '{}': {}", file_.string(), why);
  }

  std::filesystem::path file_;
  MemoryFile memory_;
  Temporary link_;
  std::optional<QuietStderr> quiet_;  // outlives the encoder's threads
  cv::VideoWriter writer_;
  int frames_ = 0;
};

// Errors: kData, saying what to do, where the recording is of another run than the summary.
Expected<void> CheckRecordedRun(const std::filesystem::path& run) {
  const auto read = ReadJsonObject(run / kSummaryFile);
  const nlohmann::json summary = read ? *read : nlohmann::json();
  return CheckOneRun(run, RunOfSummary(summary), {"record/record.json", "record/record.bin"});
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

  std::string Sequence() const { return recording.json.value("sequence", ""); }

  // An image a panel; an empty one for the free place.
  Expected<std::vector<cv::Mat>> ImagesAt(int frame) const {
    std::vector<cv::Mat> images;
    for (const Panel& panel : panels) {
      images.emplace_back();
      if (panel.still.empty()) continue;
      TSDFPP_ASSIGN(images.back(),
                    ReadStill(run / "record" / "stills" / StillName(panel.still, frame)));
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
      TSDFPP_ASSIGN(images[kColumns + r],
                    DecodeImage(encoded, "a picture after the removal", DecodeAs::kColour));
    }
    return images;
  }
};

// Errors: kData, the run has no recording with stills, or it is broken.
Expected<Footage> ReadFootage(const std::filesystem::path& run) {
  TSDFPP_RETURN_IF_ERROR(CheckRecordedRun(run));
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
  TSDFPP_RETURN_IF_ERROR(out.Open(film.size()));
  TSDFPP_ASSIGN(const LastPage grown, ShowGrowth(footage, film, out));
  TSDFPP_RETURN_IF_ERROR(ShowRemoval(footage, film, grown, out));
  TSDFPP_RETURN_IF_ERROR(out.Finish());
  return ReportVideo{out.frames(), film.size().width, film.size().height,
                     static_cast<double>(out.frames()) / kRate_hz};
}

}  // namespace tsdfpp
