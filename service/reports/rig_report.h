// Tells when a camera no longer stands where the rig says: in the log once, in the status while it lasts, in a replay's
// summary; and gives the rig as it is now.
#pragma once

#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "calib/model/camera_rig.h"
#include "pipeline/output.h"

namespace huetrack::reports {

// Whether the camera gives wrong positions, or none.
bool is_trouble(room_watch::RoomState state);

class RigReport final : public pipeline::Output {
 public:
  explicit RigReport(const config::ServiceConfig& config);

  void on_set(const pipeline::TrackedSet& set) override;

  // In force now, one sentence each. thread-safe
  std::vector<std::string> warnings() const;
  // Per camera of the rig, as it is now. thread-safe
  std::vector<pipeline::CameraCalibration> cameras() const;

  // What there was since the start, one sentence each. When the road is empty.
  std::vector<std::string> summary() const;
  // A camera gave wrong positions, or none, at any time (is_trouble). When the road is empty.
  bool has_had_trouble() const;

  // The rig with those cameras where they stand now; how many were moved. When the road is empty.
  int mend(calib::CameraRig& rig) const;

 private:
  struct Happening {
    std::size_t camera;
    room_watch::RoomState state;
    int turns;  // RoomCondition::turns
    capture::Timestamp told_at;
    pipeline::CameraCalibration facts;  // as known last, while it lasted
  };
  struct Told {
    room_watch::RoomState state = room_watch::RoomState::learning;
    int turns = 0;
    std::optional<capture::Timestamp> seen_at = {};  // what is to be told; nullopt: it is told
  };
  bool is_news(std::size_t camera, const pipeline::CameraCalibration& facts, capture::Timestamp at);

  const std::vector<std::string> cameras_;
  const config::CalibrationMode mode_;
  std::vector<Told> told_;                     // the tracking thread's
  std::vector<Happening> happenings_;          // the tracking thread's
  std::optional<capture::Timestamp> next_at_;  // the tracking thread's; when figures are told anew
  mutable std::mutex mutex_;
  std::vector<std::string> warnings_;               // guarded by mutex_; per camera, empty: none
  std::vector<pipeline::CameraCalibration> facts_;  // guarded by mutex_
};

}  // namespace huetrack::reports
