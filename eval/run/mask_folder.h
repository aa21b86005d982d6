// Masks that any network wrote to a folder, as instances of the frames (docs/segmentation.md,
// "Masks of others").
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "core/error.h"
#include "mapper/segment/instance_finder.h"

namespace tsdfpp {

// The masks of a folder. Names of PNG (or other) images say which frame they are of:
// - "anything12.png": an image of ids of frame 12 (the last digits), 0 is none, of 8 or 16 bits;
// - "anything12_3.png": instance 3 of frame 12, where it is not 0 (BOP's way);
// - "12/anything.png", in a folder named after the frame: an instance, in order of the names (as
//   Segment Anything leaves them).
// A folder has masks of one kind. Ids need not be the same in the next frame. Images without a
// number at the end of their names are of no frame.
class MaskFolder : public InstanceFinder {
 public:
  // Errors: kData where there are no masks, of several kinds, several images of ids of a frame, an
  // instance of it or its folder twice; where a name ends in a time (a point before its digits).
  static Expected<std::unique_ptr<MaskFolder>> Open(const std::filesystem::path& folder);

  // The instances, each of class "thing"; where instances of a folder overlap the smaller one is
  // surer, so that parts are on top. None where the folder has no mask of the frame. Errors: kData
  // where the frame's number lies before the first or behind the last of the masks', and where an
  // image cannot be read, is of another type or not of the depth image's size, or where the boxes
  // of a frame's masks have more pixels together than an image may have (Limits::image_pixels).
  Expected<std::vector<Instance>> Find(const Frame& frame) override;

 private:
  explicit MaskFolder(std::filesystem::path folder) : folder_(std::move(folder)) {}
  std::filesystem::path folder_;
  bool is_of_ids_ = false;
  std::map<int, std::vector<std::filesystem::path>> files_;  // by frame
};

}  // namespace tsdfpp
