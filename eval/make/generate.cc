#include "eval/make/generate.h"

#include <spdlog/spdlog.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <map>
#include <nlohmann/json.hpp>
#include <opencv2/core/utility.hpp>
#include <vector>

#include "core/files.h"
#include "core/guard.h"
#include "core/json_text.h"
#include "eval/make/frame_journal.h"
#include "eval/run/workers.h"
#include "eval/truth/visibility_truth.h"
#include "sequence/cofusion_layout.h"
#include "sequence/cofusion_writer.h"
#include "sequence/staging_folder.h"
#include "sim/render/shutter.h"
#include "sim/scene/scene_inputs.h"
#include "sim/simulated_source.h"

namespace tsdfpp {
namespace fs = std::filesystem;
namespace {

using Clock = std::chrono::steady_clock;

double SecondsSince(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

constexpr const char* kSegments = "mask_noise/segments.csv";
// Frames that a worker is told ahead, so that it never waits for its orders.
constexpr int kAhead = 2;

std::string SegmentLines(int frame, const std::vector<MaskSegment>& segments) {
  std::string lines;
  for (const MaskSegment& segment : segments) {
    lines +=
        fmt::format("{},{},{},{}\n", frame, segment.id, segment.object, segment.semantic_class);
  }
  return lines;
}

// Splits a sensed frame into the true one (with the sensor's colours) and what differs.
Frame Untangle(const SensorConfig& sensor, SensedFrame sensed, std::optional<SensedImages>& out) {
  const bool shutter = HasShutter(sensor.shutter);
  SensedImages images;
  if (shutter || !(sensor.depth == DepthSensorConfig{})) images.depth = sensed.frame.depth;
  if (shutter || !(sensor.masks == MaskFaultConfig{})) images.mask = sensed.frame.mask;
  if (!(sensor.camera_pose == CameraPoseConfig{})) images.T_WC = sensed.frame.T_WC;
  if (!images.depth.empty() || !images.mask.empty() || images.T_WC) out = std::move(images);
  Frame frame = std::move(sensed.frame);
  frame.depth = sensed.truth.depth;
  frame.mask = sensed.truth.mask;
  frame.T_WC = sensed.truth.T_WC;
  return frame;
}

// A worker process: says hello with what it renders with, then makes the frames that it is told.
Expected<void> MakeFrames(const SceneConfig& scene, const RenderOptions& render,
                          const FrameJournal& journal, const fs::path& folder, Channel& parent) {
  // Several software renderers with several threads each would fight; encoding fills the other
  // cores.
  setenv("LP_NUM_THREADS", "1", 0);
  const tbb::global_control one_thread(tbb::global_control::max_allowed_parallelism, 1);
  cv::setNumThreads(1);
  // The parent composes the scene too and says once what is remarkable about it.
  spdlog::set_level(spdlog::level::err);
  TSDFPP_ASSIGN(const auto source, SimulatedSource::Open(scene, {true, render, {}}));
  const GlInfo& gl = source->gl_info();
  SequenceRecord record;
  record.info = source->info();
  const nlohmann::json hello{{"backend", gl.backend},
                             {"platform", gl.platform},
                             {"renderer", gl.renderer},
                             {"version", gl.version},
                             {"sequence", SequenceToJson(record)}};
  parent.Send(JsonText(hello));
  TSDFPP_ASSIGN(const std::vector<TrueModel> models, source->Truth());
  std::optional<VisibilityTruth> visibility;
  while (const auto order = parent.Receive()) {
    if (!visibility) visibility.emplace(models);
    const int index = std::atoi(order->c_str());
    TSDFPP_ASSIGN(SensedFrame sensed, source->ReadSensed(index));
    JournalEntry entry;
    if (!(scene.sensor.masks == MaskFaultConfig{})) {
      entry.segments = SegmentLines(index, sensed.truth.segments);
    }
    std::optional<SensedImages> images;
    const Frame frame = Untangle(scene.sensor, std::move(sensed), images);
    TSDFPP_ASSIGN(entry.frame, WriteCofusionFrame(source->info(), frame, images, folder));
    TSDFPP_ASSIGN(const auto measured, visibility->Measure(frame));
    for (const ObjectVisibility& object : measured) entry.visibility += VisibilityLine(object);
    TSDFPP_RETURN_IF_ERROR(journal.Add(entry));
    parent.Send(*order);
  }
  return {};
}

class Generator {
 public:
  Generator(const SceneConfig& scene, const std::string& version, const GenerateOptions& options)
      : scene_(scene),
        version_(version),
        options_(options),
        staging_(options.out, StagingFolder::Kind::kShared),
        journal_(staging_.notes(), staging_.path()) {}

  Expected<GenerateResult> Run() {
    TSDFPP_RETURN_IF_ERROR(CheckPlace());
    TSDFPP_RETURN_IF_ERROR(Collect());
    TSDFPP_RETURN_IF_ERROR(staging_.Make());
    auto made = Guarded([this] { return MakeSequence(); });
    const int frames = journal_.Count();
    if (made || frames == 0) return made;
    // Whatever ended the run, whole frames are not lost; those of no use have been removed.
    staging_.Keep();
    made.error().message +=
        begun_ ? fmt::format("; {} of {} frames are kept, from which the same command goes on",
                             frames, scene_.frames)
               : "; the frames that an earlier run made are kept";
    return made;
  }

 private:
  Expected<GenerateResult> MakeSequence() {
    // Another process may have finished it while this one waited.
    TSDFPP_RETURN_IF_ERROR(CheckPlace());
    const auto start = Clock::now();
    TSDFPP_RETURN_IF_ERROR(Render());
    TSDFPP_ASSIGN(SequenceRecord record, Finish());
    result_.render_s = SecondsSince(start);
    TSDFPP_RETURN_IF_ERROR(Verify(record));
    // It took a while, in which somebody may have put something there.
    TSDFPP_RETURN_IF_ERROR(CheckPlace());
    TSDFPP_RETURN_IF_ERROR(staging_.TakeThePlace());
    return result_;
  }

  Expected<void> CheckPlace() const {
    auto place = CheckReplaceable(options_.out, options_.overwrite);
    if (!place && !options_.overwrite && IsOurSequence(options_.out)) {
      place.error().message += ", or --overwrite";
    }
    return place;
  }

  // The scene as it is stored, and what its files hold now.
  Expected<void> Collect() {
    TSDFPP_ASSIGN(SceneInputs inputs, CollectInputs(scene_));
    scene_text_ = SceneToToml(inputs.config);
    input_files_ = std::move(inputs.files);
    for (const auto& [place, file] : input_files_) {
      TSDFPP_ASSIGN(const std::string bytes, ReadFile(file));
      input_hashes_[place] = HashText(bytes);
    }
    return {};
  }

  bool Stopped() const { return options_.stop != nullptr && *options_.stop; }

  Expected<void> StoppedError() const {
    return EnvironmentError("{}: stopped", options_.out.string());
  }

  Expected<void> Render() {
    const int jobs = std::clamp(options_.jobs, 1, scene_.frames);
    result_.jobs = jobs;
    TSDFPP_ASSIGN(Workers workers, Workers::Start(jobs, [this](Channel& parent) {
                    return MakeFrames(scene_, options_.render, journal_, staging_.path(), parent);
                  }));
    int greeted = 0;
    while (true) {
      const auto next = workers.Next();
      // A signal to the whole group ends the workers as well.
      if (Stopped()) return StoppedError();
      if (!next) return tl::unexpected(next.error());
      if (!*next) {
        if (workers.running() == 0) break;
        continue;  // another signal
      }
      const auto& [worker, line] = **next;
      if (line.front() == '{') {
        TSDFPP_RETURN_IF_ERROR(TakeHello(line, greeted == 0));
        if (++greeted < jobs) continue;
        for (int ahead = 0; ahead < kAhead; ++ahead) {
          for (int i = 0; i < jobs; ++i) Order(workers, i);
        }
        continue;
      }
      TSDFPP_RETURN_IF_ERROR(TakeFrame(std::atoi(line.c_str())));
      Order(workers, worker);
    }
    if (static_cast<int>(entries_.size()) != scene_.frames) {
      return EnvironmentError("{}: {} of {} frames were made", options_.out.string(),
                              entries_.size(), scene_.frames);
    }
    return {};
  }

  // The first hello tells what was rendered before and can be kept.
  Expected<void> TakeHello(const std::string& line, bool first) {
    TSDFPP_ASSIGN(const nlohmann::json hello, ParseJsonObject(line, "a worker process"));
    const GlInfo gl{hello.at("backend"), hello.at("platform"), hello.at("renderer"),
                    hello.at("version")};
    if (!first) {
      if (gl.renderer == result_.gl.renderer && gl.version == result_.gl.version) return {};
      return EnvironmentError("the worker processes render with {} and {}, expected one renderer",
                              result_.gl.renderer, gl.renderer);
    }
    result_.gl = gl;
    const fs::path record = staging_.notes() / cofusion::kSequence;
    TSDFPP_RETURN_IF_ERROR(WriteFile(record, hello.at("sequence").get<std::string>()));
    TSDFPP_ASSIGN(const SequenceRecord read, ReadSequenceJson(record));
    result_.info = read.info;
    TSDFPP_RETURN_IF_ERROR(CheckObjectsFit(result_.info.objects));
    std::string key = fmt::format("{}\n{} {} {}\nantialias {}\n{}", version_, gl.backend,
                                  gl.renderer, gl.version, options_.render.antialias, scene_text_);
    for (const auto& [place, hash] : input_hashes_) key += fmt::format("\n{} {}", place, hash);
    if (journal_.HasKey(key)) {
      entries_ = journal_.ReadSound();
    } else {
      TSDFPP_RETURN_IF_ERROR(staging_.Clear());
      TSDFPP_RETURN_IF_ERROR(journal_.WriteKey(key));
    }
    begun_ = true;
    result_.resumed_frames = static_cast<int>(entries_.size());
    const int last = result_.info.first_index + result_.info.frame_count;
    for (int index = last - 1; index >= result_.info.first_index; --index) {
      if (!entries_.contains(index)) missing_.push_back(index);
    }
    Progress("render", result_.resumed_frames, result_.resumed_frames);
    return {};
  }

  // The next frame for a worker, or the end of its work.
  void Order(Workers& workers, int worker) {
    if (missing_.empty()) {
      workers.Close(worker);
      return;
    }
    workers.Send(worker, std::to_string(missing_.back()));
    missing_.pop_back();
  }

  Expected<void> TakeFrame(int index) {
    TSDFPP_ASSIGN(JournalEntry entry, journal_.Read(index));
    entries_.insert_or_assign(index, std::move(entry));
    Progress("render", static_cast<int>(entries_.size()), result_.resumed_frames);
    return {};
  }

  void Progress(const char* phase, int done, int resumed) {
    if (options_.progress) options_.progress(phase, done, resumed, scene_.frames);
  }

  GeneratorInfo Info() const {
    GeneratorInfo generator;
    generator.version = version_;
    generator.seed = scene_.seed;
    generator.sensor = DescribeSensor(scene_.sensor);
    generator.backend = result_.gl.backend;
    generator.renderer = result_.gl.renderer;
    if (!options_.render.antialias) generator.renderer += ", not antialiased";
    return generator;
  }

  Expected<SequenceRecord> Finish() {
    std::vector<WrittenFrame> frames;
    std::string visibility = VisibilityHeader();
    std::string segments;
    for (const auto& [index, entry] : entries_) {
      frames.push_back(entry.frame);
      visibility += entry.visibility;
      segments += entry.segments;
    }
    std::map<std::string, std::string> files{{cofusion::kScene, scene_text_},
                                             {cofusion::kVisibility, std::move(visibility)}};
    if (!(scene_.sensor.masks == MaskFaultConfig{})) {
      files[kSegments] = "frame,id,object,class\n" + segments;
    }
    for (const auto& [place, file] : input_files_) {
      TSDFPP_ASSIGN(files[place], ReadFile(file));
      if (HashText(files[place]) != input_hashes_[place]) {
        TSDFPP_RETURN_IF_ERROR(staging_.Clear());
        return DataError("{}: was changed while the scene was rendered from it", file.string());
      }
    }
    TSDFPP_ASSIGN(const CompiledScene compiled, CompiledScene::Compile(scene_));
    return FinishCofusion(result_.info, Info(), frames, compiled.TrueModels(), files,
                          staging_.path());
  }

  Expected<void> Verify(SequenceRecord& record) {
    const auto start = Clock::now();
    CertifyOptions options;
    options.ray_share = options_.ray_share;
    options.stop = options_.stop;
    options.progress = [&](int done, int) { Progress("verify", done, 0); };
    TSDFPP_ASSIGN(result_.certificate, Certify(staging_.path(), options));
    if (Stopped()) return StoppedError();
    if (!result_.certificate.sound()) {
      const auto& findings = result_.certificate.findings;
      TSDFPP_RETURN_IF_ERROR(staging_.Clear());
      return DataError(
          "{}: the sequence does not verify and is not kept; {} findings, the first: {}",
          options_.out.string(), findings.size(), FindingText(findings.front()));
    }
    record.certificate = result_.certificate.certificate;
    result_.verify_s = SecondsSince(start);
    return WriteFile(staging_.path() / cofusion::kSequence, SequenceToJson(record));
  }

  const SceneConfig& scene_;
  std::string version_;
  const GenerateOptions& options_;
  std::string scene_text_;
  std::map<std::string, fs::path> input_files_;  // by their places in the set
  std::map<std::string, std::string> input_hashes_;
  StagingFolder staging_;
  FrameJournal journal_;
  GenerateResult result_;
  std::map<int, JournalEntry> entries_;
  std::vector<int> missing_;  // the next at the back
  bool begun_ = false;        // what an earlier run left is taken over or removed
};

}  // namespace

Expected<GenerateResult> GenerateSequence(const SceneConfig& scene, const std::string& version,
                                          const GenerateOptions& options) {
  return Generator(scene, version, options).Run();
}

}  // namespace tsdfpp
