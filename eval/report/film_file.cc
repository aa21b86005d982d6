#include "eval/report/film_file.h"

#include <sys/mman.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <vector>

#include "core/files.h"

namespace tsdfpp {
namespace {

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

MemoryFile::MemoryFile()
    : descriptor_(memfd_create("tsdfpp-film", MFD_CLOEXEC)),
      failure_(descriptor_ < 0 ? errno : 0) {}

MemoryFile::~MemoryFile() {
  if (descriptor_ >= 0) close(descriptor_);
}

Expected<std::string> MemoryFile::Read() const {
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

std::string MemoryFile::path() const {
  return fmt::format("/proc/{}/fd/{}", getpid(), descriptor_);
}

FilmFile::FilmFile(const std::filesystem::path& file)
    : file_(file),
      link_(file.parent_path() / fmt::format("{}{}.mp4", HiddenName(file), getpid())) {}

FilmFile::~FilmFile() {
  std::error_code ignored;
  std::filesystem::remove(link_, ignored);
}

Expected<void> FilmFile::Open(cv::Size size, int rate_hz) {
  if (file_.has_parent_path()) TSDFPP_RETURN_IF_ERROR(MakeWritableFolder(file_.parent_path()));
  if (!memory_.is_open()) return Cannot(std::strerror(memory_.failure()));
  auto encoder = NewFilmEncoder();
  if (!encoder) return Cannot(encoder.error().message);
  encoder_ = std::move(*encoder);
  RemoveDeadLinks(file_);
  std::error_code failure;
  std::filesystem::create_symlink(memory_.path(), link_, failure);
  if (failure) return Cannot(failure.message());
  quiet_.emplace();  // the encoder prints what it chose, and its threads what they lack
  if (encoder_->Open(link_.string(), rate_hz, size)) return {};
  quiet_.reset();
  return EnvironmentError(
      "cannot write H.264 to '{}': the folder refuses, or OpenCV has no encoder for it",
      file_.string());
}

void FilmFile::Show(const cv::Mat& page) {
  encoder_->Write(page);
  ++frames_;
}

Expected<void> FilmFile::Finish() {
  encoder_->Close();
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

tl::unexpected<Error> FilmFile::Cannot(const std::string& why) const {
  return EnvironmentError("cannot write '{}': {}", file_.string(), why);
}

}  // namespace tsdfpp
