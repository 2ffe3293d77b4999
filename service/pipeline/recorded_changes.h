// Events of a live run that a replay must repeat to reproduce the live track: dropped sets and reloaded configurations.
// Stored in the recording's folder: changes.csv, and huetrackd-2.yaml, -3, ... for the reloaded configurations.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "capture/frames/frame.h"

namespace huetrack::pipeline {

struct RecordedReload {
  capture::Timestamp at;         // FrameSet::at of the first set tracked with it
  std::filesystem::path config;  // the whole configuration from then on
};
struct RecordedChanges {
  std::vector<RecordedReload> reloads;              // in order
  std::vector<capture::Timestamp> left_out;         // FrameSet::at, ascending
  std::vector<capture::Timestamp> camera_left_out;  // frames of the tracked camera, ascending
};

// folder: of a recording. Empty if there is no changes.csv. throws ConfigError "file:line: ...".
RecordedChanges read_changes(const std::filesystem::path& folder);

// thread-compatible. Every call is flushed. Failures are stored in failure(); nothing throws.
class ChangesWriter {
 public:
  explicit ChangesWriter(std::filesystem::path folder);
  void left_out(capture::Timestamp at);
  void camera_left_out(capture::Timestamp at);  // a frame of the tracked camera
  void reloaded(capture::Timestamp at, const std::string& config_yaml);
  const std::string& failure() const { return failure_; }  // one line; empty: none

 private:
  void write(const std::filesystem::path& file, const std::string& text);

  std::filesystem::path folder_;
  bool has_begun_ = false;
  int configs_ = 1;
  std::string failure_;
};

}  // namespace huetrack::pipeline
