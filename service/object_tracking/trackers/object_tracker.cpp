#include "object_tracking/trackers/object_tracker.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <stdexcept>
#include <utility>
#include <variant>

#include "object_tracking/trackers/color_follower.h"
#include "object_tracking/trackers/paper_tracker.h"
#include "object_tracking/trackers/region_tracker.h"

namespace huetrack::object_trackers {

using namespace object_tracking;
using namespace objects;

struct ObjectTracker::Impl {
  Impl(const calib::CameraRig& rig, const TargetOptions& target, const ObjectTrackerOptions& options,
       std::uint64_t stream)
      : rig(rig),
        target(target),
        options(options),
        stream(stream),
        tracker(made(rig, target, options, stream)),
        adapts(target.adapts_color && options.observation == Observation::huetrack),
        watch(rig, target),
        follower(rig, target) {}
  using Tracker = std::variant<PaperTracker, RegionTracker>;
  static Tracker made(const calib::CameraRig& rig, const TargetOptions& target, const ObjectTrackerOptions& options,
                      std::uint64_t stream) {
    if (options.observation == Observation::paper)
      return Tracker(std::in_place_type<PaperTracker>, rig, target, options,
                     particle_filter::Rng(options.seed, stream));
    return Tracker(std::in_place_type<RegionTracker>, rig, target, options, stream);
  }

  void learn_colour() {
    watch.update(*open, seen, follower.in_force());
    if (adapts) std::visit([&](auto& t) { follower.follow(*open, seen, watch, t.views()); }, tracker);
  }

  // Where the target's radius is assumed: another one that the pictures show. That of the outlines is drawn towards
  // the assumed one, by at most half the way: it is taken again as long as its steps become shorter by as much. That of
  // regions: while nothing of the assumed size is found.
  std::optional<double> shown_radius() {
    RegionTracker* const own = of_huetrack();
    if (own == nullptr || !target.is_radius_assumed) return std::nullopt;
    const OutlineFindings outlines = own->outline_findings();
    if (outlines.radius_m) {
      is_radius_measured = true;
      const double step = std::abs(std::log(*outlines.radius_m / target.radius_m));
      if (!outlines.contradict(target.radius_m) || step > last_step / 2) return std::nullopt;
      last_step = step;
      return outlines.radius_m;
    }
    const auto by_regions = own->search_findings().radius_m;
    return by_regions && !are_radii_alike(*by_regions, target.radius_m) ? by_regions : std::nullopt;
  }

  // Goes on with another radius: the objects are searched for again, with what is known of the cameras' times.
  std::unique_ptr<Impl> with_radius(double radius_m) {
    TargetOptions sized = target;
    sized.radius_m = radius_m;
    auto next = std::make_unique<Impl>(rig, sized, options, stream);
    next->is_shown = true;
    next->is_radius_measured = is_radius_measured;
    next->last_step = last_step;
    next->expected = expected;
    for (const auto& [camera, format, range] : expected) next->of_huetrack()->views().expect(camera, format, range);
    next->of_huetrack()->take_over_from(*of_huetrack());
    next->trusted = trusted;
    next->of_huetrack()->trust(trusted);
    return next;
  }

  RegionTracker* of_huetrack() { return std::get_if<RegionTracker>(&tracker); }  // nullptr: observation: paper

  struct Expected {
    std::size_t camera;
    capture::PixelFormat format;
    capture::ColorRange range;
    bool operator==(const Expected&) const = default;
  };
  const calib::CameraRig rig;
  const TargetOptions target;
  const ObjectTrackerOptions options;
  const std::uint64_t stream;
  bool is_shown = false;                                       // target.radius_m is that of shown_radius()
  bool is_radius_measured = false;                             // where it is assumed: by the outlines
  double last_step = std::numeric_limits<double>::infinity();  // of the log of the radius by outlines
  std::vector<Expected> expected = {};                         // expect(), trust(): of with_radius()
  std::vector<CameraTrust> trusted = {};
  Tracker tracker;
  std::optional<capture::FrameSet> open = {};  // nothing was learnt of it yet
  ObjectEstimate seen = {};                    // of it; of several objects, the first that is tracked
  bool adapts;
  ColorWatch watch;
  ColorFollower follower;
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

color::HsiRange ObjectTracker::color_in(std::size_t camera) const {
  return std::visit([camera](const auto& tracker) { return tracker.views().color_in(camera); }, impl_->tracker);
}

void ObjectTracker::expected_outlines(std::size_t camera, std::vector<capture::ExpectedOutline>& out) const {
  if (const auto* tracker = impl_->of_huetrack()) tracker->expected_outlines(camera, out);
}

std::uint64_t ObjectTracker::frames_of_other_colors(std::size_t camera) const {
  return std::visit([camera](const auto& tracker) { return tracker.views().frames_of_other_colors(camera); },
                    impl_->tracker);
}

void ObjectTracker::expect(int camera, capture::PixelFormat format, capture::ColorRange range) {
  const Impl::Expected expected{static_cast<std::size_t>(camera), format, range};
  if (std::ranges::find(impl_->expected, expected) == impl_->expected.end()) impl_->expected.push_back(expected);
  std::visit([&](auto& tracker) { tracker.views().expect(static_cast<std::size_t>(camera), format, range); },
             impl_->tracker);
}

void ObjectTracker::trust(std::span<const CameraTrust> cameras) {
  learn();
  for (const CameraTrust& camera : cameras) {
    const bool is_finite = camera.pose_covariance.allFinite() &&
                           (!camera.cam_from_world || (camera.cam_from_world->rotation.coeffs().allFinite() &&
                                                       camera.cam_from_world->translation.allFinite()));
    if (!is_finite) throw std::invalid_argument("trust: a camera's pose and its covariance must be finite");
  }
  impl_->trusted.assign(cameras.begin(), cameras.end());
  std::visit([&](auto& tracker) { tracker.trust(cameras); }, impl_->tracker);
}

void ObjectTracker::share_times(std::span<ObjectTracker> trackers) {
  if (trackers.size() < 2) return;
  std::vector<TimesHolder> holders;
  for (ObjectTracker& each : trackers)
    if (auto* tracker = each.impl_->of_huetrack()) tracker->add_times_holders(holders);
  object_trackers::share_times(holders);
}

void ObjectTracker::correct_times(std::span<const double> late_s) {
  if (auto* tracker = impl_->of_huetrack()) tracker->correct_times(late_s);
}

void ObjectTracker::begin_anew() {
  learn();
  std::visit([](auto& tracker) { tracker.begin_anew(); }, impl_->tracker);
}

void ObjectTracker::take_over_from(const ObjectTracker& before) {
  auto* tracker = impl_->of_huetrack();
  const auto* tracker_before = before.impl_->of_huetrack();
  if (tracker != nullptr && tracker_before != nullptr) tracker->take_over_from(*tracker_before);
}

void ObjectTracker::update(const capture::FrameSet& of_caller, std::vector<ObjectEstimate>& out) {
  learn();
  if (const auto radius_m = impl_->shown_radius()) impl_ = impl_->with_radius(*radius_m);
  const capture::FrameSet& set = impl_->open.emplace(of_caller);
  if (auto* tracker = impl_->of_huetrack())
    tracker->update(set, out);
  else
    out.assign(1, std::get<PaperTracker>(impl_->tracker).update(set));
  const auto tracked = std::ranges::find(out, TrackState::tracking, &ObjectEstimate::state);
  impl_->seen = tracked != out.end() ? *tracked : out.front();
}

void ObjectTracker::learn() {
  if (!impl_->open) return;
  if (auto* tracker = impl_->of_huetrack()) tracker->learn();
  impl_->learn_colour();
  impl_->open.reset();
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
  return impl_->watch.change_count();
}

SearchFindings ObjectTracker::search_findings() const {
  const auto* tracker = impl_->of_huetrack();
  return tracker != nullptr ? tracker->search_findings() : SearchFindings{};
}

SearchFindings ObjectTracker::search_findings_of_run() const {
  const auto* tracker = impl_->of_huetrack();
  return tracker != nullptr ? tracker->search_findings_of_run() : SearchFindings{};
}

OutlineFindings ObjectTracker::outline_findings() const {
  const auto* tracker = impl_->of_huetrack();
  return tracker != nullptr ? tracker->outline_findings() : OutlineFindings{};
}

std::optional<double> ObjectTracker::shown_radius_m() const {
  return impl_->is_shown ? std::optional(impl_->target.radius_m) : std::nullopt;
}

bool ObjectTracker::is_radius_known() const {
  return !impl_->target.is_radius_assumed || impl_->is_radius_measured;
}

std::span<const SeenRegion> ObjectTracker::regions() const {
  const auto* tracker = impl_->of_huetrack();
  return tracker != nullptr ? tracker->regions() : std::span<const SeenRegion>();
}

std::optional<Eigen::Vector3d> ObjectTracker::further_object() const {
  const auto* tracker = impl_->of_huetrack();
  return tracker != nullptr ? tracker->further_object() : std::nullopt;
}

std::vector<ColorShare> ObjectTracker::color_shares() const {
  const auto* tracker = impl_->of_huetrack();
  return tracker != nullptr ? tracker->color_shares() : std::vector<ColorShare>();
}

}  // namespace huetrack::object_trackers
