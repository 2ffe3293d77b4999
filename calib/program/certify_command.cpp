// huetrack-calibrate certify: accuracy of lengths in the volume as the service's trackers measure them, from a bar
// carried through it, or from marked places for a ball.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>

#include "calib/certify/certificate.h"
#include "calib/files/document_path.h"
#include "calib/files/number_text.h"
#include "calib/files/text_file.h"
#include "calib/gather/picture_source.h"
#include "calib/program/commands.h"
#include "calib/program/measured_points.h"
#include "calib/program/outcome.h"
#include "calib/program/tracked_recording.h"
#include "calib/report/certificate_report.h"
#include "config/service_config.h"
#include "tracks/track_csv.h"

namespace huetrack::program {
namespace {

struct CertifyOptions {
  std::string recording, config, tracks, places, report;
  std::vector<std::string> targets;
  double length_mm = 0, length_sigma_mm = 0.3, limit_mm = 0;
};

certify::BallTrack track_of(const Estimates& estimates) {
  certify::BallTrack track;
  for (const object_tracking::ObjectEstimate& e : estimates) {
    if (e.state != object_tracking::TrackState::tracking) continue;
    track.push_back({e.set_number, capture::seconds(e.at), e.position, e.velocity, e.covariance});
  }
  return track;
}

struct TrackedSet {
  double at_s = 0;
  bool is_tracked = false;
};

// frame_sets: one entry per frame set.
report::TargetTally tally_of(const std::string& name, const std::vector<TrackedSet>& frame_sets,
                             const std::vector<certify::Rest>& rests) {
  report::TargetTally tally{.name = name, .sets = frame_sets.size()};
  std::optional<double> lost_s;
  const auto end_gap = [&](double at_s) {
    if (lost_s) tally.longest_gap_s = std::max(tally.longest_gap_s, at_s - *lost_s);
    lost_s.reset();
  };
  for (const TrackedSet& of_set : frame_sets) {
    if (of_set.is_tracked) {
      ++tally.tracking;
      end_gap(of_set.at_s);
    } else if (tally.tracking > 0 && !lost_s) {
      ++tally.gaps;
      lost_s = of_set.at_s;
    }
  }
  if (lost_s) end_gap(frame_sets.back().at_s);
  tally.rests = rests.size();
  for (const certify::Rest& rest : rests) tally.rest_scatter_m += rest.scatter_m * rest.scatter_m;
  if (!rests.empty()) tally.rest_scatter_m = std::sqrt(tally.rest_scatter_m / static_cast<double>(rests.size()));
  return tally;
}

// Each camera's timing after the whole recording.
std::vector<std::pair<std::string, std::string>> times_of(const calib::CameraRig& rig, const Tracked& all) {
  std::vector<std::pair<std::string, std::string>> out;
  const Estimates* some = nullptr;
  for (const auto& [name, estimates] : all.estimates) {
    if (estimates.empty() || estimates.back().times.empty()) continue;
    if (some == nullptr || some->back().at < estimates.back().at) some = &estimates;
  }
  for (std::size_t c = 0; some != nullptr && c < rig.cameras.size(); ++c) {
    const object_tracking::CameraTimingEstimate& time = some->back().times[c];
    out.emplace_back(
        rig.cameras[c].name,
        fmt::format("latency {:.1f} +- {:.1f} ms, readout {:.1f} +- {:.1f} ms, from the motion", 1e3 * time.latency_s,
                    1e3 * time.latency_sigma_s, 1e3 * time.readout_s, 1e3 * time.readout_sigma_s));
  }
  return out;
}

// The targets to measure.
struct Ends {
  std::vector<std::string> targets;
  bool is_one_color = false;  // both balls of a bar are objects of one target
};

const object_tracking::TargetOptions& target_of(const config::ServiceConfig& config, const std::string& file,
                                                const std::string& name) {
  const auto target = std::ranges::find(config.targets, name, &object_tracking::TargetOptions::name);
  if (target != config.targets.end()) return *target;
  throw gather::InputError(
      fmt::format("{} has no target {}: it has {}", file, name, fmt::join(config.target_names(), ", ")));
}

void require_one_object(const object_tracking::TargetOptions& target, const std::string& file, std::string_view why) {
  if (target.count > 1)
    throw gather::InputError(
        fmt::format("{}: {} has count: {}, but {}: set count: 1, or omit it", file, target.name, target.count, why));
}

Ends ends_of(const CertifyOptions& o, const config::ServiceConfig& config, bool is_bar) {
  // Those of the configuration if none was named and there is no choice.
  Ends ends{.targets = o.targets.empty() ? config.target_names() : o.targets};
  const std::size_t given = ends.targets.size();
  if (given == 0 || given > (is_bar ? 2 : 1))
    throw gather::InputError(fmt::format("choose with --target the {} of {}: {}",
                                         is_bar ? "two balls (or which one, if both have its colour)" : "ball",
                                         o.config, fmt::join(config.target_names(), ", ")));
  const object_tracking::TargetOptions& first = target_of(config, o.config, ends.targets[0]);
  if (!is_bar) {
    require_one_object(first, o.config, "one ball is put on marked places");
  } else if (given == 1) {
    if (first.count != 2)
      throw gather::InputError(
          fmt::format("{0}: {1} has count: {2}, and a bar has two balls: if both have its colour, count: 2; if not, "
                      "name the other one's target, too (--target {1} --target OTHER)",
                      o.config, first.name, first.count));
    ends.is_one_color = true;
  } else if (ends.targets[0] == ends.targets[1]) {
    throw gather::InputError(fmt::format(
        "--target: {0} is given twice. A bar with two balls of its colour is --target {0}, once, with count: 2 in {1}",
        ends.targets[0], o.config));
  } else {
    for (const std::string& name : ends.targets)
      require_one_object(
          target_of(config, o.config, name), o.config,
          "two targets are for a bar with two colours (for one colour name only one: --target " + name + ")");
  }
  return ends;
}

// The measured lengths, and facts for the report.
struct Measured {
  std::vector<certify::MeasuredLength> lengths;
  std::size_t most_independent = 1'000'000;
};

std::string why_no_length(const report::OneColorTally& tally, const std::string& target) {
  if (!tally.bar.others.empty())
    return fmt::format(
        "the two objects of {} are {:.0f} to {:.0f} mm apart, but the bar has {:.0f} mm: is --length-mm right (between "
        "the centres of its balls), and is nothing else of that colour in the room?",
        target, 1e3 * tally.bar.others.front().least_m, 1e3 * tally.bar.others.front().most_m, 1e3 * tally.length_m);
  if (tally.bar.with_third > 0)
    return "there is a third object of the colour of " + target + " throughout: remove it and record anew";
  if (tally.bar.only_one > 0)
    return "two objects of " + target + " are never tracked at the same time: there is no length";
  return target + " is never tracked: there is nothing to certify";
}

Measured measured_one_color(const CertifyOptions& o, const config::ServiceConfig& config, const std::string& target,
                            const Tracked& all, report::CertificateInput& input) {
  std::vector<certify::BallTrack> tracks;
  std::vector<certify::Rest> rests;
  std::map<std::uint64_t, TrackedSet> frame_sets;
  for (const auto& [name, estimates] : all.estimates) {
    if (name != target && !files::is_object_of(name, target)) continue;
    for (const auto& e : estimates) frame_sets.try_emplace(e.set_number, TrackedSet{.at_s = capture::seconds(e.at)});
    tracks.push_back(track_of(estimates));
    const auto of_track = certify::rests_of(tracks.back());
    rests.insert(rests.end(), of_track.begin(), of_track.end());
  }
  const auto further = all.further.find(target);
  report::OneColorTally tally{.length_m = o.length_mm / 1e3, .sets = frame_sets.size()};
  tally.bar = certify::one_color_bar(tracks, further == all.further.end() ? std::set<std::uint64_t>{} : further->second,
                                     tally.length_m, config.rig);
  if (!frame_sets.empty()) tally.began_s = frame_sets.begin()->second.at_s;
  for (const certify::MeasuredLength& length : tally.bar.lengths) frame_sets[length.set].is_tracked = true;
  std::vector<TrackedSet> by_set;
  for (const auto& [set, of_set] : frame_sets) by_set.push_back(of_set);
  input.targets.push_back(tally_of(target + ", both", by_set, rests));
  input.what = fmt::format("a bar of {:.2f} mm between two balls, both {}", o.length_mm, target);
  input.one_color = tally;
  if (tally.bar.lengths.empty()) throw gather::InputError(why_no_length(tally, target));
  return {tally.bar.lengths};
}

// A bar of two colours, or one ball.
Measured measured_by_color(const CertifyOptions& o, const config::ServiceConfig& config,
                           const std::vector<std::string>& names, const Tracked& all, report::CertificateInput& input) {
  std::vector<certify::BallTrack> tracks;
  std::vector<std::vector<certify::Rest>> rests;
  for (const std::string& name : names) {
    const auto found = all.estimates.find(name);
    const Estimates& estimates = found == all.estimates.end() ? Estimates{} : found->second;
    tracks.push_back(track_of(estimates));
    rests.push_back(certify::rests_of(tracks.back()));
    std::vector<TrackedSet> tracked_sets;
    for (const auto& e : estimates)
      tracked_sets.push_back({capture::seconds(e.at), e.state == object_tracking::TrackState::tracking});
    input.targets.push_back(tally_of(name, tracked_sets, rests.back()));
    if (tracks.back().empty()) throw gather::InputError(name + " is never tracked: there is nothing to certify");
  }
  Measured out;
  if (o.length_mm > 0) {
    input.what = fmt::format("a bar of {:.2f} mm between {} and {}", o.length_mm, names[0], names[1]);
    out.lengths = certify::bar_lengths(tracks[0], tracks[1], o.length_mm / 1e3, config.rig);
    if (out.lengths.empty()) throw gather::InputError("the two balls are never tracked at the same time");
    return out;
  }
  const auto places = read_places(o.places);
  const auto visits = certify::visits_of(rests[0], places);
  input.what = fmt::format("{} visits of {} marked places by {}", visits.size(), places.size(), names[0]);
  out.lengths = certify::place_lengths(visits, places, config.rig);
  out.most_independent = visits.size();  // all lengths are between these places
  if (out.lengths.empty())
    throw gather::InputError(
        "the ball never rests at two of the places: leave it 0.5 s at each, within a third of the distance to the next "
        "one");
  return out;
}

ExitStatus certify_lengths(const CertifyOptions& o, const std::stop_token& stop) {
  if (o.recording.empty() == o.tracks.empty())
    throw gather::InputError("give a recording, or the tracks that huetrackd wrote of it (--tracks)");
  if ((o.length_mm > 0) == !o.places.empty())
    throw gather::InputError("give --length-mm of the bar, or --places with the file of the marked places");
  const config::ServiceConfig config = config::load_service_config(o.config);
  config::require_rig(config);
  const bool is_bar = o.length_mm > 0;
  const Ends ends = ends_of(o, config, is_bar);
  Tracked all;
  if (o.tracks.empty()) {
    all = tracked(config, o.recording, stop);
  } else {
    all.estimates = tracks::read_track_csv(o.tracks);
  }
  report::CertificateInput input{.rig_name = files::printable(std::filesystem::path(o.config).filename().string()),
                                 .what = {},
                                 .is_of_places = !is_bar};
  const Measured measured = ends.is_one_color ? measured_one_color(o, config, ends.targets[0], all, input)
                                              : measured_by_color(o, config, ends.targets, all, input);
  const certify::Certificate certificate =
      certify::certificate_of(measured.lengths, o.length_sigma_mm / 1e3, measured.most_independent);
  if (o.limit_mm > 0) input.limit_m = o.limit_mm / 1e3;
  input.cameras = times_of(config.rig, all);
  input.named = all.named;
  input.set_ms = all.set_ms;
  input.has_incomplete_sets = all.sets > 0;
  if (all.sets > 0) input.incomplete_share = static_cast<double>(all.incomplete) / static_cast<double>(all.sets);
  input.made_of = {{"tool", "huetrack-calibrate " HUETRACK_VERSION},
                   {"input", o.tracks.empty() ? o.recording : o.tracks},
                   {"configuration", o.config},
                   {"configuration's identity", config::config_identity(config)}};
  if (config.rig.made.at) input.made_of.emplace_back("rig made", calib::utc_text(*config.rig.made.at));
  const report::CertificateReport report = report::report_on(certificate, measured.lengths, config.rig, input);
  std::fputs(report::to_text(report.document).c_str(), stdout);
  if (!o.report.empty()) write_document(report.document, o.report);
  return status_of(report.verdict);
}

}  // namespace

void add_certify_command(CLI::App& app, Command& chosen) {
  const auto o = std::make_shared<CertifyOptions>();
  CLI::App* command = app.add_subcommand(
      "certify", "accuracy of lengths in the volume, from a bar with two balls or from marked places");
  command->add_option("recording", o->recording, "recording.yaml, or its folder");
  command->add_option("--config", o->config, "huetrackd.yaml: rig, targets and tracking options")->required();
  command->add_option("--tracks", o->tracks, "instead of the recording: the CSV that huetrackd replay --tracks wrote");
  command->add_option("--target", o->targets,
                      "a ball; repeat for the bar's other ball if it has another colour; default: all targets");
  command->add_option("--length-mm", o->length_mm, "the bar's length between the centres of its balls")
      ->check(CLI::PositiveNumber);
  command
      ->add_option("--length-sigma-mm", o->length_sigma_mm,
                   "standard deviation of the length, or of the places (default 0.3)")
      ->check(CLI::NonNegativeNumber);
  command->add_option("--places", o->places,
                      "a file of marked places for one ball; see " + files::document_path("calib/formats.md"));
  command->add_option("--limit-mm", o->limit_mm, "limit of the expanded uncertainty (95 %), for PASS or FAIL")
      ->check(CLI::PositiveNumber);
  command->add_option("--report", o->report, "write the report: NAME.html and NAME.pdf");
  command->callback([o, &chosen] { chosen = [o](const std::stop_token& stop) { return certify_lengths(*o, stop); }; });
}

}  // namespace huetrack::program
