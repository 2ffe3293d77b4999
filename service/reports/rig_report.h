// The output that reports cameras that no longer stand where the rig says: in the log once, as a warning while it
// lasts, and in the summary. It also supplies the corrected rig.
#pragma once

#include <algorithm>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "calib/model/camera_rig.h"
#include "pipeline/output.h"

namespace huetrack::reports {

// Whether the camera yields wrong positions, or none.
bool is_trouble(room_watch::RoomState state);

class RigReport final : public pipeline::Output {
 public:
  explicit RigReport(const config::ServiceConfig& config);

  void on_set(const pipeline::TrackedSet& set) override;

  // In force now, one sentence each. thread-safe
  std::vector<std::string> warnings() const;
  // Current state per camera of the rig. thread-safe
  std::vector<pipeline::CameraCalibration> cameras() const;

  // All events since the start, one sentence each. After the run.
  std::vector<std::string> summary() const;
  // is_trouble() held for some camera at any time. After the run.
  bool has_had_trouble() const { return std::ranges::any_of(events_, is_trouble, &Event::state); }

  // Sets the poses of moved cameras in `rig` to their current estimates; returns how many. After the run.
  int mend(calib::CameraRig& rig) const;

 private:
  struct Event {
    std::size_t camera;
    room_watch::RoomState state;
    int turns;  // RoomCondition::turns
    capture::Timestamp reported_at;
    pipeline::CameraCalibration facts;  // the latest, while it lasted
  };
  struct Reported {
    room_watch::RoomState state = room_watch::RoomState::learning;
    int turns = 0;
    std::optional<capture::Timestamp> pending_since = {};  // a new state was seen then and is not reported yet
  };
  bool is_news(std::size_t camera, const pipeline::CameraCalibration& facts, capture::Timestamp at);
  void update_latest_events(std::span<const pipeline::CameraCalibration> calibration);

  const std::vector<std::string> cameras_;
  const config::CalibrationMode mode_;
  std::vector<Reported> reported_;             // the tracking thread's
  std::vector<Event> events_;                  // the tracking thread's
  std::optional<capture::Timestamp> next_at_;  // the tracking thread's; next update of the figures in warnings
  mutable std::mutex mutex_;
  std::vector<std::string> warnings_;               // guarded by mutex_; per camera, empty: none
  std::vector<pipeline::CameraCalibration> facts_;  // guarded by mutex_
};

}  // namespace huetrack::reports
