// Opens a dataset on disk, whatever its format.
#pragma once

#include <filesystem>
#include <memory>
#include <vector>

#include "core/error.h"
#include "core/frame_source.h"
#include "sequence/sequence_options.h"

namespace tsdfpp {

// The formats that a path looks like, by the names of what lies there; several or none where it is
// not clear.
std::vector<DatasetFormat> DetectFormats(const std::filesystem::path& path);

// What the sequence at `path` is read from besides `path` itself, there or not: it lies beside a
// .klg, with a BOP scene in its dataset, above a scene of Replica.
std::vector<std::filesystem::path> PlacesBeside(const std::filesystem::path& path);

// Opens the sequence at `path`: a folder, or a .klg file. The format is detected unless `options`
// has one; a few frames are read to look for wrong units, inverted poses and the like
// (sequence/plausibility.h) unless `options` leaves that out or the sequence is our own (then
// `tsdfpp verify` looks closer). `notes`, where given, gets what was assumed or left out.
// Errors: kUsage where there is nothing at `path`, where several formats fit, or where an option
// does not fit the format; kData where no format fits or the checks find something; else those of
// the format's reader (sequence/dataset_readers.h, sequence/cofusion_reader.h).
Expected<std::unique_ptr<FrameSource>> OpenSequence(const std::filesystem::path& path,
                                                    const SequenceOptions& options = {},
                                                    SequenceNotes* notes = nullptr);

}  // namespace tsdfpp
