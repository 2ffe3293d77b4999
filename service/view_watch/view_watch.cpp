#include "view_watch/view_watch.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <utility>

#include "calib/model/covariance_ellipse.h"
#include "calib/model/median.h"
#include "object_tracking/objects/search_findings.h"
#include "object_tracking/objects/static_clutter_mask.h"
#include "object_tracking/sighting.h"
#include "view_watch/camera_fit.h"

namespace huetrack::view_watch {
namespace {

using object_tracking::SeenRegion;

// Which samples are compared.
struct ViewSamplesTuning {
  double max_rate_hz = 16;  // of samples; more are correlated
  double swerve = 0.35;     // of its step by which one thing changes direction between samples
};
constexpr ViewSamplesTuning view_samples{};
// Between judgements; clutter moves within it, or stays in its place for two.
constexpr double period_s = objects::clutter_history.period_s;
// Of a region that does not move, at most.
constexpr double region_noise_px =
    object_tracking::sighting_tuning.prediction_sigmas * object_tracking::sighting_tuning.same_place_px;
constexpr double moves_px = 2 * region_noise_px, path_px = 2 * moves_px;
constexpr std::size_t most_spots = 16;              // capacity
constexpr std::size_t most_cameras_at_a_time = 16;  // capacity: more would take too long
constexpr double jitter = 0.9;                      // maths: of a period, so that no turn is missed

// When views are inconsistent, and when a hypothesis explains it. Good recordings have a robust cost of 0.05 to 1 and a
// worst pair of 0.2 to 1.2 (EXPERIMENTS.md); PairComparison::Agreement has the units.
struct ConsistencyTuning {
  double disagrees = 2;         // worst pair from which they are, and all hypotheses are tested
  double much_better = 0.45;    // cost under the hypothesis in that of the rig, at most
  double clearly_better = 0.8;  // cost of the best hypothesis in that of the second
  double per_parameter = 1.1;   // factor of the cost of a hypothesis
  int tries_at_once = 4;        // then the tests become rarer
  double max_pause_s = 16;      // between tests
  int min_times = 2;            // a mistake was found so often before it is named; an unexplained one twice as often
};
constexpr ConsistencyTuning consistency{};
// Worst pair, at most, under the hypothesis: half-way, in logarithms, from what is expected to disagreement.
const double agrees = std::sqrt(consistency.disagrees);
// As far beyond disagreement as that is beyond what is expected, 1. Worst pair from which it is reported without
// explanation; best pair, twice: other rig.
constexpr double contradicting_worst = 2 * consistency.disagrees - 1;
// Cost from which a small turn is tested, once a second: twice what is noise at least.
constexpr double turned_score = 2 * pair_sampling.least_noise2;
constexpr double forgotten_after_s = 2 * pair_sampling.window_s;  // what was found once
constexpr double suspected_for_s = 2 * period_s;

struct TimingFaultTuning {
  double min_unlearnt_s = 0.03;  // what it has not estimated: a frame at 30 Hz; twice the precision of both
};
constexpr TimingFaultTuning timing_fault{};
// Of a latency, of its prior, and of a readout beyond the frame period.
const double sure_sigmas = std::sqrt(object_tracking::sighting_tuning.gate_nis);
constexpr double usual_below_middle = 0.5 / std::numbers::sqrt3;  // maths: 1 sigma of a row anywhere in the picture
// A stamp's error; up to that the tracker estimates latency.
const double min_late_s = sure_sigmas * object_tracking::time_prior.unknown_sigma_s;
constexpr double same_times_s = timing_fault.min_unlearnt_s / 2;
constexpr double since_jump_s = pair_sampling.window_s / 2;  // compared after a jump

struct CameraFaultTuning {
  double min_turn_rad = 0.0052;  // 0.3 degrees
  double min_zoom = 0.03;        // cheap lenses change by 1 to 2 % with the focus
};
constexpr CameraFaultTuning camera_fault{};

struct TargetFaultTuning {
  double min_shared = 0.03;  // of a picture that has the target's colour
};
constexpr TargetFaultTuning target_fault{};

// Radii that were measured as `ratio` times the given one. Only what nearly has the given size is searched for and
// fitted, which draws them towards it, by 0.2 to 0.5 of the way from the true one where twice that was given
// (experiment): the true radius may be as far beyond.
std::pair<double, double> widened(std::pair<double, double> range_m, double ratio) {
  (ratio < 1 ? range_m.first : range_m.second) *= ratio;
  return range_m;
}

std::size_t most_samples() {
  return std::size_t(pair_sampling.window_s * view_samples.max_rate_hz);
}

// One thing that moves, as opposed to alternating ones: it swerves by less than it goes.
bool is_smooth(const SeenPoint& before, const SeenPoint& at, const SeenPoint& after) {
  if (after.t_s - before.t_s > 2 * pair_sampling.longest_gap_s) return false;
  const Eigen::Vector2d in = (at.px - before.px) / (at.t_s - before.t_s);
  const Eigen::Vector2d out = (after.px - at.px) / (after.t_s - at.t_s);
  const double step_s = 0.5 * (after.t_s - before.t_s);
  return (out - in).norm() * step_s < region_noise_px + view_samples.swerve * (out.norm() + in.norm()) * step_s;
}

// Uneven times of both.
Mistake joined(const Mistake& before, Mistake now) {
  for (const int camera : before.cameras)
    if (std::ranges::find(now.cameras, camera) == now.cameras.end()) now.cameras.push_back(camera);
  std::ranges::sort(now.cameras);
  now.size = std::max(before.size, now.size);
  return now;
}

// Tests fault hypotheses one after the other; those that make the views consistent are answers.
class FaultHypotheses {
 public:
  // All outlive it.
  FaultHypotheses(const calib::CameraRig& rig, const std::vector<Track>& tracks, const TimeSigmas& time_sigmas,
                  const PairComparison::Agreement& as_is)
      : rig_(rig), tracks_(tracks), time_sigmas_(time_sigmas), as_is_(as_is), comparison_(rig) {
    for (std::size_t j = 1; j < rig.cameras.size(); ++j)
      for (std::size_t i = 0; i < j; ++i)
        if (const double usual = comparison_.residuals(tracks, i, j, {}, time_sigmas).usual(); std::isfinite(usual))
          pairs_.push_back({i, j, usual});
  }

  // Frames exchanged.
  void try_orders() {
    for_each_order([this](const std::vector<std::size_t>& really) {
      if (auto mistake = exchanged(really)) judge(std::move(*mistake), {.really = really}, true);
    });
  }

  // The same in videos without stamps, which did not begin together, either.
  void try_orders_and_times() {
    if (rig_.cameras.size() < 3 || rig_.cameras.size() > 4) return;  // two: anything is explained; more: too long
    const TimeSigmas sigmas = sigmas_without_trigger();
    const PairComparison::Agreement as_is = comparison_.agreement(tracks_, {}, sigmas);
    if (as_is.worst < consistency.disagrees) return;
    for_each_order([&](const std::vector<std::size_t>& really) {
      auto mistake = exchanged(really);
      if (!mistake) return;
      FaultHypothesis hypothesis{.really = really};
      hypothesis.late_s = best_latenesses(comparison_, tracks_, sigmas, hypothesis);
      const auto agreement = comparison_.agreement(tracks_, hypothesis, sigmas);
      if (!explains(agreement, as_is)) return;
      mistake->off_px = as_is_.worst_px;
      answers_.push_back({std::move(*mistake), agreement.score, true});
    });
  }

  // It is inconsistent with two that are consistent with each other: fewer could be explained by anything.
  bool could_be_fault_of(std::size_t camera) const {
    if (rig_.cameras.size() <= 2) return true;
    const auto is_of_it = [&](const Pair& pair) { return pair.i == camera || pair.j == camera; };
    const auto is_bad = [&](const Pair& pair) { return !is_of_it(pair) && pair.usual > consistency.disagrees; };
    const auto with_it = std::size_t(std::ranges::count_if(pairs_, is_of_it));
    return with_it >= 2 && with_it < pairs_.size() && std::ranges::none_of(pairs_, is_bad);
  }

  // learnt_s: the estimated latency beyond the rig's, which the tracks' times contain. is_sure: false while the views
  // are not clearly inconsistent: then it only competes, as slow motion makes late frames look like a turned camera.
  void try_lateness(std::size_t camera, double learnt_s, bool is_sure) {
    const double late_s = best_lateness(comparison_, tracks_, camera, time_sigmas_);
    const double in_all_s = late_s - learnt_s;  // beyond the rig's
    std::vector<double> extra_latency_s(rig_.cameras.size(), 0.0);
    extra_latency_s[camera] = late_s;
    judge({.kind = MistakeKind::late, .cameras = {int(camera)}, .size = in_all_s, .extra_latency_s = extra_latency_s},
          {.late_s = extra_latency_s}, is_sure);
  }

  // The times of all cameras: videos that did not begin together, or frames that were dropped and not counted. One late
  // camera alone is the simpler answer.
  void try_times_of_all(const TimeSigmas& learnt_s) {
    const auto is_of_times = [](const Answer& a) { return a.mistake.kind == MistakeKind::late; };
    const std::size_t n = rig_.cameras.size();
    if (n < 3 || n > most_cameras_at_a_time || std::ranges::any_of(answers_, is_of_times)) return;
    const TimeSigmas sigmas = sigmas_without_trigger();
    const PairComparison::Agreement as_is = comparison_.agreement(tracks_, {}, sigmas);
    if (as_is.worst < consistency.disagrees) return;
    std::vector<double> late_s = best_latenesses(comparison_, tracks_, sigmas);
    Mistake mistake{.kind = MistakeKind::uneven_times, .off_px = as_is_.worst_px};
    const double in_time_s = calib::median(late_s);
    for (std::size_t c = 0; c < n; ++c) {
      const double off_s = std::abs(late_s[c] - in_time_s);
      if (off_s >= same_times_s) mistake.cameras.push_back(int(c));
      mistake.size = std::max(mistake.size, off_s);
    }
    mistake.extra_latency_s = late_s;
    if (mistake.cameras.size() == 1) {
      const auto camera = std::size_t(mistake.cameras.front());
      mistake.kind = MistakeKind::late;
      mistake.size = late_s[camera] - in_time_s - learnt_s[camera];
    }
    for (double& s : mistake.extra_latency_s) s -= in_time_s;  // the median camera's clock is taken as right
    const auto agreement = comparison_.agreement(tracks_, {.late_s = std::move(late_s)}, sigmas);
    if (explains(agreement, as_is)) answers_.push_back({std::move(mistake), agreement.score, true});
  }

  bool has_answer() const { return !answers_.empty(); }

  void try_turn(std::size_t camera) {
    const auto turn = best_turn(comparison_, tracks_, camera, time_sigmas_);
    if (!turn) return;
    judge({.kind = MistakeKind::turned, .cameras = {int(camera)}, .size = turn->turn_rad.norm()},
          {.camera = camera, .turn_rad = turn->turn_rad},
          turn->turn_rad.norm() >= camera_fault.min_turn_rad && turn->gain >= calib::chi2_999_in_3d);
  }

  void try_zoom(std::size_t camera) {
    const auto [zoom, gain] = best_zoom(comparison_, tracks_, camera, time_sigmas_);
    judge({.kind = MistakeKind::zoomed, .cameras = {int(camera)}, .size = zoom}, {.camera = camera, .zoom = zoom},
          std::abs(zoom - 1) >= camera_fault.min_zoom && gain >= calib::chi2_999_in_1d);
  }

  // What programs and tags do to pictures without a change of their size.
  void try_flips(std::size_t camera) {
    judge({.kind = MistakeKind::mirrored, .cameras = {int(camera)}}, {.camera = camera, .is_mirrored = true}, true);
    judge({.kind = MistakeKind::upside_down, .cameras = {int(camera)}}, {.camera = camera, .is_upside_down = true},
          true);
  }

  // By one program, or because the cameras hang on the ceiling.
  void try_all_upside_down() {
    judge({.kind = MistakeKind::upside_down, .cameras = {}},
          {.camera = FaultHypothesis::every_camera, .is_upside_down = true}, true);
  }

  // The answer with the lowest cost, if it is significant; without answers another rig or a contradiction. While the
  // best answer is not significant yet, no other one is returned: it would be blamed for the best one's effect.
  std::optional<Mistake> best() {
    if (answers_.empty()) {
      const auto other = of_other_rig();
      return other || as_is_.worst < contradicting_worst ? other
                                                         : Mistake{.kind = MistakeKind::contradiction,
                                                                   .off_px = as_is_.worst_px,
                                                                   .do_some_agree = best_pair() < agrees};
    }
    std::ranges::stable_sort(answers_, {}, cost);
    join_turn_and_zoom();
    Answer& best = answers_.front();
    if (!best.is_sure) return std::nullopt;
    if (is_open_which_is_mirrored()) {
      best.mistake.cameras = {0, 1};
      return best.mistake;
    }
    if (answers_.size() > 1 && cost(best) > consistency.clearly_better * cost(answers_[1])) {
      // Of two cameras it is known that one of them is at fault.
      const Mistake& other = answers_[1].mistake;
      if (rig_.cameras.size() > 2 || other.kind != best.mistake.kind || best.mistake.kind == MistakeKind::swapped)
        return std::nullopt;
      best.mistake.cameras = {0, 1};
      best.mistake.size = std::min(std::abs(best.mistake.size), std::abs(other.size));
    }
    return best.mistake;
  }

 private:
  struct Pair {  // with enough samples, as the rig is
    std::size_t i, j;
    double usual;
  };
  struct Answer {
    Mistake mistake;
    double score;
    bool is_sure;
  };

  // Parameters are penalised. Below the noise all hypotheses are good.
  static double cost(const Answer& a) {
    const MistakeKind kind = a.mistake.kind;
    const bool has_many = kind == MistakeKind::turned || kind == MistakeKind::uneven_times;
    const bool has_one = kind == MistakeKind::late || kind == MistakeKind::zoomed;
    return std::pow(consistency.per_parameter, has_many ? 3 : has_one ? 1 : 0) * (a.score + pair_sampling.least_noise2);
  }

  // Of two cameras, exchanging left and right of either explains the views: near a plane of symmetry both do equally.
  bool is_open_which_is_mirrored() const {
    const auto is_mirrored = [](const Answer& a) { return a.mistake.kind == MistakeKind::mirrored; };
    return rig_.cameras.size() == 2 && is_mirrored(answers_.front()) &&
           std::ranges::count_if(answers_, is_mirrored) == 2;
  }

  // In few places another focal length of a camera looks like its turn: both become one answer, as significant as the
  // turn, because a small error of the focal length is no mistake by itself.
  void join_turn_and_zoom() {
    if (answers_.size() < 2 || cost(answers_[0]) <= consistency.clearly_better * cost(answers_[1])) return;
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

  static bool explains(const PairComparison::Agreement& with, const PairComparison::Agreement& as_is) {
    return with.pairs >= as_is.pairs && with.worst <= agrees && with.score <= consistency.much_better * as_is.score;
  }

  void judge(Mistake mistake, const FaultHypothesis& hypothesis, bool is_sure) {
    const auto agreement = comparison_.agreement(tracks_, hypothesis, time_sigmas_);
    if (!explains(agreement, as_is_)) return;
    mistake.off_px = as_is_.worst_px;
    answers_.push_back({std::move(mistake), agreement.score, is_sure});
  }

  // All orders of up to four cameras, otherwise all exchanges of two.
  template <typename Try>
  void for_each_order(const Try& try_order) {
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

  // nullopt: the pictures' sizes exclude it.
  std::optional<Mistake> exchanged(const std::vector<std::size_t>& really) const {
    Mistake mistake{.kind = MistakeKind::swapped};
    for (std::size_t c = 0; c < really.size(); ++c) {
      if (really[c] == c) continue;
      if (rig_.cameras[c].image_size != rig_.cameras[really[c]].image_size) return std::nullopt;
      mistake.cameras.push_back(int(c));
    }
    return mistake;
  }

  // Cameras whose times are unknown are not triggered: unless the rig states their readouts, these add to the
  // uncertainty of times.
  TimeSigmas sigmas_without_trigger() const {
    TimeSigmas sigmas = time_sigmas_;
    for (std::size_t c = 0; c < sigmas.size(); ++c)
      if (!rig_.cameras[c].timing.readout_s)
        sigmas[c] = std::hypot(sigmas[c], usual_below_middle * object_tracking::time_prior.unknown_sigma_s);
    return sigmas;
  }

  std::optional<Mistake> of_other_rig() const {
    const std::size_t n = rig_.cameras.size();
    if (as_is_.pairs < n * (n - 1) / 2) return std::nullopt;
    const double best = best_pair();
    if (best < 2 * contradicting_worst || best == std::numeric_limits<double>::infinity()) return std::nullopt;
    return Mistake{.kind = MistakeKind::other_rig, .off_px = as_is_.worst_px};
  }

  // usual() of the most consistent pair; infinity: none has enough samples.
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
  static constexpr std::string_view names[] = {
      "swapped",       "late",        "uneven_times", "turned",    "zoomed",  "mirrored", "upside_down", "other_rig",
      "contradiction", "wrong_order", "converted",    "exchanged", "delayed", "radius",   "shared_color"};
  static_assert(std::size(names) == mistake_kinds);
  return names[std::size_t(kind)];
}

bool is_of_rig(MistakeKind kind) {
  return kind == MistakeKind::swapped || kind == MistakeKind::late || kind == MistakeKind::turned ||
         kind == MistakeKind::uneven_times || kind == MistakeKind::zoomed || kind == MistakeKind::mirrored ||
         kind == MistakeKind::upside_down || kind == MistakeKind::other_rig || kind == MistakeKind::contradiction ||
         kind == MistakeKind::wrong_order || kind == MistakeKind::converted || kind == MistakeKind::exchanged ||
         kind == MistakeKind::delayed;
}

std::pair<double, double> radius_range(const object_tracking::OutlineFindings& outlines, double radius_m) {
  return widened({outlines.least_radius_m / outlines.ratio, outlines.largest_radius_m * outlines.ratio},
                 *outlines.radius_m / radius_m);
}

ViewWatch::ViewWatch(const calib::CameraRig& rig, const object_tracking::TargetOptions& target)
    : rig_(rig),
      target_(target),
      cameras_(rig.cameras.size()),
      jumps_(rig.cameras.size()),
      tracks_(rig.cameras.size()),
      time_sigmas_(rig.cameras.size(), 0),
      time_shifts_(rig.cameras.size(), 0),
      latency_sigmas_(rig.cameras.size(), unknown_sigma_s) {}

void ViewWatch::look(const object_tracking::ObjectEstimate& estimate, const object_trackers::ObjectTracker& tracker,
                     capture::Timestamp set_at, const std::vector<bool>& moved) {
  if (!first_at_ || set_at < *first_at_) {
    first_at_ = set_at;
    next_s_ = period_s;
    for (PerCamera& camera : cameras_) camera = {};
    jumps_ = JumpWatch(cameras_.size());
  }
  const double now_s = capture::seconds(set_at - *first_at_);
  target_.radius_m = tracker.shown_radius_m().value_or(target_.radius_m);
  late_s_.clear();
  keep(estimate, tracker.regions(), now_s);
  forget_clutter(estimate, now_s);
  if (target_.count == 1) jumps_.look(tracker.regions(), now_s, target_.radius_m);
  if (now_s < next_s_) return;
  next_s_ = now_s + period_s;
  const std::vector<object_tracking::ColorShare> shares = tracker.color_shares();
  const std::vector<Mistake> of_color = of_shared_color(shares);
  std::vector<Mistake> now;
  if (const auto jumps = jumps_.jumps())
    now.push_back({.kind = MistakeKind::wrong_order, .size = jumps->largest_m, .jumps = jumps->count});
  if (auto mistake = of_rig(now_s, moved)) {
    now.push_back(std::move(*mistake));
  } else if (!is_wrong_) {
    if (auto late = of_learnt_times()) now.push_back(std::move(*late));
    // In a room that shares the colour an outline may be of what touches the target. Several objects that rest are
    // masked in any room.
    const bool is_shared = target_.count == 1 && std::ranges::any_of(shares, [](const auto& s) { return s.still > 0; });
    auto wrong_radius = of_color.empty() && !is_shared ? of_radius(tracker.outline_findings()) : std::nullopt;
    if (wrong_radius) now.push_back(std::move(*wrong_radius));
  }
  const auto is_explained = [](const Suspected& s) {
    return is_of_rig(s.mistake.kind) && s.mistake.kind != MistakeKind::contradiction &&
           s.mistake.kind != MistakeKind::uneven_times;
  };
  auto uneven = of_uneven_times();
  if (uneven && now.empty() && std::ranges::none_of(suspected_, is_explained)) now.push_back(std::move(*uneven));
  now.insert(now.end(), of_color.begin(), of_color.end());
  confirm(now, now_s);
}

void ViewWatch::begin_anew() {
  for (PerCamera& camera : cameras_) camera.track.clear(), camera.intervals = 0;
  jumps_ = JumpWatch(cameras_.size());
  found_s_.reset();
}

// Keeps per camera the region assigned to the target; without one, the largest region that is not static clutter.
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
    while (!camera.track.empty() && camera.track.front().t_s < now_s - pair_sampling.window_s - 1)
      camera.track.pop_front();
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
    if (!camera.track.empty() && t_s < camera.track.back().t_s + jitter / view_samples.max_rate_hz) continue;
    const auto ray = rig_.cameras[c].model.ray({chosen->px});
    if (!ray) continue;
    if (camera.track.size() >= most_samples()) camera.track.pop_front();
    camera.track.push_back({.t_s = t_s,
                            .px = chosen->px,
                            .radius_px = chosen->radius_px,
                            .sigma_px = chosen->sigma_px,
                            .below_middle = chosen->below_middle,
                            .ray = ray->normalized(),
                            .is_target = chosen->is_target});
  }
}

void ViewWatch::note_period(PerCamera& camera, double t_s) {
  const double since_s = t_s - std::exchange(camera.seen_s, t_s);
  if (since_s <= 0 || since_s > pair_sampling.longest_gap_s) return;
  const auto averaged = std::min(++camera.intervals, most_samples());
  camera.period_s += (since_s - camera.period_s) / double(averaged);
}

// Once the target has been tracked for a while, earlier regions that were not assigned to it were clutter of its
// colour.
void ViewWatch::forget_clutter(const object_tracking::ObjectEstimate& estimate, double now_s) {
  if (estimate.state != object_tracking::TrackState::tracking || estimate.views < 2) {
    found_s_.reset();
    return;
  }
  if (!found_s_) found_s_ = now_s;
  if (now_s - *found_s_ < period_s) return;
  for (PerCamera& camera : cameras_)
    std::erase_if(camera.track, [&](const SeenPoint& sample) { return !sample.is_target && sample.t_s < *found_s_; });
}

bool ViewWatch::is_still(PerCamera& camera, const Eigen::Vector2d& px, double now_s) const {
  std::erase_if(camera.spots, [&](const PerCamera::Spot& spot) { return spot.last_s < now_s - period_s; });
  for (PerCamera::Spot& spot : camera.spots) {
    if ((spot.px - px).norm() > object_tracking::sighting_tuning.still_px()) continue;
    spot.last_s = now_s;
    return now_s - spot.first_s > 2 * period_s;
  }
  if (camera.spots.size() >= most_spots) camera.spots.erase(camera.spots.begin());
  camera.spots.push_back({px, now_s, now_s});
  return false;
}

bool ViewWatch::has_moved() const {
  int moving = 0;
  for (const Track& track : tracks_) {
    if (track.size() < pair_sampling.least_samples) continue;
    Eigen::Vector2d low = track.front().px, high = low;
    for (const SeenPoint& sample : track) low = low.cwiseMin(sample.px), high = high.cwiseMax(sample.px);
    moving += (high - low).norm() > path_px ? 1 : 0;
  }
  return moving >= 2;
}

// Samples of one thing in smooth motion; of what is not assigned to the target, only what moves. (Clutter whose edges
// flicker, or alternates with other clutter, is not recognised as static by its place.)
void ViewWatch::choose(const Track& all, double now_s, double shift_s, Track& chosen) {
  chosen.clear();
  smooth_.assign(all.size(), false);
  for (std::size_t k = 1; k + 1 < all.size(); ++k) smooth_[k] = is_smooth(all[k - 1], all[k], all[k + 1]);
  const auto moves = [&](std::size_t k) {
    constexpr double within_s = period_s;
    const auto is_far = [&](std::size_t j) { return (all[j].px - all[k].px).norm() > moves_px; };
    for (std::size_t j = k; j > 0 && smooth_[j] && all[j].t_s > all[k].t_s - within_s; --j)
      if (is_far(j)) return true;
    for (std::size_t j = k; j < all.size() && smooth_[j] && all[j].t_s < all[k].t_s + within_s; ++j)
      if (is_far(j)) return true;
    return false;
  };
  for (std::size_t k = 0; k < all.size(); ++k) {
    if (!smooth_[k] || all[k].t_s < now_s - pair_sampling.window_s || !(all[k].is_target || moves(k))) continue;
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
  const bool is_clear = is_wrong_ = as_is.worst >= consistency.disagrees;
  if (!is_clear) tries_ = 0;
  if ((!is_clear && as_is.score < turned_score) || now_s < (is_clear ? next_try_s_ : next_turn_s_)) return std::nullopt;
  next_turn_s_ = now_s + 2 * period_s;
  if (is_clear) {
    const int paused = std::max(0, ++tries_ - consistency.tries_at_once);
    next_try_s_ = now_s + std::min(consistency.max_pause_s, jitter * period_s * std::pow(2, paused));
  }
  auto found = explained(as_is, is_clear, false);
  const bool is_unexplained =
      !found || found->kind == MistakeKind::contradiction || found->kind == MistakeKind::other_rig;
  if (is_clear && is_unexplained)
    if (auto jump = of_jump(now_s)) found = std::move(jump);
  if (!found) return std::nullopt;
  next_turn_s_ = now_s;  // to be confirmed at the next judgement
  if (!found->extra_latency_s.empty() && !correct_times(*found, now_s)) return std::nullopt;
  return found;
}

// Where nothing explains the whole window, stamps may have jumped within it. Other faults will fill the window soon.
std::optional<Mistake> ViewWatch::of_jump(double now_s) {
  const double since_s = now_s - since_jump_s;
  for (Track& track : tracks_) std::erase_if(track, [&](const SeenPoint& s) { return s.t_s < since_s; });
  if (!has_moved()) return std::nullopt;
  const PairComparison::Agreement as_is = PairComparison(rig_).agreement(tracks_, {}, time_sigmas_);
  if (as_is.worst < consistency.disagrees) return std::nullopt;
  auto found = explained(as_is, true, true);
  if (!found || found->extra_latency_s.empty()) return std::nullopt;
  found->since_s = since_s;
  return found;
}

// Corrects the tracker's times when the same ones were found twice. Returns whether it is also a mistake: drivers cause
// smaller latencies, and cameras that are not triggered are none; but correct stamps do not jump.
bool ViewWatch::correct_times(Mistake& found, double now_s) {
  double largest_s = 0, surely_s = timing_fault.min_unlearnt_s;
  for (std::size_t c = 0; c < cameras_.size(); ++c) {
    largest_s = std::max(largest_s, std::abs(found.extra_latency_s[c]));
    if (found.extra_latency_s[c] != 0) surely_s = std::max(surely_s, sure_sigmas * time_sigmas_[c]);
  }
  const bool is_unlearnt = largest_s >= surely_s;
  const bool is_jump = corrections_ > 0 && is_unlearnt && time_shifts_ != shifts_when_corrected_;
  if (is_jump) found.kind = MistakeKind::uneven_times, found.size = largest_s;
  const bool is_mistake =
      is_jump || std::abs(found.size) >= min_late_s || (found.kind == MistakeKind::late && is_unlearnt);
  const auto is_near = [](double a, double b) { return std::abs(a - b) < same_times_s; };
  if (other_times_ && now_s - other_times_->found_s < forgotten_after_s &&
      std::ranges::equal(other_times_->late_s, found.extra_latency_s, is_near)) {
    late_s_ = found.extra_latency_s;
    shifts_when_corrected_ = time_shifts_;
    ++corrections_;
    tries_ = 0;
    for (std::size_t c = 0; c < cameras_.size(); ++c)
      std::erase_if(cameras_[c].track, [&](const SeenPoint& s) { return s.t_s + time_shifts_[c] < found.since_s; });
    note_correction();
  } else {
    other_times_ = {found.extra_latency_s, now_s};
  }
  return is_mistake;
}

bool ViewWatch::contradicts(const std::vector<double>& late_s) const {
  return has_moved() && PairComparison(rig_).agreement(tracks_, {.late_s = late_s}, time_sigmas_).worst > agrees;
}

void ViewWatch::note_correction() {
  for (PerCamera& camera : cameras_) camera.surest_sigma_s = unknown_sigma_s;
  other_times_.reset();
}

// are_few: few samples, which several hypotheses explain; the times of all cameras then compete with other answers.
std::optional<Mistake> ViewWatch::explained(const PairComparison::Agreement& as_is, bool is_clear, bool are_few) const {
  FaultHypotheses hypotheses(rig_, tracks_, time_sigmas_, as_is);
  if (is_clear) hypotheses.try_orders();  // exchanged cameras are clearly inconsistent
  for (std::size_t c = 0; c < rig_.cameras.size(); ++c) {
    if (!hypotheses.could_be_fault_of(c)) continue;
    hypotheses.try_lateness(c, time_shifts_[c], is_clear);
    if (is_clear) hypotheses.try_flips(c);
    hypotheses.try_turn(c);
    hypotheses.try_zoom(c);
  }
  if (is_clear) hypotheses.try_all_upside_down();
  if (is_clear && (are_few || !hypotheses.has_answer())) hypotheses.try_times_of_all(time_shifts_);
  if (is_clear && !are_few && !hypotheses.has_answer()) hypotheses.try_orders_and_times();
  return hypotheses.best();
}

// Views are consistent because the tracker has estimated a latency that is more than drivers cause: a wrong time stamp.
std::optional<Mistake> ViewWatch::of_learnt_times() const {
  const std::size_t n = cameras_.size();
  const auto is_known = [&](std::size_t c) { return sure_sigmas * latency_sigmas_[c] <= timing_fault.min_unlearnt_s; };
  // Only differences are observable: the median camera is taken as in time.
  std::vector<double> late_s;
  for (std::size_t c = 0; c < n; ++c)
    if (is_known(c)) late_s.push_back(-time_shifts_[c]);
  if (late_s.size() < std::min<std::size_t>(n, 3) || n < 2 || !has_moved()) return std::nullopt;
  const double in_time_s = n == 2 ? late_s[0] : calib::median(late_s);
  std::optional<Mistake> worst;
  for (std::size_t c = 0; c < n; ++c) {
    const double off_s = -time_shifts_[c] - in_time_s;
    // A latency that the rig states leaves less to drivers.
    const double least_s = rig_.cameras[c].timing.latency_s ? timing_fault.min_unlearnt_s : min_late_s;
    if (!is_known(c) || std::abs(off_s) < least_s) continue;
    if (worst && std::abs(worst->size) >= std::abs(off_s)) continue;
    worst = Mistake{.kind = MistakeKind::late, .cameras = {int(c)}, .size = off_s};
  }
  if (worst && n == 2) worst->cameras = {0, 1}, worst->size = std::abs(worst->size);
  return worst;
}

// With correct stamps an estimated latency stays within its uncertainty, and a readout is shorter than the frame
// period.
std::optional<Mistake> ViewWatch::of_uneven_times() {
  std::optional<Mistake> out;
  if (!late_s_.empty()) return out;  // the estimates are being corrected
  for (std::size_t c = 0; c < cameras_.size(); ++c) {
    PerCamera& camera = cameras_[c];
    const double latency_s = -time_shifts_[c], sigma_s = latency_sigmas_[c];
    const double moved_s = std::abs(latency_s - camera.surest_latency_s);
    const bool has_moved = moved_s > std::max(same_times_s, sure_sigmas * std::hypot(sigma_s, camera.surest_sigma_s));
    camera.moved_count = has_moved ? camera.moved_count + 1 : 0;
    if (camera.moved_count >= consistency.min_times || sigma_s < camera.surest_sigma_s)
      camera.surest_latency_s = latency_s, camera.surest_sigma_s = sigma_s;
    const double too_long_s = camera.readout_s - camera.period_s;
    const bool is_too_long = !rig_.cameras[c].timing.readout_s && camera.intervals >= most_samples() &&
                             too_long_s > sure_sigmas * camera.readout_sigma_s;
    if (!has_moved && !is_too_long) continue;
    const double size_s = std::max(has_moved ? moved_s : 0, is_too_long ? camera.readout_s : 0);
    if (!out) out = Mistake{.kind = MistakeKind::uneven_times};
    out->cameras.push_back(int(c));
    out->size = std::max(out->size, size_s);
  }
  return out;
}

std::vector<Mistake> ViewWatch::of_shared_color(std::span<const object_tracking::ColorShare> shares) {
  std::vector<Mistake> out;
  for (std::size_t c = 0; c < shares.size(); ++c) {
    if (shares[c].of_picture >
        std::max(target_fault.min_shared, objects::clutter_history.shared_above * shares[c].of_target))
      out.push_back({.kind = MistakeKind::shared_color, .cameras = {int(c)}, .size = shares[c].of_picture});
  }
  return out;
}

// By the outlines of all views; without them by the regions of consistent pairs.
std::optional<Mistake> ViewWatch::of_radius(const object_tracking::OutlineFindings& outlines) const {
  if (outlines.radius_m) {
    if (!outlines.contradict(target_.radius_m)) return std::nullopt;
    return Mistake{
        .kind = MistakeKind::radius, .size = *outlines.radius_m, .range_m = radius_range(outlines, target_.radius_m)};
  }
  const PairComparison comparison(rig_);
  std::vector<double> radii_m;
  for (std::size_t j = 1; j < tracks_.size(); ++j) {
    for (std::size_t i = 0; i < j; ++i) {
      const PairResiduals pair = comparison.residuals(tracks_, i, j, {}, time_sigmas_);
      if (!(pair.usual() < consistency.disagrees)) continue;
      radii_m.insert(radii_m.end(), pair.radius_m.begin(), pair.radius_m.end());
    }
  }
  if (radii_m.size() < 2 * pair_sampling.least_samples || !has_moved()) return std::nullopt;
  std::ranges::sort(radii_m);
  // Occluders make regions smaller, neighbours of the colour larger: three quarters of the samples must agree.
  const double low_m = radii_m[radii_m.size() / 4], high_m = radii_m[3 * radii_m.size() / 4];
  const auto [least_m, largest_m] = objects::alike_radii(target_.radius_m);
  if (high_m > least_m && low_m < largest_m) return std::nullopt;
  const double middle_m = radii_m[radii_m.size() / 2];
  return Mistake{.kind = MistakeKind::radius,
                 .size = middle_m,
                 .range_m = widened({objects::alike_radii(low_m).first, objects::alike_radii(high_m).second},
                                    middle_m / target_.radius_m)};
}

// A mistake is named when it was found often enough, and as long as it is found again within some seconds.
void ViewWatch::confirm(const std::vector<Mistake>& found, double now_s) {
  const auto explains = [](const Mistake& m) { return is_of_rig(m.kind) && m.kind != MistakeKind::contradiction; };
  if (std::ranges::any_of(found, explains))
    std::erase_if(suspected_, [](const Suspected& s) { return s.mistake.kind == MistakeKind::contradiction; });
  if (is_wrong_)  // not tested again: unchanged
    for (Suspected& s : suspected_)
      if (is_of_rig(s.mistake.kind)) s.last_s = now_s;
  // Where frames are exchanged no two cameras are consistent, and not every window shows their order.
  const bool are_swapped = std::ranges::any_of(suspected_, [](const Suspected& s) {
    return s.mistake.kind == MistakeKind::swapped && s.times >= consistency.min_times;
  });
  for (const Mistake& mistake : found) {
    if (are_swapped && mistake.kind == MistakeKind::other_rig) continue;
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
    const int needed = (s.mistake.kind == MistakeKind::contradiction ? 2 : 1) * consistency.min_times;
    const bool is_sure = s.times >= needed;
    if (is_sure) mistakes_.push_back(s.mistake);
    if (is_sure || s.last_s > now_s - suspected_for_s) suspected_mistakes_.push_back(s.mistake);
  }
}

}  // namespace huetrack::view_watch
