// Does a sequence on disk prove itself? Its files against their hashes, its frames against its
// models, poses and each other, and a share of them against rays of MuJoCo.
#pragma once

#include <atomic>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "core/error.h"
#include "eval/make/frame_check.h"
#include "sequence/sequence_json.h"

namespace tsdfpp {

// How far rendered depth may be from the ray's, away from edges and grazing incidence.
inline constexpr double kRayLimit_m = 1e-4;

struct CertifyOptions {
  // Of the frames, those compared with rays: evenly spread, the first and the last among them.
  double ray_share = 0.05;
  // Set to stop early; then what was not looked at is missing in the result.
  const std::atomic<bool>* stop = nullptr;
  std::function<void(int done, int total)> progress;  // called from any thread, one at a time
};

struct CertifyResult {
  std::string sequence;  // its name
  Certificate certificate;
  std::vector<int> ray_frames;
  std::vector<Finding> findings;   // none: the sequence is sound
  std::vector<std::string> notes;  // what could not be checked, and why
  bool sound() const { return findings.empty(); }
};

// Checks, in this order (each finding names the file):
// - files: every file that sequence.json lists is there with its hash, every frame has its images
// and
//   its camera pose, nothing else is there.
// - frames, all of them: eval/make/frame_check.h, and truth/visibility.csv against a new
// measurement.
// - rays, on a share of the frames: depth within kRayLimit_m of mj_ray at the models, and the same
// id,
//   where sim/render/ray_scene.h says that they must agree.
// - scene: scene.toml, composed again, has the models of models/ to the last bit, and sequence.json
//   says what it says (name, frames, rate, reveal, objects, seed, sensor).
// - certificate: one that sequence.json has is of all frames and counts no faults.
// The exact images are checked (depth_original, mask_id, gt-cam-0), not what a sensor made of them.
// The result does not depend on the number of threads.
// Errors: kUsage where there is no such folder; kData where it is not a sequence of ours at all, or
// its sequence.json cannot be read; kEnvironment where MuJoCo fails.
Expected<CertifyResult> Certify(const std::filesystem::path& folder, const CertifyOptions& options);

// The evenly spread numbers of `share` of the frames, two at least where there are two.
std::vector<int> SpreadFrames(int first, int count, double share);

nlohmann::json CertifyJson(const CertifyResult& result);
// A few lines for people: residuals, then one line a finding.
std::string CertifyText(const CertifyResult& result);
// "truth/visibility.csv, frame 3: ..."
std::string FindingText(const Finding& finding);

}  // namespace tsdfpp
