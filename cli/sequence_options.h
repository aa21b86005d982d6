// The options of every subcommand that opens a sequence.
#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/frame_source.h"
#include "eval/run/open_source.h"
#include "sequence/background_masks.h"

namespace tsdfpp {

struct SequenceArguments {
  std::string path;         // a scene (.toml) or a sequence
  std::string dataset;      // --dataset
  std::string calibration;  // --calibration
  double depth_units = 0;   // --depth-units
  bool fixed_camera = false;
  double pose_offset_s = 0;  // --pose-offset
  bool unchecked = false;
  SceneOptions scene;  // --sensor, --seed

  // One of the options on sequences that was given, null where none was.
  const char* Option() const;
};

// Adds the positional argument `name` and the options; returns the argument, which is required.
CLI::Option* AddSequenceArguments(CLI::App& app, const std::string& name,
                                  SequenceArguments& arguments);

// What was typed, for commands that print how to run them again.
std::string TextOf(const SequenceArguments& arguments);

// What the sequence or scene is read from, files and folders as a whole: its path, what lies beside
// it, the calibration, the files that a scene names. A path that is not there is left out: opening
// it says so.
std::vector<std::filesystem::path> PlacesOf(const SequenceArguments& arguments);

// Opens what the arguments name, and logs what the reader assumed. Errors: those of OpenSource; of
// the calibration's file; kUsage where options for sequences meet a scene.
Expected<std::unique_ptr<FrameSource>> OpenArguments(const SequenceArguments& arguments);

// The same for those whose scores ask which object a pixel shows: a sequence without masks is
// background throughout, with a remark (sequence/background_masks.h), which is logged. Errors: also
// kData where a sequence without masks has objects beside the background.
Expected<MaskedSource> OpenForScores(const SequenceArguments& arguments);

}  // namespace tsdfpp
