// What is known of the frames of a sequence that is being made, so that an interrupted run can go
// on.
#pragma once

#include <filesystem>
#include <map>
#include <string>

#include "core/error.h"
#include "sequence/cofusion_writer.h"

namespace tsdfpp {

// A frame whose files are on disk.
struct JournalEntry {
  WrittenFrame frame;
  std::string visibility;  // its lines of truth/visibility.csv
  std::string segments;    // its lines of mask_noise/segments.csv, where masks have faults
};

// A folder with one file a frame, which is written after the frame's own files.
class FrameJournal {
 public:
  // Keeps the entries in the folder `notes`, of frames in the folder `set`.
  FrameJournal(std::filesystem::path notes, std::filesystem::path set)
      : notes_(std::move(notes)), set_(std::move(set)) {}

  // Does the journal belong to a run with this key (scene, program, renderer)?
  bool HasKey(const std::string& key) const;
  Expected<void> WriteKey(const std::string& key) const;

  Expected<void> Add(const JournalEntry& entry) const;
  // Errors: kData where the frame has no entry that can be read.
  Expected<JournalEntry> Read(int index) const;
  // How many entries there are, sound or not.
  int Count() const;
  // The entries of the frames whose files are all there with the bytes that were written.
  std::map<int, JournalEntry> ReadSound() const;

 private:
  std::filesystem::path notes_;
  std::filesystem::path set_;
};

}  // namespace tsdfpp
