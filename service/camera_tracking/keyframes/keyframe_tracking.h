// The tracking half of our camera tracker: one frame against a map that does not change meanwhile.
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

// A pose with its evidence.
struct ProvenPose {
  camera_tracking::SweptPose pose;
  Eigen::Matrix<double, 6, 6> tangent_covariance = Eigen::Matrix<double, 6, 6>::Identity();
  PoseEvidence evidence;
  bool proven = false;
  std::vector<camera_tracking::PointSighting> sightings;  // their key frame is not set
  std::vector<int> missed;                                // points that were sought and not found
  std::optional<Readout> readout;                         // what this frame says of it
};

// thread-compatible.
class KeyframeTracking {
 public:
  KeyframeTracking(const calib::Camera& camera, std::size_t particle_count, std::uint64_t seed);

  // The world's rectangle, when it is what was started from: its edges are measured in every view. Points 0 to 3 of the
  // map.
  void set_rectangle(bool dark) { rectangle_ = dark; }
  void set_pose(capture::Timestamp at, const calib::Rigid3d& cam_from_world);  // known from elsewhere: a start
  void forget();                                                               // the motion: lost
  // The frame before the last one, of which nothing was known but what it shows: the motion that the last one gives it,
  // and its pose with that; nullopt: while the readout is not known, that says no more.
  MotionPrior motion_of(capture::Timestamp at, capture::Timestamp last_at) const {
    return CameraMotion::prior_from_next(at, last_at, pose_, readout());
  }
  std::optional<SweptFit> with_motion(const MotionPrior& prior, capture::Timestamp at, const calib::Rigid3d& pose,
                                      std::span<const camera_tracking::PoseObservation> seen,
                                      capture::Timestamp last_at);

  // The next frame. The result's `proven` says whether the pose is one; otherwise it is what the particles make of it.
  // lost: there is no pose to start from, so stored key frames are asked. proposed: a pose that somebody else found in
  // this very frame (the start, seen again); it is proven like one from the key frames.
  ProvenPose track(capture::Timestamp at, const std::shared_ptr<const camera_tracking::Pyramid>& pyramid,
                   const camera_tracking::SceneMap& map, bool lost,
                   const std::optional<calib::Rigid3d>& proposed = std::nullopt);

  const camera_tracking::PoseParticles& particles() const { return particles_; }
  double effective_sample_size() const { return effective_sample_size_; }
  Readout readout() const { return readout_.readout(); }
  const MotionPrior& prior() const { return prior_; }  // with which the last frame's pose was fitted
  // What was sought in the last frame, for pictures.
  struct Sought {
    int point;
    Eigen::Vector2d px, found_px;  // raw; found NaN when not
    Eigen::Matrix2d search;
  };
  const std::vector<Sought>& sought() const { return sought_; }

 private:
  // ---- keyframe_tracking.cpp: what should be seen from a pose.
  struct Visible {
    int point = 0;  // -1: a seed
    const camera_tracking::PointLook* look = nullptr;
    Eigen::Vector2d px;        // raw
    Eigen::Vector2f swept_px;  // how far that is from where the middle row's pose has it
    camera_tracking::PatchTransfer patch;
    int level = 0;            // to be searched at
    double map_sigma_px = 0;  // of the point's own uncertainty, projected
    // Of a seed: where it is thought to be, and what its depth leaves open of px.
    Eigen::Vector3d position = Eigen::Vector3d::Zero();
    Eigen::Vector2d open_px = Eigen::Vector2d::Zero(), reach_px = Eigen::Vector2d::Zero();
  };
  std::vector<Visible> visible(const camera_tracking::SweptPose& pose, const camera_tracking::SceneMap& map,
                               int levels) const;
  // shift_sigma_m: of the pose, per axis.
  std::vector<Visible> visible_seeds(const camera_tracking::SweptPose& pose, double shift_sigma_m,
                                     const camera_tracking::SceneMap& map, int levels) const;
  std::optional<camera_tracking::PatchTransfer> patch_of(const camera_tracking::SweptPose& pose,
                                                         const camera_tracking::SweptPixel& now,
                                                         const camera_tracking::PointLook& look,
                                                         const Eigen::Vector3d& position, const Eigen::Vector3d& normal,
                                                         const camera_tracking::SceneMap& map) const;
  static const camera_tracking::PointLook* look_most_alike(const camera_tracking::MapPoint& point,
                                                           const Eigen::Vector3d& centre,
                                                           const camera_tracking::SceneMap& map);
  static void thin_out(std::vector<Visible>& seen, std::size_t most);
  // Into patch_; false: nothing would match.
  bool warp(const Visible& seen, const camera_tracking::SceneMap& map, int level);

  // ---- keyframe_coarse.cpp: particles, drawn to where templates correlate on a small copy of the image. Pupilli and
  // Calway's annealing, with 40 points of which each costs little.
  struct Walk {
    float rotation_rad, position_m;  // standard deviations per axis
  };
  camera_tracking::SweptPose coarse(const camera_tracking::SweptPose& predicted,
                                    const camera_tracking::Pyramid& pyramid, const camera_tracking::SceneMap& map);
  Walk scatter(const calib::Rigid3d& predicted);
  std::vector<Visible> one_per_cell(const std::vector<Visible>& seen, const camera_tracking::SceneMap& map) const;
  void correlate(std::vector<Visible>& chosen, const camera_tracking::Pyramid& pyramid, int level,
                 const camera_tracking::SceneMap& map);
  void project(const Visible& seen, const camera_tracking::SceneMap& map, int level);
  void anneal(const std::vector<Visible>& chosen, int level, const camera_tracking::SceneMap& map, const Walk& walk);
  camera_tracking::SweptPose fit_to_fields(camera_tracking::SweptPose pose, const std::vector<Visible>& chosen,
                                           int level, const camera_tracking::SceneMap& map) const;

  // ---- keyframe_fine.cpp: every point to a fraction of a pixel, and whether that proves the pose.
  struct Matches {  // of one frame, corners of the start rectangle included
    int sought = 0;
    std::vector<camera_tracking::PoseObservation> observations;
    std::vector<int> point;           // of each observation
    std::vector<double> pixel_sigma;  // of each observation: without what the point's own uncertainty adds
    std::vector<int> missed;
    void add(int map_point, const camera_tracking::PoseObservation& observation, double sigma_px);
  };
  // is_guess: see PoseEvidence. is_near: the start is as good as what a few points, roughly seen, would make of it.
  ProvenPose fine(const camera_tracking::SweptPose& start, const camera_tracking::Pyramid& pyramid,
                  const camera_tracking::SceneMap& map, bool is_guess, bool is_near = false);
  ProvenPose proof_by(const Matches& matches, const camera_tracking::SweptPose& start,
                      const camera_tracking::SceneMap& map, bool is_guess);
  camera_tracking::SweptPose first_fit(const camera_tracking::SweptPose& pose, const camera_tracking::Pyramid& pyramid,
                                       const camera_tracking::SceneMap& map);
  Matches match(const std::vector<Visible>& seen, const camera_tracking::Pyramid& pyramid,
                const camera_tracking::SceneMap& map);
  void add_seeds(const camera_tracking::SweptPose& pose, const camera_tracking::Pyramid& pyramid,
                 const camera_tracking::SceneMap& map, std::size_t most, Matches& matches);
  // In the image, to a fraction of a pixel of level 0; nullopt: nothing like it is there.
  std::optional<Eigen::Vector2d> find_patch(const camera_tracking::GreyImage& image,
                                            const camera_tracking::PixelRegion& region, int level);
  camera_tracking::SweptPose add_corners(const camera_tracking::SweptPose& pose,
                                         const camera_tracking::Pyramid& pyramid, const camera_tracking::SceneMap& map,
                                         Matches& matches);
  bool is_corner(int point) const { return rectangle_ && point < 4; }
  // For a pose to go on from. Few points that are roughly seen would make any motion of their noise.
  SweptFit rough_fit(std::span<const camera_tracking::PoseObservation> observations,
                     const camera_tracking::SweptPose& start, int iterations) const {
    constexpr std::size_t enough_for_motion = 20;
    const bool is_held = observations.size() < enough_for_motion;
    return refine_swept_pose(camera_.model, observations, start, is_held ? prior_.held() : prior_, iterations);
  }
  void sort_out(const camera_tracking::PoseFit& fit, const Matches& matches, ProvenPose& out) const;
  // Where a template may lie whose centre is within reach of `at`, both in pixels of the image.
  camera_tracking::PixelRegion around(const Eigen::Vector2d& at, int reach_u, int reach_v,
                                      const camera_tracking::GreyImage& image) const;

  calib::Camera camera_;
  calib::BatchProjector lens_;
  particle_filter::Rng rng_;
  std::size_t particle_count_;
  std::uint64_t seed_;
  std::uint64_t frames_ = 0;
  std::optional<bool> rectangle_;  // dark

  camera_tracking::PoseParticles particles_;
  double effective_sample_size_ = 0;
  calib::Rigid3d pose_;
  Matrix6d pose_covariance_ = Matrix6d::Zero();  // of its tangent, as its fit has it
  calib::Rigid3d step_;                          // of the last frame: pose = step * pose before
  double depth_m_ = 1;                           // median, of what is in view
  int unproven_ = 0;                             // frames since the last proven pose
  CameraMotion motion_;
  ReadoutLearner readout_;
  MotionPrior prior_;  // of this frame
  std::vector<Sought> sought_;

  // buffers
  std::vector<camera_tracking::ObservationField> fields_;
  std::vector<float> u_, v_, log_weight_;
  camera_tracking::WarpedPatch patch_;
  std::vector<float> field_;
};

}  // namespace huetrack::keyframes
