#include "eval/sweep/replay.h"

#include <algorithm>
#include <map>
#include <set>
#include <stdexcept>

#include "core/data_folder.h"
#include "core/files.h"
#include "core/folders.h"
#include "core/json_text.h"
#include "core/one_line.h"
#include "core/plain_name.h"
#include "core/ply.h"
#include "eval/picture/map_slice.h"
#include "eval/picture/map_views.h"
#include "eval/run/program_identity.h"
#include "eval/run/run_folder.h"
#include "eval/sweep/cell_run.h"
#include "eval/sweep/sweep_report.h"
#include "sequence/image_files.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

struct Recorded {
  std::string id;
  CellSettings settings;
  SequenceVariant variant;
  std::string program;
  std::map<std::string, std::string> maps;    // digests of the evaluated frames' maps, by frame
  std::map<std::string, std::string> images;  // digests of frames
  std::set<InstanceId> removed;
};

std::vector<int> FramesOf(const json& list) {
  std::vector<int> frames;
  for (const json& frame : list) {
    frames.push_back(FrameFromJson(frame));
    if (frames.size() > 1 && frames.back() <= *std::prev(frames.end(), 2)) {
      throw std::out_of_range("frames are not in order");
    }
  }
  if (frames.empty()) throw std::out_of_range("there is no frame");
  return frames;
}

void ReadSequence(const json& sequence, SequenceVariant& variant) {
  variant.frames = FramesOf(sequence.at("frames"));
  const int first = kFirstFrame;
  const int last = kFirstFrame + variant.scene.frames - 1;
  if (variant.frames.front() < first || variant.frames.back() > last) {
    throw std::out_of_range(fmt::format("frames {} to {} are not all of the scene's {} to {}",
                                        variant.frames.front(), variant.frames.back(), first,
                                        last));
  }
  variant.evaluated = FramesOf(sequence.at("evaluated"));
  variant.examined = FrameFromJson(sequence.at("examined"));
  // Of another frame there would be no map to compare.
  if (!std::includes(variant.frames.begin(), variant.frames.end(), variant.evaluated.begin(),
                     variant.evaluated.end())) {
    throw std::out_of_range("'evaluated' has frames that are not among 'frames'");
  }
  if (!variant.IsEvaluated(variant.examined)) {
    throw std::out_of_range(
        fmt::format("'examined' is {}, which is not among 'evaluated'", variant.examined));
  }
  variant.fuse_until = FrameFromJson(sequence.at("fuse_until"));
  CellSettings probe;
  const json& error = sequence.at("object_error");
  if (!error.is_number()) throw std::out_of_range("'object_error' is no number");
  // The axis knows what it may be.
  if (auto set = FindAxis("object_error")->set(probe, error.get<double>()); !set) {
    throw std::out_of_range(set.error().message);
  }
  variant.object_error = probe.object_error;
}

void ReadCell(const json& cell, Recorded& recorded) {
  for (const json& entry : cell.at("frames")) {
    recorded.maps[std::to_string(FrameFromJson(entry.at("frame")))] =
        entry.at("map_digest").get<std::string>();
  }
  for (const auto& [frame, digest] : cell.at("images").items()) {
    recorded.images[frame] = digest.get<std::string>();
  }
  for (const json& object : cell.at("removed")) {
    recorded.removed.insert(ObjectFromJson(object));
  }
}

Expected<std::string> FindCell(const json& cells, const std::string& wanted,
                               const std::string& where) {
  std::vector<std::string> found;
  for (const auto& [id, cell] : cells.items()) {
    if (!wanted.empty() && id.starts_with(wanted)) found.push_back(id);
  }
  if (found.size() == 1) return found.front();
  if (!found.empty()) {
    return UsageError("{}: {} cells begin with '{}', expected one: {}", where, found.size(), wanted,
                      fmt::join(found, ", "));
  }
  return UsageError("{}: has no cell '{}'; its {} cells are in results.csv", where, wanted,
                    cells.size());
}

Expected<Recorded> Load(const ReplayOptions& options) {
  std::error_code ignored;
  const fs::path file =
      fs::is_directory(options.result, ignored) ? options.result / "results.json" : options.result;
  std::string where = file.string();  // what is read
  const fs::path folder = file.parent_path();
  auto results = ReadJsonObject(file);
  if (!results) return UsageError("{}, expected an experiment's folder", results.error().message);
  try {
    if (results->value("kind", "") != "tsdfpp experiment" ||
        results->value("schema", 0) != kResultsSchema) {
      return DataError("{}: is no experiment's result of schema {}", where, kResultsSchema);
    }
    Recorded recorded;
    TSDFPP_ASSIGN(recorded.id, FindCell(results->at("cells"), options.cell, where));
    TSDFPP_RETURN_IF_ERROR(CheckPlainName(recorded.id, where + ": a cell"));
    const json& cell = results->at("cells").at(recorded.id);
    TSDFPP_ASSIGN(recorded.settings, SettingsFromJson(cell.at("settings")));
    if (const auto map = recorded.settings.Pipeline(); !map) {
      return DataError("{}: a field is missing or wrong (cell {}: {})", where, recorded.id,
                       map.error().message);
    }
    const json& sequence = results->at("sequences").at(cell.at("sequence").get<std::string>());
    TSDFPP_ASSIGN(const fs::path scene,
                  DataFolder(folder).Find(sequence.at("scene").get<std::string>()));
    SequenceVariant& variant = recorded.variant;
    TSDFPP_ASSIGN(variant.scene_text, ReadFile(scene));
    TSDFPP_ASSIGN(variant.scene, ParseSceneConfig(variant.scene_text, scene.string(),
                                                  {scene.parent_path(), SceneOrigin::kData}));
    ReadSequence(sequence, variant);
    SetSabotage(recorded.settings, variant);
    recorded.program = fmt::format("{}, {}", results->at("program").get<std::string>(),
                                   results->at("renderer").get<std::string>());
    where = (folder / "cells" / (recorded.id + ".json")).string();
    TSDFPP_ASSIGN(const json noted, ReadJsonObject(where));
    ReadCell(noted, recorded);
    return recorded;
  } catch (const std::exception& error) {
    return DataError("{}: a field is missing or wrong ({})", where, WithoutTag(error.what()));
  }
}

// What the original run noted of a frame; empty where it noted nothing.
std::string Noted(const std::map<std::string, std::string>& digests, int frame) {
  const auto found = digests.find(std::to_string(frame));
  return found == digests.end() ? std::string() : found->second;
}

Expected<void> CheckSame(const Recorded& recorded, const char* what, int frame,
                         const std::string& now, const std::string& noted,
                         const SimulatedSource& source) {
  if (now == noted) return {};
  const GlInfo& gl = source.gl_info();
  return DataError(
      "cell {}: {} of frame {} are not what they were: made by {}; this is {}, {}, {}, {}",
      recorded.id, what, frame, recorded.program, ProgramIdentity(), gl.backend, gl.renderer,
      gl.version);
}

Expected<void> WriteImage(const cv::Mat& image, const fs::path& path) {
  TSDFPP_ASSIGN(const std::string bytes, EncodePng(image, path.string()));
  return WriteFile(path, bytes);
}

Expected<void> WriteCamera(const Frame& frame, const fs::path& folder) {
  TSDFPP_ASSIGN(const std::string colour, EncodeColour(frame.colour, "colour.png"));
  TSDFPP_RETURN_IF_ERROR(WriteFile(folder / "colour.png", colour));
  TSDFPP_ASSIGN(const std::string depth, EncodeDepth(frame.depth, "depth.exr"));
  TSDFPP_RETURN_IF_ERROR(WriteFile(folder / "depth.exr", depth));
  return WriteImage(frame.mask, folder / "mask.png");
}

// Through the first object that the experiment removes, else through what the image's middle shows.
SliceFrame SliceOf(const VariantFrame& both, const std::set<InstanceId>& movers) {
  SliceFrame slice;
  const Pose& T_WC = both.truth.T_WC;
  const auto first = movers.empty() ? both.truth.T_WO.end() : both.truth.T_WO.find(*movers.begin());
  if (first != both.truth.T_WO.end()) {
    slice.middle_W = first->second.translation();
  } else {
    const cv::Mat& depth = both.truth.depth;
    const float middle_m = depth.at<float>(depth.rows / 2, depth.cols / 2);
    slice.middle_W = T_WC * Eigen::Vector3d(0, 0, IsValidDepth(middle_m) ? middle_m : 1);
  }
  // Across the view, so that near is not hidden by far.
  const Eigen::Vector3d right_W = T_WC.linear().col(0);
  slice.along_W = Eigen::Vector3d(right_W.x(), right_W.y(), 0).normalized();
  return slice;
}

Expected<void> WriteSlice(const MapSlice& slice, const fs::path& out) {
  TSDFPP_ASSIGN(const std::string png, EncodeColour(slice.picture, "slice.png"));
  TSDFPP_RETURN_IF_ERROR(WriteFile(out / "slice.png", png));
  TSDFPP_ASSIGN(const std::string exr, EncodeDepth(slice.distance, "slice-distance.exr"));
  TSDFPP_RETURN_IF_ERROR(WriteFile(out / "slice-distance.exr", exr));
  return WriteImage(slice.id, out / "slice-id.png");
}

// The cell's frames up to the one that is asked for.
Expected<std::vector<int>> FramesUpTo(int frame, const Recorded& recorded) {
  const std::vector<int>& frames = recorded.variant.frames;
  const auto last = std::find(frames.begin(), frames.end(), frame);
  if (last != frames.end()) return std::vector<int>(frames.begin(), last + 1);
  const std::string step =
      frames.size() < 2 ? "" : fmt::format(" of every {}-th", frames[1] - frames[0]);
  return UsageError("cell {}: frame {} is not among the {} that it used, {} to {}{}", recorded.id,
                    frame, frames.size(), frames.front(), frames.back(), step);
}

// The last of the evaluated frames that is mapped again.
std::optional<int> LastEvaluated(const std::vector<int>& evaluated, int frame) {
  const auto later = std::upper_bound(evaluated.begin(), evaluated.end(), frame);
  if (later == evaluated.begin()) return std::nullopt;
  return *std::prev(later);
}

// The frame that is asked for, and the map's visible surfaces then.
struct Remade {
  VariantFrame both;
  TriangleMesh scene;
};

// Maps the frames again and compares what the original run noted: the map at the last evaluated
// frame, and the images of the last one. Counts and digests go into `result`.
Expected<Remade> MapAgain(const Recorded& recorded, const std::vector<int>& frames,
                          VariantSource& source, CellMapper& mapper, const ReplayOptions& options,
                          ReplayResult& result) {
  Remade remade;
  for (const int index : frames) {
    TSDFPP_ASSIGN(remade.both, source.Read(index));
    TSDFPP_RETURN_IF_ERROR(mapper.Process(remade.both));
    ++result.frames;
    if (recorded.variant.IsEvaluated(index)) mapper.SettleIds();
    if (index == result.compared_map_frame || index == options.frame) {
      remade.scene = mapper.Meshes({}).scene;
      result.map_digest = MeshDigest(remade.scene);
    }
    if (index == result.compared_map_frame) {
      TSDFPP_RETURN_IF_ERROR(CheckSame(recorded, "the map's surfaces", index, result.map_digest,
                                       Noted(recorded.maps, index), source.source()));
    }
    if (options.progress) options.progress(result.frames, static_cast<int>(frames.size()));
  }
  result.image_digest = ImageDigest(remade.both.frame);
  TSDFPP_RETURN_IF_ERROR(CheckSame(recorded, "images and poses", options.frame, result.image_digest,
                                   Noted(recorded.images, options.frame), source.source()));
  return remade;
}

// `why_no_slice` is empty where there is one.
Expected<void> WriteNote(const Recorded& recorded, int frame, const ReplayResult& result,
                         const std::string& why_no_slice, const fs::path& file) {
  json note{{"cell", recorded.id},
            {"frame", frame},
            {"settings", SettingsJson(recorded.settings)},
            {"program", ProgramIdentity()},
            {"image_digest", result.image_digest},
            {"map_digest", result.map_digest}};
  if (!why_no_slice.empty()) note["no_slice"] = why_no_slice;
  return WriteFile(file, JsonText(note, 1) + "\n");
}

// The files below a folder, as seen from it, sorted.
Expected<std::vector<std::string>> NamesBelow(const fs::path& folder) {
  TSDFPP_ASSIGN(const std::vector<fs::path> files, ListFilesBelow(folder));
  std::vector<std::string> names;
  names.reserve(files.size());
  for (const fs::path& file : files) names.push_back(file.lexically_relative(folder).string());
  std::sort(names.begin(), names.end());
  return names;
}

}  // namespace

Expected<ReplayResult> Replay(const ReplayOptions& options) {
  TSDFPP_ASSIGN(const Recorded recorded, Load(options));
  TSDFPP_ASSIGN(const std::vector<int> frames, FramesUpTo(options.frame, recorded));
  TSDFPP_ASSIGN(VariantSource source, VariantSource::Open(recorded.variant));
  TSDFPP_ASSIGN(CellMapper mapper, CellMapper::Make(recorded.settings, source.info().objects));
  ReplayResult result{recorded.settings, recorded.id, 0, std::nullopt, {}, {}, {}};
  result.compared_map_frame = LastEvaluated(recorded.variant.evaluated, options.frame);
  TSDFPP_ASSIGN(const Remade remade, MapAgain(recorded, frames, source, mapper, options, result));

  const std::string command =
      fmt::format("tsdfpp replay {} --cell {} --frame {} --out {}", options.result.string(),
                  options.cell, options.frame, options.out.string());
  TSDFPP_ASSIGN(RunFolder run, RunFolder::Begin(options.out, command));
  const fs::path& out = run.path();
  TSDFPP_RETURN_IF_ERROR(WriteCamera(remade.both.frame, out / "camera"));
  TSDFPP_RETURN_IF_ERROR(WritePly(out / "scene.ply", remade.scene));
  std::string why_no_slice;
  if (const MapRepresentation* map = mapper.map()) {
    TSDFPP_RETURN_IF_ERROR(
        WriteViews(*map, remade.both.frame.intrinsics, remade.both.frame.T_WC, 2, out / "views"));
    const auto slice = CutMap(*map, SliceOf(remade.both, recorded.removed));
    if (slice) {
      TSDFPP_RETURN_IF_ERROR(WriteSlice(*slice, out));
    } else {
      why_no_slice = slice.error().message;
    }
  }
  TSDFPP_RETURN_IF_ERROR(
      WriteNote(recorded, options.frame, result, why_no_slice, out / "replay.json"));
  TSDFPP_ASSIGN(result.files, NamesBelow(out));
  TSDFPP_RETURN_IF_ERROR(run.Commit());
  return result;
}

}  // namespace tsdfpp
