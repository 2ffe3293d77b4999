#include "room_watch/camera_watch.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>
#include <span>

#include "calib/model/median.h"

namespace huetrack::room_watch {
namespace {

using namespace std::chrono_literals;
using capture::Duration;
using capture::Timestamp;

// Learning: the mean of so many frames, so far apart: noise and flicker are averaged, and it is over within a second.
constexpr int learning_frames = 8;
constexpr Duration learning_pause = 80ms;
constexpr float least_texture = 1.5f;  // of the mean; with noise of 3 grey levels a patch is then found to 0.2 blocks
constexpr int image_margin = 6;        // blocks

constexpr int least_patches = 10;      // fewer do not outvote a person
constexpr double least_share = 0.5;    // of the patches that could say something: more than that have to agree
constexpr double object_margin = 1.3;  // of an object's radius, and a patch's diagonal

// What makes a survey of all patches: of the last six, four that are gone or farther off than a block, or all of them
// off by so much on the average, which noise does once in weeks.
constexpr double far_blocks = 1.0, near_blocks = 0.4, mean_off_blocks = 0.15;
constexpr int many_of_six = 4;
constexpr Duration shortest_pause = 250ms, longest_pause = 2s;
constexpr Duration longest_relocation_pause = 8s;  // it costs as much as a hundred patches
constexpr Duration settling = 150ms;               // between two surveys that are to agree
constexpr Duration longest_moving = 1500ms;
constexpr Duration fit_pause = 1s, alert_fit_pause = 500ms;
constexpr Duration alert_for = 5s, hurry_for = 200ms, hurry_pause = 2s;

// Patches that are looked for per second: while all is well, and while something may be going on. Each costs about a
// microsecond.
constexpr double calm_rate_hz = 6, alert_rate_hz = 40;
constexpr double least_turn_rad = 0.9e-3;  // what is told: 0.05 degrees, 3 mm at 3 m
constexpr double least_zoom = 0.006;  // a step of 15 mm towards a room at 2.5 m looks like it; a focus ring does more

constexpr double sure_sigmas = 5;
constexpr double alike_blocks = 0.12;  // in a picture: what two surveys of a still camera differ by at most
// A zoom of 2 % that could not be seen is left out of the fit: patches on one side of the picture say a turn or a zoom.
constexpr double open_zoom = 0.02;
constexpr double disputed_share = 0.8;  // a turn that fewer agree with may be a zoom
constexpr double find_gate_blocks = 1.0, guess_gate_blocks = 2.0;
// What is searched for when nothing is where it was: as far as a knock turns a camera that is then still worth mending.
constexpr double search_reach_rad = 0.06;
constexpr int least_search_reach = 8, most_search_reach = 40;  // blocks
constexpr std::size_t searched_patches = 16;

constexpr Duration knock_takes = 800ms;  // at most, with its shaking
constexpr double shaking = 4;            // times what two looks of a still camera differ by
constexpr double knock_share = 0.6;      // of a turn that happened within that
// A small turn may be the beginning of sagging: it is looked at for so long whether it goes on, by more than this
// share.
constexpr double small_turns = 4;  // in least_turn_rad
constexpr Duration small_turn_is_watched = 900ms;
constexpr double goes_on_share = 0.25;
constexpr Duration one_sagging = 6s;  // steps that follow each other so soon, and are small, are one sagging
constexpr Duration history_kept = 30s;

constexpr Duration until_nothing_is_told = 1s;
constexpr float no_contrast = 0.3f;

// Focus. What is lost is a number per patch in units of what a blur of one block takes (Found::loss). In pictures of
// rooms (rendered/bumped, webcams, juggling) a Gaussian of 0.7, 1.5, 3 blocks takes 0.7, 1.5, 2.5, and from four
// patches of five nearly as much; JPEG of quality 15 after one of 90 takes up to 0.7 in the middle, but nothing from
// one of five. Those are of blocks of one pixel; of what codecs and noise do to pixels larger blocks see less, and by
// the square root of their side smaller losses are sure (at 1280 columns a blur of 1.4 px).
constexpr float least_loss = 0.6f, loss_of_most = 0.4f, loss_that_stays = 0.3f;
constexpr double most = 0.8;  // of the patches, and half of them in each quarter of the picture
// Of six looks so many, each by more than so many sigmas: noise does that once in ten days.
constexpr int many_lost_of_six = 5;
constexpr float sure_loss_sigmas = 2;
constexpr float knows_loss = 1.f;  // sigma of a patch that has a say
// The noise that was learnt with a patch is detail that is lost at the first look already, and lost whatever the focus.
constexpr float most_noise = 0.8f;
// A camera that shakes is blurred for a moment: it is told when it has been as blurred for so long, or growing for so
// long.
constexpr Duration focus_settling = 400ms, longest_focusing = 1200ms;
constexpr double same_blur = 0.2, same_blur_blocks = 0.15;
// Where the kept patches themselves are no longer found they are looked for as a lens shows them that is so far out of
// focus: each in its place, and liker than the sharp one, as of something else one in fifty is.
constexpr std::array strong_blurs{3.0, 4.0, 5.5, 7.5};
constexpr double like_blurred = 0.9;

// What stands in the room that was not there: it is looked at again every second. People who stand sway by some
// millimetres within three seconds, which is a quarter of a block at 4 m; in a plain piece of their clothes nothing is
// seen of that, so that more of their edges have to be waited for. One patch alone may be a screen or a leaf.
constexpr Duration other_pause = 1s, rests_for = 3s, plain_rests_for = 6s, looks_around_pause = 5s;
constexpr Duration passes_within = 10s;
constexpr double rests_blocks = 0.25;
constexpr float plain_rms = 6, plain_step = 10;  // grey levels: noise and a lamp's flicker stay below
constexpr int least_changed = 2;
constexpr Duration replaced_after = 40s;
constexpr Duration kept_patience = 2s;  // a kept room that is not found so long after the start is another one

}  // namespace

std::string_view name(RoomState state) {
  static constexpr std::string_view names[] = {"learning", "plain",     "still",   "moving",  "knocked", "sagging",
                                               "zoomed",   "defocused", "changed", "blinded", "hidden"};
  static_assert(std::size(names) == std::size_t(RoomState::hidden) + 1);
  return names[std::size_t(state)];
}

CameraWatch::CameraWatch(const calib::Camera& camera, std::span<const KeptPatch> known)
    : camera_(camera), scale_(scale_for(camera.image_size.width)), loss_unit_(1 / std::sqrt(float(scale_))) {
  for (const KeptPatch& kept : known) {
    const auto patch = make_patch(block_of(kept.px), kept.seen);
    const auto ray = camera_.model.ray({kept.px});
    if (patch && ray)
      watched_.push_back({.patch = *patch, .cell = kept.cell, .ray = *ray, .seen_at = {}, .differs_since = {}});
  }
  is_kept_ = int(watched_.size()) >= least_patches;
  if (!is_kept_) watched_.clear();
}

Eigen::Vector2d CameraWatch::block_of(const Eigen::Vector2d& px) const {
  return (px.array() - double(scale_ - 1) / 2) / double(scale_);
}

Eigen::Vector2d CameraWatch::pixel_of(const Eigen::Vector2d& block) const {
  return block.array() * double(scale_) + double(scale_ - 1) / 2;
}

double CameraWatch::alike_rad() const {
  return alike_blocks * double(scale_) / camera_.model.fx();
}

// Of what a zoom would be that is none, nothing is held.
Aim CameraWatch::aim() const {
  return {condition_.rotation, has_zoomed_now() ? condition_.zoom : 0};
}

bool CameraWatch::has_zoomed_now() const {
  return std::abs(condition_.zoom) > std::max(least_zoom, sure_sigmas * condition_.zoom_sigma);
}

std::vector<KeptPatch> CameraWatch::room() const {
  std::vector<KeptPatch> kept;
  for (const Watched& w : watched_) {
    // Where it was before the camera was turned; what was learnt later is seen from there at a fraction of a block.
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
      alert_until_ = at + alert_for;
    } else {
      choose(luma);
    }
  }
  if (!learning_.empty()) learn(luma, at, objects);
  if (!watched_.empty()) watch(luma, at, objects);
  last_at_ = at;
}

// ---- Learning

void CameraWatch::choose(const Luma& luma) {
  for (const ChosenPatch& chosen : choose_patches(luma, image_margin))
    learning_.push_back({.where = chosen, .sum = {}, .frames = 0, .is_spoilt = false});
}

namespace {

bool is_before(const Eigen::Vector2d& px, double half_px, std::span<const Occluder> objects) {
  return std::ranges::any_of(
      objects, [&](const Occluder& disc) { return (disc.px - px).norm() < object_margin * disc.radius_px + half_px; });
}

}  // namespace

void CameraWatch::learn(const Luma& luma, Timestamp at, std::span<const Occluder> objects) {
  if (last_learnt_at_ && at - *last_learnt_at_ < learning_pause) return;
  last_learnt_at_ = at;
  const double half_px = double(seen_side * scale_) / std::sqrt(2.0);
  bool is_over = false;
  for (PatchMean& mean : learning_) {
    std::array<float, std::size_t(seen_side) * seen_side> now;
    if (!luma.read(mean.where.corner.x(), mean.where.corner.y(), seen_side, seen_side, now.data())) {
      mean.is_spoilt = true;
    } else {
      for (std::size_t k = 0; k < now.size(); ++k) mean.sum[k] += now[k];
    }
    const Eigen::Vector2d centre = mean.where.corner.cast<double>().array() + double(seen_side - 1) / 2;
    mean.is_spoilt = mean.is_spoilt || is_before(pixel_of(centre), half_px, objects);
    is_over = ++mean.frames >= learning_frames || is_over;
  }
  if (is_over) end_learning(at);
}

void CameraWatch::end_learning(Timestamp at) {
  for (const PatchMean& mean : learning_) {
    if (mean.is_spoilt) continue;
    SeenPatch seen;
    for (std::size_t k = 0; k < seen.size(); ++k)
      seen[k] = static_cast<std::uint8_t>(std::lround(mean.sum[k] / float(mean.frames)));
    const Eigen::Vector2d centre = mean.where.corner.cast<double>().array() + double(seen_side - 1) / 2;
    const auto patch = make_patch(centre, seen);
    const auto ray = camera_.model.ray({pixel_of(centre)});
    if (!patch || !ray || patch->least_texture < least_texture) continue;
    watched_.push_back({.patch = *patch,
                        .cell = mean.where.cell,
                        .ray = turned_back(condition_.rotation, *ray),
                        .seen_at = {},
                        .differs_since = {}});
  }
  learning_.clear();
  condition_.patches = int(watched_.size());
  if (int(watched_.size()) < least_patches) {
    watched_.clear();
    set_state(RoomState::plain, at);
  } else if (condition_.state == RoomState::learning) {
    set_state(RoomState::still, at);
    next_survey_ = at + settling;
    next_fit_ = at + fit_pause;
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
  due_ = std::min(due_ + since_s * (at < alert_until_ || at < hurry_until_ ? alert_rate_hz : calm_rate_hz),
                  double(watched_.size()));
  for (; due_ >= 1; due_ -= 1) {
    Watched& watched = watched_[next_];
    // Coprime steps: patches that follow one another are apart in the image, as one person is not everywhere.
    next_ = (next_ + 7) % watched_.size();
    if (watched_.size() % 7 == 0 && next_ < 7) next_ = (next_ + 1) % 7;
    if (measure(watched, luma, at, aim(), objects)) note(watched, at);
  }
  look_at_others(luma, at, objects);
  const bool is_waiting = history_.empty() || pending_.has_value() || nothing_since_.has_value();
  if (at >= next_survey_ && (is_waiting || is_suspicious())) {
    survey(luma, at, objects);
  } else if (at >= next_fit_) {
    next_fit_ = at + (at < alert_until_ ? alert_fit_pause : fit_pause);
    fit_recent(at);
    replace_changed(luma, at);
  }
}

// Where a patch is now, looked for where that rotation has it. False: it cannot say anything.
bool CameraWatch::measure(Watched& watched, const Luma& luma, Timestamp at, const Aim& aim,
                          std::span<const Occluder> objects) {
  const auto expected = room_watch::pixel_of(camera_.model, aim, watched.ray);
  const double half_px = double(patch_side * scale_) / std::sqrt(2.0);
  watched.is_hidden = !expected || is_before(*expected, half_px, objects);
  if (watched.other && !next_other_) next_other_ = at + other_pause;
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
    note_other(watched, luma, at);
    return true;
  }
  watched.seen_at = at;
  watched.other.reset();
  if (!watched.loss_at_first) watched.loss_at_first = is_kept_ ? 0 : std::clamp(found.loss, 0.f, most_noise);
  const float known = 1 - *watched.loss_at_first;
  watched.loss = (found.loss - *watched.loss_at_first) / known;
  watched.loss_sigma = found.loss_sigma / known;
  watched.px = pixel_of(found.centre);
  watched.sigma_px = std::max(0.02, double(found.sigma)) * double(scale_);
  return true;
}

// What is there instead, and whether it is the same as it was.
void CameraWatch::note_other(Watched& watched, const Luma& luma, Timestamp at) {
  if (is_defocused_ || blurred_since_ || nothing_since_) {
    watched.other.reset();
    return;
  }
  const Eigen::Vector2i here =
      (block_of(watched.expected_px).array() - double(seen_side - 1) / 2).round().cast<int>().matrix();
  if (watched.other && (watched.other->corner - here).cwiseAbs().maxCoeff() > 1) watched.other.reset();
  const Eigen::Vector2i corner = watched.other ? watched.other->corner : here;
  const Eigen::Vector2d centre = corner.cast<double>().array() + double(seen_side - 1) / 2;
  std::array<float, std::size_t(seen_side) * seen_side> read;
  if (!luma.read(corner.x(), corner.y(), seen_side, seen_side, read.data())) return;
  if (watched.other) {
    watched.other->looked_at = at;
    watched.other->is_same = is_same(*watched.other, luma, centre, read);
    if (watched.other->is_same) return;
  }
  Other now{.corner = corner, .seen = {}, .patch = {}, .since = at, .looked_at = at};
  std::ranges::transform(read, now.seen.begin(), [](float v) { return static_cast<std::uint8_t>(std::lround(v)); });
  now.patch = make_patch(centre, now.seen);
  now.contrast = now.patch ? now.patch->contrast() : 0;
  if (now.patch && now.patch->least_texture < least_texture) now.patch.reset();
  watched.other = std::make_unique<Other>(now);
  if (!next_other_) next_other_ = at + other_pause;
}

// now: what is at its place, as `seen`.
bool CameraWatch::is_same(const Other& then, const Luma& luma, const Eigen::Vector2d& centre,
                          std::span<const float> now) {
  if (then.patch) {
    const Found again = find(*then.patch, luma, centre);
    // Both were seen with noise.
    const double gate = std::hypot(rests_blocks, 3 * std::numbers::sqrt2 * double(again.sigma));
    return again.outcome == Found::Outcome::found && (again.centre - centre).norm() < gate;
  }
  float mean = 0, square = 0;
  for (std::size_t k = 0; k < now.size(); ++k) {
    const float step = now[k] - float(then.seen[k]);
    mean += step / float(now.size()), square += step * step / float(now.size());
  }
  return std::abs(mean) < plain_step && square - mean * mean < plain_rms * plain_rms;
}

// Patches in whose place something else is are looked at again; where it stays, all of them once.
void CameraWatch::look_at_others(const Luma& luma, Timestamp at, std::span<const Occluder> objects) {
  if (!next_other_ || at < *next_other_) return;
  next_other_.reset();
  bool is_looking_around = false;
  for (Watched& w : watched_) {
    if (!w.other) continue;
    measure(w, luma, at, aim(), objects);
    is_looking_around = is_looking_around || (w.other && w.other->is_same);
  }
  if (!is_looking_around || (looked_around_at_ && at - *looked_around_at_ < looks_around_pause)) return;
  looked_around_at_ = at;
  for (Watched& w : watched_)
    if (!w.other) measure(w, luma, at, aim(), objects);
}

bool CameraWatch::is_resting(const Watched& watched, Timestamp at) const {
  if (!watched.other || watched.is_hidden) return false;
  const Duration needed = watched.other->patch ? rests_for : plain_rests_for;
  return watched.other->is_same && at - watched.other->since >= needed;
}

// What rests beside something that moves may be a part of that: somebody who stands there.
void CameraWatch::judge_change(Timestamp at) {
  Change change;
  int plain = 0;
  for (const Watched& w : watched_) {
    if (!is_resting(w, at)) continue;
    const auto is_restless = [&](const Watched& other) {
      const int columns = std::abs(w.cell % cell_columns - other.cell % cell_columns);
      const int rows = std::abs(w.cell / cell_columns - other.cell / cell_columns);
      return columns + rows <= 1 && other.differs_since && !other.is_hidden && other.other && !other.other->is_same;
    };
    if (condition_.state != RoomState::changed && std::ranges::any_of(watched_, is_restless)) continue;
    ++change.patches;
    change.middle += w.expected_px.cwiseQuotient(Eigen::Vector2d(camera_.image_size.width, camera_.image_size.height));
    plain += w.other->contrast < no_contrast * w.patch.contrast() ? 1 : 0;
  }
  if (change.patches > 0) change.middle /= change.patches, rested_at_ = at;
  // Who passes before what was told hides it for a while.
  const bool is_any = std::ranges::any_of(watched_, [](const Watched& w) { return w.other != nullptr; });
  if (condition_.state == RoomState::changed && change.patches == 0 && is_any && at - rested_at_ < passes_within)
    return;
  change.share = double(change.patches) / double(watched_.size());
  change.is_plain = 2 * plain > change.patches;
  condition_.change = change;
}

// Two in a row that are off: more of them are looked at at once, but not again and again for somebody who stands there.
void CameraWatch::hurry(Timestamp at) {
  if (++off_in_a_row_ < 2 || at < next_hurry_) return;
  next_hurry_ = at + hurry_pause;
  hurry_until_ = at + hurry_for;
}

void CameraWatch::note(const Watched& watched, Timestamp at) {
  Innovation& innovation = innovations_[innovation_count_++ % innovations_.size()];
  innovation = {};
  if (!watched.seen_at) {
    hurry(at);
    return;
  }
  const bool is_sure = std::abs(watched.loss) > sure_loss_sigmas * watched.loss_sigma;
  innovation = {true, watched.px - watched.expected_px, is_sure ? watched.loss : 0.f};
  const double off_blocks = innovation.off_px.norm() / scale_;
  if (off_blocks < near_blocks) last_agreed_at_ = at;
  const bool is_blurred = std::abs(innovation.loss) > loss_unit_ * loss_of_most && !is_defocused_;
  if (off_blocks >= far_blocks || is_blurred) {
    hurry(at);
  } else {
    off_in_a_row_ = 0;
  }
}

bool CameraWatch::is_suspicious() const {
  if (innovation_count_ < innovations_.size()) return false;
  int off = 0, found = 0, lost = 0;
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  for (const Innovation& of_patch : innovations_) {
    const bool is_near = of_patch.is_found && of_patch.off_px.norm() < far_blocks * scale_;
    off += is_near ? 0 : 1;
    lost += std::abs(of_patch.loss) > loss_unit_ * (is_defocused_ ? loss_that_stays : loss_of_most) ? 1 : 0;
    if (!is_near) continue;
    ++found;
    sum += of_patch.off_px;
  }
  if (off >= many_of_six) return true;
  if (is_defocused_ ? lost < many_of_six : lost >= many_lost_of_six) return true;
  return found >= many_of_six && (sum / found).norm() > mean_off_blocks * scale_;
}

std::optional<RotationFit> CameraWatch::fit_all(const Luma& luma, Timestamp at, const Aim& from,
                                                std::span<const Occluder> objects, int& could_say) {
  could_say = 0;
  std::vector<SeenRay> seen;
  for (Watched& watched : watched_) {
    if (!measure(watched, luma, at, from, objects)) continue;
    ++could_say;
    if (watched.seen_at) seen.push_back({watched.ray, watched.px, watched.sigma_px});
  }
  auto fit = fit_rotation(camera_.model, seen, from, 2 * find_gate_blocks * scale_);
  if (!fit || fit->held < std::max(least_patches * 2 / 3, int(std::ceil(least_share * could_say)))) return std::nullopt;
  return fit;
}

// The blur in blocks with which the room looks as it does, each patch in its place; 0: there is none.
double CameraWatch::strong_blur(const Luma& luma) const {
  double best = 0, best_sum = 0;
  for (const double blur : strong_blurs) {
    int could_say = 0, alike = 0;
    double sum = 0;
    for (const Watched& w : watched_) {
      if (w.is_hidden) continue;
      const auto soft = blurred(w.patch, blur);
      if (!soft) continue;
      const double there = double(correlation(*soft, luma, block_of(w.expected_px)));
      ++could_say;
      const bool is_alike = there > like_blurred && there > double(correlation(w.patch, luma, block_of(w.expected_px)));
      alike += is_alike ? 1 : 0;
      sum += there;
    }
    if (could_say < least_patches || alike < least_share * could_say || sum <= best_sum) continue;
    best = blur, best_sum = sum;
  }
  return best;
}

// All patches at once.
void CameraWatch::survey(const Luma& luma, Timestamp at, std::span<const Occluder> objects) {
  innovation_count_ = 0;
  int could_say = 0;
  auto fit = fit_all(luma, at, aim(), objects, could_say);
  const auto is_other = [&] {
    return rotation_between(condition_.rotation, fit->rotation).norm() > alike_rad() ||
           std::abs(fit->zoom - aim().zoom) > least_zoom;
  };
  // A zoom that carries the outer patches too far away to be found looks like a turn to the others.
  const bool is_disputed = fit && fit->held < disputed_share * could_say && is_other();
  double blur_blocks = 0;
  if ((!fit || is_disputed) && at >= next_relocation_) {
    relocation_pause_ = nothing_since_
                            ? std::clamp<Duration>(2 * relocation_pause_, shortest_pause, longest_relocation_pause)
                            : shortest_pause;
    next_relocation_ = at + relocation_pause_;
    if (!fit) blur_blocks = strong_blur(luma);
    const auto guess = blur_blocks > 0 ? std::nullopt : relocate(luma, objects);
    int could_say_there = 0;
    const auto there = guess ? fit_all(luma, at, *guess, objects, could_say_there) : std::nullopt;
    if (there && (!fit || there->held > fit->held)) {
      fit = there;
    } else if (guess && fit) {
      fit_all(luma, at, aim(), objects, could_say);
    }
  }
  const bool is_news = !fit || is_other();
  survey_pause_ =
      is_news && fit ? shortest_pause : std::clamp<Duration>(2 * survey_pause_, shortest_pause, longest_pause);
  next_survey_ = at + survey_pause_;
  if (is_news) alert_until_ = at + alert_for;
  // It still was as before when the last patch was found in its place.
  if (is_news && fit && last_agreed_at_ && !history_.empty() && *last_agreed_at_ > history_.back().at &&
      rotation_between(condition_.rotation, fit->rotation).norm() > small_turns * least_turn_rad)
    history_.push_back({*last_agreed_at_, condition_.rotation});
  next_fit_ = at + fit_pause;
  if (!fit && blur_blocks == 0) {
    judge_nothing(at);
    return;
  }
  nothing_since_.reset();
  judge_focus(at, blur_blocks);
  if (!fit) {
    if (is_defocused_) set_state(RoomState::defocused, at);
    if (blurred_since_) next_survey_ = next_relocation_ = at + settling;
    return;
  }
  take(*fit, at, true);
  if (pending_ || blurred_since_) next_survey_ = at + settling;
}

// What most patches have lost of their detail since that moment, all over the picture; 0: that is not so.
float CameraWatch::common_loss(Timestamp since) const {
  std::vector<double> losses;
  std::array<std::array<int, 2>, 4> quarters{};  // patches, those that lost
  for (const Watched& w : watched_)
    if (w.seen_at && *w.seen_at >= since && !w.is_hidden && w.loss_sigma < knows_loss) losses.push_back(double(w.loss));
  if (int(losses.size()) < least_patches) return 0;
  const auto middle = float(calib::median_in_place(std::span(losses)));
  const float sign = middle < 0 ? -1 : 1;
  if (sign * middle < loss_unit_ * least_loss) return 0;
  for (const Watched& w : watched_) {
    if (!w.seen_at || *w.seen_at < since || w.is_hidden || w.loss_sigma >= knows_loss) continue;
    auto& [patches, lost] = quarters[(2 * w.px.x() > camera_.image_size.width ? 1u : 0u) +
                                     (2 * w.px.y() > camera_.image_size.height ? 2u : 0u)];
    ++patches;
    lost += sign * w.loss > loss_unit_ * loss_of_most ? 1 : 0;
  }
  int all_lost = 0;
  for (const auto& [patches, lost] : quarters) {
    if (2 * lost < patches) return 0;
    all_lost += lost;
  }
  return all_lost < most * double(losses.size()) ? 0 : middle;
}

// The blur, in blocks, that takes what those patches have lost.
double CameraWatch::common_blur(Timestamp since) const {
  std::vector<double> blurs;
  for (const Watched& w : watched_)
    if (w.seen_at && *w.seen_at >= since && !w.is_hidden && w.loss_sigma < knows_loss)
      blurs.push_back(blur_of(w.patch, double(w.loss)));
  return calib::median_in_place(std::span(blurs));
}

// After a look at all patches. blur_blocks: with which they were found, if only so.
void CameraWatch::judge_focus(Timestamp at, double blur_blocks) {
  const float loss = blur_blocks > 0 ? 1 : common_loss(at);
  if (loss == 0) {
    blurred_since_.reset();
    // Between the two, what was told stays.
    std::vector<double> losses;
    for (const Watched& w : watched_)
      if (w.seen_at == at && w.loss_sigma < knows_loss) losses.push_back(std::abs(double(w.loss)));
    if (is_defocused_ && !losses.empty() &&
        calib::median_in_place(std::span(losses)) < double(loss_unit_ * loss_that_stays))
      set_focus(false);
    return;
  }
  const double blur = loss < 0 ? double(loss) : blur_blocks > 0 ? blur_blocks : common_blur(at);
  if (!blurred_since_ && !is_defocused_) blurred_since_ = blur_agreed_since_ = at, pending_blur_ = blur;
  if (std::abs(blur - pending_blur_) > same_blur * std::abs(pending_blur_) + same_blur_blocks)
    blur_agreed_since_ = at, pending_blur_ = blur;
  if (is_defocused_ || at - blur_agreed_since_ >= focus_settling || at - *blurred_since_ >= longest_focusing) {
    set_focus(true);
    condition_.blur_px = blur * scale_;
  }
}

void CameraWatch::set_focus(bool is_other) {
  is_defocused_ = is_other;
  blurred_since_.reset();
  condition_.blur_px = 0;
  for (Watched& w : watched_) w.other.reset();
}

std::optional<Aim> CameraWatch::relocate(const Luma& luma, std::span<const Occluder> objects) const {
  // The best of them that are apart: every so many-th cell's.
  std::vector<const Watched*> order;
  for (const Watched& w : watched_) order.push_back(&w);
  std::ranges::stable_sort(order, std::ranges::greater{}, [](const Watched* w) { return w->patch.least_texture; });
  const int reach =
      std::clamp(int(std::ceil(search_reach_rad * camera_.model.fx() / scale_)), least_search_reach, most_search_reach);
  std::vector<SeenRay> seen;
  std::size_t searched = 0;
  for (const Watched* w : order) {
    const auto expected = room_watch::pixel_of(camera_.model, aim(), w->ray);
    if (!expected || is_before(*expected, double(patch_side * scale_), objects)) continue;
    if (searched++ == searched_patches) break;
    if (const auto place = search(w->patch, luma, block_of(*expected), reach))
      seen.push_back({w->ray, pixel_of(*place), 0.5 * scale_});
  }
  return guess_aim(camera_.model, seen, guess_gate_blocks * scale_);
}

// Of what was found since every patch was looked for.
void CameraWatch::fit_recent(Timestamp at) {
  const double rate = at < alert_until_ ? alert_rate_hz : calm_rate_hz;
  const Duration recent = capture::duration_of(1.2 * double(watched_.size()) / rate);
  std::vector<SeenRay> seen;
  int could_say = 0;
  for (const Watched& w : watched_) {
    const bool is_seen = w.seen_at && at - *w.seen_at <= recent;
    if (w.is_hidden || (!is_seen && !w.differs_since)) continue;
    ++could_say;
    if (is_seen) seen.push_back({w.ray, w.px, w.sigma_px});
  }
  const auto fit = fit_rotation(camera_.model, seen, aim(), find_gate_blocks * scale_);
  if (!fit || fit->held < std::max(least_patches * 2 / 3, int(least_share * could_say))) return;
  take(*fit, at, false);
}

void CameraWatch::take(const RotationFit& full, Timestamp at, bool is_fresh) {
  const bool is_open = sure_sigmas * full.zoom_sigma > open_zoom;
  const RotationFit fit = is_open ? without_zoom(full) : full;
  const double zoom = room_watch::zoom_instead(full, told_).value_or(0);
  zoom_instead_ = std::abs(zoom) > least_zoom ? zoom : 0;
  // What was found, but elsewhere than the rotation has it, is no part of the room any more.
  for (Watched& w : watched_) {
    if (!w.seen_at || w.is_hidden) continue;
    const auto expected = room_watch::pixel_of(camera_.model, {fit.rotation, fit.zoom}, w.ray);
    const bool agrees = expected && (*expected - w.px).norm() < find_gate_blocks * scale_;
    if (agrees) w.differs_since.reset();
    if (!agrees && !w.differs_since) w.differs_since = at;
  }
  const auto before = std::ranges::find_if(history_, [&](const Snapshot& s) { return at - s.at <= 3s; });
  if (before != history_.end() && rotation_between(before->rotation, fit.rotation).norm() > alike_rad())
    alert_until_ = std::max(alert_until_, at + alert_for);
  condition_.rotation = fit.rotation;
  condition_.covariance = fit.covariance;
  condition_.shift_to_rotation = fit.shift_to_rotation;
  condition_.zoom = fit.zoom;
  condition_.zoom_sigma = fit.zoom_sigma;
  condition_.held = fit.held;
  history_.push_back({at, fit.rotation});
  while (at - history_.front().at > history_kept) history_.pop_front();
  judge_turn(fit, at, is_fresh);
}

void CameraWatch::judge_turn(const RotationFit& fit, Timestamp at, bool is_fresh) {
  const auto sigma = [&] { return std::sqrt(fit.covariance.diagonal().maxCoeff()); };
  const Eigen::Vector3d change = rotation_between(told_, fit.rotation);
  const bool is_turned = change.norm() > std::max(least_turn_rad, sure_sigmas * sigma());
  const bool is_zoomed = has_zoomed_now();
  if (is_zoomed && !zoomed_since_) zoomed_since_ = at;
  if (!is_zoomed) zoomed_since_.reset();
  const bool has_zoomed = zoomed_since_ && at - *zoomed_since_ >= settling;
  const bool is_back = fit.rotation.norm() < 0.6 * least_turn_rad;

  if (!is_turned) {
    pending_.reset();
    judge_change(at);
    const int needed = condition_.state == RoomState::changed ? 1 : least_changed;
    const RoomState quiet = condition_.change.patches >= needed ? RoomState::changed : RoomState::still;
    if (is_defocused_) {
      set_state(RoomState::defocused, at);
    } else if (blurred_since_) {
      return;  // a lens that is focused may zoom a little
    } else if (has_zoomed) {
      set_state(RoomState::zoomed, at);
    } else if (is_back || condition_.state == RoomState::learning) {
      if (is_back) told_.setZero(), condition_.turn.reset();
      set_state(quiet, at);
    } else if (condition_.state != RoomState::knocked && condition_.state != RoomState::sagging) {
      set_state(condition_.turn ? (condition_.turn->is_slow ? RoomState::sagging : RoomState::knocked) : quiet, at);
    }
    return;
  }
  // A turn is told when two looks agree on it. A sagging camera goes on by little between them.
  const double agreed = std::max(alike_rad(), sure_sigmas * sigma());
  const double apart = pending_ ? rotation_between(pending_->rotation, fit.rotation).norm() : 0;
  const bool is_settled = pending_ && apart<agreed, is_shaking = apart> shaking * agreed;
  if (!pending_) pending_since_ = at, settled_.reset();
  pending_ = Snapshot{at, fit.rotation};
  if (!is_settled) {
    if (is_shaking) set_state(RoomState::moving, at);
    if (at - pending_since_ < longest_moving) return;
  }
  if (!is_fresh) return;
  if (!settled_) settled_ = pending_;
  const bool is_small = change.norm() < small_turns * least_turn_rad;
  if (is_small && at - settled_->at < small_turn_is_watched) return;
  const double went_on = rotation_between(settled_->rotation, fit.rotation).norm();
  const bool goes_on = is_small && went_on > std::max(goes_on_share * change.norm(), 2 * sigma());
  pending_.reset();
  if (has_zoomed) {
    told_ = fit.rotation;
    set_state(is_defocused_ ? RoomState::defocused : RoomState::zoomed, at);
    return;
  }
  // Somebody has put it back: no turn of its own.
  if (is_back && condition_.turn) {
    told_.setZero();
    condition_.turn.reset();
    set_state(is_defocused_ ? RoomState::defocused : RoomState::still, at);
    return;
  }
  tell(turn_since(at, told_, fit.rotation), goes_on, is_small, at);
}

// A camera that goes on sagging is told once.
void CameraWatch::tell(Turn turn, bool goes_on, bool is_small, Timestamp at) {
  const bool was_small = condition_.turn && rotation_between(condition_.turn->before, condition_.turn->after).norm() <
                                                small_turns * least_turn_rad;
  const bool was_slow = condition_.turn && condition_.turn->is_slow;
  const bool is_soon = condition_.turn && at - condition_.turn->until < one_sagging;
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
  told_ = turn.after;
  set_state(turn.is_slow ? RoomState::sagging : RoomState::knocked, at);
}

// Whether most of it happened at once, and when.
Turn CameraWatch::turn_since(Timestamp at, const Eigen::Vector3d& before, const Eigen::Vector3d& after) const {
  const double all = rotation_between(before, after).norm();
  Turn turn{.is_slow = true, .from = at, .until = at, .before = before, .after = after};
  if (history_.size() < 2) {  // nobody looked: of a kept room
    turn.is_slow = false;
    return turn;
  }
  double most = 0;
  for (std::size_t i = 0; i < history_.size(); ++i) {
    for (std::size_t j = i + 1; j < history_.size(); ++j) {
      const double part = rotation_between(history_[i].rotation, history_[j].rotation).norm();
      // From one look to the next no camera sags as far as that.
      const bool is_jump = j == i + 1 && part > small_turns * least_turn_rad;
      if (history_[j].at - history_[i].at > knock_takes && !is_jump) break;
      if (part <= 1.02 * most) continue;  // the shortest time in which it happened
      most = part;
      turn.from = history_[i].at, turn.until = history_[j].at;
    }
  }
  turn.is_slow = most < knock_share * all;
  if (!turn.is_slow) return turn;
  turn.until = at;
  for (const Snapshot& s : history_)
    if (rotation_between(before, s.rotation).norm() < 0.2 * all) turn.from = s.at;
  return turn;
}

void CameraWatch::judge_nothing(Timestamp at) {
  if (is_kept_ && condition_.state == RoomState::learning) {
    if (at - pending_since_ < kept_patience) return;
    // Another light, another room: it is learnt as it is now.
    is_kept_ = false;
    has_forgotten_ = true;
    has_begun_ = false;
    watched_.clear();
    last_learnt_at_.reset();
    return;
  }
  if (!nothing_since_) nothing_since_ = at;
  if (at - *nothing_since_ < until_nothing_is_told) {
    next_survey_ = std::min(next_survey_, *nothing_since_ + until_nothing_is_told);
    return;
  }
  std::vector<double> contrasts;
  for (const Watched& w : watched_)
    if (!w.is_hidden) contrasts.push_back(double(w.contrast));
  const bool is_blind = !contrasts.empty() && calib::median_in_place(std::span(contrasts)) < double(no_contrast);
  set_state(is_blind ? RoomState::blinded : RoomState::hidden, *nothing_since_);  // people are told when it happened
}

// What has long shown something else is learnt anew, as it is now.
void CameraWatch::replace_changed(const Luma& luma, Timestamp at) {
  if (!learning_.empty() || at < alert_until_ || nothing_since_ || is_defocused_) return;
  const auto is_old = [&](const Watched& w) { return w.differs_since && at - *w.differs_since > replaced_after; };
  if (std::ranges::none_of(watched_, is_old)) return;
  const auto chosen = choose_patches(luma, image_margin);
  for (const Watched& w : watched_) {
    if (!is_old(w)) continue;
    const auto there = std::ranges::find(chosen, w.cell, &ChosenPatch::cell);
    if (there != chosen.end()) learning_.push_back({.where = *there, .sum = {}, .frames = 0, .is_spoilt = false});
  }
  std::erase_if(watched_, is_old);
  next_ = 0;
}

}  // namespace huetrack::room_watch
