// A recording, opened for a session: played, paused, sought and looped.
#pragma once

#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>

#include "config/service_config.h"
#include "daemon/played_source.h"
#include "pipeline/session.h"
#include "recordings/recording.h"
#include "recordings/replay_source.h"

namespace huetrack::daemon {

struct ReplayCommand;

// The session owns the sources; played is valid as long as the session.
struct OpenedRecording {
  recordings::Recording recording;
  pipeline::SessionSources sources = {};
  capture::Timestamp first_at = {};  // of the first frame of all cameras
  std::shared_ptr<recordings::ReplaySource*> pass = nullptr;
  PlayedSource* played = nullptr;  // null: cannot be paused
  // What in the files contradicts the recording's times: logged when a camera's thread finds it.
  struct ContradictedTimes {
    std::mutex mutex;
    std::set<std::string> texts;
  };
  std::shared_ptr<ContradictedTimes> contradicted_times = std::make_shared<ContradictedTimes>();

  // Of the current pass; not while the session runs.
  recordings::ReplaySource& source() const { return **pass; }
};

// The command's configuration. throws ConfigError; std::runtime_error: it and the recording are swapped
config::ServiceConfig load_or_name_swap(const ReplayCommand& command);

// throws ConfigError
OpenedRecording open_recording(const config::ServiceConfig& config, const ReplayCommand& command);

// From the first to the last frame, as far as the files say before they are read. nullopt: one does not
std::optional<capture::Duration> length_of(const recordings::ReplaySource& source);

// The time for --hold: end of the first set with every camera that starts within a second of the first.
capture::Timestamp first_whole_set(const recordings::ReplaySource& source, capture::Duration set_span);

// The same recording without frames that are stamped before `from`, so that they need not be decoded. Only of cameras
// for which a frame's number and time are known beforehand.
recordings::Recording without_frames_before(recordings::Recording recording, capture::Timestamp from);

}  // namespace huetrack::daemon
