#include "object_tracking/outline_sighter.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "object_tracking/ball_outline.h"

namespace huetrack::object_tracking {
namespace {

// What the model leaves out of an outline's error, beside the pixels' noise, which the fit tells. Seen in single views
// of rendered balls of 3 to 12 px (benchmark outline_figures): what lasts is light, what does not last lies in how the
// edge meets the pixels and what is behind it.
constexpr double usual_noise = 1.5;  // of the fit's covariance: neighbouring pixels' noise is not independent
constexpr double new_px = 0.03, new_share = 0.002, lasting_px = 0.03, lasting_share = 0.005;
// The less the pixels say, the more of an outline is what is usual of a ball's light, from which a room's lamps differ:
// in webcams' pictures the error that lasts was 1.5 to 2.4 times what the fit states, in clean ones 1.5 times in the
// median.
constexpr double lasting_of_noise = 1.75;
// An outline is too small or too large by what blur and light make of its edge, in all pictures alike: seen in 20 views
// of rendered balls of 3 to 12 px, 0.08 px too small in the mean, 0.14 rms, 0.24 at most.
constexpr double lasting_size_px = 0.15;
// An outline that is smaller or larger than the target's, by more than blur makes it all around, has an edge at the
// wrong place on one side: the middle is off by as much as the radius. (A target's radius that is wrong makes all views
// as unsure.)
constexpr double off_all_around_px = 0.25;
// A region is left for an outline that is surely better, and an outline for a region: each is off by its own, and who
// goes from one to the other and back sees what rests move.
constexpr double better_to_begin = 1.5, better_to_stay = 3;
constexpr double same_place_px = 1;  // an outline that has moved less meets the same pixels again

// What a region is worth is in pixel_noise_px; what that has over its default is the rig's.
constexpr double usual_pixel_noise_px = 0.2;

constexpr double unknown_log_size = 0.1, known_log_size = 0.02;
constexpr double most_sizes = 300;  // of the mean: ten seconds
constexpr double enough_sizes = 30;
// A view that says nothing of a size that is not the mean's is off by as much: a part is hidden, or something adds to
// it.
constexpr double off_by_size = 0.7;

// The light over an object is that of the room's lamps, windows and walls around it, which are some metres off: so far
// on, it is lit in another way. Lamps and clouds change it, too.
constexpr double same_light_m = 1.5, same_light_s = 10;
// As long as it is so much the same it is not fitted anew: ten pictures in which it is fitted while it lasts tell its
// mean to a third of what one leaves open.
constexpr double same_enough = 0.9;

constexpr int most_steps = 4;    // begun from what motion and region say, the second is mostly the last
constexpr double ahead_s = 0.3;  // what is behind the object then is learnt now
constexpr double hidden_radii = 1.1, hidden_px = 4;

// An object of which so many outlines were sought and so few fitted is no ball.
constexpr std::size_t least_tries = 60;
constexpr double least_fitted = 0.3;

// What there is of the view's pixels around this place: all of them, or of a frame that says what matches the patch
// that has it in its middle best. nullopt: none.
std::optional<outline::Picture> picture_around(const TargetView& view, const Eigen::Vector2d& px) {
  if (capture::has_pixels(*view.image)) return picture_of(*view.image);
  if (!view.frame->matches) return std::nullopt;
  const capture::Matches::Patch* best = nullptr;
  double best_px = 0;
  for (const auto& patch : view.frame->matches->patches) {
    const double from_left = px.x() - patch.at.u, from_top = px.y() - patch.at.v;
    const double inside_px = std::min({from_left, patch.at.width - from_left, from_top, patch.at.height - from_top});
    if (inside_px > best_px) best = &patch, best_px = inside_px;
  }
  if (best == nullptr) return std::nullopt;
  return picture_of(*best, view.image->width, view.image->height);
}

// The whole picture that came with a frame that says what matches, if it has the format of the patches: of another one,
// chroma is shared otherwise, and its light is not the same.
const capture::Image* rare_picture(const TargetView& view) {
  if (capture::has_pixels(*view.image)) return nullptr;
  const capture::Image* own = capture::own_picture_of(*view.frame);
  return own != nullptr && own->format == view.image->format && own->range == view.image->range ? own : nullptr;
}

}  // namespace

OutlineSighter::OutlineSighter(const calib::CameraRig& rig, const TargetOptions& target,
                               const ObjectTrackerOptions& options)
    : radius_m_(target.radius_m),
      shape_(target.shape),
      pixel_noise_px_(options.pixel_noise_px),
      views_(rig.cameras.size()) {}

bool OutlineSighter::sharpen(const TargetView& view, const MotionBelief& belief, const ExpectedView& expected,
                             const Eigen::Matrix2d& spread, Sighting& sighting) {
  PerView& of = views_[static_cast<std::size_t>(view.index)];
  const bool was_sharp = std::exchange(of.is_sharp, false);
  if (!is_sought() || !of.behind) return false;
  const Eigen::Vector3d there = belief.position_at(expected.row.at);
  const auto ball = outline_of(*view.camera, there, radius_m_);
  if (!ball) return false;
  const ImageMotion motion = image_motion(view, expected.at, belief);

  // Where motion and region together say it is.
  Eigen::Matrix2d of_region = sighting.covariance;
  of_region.diagonal().array() += sighting.lasting_px * sighting.lasting_px;
  const Eigen::Vector2d start =
      expected.at.px + spread * (spread + of_region).inverse() * (sighting.px - expected.at.px);
  outline::Ellipse ellipse = ball->ellipse;
  ellipse.centre += start - expected.at.px;
  const Eigen::Vector3d ray = there - view.camera->centre();
  const double distance = ray.norm();
  const double depth_sigma = std::sqrt(std::max(0.0, ray.dot(belief.position_covariance() * ray))) / distance;
  const bool is_size_known = of.log_size_weight >= enough_sizes;
  outline::FitOptions options;
  options.most_steps = most_steps;
  // As long as nothing has fitted, the target's radius may be wrong, or the region's: each is tried in turn.
  const double log_size = of.log_size_weight == 0 && of.begins_at_region
                              ? std::log(std::max(1.0, sighting.radius_px) / expected.at.radius_px)
                              : of.log_size;
  options.log_size = {log_size, std::hypot(is_size_known ? known_log_size : unknown_log_size, depth_sigma / distance)};
  options.light_correlation = std::exp(-(there - of.lit_at).norm() / same_light_m -
                                capture::seconds(expected.row.at - of.lit_when) / same_light_s);
  options.may_hold_light = is_size_known && options.light_correlation >= same_enough;
  const auto picture = picture_around(view, ellipse.centre);
  if (!picture) return false;
  const outline::Fit fit = fit_.fit(*picture, *of.behind, ellipse, {motion.velocity, motion.row_s}, of.look, options);
  if (fit.outcome == outline::FitOutcome::misfit || fit.outcome == outline::FitOutcome::lost) ++not_fitted_;
  if (fit.outcome != outline::FitOutcome::fits) {
    of.look.promise.reset();  // in the next picture all is fitted at once
    of.begins_at_region = !of.begins_at_region;
    if (shape_ == TargetShape::automatic && not_fitted_ + fitted_ >= least_tries &&
        static_cast<double>(fitted_) < least_fitted * static_cast<double>(fitted_ + not_fitted_))
      is_blob_ = true;
    return false;
  }
  ++fitted_;

  const double radius_px = expected.at.radius_px;
  Sighting sharp = sighting;
  sharp.px = fit.centre - (ball->ellipse.centre - ball->centre_px);
  const double moved_px = (sharp.px - of.px).norm();
  of.still = std::exp(-moved_px / same_place_px);
  const double off_size = fit.log_size.value - of.log_size;
  const double by_size = is_size_known ? off_by_size * radius_px * off_size : 0.0;
  const double rig_px2 = std::max(0.0, pixel_noise_px_ * pixel_noise_px_ - usual_pixel_noise_px * usual_pixel_noise_px);
  const double new_px2 = new_px * new_px + new_share * new_share * radius_px * radius_px;
  sharp.covariance = usual_noise * fit.covariance;
  sharp.covariance.diagonal().array() += (1 - of.still) * new_px2 + by_size * by_size + rig_px2;
  const double wrong_px = radius_px * std::abs(is_size_known ? of.log_size : fit.log_size.value);
  const double one_sided_px = std::max(0.0, wrong_px - off_all_around_px);
  sharp.lasting_px =
      std::sqrt(lasting_px * lasting_px + lasting_share * lasting_share * radius_px * radius_px + of.still * new_px2 +
                lasting_of_noise * lasting_of_noise * fit.covariance.trace() / 2 + one_sided_px * one_sided_px);

  // What neither the motion nor the region would explain is something else's edge.
  Eigen::Matrix2d total = spread + sharp.covariance;
  total.diagonal().array() += sharp.lasting_px * sharp.lasting_px;
  const Eigen::Vector2d off = sharp.px - expected.at.px, beside = sharp.px - sighting.px;
  if (off.dot(total.inverse() * off) > region_gate ||
      beside.dot((of_region + sharp.covariance).inverse() * beside) > region_gate)
    return false;
  if (fit.visible > 0.8 && fit.log_size.sigma < 0.05) {
    of.log_size_weight = std::min(most_sizes, of.log_size_weight + 1);
    of.log_size += off_size / of.log_size_weight;
    const double lasting = std::hypot(lasting_size_px / radius_px, lasting_of_noise * fit.log_size.sigma);
    of.size_variance += (lasting * lasting - of.size_variance) / of.log_size_weight;
  }
  if ((sharp.covariance.trace() + 2 * sharp.lasting_px * sharp.lasting_px) >
      (was_sharp ? better_to_stay : better_to_begin) * of_region.trace())
    return false;

  if (fit_.learn(of.look)) of.lit_at = there, of.lit_when = expected.row.at;
  of.px = sharp.px;
  of.is_sharp = true;
  sighting = sharp;
  sighting.is_outline = true;
  return true;
}

void OutlineSighter::learn(const std::vector<TargetView>& views, const MotionBelief& belief) {
  if (!is_sought()) return;
  for (const TargetView& view : views) {
    const auto expected = expected_in(view, belief, radius_m_);
    if (!expected) continue;
    const Appearance& at = expected->at;
    const capture::Image* const rare = rare_picture(view);
    const auto around = rare == nullptr ? picture_around(view, at.px) : std::nullopt;
    if (rare == nullptr && !around) continue;
    PerView& of = views_[static_cast<std::size_t>(view.index)];
    if (!of.behind) of.behind.emplace(view.image->width, view.image->height);
    const ImageMotion motion = image_motion(view, at, belief);
    const double sigma_px = std::sqrt((at.jacobian * belief.position_covariance() * at.jacobian.transpose()).trace());
    const double smear_px = 0.5 * motion.velocity.norm() * motion.longest_exposure_s;
    const outline::ObjectDisc hidden{at.px, hidden_radii * at.radius_px + hidden_px + 3 * sigma_px + smear_px};
    if (rare != nullptr)
      of.behind->learn_all(picture_of(*rare), &hidden, 1);
    else
      of.behind->learn(*around, {at.px, at.radius_px}, ahead_s * motion.velocity, &hidden, 1);
  }
}

OutlineFindings OutlineSighter::findings() const {
  OutlineFindings out{.fitted = fitted_, .not_fitted = not_fitted_};
  // The more exact views say more, but all are lit by the same lamps: together they are no surer than in the mean.
  double sum = 0, weight = 0, views = 0;
  double least = std::numeric_limits<double>::infinity(), largest = -least;
  for (const PerView& of : views_) {
    if (of.log_size_weight < enough_sizes) continue;
    sum += of.log_size / of.size_variance, weight += 1 / of.size_variance, ++views;
    least = std::min(least, of.log_size), largest = std::max(largest, of.log_size);
  }
  if (views == 0) return out;
  out.radius_m = radius_m_ * std::exp(sum / weight);
  out.radius_sigma_m = *out.radius_m * std::sqrt(views / weight);
  out.least_radius_m = radius_m_ * std::exp(least), out.largest_radius_m = radius_m_ * std::exp(largest);
  return out;
}

}  // namespace huetrack::object_tracking
