// A scene as some cells of an experiment see it: with a seed, a sensor, faults, fewer objects, and
// which of its frames are used.
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "core/frame_source.h"
#include "eval/sweep/experiment.h"
#include "sim/simulated_source.h"

namespace tsdfpp {

struct SequenceVariant {
  SceneConfig scene;                                    // as rendered
  std::string scene_text;                               // SceneToToml of it
  std::map<std::string, std::filesystem::path> inputs;  // sim/scene/scene_inputs.h
  int fuse_until = 0;                                   // CellSettings::fuse_until
  double object_error = 0;                              // CellSettings::object_error
  Sabotage sabotage = Sabotage::kNone;                  // where IsOfSequence
  double voxel_m = 0;                                   // by which kTruthShifted shifts
  std::vector<int> frames;                              // those used, in order
  std::vector<int> evaluated;                           // of those
  int examined = 0;  // the reveal, where it is among the frames, else the last

  bool IsEvaluated(int frame) const;
  // What determines the frames and the truth that they are scored against, but for the program.
  std::string Key() const;
};

// What is broken of the sequence, if anything is.
void SetSabotage(const CellSettings& settings, SequenceVariant& variant);

// Reads scenes once.
class VariantMaker {
 public:
  // Scene files are relative to `folder`.
  VariantMaker(std::filesystem::path folder, const FrameChoice& choice)
      : folder_(std::move(folder)), choice_(choice) {}

  // Errors: those of LoadSceneConfig; kUsage, naming the setting, where it does not fit the scene:
  // more objects than there are, noise or faults on top of a sensor that has none or its own, a
  // rate above 1, frames that there are not.
  Expected<SequenceVariant> Make(const CellSettings& settings);

 private:
  std::filesystem::path folder_;
  FrameChoice choice_;
  std::map<std::pair<std::string, std::uint64_t>, SceneConfig> scenes_;
};

// What a mapper is given of a frame, and what there was.
struct VariantFrame {
  Frame frame;
  Frame truth;
};

class VariantSource {
 public:
  // Errors: those of SimulatedSource::Open.
  static Expected<VariantSource> Open(const SequenceVariant& variant);

  SimulatedSource& source() { return *source_; }
  const SequenceInfo& info() const { return source_->info(); }
  // A frame depends on its number alone. After `fuse_until` neither side has depth or mask, so that
  // poses alone reach map and truth. Given poses of objects are off by Philox draws for (seed,
  // kObjectErrorStream, frame, object). Errors: those of SimulatedSource::Read.
  Expected<VariantFrame> Read(int index);

 private:
  VariantSource(const SequenceVariant& variant, std::unique_ptr<SimulatedSource> source)
      : variant_(&variant),
        source_(std::move(source)),
        sabotage_(variant.sabotage, variant.frames) {}

  const SequenceVariant* variant_;
  std::unique_ptr<SimulatedSource> source_;
  FrameSabotage sabotage_;
};

// One of the streams of random numbers (sim/sensor/sensor_streams.h has the sensor's).
inline constexpr std::uint32_t kObjectErrorStream = 2000;
inline constexpr double kObjectErrorUnit_m = 1e-3;
inline constexpr double kObjectErrorUnit_deg = 0.1;

}  // namespace tsdfpp
