// huetrack-calibrate certify: how right lengths are in the volume, from a bar that was carried through it, or from
// marked places on which the ball was put; as the service's own trackers measure them.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <memory>
#include <thread>

#include "calib/certify/certificate.h"
#include "calib/gather/picture_source.h"
#include "calib/program/commands.h"
#include "calib/program/measured_points.h"
#include "calib/program/outcome.h"
#include "calib/report/certificate_report.h"
#include "calib/yaml/text_file.h"
#include "config/service_config.h"
#include "pipeline/session.h"
#include "recordings/recording.h"
#include "recordings/replay_source.h"
#include "tracks/track_csv.h"

namespace huetrack::program {
namespace {

struct CertifyOptions {
  std::string recording, config, tracks, places, report;
  std::vector<std::string> targets;
  double length_mm = 0, length_sigma_mm = 0.3, limit_mm = 0;
};

using Estimates = std::vector<object_tracking::ObjectEstimate>;

// What came of the recording, by target.
struct Tracked {
  std::map<std::string, Estimates> estimates;
  std::size_t sets = 0, incomplete = 0;  // 0: not known
  std::optional<double> set_ms;
};

class Collector final : public pipeline::Output {
 public:
  Collector(const std::vector<object_tracking::TargetOptions>& targets, Tracked& out) : targets_(targets), out_(out) {}
  void on_set(const pipeline::TrackedSet& set) override {
    ++out_.sets;
    const bool is_complete =
        std::ranges::all_of(set.frames.frames, [](const auto& frame) { return frame.has_value(); });
    out_.incomplete += is_complete ? 0 : 1;
    for (const auto& e : set.estimates)
      out_.estimates[object_tracking::object_name(targets_[e.target].name, e.object)].push_back(e);
  }

 private:
  const std::vector<object_tracking::TargetOptions>& targets_;
  Tracked& out_;
};

// The recording, through the service's own road.
Tracked tracked(const config::ServiceConfig& config, const std::string& file, const std::stop_token& stop) {
  const recordings::Recording recording = recordings::read_recording(file);
  for (const auto& warning : recording.warnings) std::printf("note: %s\n", warning.c_str());
  std::vector<std::string> names;
  for (const calib::Camera& camera : config.rig.cameras) names.push_back(camera.name);
  auto source = std::make_unique<recordings::ReplaySource>(
      recording, names,
      recordings::ReplayOptions{.decoder_threads = std::max(1, static_cast<int>(std::thread::hardware_concurrency())),
                                .timing = config::frame_timing(config.rig),
                                .takes_matches = true});
  pipeline::SessionSources sources;
  std::vector<pipeline::SessionCamera> known;
  for (const recordings::ReplayCamera& camera : source->cameras())
    known.push_back({.camera = static_cast<int>(known.size()),
                     .period = camera.frame_period,
                     .pixels = pipeline::SessionCamera::Pixels{camera.format, camera.range}});
  sources.cameras = [known] { return known; };
  sources.is_ascending = std::ranges::all_of(
      recording.cameras, [](const auto& camera) { return camera.received.empty() && camera.corrupted.empty(); });
  sources.sources.push_back(std::move(source));
  Tracked out;
  pipeline::Session session(config, std::move(sources), {});
  Collector collector(config.targets, out);
  session.add(collector);
  const auto began = std::chrono::steady_clock::now();
  session.run(stop);
  if (stop.stop_requested()) throw gather::InputError("stopped");
  const std::chrono::duration<double, std::milli> took = std::chrono::steady_clock::now() - began;
  if (out.sets > 0) out.set_ms = took.count() / static_cast<double>(out.sets);
  return out;
}

certify::BallTrack track_of(const Estimates& estimates) {
  certify::BallTrack track;
  for (const object_tracking::ObjectEstimate& e : estimates) {
    if (e.state != object_tracking::TrackState::tracking) continue;
    track.push_back({capture::seconds(e.at), e.position, e.velocity, e.covariance});
  }
  return track;
}

report::TargetTally tally_of(const std::string& name, const Estimates& estimates,
                             const std::vector<certify::Rest>& rests) {
  report::TargetTally tally{.name = name};
  std::optional<double> lost_at;
  bool is_found = false;
  for (const object_tracking::ObjectEstimate& e : estimates) {
    ++tally.sets;
    const double at = capture::seconds(e.at);
    if (e.state == object_tracking::TrackState::tracking) {
      ++tally.tracking;
      is_found = true;
      if (lost_at) tally.longest_gap_s = std::max(tally.longest_gap_s, at - *lost_at);
      lost_at.reset();
    } else if (is_found && !lost_at) {
      ++tally.gaps;
      lost_at = at;
    }
  }
  for (const certify::Rest& rest : rests) tally.rest_scatter_m += rest.scatter_m * rest.scatter_m;
  tally.rests = rests.size();
  if (!rests.empty()) tally.rest_scatter_m = std::sqrt(tally.rest_scatter_m / static_cast<double>(rests.size()));
  return tally;
}

// What each camera's time is known to be, after all of it was seen.
std::vector<std::pair<std::string, std::string>> times_of(const calib::CameraRig& rig, const Tracked& all) {
  std::vector<std::pair<std::string, std::string>> out;
  const Estimates* some = nullptr;
  for (const auto& [name, estimates] : all.estimates) {
    if (!estimates.empty() && !estimates.back().times.empty()) some = &estimates;
  }
  for (std::size_t c = 0; some != nullptr && c < rig.cameras.size(); ++c) {
    const object_tracking::CameraTimingEstimate& time = some->back().times[c];
    out.emplace_back(rig.cameras[c].name,
                     fmt::format("latency {:.1f} +- {:.1f} ms, readout {:.1f} +- {:.1f} ms, as the motion told",
                                 1e3 * time.latency_s, 1e3 * time.latency_sigma_s, 1e3 * time.readout_s,
                                 1e3 * time.readout_sigma_s));
  }
  return out;
}

// The targets that are asked for, of `count` that are needed.
std::vector<std::string> targets_of(const CertifyOptions& o, const config::ServiceConfig& config, std::size_t count) {
  std::vector<std::string> names = o.targets, known;
  for (const auto& target : config.targets) known.push_back(target.name);
  if (names.empty() && known.size() == count) names = known;
  const std::string all = fmt::to_string(fmt::join(known, ", "));
  if (names.size() != count)
    throw gather::InputError(
        fmt::format("say with --target which {} it is, of {}: {}", count == 1 ? "ball" : "two balls", o.config, all));
  for (const std::string& name : names) {
    if (std::ranges::find(known, name) == known.end())
      throw gather::InputError(o.config + " has no target " + name + ": it has " + all);
  }
  if (count == 2 && names[0] == names[1])
    throw gather::InputError("--target: the two balls of a bar are two targets, of two colours");
  return names;
}

ExitStatus certify_lengths(const CertifyOptions& o, const std::stop_token& stop) {
  if (o.recording.empty() == o.tracks.empty())
    throw gather::InputError("give a recording, or the tracks that huetrackd wrote of it (--tracks)");
  if ((o.length_mm > 0) == !o.places.empty())
    throw gather::InputError("give --length-mm of the bar, or --places with the file of the marked places");
  const config::ServiceConfig config = config::load_service_config(o.config);
  config::require_rig(config);
  const bool is_bar = o.length_mm > 0;
  const std::vector<std::string> names = targets_of(o, config, is_bar ? 2 : 1);
  Tracked all;
  if (o.tracks.empty()) {
    all = tracked(config, o.recording, stop);
  } else {
    all.estimates = tracks::read_track_csv(o.tracks);
  }
  report::CertificateInput input{.rig_name = yaml::printable(std::filesystem::path(o.config).filename().string()),
                                 .what = {}};
  std::vector<certify::BallTrack> tracks;
  std::vector<std::vector<certify::Rest>> rests;
  for (const std::string& name : names) {
    tracks.push_back(track_of(all.estimates[name]));
    rests.push_back(certify::rests_of(tracks.back()));
    input.targets.push_back(tally_of(name, all.estimates[name], rests.back()));
    if (tracks.back().empty()) throw gather::InputError(name + " is never tracked: there is nothing to certify");
  }
  std::vector<certify::MeasuredLength> lengths;
  std::size_t independent = 1'000'000;
  if (is_bar) {
    input.what = fmt::format("a bar of {:.2f} mm between {} and {}", o.length_mm, names[0], names[1]);
    lengths = certify::bar_lengths(tracks[0], tracks[1], o.length_mm / 1e3, config.rig);
  } else {
    const auto places = read_places(o.places);
    const auto visits = certify::visits_of(rests[0], places);
    input.what = fmt::format("{} visits of {} marked places by {}", visits.size(), places.size(), names[0]);
    lengths = certify::place_lengths(visits, places, config.rig);
    independent = visits.size();  // all lengths are made of these places
  }
  if (lengths.empty())
    throw gather::InputError(is_bar ? "the two balls are never tracked at one moment"
                                    : "the ball never rests at two of the places: 0.5 s at each, within a third of the "
                                      "way to the next place");
  const certify::Certificate certificate = certify::certificate_of(lengths, o.length_sigma_mm / 1e3, independent);
  if (o.limit_mm > 0) input.limit_m = o.limit_mm / 1e3;
  input.cameras = times_of(config.rig, all);
  input.set_ms = all.set_ms;
  input.has_incomplete_sets = all.sets > 0;
  if (all.sets > 0) input.incomplete_share = static_cast<double>(all.incomplete) / static_cast<double>(all.sets);
  input.made_of = {{"tool", "huetrack-calibrate " HUETRACK_VERSION},
                   {"input", o.tracks.empty() ? o.recording : o.tracks},
                   {"configuration", o.config},
                   {"configuration's identity", config::config_identity(config)}};
  if (config.rig.made.at) input.made_of.emplace_back("rig made", calib::utc_text(*config.rig.made.at));
  const report::CertificateReport report = report::report_on(certificate, lengths, config.rig, input);
  std::fputs(report::to_text(report.document).c_str(), stdout);
  if (!o.report.empty()) write_document(report.document, o.report);
  return status_of(report.verdict);
}

}  // namespace

void add_certify_command(CLI::App& app, Command& chosen) {
  const auto o = std::make_shared<CertifyOptions>();
  CLI::App* command = app.add_subcommand(
      "certify", "how right lengths are in the volume: from a bar with two balls, or from marked places");
  command->add_option("recording", o->recording, "recording.yaml, or the folder that holds it");
  command->add_option("--config", o->config, "huetrackd.yaml: rig, targets, and how they are tracked")->required();
  command->add_option("--tracks", o->tracks, "instead of the recording: the CSV that huetrackd replay --tracks wrote");
  command->add_option("--target", o->targets, "a ball, again for the bar's other one; default: all targets there are");
  command->add_option("--length-mm", o->length_mm, "the bar's length, from middle to middle of its balls")
      ->check(CLI::PositiveNumber);
  command->add_option("--length-sigma-mm", o->length_sigma_mm, "how well it (or the places) is known (default 0.3)")
      ->check(CLI::NonNegativeNumber);
  command->add_option("--places", o->places,
                      "a file of marked places on which the one ball was put; see calib/formats.md");
  command->add_option("--limit-mm", o->limit_mm, "PASS or FAIL: what the expanded uncertainty (95 %) must not exceed")
      ->check(CLI::PositiveNumber);
  command->add_option("--report", o->report, "write it with pictures: NAME.html, and NAME.pdf beside it");
  command->callback([o, &chosen] { chosen = [o](const std::stop_token& stop) { return certify_lengths(*o, stop); }; });
}

}  // namespace huetrack::program
