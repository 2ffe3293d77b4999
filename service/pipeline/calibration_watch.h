// Watches on the road whether every camera still stands where the rig says: what each of them sees of the still room,
// and what it sees of an object whose position the others fix. Says what is to be held of each camera, by the
// configuration: nothing, that it is left out, or that its pose follows. Facts for the outputs; no sentences.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "calib/model/camera_rig.h"
#include "capture/frames/frame.h"
#include "config/service_config.h"
#include "object_tracking/object_estimate.h"
#include "object_tracking/tracker_options.h"
#include "room_watch/camera_watch.h"
#include "room_watch/moved_pose.h"

namespace huetrack::pipeline {

// What is known of one camera's calibration at the moment.
struct CameraCalibration {
  room_watch::RoomCondition room;
  std::optional<room_watch::MovedPoseEstimate> moved;  // where it stands now; nullopt: where the rig says
  double effect_m = 0;                                 // by how much positions are off by that, if nothing is done, rms
  bool is_used = true;                                 // by the trackers
  bool is_mended = false;                              // they hold it to stand where `moved` says
};

// thread-compatible: the tracking thread's. Deterministic: by the sets alone.
class CalibrationWatch {
 public:
  // volume: where targets may be. still: per camera of the rig, false of one that moves and is not watched.
  CalibrationWatch(const calib::CameraRig& rig, const object_tracking::Volume& volume, config::CalibrationConfig config,
                   std::vector<bool> still);

  // Before the trackers' update with that set. True: trust() has changed.
  bool look(const capture::FrameSet& set);
  // After it.
  void learn(std::span<const object_tracking::ObjectEstimate> estimates);

  const std::vector<object_tracking::CameraTrust>& trust() const { return trust_; }  // per camera of the rig
  const std::vector<CameraCalibration>& cameras() const { return facts_; }           // per camera of the rig
  // As it is known by now, to be kept; cameras of which nothing is known are absent.
  std::vector<config::KeptRoom> room() const;

 private:
  struct Watched {
    room_watch::CameraWatch watch;
    bool is_still;
    std::optional<room_watch::MovedPose> pose = {};
    int turns = 0;                                       // of the condition, that `pose` knows
    Eigen::Vector3d rotation = Eigen::Vector3d::Zero();  // of the room, that `pose` knows
    std::optional<capture::Timestamp> trusted_at = {};   // when trust() was last said of it
    std::optional<capture::Timestamp> effect_at = {};
    std::vector<room_watch::Occluder> objects = {};
  };
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
