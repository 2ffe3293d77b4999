// huetrack: the command-line client. It sees only what any DDS program can see.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <exception>
#include <functional>
#include <map>
#include <stdexcept>
#include <string>
#include <utility>

#include "calib/files/document_path.h"
#include "calib/files/text_file.h"
#include "calib/files/unknown_words.h"
#include "clients/bag/export.h"
#include "clients/live_view/view.h"
#include "clients/plot/plot.h"
#include "commands.h"
#include "control.h"
#include "idl/control_words.h"

namespace {

using namespace huetrack;
using namespace huetrack::client;

// Every command with its options; the one that was named says what to run.
struct CommandLine {
  CommandLine();

  CLI::App app{"huetrack: what a running huetrackd says over DDS, as text, files and a live page"};
  std::function<int()> run;  // throws std::exception of one readable line

 private:
  CLI::App& add(const char* name, const char* what_it_does, std::function<int()> runs);
  void add_bus(CLI::App& command);
  void add_samples(CLI::App& command);
  void add_watch();
  void add_log();
  void add_status();
  void add_view();
  void add_control();
  void add_plot();
  void add_export();
  int watch_or_log(std::string_view usual_format);

  idl::ParticipantOptions participant_{.name = "huetrack"};
  WatchOptions watch_;
  double timeout_s_ = 0;
  std::string format_, status_format_ = "text";
  live_view::LiveViewOptions view_;
  ControlOptions control_;
  plot::PlotOptions plot_;
  bag::BagOptions export_;
};

CommandLine::CommandLine() {
  app.set_version_flag("--version", "huetrack " HUETRACK_VERSION);
  app.require_subcommand(1);
  files::name_unknown_words(app, "huetrack", CLI::FailureMessage::simple);
  add_watch();
  add_log();
  add_status();
  add_view();
  add_control();
  add_plot();
  add_export();
}

CLI::App& CommandLine::add(const char* name, const char* what_it_does, std::function<int()> runs) {
  CLI::App* command = app.add_subcommand(name, what_it_does);
  command->callback([this, runs = std::move(runs)] { run = runs; });
  return *command;
}

void CommandLine::add_bus(CLI::App& command) {
  command.add_option("--domain", participant_.domain, "DDS domain, 0..232 (default: ROS_DOMAIN_ID, else 0)");
  command
      .add_option("--interface", participant_.interfaces,
                  "use only this network interface, and loopback: name or IPv4 address; may be repeated")
      ->allow_extra_args(false);
  command.add_option("--profiles", participant_.profiles, "Fast DDS XML profiles file");
}

void CommandLine::add_samples(CLI::App& command) {
  command.add_option("--target", watch_.target, "only this target with all its objects, or one object, as in ball_3");
  command.add_option("--camera", watch_.camera,
                     "poses of this tracked camera instead of positions; all: of all cameras");
  command.add_option("--count", watch_.count, "end after this number of lines")->check(CLI::Range(1, 1'000'000'000));
  command.add_option("--timeout", timeout_s_, "end with exit status 1 after this number of seconds without a line")
      ->check(CLI::Range(0.001, 1e9));
  add_bus(command);
}

int CommandLine::watch_or_log(std::string_view usual_format) {
  static const std::map<std::string, Format, std::less<>> formats{
      {"text", Format::text}, {"csv", Format::csv}, {"json", Format::json}, {"tum", Format::tum}, {"osc", Format::osc}};
  watch_.participant = participant_;
  if (timeout_s_ > 0) watch_.timeout = std::chrono::duration<double>(timeout_s_);
  watch_.format = formats.find(format_.empty() ? usual_format : format_)->second;
  if (watch_.format == Format::osc && watch_.udp.empty())
    throw std::runtime_error("--format osc needs a UDP receiver: --udp HOST:PORT");
  return watch(watch_);
}

void CommandLine::add_watch() {
  CLI::App& command = add("watch", "print every position (or camera pose), one line each",
                          [this] { return watch_or_log(watch_.udp.empty() ? "text" : "json"); });
  command
      .add_option("--format", format_,
                  "text (default), csv, json, tum (timestamp tx ty tz qx qy qz qw; of a camera only while its state is "
                  "tracking) or, with --udp, osc (Open Sound Control)")
      ->check(CLI::IsMember({"text", "csv", "json", "tum", "osc"}));
  command.add_option("--udp", watch_.udp,
                     "HOST:PORT: send each sample there as a datagram, as json (default), osc or another format, "
                     "instead of printing it");
  add_samples(command);
}

void CommandLine::add_log() {
  CLI::App& command =
      add("log", "write every position (or camera pose) to a CSV file", [this] { return watch_or_log("csv"); });
  command.add_option("file", watch_.file, "the CSV file")->required();
  command.add_flag("--overwrite", watch_.overwrite, "replace the file if it exists");
  add_samples(command);
}

void CommandLine::add_status() {
  CLI::App& command =
      add("status", "print the service's status; exit status 0: healthy, 3: problems, 1: no service",
          [this] { return status(participant_, status_format_ == "json" ? StatusFormat::json : StatusFormat::text); });
  command.add_option("--format", status_format_, "text or json: one object per service")
      ->check(CLI::IsMember({"text", "json"}))
      ->capture_default_str();
  add_bus(command);
}

void CommandLine::add_view() {
  CLI::App& command = add("view", "serve a live page for browsers on this host", [this] {
    view_.participant = participant_;
    return live_view::view(view_, has_ended);
  });
  command.add_option("--port", view_.server.port, "TCP port; 0: any free one")
      ->check(CLI::Range(0, 65535))
      ->capture_default_str();
  command.add_flag("--any-free-port", view_.server.or_any_free, "take another port if that one is in use");
  command
      .add_option("--address", view_.server.address,
                  "IPv4 address to listen on, 0.0.0.0: every one of this host. Any but 127.0.0.1 is open to the "
                  "network: then a token is part of the page's address")
      ->capture_default_str();
  command
      .add_option("--allow-origin", view_.server.allowed_origins,
                  "http://HOST:PORT of a web page of yours that may read positions here; may be repeated")
      ->allow_extra_args(false);
  add_bus(command);
}

void CommandLine::add_control() {
  CLI::App& command =
      add("control", "ask a running service: record, target, camera, calibrate, replay, undo, redo, history", [this] {
        control_.participant = participant_;
        return control(control_);
      });
  command.add_option("words", control_.words, "the request; see " + files::document_path("idl/README.md"))->required();
  command.add_option("--service", control_.service, "HOST/PID, if there are several services");
  command.add_option("--out", control_.out, "of a download: the tar file; -: stdout; default: NAME.tar");
  add_bus(command);
  // The shell's completion reads them (configs/service/completion.bash).
  std::string words = "The words:\n";
  for (const idl::ControlGroup& group : idl::control_groups)
    words += fmt::format("  {} {}\n", group.word, group.requests);
  words += "  record download NAME\n  calibrate report, print [KEY=VALUE ...]\n  undo\n  redo\n  history\n";
  command.footer(words);
}

void CommandLine::add_plot() {
  CLI::App& command = add("plot", "draw a track CSV: the track, its states, its uncertainty", [this] {
    plot::plot(plot_);
    return 0;
  });
  command.add_option("tracks", plot_.tracks, "CSV of `huetrackd replay --tracks` or `huetrack log`")->required();
  command.add_option("--truth", plot_.truth,
                     "CSV with columns ball or target, t, x, y, z; CSV of Motive or Vicon, TSV of Qualisys, TUM");
  command.add_option("--clock-offset", plot_.clock_offset_s, "seconds that the tracks' clock is ahead of the truth's");
  const std::map<std::string, truth::Freedom> freedoms{
      {"none", truth::Freedom::none}, {"rigid", truth::Freedom::rigid}, {"similarity", truth::Freedom::similarity}};
  command.add_option("--align", plot_.align, "first align the tracks with the truth; similarity: with a scale")
      ->transform(CLI::Transformer(freedoms).description(""))
      ->type_name("none|rigid|similarity");
  command.add_flag("--align-time", plot_.align_time, "first estimate the clock offset, as far as both overlap");
  command.add_option("--out", plot_.out, "FILE.png, FILE.svg or FILE.html (self-contained)")->required();
}

void CommandLine::add_export() {
  CLI::App& command =
      add("export", "turn a track CSV, or a recording's pictures, into a rosbag2 or an MCAP file", [this] {
        // An option of several words takes a track that follows it.
        const auto track = std::ranges::find_if(export_.pictures, [](const std::string& word) {
          return word.ends_with(".csv") && word.find('=') == std::string::npos;
        });
        if (export_.tracks.empty() && track != export_.pictures.end()) {
          export_.tracks = *track;
          export_.pictures.erase(track);
        }
        bag::export_track(export_);
        return 0;
      });
  command.add_option("tracks", export_.tracks, "CSV of `huetrackd replay --tracks` or `huetrack log`");
  command
      .add_option("--out", export_.out, "FILE.mcap, or a new folder for a rosbag2 (sqlite3); TUM: watch --format tum")
      ->required();
  command.add_option(
      "--pictures", export_.pictures,
      "a recording, or the cameras' videos, left=a.mp4 right=b.mp4: adds every frame as a CompressedImage, "
      "and its CameraInfo");
  command.add_option("--rig", export_.rig,
                     "rig file: the cameras' poses and lenses; default: rig.yaml in the recording's folder");
  command.add_option("--frame", export_.frame_id, "the world's name in the messages")->capture_default_str();
  command.add_option("--clock-offset", export_.clock_offset_s,
                     "seconds to add to all times; a replay has its recording's times");
}

}  // namespace

int main(int argc, char** argv) {
  end_on_signals();  // first: also ends a slow start
  CommandLine line;
  CLI11_PARSE(line.app, argc, argv);
  try {
    return line.run();
  } catch (const std::exception& error) {  // a wrong option or file, a full disk: said once, here
    std::fprintf(stderr, "huetrack: %s\n", files::printable(error.what(), files::longest_message).c_str());
    return 1;
  }
}
