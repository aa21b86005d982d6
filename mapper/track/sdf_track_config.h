// Settings of the tracker that registers an object's segment to the object's signed distances.
#pragma once

#include <algorithm>
#include <string>

#include "core/error.h"
#include "core/toml_reader.h"

namespace tsdfpp {

// A camera (CameraSource) is found with these settings, too, but for some that have no effect then,
// or a bound (docs/tracking.md, "The camera").
struct SdfTrackConfig {
  // The segment.
  int mask_erosion_px = 1;  // taken off its outline, where depth is mixed
  // Of depth to a pixel beside, and three axial deviations; more is an edge, which is left out.
  double max_step_voxels = 2;
  int max_points = 5000;  // more are thinned evenly
  int min_points = 30;    // with fewer an object is neither begun nor tracked

  // By what points are weighted, standard deviations: axial + axial_growth (z - 0.4)^2 along the
  // optical axis (metres, z in metres), `lateral_px` across it, as Nguyen, Izadi and Lovell 2012
  // measured for Kinect (0.0012, 0.0019, 0.8), and `model_voxels` of the model's surface. The first
  // three are off because the points that they take weight from, at grazing incidence, are those
  // that hold an object along its length (docs/tracking.md).
  // Weights are relative to that of a point seen head on from 0.4 m. So `axial_m` by itself takes
  // no weight from any: it widens what is an edge or an inlier. `model_voxels` counts only beside
  // `axial_growth` or `lateral_px`.
  double axial_m = 0;
  double axial_growth = 0;  // per metre
  double lateral_px = 0;
  double Axial_m(double z_m) const { return axial_m + axial_growth * (z_m - 0.4) * (z_m - 0.4); }
  double model_voxels = 0.1;

  // Point to signed distance.
  bool curved = true;  // distances without their sag between voxels (SurfaceReader::SagAt)
  // Where the distance changes by more than max_slope metres a metre, and falls by more than
  // max_fall metres a metre along the camera's ray, it is of two surfaces (docs/tracking.md, Steep
  // distances), and a point there has none. A max_slope of 0 switches this off.
  double max_slope = 4;
  double max_fall = 1.5;
  // Where a map's distance changes by more than this many metres a metre, it is of a side that was
  // seen at a grazing angle, and less certain: it counts in proportion less. 0 switches this off.
  double certain_slope = 2;
  double huber_voxels = 1;  // beyond it a residual counts linearly while the pose is coarse ...
  double huber_deviations = 1.5;  // ... and at last, in robust standard deviations
  int coarse_points = 400;        // of the first passes
  int middle_points = 750;        // of those between; the last has all
  int max_iterations = 15;        // of each pass
  double settled_voxels = 0.002;  // settled: an iteration moves no point by more than this

  // Along a direction of which less than this share of the points' information speaks, the object
  // is expected to move on as it did; 0 switches this off. The share is of points that deviate by a
  // tenth of a voxel or more; of better ones it is less, in proportion, down to half (WeakShare()).
  double weak_share = 0.02;

  // A segment is kept, at most keyframe_points of it, and registered along with each later one
  // until the object has turned by so much before the camera, or by kMostViewTurn_rad where the
  // term of colour compares it: what the model adds to both is taken off. 0 switches this off.
  double keyframe_turn_rad = 0.15;
  // A second one is kept for longer, so that fewer take over each other's errors. It corrects along
  // the directions that are known as well as it was (calibration.h). 0, or no first one, switches
  // this off; so does the term of colour, since it may know what distances, by which alone it
  // corrects, do not.
  double anchor_turn_rad = 0.8;
  double AnchorTurn_rad() const {
    return keyframe_turn_rad > 0 && colour_weight <= 0 ? anchor_turn_rad : 0;
  }
  // Until an object moves for the first time nothing was taken over: both are made anew once it is
  // seen from so far another side, so that they are of about the view in which it begins to move.
  // A motion is not noticed at once: they are those of some frames before. 0 switches this off.
  double rest_turn_rad = 0;
  int keyframe_points = 1500;
  int colour_points = 600;  // of a keyframe, at most, for the term of colour

  // Terms of the image (view_terms.h): how much an error of theirs counts beside one of a distance,
  // both in deviations; 0 switches one off. The last two need a keyframe: without one the outline
  // must be switched off as well. The outline has a say along weak shifts alone.
  double free_space_weight = 0;
  double outline_weight = 1;
  double colour_weight = 0;
  static constexpr double kMostViewTurn_rad = 0.15;
  bool ComparesViews() const { return outline_weight > 0 || colour_weight > 0; }
  double KeyframeTurn_rad() const {
    return colour_weight > 0 ? std::min(keyframe_turn_rad, kMostViewTurn_rad) : keyframe_turn_rad;
  }

  // Gates; an object that fails one is frozen for the frame.
  // A point nearer than this to the model's surface is an inlier, and one nearer than three of its
  // axial deviations besides.
  double inlier_voxels = 1;
  double min_inlier_share = 0.6;       // of the points at which the model is observed
  double min_observed_share = 0.3;     // of all points
  double max_translation_voxels = 10;  // of the segment's centre, for each frame since the last
  double max_rotation_rad = 0.35;      // for each frame since the last
  // Of the model's surface that faces the camera and is in the picture: what an object's own pixels
  // must show. Asked where it is not at rest and its place is known worse than the second (the
  // deviation of its segment's centre along the direction that is known least). A share of 0
  // switches this off.
  double min_shown_share = 0.6;
  double max_hidden_deviation_voxels = 0.05;

  // An object that was out of sight and comes back is looked for all around its model
  // (lost_objects.h). After so many frames its model is begun anew where it was not found.
  int return_frames = 15;

  // A motion that moves no point by more than this is none: the pose keeps its numbers, so that a
  // map that resamples what moves does not blur what stands still.
  double rest_voxels = 0.02;
  // An object whose last motion moved no point by more than a tenth of a voxel rests where the
  // points say less than 1 + this / sqrt(their number) times as much against its place as against
  // the one found (ComparePlace()). 0 switches this off.
  double rest_evidence = 3;
  // One that moves rests again where the points say less than half of that against the place that
  // it had so many frames ago, which is at most a voxel away. 0 switches this off.
  int rest_frames = 4;
  // None of both where its places in so many frames and this one go one way, and the slope of a
  // line through them is more than so many times its standard error (trend.h). 0 switches this off.
  double rest_trend = 0;

  // Of TrackChoice::kMoving alone. What waits for motion has moved where so many frames in a row
  // show a point of it this far from where it began, each with this evidence, as above, against its
  // place there, and all in a row with this sum; with fewer points than these, so many times as
  // much.
  double motion_voxels = 1;
  int motion_frames = 3;
  double motion_evidence = 6;
  double motion_evidence_sum = 36;
  int motion_points = 100;

  // Errors: kUsage, naming the field, what was found and what was expected.
  Expected<void> Validate() const;
  // Reads one table strictly; `where` names the file in errors.
  static Expected<SdfTrackConfig> FromToml(const toml::table& table, const std::string& where);
  toml::table ToToml() const;
  bool operator==(const SdfTrackConfig&) const = default;
};

}  // namespace tsdfpp
