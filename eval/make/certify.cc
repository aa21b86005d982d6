#include "eval/make/certify.h"

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <mutex>
#include <set>
#include <utility>

#include "core/data_folder.h"
#include "core/files.h"
#include "core/folders.h"
#include "core/one_line.h"
#include "eval/make/file_check.h"
#include "eval/truth/visibility_truth.h"
#include "sequence/cofusion_layout.h"
#include "sequence/cofusion_reader.h"
#include "sim/load_scene.h"
#include "sim/render/ray_scene.h"
#include "sim/scene/scene_builder.h"
#include "sim/scene/scene_inputs.h"
#include "sim/simulated_source.h"

namespace tsdfpp {
namespace fs = std::filesystem;
namespace {

// What one frame contributes.
struct FrameResult {
  bool done = false;
  FrameReport report;
  ResidualMeter rays{kRayLimit_m};
  std::int64_t wrong_ids = 0;
};

// The lines of truth/visibility.csv by frame.
Expected<std::map<int, std::string>> ReadVisibility(const fs::path& path) {
  TSDFPP_ASSIGN(const std::string text, ReadFile(path));
  std::map<int, std::string> lines;
  std::size_t at = text.find('\n');
  while (at != std::string::npos && at + 1 < text.size()) {
    const std::size_t end = text.find('\n', at + 1);
    const std::string line = text.substr(at + 1, end == std::string::npos ? end : end - at);
    lines[std::atoi(line.c_str())] += line;
    at = end;
  }
  return lines;
}

void CompareWithRays(const Frame& frame, RayScene& scene, FrameResult& result) {
  const RayImage rays = scene.Cast(frame.intrinsics, frame.T_WC, frame.T_WO);
  std::int64_t far = 0;
  std::int64_t missed = 0;
  double worst = 0;
  for (int v = 0; v < frame.depth.rows; ++v) {
    for (int u = 0; u < frame.depth.cols; ++u) {
      const PixelComparison pixel = ComparePixel(rays, frame.depth, frame.mask, u, v);
      switch (pixel.verdict) {
        case RayVerdict::kExcluded:
          result.rays.Exclude(1);
          break;
        case RayVerdict::kMissed:
          ++missed;
          break;
        case RayVerdict::kWrongId:
          ++result.wrong_ids;
          break;
        case RayVerdict::kCompared:
          result.rays.Add(pixel.depth_error_m);
          far += pixel.depth_error_m > kRayLimit_m ? 1 : 0;
          worst = std::max(worst, pixel.depth_error_m);
          break;
      }
    }
  }
  const auto add = [&](const std::string& file, std::string sentence) {
    result.report.findings.push_back({"rays", file, frame.index, std::move(sentence)});
  };
  if (result.wrong_ids > 0) {
    add(cofusion::MaskFile(frame.index),
        fmt::format("{} pixels show another object than the one that their ray hits",
                    result.wrong_ids));
  }
  if (far + missed > 0) {
    add(cofusion::DepthFile(frame.index),
        fmt::format("{} pixels are up to {:.3g} mm off the rays' depth (limit {:.3g} mm), {} show "
                    "something where the ray hits nothing or the reverse",
                    far, 1e3 * worst, 1e3 * kRayLimit_m, missed));
  }
}

bool SameModel(const TrueModel& a, const TrueModel& b) {
  return a.mesh_O.vertices == b.mesh_O.vertices && a.mesh_O.triangles == b.mesh_O.triangles;
}

// This scene is data, not what its user wrote: its files are those of the sequence.
Expected<void> CheckInside(const SceneConfig& config, const fs::path& folder) {
  TSDFPP_ASSIGN(const SceneInputs inputs, CollectInputs(config));
  const DataFolder data(folder);
  const fs::path root = AbsolutePath(folder).lexically_normal();
  for (const auto& [place, file] : inputs.files) {
    const std::string relative = file.lexically_normal().lexically_relative(root).string();
    TSDFPP_ASSIGN(const fs::path found, data.Find(relative));
  }
  return {};
}

// Composes the scene again and compares what comes out with the models and the record on disk.
void CheckScene(const fs::path& folder, const SequenceRecord& record,
                const std::vector<TrueModel>& models, CertifyResult& result) {
  if (!IsThere(folder / cofusion::kScene)) {
    result.notes.emplace_back("scene.toml is not there: the scene was not composed again");
    return;
  }
  const auto config = LoadSceneConfig(folder / cofusion::kScene, std::nullopt, SceneOrigin::kData);
  const auto inside =
      config ? CheckInside(*config, folder) : Expected<void>(tl::unexpected(config.error()));
  auto scene = inside ? CompiledScene::Compile(*config)
                      : Expected<CompiledScene>(tl::unexpected(inside.error()));
  if (!scene) {
    result.findings.push_back({"scene", cofusion::kScene, -1,
                               "the scene cannot be composed again: " + scene.error().message});
    return;
  }
  const auto of_record = CheckRecord(record, *config, SequenceInfoOf(*config, *scene));
  result.findings.insert(result.findings.end(), of_record.begin(), of_record.end());
  for (const TrueModel& composed : scene->TrueModels()) {
    const auto on_disk = std::find_if(
        models.begin(), models.end(),
        [&](const TrueModel& candidate) { return candidate.info.id == composed.info.id; });
    if (on_disk == models.end() || !SameModel(composed, *on_disk)) {
      result.findings.push_back({"scene", cofusion::ModelFile(composed.info), -1,
                                 "the model is not the one that scene.toml describes"});
    }
  }
}

class Certifier {
 public:
  Certifier(const CertifyOptions& options, FrameSource& source, std::vector<TrueModel> models,
            std::map<int, std::string> visibility, bool has_visibility, RayScene rays)
      : options_(options),
        source_(source),
        visibility_lines_(std::move(visibility)),
        has_visibility_(has_visibility),
        visibility_(VisibilityTruth(models)),
        rays_(std::move(rays)),
        frame_check_(std::move(models)) {}

  std::vector<FrameResult> CheckFrames(const std::set<int>& ray_frames) {
    const SequenceInfo& info = source_.info();
    std::vector<FrameResult> results(static_cast<std::size_t>(info.frame_count));
    tbb::parallel_for(
        tbb::blocked_range<int>(0, info.frame_count, 1),
        [&](const tbb::blocked_range<int>& range) {
          // Otherwise a thread that waits inside could begin another frame with the same state.
          tbb::this_task_arena::isolate([&] {
            for (int i = range.begin(); i != range.end(); ++i) {
              if (options_.stop != nullptr && *options_.stop) return;
              const int index = info.first_index + i;
              results[static_cast<std::size_t>(i)] = CheckFrame(index, ray_frames.contains(index));
              Progress(info.frame_count);
            }
          });
        },
        tbb::simple_partitioner());
    return results;
  }

 private:
  FrameResult CheckFrame(int index, bool with_rays) {
    FrameResult result;
    const auto frame = source_.ReadTrue(index);
    if (!frame) {
      result.report.findings.push_back({"files", "", index, frame.error().message});
      return result;
    }
    if (frame->mask.empty()) {
      result.report.findings.push_back(
          {"mask", cofusion::MaskFile(index), index, "the frame has no mask"});
      return result;
    }
    result.report = frame_check_.Check(*frame);
    CheckVisibility(*frame, result);
    if (with_rays) CompareWithRays(*frame, rays_.local(), result);
    result.done = true;
    return result;
  }

  void CheckVisibility(const Frame& frame, FrameResult& result) {
    if (!has_visibility_) return;
    std::string measured;
    const auto entries = visibility_.local().Measure(frame);
    if (!entries) return;  // images that do not fit were found before
    for (const ObjectVisibility& entry : *entries) measured += VisibilityLine(entry);
    const auto stored = visibility_lines_.find(frame.index);
    if (stored != visibility_lines_.end() && stored->second == measured) return;
    std::size_t line = 0;
    const std::string text = stored == visibility_lines_.end() ? "" : stored->second;
    for (std::size_t i = 0; i < std::min(text.size(), measured.size()) && text[i] == measured[i];
         ++i) {
      if (text[i] == '\n') line = i + 1;
    }
    const auto line_of = [&](const std::string& lines) {
      return lines.substr(line, lines.find('\n', line) - line);
    };
    result.report.findings.push_back(
        {"visibility", cofusion::kVisibility, frame.index,
         fmt::format("found '{}', measured '{}'", line < text.size() ? line_of(text) : "",
                     line < measured.size() ? line_of(measured) : "")});
  }

  void Progress(int total) {
    const std::lock_guard lock(mutex_);
    ++done_;
    if (options_.progress) options_.progress(done_, total);
  }

  const CertifyOptions& options_;
  FrameSource& source_;
  std::map<int, std::string> visibility_lines_;
  bool has_visibility_;
  tbb::enumerable_thread_specific<VisibilityTruth> visibility_;
  tbb::enumerable_thread_specific<RayScene> rays_;
  FrameCheck frame_check_;
  std::mutex mutex_;
  int done_ = 0;
};

std::string ResidualText(const char* name, const Residual& r) {
  return fmt::format(
      "  {:<24} mean {:.4f} mm, p99 {:.4f} mm, max {:.4f} mm (limit {:.4g} mm); {} pixels, {} "
      "left out, {} beyond\n",
      name, 1e3 * r.mean_m, 1e3 * r.p99_m, 1e3 * r.max_m, 1e3 * r.limit_m, r.checked, r.excluded,
      r.violations);
}

nlohmann::json ResidualJson(const Residual& r) {
  return {{"mean_m", r.mean_m},        {"p99_m", r.p99_m},     {"max_m", r.max_m},
          {"limit_m", r.limit_m},      {"checked", r.checked}, {"excluded", r.excluded},
          {"violations", r.violations}};
}

}  // namespace

std::vector<int> SpreadFrames(int first, int count, double share) {
  const int wanted =
      std::clamp(static_cast<int>(std::ceil(share * count)), std::min(2, count), count);
  std::vector<int> frames;
  for (int i = 0; i < wanted; ++i) {
    const double at = wanted > 1 ? static_cast<double>(i) * (count - 1) / (wanted - 1) : 0;
    frames.push_back(first + static_cast<int>(std::lround(at)));
  }
  return frames;
}

namespace {

// What a sequence of ours says of itself. Errors: kUsage and kData, it is none.
Expected<SequenceRecord> ReadRecord(const fs::path& folder) {
  std::error_code code;
  if (!fs::is_directory(folder, code)) {
    if (!fs::exists(folder, code)) {
      return UsageError("{}: no such folder, expected a sequence", folder.string());
    }
    return UsageError("{}: is a {}, expected the folder of a sequence that tsdfpp generate made",
                      folder.string(), folder.extension() == ".toml" ? "scene" : "file");
  }
  if (!fs::exists(folder / cofusion::kSequence, code)) {
    return DataError("{}: holds no {}, expected a sequence that tsdfpp generate made",
                     folder.string(), cofusion::kSequence);
  }
  TSDFPP_RETURN_IF_ERROR(CheckLinksBelow(folder));
  TSDFPP_ASSIGN(SequenceRecord record, ReadSequenceJson(folder / cofusion::kSequence));
  // Each frame has three images; where far more are claimed there is nothing to look at one by one.
  if (static_cast<std::size_t>(record.info.frame_count) > record.hashes.size()) {
    return DataError("{}: frame_count is {}, but only {} files are listed",
                     (folder / cofusion::kSequence).string(), record.info.frame_count,
                     record.hashes.size());
  }
  return record;
}

// Adds up what was found of the frames, in their order.
void Gather(const std::vector<FrameResult>& frames, CertifyResult& result) {
  ResidualMeter model(kModelLimit_m);
  ResidualMeter ray_depth(kRayLimit_m);
  for (const FrameResult& frame : frames) {
    model.Merge(frame.report.model);
    ray_depth.Merge(frame.rays);
    result.certificate.wrong_ids += frame.wrong_ids;
    result.certificate.frames += frame.done ? 1 : 0;
    result.findings.insert(result.findings.end(), frame.report.findings.begin(),
                           frame.report.findings.end());
  }
  result.certificate.ray_frames = static_cast<int>(result.ray_frames.size());
  result.certificate.model = model.Result();
  result.certificate.ray_depth = ray_depth.Result();
}

}  // namespace

Expected<CertifyResult> Certify(const fs::path& folder, const CertifyOptions& options) {
  TSDFPP_ASSIGN(const SequenceRecord record, ReadRecord(folder));
  CertifyResult result;
  result.sequence = record.info.name;
  result.findings = CheckFiles(folder, record);
  const auto paths = CheckTrajectories(folder, record);
  result.findings.insert(result.findings.end(), paths.begin(), paths.end());
  const auto faults = CheckCertificate(record);
  result.findings.insert(result.findings.end(), faults.begin(), faults.end());
  const auto give_up = [&](const Error& error) {
    result.findings.push_back({"files", "", -1, error.message});
    return result;
  };
  auto source = OpenCofusion(folder);
  if (!source) return give_up(source.error());
  auto models = (*source)->Truth();
  if (!models) return give_up(models.error());
  TSDFPP_ASSIGN(RayScene rays, RayScene::Compose(*models));
  const bool has_visibility = record.hashes.contains(cofusion::kVisibility);
  std::map<int, std::string> lines;
  if (has_visibility) {
    if (auto read = ReadVisibility(folder / cofusion::kVisibility)) lines = std::move(*read);
  } else {
    result.notes.push_back(
        fmt::format("{} is not there: visibility was not checked", cofusion::kVisibility));
  }
  const SequenceInfo& info = record.info;
  result.ray_frames = SpreadFrames(info.first_index, info.frame_count, options.ray_share);
  CheckScene(folder, record, *models, result);
  Certifier certifier(options, **source, std::move(*models), std::move(lines), has_visibility,
                      std::move(rays));
  Gather(certifier.CheckFrames({result.ray_frames.begin(), result.ray_frames.end()}), result);
  return result;
}

std::string FindingText(const Finding& finding) {
  std::string where = finding.subject;
  if (finding.frame >= 0)
    where += fmt::format("{}frame {}", where.empty() ? "" : ", ", finding.frame);
  // Names of files on disk may hold anything.
  return OneLine(where.empty() ? finding.sentence : where + ": " + finding.sentence);
}

std::string CertifyText(const CertifyResult& result) {
  const Certificate& c = result.certificate;
  std::string text = fmt::format("{}: {} frames checked, {} of them against rays\n",
                                 result.sequence, c.frames, c.ray_frames);
  text += ResidualText("points to their models", c.model);
  text += ResidualText("depth to rays", c.ray_depth);
  text += fmt::format("  {} pixels with another id than their ray's\n", c.wrong_ids);
  for (const std::string& note : result.notes) text += "  note: " + note + "\n";
  for (const Finding& finding : result.findings) {
    text += fmt::format("  {}: {}\n", finding.check, FindingText(finding));
  }
  text +=
      result.sound() ? "sound\n" : fmt::format("NOT SOUND: {} findings\n", result.findings.size());
  return text;
}

nlohmann::json CertifyJson(const CertifyResult& result) {
  const Certificate& c = result.certificate;
  nlohmann::json findings = nlohmann::json::array();
  for (const Finding& f : result.findings) {
    findings.push_back({{"check", f.check},
                        {"file", f.subject},
                        {"frame", f.frame >= 0 ? nlohmann::json(f.frame) : nlohmann::json(nullptr)},
                        {"sentence", f.sentence}});
  }
  return {{"sequence", result.sequence},
          {"sound", result.sound()},
          {"frames", c.frames},
          {"ray_frames", result.ray_frames},
          {"model", ResidualJson(c.model)},
          {"ray_depth", ResidualJson(c.ray_depth)},
          {"wrong_ids", c.wrong_ids},
          {"findings", findings},
          {"notes", result.notes}};
}

}  // namespace tsdfpp
