// Executes requests in words from the page and `huetrack control` (idl/README.md). Checks a request completely,
// including permissions, before anything changes.
#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <span>
#include <string>

#include "capture/v4l2_source.h"
#include "config/service_config.h"
#include "idl/huetrack_view.h"
#include "page/calibration_session.h"
#include "page/playback.h"
#include "pipeline/recording_keeper.h"

namespace huetrack::page {

// How the devices begin that `huetrackd demo` writes into its configuration: a recording is played in their place.
inline constexpr std::string_view played_device = "/dev/v4l/by-id/huetrackd-demo-";

// thread-compatible; the page service's thread owns it.
class ControlHandler {
 public:
  struct Actions {
    pipeline::RecordingKeeper* recording = nullptr;  // outlives this; nullptr: no recording (replay)
    CalibrationSession* calibration = nullptr;       // outlives this; nullptr: no calibration
    Playback* playback = nullptr;                    // of a replay; outlives this; nullptr: live
    std::function<void()> close = nullptr;           // ends the replay, back to cameras; nullptr: none
    // Replays the recording in this folder instead of live cameras, after the reply. nullptr: not possible.
    std::function<void(const std::filesystem::path& folder)> open_recording = nullptr;
    // By camera name: controls that are reachable from here.
    std::map<std::string, std::shared_ptr<capture::CameraControls>> cameras = {};
    // Reloads the saved configuration. Returns the reason of a failure, or an empty string.
    std::function<std::string()> reload = nullptr;
    // Restarts the session with the saved configuration, after the reply. nullptr: not possible.
    std::function<std::string()> restart = nullptr;
  };
  explicit ControlHandler(Actions actions) : actions_(std::move(actions)) {}

  msg::ControlReply answer(const msg::ControlRequest& request, const config::ServiceConfig& config) const;

  // Call it some times a second: continues long requests.
  void poll() const;

  // "record read", "record picture", "calibrate report": fast sequences of parts, which may be repeated.
  static bool is_read(const msg::ControlRequest& request);

 private:
  using Words = std::span<const std::string>;
  void record(Words words, const config::ServiceConfig& config, msg::ControlReply& reply) const;
  void calibrate(Words words, const config::ServiceConfig& config, msg::ControlReply& reply) const;
  void remove(const std::string& name, const config::RecordConfig& record, msg::ControlReply& reply) const;
  void target(Words words, const config::ServiceConfig& config, msg::ControlReply& reply) const;
  void camera(Words words, const config::ServiceConfig& config, msg::ControlReply& reply) const;
  void open(const std::string& name, const config::ServiceConfig& config, msg::ControlReply& reply) const;
  void replay(Words words, const config::ServiceConfig& config, msg::ControlReply& reply) const;
  void history(const std::string& word, const config::ServiceConfig& config, msg::ControlReply& reply) const;
  // Applies what was just saved. Returns a sentence, after a blank, if that is not immediate.
  std::string take_over(const config::ServiceConfig& config) const;
  double pre_roll_held_s() const;
  void reply_state(const config::RecordConfig& record, msg::ControlReply& reply) const;
  void list(const config::RecordConfig& record, msg::ControlReply& reply) const;
  void read(Words words, const config::RecordConfig& record, msg::ControlReply& reply) const;
  void picture(Words words, const config::RecordConfig& record, msg::ControlReply& reply) const;
  void show_config(const config::ServiceConfig& config, msg::ControlReply& reply) const;
  pipeline::RecordingKeeper& recording() const;  // throws std::runtime_error if there is none
  // The recording whose files are not complete yet; empty: none.
  std::string unfinished() const;
  void require_finished(const std::string& name) const;  // throws std::runtime_error

  const Actions actions_;
};

}  // namespace huetrack::page
