// The part of a surface that a set of frames saw, which is what maps of the same frames are
// compared on.
#pragma once

#include <string>
#include <vector>

#include "core/frame_source.h"
#include "metrics/surface_samples.h"

namespace tsdfpp {

// Frames of a scene or sequence, read once.
struct FrameSet {
  SequenceInfo info;
  std::vector<Frame> frames;
  std::vector<TrueModel> models;
};

// Frames `first`, `first + step`, ... up to `last` at most (the sequence's last where `last` is 0)
// of scenes/<scene>.toml. Errors: those of OpenSource and of the source.
Expected<FrameSet> ReadFrames(const std::string& scene, int step, int last = 0);

// Samples of `mesh_W`, one a square centimetre, that three frames at least saw from the front and
// under 75 deg, their depth within `margin_m` of the sample's, whatever the masks say.
SampleSet SeenSamples(const TriangleMesh& mesh_W, const std::vector<Frame>& frames,
                      double margin_m);

// Mean of the values of the points in the box.
double MeanIn(const Eigen::AlignedBox3f& box_W, const std::vector<Eigen::Vector3f>& points_W,
              const std::vector<float>& values);

}  // namespace tsdfpp
