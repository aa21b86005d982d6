#include "eval/make/file_check.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "core/data_folder.h"
#include "core/folders.h"
#include "core/one_line.h"
#include "core/plain_name.h"
#include "sequence/cofusion_layout.h"
#include "sequence/trajectory_file.h"

namespace tsdfpp {
namespace fs = std::filesystem;
namespace {

Finding FileFinding(const std::string& file, std::string sentence, int frame = -1) {
  return {"files", file, frame, std::move(sentence)};
}

// Is there a listed file that begins so?
bool ListsAny(const SequenceRecord& record, const std::string& prefix) {
  const auto at = record.hashes.lower_bound(prefix);
  return at != record.hashes.end() && at->first.starts_with(prefix);
}

std::string TextOf(const std::optional<RevealPlan>& plan) {
  if (!plan) return "none";
  return fmt::format("frame {} without objects {}", plan->frame, fmt::join(plan->removed, ", "));
}

// "car", of class "toy".
std::string ObjectIn(const std::vector<ObjectInfo>& objects, InstanceId id) {
  const auto object = std::find_if(objects.begin(), objects.end(),
                                   [&](const ObjectInfo& each) { return each.id == id; });
  if (object == objects.end()) return "none";
  return fmt::format("'{}' of class '{}'", object->name, object->semantic_class);
}

}  // namespace

std::vector<Finding> CheckFiles(const fs::path& folder, const SequenceRecord& record) {
  std::vector<Finding> findings;
  const std::vector<std::pair<std::string, std::string>> listed(record.hashes.begin(),
                                                                record.hashes.end());
  std::vector<std::string> wrong(listed.size());
  const DataFolder data(folder);
  tbb::parallel_for(std::size_t{0}, listed.size(), [&](std::size_t i) {
    const auto& [file, hash] = listed[i];
    const auto bytes = data.Read(file);
    if (!bytes) {
      wrong[i] =
          fmt::format("is listed in sequence.json and cannot be read ({})", bytes.error().message);
    } else if (const std::string found = HashText(*bytes); found != hash) {
      wrong[i] =
          fmt::format("its hash is {}, sequence.json says {}: the file was changed", found, hash);
    }
  });
  for (std::size_t i = 0; i < listed.size(); ++i) {
    if (!wrong[i].empty()) findings.push_back(FileFinding(listed[i].first, wrong[i]));
  }
  std::set<std::string> strangers;
  const auto there = ListFilesBelow(folder);
  if (!there) findings.push_back(FileFinding("", there.error().message));
  for (const fs::path& path : there ? *there : std::vector<fs::path>()) {
    const std::string file = path.lexically_relative(folder).string();
    if (file != cofusion::kSequence && !record.hashes.contains(file)) strangers.insert(file);
  }
  for (const std::string& file : strangers) {
    findings.push_back(FileFinding(file, "is not listed in sequence.json"));
  }
  const SequenceInfo& info = record.info;
  // A sensor with faults made an image of every frame, or of none.
  const bool depths = ListsAny(record, std::string(cofusion::kSensedDepth) + "/Depth");
  const bool masks = ListsAny(record, std::string(cofusion::kSensedMask) + "/Mask");
  for (int index = info.first_index; index < info.first_index + info.frame_count; ++index) {
    std::vector<std::string> files{cofusion::ColourFile(index), cofusion::DepthFile(index),
                                   cofusion::MaskFile(index)};
    if (depths) files.push_back(cofusion::SensedDepthFile(index));
    if (masks) files.push_back(cofusion::SensedMaskFile(index));
    for (const std::string& file : files) {
      if (!record.hashes.contains(file)) {
        findings.push_back(
            FileFinding(file, "a frame's image is not listed in sequence.json", index));
      }
    }
  }
  return findings;
}

std::vector<Finding> CheckTrajectories(const fs::path& folder, const SequenceRecord& record) {
  std::vector<Finding> findings;
  const SequenceInfo& info = record.info;
  const int last = info.first_index + info.frame_count - 1;
  const auto check = [&](const std::string& file, bool every_frame) {
    const auto trajectory = ReadTrajectory(folder / file);
    if (!trajectory) {
      findings.push_back(FileFinding(file, trajectory.error().message));
      return;
    }
    for (const auto& [index, pose] : *trajectory) {
      if (index < info.first_index || index > last) {
        findings.push_back(FileFinding(file,
                                       fmt::format("a pose for frame {}, the frames are {} to {}",
                                                   index, info.first_index, last),
                                       index));
      }
    }
    for (int index = info.first_index; every_frame && index <= last; ++index) {
      if (!trajectory->contains(index)) {
        findings.push_back(FileFinding(file, "no pose for this frame", index));
      }
    }
  };
  check(cofusion::kCameraTrajectory, true);
  if (record.hashes.contains(cofusion::kSensedCameraTrajectory)) {
    check(cofusion::kSensedCameraTrajectory, true);
  }
  for (const ObjectInfo& object : info.objects) {
    if (object.id != kBackground) check(cofusion::TrajectoryFile(object), false);
    if (!record.hashes.contains(cofusion::ModelFile(object))) {
      findings.push_back(FileFinding(cofusion::ModelFile(object),
                                     "an object's model is not listed in sequence.json"));
    }
  }
  return findings;
}

std::vector<Finding> CheckRecord(const SequenceRecord& record, const SceneConfig& scene,
                                 const SequenceInfo& of_scene) {
  std::vector<Finding> findings;
  const auto compare = [&](const std::string& field, const std::string& found,
                           const std::string& expected) {
    if (found == expected) return;
    findings.push_back({"scene", cofusion::kSequence, -1,
                        fmt::format("{} is {}, scene.toml says {}", field, found, expected)});
  };
  const SequenceInfo& info = record.info;
  compare("'scene'", info.name, OneLine(of_scene.name, kMostNameBytes));
  compare("'frame_count'", std::to_string(info.frame_count), std::to_string(of_scene.frame_count));
  // Both files have all digits: this is for rounding alone.
  constexpr double kSameRate = 1e-12;
  if (!(std::abs(info.rate_hz - of_scene.rate_hz) <= kSameRate * of_scene.rate_hz)) {
    compare("'rate_hz'", fmt::format("{}", info.rate_hz), fmt::format("{}", of_scene.rate_hz));
  }
  compare("'reveal'", TextOf(info.reveal), TextOf(of_scene.reveal));
  const auto ids = [](const SequenceInfo& of) {
    return of.mask_ids_are_objects ? "objects" : "frame";
  };
  compare("'mask_ids'", ids(info), ids(of_scene));
  const GeneratorInfo& generator = record.generator;
  if (generator.seed) {
    compare("'seed'", std::to_string(*generator.seed), std::to_string(scene.seed));
  }
  compare("'sensor'", generator.sensor, DescribeSensor(scene.sensor));
  std::set<InstanceId> objects;
  for (const ObjectInfo& object : info.objects) objects.insert(object.id);
  for (const ObjectInfo& object : of_scene.objects) objects.insert(object.id);
  for (const InstanceId id : objects) {
    compare(fmt::format("object {}", id), ObjectIn(info.objects, id),
            ObjectIn(of_scene.objects, id));
  }
  return findings;
}

std::vector<Finding> CheckCertificate(const SequenceRecord& record) {
  std::vector<Finding> findings;
  if (!record.certificate) return findings;
  const Certificate& certificate = *record.certificate;
  const auto add = [&](std::string sentence) {
    findings.push_back(
        {"certificate", cofusion::kSequence, -1, "its certificate says " + std::move(sentence)});
  };
  if (certificate.frames != record.info.frame_count) {
    add(fmt::format("{} frames, the sequence has {}", certificate.frames, record.info.frame_count));
  }
  const std::int64_t beyond = certificate.model.violations + certificate.ray_depth.violations;
  if (beyond > 0) add(fmt::format("{} pixels beyond the limits, expected none", beyond));
  if (certificate.wrong_ids > 0) {
    add(fmt::format("{} wrong ids, expected none", certificate.wrong_ids));
  }
  return findings;
}

}  // namespace tsdfpp
