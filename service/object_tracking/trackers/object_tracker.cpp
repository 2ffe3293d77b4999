#include "object_tracking/trackers/object_tracker.h"

#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <optional>
#include <stdexcept>
#include <variant>

#include "object_tracking/trackers/color_follower.h"
#include "object_tracking/trackers/many_tracker.h"
#include "object_tracking/trackers/paper_tracker.h"
#include "object_tracking/trackers/region_tracker.h"

namespace huetrack::object_trackers {

using namespace object_tracking;
using namespace objects;

namespace {

// The same target, if its hues were written in OpenCV's units, of two degrees each; nullopt: they cannot be, for there
// are only 180 of them. Without what the hues as written have, too: what is seen there says nothing of the units, and
// the middle of the right hues is always beyond.
std::optional<TargetOptions> at_twice_the_hue(TargetOptions target) {
  std::vector<color::HsiRange*> ranges{&target.color};
  for (auto& [_, range] : target.camera_colors) ranges.push_back(&range);
  for (color::HsiRange* range : ranges) {
    if (range->hue_max_deg > 180 || range->hue_min_deg > range->hue_max_deg) return std::nullopt;
    range->hue_min_deg = std::max(2 * range->hue_min_deg, range->hue_max_deg);
    range->hue_max_deg = std::min(2 * range->hue_max_deg, 359.9);
    if (range->hue_min_deg >= range->hue_max_deg) return std::nullopt;
  }
  return target;
}

// Looks for the target at twice its hue, while it is not found at its own, or what was found there may be anything: for
// some seconds, and once, as it takes as long as the search itself.
class TwiceTheHue {
 public:
  TwiceTheHue(const calib::CameraRig& rig, const TargetOptions& target, const ObjectTrackerOptions& options)
      : target_(options.observation == Observation::huetrack ? at_twice_the_hue(target) : std::nullopt) {
    if (target_) rig_ = rig, options_ = options;
  }

  // Before the tracker looks at the set. state: of what was found at its own hue, in the last one; is_sure: it looks
  // like the object. has_moved: since it was found.
  void look(const capture::FrameSet& set, TrackState state, bool is_sure, bool has_moved) {
    // The object has come, and what moved was something else.
    if (state == TrackState::tracking && is_sure && has_moved) is_found_ = false;
    if (!target_) return;
    if (!began_at_) began_at_ = set.at;
    if (state != TrackState::tracking || !tracking_since_) tracking_since_ = set.at;
    const double in_use_s = capture::seconds(set.at - *began_at_);
    if (capture::seconds(set.at - *tracking_since_) > found_after_s || in_use_s > longest_s) return end();
    // What looks like it there is its own hue's, whatever else moves; for good where it moves.
    if (state == TrackState::tracking && has_moved) return end();
    if (state == TrackState::tracking && is_sure) {
      is_tracked_ = false;
      sets_ = 0;
      return;
    }
    if (!tracker_) {
      tracker_ = std::make_unique<RegionTracker>(rig_, *target_, options_, particle_filter::Rng(options_.seed, 0x48));
    }
    const ObjectEstimate estimate = tracker_->update(set);
    is_tracked_ = estimate.state == TrackState::tracking;
    if (!is_tracked_) {
      sets_ = 0;
      return;
    }
    if (sets_++ == 0) from_ = estimate.position;
    is_found_ = sets_ >= least_sets && (estimate.position - from_).norm() > least_way_m;
    if (is_found_) end();
  }
  // It looks like the object as well, there.
  bool is_rival() const { return is_found_ || (tracker_ && is_tracked_ && tracker_->looks_like_object()); }
  bool is_found() const { return is_found_; }
  // nullptr: it looks for nothing (any more).
  const TargetOptions* target() const { return target_ ? &*target_ : nullptr; }

 private:
  static constexpr double found_after_s = 1, longest_s = 8;
  static constexpr int least_sets = 10;
  static constexpr double least_way_m = 0.1;  // furniture does not move

  void end() {
    tracker_.reset();
    target_.reset();
  }

  std::optional<TargetOptions> target_;  // nullopt: nothing is looked for (any more)
  calib::CameraRig rig_;
  ObjectTrackerOptions options_;
  std::unique_ptr<RegionTracker> tracker_;
  std::optional<capture::Timestamp> began_at_, tracking_since_;
  int sets_ = 0;  // of tracking, one after the other
  Eigen::Vector3d from_ = Eigen::Vector3d::Zero();
  bool is_tracked_ = false, is_found_ = false;
};

}  // namespace

struct ObjectTracker::Impl {
  Impl(const calib::CameraRig& rig, const TargetOptions& target, const ObjectTrackerOptions& options,
       std::uint64_t stream)
      : tracker(made(rig, target, options, stream)),
        adapts(target.adapts_color && options.observation == Observation::huetrack),
        is_ball(target.shape != TargetShape::blob),
        watch(rig, target),
        follower(rig, target),
        twice_the_hue(rig, target, options) {}
  using Tracker = std::variant<PaperTracker, RegionTracker, ManyTracker>;
  static Tracker made(const calib::CameraRig& rig, const TargetOptions& target, const ObjectTrackerOptions& options,
                      std::uint64_t stream) {
    const particle_filter::Rng rng(options.seed, stream);
    if (options.observation == Observation::paper)
      return Tracker(std::in_place_type<PaperTracker>, rig, target, options, rng);
    if (target.count == 1) return Tracker(std::in_place_type<RegionTracker>, rig, target, options, rng);
    return Tracker(std::in_place_type<ManyTracker>, rig, target, options, stream);
  }

  // By what was found at the colour's own hue so far.
  void look_at_twice_the_hue(const capture::FrameSet& set) {
    auto* one = std::get_if<RegionTracker>(&tracker);
    const bool was_found = twice_the_hue.is_found();
    twice_the_hue.look(set, last_state, one == nullptr || one->looks_like_object(), one != nullptr && one->has_moved());
    if (one == nullptr) return;
    one->set_rival(is_ball && twice_the_hue.is_rival());
    // A target that has not come yet is not doubted because something else moves.
    const bool has_track = last_state == TrackState::tracking || last_state == TrackState::coasting;
    if (has_track && twice_the_hue.is_found() && !was_found) one->distrust_color(set.at);
  }

  // One of several objects stands for the colour of all: the first one that is tracked.
  void learn_colour(const capture::FrameSet& set, std::span<const ObjectEstimate> estimates) {
    const auto tracked = std::ranges::find(estimates, TrackState::tracking, &ObjectEstimate::state);
    const ObjectEstimate& estimate = tracked != estimates.end() ? *tracked : estimates.front();
    watch.look(set, estimate, follower.in_force());
    last_state = estimate.state;
    if (adapts) std::visit([&](auto& t) { follower.follow(set, estimate, watch, t.views()); }, tracker);
  }

  Tracker tracker;
  bool adapts, is_ball;
  ColorWatch watch;
  ColorFollower follower;
  TwiceTheHue twice_the_hue;
  TrackState last_state = TrackState::searching;  // of the estimate that stands for the colour
};

ObjectTracker::ObjectTracker(const calib::CameraRig& rig, const TargetOptions& target,
                             const ObjectTrackerOptions& options) {
  std::vector<std::string> all;
  for (const auto& problems : {rig.problems(), target.problems(), options.problems()})
    all.insert(all.end(), problems.begin(), problems.end());
  for (const auto& [camera, own] : target.camera_colors) {
    if (!rig.index_of(camera)) all.push_back(fmt::format("camera_colors: there is no camera '{}' in the rig", camera));
  }
  for (const auto& [camera, boxes] : target.ignored) {
    if (!rig.index_of(camera)) all.push_back(fmt::format("ignored: there is no camera '{}' in the rig", camera));
  }
  if (target.count > 1 && options.observation == Observation::paper)
    all.emplace_back("count: the paper's filter is of one object; observation: paper needs a count of 1");
  if (!all.empty()) throw std::invalid_argument(fmt::format("target {}: {}", target.name, fmt::join(all, "; ")));
  // The target's name, not its place in the list, picks the stream: adding a target does not change another's track.
  std::uint64_t stream = 0xcbf29ce484222325u;  // FNV-1a
  for (const char c : target.name) stream = (stream ^ static_cast<unsigned char>(c)) * 0x100000001b3u;
  impl_ = std::make_unique<Impl>(rig, target, options, stream);
}

ObjectTracker::~ObjectTracker() = default;
ObjectTracker::ObjectTracker(ObjectTracker&&) noexcept = default;
ObjectTracker& ObjectTracker::operator=(ObjectTracker&&) noexcept = default;

std::vector<color::HsiRange> first_colors_looked_for(const TargetOptions& target, const ObjectTrackerOptions& options,
                                                     std::string_view camera) {
  std::vector<color::HsiRange> out{target.color_in(camera)};
  if (options.observation == Observation::huetrack)
    if (const auto twice = at_twice_the_hue(target)) out.push_back(twice->color_in(camera));
  return out;
}

void ObjectTracker::colors_looked_for(std::size_t camera, std::vector<color::HsiRange>& out) const {
  std::visit(
      [&](const auto& tracker) {
        out.push_back(tracker.views().color_in(camera));
        if (const TargetOptions* twice = impl_->twice_the_hue.target(); twice != nullptr)
          out.push_back(twice->color_in(tracker.views().camera(camera).name));
      },
      impl_->tracker);
}

void ObjectTracker::expected_outlines(std::size_t camera, std::vector<capture::ExpectedOutline>& out) const {
  if (const auto* one = std::get_if<RegionTracker>(&impl_->tracker)) one->expected_outlines(camera, out);
}

std::uint64_t ObjectTracker::frames_of_other_colors(std::size_t camera) const {
  return std::visit([camera](const auto& tracker) { return tracker.views().frames_of_other_colors(camera); },
                    impl_->tracker);
}

void ObjectTracker::expect(int camera, capture::PixelFormat format, capture::ColorRange range) {
  std::visit([&](auto& tracker) { tracker.views().expect(static_cast<std::size_t>(camera), format, range); },
             impl_->tracker);
}

void ObjectTracker::trust(std::span<const CameraTrust> cameras) {
  for (const CameraTrust& camera : cameras) {
    const bool is_finite = camera.pose_covariance.allFinite() &&
                           (!camera.cam_from_world || (camera.cam_from_world->rotation.coeffs().allFinite() &&
                                                       camera.cam_from_world->translation.allFinite()));
    if (!is_finite) throw std::invalid_argument("trust: a camera's pose and its covariance must be finite");
  }
  std::visit([&](auto& tracker) { tracker.trust(cameras); }, impl_->tracker);
}

void ObjectTracker::correct_times(std::span<const double> late_s) {
  if (auto* one = std::get_if<RegionTracker>(&impl_->tracker))
    one->correct_times(late_s);
  else if (auto* many = std::get_if<ManyTracker>(&impl_->tracker))
    many->correct_times(late_s);
}

void ObjectTracker::take_over_from(const ObjectTracker& before) {
  auto* many = std::get_if<ManyTracker>(&impl_->tracker);
  const auto* many_before = std::get_if<ManyTracker>(&before.impl_->tracker);
  if (many != nullptr && many_before != nullptr) many->take_over_from(*many_before);
}

void ObjectTracker::update(const capture::FrameSet& set, std::vector<ObjectEstimate>& out) {
  impl_->look_at_twice_the_hue(set);
  if (auto* many = std::get_if<ManyTracker>(&impl_->tracker)) {
    many->update(set, out);
  } else {
    out.resize(1);
    if (auto* one = std::get_if<RegionTracker>(&impl_->tracker))
      out.front() = one->update(set);
    else
      out.front() = std::get<PaperTracker>(impl_->tracker).update(set);
  }
  impl_->learn_colour(set, out);
}

ObjectEstimate ObjectTracker::update(const capture::FrameSet& set) {
  std::vector<ObjectEstimate> out;
  update(set, out);
  return std::move(out.front());
}

std::vector<Eigen::Vector3f> ObjectTracker::particles(std::size_t about) const {
  return std::visit(
      [about](const auto& tracker) {
        const PositionParticles& p = tracker.particles();
        const std::size_t step = about == 0 ? 1 : std::max<std::size_t>(1, p.size() / about);
        std::vector<Eigen::Vector3f> out;
        out.reserve(p.size() / step + 1);
        for (std::size_t i = 0; i < p.size(); i += step) out.emplace_back(p.x[i], p.y[i], p.z[i]);
        return out;
      },
      impl_->tracker);
}

std::vector<ColorHealth> ObjectTracker::color_health() const {
  std::vector<ColorHealth> all;
  for (std::size_t i = 0; i < impl_->watch.camera_count(); ++i) {
    all.push_back(impl_->watch.in(i));
    all.back().followed = impl_->follower.shift(i);
  }
  return all;
}

std::uint64_t ObjectTracker::color_change_count() const {
  return impl_->watch.news();
}

SearchFindings ObjectTracker::search_findings() const {
  SearchFindings findings;
  if (const auto* one = std::get_if<RegionTracker>(&impl_->tracker)) findings = one->search_findings();
  if (const auto* many = std::get_if<ManyTracker>(&impl_->tracker)) findings = many->search_findings();
  findings.is_found_at_twice_the_hue = impl_->twice_the_hue.is_found();
  return findings;
}

OutlineFindings ObjectTracker::outline_findings() const {
  const auto* tracker = std::get_if<RegionTracker>(&impl_->tracker);
  return tracker != nullptr ? tracker->outline_findings() : OutlineFindings{};
}

std::span<const SeenRegion> ObjectTracker::regions() const {
  if (const auto* one = std::get_if<RegionTracker>(&impl_->tracker)) return one->regions();
  if (const auto* many = std::get_if<ManyTracker>(&impl_->tracker)) return many->regions();
  return {};
}

std::optional<Eigen::Vector3d> ObjectTracker::further_object() const {
  if (const auto* one = std::get_if<RegionTracker>(&impl_->tracker)) return one->further_object();
  if (const auto* many = std::get_if<ManyTracker>(&impl_->tracker)) return many->further_object();
  return std::nullopt;
}

std::vector<ColorShare> ObjectTracker::color_shares() const {
  if (const auto* one = std::get_if<RegionTracker>(&impl_->tracker)) return one->color_shares();
  if (const auto* many = std::get_if<ManyTracker>(&impl_->tracker)) return many->color_shares();
  return {};
}

}  // namespace huetrack::object_trackers
