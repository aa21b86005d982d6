// Which object of the map each segment is (paper III-C): the second verb of the pipeline.
#pragma once

#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"
#include "core/types.h"
#include "mapper/map_representation.h"
#include "mapper/segment/segmenter.h"

namespace tsdfpp {

struct AssociatedObjects {
  // The object of each pixel: CV_16UC1 of the size of the segments; ids that the map does not have
  // are of objects that the frame brings into it. May share its pixels with the segments.
  cv::Mat labels;
  // The semantic class of those objects for which a segment of the frame brought one.
  std::map<InstanceId, std::string> classes{};
  // The pixels, with valid depth, of each segment that is none of the map's objects.
  std::vector<std::vector<int>> unclaimed{};
  // Of each of those: whether an object may begin with it, and whether it is more than a piece of
  // what is seen (Segments::unknown).
  std::vector<bool> may_begin{};
  std::vector<bool> is_known{};
};

class Associator {
 public:
  virtual ~Associator() = default;

  // `segments` is what the segmenter made of the frame, and has the frame's form
  // (mapper/map_reach.h). Frames come in order.
  virtual AssociatedObjects Associate(const Frame& frame, const Segments& segments,
                                      const MapRepresentation& map) = 0;

  // Whether a segment, the pixels of it with valid depth, may be of an object that is missing, or
  // of one of the map's that the frame does not show, `unseen`.
  using MayBeMissing =
      std::function<bool(const std::vector<int>& pixels, const std::vector<InstanceId>& unseen)>;
  // Called before Associate(), of that frame: a segment that may be one of those is not to be a new
  // object at once. Nothing after it.
  virtual void ExpectReturns(const MayBeMissing& /*may_be*/) {}

  // Called after Associate(), of that frame: others found an object of the map in it.
  virtual void Found(InstanceId /*id*/) {}

  // Called where the frame associated last was mapped; one that was refused leaves no trace.
  virtual void Accept() {}

  // What whoever asked for the map should know, a sentence each.
  virtual std::vector<std::string> Remarks() const { return {}; }
};

enum class AssociationMode {
  kGiven,  // the segments' ids are those of objects already
  kVotes,  // the segments' ids are of one frame alone
};

// "given" or "votes". Errors: kUsage.
Expected<AssociationMode> AssociationModeFromName(std::string_view name);
std::string_view AssociationModeName(AssociationMode mode);

}  // namespace tsdfpp
