// What the trackers of the papers by Lee and by Pupilli and Calway have in common around their filters: the start, the
// states, the covariance that is told.
#pragma once

#include <memory>

#include "camera_tracking/camera_starter.h"
#include "camera_tracking/camera_tracker.h"
#include "camera_tracking/papers/mean_polish.h"
#include "camera_tracking/pose_particles.h"
#include "camera_tracking/scene_map.h"
#include "particle_filter/resample.h"

namespace huetrack::papers {

// What a method makes of a frame.
struct FilteredPose {
  bool tracked = false;
  calib::Rigid3d cam_from_world;
  int in_view = 0, matched = 0, map_points = 0;
  double map_sigma_m = 0;  // rms, of the matched points' own: errors that they share do not average out
  double depth_m = 1;      // of one of them
  std::vector<camera_tracking::PoseObservation> seen;  // the matched points, where the image shows them
  // The fit that cam_from_world is of; none: it is the particles' mean.
  std::optional<camera_tracking::PoseFit> polished;
};

class PaperTrackerBase : public camera_tracking::CameraTracker {
 public:
  camera_tracking::CameraEstimate update(const capture::Frame& frame) final;
  std::string why_no_pose() const final;
  void save_map(const std::filesystem::path& file) const final;

 protected:
  // throws std::runtime_error naming the map file
  PaperTrackerBase(const calib::Camera& camera, const camera_tracking::CameraTrackerOptions& options);
  virtual void start(const std::shared_ptr<const camera_tracking::Pyramid>& pyramid,
                     const camera_tracking::Started& started, std::uint64_t number) = 0;
  // Seen again from here: a lost filter's particles are put there.
  virtual void restart(const calib::Rigid3d& cam_from_world) = 0;
  virtual FilteredPose track(const std::shared_ptr<const camera_tracking::Pyramid>& pyramid, std::uint64_t number) = 0;
  virtual const camera_tracking::PoseParticles& particles() const = 0;
  virtual camera_tracking::SceneMap scene() const = 0;  // to find the way in, or back
  // False while a pose has yet to be proven: a map that grew about a wrong pose would prove it. (The papers have no
  // such doubt.)
  bool may_map() const { return unsupported_ == 0 && (probation_ == 0 || as_printed_); }
  std::optional<camera_tracking::StoredMap> take_loaded() { return std::move(loaded_); }

  calib::Camera camera_;

 private:
  void find_way_in(const camera_tracking::Pyramid& pyramid, std::uint64_t number);
  FilteredPose begin(const capture::Frame& frame, const camera_tracking::GreyImage& grey,
                     const std::shared_ptr<const camera_tracking::Pyramid>& pyramid, std::uint64_t number);
  FilteredPose follow(const capture::Frame& frame, const camera_tracking::GreyImage& grey,
                      const std::shared_ptr<const camera_tracking::Pyramid>& pyramid, std::uint64_t number);
  void settle_state(const FilteredPose& pose, const camera_tracking::Covariance6d& covariance, capture::Timestamp at);
  std::optional<camera_tracking::PoseFit> proposal(const camera_tracking::Pyramid& pyramid,
                                                   std::uint64_t number) const;  // from the features' looks
  camera_tracking::Covariance6d covariance_of(const FilteredPose& pose, const calib::Rigid3d& cam_from_world) const;
  bool proven(const FilteredPose& pose) const;

  camera_tracking::CameraStarter starter_;
  std::optional<camera_tracking::StoredMap> loaded_;
  std::uint64_t seed_;
  bool as_printed_;
  std::uint64_t frames_ = 0;
  bool started_ = false, has_map_ = false;
  int probation_ = 0;
  int unsupported_ = 0;  // frames in a row
  camera_tracking::PoseState state_ = camera_tracking::PoseState::searching;
  capture::Timestamp tracked_at_{};
  camera_tracking::Covariance6d start_covariance_ = camera_tracking::Covariance6d::Zero();
};

}  // namespace huetrack::papers
