// `huetrackd replay`: tracks a recording, with output to DDS, CSV and pictures.
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "daemon/tally.h"
#include "pipeline/figures.h"

namespace huetrack::daemon {

// Published capture times. Those in the CSV are always the recording's clock.
enum class ReplayStamps : std::uint8_t {
  now,        // as if the first frame were captured at the start of the replay
  recording,  // the recording's clock, plus its started_at if it has one
};

struct ReplayCommand {
  std::filesystem::path config;
  std::vector<std::string> recording;  // recording.yaml, or its folder, or a CAMERA=FILE for each camera
  double speed = 0;                    // times the recorded one; 0: as fast as possible
  bool loops = false;                  // again and again, until a stop; capture times go on rising
  std::optional<ReplayStamps> stamps;  // nullopt: now if a speed is given, else recording
  bool no_dds = false;                 // overrides the configuration
  double wait_for_subscriber_s = 0;    // longest wait before the first frame; only with DDS
  int subscribers = 1;                 // number to wait for
  std::optional<int> threads;          // overrides the configuration
  std::filesystem::path tracks;        // CSV; empty: none
  std::filesystem::path poses;         // TUM file of the tracked camera's poses, see PoseFileWriter; empty: none
  std::filesystem::path pictures;      // folder; empty: none
  int pictures_every = 1;              // >= 1
  std::filesystem::path truth;         // CSV, see Truth; empty: none
  std::filesystem::path write_rig;     // rig with estimated timing and current poses; empty: none
  bool hold = false;  // pause after the first frame of every camera, until the page continues; needs DDS
  std::atomic<bool>* reload = nullptr;  // a flag that requests a reload; needs DDS
  std::function<void()> close = {};     // called when the page requests the end; empty: not possible
  bool progress = true;                 // a bar on stderr, if that is a terminal
};

struct ReplaySummary {
  pipeline::PipelineFigures figures;
  bool stopped = false;  // before the end
  std::int64_t missing_frames = 0;
  std::int64_t corrupted_frames = 0;
  std::vector<std::string> ended_early;  // cameras that lack several frames at the end, one sentence each
  double recorded_s = 0;                 // length of the played part
  double wall_s = 0;                     // until the last estimate, without held_s and pictures
  double held_s = 0;                     // while paused
  std::vector<TargetSummary> targets;
  std::vector<std::string> mistakes;     // in rig, configuration and recording, one sentence each
  std::vector<std::string> clutter;      // static clutter of a target's colour and extra objects, one sentence each
  std::vector<std::string> times;        // timing of the cameras, one sentence each
  std::vector<std::string> calibration;  // moved cameras, one sentence each
  bool has_camera_trouble = false;       // a camera was moved, blinded or hidden
  std::vector<std::string> light;        // effects of light, one sentence each
  bool has_lost_color = false;           // a colour left its range
  std::optional<CameraSummary> camera;   // the tracked camera
  std::uint64_t published = 0;           // DDS samples written
  std::uint64_t publish_failures = 0;
  std::string bus;                    // description of the domain; empty: no DDS
  capture::Duration clock_offset{0};  // published capture time minus the recording's clock
  std::size_t pictures = 0;
};

// throws ConfigError and other std::exceptions with one readable line. Logs warnings.
ReplaySummary replay(const ReplayCommand& command, const std::stop_token& stop);

// The summary for people, several lines; problems_text() is last.
std::string to_text(const ReplaySummary& summary, const ReplayCommand& command);
// For --strict: a mistake, a target that was never tracked, or positions that were wrong or missing for a known reason.
bool has_trouble(const ReplaySummary& summary);
// Its lines about warnings and mistakes; empty: none.
std::string problems_text(const ReplaySummary& summary);

}  // namespace huetrack::daemon
