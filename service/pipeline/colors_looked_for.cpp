#include "pipeline/colors_looked_for.h"

#include <algorithm>

#include "color/match_tiles.h"

namespace huetrack::pipeline {
namespace {

// New trackers are there with one of the next sets, if there are new ones.
constexpr std::size_t sets_until_taken_over = 100;

void add(std::vector<capture::MatchedColor>& colors, const capture::MatchedColor& color) {
  if (std::ranges::find(colors, color) == colors.end()) colors.push_back(color);
}

}  // namespace

ColorsLookedFor::ColorsLookedFor(const config::ServiceConfig& config, std::span<const capture::LiveCamera> cameras) {
  for (const auto& camera : cameras) {
    if (!camera.look_for) continue;
    const auto index = std::size_t(camera.camera);
    cameras_.push_back({.index = index,
                        .name = config.rig.cameras[index].name,
                        .look_for = camera.look_for,
                        .expect_outlines = camera.expect_outlines,
                        .tell_outlines = camera.tell_outlines,
                        .coming = {},
                        .told = {}});
  }
  expect(config);
  for (Camera& camera : cameras_) {
    camera.told = camera.coming;
    camera.look_for(camera.told);
  }
}

void ColorsLookedFor::expect(const config::ServiceConfig& config) {
  sets_ = 0;
  for (Camera& camera : cameras_) {
    camera.coming.clear();
    for (const auto& target : config.targets) add(camera.coming, color::matched_color(target.color_in(camera.name)));
  }
}

void ColorsLookedFor::on_config(const config::ServiceConfig& config) noexcept {
  const std::scoped_lock lock(mutex_);
  expect(config);
  for (Camera& camera : cameras_) {
    for (const auto& color : camera.coming) add(camera.told, color);  // beside what is in force until then
    camera.look_for(camera.told);
  }
}

void ColorsLookedFor::on_set(const TrackedSet& set) {
  if (cameras_.empty()) return;
  const std::scoped_lock lock(mutex_);
  if (!set.reloaded.empty()) sets_ = sets_until_taken_over;
  const bool is_taken_over = sets_++ >= sets_until_taken_over;
  for (Camera& camera : cameras_) {
    wanted_.clear();
    if (!is_taken_over) wanted_ = camera.coming;
    for (const auto& tracker : set.trackers) add(wanted_, color::matched_color(tracker.color_in(camera.index)));
    if (wanted_ != camera.told) {
      camera.told = wanted_;
      camera.look_for(camera.told);
    }
    const auto& frame = set.frames.frames[camera.index];
    if (!frame || !camera.expect_outlines) continue;
    outlines_.clear();
    for (const auto& tracker : set.trackers) tracker.expected_outlines(camera.index, outlines_);
    if (!outlines_.empty()) camera.expect_outlines(frame->sequence, outlines_);
  }
  for (const Camera& camera : cameras_)
    if (camera.tell_outlines) camera.tell_outlines();
}

}  // namespace huetrack::pipeline
