#include "view_watch/view_watch.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "calib/model/median.h"
#include "view_watch/camera_fit.h"

namespace huetrack::view_watch {
namespace {

using object_tracking::SeenRegion;

constexpr double window_s = 3, longest_rate_hz = 16, judged_every_s = 0.5;
constexpr double forgotten_after_s = 6;  // what was found once and not again
constexpr double suspected_for_s = 1;

// Good recordings have a robust cost of 0.05 to 1 and a worst pair of 0.2 to 1.2, in which cameras' own errors and
// light are (README.md). A supposition is the answer when all pairs then agree as well, and cost much less than before.
constexpr double agrees = 1.4, much_better = 0.45, least_gain = 0.25;
// Below the first nothing is supposed; from the last on all that there is, and in between a small turn, but not often:
// it takes a millisecond. From the second on the views contradict one another, whatever explains it.
constexpr double turned_score = 0.4, suspicious_score = 0.9, disagrees = 2;
constexpr double turns_tried_every_s = 1;
// What was supposed so often is supposed ever more rarely: it explains, or it does not.
constexpr int tries_at_once = 4;
constexpr double longest_pause_s = 16;
// Of two suppositions one is named only where it explains more than the other one: a turn has three numbers to fit.
constexpr double clearly_better = 0.8;
constexpr double nothing_explains = 6;
// A mistake is named when it was found so often, half a second apart.
constexpr int least_times = 2;
// What nothing explains is told when the worst pair is off by so much, two to three times the worst of good recordings,
// and was found so often: times that are being learnt, and a ball that comes from behind something, last less long.
constexpr double contradicts = 3;
constexpr int least_contradictions = 4;
// What time learning can do by itself is no mistake (motion_state.cpp: standard deviation 20 ms). What it has not done
// is one, from a frame of 30 Hz on: by as much drivers and people are off, and less is what exposures leave open.
constexpr double least_late_s = 0.07, least_unlearnt_s = 0.03, surely_unlearnt = 4;
// Rolling shutters take 10 to 33 ms, and what is seen is usually so far from the middle row.
constexpr double unknown_readout_s = 0.02, usual_below_middle = 0.3;
// What was learnt is said in hundredths of a second.
constexpr double said_to_s = 0.005;
// One-sided: once in a thousand.
constexpr double surely_too_long = 3;
// Found twice, half a second apart, times are what they are: not further apart than they can be told.
constexpr double same_times_s = 0.015;
// Of what jumped lately, less is known than of what lasts; at 16 Hz this is more samples than a comparison needs.
constexpr double since_jump_s = 1.2;
constexpr std::size_t most_cameras_at_a_time = 16;  // more would take too long
constexpr double least_turn_rad = 0.0052;
// Chi-square, 3 degrees of freedom: light and shade do as much in one camera and place of a thousand.
constexpr double surely_turned = 16.3;
// Chi-square, 1 degree of freedom; and cheap lenses' focal lengths follow the focus by a per cent or two.
constexpr double surely_zoomed = 10.8, least_zoom = 0.03;
// Of a picture.
constexpr double least_shared = 0.03, times_the_target = 4;
constexpr int least_shared_looks = 3;
// A region is smaller than the disc by a dark side, larger by what else has the colour.
constexpr double smallest_ratio = 0.78, largest_ratio = 1.3;
// An outline is exact to a few per cent, and blur and light that darkens towards the edge make it smaller: by 6 % in
// the worst of good recordings, of which this is more than twice.
constexpr double smallest_by_outlines = 0.86, largest_by_outlines = 1.1;
constexpr double least_motion_px = 12;  // in an image

std::size_t most_samples() {
  return std::size_t(window_s * longest_rate_hz);
}

// One thing that moves, and not now this and now that: it swerves by less than it goes.
bool is_smooth(const SeenPoint& before, const SeenPoint& at, const SeenPoint& after) {
  constexpr double longest_gap_s = 0.15, noise_px = 3, swerve = 0.35;
  if (after.t_s - before.t_s > 2 * longest_gap_s) return false;
  const Eigen::Vector2d in = (at.px - before.px) / (at.t_s - before.t_s);
  const Eigen::Vector2d out = (after.px - at.px) / (after.t_s - at.t_s);
  const double step_s = 0.5 * (after.t_s - before.t_s);
  return (out - in).norm() * step_s < noise_px + swerve * (out.norm() + in.norm()) * step_s;
}

// Of stamps that jump: of all cameras that do.
Mistake joined(const Mistake& before, Mistake now) {
  for (const int camera : before.cameras)
    if (std::ranges::find(now.cameras, camera) == now.cameras.end()) now.cameras.push_back(camera);
  std::ranges::sort(now.cameras);
  now.size = std::max(before.size, now.size);
  return now;
}

// What would make the views agree, supposed one after the other; an answer is what does.
class Suppositions {
 public:
  // All outlive it.
  Suppositions(const calib::CameraRig& rig, const std::vector<Track>& tracks, const TimeSigmas& time_sigmas,
               const PairComparison::Agreement& as_is)
      : rig_(rig), tracks_(tracks), time_sigmas_(time_sigmas), as_is_(as_is), comparison_(rig) {
    for (std::size_t j = 1; j < rig.cameras.size(); ++j)
      for (std::size_t i = 0; i < j; ++i)
        if (const double usual = comparison_.residuals(tracks, i, j, {}, time_sigmas).usual(); std::isfinite(usual))
          pairs_.push_back({i, j, usual});
  }

  // Whose frames are whose: every exchange of two, and of three or four all orders.
  void try_orders() {
    const std::size_t n = rig_.cameras.size();
    std::vector<std::size_t> really(n);
    std::iota(really.begin(), really.end(), 0u);
    if (n <= 4) {
      while (std::next_permutation(really.begin(), really.end())) try_order(really);
    } else {
      for (std::size_t j = 1; j < n; ++j)
        for (std::size_t i = 0; i < j; ++i)
          std::swap(really[i], really[j]), try_order(really), std::swap(really[i], really[j]);
    }
  }

  // It disagrees with two that agree with each other: fewer could be explained by anything.
  bool could_be_fault_of(std::size_t camera) const {
    if (rig_.cameras.size() <= 2) return true;
    const auto is_of_it = [&](const Pair& pair) { return pair.i == camera || pair.j == camera; };
    const auto is_bad = [&](const Pair& pair) { return !is_of_it(pair) && pair.usual > disagrees; };
    const auto with_it = std::size_t(std::ranges::count_if(pairs_, is_of_it));
    return with_it >= 2 && with_it < pairs_.size() && std::ranges::none_of(pairs_, is_bad);
  }

  // learnt_s: how late it was learnt to be, which the tracks' times hold.
  void try_lateness(std::size_t camera, double learnt_s) {
    const double late_s = best_lateness(comparison_, tracks_, camera, time_sigmas_);
    const double in_all_s = late_s - learnt_s;  // beside what the rig says
    std::vector<double> unlearnt_s(rig_.cameras.size(), 0.0);
    unlearnt_s[camera] = late_s;
    judge({.kind = MistakeKind::late, .cameras = {int(camera)}, .size = in_all_s, .unlearnt_s = unlearnt_s},
          {.late_s = unlearnt_s}, true);
  }

  // The times of all cameras: of videos that did not begin together, and of frames that were dropped and not counted.
  // One camera that is late alone is the simpler answer.
  void try_times_of_all(const TimeSigmas& learnt_s) {
    const auto is_of_times = [](const Answer& a) { return a.mistake.kind == MistakeKind::late; };
    const std::size_t n = rig_.cameras.size();
    if (n < 3 || n > most_cameras_at_a_time || std::ranges::any_of(answers_, is_of_times)) return;
    // Cameras whose times are others are in no step, and nobody knows their readouts but who states them: what is seen
    // above or below the middle of a picture is off by as much.
    TimeSigmas sigmas = time_sigmas_;
    for (std::size_t c = 0; c < n; ++c)
      if (!rig_.cameras[c].timing.readout_s) sigmas[c] = std::hypot(sigmas[c], usual_below_middle * unknown_readout_s);
    const PairComparison::Agreement as_is = comparison_.agreement(tracks_, {}, sigmas);
    if (as_is.worst < disagrees) return;
    std::vector<double> late_s = best_latenesses(comparison_, tracks_, sigmas);
    Mistake mistake{.kind = MistakeKind::uneven_times, .off_px = as_is_.worst_px};
    const double in_time_s = calib::median(late_s);
    for (std::size_t c = 0; c < n; ++c) {
      const double off_s = std::abs(late_s[c] - in_time_s);
      if (off_s >= same_times_s) mistake.cameras.push_back(int(c));
      mistake.size = std::max(mistake.size, off_s);
    }
    mistake.unlearnt_s = late_s;
    if (mistake.cameras.size() == 1) {
      const auto camera = std::size_t(mistake.cameras.front());
      mistake.kind = MistakeKind::late;
      mistake.size = late_s[camera] - in_time_s - learnt_s[camera];
    }
    for (double& s : mistake.unlearnt_s) s -= in_time_s;  // most cameras' clock is the right one
    const auto agreement = comparison_.agreement(tracks_, {.late_s = std::move(late_s)}, sigmas);
    if (explains(agreement, as_is)) answers_.push_back({std::move(mistake), agreement.score, true});
  }

  bool has_answer() const { return !answers_.empty(); }

  void try_turn(std::size_t camera) {
    const auto turn = best_turn(comparison_, tracks_, camera, time_sigmas_);
    if (!turn) return;
    judge({.kind = MistakeKind::turned, .cameras = {int(camera)}, .size = turn->turn_rad.norm()},
          {.camera = camera, .turn_rad = turn->turn_rad},
          turn->turn_rad.norm() >= least_turn_rad && turn->gain >= surely_turned);
  }

  void try_zoom(std::size_t camera) {
    const auto [zoom, gain] = best_zoom(comparison_, tracks_, camera, time_sigmas_);
    judge({.kind = MistakeKind::zoomed, .cameras = {int(camera)}, .size = zoom}, {.camera = camera, .zoom = zoom},
          std::abs(zoom - 1) >= least_zoom && gain >= surely_zoomed);
  }

  void try_mirror(std::size_t camera) {
    judge({.kind = MistakeKind::mirrored, .cameras = {int(camera)}}, {.camera = camera, .is_mirrored = true}, true);
  }

  // The one that explains more than the others do, if it is surely so; or another room's rig, where nothing does. What
  // explains best and is not sure yet leaves the others unsaid: they would be named for what it did.
  std::optional<Mistake> best() {
    if (answers_.empty()) {
      const auto other = of_other_rig();
      return other || as_is_.worst < contradicts ? other
                                                 : Mistake{.kind = MistakeKind::contradiction,
                                                           .off_px = as_is_.worst_px,
                                                           .do_some_agree = best_pair() < agrees};
    }
    std::ranges::stable_sort(answers_, {}, cost);
    join_turn_and_zoom();
    Answer& best = answers_.front();
    if (!best.is_sure) return std::nullopt;
    if (answers_.size() > 1 && cost(best) > clearly_better * cost(answers_[1])) {
      // Two cameras of one rig, alike in all else: that one of them is so is known.
      const Mistake& other = answers_[1].mistake;
      if (rig_.cameras.size() > 2 || other.kind != best.mistake.kind || best.mistake.kind == MistakeKind::swapped)
        return std::nullopt;
      best.mistake.cameras = {0, 1};
      best.mistake.size = std::min(std::abs(best.mistake.size), std::abs(other.size));
    }
    return best.mistake;
  }

 private:
  struct Pair {  // that can be compared, as things are
    std::size_t i, j;
    double usual;
  };
  struct Answer {
    Mistake mistake;
    double score;
    bool is_sure;
  };

  // A supposition without numbers to fit is the better one where both explain.
  static double cost(const Answer& a) {
    const MistakeKind kind = a.mistake.kind;
    const double fitted = kind == MistakeKind::turned || kind == MistakeKind::uneven_times ? 1.3
                          : kind == MistakeKind::late || kind == MistakeKind::zoomed       ? 1.1
                                                                                           : 1.0;
    return fitted * (a.score + 0.2);
  }

  // Of one camera seen in few places, another focal length looks like a turn. That it is one of the two is known, and
  // is one answer, as sure as the turn is: a focal length that is off by a little is no mistake by itself.
  void join_turn_and_zoom() {
    if (answers_.size() < 2 || cost(answers_[0]) <= clearly_better * cost(answers_[1])) return;
    Answer &first = answers_[0], &second = answers_[1];
    const bool is_turn_first = first.mistake.kind == MistakeKind::turned;
    const Answer &turn = is_turn_first ? first : second, &zoom = is_turn_first ? second : first;
    if (turn.mistake.kind != MistakeKind::turned || zoom.mistake.kind != MistakeKind::zoomed ||
        turn.mistake.cameras != zoom.mistake.cameras)
      return;
    Answer joined{turn.mistake, std::min(turn.score, zoom.score), turn.is_sure};
    joined.mistake.zoom = zoom.mistake.size;
    answers_.erase(answers_.begin());
    answers_.front() = std::move(joined);
  }

  static bool explains(const PairComparison::Agreement& supposed, const PairComparison::Agreement& as_is) {
    return supposed.pairs >= as_is.pairs && supposed.worst <= agrees && supposed.score <= much_better * as_is.score &&
           as_is.score - supposed.score >= least_gain;
  }

  void judge(Mistake mistake, const Supposition& supposition, bool is_sure) {
    const auto agreement = comparison_.agreement(tracks_, supposition, time_sigmas_);
    if (!explains(agreement, as_is_)) return;
    mistake.off_px = as_is_.worst_px;
    answers_.push_back({std::move(mistake), agreement.score, is_sure});
  }

  void try_order(const std::vector<std::size_t>& really) {
    Mistake mistake{.kind = MistakeKind::swapped};
    for (std::size_t c = 0; c < really.size(); ++c) {
      if (really[c] == c) continue;
      if (rig_.cameras[c].image_size != rig_.cameras[really[c]].image_size) return;
      mistake.cameras.push_back(int(c));
    }
    judge(std::move(mistake), {.really = really}, true);
  }

  std::optional<Mistake> of_other_rig() const {
    const std::size_t n = rig_.cameras.size();
    if (as_is_.pairs < n * (n - 1) / 2) return std::nullopt;
    const double best = best_pair();
    if (best < nothing_explains || best == std::numeric_limits<double>::infinity()) return std::nullopt;
    return Mistake{.kind = MistakeKind::other_rig, .off_px = as_is_.worst_px};
  }

  // As things are, how far the two cameras are apart that agree best; infinity: none can be compared.
  double best_pair() const {
    const auto best = std::ranges::min_element(pairs_, {}, &Pair::usual);
    return best == pairs_.end() ? std::numeric_limits<double>::infinity() : best->usual;
  }

  const calib::CameraRig& rig_;
  const std::vector<Track>& tracks_;
  const TimeSigmas& time_sigmas_;
  const PairComparison::Agreement& as_is_;
  const PairComparison comparison_;
  std::vector<Pair> pairs_;
  std::vector<Answer> answers_;
};

}  // namespace

std::string_view name(MistakeKind kind) {
  static constexpr std::string_view names[] = {"swapped", "late",         "uneven_times", "turned",
                                               "zoomed",  "mirrored",     "other_rig",    "contradiction",
                                               "radius",  "shared_color", "opencv_hue"};
  static_assert(std::size(names) == mistake_kinds);
  return names[std::size_t(kind)];
}

bool is_of_rig(MistakeKind kind) {
  return kind == MistakeKind::swapped || kind == MistakeKind::late || kind == MistakeKind::turned ||
         kind == MistakeKind::uneven_times || kind == MistakeKind::zoomed || kind == MistakeKind::mirrored ||
         kind == MistakeKind::other_rig || kind == MistakeKind::contradiction;
}

ViewWatch::ViewWatch(const calib::CameraRig& rig, const object_tracking::TargetOptions& target)
    : rig_(rig),
      target_(target),
      cameras_(rig.cameras.size()),
      tracks_(rig.cameras.size()),
      time_sigmas_(rig.cameras.size(), 0.001),
      time_shifts_(rig.cameras.size(), 0),
      latency_sigmas_(rig.cameras.size(), 1) {}

void ViewWatch::look(const object_tracking::ObjectEstimate& estimate, const object_trackers::ObjectTracker& tracker,
                     capture::Timestamp set_at, const std::vector<bool>& moved) {
  if (!first_at_ || set_at < *first_at_) {
    first_at_ = set_at;
    next_s_ = judged_every_s;
    for (PerCamera& camera : cameras_) camera = {};
  }
  const double now_s = capture::seconds(set_at - *first_at_);
  late_s_.clear();
  keep(estimate, tracker.regions(), now_s);
  forget_what_was_not_it(estimate, now_s);
  if (now_s < next_s_) return;
  next_s_ = now_s + judged_every_s;
  std::vector<Mistake> now;
  if (auto mistake = of_rig(now_s, moved)) {
    now.push_back(std::move(*mistake));
  } else if (!is_wrong_) {
    if (auto late = of_learnt_times()) now.push_back(std::move(*late));
    if (auto wrong_radius = of_radius(tracker.outline_findings())) now.push_back(std::move(*wrong_radius));
  }
  const auto is_explained = [](const Suspected& s) {
    return is_of_rig(s.mistake.kind) && s.mistake.kind != MistakeKind::contradiction &&
           s.mistake.kind != MistakeKind::uneven_times;
  };
  auto uneven = of_uneven_times();
  if (uneven && now.empty() && std::ranges::none_of(suspected_, is_explained)) now.push_back(std::move(*uneven));
  const auto shares = tracker.color_shares();
  for (std::size_t c = 0; c < shares.size(); ++c) {
    const bool is_shared = shares[c].of_picture > std::max(least_shared, times_the_target * shares[c].of_target);
    cameras_[c].shared_looks = is_shared ? cameras_[c].shared_looks + 1 : 0;
    if (cameras_[c].shared_looks >= least_shared_looks)
      now.push_back({.kind = MistakeKind::shared_color, .cameras = {int(c)}, .size = shares[c].of_picture});
  }
  if (tracker.search_findings().is_found_at_twice_the_hue)
    now = {{.kind = MistakeKind::opencv_hue}};  // all else was seen of something else
  else  // never found, or taken back by the tracker: it is not one of those that come and go
    std::erase_if(suspected_, [](const Suspected& s) { return s.mistake.kind == MistakeKind::opencv_hue; });
  confirm(now, now_s);
}

// Of every camera what is taken for the target; where that is not seen, the largest region that does not stand still.
void ViewWatch::keep(const object_tracking::ObjectEstimate& estimate, std::span<const SeenRegion> regions,
                     double now_s) {
  for (std::size_t c = 0; c < cameras_.size() && c < estimate.times.size(); ++c) {
    const calib::CameraTiming& timing = rig_.cameras[c].timing;
    time_sigmas_[c] =
        std::hypot(estimate.times[c].latency_sigma_s, usual_below_middle * estimate.times[c].readout_sigma_s);
    latency_sigmas_[c] = estimate.times[c].latency_sigma_s;
    time_shifts_[c] = timing.latency_s.value_or(0) - estimate.times[c].latency_s;
    cameras_[c].readout_s = std::abs(estimate.times[c].readout_s);
    cameras_[c].readout_sigma_s = estimate.times[c].readout_sigma_s;
  }
  for (std::size_t c = 0; c < cameras_.size(); ++c) {
    PerCamera& camera = cameras_[c];
    while (!camera.track.empty() && camera.track.front().t_s < now_s - window_s - 1) camera.track.pop_front();
    const SeenRegion* chosen = nullptr;
    for (const SeenRegion& region : regions) {
      if (std::size_t(region.camera) != c) continue;
      const bool stands_still = is_still(camera, region.px, now_s);
      if (stands_still && !region.is_target) continue;
      if (chosen == nullptr || region.is_target || (!chosen->is_target && region.radius_px > chosen->radius_px))
        chosen = &region;
    }
    if (chosen == nullptr) continue;
    const double t_s = capture::seconds(chosen->at - *first_at_);
    note_period(camera, t_s);
    if (!camera.track.empty() && t_s < camera.track.back().t_s + 0.9 / longest_rate_hz) continue;
    const auto ray = rig_.cameras[c].model.ray({chosen->px});
    if (!ray) continue;
    if (camera.track.size() >= most_samples()) camera.track.pop_front();
    camera.track.push_back(
        {.t_s = t_s,
         .px = chosen->px,
         .radius_px = chosen->radius_px,
         .sigma_px = chosen->outline_sigma_px > 0 ? chosen->outline_sigma_px : sigma_of_region_px(chosen->radius_px),
         .below_middle = chosen->below_middle,
         .ray = ray->normalized(),
         .is_target = chosen->is_target});
  }
}

// Of a camera that sees the target in every frame now and again at least.
void ViewWatch::note_period(PerCamera& camera, double t_s) {
  constexpr double longest_s = 0.25, least_share = 1.0 / 64;
  const double since_s = t_s - std::exchange(camera.seen_s, t_s);
  if (since_s <= 0 || since_s > longest_s) return;
  camera.period_s += std::max(least_share, 1.0 / ++camera.intervals) * (since_s - camera.period_s);
}

// Views that have agreed for a while about where the target is tell that what they showed before, elsewhere, was
// something else of its colour: furniture, of a room that shares it.
void ViewWatch::forget_what_was_not_it(const object_tracking::ObjectEstimate& estimate, double now_s) {
  if (estimate.state != object_tracking::TrackState::tracking || estimate.views < 2) {
    found_s_.reset();
    return;
  }
  if (!found_s_) found_s_ = now_s;
  if (now_s - *found_s_ < judged_every_s) return;
  for (PerCamera& camera : cameras_)
    std::erase_if(camera.track, [&](const SeenPoint& sample) { return !sample.is_target && sample.t_s < *found_s_; });
}

bool ViewWatch::is_still(PerCamera& camera, const Eigen::Vector2d& px, double now_s) const {
  constexpr double same_px = 2, still_after_s = 1, forgotten_s = 5;
  constexpr int least_count = 5;
  constexpr std::size_t most = 16;
  std::erase_if(camera.spots, [&](const PerCamera::Spot& spot) { return spot.last_s < now_s - forgotten_s; });
  for (PerCamera::Spot& spot : camera.spots) {
    if ((spot.px - px).norm() > same_px) continue;
    spot.last_s = now_s;
    return ++spot.count >= least_count && now_s - spot.first_s > still_after_s;
  }
  if (camera.spots.size() >= most) camera.spots.erase(camera.spots.begin());
  camera.spots.push_back({px, now_s, now_s, 1});
  return false;
}

bool ViewWatch::has_moved() const {
  int moving = 0;
  for (const Track& track : tracks_) {
    if (track.size() < PairComparison::least_samples) continue;
    Eigen::Vector2d low = track.front().px, high = low;
    for (const SeenPoint& sample : track) low = low.cwiseMin(sample.px), high = high.cwiseMax(sample.px);
    moving += (high - low).norm() > least_motion_px ? 1 : 0;
  }
  return moving >= 2;
}

// What is one thing; and of what the tracker does not take for the target, only what moves. Furniture of its colour
// flickers at its edges too much to be known by where it is, now one piece is the largest and now another one, and
// tells of no camera.
void ViewWatch::choose(const Track& all, double now_s, double shift_s, Track& chosen) {
  chosen.clear();
  smooth_.assign(all.size(), false);
  for (std::size_t k = 1; k + 1 < all.size(); ++k) smooth_[k] = is_smooth(all[k - 1], all[k], all[k + 1]);
  const auto moves = [&](std::size_t k) {
    constexpr double within_s = 0.5, least_px = 6;  // twice what noise may make of a region that does not
    const auto is_far = [&](std::size_t j) { return (all[j].px - all[k].px).norm() > least_px; };
    for (std::size_t j = k; j > 0 && smooth_[j] && all[j].t_s > all[k].t_s - within_s; --j)
      if (is_far(j)) return true;
    for (std::size_t j = k; j < all.size() && smooth_[j] && all[j].t_s < all[k].t_s + within_s; ++j)
      if (is_far(j)) return true;
    return false;
  };
  for (std::size_t k = 0; k < all.size(); ++k) {
    if (!smooth_[k] || all[k].t_s < now_s - window_s || !(all[k].is_target || moves(k))) continue;
    chosen.push_back(all[k]);
    chosen.back().t_s += shift_s;
  }
}

std::optional<Mistake> ViewWatch::of_rig(double now_s, const std::vector<bool>& moved) {
  for (std::size_t c = 0; c < cameras_.size(); ++c) {
    if (c < moved.size() && moved[c])
      tracks_[c].clear();
    else
      choose(cameras_[c].track, now_s, time_shifts_[c], tracks_[c]);
  }
  is_wrong_ = false;
  if (!has_moved()) return std::nullopt;
  const PairComparison comparison(rig_);
  const PairComparison::Agreement as_is = comparison.agreement(tracks_, {}, time_sigmas_);
  is_wrong_ = as_is.pairs > 0 && (as_is.worst >= disagrees || as_is.score >= suspicious_score);
  const bool is_clear = as_is.worst >= disagrees;
  if (!is_clear) tries_ = 0;
  if ((!is_wrong_ && as_is.score < turned_score) || now_s < (is_clear ? next_try_s_ : next_turn_s_))
    return std::nullopt;
  next_turn_s_ = now_s + turns_tried_every_s;
  if (is_clear) {
    const int paused = std::max(0, ++tries_ - tries_at_once);
    next_try_s_ = now_s + std::min(longest_pause_s, 0.9 * judged_every_s * std::pow(2, paused));
  }
  auto found = explained(as_is, is_clear, false);
  const bool is_unexplained =
      !found || found->kind == MistakeKind::contradiction || found->kind == MistakeKind::other_rig;
  if (is_clear && is_unexplained)
    if (auto jump = of_jump(now_s)) found = std::move(jump);
  if (!found) return std::nullopt;
  next_turn_s_ = now_s;  // is it so half a second later, too?
  if (!found->unlearnt_s.empty() && !correct_times(*found, now_s)) return std::nullopt;
  return found;
}

// Nothing explains the whole window: stamps that jumped a moment ago were others before. What else happened a moment
// ago will have the whole window soon.
std::optional<Mistake> ViewWatch::of_jump(double now_s) {
  const double since_s = now_s - since_jump_s;
  for (Track& track : tracks_) std::erase_if(track, [&](const SeenPoint& s) { return s.t_s < since_s; });
  if (!has_moved()) return std::nullopt;
  const PairComparison::Agreement as_is = PairComparison(rig_).agreement(tracks_, {}, time_sigmas_);
  if (as_is.worst < disagrees) return std::nullopt;
  auto found = explained(as_is, true, true);
  if (!found || found->unlearnt_s.empty()) return std::nullopt;
  found->since_s = since_s;
  return found;
}

// Has the tracker correct its cameras' times when they were found twice to be the same others. Whether it is a mistake,
// besides: drivers do as much, and a trigger that there is none of is no mistake of people. But stamps that are right
// do not jump.
bool ViewWatch::correct_times(Mistake& found, double now_s) {
  double unlearnt_s = 0, surely_s = least_unlearnt_s;
  for (std::size_t c = 0; c < cameras_.size(); ++c) {
    unlearnt_s = std::max(unlearnt_s, std::abs(found.unlearnt_s[c]));
    if (found.unlearnt_s[c] != 0) surely_s = std::max(surely_s, surely_unlearnt * time_sigmas_[c]);
  }
  const bool is_unlearnt = unlearnt_s >= surely_s;
  const bool is_jump = corrections_ > 0 && is_unlearnt && time_shifts_ != shifts_when_corrected_;
  if (is_jump) found.kind = MistakeKind::uneven_times, found.size = unlearnt_s;
  const bool is_mistake =
      is_jump || std::abs(found.size) >= least_late_s || (found.kind == MistakeKind::late && is_unlearnt);
  const auto is_near = [](double a, double b) { return std::abs(a - b) < same_times_s; };
  if (other_times_ && now_s - other_times_->found_s < forgotten_after_s &&
      std::ranges::equal(other_times_->late_s, found.unlearnt_s, is_near)) {
    late_s_ = found.unlearnt_s;
    shifts_when_corrected_ = time_shifts_;
    for (PerCamera& camera : cameras_) camera.surest_sigma_s = nothing_known_s;
    ++corrections_;
    tries_ = 0;
    for (std::size_t c = 0; c < cameras_.size(); ++c)
      std::erase_if(cameras_[c].track, [&](const SeenPoint& s) { return s.t_s + time_shifts_[c] < found.since_s; });
    other_times_.reset();
  } else {
    other_times_ = {found.unlearnt_s, now_s};
  }
  return is_mistake;
}

// Of few samples several things explain much: then the times of all cameras compete with what explains them, too.
std::optional<Mistake> ViewWatch::explained(const PairComparison::Agreement& as_is, bool is_clear, bool are_few) const {
  Suppositions suppositions(rig_, tracks_, time_sigmas_, as_is);
  if (is_clear) suppositions.try_orders();  // exchanged or late cameras are not that near
  for (std::size_t c = 0; c < rig_.cameras.size(); ++c) {
    if (!suppositions.could_be_fault_of(c)) continue;
    if (is_clear) suppositions.try_lateness(c, time_shifts_[c]);
    if (is_clear) suppositions.try_mirror(c);
    suppositions.try_turn(c);
    suppositions.try_zoom(c);
  }
  if (is_clear && (are_few || !suppositions.has_answer())) suppositions.try_times_of_all(time_shifts_);
  return suppositions.best();
}

// Views agree because it was learnt how late a camera is, and that is more than drivers do: a time stamp that is wrong.
std::optional<Mistake> ViewWatch::of_learnt_times() const {
  const std::size_t n = cameras_.size();
  const auto is_known = [&](std::size_t c) { return latency_sigmas_[c] <= said_to_s; };
  // Only differences are learnt, from one camera that is held: the one that the others have in common is in time.
  std::vector<double> late_s;
  for (std::size_t c = 0; c < n; ++c)
    if (is_known(c)) late_s.push_back(-time_shifts_[c]);
  if (late_s.size() < std::min<std::size_t>(n, 3) || n < 2 || !has_moved()) return std::nullopt;
  const double in_time_s = n == 2 ? late_s[0] : calib::median(late_s);
  std::optional<Mistake> worst;
  for (std::size_t c = 0; c < n; ++c) {
    const double off_s = -time_shifts_[c] - in_time_s;
    // What the rig states is not anything that drivers do.
    const double least_s = rig_.cameras[c].timing.latency_s ? least_unlearnt_s : least_late_s;
    if (!is_known(c) || std::abs(off_s) < least_s) continue;
    if (worst && std::abs(worst->size) >= std::abs(off_s)) continue;
    worst = Mistake{.kind = MistakeKind::late, .cameras = {int(c)}, .size = off_s};
  }
  if (worst && n == 2) worst->cameras = {0, 1}, worst->size = std::abs(worst->size);
  return worst;
}

// Stamps that are when frames were exposed, but for what lasts, leave what was learnt of them where it was; and no
// sensor reads its rows out for longer than it takes from one frame to the next.
std::optional<Mistake> ViewWatch::of_uneven_times() {
  constexpr int enough = 64;  // intervals, of which rows make now a longer and now a shorter one
  std::optional<Mistake> out;
  if (!late_s_.empty()) return out;  // what was believed until now is known to be wrong
  for (std::size_t c = 0; c < cameras_.size(); ++c) {
    PerCamera& camera = cameras_[c];
    const double latency_s = -time_shifts_[c], sigma_s = latency_sigmas_[c];
    const double moved_s = std::abs(latency_s - camera.surest_latency_s);
    const bool has_moved =
        moved_s > std::max(same_times_s, surely_unlearnt * std::hypot(sigma_s, camera.surest_sigma_s));
    camera.moved_looks = has_moved ? camera.moved_looks + 1 : 0;
    if (camera.moved_looks >= least_times || sigma_s < camera.surest_sigma_s)
      camera.surest_latency_s = latency_s, camera.surest_sigma_s = sigma_s;
    const double too_long_s = camera.readout_s - camera.period_s;
    const bool is_too_long = !rig_.cameras[c].timing.readout_s && camera.intervals >= enough &&
                             too_long_s > surely_too_long * camera.readout_sigma_s;
    if (!has_moved && !is_too_long) continue;
    const double size_s = std::max(has_moved ? moved_s : 0, is_too_long ? camera.readout_s : 0);
    if (!out) out = Mistake{.kind = MistakeKind::uneven_times};
    out->cameras.push_back(int(c));
    out->size = std::max(out->size, size_s);
  }
  return out;
}

// By the outlines in all views, where there are; by regions of cameras that agree about where it is otherwise.
std::optional<Mistake> ViewWatch::of_radius(const object_tracking::OutlineFindings& outlines) const {
  if (outlines.radius_m) {
    const bool is_wrong = outlines.largest_radius_m < smallest_by_outlines * target_.radius_m ||
                          outlines.least_radius_m > largest_by_outlines * target_.radius_m;
    if (!is_wrong) return std::nullopt;
    return Mistake{.kind = MistakeKind::radius, .size = *outlines.radius_m, .is_of_outlines = true};
  }
  const PairComparison comparison(rig_);
  std::vector<double> radii_m;
  for (std::size_t j = 1; j < tracks_.size(); ++j) {
    for (std::size_t i = 0; i < j; ++i) {
      const PairResiduals pair = comparison.residuals(tracks_, i, j, {}, time_sigmas_);
      if (!(pair.usual() < disagrees)) continue;
      radii_m.insert(radii_m.end(), pair.radius_m.begin(), pair.radius_m.end());
    }
  }
  constexpr std::size_t least = 24;
  if (radii_m.size() < least || !has_moved()) return std::nullopt;
  std::ranges::sort(radii_m);
  // What hides a part of it makes it smaller, what is beside it of its colour larger: most of what was seen must say
  // so.
  const double low_m = radii_m[radii_m.size() / 4], high_m = radii_m[3 * radii_m.size() / 4];
  const double radius_m = target_.radius_m;
  if (high_m > smallest_ratio * radius_m && low_m < largest_ratio * radius_m) return std::nullopt;
  return Mistake{.kind = MistakeKind::radius, .size = radii_m[radii_m.size() / 2]};
}

// Named when it was found twice, and as long as it is found now and again.
void ViewWatch::confirm(const std::vector<Mistake>& found, double now_s) {
  const auto explains = [](const Mistake& m) { return is_of_rig(m.kind) && m.kind != MistakeKind::contradiction; };
  if (std::ranges::any_of(found, explains))
    std::erase_if(suspected_, [](const Suspected& s) { return s.mistake.kind == MistakeKind::contradiction; });
  if (is_wrong_)  // and has not been looked into again: it is as it was
    for (Suspected& s : suspected_)
      if (is_of_rig(s.mistake.kind)) s.last_s = now_s;
  for (const Mistake& mistake : found) {
    const auto known =
        std::ranges::find_if(suspected_, [&](const Suspected& s) { return s.mistake.is_same_as(mistake); });
    if (known == suspected_.end()) {
      suspected_.push_back({mistake, 1, now_s});
    } else {
      known->mistake = mistake.kind == MistakeKind::uneven_times ? joined(known->mistake, mistake) : mistake;
      ++known->times;
      known->last_s = now_s;
    }
  }
  std::erase_if(suspected_, [&](const Suspected& s) { return s.last_s < now_s - forgotten_after_s; });
  mistakes_.clear();
  suspected_mistakes_.clear();
  for (const Suspected& s : suspected_) {
    const bool is_sure = s.times >= (s.mistake.kind == MistakeKind::contradiction ? least_contradictions : least_times);
    if (is_sure) mistakes_.push_back(s.mistake);
    if (is_sure || s.last_s > now_s - suspected_for_s) suspected_mistakes_.push_back(s.mistake);
  }
}

}  // namespace huetrack::view_watch
