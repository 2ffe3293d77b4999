#include "room_watch/camera_watch.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>
#include <span>

#include "calib/model/median.h"

namespace huetrack::room_watch {
namespace {

using capture::Duration;
using capture::Timestamp;
using std::chrono::milliseconds;

struct RoomLearningTuning {
  int frames = 8;              // averaged per patch, against noise and flicker
  int pause_ms = 80;           // between them: learning takes less than a second
  float min_texture = 1.5f;    // of a patch; with noise of 3 grey levels it is then found to 0.2 blocks
  double object_margin = 1.3;  // of an object's radius, inside which patches are occluded
  int min_patches = 10;        // fewer do not outvote a person
  int memory_ms = 30000;       // of rotations; a patch that was replaced for so long is learnt anew
};
constexpr RoomLearningTuning room_learning{};

// Surveys: when all patches are measured, and which fit is accepted.
struct RoomSurveyTuning {
  int recent = 6;                     // measurements that are judged together, about 1 us each
  double displaced_blocks = 1.0;      // a patch farther from its prediction is displaced
  double min_share = 0.5;             // of the observable patches that must agree with a rotation
  double most_share = 0.8;            // of the patches: "most"; a fit with fewer inliers may be a zoom
  int calm_pause_ms = 1000;           // between fits; between measurements of replaced patches; until a view is lost
  int alert_ms = 5000;                // how long an alert lasts; small turns that follow so soon are one sagging
  int settling_ms = 150;              // between surveys after news, and between two that are to agree
  int search_blocks = 32;             // reach of the search for displaced patches: 4 to 5 degrees of a usual lens
  std::size_t searched_patches = 16;  // the ones with most texture
};
constexpr RoomSurveyTuning room_survey{};
constexpr Duration settling = milliseconds(room_survey.settling_ms);
constexpr Duration calm_pause = milliseconds(room_survey.calm_pause_ms), alert = milliseconds(room_survey.alert_ms);
// Measurements per second and camera: what is judged together takes a pause, in an alert as long as a view settles.
constexpr double calm_rate_hz = 1e3 * room_survey.recent / room_survey.calm_pause_ms;
constexpr double alert_rate_hz = 1e3 * room_survey.recent / room_survey.settling_ms;
// Between surveys without news; between hurries; until a kept room is given up.
constexpr Duration max_pause = 2 * calm_pause;

struct RoomTurnTuning {
  double min_turn_rad = 0.9e-3;  // reported: 0.05 degrees, 3 mm at 3 m
  double min_zoom = 0.006;       // a step of 15 mm towards a room at 2.5 m; a focus ring does more
  double sure_sigmas = 5;        // of a turn or a zoom
  double repeat_blocks = 0.12;   // by which two surveys of a still camera differ at most, in the picture
  int knock_ms = 900;        // a knock takes at most so long, with its shaking; a small turn is observed for so long
  double knock_share = 0.6;  // of a turn that happened within that: a knock
  double small_turns = 4;    // in min_turn_rad; a smaller turn may be the beginning of sagging
};
constexpr RoomTurnTuning room_turn{};
constexpr double small_turn_rad = room_turn.small_turns * room_turn.min_turn_rad;
constexpr Duration knock = milliseconds(room_turn.knock_ms);

// Focus. Found::loss is in units of what a blur of one block removes. In pictures of rooms a Gaussian of 0.7, 1.5, 3
// blocks removes 0.7, 1.5, 2.5, and nearly as much from four patches of five; JPEG of quality 15 after 90 up to 0.7 in
// the median, but nothing from one of five. For blocks of one pixel; larger ones average codec and noise, and losses
// are significant by the root of their side earlier.
struct RoomFocusTuning {
  float min_loss = 0.6f;         // median over the patches; half of it keeps the state, and counts for a patch
  float sure_sigmas = 2;         // of a patch's loss
  float max_loss_sigma = 1.f;    // of a patch that has a vote
  double min_correlation = 0.9;  // of a blurred patch in its place; something else has it once in fifty
};
constexpr RoomFocusTuning room_focus{};
constexpr std::array strong_blurs{3.0, 4.0, 5.5, 7.5};  // maths: nodes of a search, blocks

// Changes of the room. People who stand sway by some millimetres in three seconds, a quarter of a block at 4 m.
struct RoomChangeTuning {
  int rest_ms = 3000;       // without motion; twice as long where it is plain, as only its edges show motion
  double noise_sigmas = 3;  // of two measurements
  float plain_rms = 8;      // grey levels; noise and a lamp's flicker are below
  int min_patches = 2;      // one alone may be a screen or a leaf
};
constexpr RoomChangeTuning room_change{};

constexpr int image_margin = patch_side / 2;  // blocks

bool is_before(const Eigen::Vector2d& px, double half_px, std::span<const Occluder> objects) {
  return std::ranges::any_of(objects, [&](const Occluder& disc) {
    return (disc.px - px).norm() < room_learning.object_margin * disc.radius_px + half_px;
  });
}

Eigen::Vector2d centre_of(const Eigen::Vector2i& corner) {
  return corner.cast<double>().array() + double(seen_side - 1) / 2;
}

double angle_between(const Eigen::Vector3d& before, const Eigen::Vector3d& after) {
  return rotation_between(before, after).norm();
}

std::uint8_t rounded(float value) {
  return static_cast<std::uint8_t>(std::lround(value));
}

}  // namespace

std::string_view name(RoomState state) {
  static constexpr std::string_view names[] = {"learning", "plain",     "still",   "moving",  "knocked", "sagging",
                                               "zoomed",   "defocused", "changed", "blinded", "hidden"};
  static_assert(std::size(names) == std::size_t(RoomState::hidden) + 1);
  return names[std::size_t(state)];
}

CameraWatch::CameraWatch(const calib::Camera& camera, std::span<const KeptPatch> known)
    : camera_(camera),
      scale_(scale_for(camera.image_size.width)),
      loss_unit_(1 / std::sqrt(float(scale_))),
      innovations_(std::size_t(room_survey.recent)) {
  for (const KeptPatch& kept : known) {
    const auto patch = make_patch(block_of(kept.px), kept.seen);
    const auto ray = camera_.model.ray({kept.px});
    if (patch && ray) watched_.push_back({.patch = *patch, .cell = kept.cell, .ray = *ray});
  }
  is_kept_ = int(watched_.size()) >= room_learning.min_patches;
  if (!is_kept_) watched_.clear();
}

Eigen::Vector2d CameraWatch::block_of(const Eigen::Vector2d& px) const {
  return (px.array() - double(scale_ - 1) / 2) / double(scale_);
}

Eigen::Vector2d CameraWatch::pixel_of(const Eigen::Vector2d& block) const {
  return block.array() * double(scale_) + double(scale_ - 1) / 2;
}

double CameraWatch::repeat_rad() const {
  return room_turn.repeat_blocks * double(scale_) / camera_.model.fx();
}

// The loss that counts for a patch, and that keeps the state of the focus.
float CameraWatch::min_patch_loss() const {
  return loss_unit_ * room_focus.min_loss / 2;
}

Aim CameraWatch::aim() const {
  return {condition_.rotation, has_zoomed_now() ? condition_.zoom : 0};
}

bool CameraWatch::has_zoomed_now() const {
  return std::abs(condition_.zoom) > std::max(room_turn.min_zoom, room_turn.sure_sigmas * condition_.zoom_sigma);
}

std::vector<KeptPatch> CameraWatch::room() const {
  std::vector<KeptPatch> kept;
  for (const Watched& w : watched_) {
    // Where it was before the camera was turned; exact to a fraction of a block for patches learnt later.
    const auto px = camera_.model.project(w.ray);
    if (px && !w.differs_since) kept.push_back({px->px, w.cell, w.patch.seen});
  }
  return kept;
}

void CameraWatch::set_state(RoomState state, Timestamp at) {
  if (condition_.state == state) return;
  condition_.state = state;
  condition_.since = at;
}

void CameraWatch::look(const capture::Frame& frame, std::span<const Occluder> objects) {
  if (frame.status != capture::FrameStatus::ok || frame.pixels.width != camera_.image_size.width ||
      frame.pixels.height != camera_.image_size.height)
    return;
  const capture::Image* const picture = own_picture_of(frame);
  if (picture == nullptr) return;  // of matches: with one of the next frames
  const Luma luma(*picture, scale_);
  const Timestamp at = frame.captured_at;
  if (!has_begun_) {
    has_begun_ = true;
    condition_.since = at;
    if (is_kept_) {
      next_survey_ = at;
      pending_since_ = at;
      alert_until_ = at + alert;
    } else {
      start_learning(luma);
    }
  }
  if (!learning_.empty()) learn(luma, at, objects);
  if (!watched_.empty()) watch(luma, at, objects);
  last_at_ = at;
}

// ---- Learning

void CameraWatch::start_learning(const Luma& luma) {
  for (const ChosenPatch& chosen : choose_patches(luma, image_margin)) learning_.push_back({.where = chosen});
}

void CameraWatch::learn(const Luma& luma, Timestamp at, std::span<const Occluder> objects) {
  if (last_learnt_at_ && at - *last_learnt_at_ < milliseconds(room_learning.pause_ms)) return;
  last_learnt_at_ = at;
  const double half_px = double(seen_side * scale_) / std::sqrt(2.0);
  bool is_over = false;
  for (PatchMean& mean : learning_) {
    SeenBlocks now;
    if (!luma.read(mean.where.corner.x(), mean.where.corner.y(), seen_side, seen_side, now.data())) {
      mean.is_spoilt = true;
    } else {
      for (std::size_t k = 0; k < now.size(); ++k) mean.sum[k] += now[k];
    }
    mean.is_spoilt = mean.is_spoilt || is_before(pixel_of(centre_of(mean.where.corner)), half_px, objects);
    is_over = ++mean.frames >= room_learning.frames || is_over;
  }
  if (is_over) end_learning(at);
}

void CameraWatch::end_learning(Timestamp at) {
  for (const PatchMean& mean : learning_) {
    if (mean.is_spoilt) continue;
    SeenPatch seen;
    for (std::size_t k = 0; k < seen.size(); ++k) seen[k] = rounded(mean.sum[k] / float(mean.frames));
    const Eigen::Vector2d centre = centre_of(mean.where.corner);
    const auto patch = make_patch(centre, seen);
    const auto ray = camera_.model.ray({pixel_of(centre)});
    if (!patch || !ray || patch->least_texture < room_learning.min_texture) continue;
    watched_.push_back({.patch = *patch, .cell = mean.where.cell, .ray = turned_back(condition_.rotation, *ray)});
  }
  learning_.clear();
  condition_.patches = int(watched_.size());
  if (int(watched_.size()) < room_learning.min_patches) {
    watched_.clear();
    set_state(RoomState::plain, at);
  } else if (condition_.state == RoomState::learning) {
    set_state(RoomState::still, at);
    next_survey_ = at + settling;
    next_fit_ = at + calm_pause;
  }
}

// ---- Watching

void CameraWatch::watch(const Luma& luma, Timestamp at, std::span<const Occluder> objects) {
  condition_.patches = int(watched_.size());
  if (is_kept_ && condition_.state == RoomState::learning) {
    if (at >= next_survey_) survey(luma, at, objects);
    return;
  }
  const double since_s = last_at_ ? std::clamp(capture::seconds(at - *last_at_), 0.0, 1.0) : 0;
  const bool is_fast = at < alert_until_ || at < hurry_until_;
  due_ = std::min(due_ + since_s * (is_fast ? alert_rate_hz : calm_rate_hz), double(watched_.size()));
  for (; due_ >= 1; due_ -= 1) {
    Watched& watched = watched_[next_];
    // layout: coprime steps, so that consecutive patches are apart in the image, because one person is not everywhere
    next_ = (next_ + 7) % watched_.size();
    if (watched_.size() % 7 == 0 && next_ < 7) next_ = (next_ + 1) % 7;
    if (measure(watched, luma, at, aim(), objects)) note_innovation(watched, at);
  }
  measure_replaced(luma, at, objects);
  const bool is_waiting = history_.empty() || pending_ || lost_since_ || blurred_since_;
  if (at >= next_survey_ && (is_waiting || is_suspicious())) {
    survey(luma, at, objects);
  } else if (at >= next_fit_) {
    next_fit_ = at + (at < alert_until_ ? calm_pause / 2 : calm_pause);
    fit_recent(at);
    relearn_replaced(luma, at);
  }
}

// Registers a patch where `aim` predicts it. False: it is not observable.
bool CameraWatch::measure(Watched& watched, const Luma& luma, Timestamp at, const Aim& aim,
                          std::span<const Occluder> objects) {
  const auto expected = room_watch::pixel_of(camera_.model, aim, watched.ray);
  const double half_px = double(patch_side * scale_) / std::sqrt(2.0);
  watched.is_hidden = !expected || is_before(*expected, half_px, objects);
  if (watched.replacement && !next_replaced_) next_replaced_ = at + calm_pause;
  if (watched.is_hidden) return false;
  watched.expected_px = *expected;
  const Found found = find(watched.patch, luma, block_of(*expected));
  if (found.outcome == Found::Outcome::outside) {
    watched.is_hidden = true;
    return false;
  }
  watched.contrast = found.contrast / watched.patch.contrast();
  if (found.outcome == Found::Outcome::differs) {
    if (!watched.differs_since) watched.differs_since = at;
    watched.seen_at.reset();
    note_replacement(watched, luma, at);
    return true;
  }
  watched.seen_at = at;
  watched.replacement.reset();
  if (!watched.first_loss) watched.first_loss = is_kept_ ? 0 : std::clamp(found.loss, 0.f, 1.f);
  const float known = 1 - *watched.first_loss;  // 0: infinite sigma, no vote
  watched.loss = (found.loss - *watched.first_loss) / known;
  watched.loss_sigma = found.loss_sigma / known;
  watched.px = pixel_of(found.centre);
  watched.sigma_px = std::max(patch_fit.settled_blocks, double(found.sigma)) * double(scale_);
  return true;
}

// Keeps what is there instead, and whether it is the same as before.
void CameraWatch::note_replacement(Watched& watched, const Luma& luma, Timestamp at) {
  auto& then = watched.replacement;
  if (is_defocused_ || blurred_since_ || lost_since_) {
    then.reset();
    return;
  }
  const Eigen::Vector2i here =
      (block_of(watched.expected_px).array() - double(seen_side - 1) / 2).round().cast<int>().matrix();
  if (then && (then->corner - here).cwiseAbs().maxCoeff() > 1) then.reset();
  const Eigen::Vector2i corner = then ? then->corner : here;
  SeenBlocks read;
  if (!luma.read(corner.x(), corner.y(), seen_side, seen_side, read.data())) return;
  if (then) {
    then->is_same = is_same(*then, luma, centre_of(corner), read);
    if (then->is_same) return;
  }
  Replacement now{.corner = corner, .since = at};
  std::ranges::transform(read, now.seen.begin(), rounded);
  now.patch = make_patch(centre_of(corner), now.seen);
  now.contrast = now.patch ? now.patch->contrast() : 0;
  if (now.patch && now.patch->least_texture < room_learning.min_texture) now.patch.reset();
  then = std::make_unique<Replacement>(now);
  if (!next_replaced_) next_replaced_ = at + calm_pause;
}

// now: the blocks at its place, as `seen`.
bool CameraWatch::is_same(const Replacement& then, const Luma& luma, const Eigen::Vector2d& centre,
                          std::span<const float> now) {
  if (then.patch) {
    const Found again = find(*then.patch, luma, centre);
    // What two surveys of a still camera differ by, twice, as people sway by as much; and the noise of both.
    const double gate =
        std::hypot(2 * room_turn.repeat_blocks, room_change.noise_sigmas * std::numbers::sqrt2 * double(again.sigma));
    return again.outcome == Found::Outcome::found && (again.centre - centre).norm() < gate;
  }
  float square = 0;
  for (std::size_t k = 0; k < now.size(); ++k) {
    const float step = now[k] - float(then.seen[k]);
    square += step * step / float(now.size());
  }
  return square < room_change.plain_rms * room_change.plain_rms;
}

// Measures replaced patches again; where a replacement stays, all patches once.
void CameraWatch::measure_replaced(const Luma& luma, Timestamp at, std::span<const Occluder> objects) {
  if (!next_replaced_ || at < *next_replaced_) return;
  next_replaced_.reset();
  bool is_looking_around = false;
  for (Watched& w : watched_) {
    if (!w.replacement) continue;
    measure(w, luma, at, aim(), objects);
    is_looking_around = is_looking_around || (w.replacement && w.replacement->is_same);
  }
  if (!is_looking_around || (looked_around_at_ && at - *looked_around_at_ < alert)) return;
  looked_around_at_ = at;
  for (Watched& w : watched_)
    if (!w.replacement) measure(w, luma, at, aim(), objects);
}

bool CameraWatch::is_resting(const Watched& watched, Timestamp at) const {
  if (!watched.replacement || watched.is_hidden) return false;
  const Duration needed = (watched.replacement->patch ? 1 : 2) * milliseconds(room_change.rest_ms);
  return watched.replacement->is_same && at - watched.replacement->since >= needed;
}

// A resting replacement beside a moving one may be part of it: a person who stands there.
void CameraWatch::judge_change(Timestamp at) {
  Change change;
  int plain = 0;
  for (const Watched& w : watched_) {
    if (!is_resting(w, at)) continue;
    const auto is_restless_neighbour = [&](const Watched& other) {
      const int columns = std::abs(w.cell % cell_columns - other.cell % cell_columns);
      const int rows = std::abs(w.cell / cell_columns - other.cell / cell_columns);
      return columns + rows <= 1 && other.differs_since && !other.is_hidden && other.replacement &&
             !other.replacement->is_same;
    };
    if (condition_.state != RoomState::changed && std::ranges::any_of(watched_, is_restless_neighbour)) continue;
    ++change.patches;
    change.middle += w.expected_px.cwiseQuotient(Eigen::Vector2d(camera_.image_size.width, camera_.image_size.height));
    plain += w.replacement->contrast < patch_fit.min_contrast * w.patch.contrast() ? 1 : 0;
  }
  if (change.patches > 0) change.middle /= change.patches;
  // A person may be in front of a reported change.
  const bool is_any = std::ranges::any_of(watched_, [](const Watched& w) { return w.replacement != nullptr; });
  if (condition_.state == RoomState::changed && change.patches == 0 && is_any) return;
  change.share = double(change.patches) / double(watched_.size());
  change.is_plain = 2 * plain > change.patches;
  condition_.change = change;
}

// After two displaced patches in a row more are measured at once, but not again and again for a person who stands
// there.
void CameraWatch::hurry(Timestamp at) {
  if (++off_in_a_row_ < 2 || at < next_hurry_) return;
  next_hurry_ = at + max_pause;
  hurry_until_ = at + settling;
}

void CameraWatch::note_innovation(const Watched& watched, Timestamp at) {
  Innovation& innovation = innovations_[innovation_count_++ % innovations_.size()];
  innovation = {};
  if (!watched.seen_at) {
    hurry(at);
    return;
  }
  const bool is_sure = std::abs(watched.loss) > room_focus.sure_sigmas * watched.loss_sigma;
  innovation = {true, watched.px - watched.expected_px, is_sure ? watched.loss : 0.f};
  const double off_blocks = innovation.off_px.norm() / scale_;
  const bool is_displaced = off_blocks >= room_survey.displaced_blocks;
  if (!is_displaced) last_agreed_at_ = at;
  const bool is_blurred = std::abs(innovation.loss) > min_patch_loss() && !is_defocused_;
  if (is_displaced || is_blurred) {
    hurry(at);
  } else {
    off_in_a_row_ = 0;
  }
}

bool CameraWatch::is_suspicious() const {
  if (innovation_count_ < innovations_.size()) return false;
  int off = 0, found = 0, blurred = 0;
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  for (const Innovation& of_patch : innovations_) {
    const bool is_near = of_patch.is_found && of_patch.off_px.norm() < room_survey.displaced_blocks * scale_;
    off += is_near ? 0 : 1;
    blurred += std::abs(of_patch.loss) > min_patch_loss() ? 1 : 0;
    if (!is_near) continue;
    ++found;
    sum += of_patch.off_px;
  }
  const auto are_many = [](int count) { return count > room_survey.min_share * room_survey.recent; };
  if (are_many(off)) return true;
  // All but one: noise does that once in ten days.
  if (is_defocused_ ? !are_many(blurred) : blurred >= room_survey.recent - 1) return true;
  return are_many(found) && (sum / found).norm() > room_turn.repeat_blocks * scale_;
}

std::optional<RotationFit> CameraWatch::fit_all(const Luma& luma, Timestamp at, const Aim& from,
                                                std::span<const Occluder> objects, int& observable) {
  observable = 0;
  std::vector<SeenRay> seen;
  for (Watched& watched : watched_) {
    if (!measure(watched, luma, at, from, objects)) continue;
    ++observable;
    if (watched.seen_at) seen.push_back({watched.ray, watched.px, watched.sigma_px});
  }
  auto fit = fit_rotation(camera_.model, seen, from, 2 * room_survey.displaced_blocks * scale_);
  if (!fit ||
      fit->inliers < std::max(room_learning.min_patches * 2 / 3, int(std::ceil(room_survey.min_share * observable))))
    return std::nullopt;
  return fit;
}

// The blur, blocks, after which the patches look as the picture does, each in its place; 0: there is none.
double CameraWatch::strong_blur(const Luma& luma) const {
  double best = 0, best_sum = 0;
  for (const double blur : strong_blurs) {
    int observable = 0, alike = 0;
    double sum = 0;
    for (const Watched& w : watched_) {
      if (w.is_hidden) continue;
      const auto soft = blurred(w.patch, blur);
      if (!soft) continue;
      const Eigen::Vector2d place = block_of(w.expected_px);
      const double there = double(correlation(*soft, luma, place));
      ++observable;
      alike += there > room_focus.min_correlation && there > double(correlation(w.patch, luma, place)) ? 1 : 0;
      sum += there;
    }
    if (observable < room_learning.min_patches || alike < room_survey.min_share * observable || sum <= best_sum)
      continue;
    best = blur, best_sum = sum;
  }
  return best;
}

// Measures all patches at once, and judges them.
void CameraWatch::survey(const Luma& luma, Timestamp at, std::span<const Occluder> objects) {
  innovation_count_ = 0;
  int observable = 0;
  auto fit = fit_all(luma, at, aim(), objects, observable);
  const auto has_turned = [&] {
    return angle_between(condition_.rotation, fit->rotation) > repeat_rad() ||
           std::abs(fit->zoom - aim().zoom) > room_turn.min_zoom;
  };
  // A zoom that carries the outer patches too far away to be found looks like a turn to the others.
  const bool is_disputed = fit && fit->inliers < room_survey.most_share * observable && has_turned();
  double blur_blocks = 0;
  if ((!fit || is_disputed) && at >= next_relocation_) {
    relocation_pause_ = lost_since_ ? std::clamp<Duration>(2 * relocation_pause_, settling, alert) : settling;
    next_relocation_ = at + relocation_pause_;
    if (!fit) blur_blocks = strong_blur(luma);
    const auto guess = blur_blocks > 0 ? std::nullopt : relocate(luma, objects);
    int observable_there = 0;
    const auto there = guess ? fit_all(luma, at, *guess, objects, observable_there) : std::nullopt;
    if (there && (!fit || there->inliers > fit->inliers)) {
      fit = there;
    } else if (guess && fit) {
      fit_all(luma, at, aim(), objects, observable);
    }
  }
  const bool is_news = !fit || has_turned();
  survey_pause_ = is_news && fit ? settling : std::clamp<Duration>(2 * survey_pause_, settling, max_pause);
  next_survey_ = at + survey_pause_;
  if (is_news) alert_until_ = at + alert;
  // The camera still stood as before when the last patch was found in its place.
  if (is_news && fit && last_agreed_at_ && !history_.empty() && *last_agreed_at_ > history_.back().at &&
      angle_between(condition_.rotation, fit->rotation) > small_turn_rad)
    history_.push_back({*last_agreed_at_, condition_.rotation});
  next_fit_ = at + calm_pause;
  if (!fit && blur_blocks == 0) {
    judge_lost_view(at);
    return;
  }
  lost_since_.reset();
  judge_focus(at, blur_blocks);
  if (!fit) {
    if (is_defocused_) set_state(RoomState::defocused, at);
    if (blurred_since_) next_survey_ = next_relocation_ = at + settling;
    return;
  }
  accept(*fit, at, true);
  if (pending_ || blurred_since_) next_survey_ = at + settling;
}

// Found since then, with a significant loss or none.
bool CameraWatch::has_loss(const Watched& watched, Timestamp since) {
  return watched.seen_at && *watched.seen_at >= since && !watched.is_hidden &&
         watched.loss_sigma < room_focus.max_loss_sigma;
}

// Median loss of detail since that moment, if most patches of the whole picture lost some; otherwise 0.
float CameraWatch::common_loss(Timestamp since) const {
  std::vector<double> losses;
  for (const Watched& w : watched_)
    if (has_loss(w, since)) losses.push_back(double(w.loss));
  if (int(losses.size()) < room_learning.min_patches) return 0;
  const auto middle = float(calib::median_in_place(std::span(losses)));
  const float sign = middle < 0 ? -1 : 1;
  // Hysteresis: a blur that has begun need not grow.
  if (sign * middle < (blurred_since_ ? min_patch_loss() : loss_unit_ * room_focus.min_loss)) return 0;
  std::array<std::array<int, 2>, 4> quarters{};  // patches, those that lost
  for (const Watched& w : watched_) {
    if (!has_loss(w, since)) continue;
    auto& [patches, lost] = quarters[(2 * w.px.x() > camera_.image_size.width ? 1u : 0u) +
                                     (2 * w.px.y() > camera_.image_size.height ? 2u : 0u)];
    ++patches;
    lost += sign * w.loss > min_patch_loss() ? 1 : 0;
  }
  int all_lost = 0;
  for (const auto& [patches, lost] : quarters) {
    if (2 * lost < patches) return 0;
    all_lost += lost;
  }
  return all_lost < room_survey.most_share * double(losses.size()) ? 0 : middle;
}

// The blur, blocks, that explains those losses.
double CameraWatch::common_blur(Timestamp since) const {
  std::vector<double> blurs;
  for (const Watched& w : watched_)
    if (has_loss(w, since)) blurs.push_back(blur_of(w.patch, double(w.loss)));
  return calib::median_in_place(std::span(blurs));
}

// After a survey. blur_blocks: after which the patches were found, if only so.
void CameraWatch::judge_focus(Timestamp at, double blur_blocks) {
  const float loss = blur_blocks > 0 ? 1 : common_loss(at);
  if (loss == 0) {
    blurred_since_.reset();
    // Hysteresis: a reported blur ends below half of the loss.
    std::vector<double> losses;
    for (const Watched& w : watched_)
      if (w.seen_at == at && w.loss_sigma < room_focus.max_loss_sigma) losses.push_back(std::abs(double(w.loss)));
    if (is_defocused_ && !losses.empty() && calib::median_in_place(std::span(losses)) < double(min_patch_loss()))
      set_focus(false);
    return;
  }
  const double blur = loss < 0 ? double(loss) : blur_blocks > 0 ? blur_blocks : common_blur(at);
  if (!blurred_since_ && !is_defocused_) blurred_since_ = at;
  if (is_defocused_ || at - *blurred_since_ >= knock) {  // longer than by shaking
    set_focus(true);
    condition_.blur_px = blur * scale_;
  }
}

void CameraWatch::set_focus(bool is_defocused) {
  is_defocused_ = is_defocused;
  blurred_since_.reset();
  condition_.blur_px = 0;
  for (Watched& w : watched_) w.replacement.reset();
}

// Searches the patches with most texture far away.
std::optional<Aim> CameraWatch::relocate(const Luma& luma, std::span<const Occluder> objects) const {
  std::vector<const Watched*> order;
  for (const Watched& w : watched_) order.push_back(&w);
  std::ranges::stable_sort(order, std::ranges::greater{}, [](const Watched* w) { return w->patch.least_texture; });
  std::vector<SeenRay> seen;
  std::size_t searched = 0;
  for (const Watched* w : order) {
    const auto expected = room_watch::pixel_of(camera_.model, aim(), w->ray);
    if (!expected || is_before(*expected, double(patch_side * scale_), objects)) continue;
    if (searched++ == room_survey.searched_patches) break;
    if (const auto place = search(w->patch, luma, block_of(*expected), room_survey.search_blocks))
      seen.push_back({w->ray, pixel_of(*place), 0.5 * scale_});
  }
  return guess_aim(camera_.model, seen, 2 * room_survey.displaced_blocks * scale_);
}

// Fits the measurements of the last round over all patches.
void CameraWatch::fit_recent(Timestamp at) {
  const double rate = at < alert_until_ ? alert_rate_hz : calm_rate_hz;
  const Duration recent = capture::duration_of(double(watched_.size()) / rate);
  std::vector<SeenRay> seen;
  int observable = 0;
  for (const Watched& w : watched_) {
    const bool is_seen = w.seen_at && at - *w.seen_at <= recent;
    if (w.is_hidden || (!is_seen && !w.differs_since)) continue;
    ++observable;
    if (is_seen) seen.push_back({w.ray, w.px, w.sigma_px});
  }
  const auto fit = fit_rotation(camera_.model, seen, aim(), room_survey.displaced_blocks * scale_);
  if (!fit || fit->inliers < std::max(room_learning.min_patches * 2 / 3, int(room_survey.min_share * observable)))
    return;
  accept(*fit, at, false);
}

void CameraWatch::accept(const RotationFit& full, Timestamp at, bool is_survey) {
  // A zoom that may be the fit's error is taken as none.
  const bool has_zoom = std::abs(full.zoom) > room_turn.sure_sigmas * full.zoom_sigma;
  const RotationFit fit = has_zoom ? full : without_zoom(full);
  const double zoom = room_watch::zoom_instead(full, reported_).value_or(0);
  zoom_instead_ = std::abs(zoom) > room_turn.min_zoom ? zoom : 0;
  // A patch that was found but disagrees with the rotation is no part of the room any more.
  for (Watched& w : watched_) {
    if (!w.seen_at || w.is_hidden) continue;
    const auto expected = room_watch::pixel_of(camera_.model, {fit.rotation, fit.zoom}, w.ray);
    const bool agrees = expected && (*expected - w.px).norm() < room_survey.displaced_blocks * scale_;
    if (agrees) w.differs_since.reset();
    if (!agrees && !w.differs_since) w.differs_since = at;
  }
  const auto before = std::ranges::find_if(history_, [&](const Snapshot& s) { return at - s.at <= alert; });
  if (before != history_.end() && angle_between(before->rotation, fit.rotation) > repeat_rad())
    alert_until_ = std::max(alert_until_, at + alert);
  condition_.rotation = fit.rotation;
  condition_.covariance = fit.covariance;
  condition_.shift_to_rotation = fit.shift_to_rotation;
  condition_.zoom = fit.zoom;
  condition_.zoom_sigma = fit.zoom_sigma;
  condition_.inliers = fit.inliers;
  history_.push_back({at, fit.rotation});
  while (at - history_.front().at > milliseconds(room_learning.memory_ms)) history_.pop_front();
  judge_turn(fit, at, is_survey);
}

void CameraWatch::judge_turn(const RotationFit& fit, Timestamp at, bool is_survey) {
  const double sigma = std::sqrt(fit.covariance.diagonal().maxCoeff());
  const double change = angle_between(reported_, fit.rotation);
  const bool is_zoomed = has_zoomed_now();
  if (is_zoomed && !zoomed_since_) zoomed_since_ = at;
  if (!is_zoomed) zoomed_since_.reset();
  const bool has_zoomed = zoomed_since_ && at - *zoomed_since_ >= settling;
  const bool is_back = fit.rotation.norm() < room_turn.min_turn_rad / 2;
  if (change <= std::max(room_turn.min_turn_rad, room_turn.sure_sigmas * sigma)) {
    judge_no_turn(has_zoomed, is_back, at);
    return;
  }
  // A turn is reported when two surveys agree on it. A sagging camera turns little between them.
  const double agreed = std::max(repeat_rad(), room_turn.sure_sigmas * sigma);
  const bool is_settled = pending_ && angle_between(pending_->rotation, fit.rotation) < agreed;
  if (pending_ && !is_settled) set_state(RoomState::moving, at);
  if (!pending_) pending_since_ = at, settled_.reset();
  pending_ = Snapshot{at, fit.rotation};
  if (!is_settled && at - pending_since_ < 2 * knock) return;  // then it is reported, however it shakes
  if (!is_survey) return;
  if (!settled_) settled_ = pending_;
  const bool is_small = change < small_turn_rad;
  if (is_small && at - settled_->at < knock) return;
  const bool goes_on = is_small && angle_between(settled_->rotation, fit.rotation) > std::max(repeat_rad(), 2 * sigma);
  pending_.reset();
  if (has_zoomed) {
    reported_ = fit.rotation;
    set_state(is_defocused_ ? RoomState::defocused : RoomState::zoomed, at);
    return;
  }
  // Turned back where it was: no turn of its own.
  if (is_back && condition_.turn) {
    reported_.setZero();
    condition_.turn.reset();
    set_state(is_defocused_ ? RoomState::defocused : RoomState::still, at);
    return;
  }
  report(turn_since(at, reported_, fit.rotation), goes_on, is_small, at);
}

void CameraWatch::judge_no_turn(bool has_zoomed, bool is_back, Timestamp at) {
  pending_.reset();
  judge_change(at);
  const int needed = condition_.state == RoomState::changed ? 1 : room_change.min_patches;
  const RoomState quiet = condition_.change.patches >= needed ? RoomState::changed : RoomState::still;
  if (is_defocused_) {
    set_state(RoomState::defocused, at);
  } else if (blurred_since_) {
    return;  // focusing may zoom a little
  } else if (has_zoomed) {
    set_state(RoomState::zoomed, at);
  } else if (is_back || condition_.state == RoomState::learning) {
    if (is_back) reported_.setZero(), condition_.turn.reset();
    set_state(quiet, at);
  } else if (condition_.state != RoomState::knocked && condition_.state != RoomState::sagging) {
    set_state(condition_.turn ? (condition_.turn->is_slow ? RoomState::sagging : RoomState::knocked) : quiet, at);
  }
}

// A camera that goes on sagging is reported once.
void CameraWatch::report(Turn turn, bool goes_on, bool is_small, Timestamp at) {
  const auto& last = condition_.turn;
  const bool was_small = last && angle_between(last->before, last->after) < small_turn_rad;
  const bool was_slow = last && last->is_slow;
  const bool is_soon = last && at - last->until < alert;
  turn.is_slow = turn.is_slow || goes_on || (is_small && (was_slow || (was_small && is_soon)));
  if (turn.is_slow && (was_slow || (was_small && is_soon))) {
    condition_.turn->is_slow = true;
    condition_.turn->until = turn.until;
    condition_.turn->after = turn.after;
  } else {
    condition_.turn = turn;
    ++condition_.turns;
  }
  condition_.zoom_instead = zoom_instead_;
  reported_ = turn.after;
  set_state(turn.is_slow ? RoomState::sagging : RoomState::knocked, at);
}

// Whether most of it happened at once, and when.
Turn CameraWatch::turn_since(Timestamp at, const Eigen::Vector3d& before, const Eigen::Vector3d& after) const {
  const double all = angle_between(before, after);
  Turn turn{.is_slow = true, .from = at, .until = at, .before = before, .after = after};
  if (history_.size() < 2) {  // of a kept room: it happened before the start
    turn.is_slow = false;
    return turn;
  }
  double most = 0;
  for (std::size_t i = 0; i < history_.size(); ++i) {
    for (std::size_t j = i + 1; j < history_.size(); ++j) {
      const double part = angle_between(history_[i].rotation, history_[j].rotation);
      // No camera sags as far as that between consecutive fits.
      const bool is_jump = j == i + 1 && part > small_turn_rad;
      if (history_[j].at - history_[i].at > knock && !is_jump) break;
      if (part <= most + repeat_rad()) continue;  // of equal intervals the shortest
      most = part;
      turn.from = history_[i].at, turn.until = history_[j].at;
    }
  }
  turn.is_slow = most < room_turn.knock_share * all;
  if (!turn.is_slow) return turn;
  turn.until = at;
  for (const Snapshot& s : history_)
    if (angle_between(before, s.rotation) < repeat_rad()) turn.from = s.at;
  return turn;
}

void CameraWatch::judge_lost_view(Timestamp at) {
  if (is_kept_ && condition_.state == RoomState::learning) {
    if (at - pending_since_ < max_pause) return;
    // The light or the room is another one: it is learnt as it is now.
    is_kept_ = false;
    has_forgotten_ = true;
    learn_anew();
    return;
  }
  if (!lost_since_) lost_since_ = at;
  if (at - *lost_since_ < calm_pause) {
    next_survey_ = std::min(next_survey_, *lost_since_ + calm_pause);
    return;
  }
  // Not found once since it was learnt: what moved was taken for the room, as before a plain wall.
  if (history_.empty()) {
    learn_anew();
    set_state(RoomState::learning, at);
    return;
  }
  std::vector<double> contrasts;
  for (const Watched& w : watched_)
    if (!w.is_hidden) contrasts.push_back(double(w.contrast));
  const bool is_blind =
      !contrasts.empty() && calib::median_in_place(std::span(contrasts)) < double(patch_fit.min_contrast);
  set_state(is_blind ? RoomState::blinded : RoomState::hidden, *lost_since_);
}

void CameraWatch::learn_anew() {
  has_begun_ = false;
  watched_.clear();
  last_learnt_at_.reset();
  lost_since_.reset();
}

void CameraWatch::relearn_replaced(const Luma& luma, Timestamp at) {
  if (!learning_.empty() || at < alert_until_ || lost_since_ || is_defocused_) return;
  const auto is_old = [&](const Watched& w) {
    return w.differs_since && at - *w.differs_since > milliseconds(room_learning.memory_ms);
  };
  if (std::ranges::none_of(watched_, is_old)) return;
  const auto chosen = choose_patches(luma, image_margin);
  for (const Watched& w : watched_) {
    if (!is_old(w)) continue;
    const auto there = std::ranges::find(chosen, w.cell, &ChosenPatch::cell);
    if (there != chosen.end()) learning_.push_back({.where = *there});
  }
  std::erase_if(watched_, is_old);
  next_ = 0;
}

}  // namespace huetrack::room_watch
