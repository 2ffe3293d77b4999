// The output that records while tracking: everything, or what was before and after something happened; with what a
// replay must repeat to give the live track.
#pragma once

#include <atomic>
#include <filesystem>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "pipeline/output.h"
#include "pipeline/recorded_changes.h"
#include "pipeline/recorder.h"

namespace huetrack::pipeline {

struct RecordingKeeperOptions {
  std::filesystem::path record_to;  // everything goes into this folder; empty: what config.record says
  std::size_t cameras_in_use = 1;   // >= 1; they share the pre-roll's memory
  bool is_tracking = true;          // false: nothing happens that a replay must repeat
};

// on_...() as the road calls them, the rest: one supervising thread.
class RecordingKeeper final : public Output {
 public:
  // Starts to record where everything is to be. config: as it is in force.
  // throws CaptureError: options.record_to cannot be recorded into. (A disk that does not take what config.record asks
  // for is a warning.)
  RecordingKeeper(const config::ServiceConfig& config, const RecordingKeeperOptions& options);

  void on_frame(const capture::Frame& frame, capture::Timestamp received_at) override;
  void on_left_out(const LeftOut& left_out) override;
  void on_set(const TrackedSet& set) override;
  void on_config(const config::ServiceConfig& config) noexcept override;

  // Now and then: ends what is over, saves the pre-roll of a target that was lost, writes down what happened.
  void look_after();
  // Into a folder named by the time and `why`; "signal": somebody asked for it.
  void save_pre_roll(const std::string& why);
  // When the road is empty: what is written is on disk, and what is still waiting after `patience` is left out. Nothing
  // is recorded from then on, whatever is asked.
  void finish(capture::Duration patience);

  std::vector<std::string> warnings() const;                       // one sentence each
  const std::filesystem::path& folder() const { return folder_; }  // of the current or last recording; empty: none
  bool is_recording() const;                                       // and the disk takes it
  RecorderFigures figures() const;                                 // empty: nothing is ever recorded

 private:
  void make_recorder(const config::ServiceConfig& config, const RecordingKeeperOptions& options, bool has_pre_roll);
  void start(const std::filesystem::path& folder, bool is_tracking);
  std::filesystem::path new_folder(const std::string& why) const;
  void write_changes();

  const config::RecordConfig record_;
  const std::vector<std::string> cameras_;  // names, of the rig
  std::optional<Recorder> recorder_;
  std::optional<ChangesWriter> changes_;  // made by the constructor, or never
  std::filesystem::path folder_;          // of the current or last recording
  std::string problem_;                   // empty: none
  bool is_finished_ = false;

  std::vector<object_tracking::TrackState> states_;  // the tracking thread's; per target
  std::atomic<bool> has_lost_ = false;
  struct Happening {
    capture::Timestamp at;
    std::string config;  // what was reloaded; empty: a set was left out
  };
  std::mutex mutex_;
  std::vector<Happening> happened_;                  // guarded by mutex_
  std::vector<capture::Timestamp> camera_left_out_;  // guarded by mutex_
};

}  // namespace huetrack::pipeline
