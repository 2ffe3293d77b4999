// huetrack-calibrate coverage: what a running recording of a board or a waved ball still lacks.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdio>
#include <memory>
#include <mutex>
#include <thread>

#include "calib/board/board_yaml.h"
#include "calib/files/config_error.h"
#include "calib/gather/live_boards.h"
#include "calib/gather/picture_source.h"
#include "calib/gather/progress_line.h"
#include "calib/program/commands.h"
#include "calib/program/waved_ball.h"
#include "calib/wave/wave_coverage.h"
#include "recordings/growing_recording.h"

namespace huetrack::program {
namespace {

struct CoverageOptions {
  std::string recording, board, config;
  std::vector<std::string> targets;
  std::filesystem::path page;
  bool quiet = false;
};

// Waits until a recording that was just started is readable. throws files::ConfigError: timeout.
std::vector<recordings::RecordedCamera> growing_cameras(const std::string& recording, const std::stop_token& stop) {
  constexpr std::chrono::milliseconds patience(20'000), look_again(100);
  for (const auto end = std::chrono::steady_clock::now() + patience;;) {
    try {
      return recordings::read_recording(recording).cameras;
    } catch (const files::ConfigError&) {
      if (stop.stop_requested() || std::chrono::steady_clock::now() > end) throw;
    }
    std::this_thread::sleep_for(look_again);
  }
}

// For a calling program: the counts of each camera, all needs, and the status, which ends the message.
void send(const wave::WaveCoverage& coverage, const calib::CameraRig& rig, gather::ProgressLine& line, int seconds) {
  const std::vector<std::string> needs = coverage.needs();
  if (!gather::ProgressLine::is_machine_readable()) {
    line.show("wave the ball", seconds, std::nullopt, needs.empty() ? "enough" : needs.front());
    return;
  }
  const std::vector<wave::WaveCoverage::OfCamera> cameras = coverage.cameras();
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    const wave::WaveCoverage::OfCamera& of = cameras[c];
    gather::send_to_program(
        "coverage",
        {rig.cameras[c].name, std::to_string(of.sightings), std::to_string(wave::WaveCoverage::enough_sightings),
         fmt::format("{:.0f}", 100 * of.image_share()), fmt::format("{:.0f}", 100 * wave::WaveCoverage::enough_image),
         fmt::to_string(fmt::join(of.parts, ",")), "", of.is_seen_now ? "it is seen" : "it is not seen now"});
  }
  for (const std::string& need : needs) gather::send_to_program("need", {need});
  line.show("wave the ball", seconds, std::nullopt, "");
}

// One thread per camera, because reading waits for the next frame.
ExitStatus cover_wave(const CoverageOptions& o, const std::stop_token& stop) {
  WavedOptions waved;
  waved.config = o.config;
  waved.targets = o.targets;
  const WavedInput in = configured_input(waved);
  const std::vector<recordings::RecordedCamera> recorded = growing_cameras(o.recording, stop);
  std::mutex mutex;
  wave::WaveCoverage coverage(in.rig);  // guarded by mutex
  double newest_s = 0;                  // guarded by mutex
  gather::ProgressLine line(!o.quiet);
  {
    std::vector<std::jthread> threads;
    for (const recordings::RecordedCamera& camera : recorded) {
      const auto index = in.rig.index_of(camera.name);
      if (!index) continue;
      threads.emplace_back([&, camera, c = *index] {
        recordings::GrowingCamera source(camera, c);
        std::vector<std::unique_ptr<wave::BallFinder>> finders;
        for (const auto& target : in.targets) finders.push_back(std::make_unique<wave::BallFinder>(in.rig, target));
        while (const auto frame = source.next(stop)) {
          for (std::size_t ball = 0; ball < finders.size(); ++ball) {
            const auto found = finders[ball]->detect(*frame);
            if (!found) continue;
            const std::lock_guard lock(mutex);
            coverage.add(*found, ball);
            newest_s = std::max(newest_s, found->t_s);
          }
        }
      });
    }
    while (!stop.stop_requested()) {
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
      const std::lock_guard lock(mutex);
      if (line.due()) send(coverage, in.rig, line, int(newest_s));
    }
  }
  line.clear();
  std::printf("%s\n", coverage.text().c_str());
  return ExitStatus::usable;
}

ExitStatus cover(const CoverageOptions& o, std::stop_token stop) {
  if (o.board.empty() == o.config.empty()) throw gather::InputError("give --board, or --config for a waved ball");
  if (!o.config.empty()) return cover_wave(o, stop);
  const board::BoardDetector detector(board::read_board(o.board));
  std::vector<gather::LiveCameraSource> cameras;
  for (const recordings::RecordedCamera& camera : growing_cameras(o.recording, stop))
    cameras.push_back({camera.name, std::make_unique<recordings::GrowingCamera>(camera, int(cameras.size())), {}});
  if (cameras.size() < 2) throw gather::InputError(o.recording + ": at least two cameras are needed");
  gather::LiveBoardsOptions options;
  options.until_enough = false;
  options.progress = !o.quiet;
  options.page = o.page;
  const gather::FoundBoards found = gather::gather_live(std::move(cameras), detector, options, stop);
  std::printf("%zu frame sets kept of %d processed\n", found.set_at_s.size(), found.sets_looked_at);
  return ExitStatus::usable;
}

}  // namespace

void add_coverage_command(CLI::App& app, Command& chosen) {
  const auto o = std::make_shared<CoverageOptions>();
  CLI::App* command = app.add_subcommand(
      "coverage", "show what a running recording of a board or a waved ball still lacks, until Ctrl-C");
  command->add_option("recording", o->recording, "its folder")->required();
  command->add_option("--board", o->board, "the board file");
  command->add_option("--config", o->config, "huetrackd.yaml, for a waved ball");
  command->add_option("--target", o->targets, "the waved target");
  command->add_option("--view", o->page, "write a page for a browser with the detections and what is still missing");
  command->add_flag("--quiet", o->quiet, "no progress");
  command->callback([o, &chosen] { chosen = [o](const std::stop_token& stop) { return cover(*o, stop); }; });
}

}  // namespace huetrack::program
