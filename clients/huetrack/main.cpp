// huetrack: the command-line client. It sees only what any DDS program can see.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <map>
#include <string>

#include "calib/yaml/text_file.h"
#include "calib/yaml/unknown_command.h"
#include "clients/bag/export.h"
#include "clients/live_view/view.h"
#include "clients/plot/plot.h"
#include "commands.h"
#include "control.h"

int main(int argc, char** argv) {
  using namespace huetrack::client;
  end_on_signals();  // first of all: whoever ends it early is answered, too
  CLI::App app("huetrack: what a running huetrackd says over DDS, as text, files and a live page");
  app.set_version_flag("--version", "huetrack " HUETRACK_VERSION);
  app.require_subcommand(1);
  huetrack::yaml::name_unknown_commands(app, "huetrack", CLI::FailureMessage::simple);
  WatchOptions options;
  options.participant.name = "huetrack";

  const auto add_bus = [&](CLI::App* command) {
    command->add_option("--domain", options.participant.domain, "DDS domain, 0..232 (default: ROS_DOMAIN_ID, else 0)");
    command
        ->add_option("--interface", options.participant.interfaces,
                     "use only this network interface, and loopback: name or IPv4 address; may be repeated")
        ->allow_extra_args(false);
    command->add_option("--profiles", options.participant.profiles, "Fast DDS XML profiles file");
  };
  double timeout_s = 0;
  const auto add_samples = [&](CLI::App* command) {
    command->add_option("--target", options.target,
                        "only this target, with all its objects; or one of these, as in ball_3");
    command->add_option("--camera", options.camera,
                        "the pose of this tracked camera instead of positions; all: of every one");
    command->add_option("--count", options.count, "end after so many lines")->check(CLI::Range(1, 1'000'000'000));
    command->add_option("--timeout", timeout_s, "end with exit status 1 when no line came for so many seconds")
        ->check(CLI::Range(0.001, 1e9));
    add_bus(command);
  };

  CLI::App* watch_command = app.add_subcommand("watch", "print every position (or camera pose), one line each");
  const std::map<std::string, Format> formats{
      {"text", Format::text}, {"csv", Format::csv}, {"json", Format::json}, {"tum", Format::tum}, {"osc", Format::osc}};
  std::string format;
  watch_command
      ->add_option(
          "--format", format,
          "text (default), csv, json, tum (timestamp tx ty tz qx qy qz qw; of a camera only while its state is "
          "tracking) or, with --udp, osc (Open Sound Control)")
      ->check(CLI::IsMember({"text", "csv", "json", "tum", "osc"}));
  watch_command->add_option(
      "--udp", options.udp,
      "HOST:PORT: send each sample there as a datagram, as json (default) or osc, instead of printing it");
  add_samples(watch_command);

  CLI::App* log_command = app.add_subcommand("log", "write every position (or camera pose) to a CSV file");
  log_command->add_option("file", options.file, "the CSV file")->required();
  log_command->add_flag("--overwrite", options.overwrite, "replace the file if it exists");
  add_samples(log_command);

  CLI::App* status_command = app.add_subcommand(
      "status", "print what the service says about itself; exit status 0: well, 3: not well, 1: there is none");
  std::string status_format = "text";
  status_command->add_option("--format", status_format, "text or json: one object per service")
      ->check(CLI::IsMember({"text", "json"}))
      ->capture_default_str();
  add_bus(status_command);

  huetrack::live_view::ViewOptions view;
  CLI::App* view_command = app.add_subcommand("view", "serve a live page for browsers on this host");
  view_command->add_option("--port", view.server.port, "to listen on; 0: any free one")
      ->check(CLI::Range(0, 65535))
      ->capture_default_str();
  view_command
      ->add_option("--address", view.server.address,
                   "IPv4 address to listen on, 0.0.0.0: every one of this host. Any but 127.0.0.1 is open to the "
                   "network: then a token is part of the page's address")
      ->capture_default_str();
  view_command
      ->add_option("--allow-origin", view.server.allowed_origins,
                   "http://HOST:PORT of a web page of yours that may read positions here; may be repeated")
      ->allow_extra_args(false);
  add_bus(view_command);

  ControlOptions control_options;
  CLI::App* control_command =
      app.add_subcommand("control", "ask a running service: record state|start|stop|save|list, record download NAME");
  control_command->add_option("words", control_options.words, "what is asked; idl/README.md lists it")->required();
  control_command->add_option("--service", control_options.service, "HOST/PID, where there are several");
  control_command->add_option("--out", control_options.out,
                              "of a download: the tar file; -: stdout; default: NAME.tar");
  add_bus(control_command);

  huetrack::plot::PlotOptions plot;
  CLI::App* plot_command = app.add_subcommand("plot", "draw a track CSV: the track, its states, its uncertainty");
  plot_command->add_option("tracks", plot.tracks, "CSV of `huetrackd replay --tracks` or `huetrack log`")->required();
  plot_command->add_option("--truth", plot.truth, "CSV with columns ball or target, t, x, y, z");
  plot_command->add_option("--clock-offset", plot.clock_offset_s,
                           "seconds that the tracks' clock is ahead of the truth's");
  plot_command->add_option("--out", plot.out, "FILE.png, FILE.svg or FILE.html (one file that needs no other)")
      ->required();

  huetrack::bag::ExportOptions bag;
  CLI::App* export_command =
      app.add_subcommand("export", "turn a track CSV into a rosbag2 or an MCAP file, for ROS 2 and its tools");
  export_command->add_option("tracks", bag.tracks, "CSV of `huetrackd replay --tracks` or `huetrack log`")->required();
  export_command->add_option("--out", bag.out, "FILE.mcap, or a new folder for a rosbag2 (sqlite3)")->required();
  export_command->add_option("--frame", bag.frame_id, "the world's name in the messages")->capture_default_str();
  export_command->add_option("--clock-offset", bag.clock_offset_s,
                             "seconds to add to every time: a replay's are its recording's own");

  CLI11_PARSE(app, argc, argv);

  if (timeout_s > 0) options.timeout = std::chrono::duration<double>(timeout_s);
  try {
    if (status_command->parsed())
      return status(options.participant, status_format == "json" ? StatusFormat::json : StatusFormat::text);
    if (control_command->parsed()) {
      control_options.participant = options.participant;
      return control(control_options);
    }
    if (plot_command->parsed()) {
      huetrack::plot::plot(plot);
      return 0;
    }
    if (export_command->parsed()) {
      huetrack::bag::export_track(bag);
      return 0;
    }
    if (view_command->parsed()) {
      view.participant = options.participant;
      return huetrack::live_view::view(view, has_ended);
    }
    if (format.empty()) format = log_command->parsed() ? "csv" : options.udp.empty() ? "text" : "json";
    options.format = formats.at(format);
    if (options.format == Format::osc && options.udp.empty())
      throw std::runtime_error("--format osc is for programs, by UDP: say where to with --udp HOST:PORT");
    return watch(options);
  } catch (const std::exception& error) {  // a wrong option or file, a full disk: said once, here
    std::fprintf(stderr, "huetrack: %s\n",
                 huetrack::yaml::printable(error.what(), huetrack::yaml::longest_message).c_str());
    return 1;
  }
}
