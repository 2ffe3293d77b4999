// What happened to the tracking while a recording was made, beside its frames: sets that were never tracked, because
// tracking was too slow, and reloads of the configuration. A replay of the recording repeats them, so that it gives the
// live track. They lie in the recording's folder: changes.csv, and huetrackd-2.yaml, -3, ... for what was reloaded.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "capture/frames/frame.h"

namespace huetrack::pipeline {

struct RecordedReload {
  capture::Timestamp at;         // FrameSet::at of the first set that was tracked with it
  std::filesystem::path config;  // the whole configuration from then on
};
struct RecordedChanges {
  std::vector<RecordedReload> reloads;              // in the order in which they happened
  std::vector<capture::Timestamp> left_out;         // FrameSet::at, ascending
  std::vector<capture::Timestamp> camera_left_out;  // frames of the tracked camera, ascending
};

// folder: of a recording. Empty when nothing happened. throws ConfigError "file:line: ...".
RecordedChanges read_changes(const std::filesystem::path& folder);

// thread-compatible. Every call is handed to the system at once. Failures are kept for failure(); nothing throws.
class ChangesWriter {
 public:
  explicit ChangesWriter(std::filesystem::path folder);
  void left_out(capture::Timestamp at);
  void camera_left_out(capture::Timestamp at);  // a frame of the tracked camera
  void reloaded(capture::Timestamp at, const std::string& config_yaml);
  const std::string& failure() const { return failure_; }  // one line; empty: all is well

 private:
  void write(const std::filesystem::path& file, const std::string& text);

  std::filesystem::path folder_;
  bool has_begun_ = false;
  int configs_ = 1;
  std::string failure_;
};

}  // namespace huetrack::pipeline
