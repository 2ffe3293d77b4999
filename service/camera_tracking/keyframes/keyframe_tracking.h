// The tracking half of our camera tracker: one frame against a map that does not change meanwhile.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "calib/model/batch_projector.h"
#include "calib/model/camera_rig.h"
#include "camera_tracking/camera_tracker.h"
#include "camera_tracking/keyframes/keyframe_mapping.h"
#include "camera_tracking/observation_field.h"
#include "camera_tracking/pose_particles.h"
#include "camera_tracking/rectangle_finder.h"
#include "camera_tracking/scene_map.h"
#include "camera_tracking/template_patch.h"

namespace huetrack {

// A pose with its evidence.
struct ProvenPose {
  Rigid3d cam_from_world;
  Eigen::Matrix<double, 6, 6> tangent_covariance = Eigen::Matrix<double, 6, 6>::Identity();
  int sought = 0, found = 0;  // points; found: inliers of the pose
  int corners = 0;            // of the start rectangle, measured and agreeing
  double spread_px = 0;       // of the found ones over the image: the smaller standard deviation
  double scale = 1;           // residuals over what they should be
  bool proven = false;
  std::vector<Sighting> sightings;
  std::vector<int> missed;
};

// thread-compatible.
class KeyframeTracking {
 public:
  KeyframeTracking(const Camera& camera, std::size_t particle_count, std::uint64_t seed);

  // The world's rectangle, when it is what was started from: its edges are measured in every view. Points 0 to 3 of the
  // map.
  void set_rectangle(bool dark) { rectangle_ = dark; }
  void set_pose(const Rigid3d& cam_from_world);  // known from elsewhere: a start
  void forget();                                 // the motion: lost

  // The next frame. The result's `proven` says whether the pose is one; otherwise it is what the particles make of it.
  // lost: there is no pose to start from, so stored key frames are asked. proposed: a pose that somebody else found in
  // this very frame (the start, seen again); it is proven like one from the key frames.
  ProvenPose track(const std::shared_ptr<const Pyramid>& pyramid, const SceneMap& map, bool lost,
                   const std::optional<Rigid3d>& proposed = std::nullopt);

  const PoseParticles& particles() const { return particles_; }
  double effective_sample_size() const { return effective_sample_size_; }
  // What was sought in the last frame, for pictures.
  struct Sought {
    int point;
    Eigen::Vector2d px, found_px;  // raw; found NaN when not
    Eigen::Matrix2d search;
  };
  const std::vector<Sought>& sought() const { return sought_; }

 private:
  struct Visible {
    int point = 0;
    const PointLook* look = nullptr;
    Eigen::Vector2d px;  // raw
    PatchView view;
    int level = 0;            // to be searched at
    double map_sigma_px = 0;  // of the point's own uncertainty, projected
  };
  std::vector<Visible> visible(const Rigid3d& pose, const SceneMap& map, int levels) const;
  Rigid3d coarse(const Rigid3d& predicted, const Pyramid& pyramid, const SceneMap& map);
  ProvenPose fine(const Rigid3d& pose, const Pyramid& pyramid, const SceneMap& map, bool strict);
  Rigid3d first_fit(const Rigid3d& pose, const Pyramid& pyramid, const SceneMap& map, const std::vector<Visible>& seen);

  Camera camera_;
  BatchProjector lens_;
  Rng rng_;
  std::size_t particle_count_;
  std::uint64_t seed_;
  std::uint64_t frames_ = 0;
  std::optional<bool> rectangle_;  // dark

  PoseParticles particles_;
  double effective_sample_size_ = 0;
  Rigid3d pose_;
  Rigid3d step_;        // of the last frame: pose = step * pose before
  double depth_m_ = 1;  // median, of what is in view
  int unproven_ = 0;    // frames since the last proven pose
  std::vector<Sought> sought_;

  // buffers
  std::vector<ObservationField> fields_;
  std::vector<float> u_, v_, log_weight_;
  WarpedPatch patch_;
  std::vector<float> field_;
};

}  // namespace huetrack
