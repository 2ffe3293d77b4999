// `huetrackd replay`: a recording through the tracker, to DDS, CSV and pictures.
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

enum class ReplaySpeed : std::uint8_t {
  real,  // frames are held back until their capture time
  max,   // as fast as the machine can
};

// What the published capture times are. The CSV's are always the recording's own clock.
enum class ReplayStamps : std::uint8_t {
  now,        // as if the recording's first frame had been captured when the replay starts
  recording,  // the recording's own clock, from its started_at where it has one
};

struct ReplayCommand {
  std::filesystem::path config;
  std::vector<std::string> recording;  // recording.yaml, or its folder, or a CAMERA=FILE for each camera
  ReplaySpeed speed = ReplaySpeed::max;
  std::optional<ReplayStamps> stamps;   // nullopt: now at speed real, recording at speed max
  bool no_dds = false;                  // whatever the configuration says
  double wait_for_subscriber_s = 0;     // at most so long before the first frame; only with DDS
  int subscribers = 1;                  // so many are waited for
  std::optional<int> threads;           // instead of the configuration's
  std::filesystem::path tracks;         // CSV; empty: none
  std::filesystem::path poses;          // TUM file of the tracked camera's poses, see PoseFileWriter; empty: none
  std::filesystem::path pictures;       // folder; empty: none
  int pictures_every = 1;               // >= 1
  std::filesystem::path truth;          // CSV, see Truth; empty: none
  std::filesystem::path write_rig;      // the rig as learnt: the cameras' times, and where they stand; empty: none
  bool hold = false;                    // after the first frame of every camera, until the page says go on; needs DDS
  std::atomic<bool>* reload = nullptr;  // set by somebody: the configuration is to be read again; needs DDS
  std::function<void()> close = {};     // of the page, which asks for its end; empty: it cannot
  bool progress = true;                 // a bar on stderr, if that is a terminal
};

struct ReplaySummary {
  pipeline::PipelineFigures figures;
  bool stopped = false;  // before the end
  std::int64_t missing_frames = 0;
  std::int64_t corrupted_frames = 0;
  std::vector<std::string> ended_early;  // cameras that lack more than a frame at the end, one sentence each
  double recorded_s = 0;                 // the part that was played
  double wall_s = 0;                     // until the last estimate was out, but held_s; pictures may take longer
  double held_s = 0;                     // while it was held, or paused
  std::vector<TargetSummary> targets;
  std::vector<std::string> mistakes;     // in rig and configuration that the tracks show, one sentence each
  std::vector<std::string> left_out;     // what has a target's colour and never moves, one sentence each
  std::vector<std::string> times;        // when the cameras' rows are exposed, one sentence each
  std::vector<std::string> calibration;  // cameras that no longer stand where the rig says, one sentence each
  bool has_camera_trouble = false;       // one of those gave wrong positions, or none: moved, blinded, hidden
  std::vector<std::string> light;        // what light did to cameras and colours, one sentence each
  bool has_lost_color = false;           // by one of those: a colour left what is looked for
  std::optional<CameraSummary> camera;   // the tracked one
  std::uint64_t published = 0;           // DDS samples written
  std::uint64_t publish_failures = 0;
  std::string bus;                    // where to; empty: no DDS
  capture::Duration clock_offset{0};  // published capture time minus the recording's clock
  std::size_t pictures = 0;
};

// throws ConfigError and other std::exceptions whose what() is one readable line. Warnings go to the log.
ReplaySummary replay(const ReplayCommand& command, const std::stop_token& stop);

// For people, several lines: what there was, then what is not well (problems_text()), where the eye is at the end.
std::string to_text(const ReplaySummary& summary, const ReplayCommand& command);
// What a monitor is to know: a mistake, or that positions were wrong, or missing, for a reason that is known.
bool has_trouble(const ReplaySummary& summary);
// Of it the lines that name warnings and mistakes; empty: all is well.
std::string problems_text(const ReplaySummary& summary);

}  // namespace huetrack::daemon
