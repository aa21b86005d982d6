#include "cli/segment.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <chrono>
#include <filesystem>
#include <memory>
#include <optional>
#include <set>
#include <string>

#include "cli/segmentation_options.h"
#include "cli/sequence_options.h"
#include "core/files.h"
#include "core/folders.h"
#include "core/json_text.h"
#include "eval/picture/segment_picture.h"
#include "eval/run/run_folder.h"
#include "eval/score/segment_scores.h"
#include "mapper/kernels.h"
#include "mapper/segment/segmenter.h"
#include "sequence/image_encoders.h"
#include "sequence/sequence_json.h"

namespace tsdfpp {
namespace {

struct SegmentArguments {
  SequenceArguments source;
  SegmentationOptions segmentation{.segmentation = "depth"};
  std::string settings;
  std::string noise;
  std::string out;
  int every = 1;
  bool colour = false;
  bool score = false;
};

Expected<DepthSegmentsConfig> DepthConfig(const SegmentArguments& options) {
  DepthSegmentsConfig config;
  if (!options.settings.empty()) {
    TSDFPP_ASSIGN(const toml::table table, ParseTomlFile(options.settings));
    TSDFPP_ASSIGN(config, DepthSegmentsConfig::FromToml(table, options.settings));
  }
  if (!options.noise.empty()) {
    TSDFPP_ASSIGN(config.noise, DepthNoiseFromName(options.noise));
  }
  return config;
}

Expected<std::unique_ptr<Segmenter>> MakeSegmenterOf(const SegmentArguments& options) {
  TSDFPP_ASSIGN(const Segmentation segmentation,
                SegmentationFromName(options.segmentation.segmentation));
  TSDFPP_ASSIGN(SegmenterParts parts, ReadSegmenterParts(options.segmentation, segmentation));
  if (UsesDepth(segmentation)) {
    TSDFPP_ASSIGN(parts.depth, DepthConfig(options));
  } else if (!options.settings.empty() || !options.noise.empty()) {
    return UsageError("{} goes with --segmentation depth or full only",
                      options.noise.empty() ? "--settings" : "--noise");
  }
  return MakeSegmenter(segmentation, {}, parts);
}

// What a run leaves, frame by frame.
class SegmentWriter {
 public:
  SegmentWriter(const SegmentArguments& options, FrameSource& source, std::filesystem::path out)
      : options_(options), source_(source), out_(std::move(out)) {}

  static std::string NameOf(int frame) { return fmt::format("{:06d}.png", frame); }

  Expected<void> Add(Segmenter& segmenter, int index) {
    TSDFPP_ASSIGN(const Frame frame, source_.Read(index));
    const auto start = std::chrono::steady_clock::now();
    TSDFPP_ASSIGN(const Segments segments, segmenter.Segment(frame));
    const cv::Mat ids = segments.IdsOfObjects();
    seconds_ += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    if (ids.empty()) {
      return DataError(
          "{}: frame {} has no mask, expected one for each frame, for --segmentation "
          "gt",
          source_.info().name, index);
    }
    TSDFPP_RETURN_IF_ERROR(WriteFile(out_ / NameOf(index), PngFile(ids)));
    if (options_.colour) {
      TSDFPP_RETURN_IF_ERROR(
          WriteFile(out_ / "colour" / NameOf(index), PngFile(SegmentPicture(frame.colour, ids))));
    }
    ++frames_;
    shows_any_ = shows_any_ || cv::countNonZero((ids != kBackground) & (ids != kNoInstance)) > 0;
    if (!options_.score) return {};
    cv::Mat truth = frame.mask;
    if (source_.IsSensed()) {
      TSDFPP_ASSIGN(const Frame true_frame, source_.ReadTrue(index));
      truth = true_frame.mask;
    }
    if (truth.empty()) {
      return DataError("{}: frame {} has no mask, expected one for each frame, for --score",
                       source_.info().name, index);
    }
    return scorer_.Observe(truth, ids, frame.depth);
  }

  int frames() const { return frames_; }
  // Whether any frame has more than background.
  bool shows_any() const { return shows_any_; }
  double SecondsAFrame() const { return frames_ == 0 ? 0 : seconds_ / frames_; }
  SegmentScores Scores() const { return scorer_.Result(); }

 private:
  const SegmentArguments& options_;
  FrameSource& source_;
  std::filesystem::path out_;
  SegmentScorer scorer_;
  double seconds_ = 0;
  int frames_ = 0;
  bool shows_any_ = false;
};

std::string ScoreText(const Measured& value) {
  return value.value ? fmt::format("{:.3f}", *value.value) : "-";
}

// Errors: kUsage where `out` lies where the sequence is read, or is the folder of the masks.
Expected<void> CheckOut(const SegmentArguments& options) {
  const auto refused = [&](const std::string& read) {
    return UsageError("--out '{}' lies in '{}', which is read, expected a folder outside",
                      options.out, read);
  };
  for (const std::filesystem::path& read : PlacesOf(options.source)) {
    if (LiesIn(options.out, read)) return refused(read.string());
  }
  const std::string& masks = options.segmentation.masks;
  if (LiesIn(options.out, masks) && LiesIn(masks, options.out)) return refused(masks);
  return {};
}

Expected<CommandResult> RunSegment(const SegmentArguments& options, const CLI::App& app) {
  if (IsOurSequence(options.out)) {
    return UsageError("--out '{}' is a sequence, expected another folder", options.out);
  }
  TSDFPP_RETURN_IF_ERROR(CheckOut(options));
  TSDFPP_ASSIGN(const std::unique_ptr<Segmenter> segmenter, MakeSegmenterOf(options));
  TSDFPP_ASSIGN(const std::unique_ptr<FrameSource> source, OpenArguments(options.source));
  const SequenceInfo& info = source->info();
  TSDFPP_ASSIGN(RunFolder run_folder, RunFolder::Begin(options.out, CommandText(app)));
  std::set<std::string> files{"segments.json"};
  for (int i = 0; i < info.frame_count; i += options.every) {
    files.insert(SegmentWriter::NameOf(info.first_index + i));
  }
  if (options.colour) {
    for (int i = 0; i < info.frame_count; i += options.every) {
      files.insert("colour/" + SegmentWriter::NameOf(info.first_index + i));
    }
  }
  TSDFPP_RETURN_IF_ERROR(run_folder.CheckPlaces(files));
  SegmentWriter writer(options, *source, run_folder.path());
  {
    ProgressBar bar("segment");
    for (int i = 0; i < info.frame_count; i += options.every) {
      TSDFPP_RETURN_IF_ERROR(writer.Add(*segmenter, info.first_index + i));
      bar.Show(i + 1, info.frame_count);
    }
  }
  nlohmann::json json{{"run", run_folder.id()},
                      {"sequence", info.name},
                      {"segmentation", options.segmentation.segmentation},
                      {"kernels", KernelsName(UsedKernels())},
                      {"frames", writer.frames()},
                      {"every", options.every},
                      {"ms_a_frame", 1000 * writer.SecondsAFrame()}};
  std::string text =
      fmt::format("{}: segments of {} frames of {}, {:.1f} ms a frame\n", options.out,
                  writer.frames(), info.name, 1000 * writer.SecondsAFrame());
  if (options.score) {
    const SegmentScores scores = writer.Scores();
    json["scores"] = ToJson(scores);
    text += fmt::format(
        "mean IoU {}, PQ {} (background {}, objects {}), IoU over the sequence {}\n",
        ScoreText(scores.mean_iou), ScoreText(scores.quality.pq), ScoreText(scores.background.pq),
        ScoreText(scores.objects.pq), ScoreText(scores.sequence_iou));
  }
  TSDFPP_RETURN_IF_ERROR(WriteFile(run_folder.path() / "segments.json", JsonText(json, 2) + "\n"));
  TSDFPP_RETURN_IF_ERROR(run_folder.Commit());
  if (!writer.shows_any() && options.segmentation.segmentation != "none") {
    spdlog::warn("{}: no frame has a segment beside the background (--segmentation {})", info.name,
                 options.segmentation.segmentation);
  }
  return CommandResult{json, text};
}

}  // namespace

Run AddSegment(CLI::App& app, const CommonOptions&) {
  auto options = std::make_shared<SegmentArguments>();
  AddSequenceArguments(app, "SCENE-or-SEQ", options->source);
  AddSegmentationOptions(
      app, "What finds segments: gt (the sequence's masks), none (all is background),",
      options->segmentation);
  app.add_option("--noise", options->noise,
                 "Of depth: nguyen2012 (Kinect v1, the default) or exact; for depth")
      ->check(OneOf({"nguyen2012", "exact"}));
  app.add_option("--settings", options->settings,
                 "TOML file with settings of depth (docs/segmentation.md)")
      ->check(NotEmpty("a file"));
  app.add_option("--every", options->every, "Every N-th frame only")
      ->check(WholeBetween(1, 1000000))
      ->capture_default_str();
  app.add_flag("--colour", options->colour, "Pictures for people, too, in colour/");
  app.add_flag("--score", options->score, "Compare with the sequence's masks");
  app.add_option("--out", options->out, "Output folder")->check(NotEmpty("a folder"))->required();
  return [options, &app] { return RunSegment(*options, app); };
}

}  // namespace tsdfpp
