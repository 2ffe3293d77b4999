// The service's status, published about once a second and on every change. A plain value.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "capture/frames/frame.h"
#include "capture/timing/host_clock.h"

namespace huetrack::publish {

struct CameraStatus {
  std::string name;
  enum class Health : std::uint8_t { waiting, delivering, stalled, absent, ended };
  Health health = Health::waiting;
  std::string message;        // problem and remedy; empty: none
  std::uint64_t frames = 0;   // since the start
  std::uint64_t dropped = 0;  // sequence gaps
  std::uint64_t corrupted = 0;
  std::uint64_t repeated = 0;  // part of `frames`: repeats the previous picture
  double rate_hz = 0;          // over the last seconds
  double age_s = 0;            // since the last frame was received
  bool is_used = true;         // false: not in the configuration
};

// The clock of a remote host.
struct HostClockStatus {
  capture::HostClock clock;
  std::vector<std::string> cameras;  // of the rig, on this host
};

struct ServiceStatus {
  capture::Timestamp at;  // UNIX time
  std::string program_version;
  std::string mode;  // "replay" or "run"
  std::string config_file;
  std::string config_identity;  // hash of the resolved configuration
  std::string rig_identity;     // rig_identity() of the rig in use
  std::string rig_history;      // RigHistory::text(); empty: unknown
  double clock_offset_s = 0;    // published capture time minus the recording's own clock; 0 live
  double set_rate_hz = 0;       // frame sets tracked per second, over the last seconds
  std::uint64_t sets = 0;
  std::uint64_t incomplete_sets = 0;
  std::uint64_t late_frames = 0;
  std::uint64_t dropped_sets = 0;  // by the queue: tracking was too slow
  std::vector<CameraStatus> cameras;
  std::vector<HostClockStatus> clocks;  // by host name; empty: no remote cameras
  std::vector<std::string> targets;     // names
  std::vector<std::string> warnings;    // one sentence each
};

}  // namespace huetrack::publish
