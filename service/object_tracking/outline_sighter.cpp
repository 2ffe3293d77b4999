#include "object_tracking/outline_sighter.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "object_tracking/ball_outline.h"

namespace huetrack::object_tracking {
namespace {

// Model errors come on top of the covariance that the fit states. Experiment: benchmark outline_figures, single views
// of rendered balls of 3 to 12 px (EXPERIMENTS.md). Biases are shading; new errors lie in how the edge meets the
// pixels.
struct OutlineErrorTuning {
  double fit_inflation = 1.5;    // of the fit's covariance: neighbouring pixels' noise is correlated (experiment)
  double new_px = 0.03;          // px, 1 sigma, independent in every frame (experiment)
  double new_share = 0.002;      // of the radius, the same (experiment)
  double bias_px = 0.03;         // px, 1 sigma, slowly varying (experiment)
  double bias_share = 0.005;     // of the radius, the same (experiment)
  double bias_of_fit = 1.75;     // of the fit's sigma: shading prior, 1.5 to 2.4 in webcam images (experiment)
  double size_bias_px = 0.15;    // px, 1 sigma of the outline's radius by blur and shading: 0.14 rms (experiment)
  double even_size_px = 0.25;    // px, a larger error of the radius comes from one side and moves the centre, too
  double start_gain = 1.5;       // region variance over outline variance from which an outline replaces a region
  double stay_gain = 3;          // hysteresis of start_gain: while the outline is in use
  double centre_per_size = 0.7;  // centre error per error of the radius: a part is hidden, or something adds to it
};
constexpr OutlineErrorTuning outline_error{};

struct OutlineSighterTuning {
  double known_log_size = 0.02;     // 1 sigma of the log of the outline's radius over the target's, once it is learnt
  double min_sizes = 30;            // frames from which the size counts as known
  double size_visible_share = 0.8;  // of the outline that must be visible to learn a size from it
  double same_light_m = 1.5;        // m, decay length of the shading: lamps and windows are some metres away
  double same_light_s = 10;         // s, decay time of the same: lamps and clouds change
  double held_light = 0.9;          // correlation above which the shading is not fitted anew
  int max_steps = 4;                // Gauss-Newton steps: the second is mostly the last
  double ahead_s = 0.3;             // s, the background is learnt where the object will be then
  std::size_t min_tries = 60;       // fits before a target counts as not round
  double min_fitted = 0.3;          // share of the fits that must succeed, else it is not round
};
constexpr OutlineSighterTuning outline_sighter{};
constexpr double unknown_log_size = outline::appearance_prior.log_size_sigma;  // before it is learnt

// The whole image that came with a frame of matches, if it has the patches' format: another one subsamples chroma
// differently.
const capture::Image* rare_picture(const TargetView& view) {
  if (capture::has_pixels(*view.image)) return nullptr;
  const capture::Image* own = capture::own_picture_of(*view.frame);
  return own != nullptr && own->format == view.image->format && own->range == view.image->range ? own : nullptr;
}

// With one camera: where the model of a ball does not explain the picture, the edge may be another one's, as of the
// hand around it. Then the size is as wrong as it differs from the region's by more than that may be wrong.
double model_error_of_size(const outline::Fit& fit, double radius_px, const Sighting& region) {
  if (fit.size_model_error == 0 || !region.size) return fit.size_model_error;
  const double off = fit.log_size.value - std::log(region.size->radius_px / radius_px);
  const double usual = sighting_tuning.prediction_sigmas * std::hypot(region.size->log_sigma, region.size->log_bias);
  return std::hypot(fit.size_model_error, std::sqrt(std::max(0.0, off * off - usual * usual)));
}

}  // namespace

OutlineSighter::OutlineSighter(const calib::CameraRig& rig, const TargetOptions& target,
                               const ObjectTrackerOptions& options)
    : radius_m_(target.radius_m),
      shape_(target.shape),
      pixel_noise_px_(options.pixel_noise_px),
      views_(rig.cameras.size()) {}

bool OutlineSighter::sharpen(const TargetView& view, const MotionState& state, const ExpectedView& expected,
                             const Eigen::Matrix2d& spread, Sighting& sighting) {
  PerView& of = views_[std::size_t(view.index)];
  const bool was_sharp = std::exchange(of.is_sharp, false);
  if (!is_enabled() || !of.behind) return false;
  const Eigen::Vector3d there = state.position_at(expected.row.at);
  const auto ball = outline_of(*view.camera, there, radius_m_);
  if (!ball) return false;
  const ImageMotion motion = image_motion(view, expected.at, state);

  // Initial centre: prediction and region, fused.
  Eigen::Matrix2d of_region = sighting.covariance;
  of_region.diagonal().array() += sighting.bias_sigma_px * sighting.bias_sigma_px;
  const Eigen::Vector2d start =
      expected.at.px + spread * (spread + of_region).inverse() * (sighting.px - expected.at.px);
  outline::Ellipse ellipse = ball->ellipse;
  ellipse.centre += start - expected.at.px;
  const Eigen::Vector3d ray = there - view.camera->centre();
  const double distance = ray.norm();
  const double depth_sigma = std::sqrt(std::max(0.0, ray.dot(state.position_covariance() * ray))) / distance;
  // With one camera, the filter knows the size in the image better than the distance.
  const auto [usual_size, usual_sigma] =
      state.has_size() ? state.expected_log_size(expected.row, ray) : std::pair(of.log_size, depth_sigma / distance);
  const bool is_size_known =
      state.has_size() ? usual_sigma < unknown_log_size : of.log_size_weight >= outline_sighter.min_sizes;
  outline::FitOptions options;
  options.most_steps = outline_sighter.max_steps;
  options.is_edge_curved = state.has_size();
  // Until a size is learnt, the expected radius and the region's are tried in turn after each failed fit.
  const double log_size = of.log_size_weight == 0 && of.begins_at_region
                              ? std::log(std::max(1.0, sighting.radius_px) / expected.at.radius_px)
                              : usual_size;
  const double size_sigma = is_size_known ? outline_sighter.known_log_size : unknown_log_size;
  options.log_size = {log_size, std::hypot(size_sigma, usual_sigma)};
  // Share of a deviation that is the outline's, not the distance's: something hides a part, or adds to it.
  const double by_outline = state.has_size() ? std::pow(size_sigma / options.log_size.sigma, 2) : 1.0;
  options.light_correlation = std::exp(-(there - of.lit_at).norm() / outline_sighter.same_light_m -
                                       capture::seconds(expected.row.at - of.lit_when) / outline_sighter.same_light_s);
  options.may_hold_light = is_size_known && options.light_correlation >= outline_sighter.held_light;
  const auto picture = picture_around(view, ellipse.centre);
  if (!picture) return false;
  const outline::Fit fit = fit_.fit(*picture, *of.behind, ellipse, {motion.velocity, motion.row_s}, of.look, options);
  if (fit.outcome == outline::FitOutcome::misfit || fit.outcome == outline::FitOutcome::lost) ++not_fitted_;
  if (fit.outcome != outline::FitOutcome::fits) {
    of.look.promise.reset();  // the next fit starts from scratch
    of.begins_at_region = !of.begins_at_region;
    if (shape_ == TargetShape::automatic && not_fitted_ + fitted_ >= outline_sighter.min_tries &&
        double(fitted_) < outline_sighter.min_fitted * double(fitted_ + not_fitted_))
      is_blob_ = true;
    return false;
  }
  ++fitted_;

  const double radius_px = expected.at.radius_px;
  Sighting sharp = sighting;
  sharp.missing = std::min(sighting.missing, 1 - fit.visible);
  sharp.px = fit.centre - (ball->ellipse.centre - ball->centre_px);
  const double moved_px = (sharp.px - of.px).norm();
  of.still = std::exp(-moved_px / sighting_tuning.same_place_px);
  const double off_size = fit.log_size.value - usual_size;
  const double by_size = is_size_known ? outline_error.centre_per_size * radius_px * by_outline * off_size : 0.0;
  // pixel_noise_px is a region's; what it has over its default is the rig's error.
  constexpr double region_px = ObjectTrackerOptions::default_pixel_noise_px;
  const double rig_px2 = std::max(0.0, pixel_noise_px_ * pixel_noise_px_ - region_px * region_px);
  const OutlineErrorTuning& e = outline_error;
  const double new_px2 = e.new_px * e.new_px + e.new_share * e.new_share * radius_px * radius_px;
  sharp.covariance = e.fit_inflation * fit.covariance;
  sharp.covariance.diagonal().array() += (1 - of.still) * new_px2 + by_size * by_size + rig_px2;
  const double wrong_px = radius_px * by_outline *
                          std::abs(!is_size_known     ? fit.log_size.value
                                   : state.has_size() ? off_size
                                                      : of.log_size);
  const double one_sided_px = std::max(0.0, wrong_px - e.even_size_px);
  sharp.bias_sigma_px = std::sqrt(e.bias_px * e.bias_px + e.bias_share * e.bias_share * radius_px * radius_px +
                                  of.still * new_px2 + e.bias_of_fit * e.bias_of_fit * fit.covariance.trace() / 2 +
                                  one_sided_px * one_sided_px + sighting.hidden_px * sighting.hidden_px);
  sharp.unmodelled_px = std::sqrt(fit.model_error.trace() / 2);

  // An outline outside the gate of prediction or region is another object's edge.
  Eigen::Matrix2d total = spread + sharp.covariance;
  total.diagonal().array() += sharp.bias_sigma_px * sharp.bias_sigma_px;
  const Eigen::Vector2d off = sharp.px - expected.at.px, to_region = sharp.px - sighting.px;
  if (off.dot(total.inverse() * off) > sighting_tuning.gate_nis ||
      to_region.dot((of_region + sharp.covariance).inverse() * to_region) > sighting_tuning.gate_nis)
    return false;
  const double lasting = std::hypot(e.size_bias_px / radius_px, e.bias_of_fit * fit.log_size.sigma);
  const double by_model = state.has_size() ? model_error_of_size(fit, radius_px, sighting) : 0;
  const double size_sigma_now = std::hypot(fit.log_size.sigma, by_model);
  if (state.has_size() && size_sigma_now >= unknown_log_size) return false;
  const bool is_size_measured = fit.visible > outline_sighter.size_visible_share && size_sigma_now < unknown_log_size;
  if (is_size_measured && state.has_size()) {
    sharp.size = {.radius_px = radius_px * std::exp(fit.log_size.value),
                  .log_sigma = std::sqrt(e.fit_inflation * fit.log_size.sigma * fit.log_size.sigma +
                                         (1 - of.still) * new_px2 / (radius_px * radius_px)),
                  .log_bias = std::hypot(lasting, sighting.narrowed, by_model)};
  } else if (is_size_measured) {
    of.log_size_weight = std::min(sighting_tuning.size_memory, of.log_size_weight + 1);
    of.log_size += off_size / of.log_size_weight;
    of.size_variance += (lasting * lasting - of.size_variance) / of.log_size_weight;
  }
  if ((sharp.covariance.trace() + 2 * sharp.bias_sigma_px * sharp.bias_sigma_px) >
      (was_sharp ? e.stay_gain : e.start_gain) * of_region.trace())
    return false;

  if (fit_.learn(of.look)) of.lit_at = there, of.lit_when = expected.row.at;
  of.px = sharp.px;
  of.is_sharp = true;
  sighting = sharp;
  sighting.is_outline = true;
  return true;
}

std::optional<KnownBackground> OutlineSighter::behind(std::size_t camera) const {
  const PerView& of = views_[camera];
  if (!is_enabled() || !of.behind) return std::nullopt;
  return KnownBackground{&*of.behind, std::sqrt(std::max(1.0, of.look.usual_misfit))};
}

void OutlineSighter::learn(const std::vector<TargetView>& views, const MotionState& state) {
  if (!is_enabled()) return;
  for (const TargetView& view : views) {
    const auto expected = expected_in(view, state, radius_m_);
    if (!expected) continue;
    const BallProjection& at = expected->at;
    const capture::Image* const rare = rare_picture(view);
    const auto around = rare == nullptr ? picture_around(view, at.px) : std::nullopt;
    if (rare == nullptr && !around) continue;
    PerView& of = views_[std::size_t(view.index)];
    if (!of.behind) of.behind.emplace(view.image->width, view.image->height);
    const ImageMotion motion = image_motion(view, at, state);
    const double sigma_px = std::sqrt((at.jacobian * state.position_covariance() * at.jacobian.transpose()).trace());
    const double smear_px = 0.5 * motion.velocity.norm() * motion.longest_exposure_s;
    const outline::ObjectDisc hidden{at.px, sighting_tuning.covered_radii * at.radius_px + sighting_tuning.covered_px +
                                                sighting_tuning.prediction_sigmas * sigma_px + smear_px};
    if (rare != nullptr)
      of.behind->learn_all(picture_of(*rare), &hidden, 1);
    else
      of.behind->learn(*around, {at.px, at.radius_px}, outline_sighter.ahead_s * motion.velocity, &hidden, 1);
  }
}

OutlineFindings OutlineSighter::findings() const {
  OutlineFindings out{.fitted = fitted_, .not_fitted = not_fitted_};
  // Weighted mean; its variance is the views' mean one, as all are lit by the same lamps.
  double sum = 0, weight = 0, views = 0;
  double least = std::numeric_limits<double>::infinity(), largest = -least;
  for (const PerView& of : views_) {
    if (of.log_size_weight == 0) continue;
    least = std::min(least, of.log_size), largest = std::max(largest, of.log_size);
    if (of.log_size_weight < outline_sighter.min_sizes) continue;
    sum += of.log_size / of.size_variance, weight += 1 / of.size_variance, ++views;
  }
  if (views == 0) return out;
  out.radius_m = radius_m_ * std::exp(sum / weight);
  out.radius_sigma_m = *out.radius_m * std::sqrt(views / weight);
  out.least_radius_m = radius_m_ * std::exp(least), out.largest_radius_m = radius_m_ * std::exp(largest);
  return out;
}

}  // namespace huetrack::object_tracking
