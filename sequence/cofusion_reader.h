// Reads Co-Fusion sets: our own and those of others.
#pragma once

#include <filesystem>
#include <memory>

#include "core/error.h"
#include "core/frame_source.h"

namespace tsdfpp {

// Opens the set in `folder`. Names, classes, rate, numbers and the reveal plan come from
// sequence.json. Without one: the frames are the images in colour/, from number 0 or 1 on, at 30
// Hz; the objects are those of the trajectories (the class is the name), plus any other id that a
// mask holds, named "object<id>"; there is no reveal plan. Without mask_id/ frames carry no mask.
//
// Where a sequence of ours was made by a sensor with faults, Read() gives what it saw
// (depth_noise/, mask_noise/, sensed-cam-0.txt) and ReadTrue() the truth. Other sets give
// depth_original/ in both.
// Read() gives depth as it is on disk (Frame says which values are invalid) and time_s = (index -
// first_index) / rate; an object without a pose at a frame is absent from T_WO. Its errors: kUsage
// for a frame out of range; kData, naming the file, for an image that is missing, cannot be
// decoded, has another size or type, for depth in millimetres, and for a camera pose that is
// missing.
// Truth() reads models/; error kData where there are none.
//
// Errors: kData, naming the file, what was found and what was expected.
Expected<std::unique_ptr<FrameSource>> OpenCofusion(const std::filesystem::path& folder);

}  // namespace tsdfpp
