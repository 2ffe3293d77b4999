// Answers what pages and `huetrack control` ask in words: idl/README.md lists them. A request is checked here, word by
// word, before anything is done; whoever may not ask is told why.
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

// thread-compatible; the page service's thread owns it.
class ControlHandler {
 public:
  struct Actions {
    pipeline::RecordingKeeper* recording =
        nullptr;                             // outlives the desk; nullptr: nothing can be recorded, as of a replay
    CalibrationSession* calibration = nullptr;  // outlives the desk; nullptr: nothing can be calibrated
    Playback* playback = nullptr;            // of a replay that can be held and stepped through; outlives the desk
    std::function<void()> close = nullptr;   // of such a replay: the cameras again; nullptr: there are none
    // Of live cameras: the recording in this folder is replayed instead, after the answer is out. nullptr: it cannot
    // be.
    std::function<void(const std::filesystem::path& folder)> open_recording = nullptr;
    // By the camera's name: those that are reached from here.
    std::map<std::string, std::shared_ptr<capture::CameraControls>> cameras = {};
    // What was written stands in its file: take it over. Returns why that did not work, or an empty string.
    std::function<std::string()> reload = nullptr;
    // What was written needs a session of its own: it begins after the answer is out. nullptr: only a restart does.
    std::function<std::string()> begin_anew = nullptr;
  };
  explicit ControlHandler(Actions actions) : actions_(std::move(actions)) {}

  msg::ControlReply answer(const msg::ControlRequest& request, const config::ServiceConfig& config) const;

  // Now and then, some times a second: what was asked for and takes its time goes on.
  void look_after() const;

  // "record read", "calibrate report": pieces follow each other quickly, and each can be asked for again.
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
  // What was just written is taken over; where that is not at once, when it is, as a sentence after a blank.
  std::string take_over(const config::ServiceConfig& config) const;
  void tell_state(const config::RecordConfig& record, msg::ControlReply& reply) const;
  void list(const config::RecordConfig& record, msg::ControlReply& reply) const;
  void read(Words words, const config::RecordConfig& record, msg::ControlReply& reply) const;
  pipeline::RecordingKeeper& recording() const;  // throws std::runtime_error: there is none
  // The recording that is being written, or whose files are not closed yet; empty: none.
  std::string unfinished() const;
  void require_finished(const std::string& name) const;  // throws std::runtime_error

  const Actions actions_;
};

}  // namespace huetrack::page
