// Common base of the trackers of the papers by Lee and by Pupilli and Calway: start, states, published covariance.
#pragma once

#include <memory>

#include "camera_tracking/camera_starter.h"
#include "camera_tracking/camera_tracker.h"
#include "camera_tracking/papers/mean_polish.h"
#include "camera_tracking/pose_particles.h"
#include "camera_tracking/scene_map.h"

namespace huetrack::papers {

using namespace camera_tracking;

struct FilteredPose {  // a filter's result for one frame
  bool tracked = false;
  calib::Rigid3d cam_from_world;
  int in_view = 0, matched = 0, map_points = 0;
  double map_sigma_m = 0;  // rms of the matched points' own sigmas, not averaged: their errors are correlated
  double depth_m = 1;      // of one of them
  std::vector<PoseObservation> seen;  // the matched points with their measured pixels
  std::optional<PoseFit> polished;    // of cam_from_world; none: it is the particles' mean
};

class PaperTrackerBase : public CameraTracker {
 public:
  CameraEstimate update(const capture::Frame& frame) final;
  void begin_anew() final;
  std::string why_no_pose() const final;
  void save_map(const std::filesystem::path& file) const final;

 protected:
  // Throws std::runtime_error naming the map file.
  PaperTrackerBase(const calib::Camera& camera, const CameraTrackerOptions& options);
  virtual void start(const std::shared_ptr<const Pyramid>& pyramid, const StartResult& started,
                     std::uint64_t number) = 0;
  virtual void restart(const calib::Rigid3d& cam_from_world) = 0;
  virtual FilteredPose track(const std::shared_ptr<const Pyramid>& pyramid, std::uint64_t number) = 0;
  virtual const PoseParticles& particles() const = 0;
  virtual SceneMap scene() const = 0;  // for the relocalisation
  // False while a pose has yet to be proven: a map that grew about a wrong pose would prove it. (The papers have no
  // such doubt.)
  bool may_map() const { return unsupported_ == 0 && (probation_ == 0 || as_printed_); }
  std::optional<StoredMap> take_loaded() { return std::move(loaded_); }

  calib::Camera camera_;

 private:
  void relocalise_into_map(const Pyramid& pyramid, std::uint64_t number);
  FilteredPose begin(const capture::Frame& frame, const GreyImage& grey, const std::shared_ptr<const Pyramid>& pyramid,
                     std::uint64_t number);
  FilteredPose follow(const capture::Frame& frame, const GreyImage& grey, const std::shared_ptr<const Pyramid>& pyramid,
                      std::uint64_t number);
  void update_state(const FilteredPose& pose, const Covariance6d& covariance, capture::Timestamp at);
  std::optional<PoseFit> proposal(const Pyramid& pyramid, std::uint64_t number) const;
  Covariance6d covariance_of(const FilteredPose& pose, const calib::Rigid3d& cam_from_world) const;
  bool proven(const FilteredPose& pose) const;

  CameraStarter starter_;
  std::optional<StoredMap> loaded_;
  std::uint64_t seed_;
  bool as_printed_;
  std::uint64_t frames_ = 0;
  bool started_ = false, has_map_ = false;
  int probation_ = 0;
  int unsupported_ = 0;  // consecutive frames
  PoseState state_ = PoseState::searching;
  capture::Timestamp tracked_at_{};
  Covariance6d start_covariance_ = Covariance6d::Zero();
};

}  // namespace huetrack::papers
