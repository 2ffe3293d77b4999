// Calibrates the cameras while the service runs: makes a recording, runs huetrack-calibrate on it as a child process,
// and replaces the rig on request. Requests in words (idl/README.md, `calibrate`); one calibration at a time.
//
// A calibration is a recording in record.folder, named by its time and -board or -wave. It also contains board.yaml,
// calibrated.yaml (the rig), calibrated.report.html and calibrated.log.
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
#include "config/taught_file.h"
#include "idl/huetrack_view.h"
#include "page/child_process.h"
#include "pipeline/recording_keeper.h"

namespace huetrack::page {

// thread-compatible. Outlives pipeline sessions, which may restart meanwhile.
class CalibrationSession {
 public:
  struct Options {
    // huetrack-calibrate; empty: find_program().
    std::filesystem::path program = {};
    // Logs events, one sentence; is_problem: it failed. May be empty.
    std::function<void(bool is_problem, const std::string& what)> log = nullptr;
    std::chrono::seconds longest_board{900};  // recordings end then, to limit disk usage
  };
  explicit CalibrationSession(Options options) : options_(std::move(options)) {}

  // Executes the words after `calibrate`, except accept. recording: of this session; nullptr: none. Fills rows and
  // reason. throws std::runtime_error with one readable line
  using Words = std::span<const std::string>;
  void answer(Words words, const config::ServiceConfig& config, pipeline::RecordingKeeper* recording,
              msg::ControlReply& reply);

  // `accept`: writes the new rig next to the configuration and refers to it in the taught file. Returns its path.
  // throws std::runtime_error with one readable line, and changes nothing, if there is no rig, it is doubtful and
  // `words` does not confirm that, or the configuration is invalid with it.
  std::filesystem::path accept(Words words, const config::ServiceConfig& config);

  // Call it some times a second: reads the child's output and starts the next step.
  void poll(pipeline::RecordingKeeper* recording);

  // The recording that is being made or used; empty: none.
  std::string busy_with() const { return is_busy() ? folder_.filename().string() : ""; }

 private:
  enum class Stage : std::uint8_t { idle, recording, closing, solving, usable, doubtful, failed, cancelled, accepted };
  enum class Kind : std::uint8_t { board, wave };
  struct CameraCoverage {
    std::string camera;
    std::vector<std::string> fields;  // of huetrack-calibrate (calib/reference.md)
  };

  bool is_busy() const { return stage_ == Stage::recording || stage_ == Stage::closing || stage_ == Stage::solving; }
  void begin(Kind kind, const config::ServiceConfig& config);
  void begin_board(Words words, const config::ServiceConfig& config, pipeline::RecordingKeeper* recording,
                   msg::ControlReply& reply);
  void begin_wave(Words words, const config::ServiceConfig& config, pipeline::RecordingKeeper* recording,
                  msg::ControlReply& reply);
  void solve_again(Words words, const config::ServiceConfig& config, msg::ControlReply& reply);
  void read_print(Words words, msg::ControlReply& reply);
  void reply_state(const config::ServiceConfig& config, msg::ControlReply& reply) const;
  void read_report(Words words, msg::ControlReply& reply) const;
  void stop(pipeline::RecordingKeeper* recording, msg::ControlReply& reply);
  void cancel(pipeline::RecordingKeeper* recording, msg::ControlReply& reply);
  void start(std::vector<std::string> arguments);  // throws std::runtime_error
  void read_output();
  void parse(const std::string& line);
  void check_recording(pipeline::RecordingKeeper* recording);
  void solve_when_closed(const pipeline::RecordingKeeper* recording);
  void take_result(const ChildProcess::Ended& ended);
  void end(Stage stage, const std::string& says);
  bool is_recorded_by(const pipeline::RecordingKeeper* recording) const;
  std::filesystem::path in_folder(const char* name) const { return folder_ / name; }
  std::filesystem::path program() const;  // throws std::runtime_error if not found

  const Options options_;
  Stage stage_ = Stage::idle;
  Kind kind_ = Kind::board;
  std::filesystem::path program_, folder_, config_file_, rig_before_;  // rig_before_: empty: none
  std::string target_;                                                 // of a wave
  std::vector<std::string> camera_distance_;           // of a wave: two cameras and metres; empty: not measured
  std::optional<config::CalibratedBy> calibrated_by_;  // of a wave that was solved
  // A board for printing: the request and its PDF.
  std::vector<std::string> printed_for_;
  std::vector<std::uint8_t> print_;
  bool has_board_ = false;  // its file is written, and the coverage is being analysed
  std::optional<std::chrono::steady_clock::time_point> end_at_;  // of the recording
  std::chrono::steady_clock::time_point began_at_{}, end_requested_at_{};
  std::optional<ChildProcess> child_;
  std::string says_;       // state or result; one sentence
  std::string last_line_;  // of the child's output
  std::string step_, done_, total_, details_;
  std::vector<CameraCoverage> coverage_, next_coverage_;  // next_: incomplete
  std::vector<std::string> needs_, next_needs_;
  std::string verdict_;  // a sentence
};

}  // namespace huetrack::page
