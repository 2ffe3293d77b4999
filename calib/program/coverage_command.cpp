// huetrack-calibrate coverage: what a recording of a board that is still being made lacks.
#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdio>
#include <memory>
#include <thread>

#include "calib/board/board_yaml.h"
#include "calib/gather/live_boards.h"
#include "calib/gather/picture_source.h"
#include "calib/program/commands.h"
#include "calib/yaml/yaml_reader.h"
#include "capture/growing_recording.h"

namespace huetrack::program {
namespace {

struct CoverageOptions {
  std::string recording, board;
  std::filesystem::path page;
  bool quiet = false;
};

// As soon as it says which frames it has: it may have been begun a moment ago. throws ConfigError: it does not, for
// long.
std::vector<capture::RecordedCamera> growing_cameras(const std::string& recording, const std::stop_token& stop) {
  constexpr std::chrono::milliseconds patience(20'000), look_again(100);
  for (const auto end = std::chrono::steady_clock::now() + patience;;) {
    try {
      return capture::read_recording(recording).cameras;
    } catch (const yaml::ConfigError&) {
      if (stop.stop_requested() || std::chrono::steady_clock::now() > end) throw;
    }
    std::this_thread::sleep_for(look_again);
  }
}

ExitStatus cover(const CoverageOptions& o, std::stop_token stop) {
  const board::BoardDetector detector(board::read_board(o.board));
  std::vector<gather::LiveCameraSource> cameras;
  for (const capture::RecordedCamera& camera : growing_cameras(o.recording, stop))
    cameras.push_back({camera.name, std::make_unique<capture::GrowingCamera>(camera, int(cameras.size())), {}});
  if (cameras.size() < 2) throw gather::InputError(o.recording + ": two cameras or more are needed");
  gather::LiveBoardsOptions options;
  options.until_enough = false;
  options.progress = !o.quiet;
  options.page = o.page;
  const gather::FoundBoards found = gather::gather_live(std::move(cameras), detector, options, stop);
  std::printf("%zu moments, of %d that were looked at\n", found.set_at_s.size(), found.sets_looked_at);
  return ExitStatus::usable;
}

}  // namespace

void add_coverage_command(CLI::App& app, Command& chosen) {
  const auto o = std::make_shared<CoverageOptions>();
  CLI::App* command = app.add_subcommand(
      "coverage", "tell what a recording of a board still lacks while it is being made, until Ctrl-C");
  command->add_option("recording", o->recording, "its folder")->required();
  command->add_option("--board", o->board, "the board file")->required();
  command->add_option("--view", o->page, "a page to open in a browser: what is detected, and what is missing");
  command->add_flag("--quiet", o->quiet, "no progress");
  command->callback([o, &chosen] { chosen = [o](const std::stop_token& stop) { return cover(*o, stop); }; });
}

}  // namespace huetrack::program
