#include "reports/mistake_report.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <spdlog/spdlog.h>

#include <algorithm>

#include "reports/mistake_words.h"

namespace huetrack::reports {

MistakeReport::MistakeReport(const config::ServiceConfig& config)
    : cameras_(config.rig.camera_names()), targets_(config.targets) {}

void MistakeReport::on_set(const pipeline::TrackedSet& set) {
  if (!first_at_) first_at_ = set.frames.at;
  const std::scoped_lock lock(mutex_);
  const double now_s = capture::seconds(set.frames.at - *first_at_);
  std::vector<std::string> now, kinds;
  std::vector<bool> may_be_cleared;
  for (std::size_t t = 0; t < set.mistakes.size() && t < targets_.size(); ++t) {
    for (const auto& mistake : set.mistakes[t]) {
      if (view_watch::is_of_rig(mistake.kind) && mistake.kind != view_watch::MistakeKind::contradiction)
        has_explained_rig_ = true;
      now.push_back(mistake_text(mistake, targets_[t], cameras_));
      kinds.push_back(fmt::format("{} {} {}", t, int(mistake.kind), fmt::join(mistake.cameras, " ")));
      // A false alarm if something of twice the hue moved before the object appeared. All other kinds are facts.
      may_be_cleared.push_back(mistake.kind == view_watch::MistakeKind::opencv_hue);
    }
  }
  if (now == warnings_) return;
  clear_all_but(kinds, now_s);
  for (std::size_t i = 0; i < now.size(); ++i) {
    const std::string &sentence = now[i], &kind = kinds[i];
    if (const auto known = ever_.find(kind); known != ever_.end()) {
      known->second.sentence = sentence;
      known->second.cleared_s.reset();
      continue;
    }
    spdlog::warn("{}", sentence);
    ever_.emplace(kind, Named{now_s, sentence, may_be_cleared[i]});
    order_.push_back(kind);
  }
  warnings_ = std::move(now);
}

void MistakeReport::clear_all_but(const std::vector<std::string>& kinds_now, double now_s) {
  for (auto& [kind, named] : ever_) {
    if (!named.may_be_cleared || named.cleared_s || std::ranges::find(kinds_now, kind) != kinds_now.end()) continue;
    named.cleared_s = now_s;
    spdlog::info("cleared, because the target is tracked in its own colour: {}", named.sentence);
  }
}

void MistakeReport::on_config(const config::ServiceConfig& config) noexcept {
  const std::scoped_lock lock(mutex_);
  targets_ = config.targets;
  for (auto& [_, named] : ever_) named.may_be_cleared = false;  // it may disappear because the user corrected it
}

std::vector<std::string> MistakeReport::warnings() const {
  const std::scoped_lock lock(mutex_);
  return warnings_;
}

std::vector<std::string> MistakeReport::sentences(bool are_cleared) const {
  std::vector<std::string> all;
  for (const std::string& kind : order_) {
    const Named& named = ever_.at(kind);
    if (named.cleared_s.has_value() != are_cleared) continue;
    all.push_back(named.cleared_s ? fmt::format("named at {:.1f} s and cleared at {:.1f} s: {}", named.at_s,
                                                *named.cleared_s, named.sentence)
                                  : fmt::format("from {:.1f} s on: {}", named.at_s, named.sentence));
  }
  return all;
}

std::vector<std::string> MistakeReport::summary() const {
  return sentences(false);
}

std::vector<std::string> MistakeReport::cleared() const {
  return sentences(true);
}

}  // namespace huetrack::reports
