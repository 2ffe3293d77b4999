// Calibrates the cameras while the service runs: it makes the recording that is calibrated from, huetrack-calibrate, as
// a process of its own, does the rest, and what came of it takes the place of the rig when somebody says so. Requests
// in words (idl/README.md, `calibrate`); one calibration at a time.
//
// A calibration is a recording in record.folder, named by its time and -board or -wave. Beside its films stand what was
// said of it: board.yaml, calibrated.yaml (the rig), calibrated.report.html, calibrated.log.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "config/service_config.h"
#include "idl/huetrack_view.h"
#include "page/child_process.h"
#include "pipeline/recording_keeper.h"

namespace huetrack::page {

// thread-compatible: one thread at a time. It outlives sessions, which may begin anew while it works.
class CalibrationSession {
 public:
  struct Options {
    // huetrack-calibrate; empty: found (find_program()).
    std::filesystem::path program = {};
    // What happened, a sentence; is_problem: that nothing came of it. May be empty.
    std::function<void(bool is_problem, const std::string& what)> log = nullptr;
    std::chrono::seconds longest_board{900};  // then it is ended as if somebody had said so: a disk is not endless
  };
  explicit CalibrationSession(Options options) : options_(std::move(options)) {}

  // The words that follow `calibrate`, but for accept. recording: of this session; nullptr: it has none. Fills rows and
  // reason. throws std::runtime_error of one readable line
  using Words = std::span<const std::string>;
  void answer(Words words, const config::ServiceConfig& config, pipeline::RecordingKeeper* recording,
              msg::ControlReply& reply);

  // `accept`: the rig that was found becomes a file beside the configuration, and the taught file names it. Gives that
  // file. throws std::runtime_error of one readable line: there is none, it is doubtful and words does not say so, or
  // the configuration does not hold with it; then nothing has changed.
  std::filesystem::path accept(Words words, const config::ServiceConfig& config);

  // Now and then, some times a second: hears what the other program says, and goes on with what is next.
  void look_after(pipeline::RecordingKeeper* recording);

  // The recording that is being made or calibrated from; empty: none.
  std::string busy_with() const { return is_busy() ? folder_.filename().string() : ""; }

 private:
  enum class Stage : std::uint8_t { idle, recording, closing, solving, usable, doubtful, failed, cancelled, accepted };
  enum class Kind : std::uint8_t { board, wave };
  struct CameraCoverage {
    std::string camera;
    std::vector<std::string> fields;  // as huetrack-calibrate tells them (calib/reference.md)
  };

  bool is_busy() const { return stage_ == Stage::recording || stage_ == Stage::closing || stage_ == Stage::solving; }
  void begin(Kind kind, const config::ServiceConfig& config);
  void begin_board(Words words, const config::ServiceConfig& config, pipeline::RecordingKeeper* recording,
                   msg::ControlReply& reply);
  void begin_wave(Words words, const config::ServiceConfig& config, pipeline::RecordingKeeper* recording,
                  msg::ControlReply& reply);
  void solve_again(Words words, const config::ServiceConfig& config, msg::ControlReply& reply);
  void read_print(Words words, msg::ControlReply& reply);
  void tell_state(const config::ServiceConfig& config, msg::ControlReply& reply) const;
  void read_report(Words words, msg::ControlReply& reply) const;
  void stop(pipeline::RecordingKeeper* recording, msg::ControlReply& reply);
  void cancel(pipeline::RecordingKeeper* recording, msg::ControlReply& reply);
  void start(std::vector<std::string> arguments);  // throws std::runtime_error
  void hear();
  void hear(const std::string& line);
  void look_at_recording(pipeline::RecordingKeeper* recording);
  void solve_when_closed(const pipeline::RecordingKeeper* recording);
  void take_result(const ChildProcess::Ended& ended);
  void end(Stage stage, const std::string& says);
  bool is_recorded_by(const pipeline::RecordingKeeper* recording) const;
  std::filesystem::path in_folder(const char* name) const { return folder_ / name; }
  std::filesystem::path program() const;  // throws std::runtime_error: there is none

  const Options options_;
  Stage stage_ = Stage::idle;
  Kind kind_ = Kind::board;
  std::filesystem::path program_, folder_, config_file_, rig_before_;  // rig_before_: empty: there was none
  std::string target_;                                                 // of a wave
  std::vector<std::string> camera_distance_;  // of a wave, if it was measured: two cameras and metres; else empty
  // A board to be printed: what was asked for, and its PDF.
  std::vector<std::string> printed_for_;
  std::vector<std::uint8_t> print_;
  bool has_board_ = false;  // its file is written, and what the recording lacks is being looked at
  std::optional<std::chrono::steady_clock::time_point> end_at_;  // of the recording
  std::chrono::steady_clock::time_point began_at_{}, asked_to_end_at_{};
  std::optional<ChildProcess> child_;
  std::string says_;       // how it stands, or what came of it; one sentence
  std::string last_line_;  // that the other program printed
  std::string step_, done_, total_, details_;
  std::vector<CameraCoverage> coverage_, coming_coverage_;  // coming_: until its last line
  std::vector<std::string> needs_, coming_needs_;
  std::string verdict_;  // a sentence
};

}  // namespace huetrack::page
