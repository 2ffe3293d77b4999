// The tracking half of our camera tracker: the pose of one frame from a fixed map.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "calib/model/batch_projector.h"
#include "calib/model/camera_rig.h"
#include "camera_tracking/camera_tracker.h"
#include "camera_tracking/keyframes/camera_motion.h"
#include "camera_tracking/keyframes/keyframe_mapping.h"
#include "camera_tracking/keyframes/pose_proof.h"
#include "camera_tracking/keyframes/swept_fit.h"
#include "camera_tracking/observation_field.h"
#include "camera_tracking/pose_particles.h"
#include "camera_tracking/pose_solver.h"
#include "camera_tracking/rectangle_finder.h"
#include "camera_tracking/scene_map.h"
#include "camera_tracking/template_patch.h"

namespace huetrack::keyframes {

// A pose with the evidence for it.
struct ProvenPose {
  SweptPose pose;
  Eigen::Matrix<double, 6, 6> tangent_covariance = Eigen::Matrix<double, 6, 6>::Identity();
  PoseEvidence evidence;
  bool proven = false;
  std::vector<PointSighting> sightings;  // keyframe is not set
  std::vector<int> missed;               // points that were not found
  std::optional<Readout> readout;        // measured by this frame alone
};

// thread-compatible.
class KeyframeTracking {
 public:
  KeyframeTracking(const calib::Camera& camera, std::size_t particle_count, std::uint64_t seed);

  // The start was a rectangle, points 0 to 3 of the map: its edges are measured in every frame.
  void set_rectangle(bool dark) { rectangle_ = dark; }
  void set_pose(capture::Timestamp at, const calib::Rigid3d& cam_from_world);  // of a start
  void forget();                                                               // the motion of a lost camera
  // The motion of the start frame at `at`, which had no predecessor, from the pose of the frame after it; and its pose
  // refitted with that motion, nullopt while the readout is unknown.
  MotionPrior motion_from_next(capture::Timestamp at, capture::Timestamp last_at) const {
    return CameraMotion::prior_from_next(at, last_at, pose_, readout());
  }
  std::optional<SweptFit> refit_with_motion(const MotionPrior& prior, capture::Timestamp at, const calib::Rigid3d& pose,
                                            std::span<const PoseObservation> seen, capture::Timestamp last_at);

  // The next frame. The result is only a pose if `proven`.
  //   lost      no previous pose: relocalises in the key frames
  //   proposed  a hypothesis from elsewhere (the start was detected again), verified like a relocalisation
  ProvenPose track(capture::Timestamp at, const std::shared_ptr<const Pyramid>& pyramid, const SceneMap& map, bool lost,
                   const std::optional<calib::Rigid3d>& proposed = std::nullopt);

  const PoseParticles& particles() const { return particles_; }
  double effective_sample_size() const { return effective_sample_size_; }
  Readout readout() const { return readout_.readout(); }
  const MotionPrior& prior() const { return prior_; }  // of the last frame's fit
  // The searches of the last frame, for drawing.
  struct Sought {
    int point;
    Eigen::Vector2d px, found_px;  // raw; found_px: NaN if not found
    Eigen::Matrix2d search;
  };
  const std::vector<Sought>& sought() const { return sought_; }

 private:
  // ---- keyframe_tracking.cpp: the points that are visible from a pose.
  struct Visible {
    int point = 0;  // -1: a seed
    const PointView* view = nullptr;
    Eigen::Vector2d px;        // raw
    Eigen::Vector2f swept_px;  // px less the projection by the middle row's pose
    PatchTransfer patch;
    int level = 0;            // of the search
    double map_sigma_px = 0;  // the point's own uncertainty, projected
    // Of a seed: estimated position, and the projections of an inflated and of the estimated sigma of its depth.
    Eigen::Vector3d position = Eigen::Vector3d::Zero();
    Eigen::Vector2d line_sigma_px = Eigen::Vector2d::Zero(), reach_px = Eigen::Vector2d::Zero();
  };
  std::vector<Visible> visible(const SweptPose& pose, const SceneMap& map, int levels) const;
  // shift_sigma_m: of the camera's position, per axis.
  std::vector<Visible> visible_seeds(const SweptPose& pose, double shift_sigma_m, const SceneMap& map,
                                     int levels) const;
  std::optional<PatchTransfer> patch_of(const SweptPose& pose, const SweptPixel& now, const PointView& view,
                                        const Eigen::Vector3d& position, const Eigen::Vector3d& normal,
                                        const SceneMap& map) const;
  static const PointView* most_similar_view(const MapPoint& point, const Eigen::Vector3d& centre, const SceneMap& map);
  static void subsample(std::vector<Visible>& seen, std::size_t most);
  // Into patch_; false: too distorted to match.
  bool warp(const Visible& seen, const SceneMap& map, int level);

  // ---- keyframe_coarse.cpp: annealed particles on a small copy of the image, as Pupilli and Calway, with 40 points.
  struct Walk {
    float rotation_rad, position_m;  // standard deviations per axis
  };
  SweptPose coarse(const SweptPose& predicted, const Pyramid& pyramid, const SceneMap& map);
  Walk scatter(const calib::Rigid3d& predicted);
  std::vector<Visible> one_per_cell(const std::vector<Visible>& seen, const SceneMap& map) const;
  void correlate(std::vector<Visible>& chosen, const Pyramid& pyramid, int level, const SceneMap& map);
  void project(const Visible& seen, const SceneMap& map, int level);
  void anneal(const std::vector<Visible>& chosen, int level, const SceneMap& map, const Walk& walk);
  SweptPose fit_to_fields(SweptPose pose, const std::vector<Visible>& chosen, int level, const SceneMap& map) const;

  // ---- keyframe_fine.cpp: sub-pixel matches of all points, the fit, and the verdict.
  struct Matches {  // of one frame, corners of the start rectangle included
    int sought = 0;
    std::vector<PoseObservation> observations;
    std::vector<int> point;           // of each observation
    std::vector<double> pixel_sigma;  // of each observation: without the point's own uncertainty
    std::vector<int> missed;
    void add(int map_point, const PoseObservation& observation, double sigma_px);
  };
  // is_guess: see PoseEvidence. is_near: skips first_fit().
  ProvenPose fine(const SweptPose& start, const Pyramid& pyramid, const SceneMap& map, bool is_guess,
                  bool is_near = false);
  ProvenPose proof_by(const Matches& matches, const SweptPose& start, const SceneMap& map, bool is_guess);
  SweptPose first_fit(const SweptPose& pose, const Pyramid& pyramid, const SceneMap& map);
  Matches match(const std::vector<Visible>& seen, const Pyramid& pyramid, const SceneMap& map);
  void add_seeds(const SweptPose& pose, const Pyramid& pyramid, const SceneMap& map, std::size_t most,
                 Matches& matches);
  // Sub-pixel match of patch_, raw pixels; nullopt: none.
  std::optional<Eigen::Vector2d> find_patch(const GreyImage& image, const PixelRegion& region, int level);
  SweptPose add_corners(const SweptPose& pose, const Pyramid& pyramid, const SceneMap& map, Matches& matches);
  bool is_corner(int point) const { return rectangle_ && point < 4; }
  // An intermediate fit. With few, imprecise points it holds the motion at its prior.
  SweptFit rough_fit(std::span<const PoseObservation> observations, const SweptPose& start, int iterations) const {
    constexpr std::size_t enough_for_motion = 20;
    const bool is_held = observations.size() < enough_for_motion;
    return refine_swept_pose(camera_.model, observations, start, is_held ? prior_.without_uncertainty() : prior_,
                             iterations);
  }
  void classify(const PoseFit& fit, const Matches& matches, ProvenPose& out) const;  // inliers and outliers
  // The anchors of templates whose centres are within reach of `at`, pixels of the image.
  PixelRegion around(const Eigen::Vector2d& at, int reach_u, int reach_v, const GreyImage& image) const;

  calib::Camera camera_;
  calib::BatchProjector lens_;
  particle_filter::Rng rng_;
  std::size_t particle_count_;
  std::uint64_t seed_;
  std::uint64_t frames_ = 0;
  std::optional<bool> rectangle_;  // dark

  PoseParticles particles_;
  double effective_sample_size_ = 0;
  calib::Rigid3d pose_;
  Matrix6d pose_covariance_ = Matrix6d::Zero();  // of its tangent
  calib::Rigid3d step_;                          // of the last frame: pose = step * pose before
  double depth_m_ = 1;                           // median of the points in view
  int unproven_ = 0;                             // frames since the last proven pose
  CameraMotion motion_;
  ReadoutLearner readout_;
  MotionPrior prior_;  // of this frame
  std::vector<Sought> sought_;

  // buffers
  std::vector<ObservationField> fields_;
  std::vector<float> u_, v_, log_weight_;
  WarpedPatch patch_;
  std::vector<float> field_;
};

}  // namespace huetrack::keyframes
