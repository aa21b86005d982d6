// Renders a scene to a certified sequence on disk, in several processes, and goes on where an
// interrupted run stopped.
#pragma once

#include <atomic>
#include <filesystem>
#include <functional>
#include <string>

#include "core/error.h"
#include "eval/make/certify.h"
#include "sim/config/scene_config.h"
#include "sim/render/gl_context.h"
#include "sim/render/renderer.h"

namespace tsdfpp {

struct GenerateOptions {
  std::filesystem::path out;
  bool overwrite = false;  // an earlier sequence of ours
  int jobs = 1;            // worker processes
  RenderOptions render;
  double ray_share = 0.05;  // of the frames, compared with rays (CertifyOptions)
  // Set by a signal handler to stop. The handler must be installed without SA_RESTART.
  const std::atomic<bool>* stop = nullptr;
  // `phase` is "render" or "verify"; `resumed` of the frames `done` were there before.
  std::function<void(const std::string& phase, int done, int resumed, int total)> progress;
};

struct GenerateResult {
  SequenceInfo info;
  GlInfo gl;
  int resumed_frames = 0;
  int jobs = 0;
  double render_s = 0;  // frames written, wall clock
  double verify_s = 0;
  CertifyResult certificate;
};

// The set (sequence/cofusion_writer.h) with scene.toml and the files that it names (in inputs/, so
// that the set can be rendered again from itself: sim/scene/scene_inputs.h), truth/visibility.csv
// and the certificate in sequence.json. Colour is what the sensor gave; depth, masks and poses are
// true, and what the sensor made of them lies beside them (sequence/cofusion_layout.h). The bytes
// do not depend on `jobs`.
//
// Frames are made in a hidden folder beside `out`, which takes out's place in the end. Whatever
// ends the run, it stays there as soon as it holds a whole frame; the next run of the same scene
// with the same program and renderer keeps the frames whose files have the hashes that were noted,
// and makes the others. A run of anything else removes it, once its renderer has begun. Call it
// while the process has one thread.
//
// Errors: those of SimulatedSource::Open and of writing a set; kEnvironment where it was stopped or
// a worker died; kData where the sequence does not verify, or a file that it is made of was changed
// meanwhile: nothing is left of it.
Expected<GenerateResult> GenerateSequence(const SceneConfig& scene, const std::string& version,
                                          const GenerateOptions& options);

}  // namespace tsdfpp
