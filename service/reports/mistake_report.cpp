#include "reports/mistake_report.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <spdlog/spdlog.h>

#include <algorithm>

#include "reports/mistake_words.h"

namespace huetrack::reports {

namespace {

bool do_name_times(const pipeline::TrackedSet& set) {
  return std::ranges::any_of(set.mistakes, [](const auto& of_target) {
    return std::ranges::any_of(of_target, [](const view_watch::Mistake& mistake) {
      using enum view_watch::MistakeKind;
      return mistake.kind == late || mistake.kind == uneven_times || mistake.kind == delayed ||
             mistake.kind == converted || mistake.kind == exchanged;
    });
  });
}

}  // namespace

MistakeReport::MistakeReport(const config::ServiceConfig& config, bool is_recorded)
    : is_recorded_(is_recorded), cameras_(config.rig.camera_names()), targets_(config.targets) {}

void MistakeReport::on_set(const pipeline::TrackedSet& set) {
  if (!first_at_) first_at_ = set.frames.at;
  note_frames(set.frames);
  const std::scoped_lock lock(mutex_);
  const double now_s = capture::seconds(set.frames.at - *first_at_);
  std::vector<std::string> now, kinds;
  std::vector<std::pair<std::size_t, view_watch::Mistake>> named_now;  // target, mistake
  const bool are_times_in_doubt = do_name_times(set);
  have_times_been_named_ = have_times_been_named_ || are_times_in_doubt;
  for (const auto& of_target : set.mistakes)
    if (std::ranges::any_of(of_target, view_watch::is_of_rig, &view_watch::Mistake::kind)) has_rig_mistake_ = true;
  if (std::ranges::any_of(set.calibration, [](const auto& camera) { return camera.moved && !camera.is_mended; }))
    has_moved_ = true;
  for (std::size_t t = 0; t < set.mistakes.size() && t < targets_.size(); ++t) {
    for (const auto& mistake : set.mistakes[t]) {
      if (view_watch::is_of_rig(mistake.kind) && mistake.kind != view_watch::MistakeKind::contradiction)
        has_explained_rig_ = true;
      std::string kind = fmt::format("{} {} {}", t, int(mistake.kind), fmt::join(mistake.cameras, " "));
      const auto known = ever_.find(kind);
      const bool is_radius = mistake.kind == view_watch::MistakeKind::radius;
      if (is_radius && (has_rig_mistake_ || (has_moved_ && known == ever_.end()))) continue;
      view_watch::Mistake named = mistake;
      if (mistake.kind == view_watch::MistakeKind::late && !mistake.cameras.empty())
        named.shown_hz = frames_per_second(std::size_t(mistake.cameras.front()));
      now.push_back(is_radius && has_moved_
                        ? known->second.sentence
                        : mistake_text(named, targets_[t], cameras_, is_recorded_, are_times_in_doubt));
      named_now.emplace_back(t, std::move(named));
      kinds.push_back(std::move(kind));
    }
  }
  if (now == warnings_) return;
  for (std::size_t i = 0; i < now.size(); ++i) {
    const std::string &sentence = now[i], &kind = kinds[i];
    if (const auto known = ever_.find(kind); known != ever_.end()) {
      known->second.sentence = sentence, known->second.mistake = named_now[i].second;
      continue;
    }
    spdlog::warn("{}", sentence);
    ever_.emplace(kind, Named{now_s, sentence, named_now[i].second, named_now[i].first});
    order_.push_back(kind);
  }
  warnings_ = std::move(now);
}

void MistakeReport::note_frames(const capture::FrameSet& frames) {
  spans_.resize(frames.frames.size());
  for (std::size_t c = 0; c < spans_.size(); ++c) {
    if (!frames.frames[c]) continue;
    const capture::Frame& frame = *frames.frames[c];
    Span& span = spans_[c];
    if (span.first_at == capture::Timestamp{} || frame.sequence <= span.last)
      span.first = frame.sequence, span.first_at = frame.captured_at;
    span.last = frame.sequence, span.last_at = frame.captured_at;
  }
}

double MistakeReport::frames_per_second(std::size_t camera) const {
  if (camera >= spans_.size() || spans_[camera].last_at <= spans_[camera].first_at) return 0;
  const Span& span = spans_[camera];
  return (span.last - span.first) / capture::seconds(span.last_at - span.first_at);
}

void MistakeReport::on_config(const config::ServiceConfig& config) noexcept {
  const std::scoped_lock lock(mutex_);
  targets_ = config.targets;
}

std::vector<std::string> MistakeReport::warnings() const {
  const std::scoped_lock lock(mutex_);
  return warnings_;
}

std::vector<std::string> MistakeReport::summary(bool are_times_contradicted) const {
  std::vector<std::string> all;
  const bool are_in_doubt = are_times_contradicted || have_times_been_named_;
  for (const std::string& kind : order_) {
    const Named& named = ever_.at(kind);
    if (named.is_radius() && has_rig_mistake_) continue;
    // What was said before wrong times were found is corrected.
    const std::string sentence = are_in_doubt && !named.is_radius()
                                     ? mistake_text(named.mistake, targets_[named.target], cameras_, is_recorded_, true)
                                     : named.sentence;
    all.push_back(fmt::format("from {:.1f} s on: {}", named.at_s, sentence));
  }
  return all;
}

}  // namespace huetrack::reports
