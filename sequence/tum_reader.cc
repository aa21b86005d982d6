#include <algorithm>
#include <cmath>

#include "core/data_folder.h"
#include "sequence/calibration.h"
#include "sequence/dataset_readers.h"
#include "sequence/image_files.h"
#include "sequence/text_lines.h"
#include "sequence/timed_poses.h"

namespace tsdfpp {
namespace fs = std::filesystem;
namespace {

constexpr double kTumUnitsPerMetre = 5000;
// ROS's default for a Kinect, which TUM recommends for its registered depth images.
constexpr Intrinsics kTumDefault{640, 480, 525, 525, 319.5, 239.5};

struct TimedFile {
  double time_s = 0;
  std::string file;
};

struct Association {
  TimedFile colour;
  TimedFile depth;
};

Expected<double> TimeOf(const fs::path& path, const TextLine& line, std::size_t word) {
  const auto time_s = ParseNumber(line.words[word]);
  if (!time_s || !std::isfinite(*time_s)) {
    return DataError("{}:{}: '{}' is not a time in seconds", path.string(), line.number,
                     line.words[word]);
  }
  return *time_s;
}

std::string WhereOf(const fs::path& path, const TextLine& line) {
  return fmt::format("{}:{}", path.string(), line.number);
}

Expected<std::vector<TimedFile>> ReadList(const fs::path& path) {
  TSDFPP_ASSIGN(const std::vector<TextLine> lines, ReadTextLines(path));
  std::vector<TimedFile> files;
  for (const TextLine& line : lines) {
    if (line.words.size() != 2) {
      return DataError("{}:{}: {} words, expected a time and a file", path.string(), line.number,
                       line.words.size());
    }
    TSDFPP_ASSIGN(const double time_s, TimeOf(path, line, 0));
    TSDFPP_RETURN_IF_ERROR(CheckRelativePath(line.words[1], WhereOf(path, line)));
    files.push_back({time_s, line.words[1]});
  }
  if (files.empty()) return DataError("{}: holds no images", path.string());
  std::sort(files.begin(), files.end(),
            [](const TimedFile& a, const TimedFile& b) { return a.time_s < b.time_s; });
  return files;
}

// Depth is the 16-bit grey one of the two images.
Expected<bool> DepthIsFirst(const fs::path& folder, const fs::path& list, const std::string& first,
                            const std::string& second) {
  TSDFPP_ASSIGN(const cv::Mat a, ReadImage(folder / first));
  TSDFPP_ASSIGN(const cv::Mat b, ReadImage(folder / second));
  const bool a_is_depth = a.type() == CV_16UC1;
  const bool b_is_depth = b.type() == CV_16UC1;
  if (a_is_depth == b_is_depth) {
    return DataError(
        "{}: {} is {} and {} is {}, expected one of them to be depth (16-bit unsigned with 1 "
        "channel)",
        list.string(), first, ImageTypeName(a), second, ImageTypeName(b));
  }
  return a_is_depth;
}

Expected<std::vector<Association>> ReadAssociations(const fs::path& folder, const fs::path& path) {
  TSDFPP_ASSIGN(const std::vector<TextLine> lines, ReadTextLines(path));
  std::vector<Association> pairs;
  bool depth_first = false;
  for (const TextLine& line : lines) {
    if (line.words.size() != 4) {
      return DataError("{}:{}: {} words, expected a time and a file twice", path.string(),
                       line.number, line.words.size());
    }
    for (const std::size_t word : {1U, 3U}) {
      TSDFPP_RETURN_IF_ERROR(CheckRelativePath(line.words[word], WhereOf(path, line)));
    }
    if (pairs.empty()) {
      TSDFPP_ASSIGN(depth_first, DepthIsFirst(folder, path, line.words[1], line.words[3]));
    }
    TSDFPP_ASSIGN(const double first_s, TimeOf(path, line, 0));
    TSDFPP_ASSIGN(const double second_s, TimeOf(path, line, 2));
    Association pair{{first_s, line.words[1]}, {second_s, line.words[3]}};
    if (depth_first) std::swap(pair.colour, pair.depth);
    pairs.push_back(std::move(pair));
  }
  if (pairs.empty()) return DataError("{}: holds no images", path.string());
  return pairs;
}

// As TUM's associate.py: of all pairs within the limit the nearest in time first, each image once.
// Errors: kData where there are so many pairs that the times cannot be right.
Expected<std::vector<Association>> Associate(const std::vector<TimedFile>& colour,
                                             const std::vector<TimedFile>& depth,
                                             const fs::path& folder) {
  // At the limit a camera takes some 40 pictures in twice the time.
  constexpr std::size_t kMostPairsAnImage = 100;
  const std::size_t most_pairs = kMostPairsAnImage * (colour.size() + depth.size());
  struct Candidate {
    double apart_s;
    std::size_t c;
    std::size_t d;
  };
  std::vector<Candidate> candidates;
  std::size_t begin = 0;
  for (std::size_t c = 0; c < colour.size(); ++c) {
    while (begin < depth.size() && depth[begin].time_s < colour[c].time_s - kAssociationLimit_s) {
      ++begin;
    }
    for (std::size_t d = begin;
         d < depth.size() && depth[d].time_s <= colour[c].time_s + kAssociationLimit_s; ++d) {
      candidates.push_back({std::abs(depth[d].time_s - colour[c].time_s), c, d});
      if (candidates.size() > most_pairs) {
        return DataError("{}: over {} images an image within {} s, expected times of a recording",
                         folder.string(), kMostPairsAnImage, kAssociationLimit_s);
      }
    }
  }
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const Candidate& a, const Candidate& b) { return a.apart_s < b.apart_s; });
  std::vector<int> partner(colour.size(), -1);
  std::vector<bool> taken(depth.size(), false);
  for (const Candidate& candidate : candidates) {
    if (partner[candidate.c] >= 0 || taken[candidate.d]) continue;
    partner[candidate.c] = static_cast<int>(candidate.d);
    taken[candidate.d] = true;
  }
  std::vector<Association> pairs;
  for (std::size_t c = 0; c < colour.size(); ++c) {
    if (partner[c] >= 0) pairs.push_back({colour[c], depth[static_cast<std::size_t>(partner[c])]});
  }
  return pairs;
}

Expected<std::vector<Association>> Pairs(const fs::path& folder, SequenceNotes& notes) {
  std::error_code code;
  constexpr std::array kNames{"associations.txt", "associated.txt"};
  if (fs::exists(folder / kNames[0], code) && fs::exists(folder / kNames[1], code)) {
    return DataError("{}: holds both {} and {}, expected one", folder.string(), kNames[0],
                     kNames[1]);
  }
  for (const char* name : kNames) {
    if (!fs::exists(folder / name, code)) continue;
    TSDFPP_ASSIGN(std::vector<Association> pairs, ReadAssociations(folder, folder / name));
    const auto time = [](const Association& pair) { return pair.depth.time_s; };
    if (!std::ranges::is_sorted(pairs, {}, time)) {
      std::ranges::stable_sort(pairs, {}, time);
      notes.push_back(
          fmt::format("{}: not in the order of the depth images' times, in which its "
                      "frames are read",
                      (folder / name).string()));
    }
    return pairs;
  }
  TSDFPP_ASSIGN(const std::vector<TimedFile> colour, ReadList(folder / "rgb.txt"));
  TSDFPP_ASSIGN(const std::vector<TimedFile> depth, ReadList(folder / "depth.txt"));
  TSDFPP_ASSIGN(std::vector<Association> pairs, Associate(colour, depth, folder));
  if (pairs.empty()) {
    return DataError(
        "{}: no colour image is within {} s of a depth image; colour is from {:.3f} to {:.3f} s, "
        "depth from {:.3f} to {:.3f} s",
        folder.string(), kAssociationLimit_s, colour.front().time_s, colour.back().time_s,
        depth.front().time_s, depth.back().time_s);
  }
  if (pairs.size() < colour.size()) {
    notes.push_back(fmt::format("{}: {} of {} colour images have no depth image within {} s",
                                (folder / "rgb.txt").string(), colour.size() - pairs.size(),
                                colour.size(), kAssociationLimit_s));
  }
  return pairs;
}

}  // namespace

Expected<std::unique_ptr<DatasetSource>> OpenTum(const fs::path& folder,
                                                 const SequenceOptions& options,
                                                 SequenceNotes& notes) {
  TSDFPP_ASSIGN(const std::vector<Association> pairs, Pairs(folder, notes));
  std::error_code code;
  const fs::path truth = folder / "groundtruth.txt";
  TSDFPP_RETURN_IF_ERROR(RemarkOnPoseOffset(truth, options.pose_offset_s, notes));
  if (fs::exists(truth, code) && options.fixed_camera) {
    return FixedCameraWithPoses(truth);
  }
  TimedPoses poses;
  if (fs::exists(truth, code) || !options.fixed_camera) {
    TSDFPP_ASSIGN(poses, ReadTimedPoses(truth, &notes));
  }
  FileSequence sequence;
  sequence.format = DatasetFormat::kTum;
  sequence.name = NameOfFolder(folder);
  Intrinsics camera = kTumDefault;
  sequence.size_source = "TUM's default camera";
  if (fs::exists(folder / "calibration.txt", code)) {
    TSDFPP_ASSIGN(camera, ReadCalibration(folder / "calibration.txt"));
    sequence.size_source = "calibration.txt";
  } else if (!options.intrinsics) {
    notes.push_back(
        fmt::format("{}: no calibration.txt, 525 525 319.5 239.5 is taken", sequence.name));
  }
  std::vector<std::string> stems;
  for (const Association& pair : pairs) {
    FrameFiles frame;
    frame.time_s = pair.depth.time_s;
    frame.colour = folder / pair.colour.file;
    frame.depth = folder / pair.depth.file;
    frame.camera = camera;
    frame.depth_units_per_m = kTumUnitsPerMetre;
    if (!poses.empty()) {
      const auto pose = PoseAt(poses, pair.depth.time_s + options.pose_offset_s);
      if (!pose) continue;
      frame.T_WC = *pose;
    }
    frame.number = static_cast<int>(sequence.frames.size());
    sequence.frames.push_back(std::move(frame));
    stems.push_back(fs::path(pair.colour.file).stem().string());
  }
  if (sequence.frames.empty()) {
    return DataError(
        "{}: no image is within its times, {:.3f} to {:.3f} s; images are from {:.3f} "
        "to {:.3f} s{}",
        truth.string(), poses.begin()->first, poses.rbegin()->first, pairs.front().depth.time_s,
        pairs.back().depth.time_s,
        options.pose_offset_s == 0
            ? ""
            : fmt::format(", and looked up with an offset of {:g} s", options.pose_offset_s));
  }
  if (sequence.frames.size() < pairs.size()) {
    notes.push_back(
        fmt::format("{}: {} of {} frames have no camera pose near their time and are "
                    "left out",
                    truth.string(), pairs.size() - sequence.frames.size(), pairs.size()));
  }
  TSDFPP_ASSIGN(const std::vector<fs::path> masks, FindMasks(folder, stems, notes));
  sequence.has_masks = !masks.empty();
  for (std::size_t i = 0; i < masks.size(); ++i) sequence.frames[i].ids = masks[i];
  return MakeFileSource(std::move(sequence), options, notes);
}

}  // namespace tsdfpp
