// What the trackers of the papers by Lee and by Pupilli and Calway have in common around their filters: the start, the
// states, the covariance that is told.
#pragma once

#include <algorithm>
#include <memory>

#include "camera_tracking/camera_starter.h"
#include "camera_tracking/camera_tracker.h"
#include "camera_tracking/papers/mean_polish.h"
#include "camera_tracking/pose_particles.h"
#include "camera_tracking/scene_map.h"
#include "particle_filter/resample.h"

namespace huetrack {

// What a method makes of a frame.
struct FilteredPose {
  bool tracked = false;
  Rigid3d cam_from_world;
  int in_view = 0, matched = 0, map_points = 0;
  double map_sigma_m = 0;             // rms, of the matched points' own: errors that they share do not average out
  double depth_m = 1;                 // of one of them
  std::vector<PoseObservation> seen;  // the matched points, where the image shows them
  std::optional<PoseFit> polished;    // the fit that cam_from_world is of; none: it is the particles' mean
};

class PaperTrackerBase : public CameraTracker {
 public:
  CameraEstimate update(const Frame& frame) final;
  std::string why_no_pose() const final;

 protected:
  // throws std::runtime_error naming the map file
  PaperTrackerBase(const Camera& camera, const CameraTrackerOptions& options);
  virtual void start(const std::shared_ptr<const Pyramid>& pyramid, const Started& started, std::uint64_t number) = 0;
  virtual void restart(
      const Rigid3d& cam_from_world) = 0;  // seen again from here: a lost filter's particles are put there
  virtual FilteredPose track(const std::shared_ptr<const Pyramid>& pyramid, std::uint64_t number) = 0;
  virtual const PoseParticles& particles() const = 0;
  virtual SceneMap scene() const = 0;  // to find the way in, or back
  // False while a pose has yet to be proven: a map that grew about a wrong pose would prove it.
  // (The papers have no such doubt.)
  bool may_map() const { return unsupported_ == 0 && (probation_ == 0 || as_printed_); }
  std::optional<StoredMap> take_loaded() { return std::move(loaded_); }

  Camera camera_;

 private:
  std::optional<PoseFit> proposal(const Pyramid& pyramid, std::uint64_t number) const;  // from the features' looks
  Covariance6d covariance_of(const FilteredPose& pose, const Rigid3d& cam_from_world) const;
  bool proven(const FilteredPose& pose) const;

  CameraStarter starter_;
  std::optional<StoredMap> loaded_;
  std::uint64_t seed_;
  bool as_printed_;
  std::uint64_t frames_ = 0;
  bool started_ = false, has_map_ = false;
  int probation_ = 0;
  int unsupported_ = 0;  // frames in a row
  CameraState state_ = CameraState::searching;
  Timestamp tracked_at_{};
  Covariance6d start_covariance_ = Covariance6d::Zero();
};

}  // namespace huetrack
