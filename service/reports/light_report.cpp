#include "reports/light_report.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <iterator>

#include "capture/network_source.h"
#include "pipeline/without_numbers.h"
#include "reports/light_words.h"

namespace huetrack::reports {
namespace {

constexpr std::uint64_t update_sets = 30;  // sets between two updates of the figures in a warning

}  // namespace

LightReport::LightReport(const config::ServiceConfig& config, bool is_recorded)
    : cameras_(config.rig.camera_names()),
      is_recorded_(is_recorded),
      has_controls_(cameras_.size(), true),
      watches_(cameras_.size()),
      briefs_(cameras_.size()),
      colors_(config.targets.size()),
      targets_(config.targets),
      camera_warnings_(cameras_.size()) {
  for (const config::LiveCameraConfig& camera : config.cameras)
    if (const auto index = config.rig.index_of(camera.name))
      has_controls_[std::size_t(*index)] = !capture::is_network_address(camera.device.native());
  for (TargetColors& colors : colors_) colors.warnings.resize(cameras_.size()), colors.followed.resize(cameras_.size());
}

void LightReport::on_frame(const capture::Frame& frame, capture::Timestamp /*received_at*/) {
  if (frame.status != capture::FrameStatus::ok || !capture::has_pixels(frame.pixels)) return;
  const auto c = std::size_t(frame.camera);
  if (!watches_[c].is_wanted(frame.captured_at) || !watches_[c].look(frame.pixels, frame.captured_at)) return;
  std::vector<std::string> warnings;
  for (const Remark& remark : light_remarks(watches_[c].findings(), has_controls_[c])) {
    warnings.push_back(fmt::format("camera {}: {}: {}{}", cameras_[c], remark.what,
                                   is_recorded_ ? "for the next recording, set " : "set ", remark.advice));
    if (std::ranges::find(briefs_[c], remark.brief) == briefs_[c].end()) briefs_[c].push_back(remark.brief);
    if (logged_.insert(pipeline::without_numbers(remark.what + remark.advice)).second)
      spdlog::warn("{}", warnings.back());
  }
  if (is_recorded_) return;
  const std::scoped_lock lock(mutex_);
  camera_warnings_[c] = std::move(warnings);
}

void LightReport::on_set(const pipeline::TrackedSet& set) {
  if (!first_at_) first_at_ = set.frames.at;
  const bool is_due = ++sets_ % update_sets == 0;
  for (std::size_t t = 0; t < set.trackers.size() && t < colors_.size(); ++t)
    if (is_due || set.trackers[t].color_change_count() != colors_[t].news) report_colors(t, set);
}

void LightReport::report_colors(std::size_t target, const pipeline::TrackedSet& set) {
  TargetColors& colors = colors_[target];
  colors.news = set.trackers[target].color_change_count();
  const auto healths = set.trackers[target].color_health();
  const auto estimate = std::ranges::find(set.estimates, target, &object_tracking::ObjectEstimate::target);
  const auto state = estimate != set.estimates.end() ? estimate->state : object_tracking::TrackState::searching;
  const std::scoped_lock lock(mutex_);
  for (std::size_t c = 0; c < healths.size(); ++c) {
    has_lost_color_ = has_lost_color_ || is_lost(healths[c], state);
    colors.followed[c] = followed_text(cameras_[c], healths[c]);
    std::string warning = color_warning(targets_[target], cameras_[c], healths[c], is_recorded_);
    if (!warning.empty()) {
      const std::string kind = cameras_[c] + pipeline::without_numbers(warning);
      if (colors.warnings[c].empty() || kind != cameras_[c] + pipeline::without_numbers(colors.warnings[c]))
        spdlog::warn("{}", warning);
      if (std::ranges::find(colors.ever, kind, &TargetColors::Warning::kind) == colors.ever.end())
        colors.ever.push_back(
            {kind, fmt::format("from {:.3f} s on: {}", capture::seconds(set.frames.at - *first_at_), warning), c});
    }
    colors.warnings[c] = std::move(warning);
  }
}

void LightReport::on_config(const config::ServiceConfig& config) noexcept {
  const std::scoped_lock lock(mutex_);
  targets_ = config.targets;
}

std::vector<std::string> LightReport::warnings() const {
  const std::scoped_lock lock(mutex_);
  std::vector<std::string> all;
  for (const TargetColors& colors : colors_)
    std::ranges::copy_if(colors.warnings, std::back_inserter(all),
                         [](const auto& warning) { return !warning.empty(); });
  for (const auto& of_camera : camera_warnings_) std::ranges::copy(of_camera, std::back_inserter(all));
  return all;
}

std::vector<std::string> LightReport::summary() const {
  std::vector<std::string> all;
  if (const std::string pictures = pictures_summary(); !pictures.empty())
    all.push_back(pictures + ": the log says what to set");
  for (std::size_t t = 0; t < colors_.size(); ++t) {
    std::vector<std::string> parts;
    const auto& ever = colors_[t].ever;
    if (!ever.empty()) parts.push_back(ever.front().sentence);
    std::vector<std::string> others;
    for (const TargetColors::Warning& warning : ever)
      if (warning.camera != ever.front().camera && std::ranges::find(others, cameras_[warning.camera]) == others.end())
        others.push_back(cameras_[warning.camera]);
    if (!others.empty()) parts.push_back(fmt::format("the log has more, about {}", fmt::join(others, ", ")));
    for (const std::string& sentence : colors_[t].followed)
      if (!sentence.empty())
        parts.push_back(ever.empty() && parts.empty() ? targets_[t].name + ": " + sentence : sentence);
    if (!parts.empty()) all.push_back(fmt::format("{}", fmt::join(parts, "; ")));
  }
  return all;
}

// "flicker at 100 Hz in cam0, cam1; automatic exposure or changing light in cam0"
std::string LightReport::pictures_summary() const {
  std::vector<std::string> kinds, parts;
  for (const auto& of_camera : briefs_)
    for (const std::string& brief : of_camera)
      if (std::ranges::find(kinds, brief) == kinds.end()) kinds.push_back(brief);
  for (const std::string& kind : kinds) {
    std::vector<std::string> names;
    for (std::size_t c = 0; c < cameras_.size(); ++c)
      if (std::ranges::find(briefs_[c], kind) != briefs_[c].end()) names.push_back(cameras_[c]);
    parts.push_back(fmt::format("{} in {}", kind, fmt::join(names, ", ")));
  }
  return fmt::format("{}", fmt::join(parts, "; "));
}

}  // namespace huetrack::reports
