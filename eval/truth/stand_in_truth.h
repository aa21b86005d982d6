// The paper's experiment on a dataset that has neither true surfaces nor a plan.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "core/frame_source.h"
#include "eval/truth/scene_truth.h"

namespace tsdfpp {

// The paper reveals what is under the cars of ToyCar3 after this frame (section IV).
inline constexpr int kPaperReveal = 256;

// At kPaperReveal, or at the last frame of a shorter sequence; removed are the objects with a
// trajectory (those of a class, as OpenCofusion gives them).
RevealPlan PaperPlan(const SequenceInfo& info);

// Is this a Co-Fusion set of somebody else's, without true surfaces?
bool IsForeignCofusion(const std::filesystem::path& path);

// The densest reconstruction of the source's own frames, to stand in for true surfaces: all frames
// and no other weights than their number, the background by itself, and each object by itself in
// its own frame, at the given poses. Frames in which an object with a trajectory has no pose are
// left out for it; an object that never has one is taken to be at rest. Surfaces are open, and in
// regions of their objects' names. Errors: those of the source; kData where a frame has no mask or
// nothing can be reconstructed.
Expected<std::vector<TrueModel>> ReconstructTruth(
    FrameSource& source, double voxel_m,
    const std::function<void(int done, int total)>& progress = {});

// How such surfaces are to be used: samples all over the background, a margin of a voxel between
// them and depth, nothing is inside them.
TruthOptions StandInOptions(double voxel_m);

// What has to be said wherever they were used.
std::string StandInNote(const SequenceInfo& info, double voxel_m);

// A source with another plan, and, where there are any, with these models for its truth.
std::unique_ptr<FrameSource> WithPlan(std::unique_ptr<FrameSource> source, const RevealPlan& plan,
                                      std::vector<TrueModel> models = {});

}  // namespace tsdfpp
