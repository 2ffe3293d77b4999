// huetrack-calibrate coverage: what a recording that is still being made lacks, of a board or of a ball that is waved.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdio>
#include <memory>
#include <mutex>
#include <thread>

#include "calib/board/board_yaml.h"
#include "calib/gather/live_boards.h"
#include "calib/gather/picture_source.h"
#include "calib/gather/progress_line.h"
#include "calib/program/commands.h"
#include "calib/program/waved_ball.h"
#include "calib/wave/wave_coverage.h"
#include "calib/yaml/yaml_reader.h"
#include "recordings/growing_recording.h"

namespace huetrack::program {
namespace {

struct CoverageOptions {
  std::string recording, board, config;
  std::vector<std::string> targets;
  std::filesystem::path page;
  bool quiet = false;
};

// As soon as it says which frames it has: it may have been begun a moment ago. throws ConfigError: it does not, for
// long.
std::vector<recordings::RecordedCamera> growing_cameras(const std::string& recording, const std::stop_token& stop) {
  constexpr std::chrono::milliseconds patience(20'000), look_again(100);
  for (const auto end = std::chrono::steady_clock::now() + patience;;) {
    try {
      return recordings::read_recording(recording).cameras;
    } catch (const yaml::ConfigError&) {
      if (stop.stop_requested() || std::chrono::steady_clock::now() > end) throw;
    }
    std::this_thread::sleep_for(look_again);
  }
}

// The program that shows it: what each camera has, all that is missing, and then the status, which ends it.
void tell(const wave::WaveCoverage& coverage, const calib::CameraRig& rig, gather::ProgressLine& line, int seconds) {
  const std::vector<std::string> needs = coverage.needs();
  if (!gather::ProgressLine::tells_programs()) {
    line.show("wave the ball", seconds, std::nullopt, needs.empty() ? "enough" : needs.front());
    return;
  }
  const std::vector<wave::WaveCoverage::OfCamera> cameras = coverage.cameras();
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    const wave::WaveCoverage::OfCamera& of = cameras[c];
    gather::tell_program(
        "coverage",
        {rig.cameras[c].name, std::to_string(of.sightings), std::to_string(wave::WaveCoverage::enough_sightings),
         fmt::format("{:.0f}", 100 * of.image_share()), fmt::format("{:.0f}", 100 * wave::WaveCoverage::enough_image),
         fmt::to_string(fmt::join(of.parts, ",")), "", of.is_seen_now ? "it is seen" : "it is not seen now"});
  }
  for (const std::string& need : needs) gather::tell_program("need", {need});
  line.show("wave the ball", seconds, std::nullopt, "");
}

// Every camera has its own thread, as its next frame is waited for.
ExitStatus cover_wave(const CoverageOptions& o, const std::stop_token& stop) {
  WavedOptions waved;
  waved.recording = o.recording;
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
      if (line.due()) tell(coverage, in.rig, line, int(newest_s));
    }
  }
  line.clear();
  std::printf("%s\n", coverage.text().c_str());
  return ExitStatus::usable;
}

ExitStatus cover(const CoverageOptions& o, std::stop_token stop) {
  if (o.board.empty() == o.config.empty())
    throw gather::InputError("give --board, or --config for a ball that is waved");
  if (!o.config.empty()) return cover_wave(o, stop);
  const board::BoardDetector detector(board::read_board(o.board));
  std::vector<gather::LiveCameraSource> cameras;
  for (const recordings::RecordedCamera& camera : growing_cameras(o.recording, stop))
    cameras.push_back({camera.name, std::make_unique<recordings::GrowingCamera>(camera, int(cameras.size())), {}});
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
      "coverage", "tell what a recording of a board, or of a waved ball, still lacks while it is made, until Ctrl-C");
  command->add_option("recording", o->recording, "its folder")->required();
  command->add_option("--board", o->board, "the board file");
  command->add_option("--config", o->config, "huetrackd.yaml: a ball is waved, of its targets");
  command->add_option("--target", o->targets, "which of its targets is waved");
  command->add_option("--view", o->page, "a page to open in a browser: what is detected, and what is missing");
  command->add_flag("--quiet", o->quiet, "no progress");
  command->callback([o, &chosen] { chosen = [o](const std::stop_token& stop) { return cover(*o, stop); }; });
}

}  // namespace huetrack::program
