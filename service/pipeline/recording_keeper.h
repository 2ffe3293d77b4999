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

// on_...() as the road calls them, begin() before it runs; the rest is thread-safe.
class RecordingKeeper final : public Output {
 public:
  // config: as it is in force.
  RecordingKeeper(const config::ServiceConfig& config, RecordingKeeperOptions options);
  // Starts to record where everything is to be.
  // throws CaptureError: options.record_to cannot be recorded into. (A disk that does not take what config.record asks
  // for is a warning.)
  void begin();

  void on_frame(const capture::Frame& frame, capture::Timestamp received_at) override;
  void on_left_out(const LeftOut& left_out) override;
  void on_set(const TrackedSet& set) override;
  void on_config(const config::ServiceConfig& config) noexcept override;

  // Now and then: ends what is over, saves the pre-roll of a target that was lost, writes down what happened.
  void look_after();
  // Into a folder named by the time and `why`; "signal": somebody asked for it. What goes wrong is logged, or a
  // warning.
  void save_pre_roll(const std::string& why);

  // What somebody asks for while it runs; each gives the recording's folder. throws std::runtime_error of one readable
  // line: there is nothing to do that with, it is done already, the configuration wants it otherwise, the disk refuses.
  std::filesystem::path
  start_on_request();  // from the pre-roll's first frame on, where there is one; a pre-roll goes on
  std::filesystem::path stop_on_request();
  std::filesystem::path save_on_request(const std::string& why = "asked");  // the pre-roll, and what follows it
  // From now on, without a pre-roll, into a folder of its own named by the time and `why`.
  std::filesystem::path start_anew(const std::string& why);

  // When the road is empty: what is written is on disk, and what is still waiting after `patience` is left out. Nothing
  // is recorded from then on, whatever is asked.
  void finish(capture::Duration patience);

  std::vector<std::string> warnings() const;  // one sentence each
  std::filesystem::path folder() const;       // of the current or last recording; empty: none
  bool is_recording() const;                  // and the disk takes it
  bool is_unfinished() const;                 // it is recording, or its files are not closed yet: folder() is not whole
  RecorderFigures figures() const;            // empty: nothing is ever recorded

 private:
  // All but begin() and is_always(): under supervised_.
  void make_recorder(const config::ServiceConfig& config);
  void start(const std::filesystem::path& folder);
  // why: what the folder's name ends with. throws std::runtime_error: it records already, the disk refuses.
  void start_as_asked(Recorder& recorder, const std::string& why, bool with_pre_roll);
  std::filesystem::path new_folder(const std::string& why) const;
  void write_changes();
  void save(const std::string& why);
  Recorder& recorder_for_who_asks();  // throws std::runtime_error

  bool is_always() const { return record_.always || !options_.record_to.empty(); }  // from the start to the end
  bool has_pre_roll() const { return record_.pre_roll_s > 0 && !is_always(); }

  const config::RecordConfig record_;
  const RecordingKeeperOptions options_;
  const std::vector<std::string> cameras_;  // names, of the rig
  std::string without_pictures_;            // a camera that says which pixels match, if there is one
  mutable std::mutex supervised_;           // guards what is done to the recorder, and all of this block
  std::optional<Recorder> recorder_;        // made by the constructor, or never
  std::optional<ChangesWriter> changes_;    // made by begin(), or never
  std::filesystem::path folder_;            // of the current or last recording
  std::string problem_;                     // empty: none
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
