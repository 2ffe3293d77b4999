// Monitors whether each still camera stands where the rig says, by the still room and by objects that the other cameras
// localise. According to the configuration, the trackers get an inflated covariance for a moved camera, ignore it, or
// get its corrected pose. Facts for the outputs; no sentences.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "calib/model/camera_rig.h"
#include "capture/frames/frame.h"
#include "config/service_config.h"
#include "object_tracking/object_estimate.h"
#include "object_tracking/tracker_options.h"
#include "room_watch/camera_watch.h"
#include "room_watch/moved_pose.h"

namespace huetrack::pipeline {

// Current state of one camera's calibration.
struct CameraCalibration {
  room_watch::RoomCondition room;
  std::optional<room_watch::MovedPoseEstimate> moved;  // current pose; nullopt: that of the rig
  double effect_m = 0;                                 // m, rms error of positions if it is not corrected
  bool is_used = true;                                 // by the trackers
  bool is_mended = false;                              // the trackers use `moved`
};

// thread-compatible: the tracking thread's. Deterministic: depends on the sets only.
class CalibrationWatch {
 public:
  // volume: where targets may be. still: per camera of the rig; false: it moves and is not monitored.
  CalibrationWatch(const calib::CameraRig& rig, const object_tracking::Volume& volume, config::CalibrationConfig config,
                   std::vector<bool> still);

  // The next set does not continue the last one: each camera is compared anew with the room as it was learnt.
  void begin_anew();
  // Before the trackers' update with that set. Returns whether trust() has changed.
  bool look(const capture::FrameSet& set);
  // After it.
  void learn(std::span<const object_tracking::ObjectEstimate> estimates);

  const std::vector<object_tracking::CameraTrust>& trust() const { return trust_; }  // per camera of the rig
  const std::vector<CameraCalibration>& cameras() const { return facts_; }           // per camera of the rig
  // The learnt room, to be saved; cameras without one are absent.
  std::vector<config::KeptRoom> room() const;

 private:
  struct Watched {
    room_watch::CameraWatch watch;
    bool is_still;
    std::optional<room_watch::MovedPose> pose = {};
    int turns = 0;                                       // of the room's condition, already in `pose`
    Eigen::Vector3d rotation = Eigen::Vector3d::Zero();  // of the room, already in `pose`
    std::optional<capture::Timestamp> trusted_at = {};   // last change of trust()
    std::optional<capture::Timestamp> effect_at = {};
    std::vector<room_watch::Occluder> objects = {};
  };
  std::vector<room_watch::KeptPatch> known_patches(const std::string& camera) const;  // of the configuration
  void follow(std::size_t camera);
  void note(std::size_t camera, capture::Timestamp at);
  std::vector<bool> used_cameras() const;
  bool trust_camera(std::size_t camera, bool is_used, capture::Timestamp at);
  double effect_of(std::size_t camera, const calib::Rigid3d& now) const;

  const calib::CameraRig rig_;
  const object_tracking::Volume volume_;
  const config::CalibrationConfig config_;
  std::vector<Watched> watched_;
  std::vector<CameraCalibration> facts_;
  std::vector<object_tracking::CameraTrust> trust_;
};

}  // namespace huetrack::pipeline
