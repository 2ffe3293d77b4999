#include "pipeline/remote_colors.h"

#include <algorithm>

#include "color/match_tiles.h"

namespace huetrack::pipeline {
namespace {

struct RemoteColorsTuning {
  std::size_t reload_sets = 100;  // frame sets after which a reload is in force even if it replaced no tracker
};
constexpr RemoteColorsTuning remote_colors_tuning{};

void add(std::vector<capture::MatchedColor>& colors, const capture::MatchedColor& color) {
  if (std::ranges::find(colors, color) == colors.end()) colors.push_back(color);
}

}  // namespace

RemoteColors::RemoteColors(const config::ServiceConfig& config, std::span<const capture::LiveCamera> cameras) {
  for (const auto& camera : cameras) {
    if (!camera.look_for) continue;
    const auto index = std::size_t(camera.camera);
    cameras_.push_back({.index = index,
                        .name = config.rig.cameras[index].name,
                        .look_for = camera.look_for,
                        .expect_outlines = camera.expect_outlines,
                        .flush_outlines = camera.send_outlines,
                        .next = {},
                        .sent = {}});
  }
  expect(config);
  for (Camera& camera : cameras_) {
    camera.sent = camera.next;
    camera.look_for(camera.sent);
  }
}

void RemoteColors::expect(const config::ServiceConfig& config) {
  sets_ = 0;
  for (Camera& camera : cameras_) {
    camera.next.clear();
    for (const auto& target : config.targets) add(camera.next, color::matched_color(target.color_in(camera.name)));
  }
}

void RemoteColors::on_config(const config::ServiceConfig& config) noexcept {
  const std::scoped_lock lock(mutex_);
  expect(config);
  for (Camera& camera : cameras_) {
    for (const auto& color : camera.next) add(camera.sent, color);  // in addition to those still in use
    camera.look_for(camera.sent);
  }
}

void RemoteColors::on_set(const TrackedSet& set) {
  if (cameras_.empty()) return;
  const std::scoped_lock lock(mutex_);
  if (!set.reloaded.empty()) sets_ = remote_colors_tuning.reload_sets;
  const bool is_taken_over = sets_++ >= remote_colors_tuning.reload_sets;
  for (Camera& camera : cameras_) {
    wanted_.clear();
    if (!is_taken_over) wanted_ = camera.next;
    for (const auto& tracker : set.trackers) add(wanted_, color::matched_color(tracker.color_in(camera.index)));
    if (wanted_ != camera.sent) {
      camera.sent = wanted_;
      camera.look_for(camera.sent);
    }
    const auto& frame = set.frames.frames[camera.index];
    if (!frame || !camera.expect_outlines) continue;
    outlines_.clear();
    for (const auto& tracker : set.trackers) tracker.expected_outlines(camera.index, outlines_);
    if (!outlines_.empty()) camera.expect_outlines(frame->sequence, outlines_);
  }
  for (const Camera& camera : cameras_)
    if (camera.flush_outlines) camera.flush_outlines();
}

}  // namespace huetrack::pipeline
