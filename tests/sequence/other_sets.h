// Sets in the layouts that we read but do not write, made of any source with OpenCV and streams
// alone.
#pragma once

#include <filesystem>

#include "core/frame_source.h"
#include "sequence/sequence_options.h"

namespace tsdfpp::test {

// results/ (colour as JPEG) and traj.txt, with cam_params.json in `set` or, where `beside`, one
// folder up. 6553.5 units a metre.
void WriteReplica(FrameSource& source, const std::filesystem::path& set, bool beside = false);

// color/ (twice as large as depth), depth/, pose/, intrinsic/, instance-filt/ (as large as color);
// numbers 0, 10, 20... without leading zeros; the pose of the frame at place 2 is infinite.
void WriteScannet(FrameSource& source, const std::filesystem::path& set);

// Whether one of the notes holds these words.
bool NotesSay(const SequenceNotes& notes, const std::string& words);

}  // namespace tsdfpp::test
