// The output that records while tracking: everything, or the time around an event; and the changes that a replay must
// repeat to reproduce the live track.
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
  std::filesystem::path record_to;  // record everything into this folder; empty: by config.record
  std::size_t cameras_in_use = 1;   // >= 1; share the pre-roll's memory
  bool is_tracking = true;          // false: no changes to record
};

// on_...(): as Output; begin() before the run; all else is thread-safe.
class RecordingKeeper final : public Output {
 public:
  // config: in force.
  RecordingKeeper(const config::ServiceConfig& config, RecordingKeeperOptions options);
  // Starts to record if everything is to be recorded. throws CaptureError if options.record_to cannot be written;
  // failure of config.record's folder is only a warning.
  void begin();

  void on_frame(const capture::Frame& frame, capture::Timestamp received_at) override;
  void on_left_out(const LeftOut& left_out) override;
  void on_set(const TrackedSet& set) override;
  void on_config(const config::ServiceConfig& config) noexcept override;

  // Call regularly: ends recordings, saves the pre-roll of a lost target, writes changes.
  void supervise();
  // Into a folder named by the time and `why` ("signal": requested by a signal). Failures are logged, or warnings.
  void save_pre_roll(const std::string& why);

  // Requests while the service runs; each returns the recording's folder. throws std::runtime_error with one readable
  // line if the configuration, the state or the disk does not allow it.
  std::filesystem::path start_on_request();  // with the pre-roll; also continues a saved pre-roll
  std::filesystem::path stop_on_request();
  std::filesystem::path save_on_request(const std::string& why = "asked");  // the pre-roll and what follows
  // Without the pre-roll, into a folder named by the time and `why`.
  std::filesystem::path start_anew(const std::string& why);

  // After the run: writes everything to disk, drops what is still waiting after `patience`. Later requests are refused.
  void finish(capture::Duration patience);

  std::vector<std::string> warnings() const;  // one sentence each
  std::filesystem::path folder() const;       // of the current or last recording; empty: none
  bool is_recording() const;                  // without a disk error
  bool is_unfinished() const;                 // recording, or files not closed: folder() is incomplete
  RecorderFigures figures() const;            // empty: recording is not configured

 private:
  // All but begin() and is_always(): under supervised_.
  void make_recorder(const config::ServiceConfig& config);
  void start(const std::filesystem::path& folder);
  // why: suffix of the folder's name. throws std::runtime_error: already recording, or a disk error.
  void start_new(Recorder& recorder, const std::string& why, bool with_pre_roll);
  std::filesystem::path new_folder(const std::string& why) const;
  void write_changes();
  void save(const std::string& why);
  Recorder& requested_recorder();  // throws std::runtime_error

  bool is_always() const { return record_.always || !options_.record_to.empty(); }  // the whole run
  bool has_pre_roll() const { return record_.pre_roll_s > 0 && !is_always(); }

  const config::RecordConfig record_;
  const RecordingKeeperOptions options_;
  const std::vector<std::string> cameras_;  // names, of the rig
  std::string without_pictures_;            // name of a camera with `send: matches`; empty: none
  mutable std::mutex supervised_;           // guards this block
  std::optional<Recorder> recorder_;        // set by the constructor, or never
  std::optional<ChangesWriter> changes_;    // set by begin(), or never
  std::filesystem::path folder_;            // of the current or last recording
  std::string problem_;                     // empty: none
  bool is_finished_ = false;

  std::vector<object_tracking::TrackState> states_;  // the tracking thread's; per target
  std::atomic<bool> has_lost_ = false;
  struct Change {
    capture::Timestamp at;
    std::string config;  // reloaded YAML; empty: a set was dropped
  };
  std::mutex mutex_;
  std::vector<Change> changes_to_write_;             // guarded by mutex_
  std::vector<capture::Timestamp> camera_left_out_;  // guarded by mutex_
};

}  // namespace huetrack::pipeline
