// Sequences of every format, as a set of files.
#include <algorithm>
#include <cmath>
#include <optional>

#include "sequence/open_sequence.h"
#include "sequence/sequence_json.h"
#include "tests/fuzz/complaint.h"
#include "tests/fuzz/file_set.h"
#include "tests/fuzz/target.h"

namespace tsdfpp::fuzz {
namespace {

namespace fs = std::filesystem;

constexpr int kMostFramesRead = 3;

bool IsRigid(const Pose& pose) {
  constexpr double kTolerance = 1e-2;
  const Eigen::Matrix3d off =
      pose.linear().transpose() * pose.linear() - Eigen::Matrix3d::Identity();
  return pose.translation().allFinite() && off.allFinite() &&
         off.cwiseAbs().maxCoeff() < kTolerance;
}

// What users of a sequence rely on.
void CheckInfo(const SequenceInfo& info) {
  const Intrinsics& camera = info.intrinsics;
  Require(camera.width >= 1 && camera.height >= 1, "a camera without pixels");
  Require(camera.fx > 0 && camera.fy > 0 && std::isfinite(camera.fx) && std::isfinite(camera.fy) &&
              std::isfinite(camera.cx) && std::isfinite(camera.cy),
          "a camera that cannot be");
  Require(info.frame_count >= 1 && info.first_index >= 0, "a sequence without frames");
  Require(info.rate_hz > 0 && std::isfinite(info.rate_hz), "a rate that cannot be");
  for (const ObjectInfo& object : info.objects) {
    Require(object.name.find('/') == std::string::npos && !object.name.empty(),
            "a name that is no file's");
  }
}

void CheckFrame(const Frame& frame, const SequenceInfo& info) {
  const cv::Size size(info.intrinsics.width, info.intrinsics.height);
  Require(frame.depth.size() == size && frame.depth.type() == CV_32FC1, "depth of another form");
  Require(frame.colour.size() == size && frame.colour.type() == CV_8UC3, "colour of another form");
  Require(frame.mask.empty() || (frame.mask.size() == size && frame.mask.type() == CV_16UC1),
          "a mask of another form");
  Require(IsRigid(frame.T_WC), "a camera pose that is not rigid");
  for (const auto& [id, T_WO] : frame.T_WO) Require(IsRigid(T_WO), "a pose that is not rigid");
}

// "@options" is no file: its bytes choose what a user can choose.
SequenceOptions OptionsOf(std::string_view input, DatasetFormat format) {
  SequenceOptions options;
  options.format = format;
  for (const Entry& entry : UnpackSet(input)) {
    if (entry.path != "@options" || entry.bytes.empty()) continue;
    const char first = entry.bytes.front();
    if (first == 'd') options.format.reset();  // detected
    options.fixed_camera = first == 'f';
    options.check = first != 'u';  // unchecked
    if (first == 'i') options.intrinsics = Intrinsics{0, 0, 12, -12, 6, 5};
    if (first == 'm') options.depth_units_per_m = 10'000;
  }
  return options;
}

// Opens `path` below the set's folder, where that is there, else the folder.
bool ReadSequence(std::string_view input, DatasetFormat format, const char* below = "") {
  const fs::path& folder = WriteSet(input);
  std::error_code code;
  const bool has_below = *below != '\0' && fs::is_directory(folder / below, code);
  SequenceNotes notes;
  const auto source =
      OpenSequence(has_below ? folder / below : folder, OptionsOf(input, format), &notes);
  for (const std::string& note : notes) Require(!note.empty(), "an empty note");
  if (!Accepted(source)) return false;
  const SequenceInfo info = (*source)->info();
  CheckInfo(info);
  bool all = true;
  const int count = std::min(info.frame_count, kMostFramesRead);
  for (int i = info.first_index; i < info.first_index + count; ++i) {
    for (const bool as_true : {false, true}) {
      const auto frame = as_true ? (*source)->ReadTrue(i) : (*source)->Read(i);
      all &= Accepted(frame);
      if (frame) CheckFrame(*frame, info);
    }
  }
  all &= !Accepted((*source)->Read(info.first_index + info.frame_count));
  const auto truth = (*source)->Truth();
  if (Accepted(truth)) Require(!truth->empty(), "a truth without surfaces");
  return all;
}

template <DatasetFormat kFormat>
bool ReadSet(std::string_view input) {
  return ReadSequence(input, kFormat);
}

bool ReadReplica(std::string_view input) {
  return ReadSequence(input, DatasetFormat::kReplica, "room0");
}

bool ReadJsonOfSequence(std::string_view input) {
  const fs::path path = WriteOne("sequence.json", input);
  const auto record = ReadSequenceJson(path);
  if (!Accepted(record, path.string())) return false;
  CheckInfo(record->info);
  // What is written is read, and is then the same.
  const std::string text = SequenceToJson(*record);
  const auto again = ReadSequenceJson(WriteOne("sequence.json", text));
  Require(again.has_value(), again ? "" : "what was written is refused: " + again.error().message);
  Require(SequenceToJson(*again) == text, "what was written is read as something else");
  return true;
}

}  // namespace

void AddSequenceTargets(std::vector<Target>& targets) {
  targets.push_back({"cofusion",
                     "",
                     ReadSet<DatasetFormat::kCofusion>,
                     {"sequence/cofusion_reader.cc", "sequence/cofusion_layout.cc",
                      "sequence/calibration.cc", "sequence/trajectory_file.cc"}});
  targets.push_back({"tum",
                     "",
                     ReadSet<DatasetFormat::kTum>,
                     {"sequence/tum_reader.cc", "sequence/timed_poses.cc",
                      "sequence/file_source.cc", "sequence/text_lines.cc"}});
  targets.push_back(
      {"bop",
       "",
       ReadSet<DatasetFormat::kBop>,
       {"sequence/bop_reader.cc", "sequence/bop_instances.cc", "sequence/pose_matrix.cc"}});
  targets.push_back({"klg",
                     "",
                     ReadSet<DatasetFormat::kKlg>,
                     {"sequence/klg_reader.cc", "sequence/klg_layout.cc"}});
  targets.push_back({"scannet",
                     "",
                     ReadSet<DatasetFormat::kScannet>,
                     {"sequence/scannet_reader.cc", "sequence/resample.cc"}});
  targets.push_back({"replica", "", ReadReplica, {"sequence/replica_reader.cc"}});
  targets.push_back({"sevenscenes",
                     "",
                     ReadSet<DatasetFormat::kSevenScenes>,
                     {"sequence/sevenscenes_reader.cc"}});
  targets.push_back({"sequence_json",
                     "sequence.json",
                     ReadJsonOfSequence,
                     {"sequence/sequence_json.cc", "core/plain_name.cc"}});
}

}  // namespace tsdfpp::fuzz
