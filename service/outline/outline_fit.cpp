#include "outline/outline_fit.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "outline/camera_curve.h"

namespace huetrack::outline {
namespace {

// Which outlines are fitted, and which fits are accepted.
struct OutlineFitTuning {
  double reach_px = 4;           // px beyond and within the edge: 4 sigma of a soft edge
  double min_radius_px = 1.5;    // px; smaller discs are all edge
  float min_contrast = 4;        // of the object to the background, in standard deviations of a pixel
  double max_misfit = 9;         // mean squared residual, in variances
  double min_visible = 0.25;     // share of the edge
  double alike_share = 0.25;     // of the samples in which what the model does not explain is alike (experiment)
  double max_shift_radii = 0.8;  // of the centre from the start
  double max_growth = 0.35;      // of log size from its prior
  double max_exposure_s = 0.04;  // seconds; longer is not possible at 25 Hz
  double color_edge_px = 1.2;    // the object's first colour is the median so many px inside the edge
};
constexpr OutlineFitTuning outline_fit{};
constexpr double usual_loss = 0.66;  // maths: mean of robust() of a normal residual, 0.63, and of rounding

// Priors of the light, standard deviations; light is linear, 1: the object's own.
struct LightPriorTuning {
  double background_gain = 0.1;       // lamps, clouds, exposure; half of it as a slope over the rows, per radius
  double shading = 0.5;               // brightness of the ball
  double shading_slope = 0.7;         // light from one side
  double shading_quadratic = 0.05;    // light that bends across the picture; larger passes for the edge (experiment)
  double shading_depth = 0.2;         // light that darkens towards the edge
  double shading_depth_slope = 0.03;  // and more on one side; larger passes for a shift of the edge (experiment)
  double paleness = 0.2;              // white added to the ball's colour; a quarter of it as a slope
};
constexpr LightPriorTuning light_prior{};

// How the appearance model is learnt. Natural logarithms.
struct AppearanceLearningTuning {
  double blur_sigma = 0.05;              // between pictures of one camera; the mean is never known better
  double blur_of_light = 0.6;            // error of one picture's blur by unmodelled light: ten pictures count as one
  double min_exposure_sigma_s = 0.0005;  // seconds
  double size_sigmas = 2;                // farther from its prior, something hides a part: light is not learnt
};
constexpr AppearanceLearningTuning appearance_learning{};

struct OutlineStepTuning {
  double settled_sigmas = 0.4;  // of place and size, of all steps to come: then the fit ends
  double min_share = 0.3;       // of a step in the one before, in that forecast
  double far_px = 0.35;         // half an edge's softness: beyond it derivatives are made again
  double other_blur = 0.2;      // and for an edge so much softer, natural logarithm
  double other_weight = 1.1;    // and where robust weights have changed by so much
  double max_step = 0.4;        // trust region: radii of the centre, log of blur; half of it of log size
  int outlier_steps = 3;        // in which outliers are judged; later they would chase the fit
};
constexpr OutlineStepTuning outline_step{};

// When a fit with held light is good enough.
struct HeldLightTuning {
  double min_visible = 0.75;  // share of the edge; less, and an occluder passes for the ball's dark side
  double chance_sigmas = 4;   // of the misfit, a mean of many squares, over the last full fit's
};
constexpr HeldLightTuning held_light{};

}  // namespace

// The pixels within reach of the edge. false: none, or too many.
bool OutlineFit::find_grid(const Picture& picture) {
  grid_.columns = picture.columns, grid_.rows = picture.rows;
  has_chroma_ = !picture.is_grey;
  const Eigen::Matrix2d px_from_disc = band_.disc_from_px.inverse();
  const auto bounds = [&](int axis, int begin, int limit, int shared, int& low, int& count) {
    const double reach = px_from_disc.row(axis).norm() + band_.reach_px;
    const double first = std::floor(start_.centre[axis] - reach), last = std::ceil(start_.centre[axis] + reach);
    if (!(first > -1e6 && last < 1e6)) return false;
    low = std::max(begin, static_cast<int>(first)) / shared * shared;
    const int high = std::min(limit, (static_cast<int>(last) + shared) / shared * shared);
    count = (high - low) / shared * shared;
    return count > 0 && count <= OutlierPixels::largest_grid;
  };
  return bounds(0, picture.part_u, picture.end_u(), grid_.columns, grid_.u0, grid_.width) &&
         bounds(1, picture.part_v, picture.end_v(), grid_.rows, grid_.v0, grid_.height);
}

// The known colour, or the median inside. false: too few pixels.
bool OutlineFit::find_object_color(const AppearanceModel& model) {
  const auto shrunk = static_cast<float>(1 - outline_fit.color_edge_px / band_.radius_px);
  if (model.object.maxCoeff() > 0) {
    object_ = model.object;
  } else {
    std::array<std::vector<float>, 3> values;
    const Eigen::Matrix2f m = band_.disc_from_px.cast<float>();
    light_.for_each([&](const EdgeSamples::Block& of, int k) {
      if ((m * Eigen::Vector2f(of.u[k], of.v[k])).squaredNorm() > shrunk * shrunk) return;
      values[0].push_back(of.seen.light[k]);
      values[1].push_back(of.seen.blue[k]), values[2].push_back(of.seen.red[k]);
    });
    if (values[0].size() < 3) return false;
    std::array<float, 3> middle{};
    for (std::size_t i = 0; i < 3; ++i) {
      const auto at = values[i].begin() + static_cast<std::ptrdiff_t>(values[i].size() / 2);
      std::ranges::nth_element(values[i], at);
      middle[i] = *at;
    }
    const LinearLight light = linear_light(middle[0], middle[1], middle[2]);
    object_ = {light.red, light.green, light.blue};
  }
  const LightChroma seen =
      ycc(white * grey_of(object_.x()), white * grey_of(object_.y()), white * grey_of(object_.z()));
  object_seen_ = {seen.light, seen.blue, seen.red};
  return true;
}

void OutlineFit::make_samples() {
  // The direction of chroma in which the object differs most from the background around it.
  float sum_light = 0, sum_blue = 0, sum_red = 0;
  light_.for_each([&](const EdgeSamples::Block& of, int k) {
    sum_light += of.behind.light[k], sum_blue += of.behind.blue[k], sum_red += of.behind.red[k];
  });
  const auto n = static_cast<float>(std::max(1, light_.n));
  const float off_blue = object_seen_[1] - sum_blue / n, off_red = object_seen_[2] - sum_red / n;
  const float length = std::hypot(off_blue, off_red);
  chroma_blue_ = length > 1 ? off_blue / length : 0.f, chroma_red_ = length > 1 ? off_red / length : 1.f;
  contrast_ = std::hypot(length / noise_.chroma, (object_seen_[0] - sum_light / n) / noise_.light);
  make_linear(light_, 0, 0);
  make_linear(chroma_, chroma_blue_, chroma_red_);
  find_hidden(light_, object_seen_.data(), noise_);
}

void OutlineFit::begin(const AppearanceModel& model, const FitOptions& options) {
  x_.setZero();
  information_.setZero();
  const auto set_prior = [&](int i, double value, double sigma) {
    x_[i] = value;
    information_(i, i) = 1 / (sigma * sigma);
  };
  set_prior(size_, options.log_size.value, options.log_size.sigma);
  set_prior(blur_light_, model.log_blur_light.value,
            std::hypot(model.log_blur_light.sigma, appearance_learning.blur_sigma));
  set_prior(blur_chroma_, model.log_blur_chroma.value,
            std::hypot(model.log_blur_chroma.sigma, appearance_learning.blur_sigma));
  set_prior(exposure_, model.exposure_s.value, model.exposure_s.sigma);
  set_prior(lit_, 0, light_prior.background_gain), set_prior(lit_ + 1, 0, light_prior.background_gain / 2);
  set_prior(shading_, 1, light_prior.shading);
  for (int i = 1; i < 3; ++i) set_prior(shading_ + i, 0, light_prior.shading_slope);
  // Any light on a matte ball is a quadratic polynomial of its surface's direction (Ramamoorthi and Hanrahan 2001).
  // What darkens towards the edge, and more on one side, is nearly collinear with the place of the edge: hence the
  // tight priors, which a large ball's many pixels override.
  for (int i = 3; i < 6; ++i) set_prior(shading_ + i, 0, light_prior.shading_quadratic);
  set_prior(shading_ + 6, 0, light_prior.shading_depth);
  for (int i = 7; i < 9; ++i) set_prior(shading_ + i, 0, light_prior.shading_depth_slope);
  set_prior(paleness_, 0, light_prior.paleness);
  for (int i = 1; i < 3; ++i) set_prior(paleness_ + i, 0, light_prior.paleness / 4);
  expected_ = x_;
  if (!model.light) return;
  if (is_light_held_) {
    x_.segment<lights>(shading_) = model.light->mean;
    expected_ = x_;
    information_(shading_, shading_) = 1 / (light_prior.background_gain * light_prior.background_gain);
    return;
  }
  // Kalman prediction of a first-order Gauss-Markov process: many pictures in one light separate shading from the
  // place of the edge.
  const double kept = options.light_correlation, kept2 = kept * kept;
  auto information = information_.block<lights, lights>(shading_, shading_);
  LightMatrix covariance = kept2 * model.light->covariance;
  covariance.diagonal() += (1 - kept2) * information.diagonal().cwiseInverse();
  const auto of_light = inverse_of(covariance);
  if (!of_light) return;
  information = *of_light;
  auto light = expected_.segment<lights>(shading_);
  light += kept * (model.light->mean - light);
  x_.segment<lights>(shading_) = model.light->mean;
}

EdgeModel OutlineFit::model_of_light() const {
  EdgeModel k{};
  k.by_red = y_red * white, k.by_green = y_green * white, k.by_blue = y_blue * white;
  k.sigma = noise_.light;
  k.counts_glints = 1;
  const auto blur = static_cast<float>(std::exp(x_[blur_light_]));
  k.blur2 = blur * blur;
  k.more2 = static_cast<float>(std::exp(2 * x_[blur_chroma_]));
  const Eigen::Matrix2f m = (band_.disc_from_px * std::exp(-x_[size_])).cast<float>();
  k.cu = static_cast<float>(x_[cu_]), k.cv = static_cast<float>(x_[cv_]);
  k.m00 = m(0, 0), k.m01 = m(0, 1), k.m10 = m(1, 0), k.m11 = m(1, 1);
  k.vx = static_cast<float>(movement_.velocity.x()), k.vy = static_cast<float>(movement_.velocity.y());
  const double exposure = std::clamp(x_[exposure_], 0.0, outline_fit.max_exposure_s);
  k.exposure = static_cast<float>(exposure);
  // One moment per two standard deviations of the edge.
  const double way = movement_.velocity.norm() * exposure;
  k.moments = std::clamp(static_cast<int>(std::ceil(way / (2 * static_cast<double>(blur)))), 1,
                         static_cast<int>(k.moment.size()));
  for (int i = 0; i < k.moments; ++i)
    k.moment[static_cast<std::size_t>(i)] = (static_cast<float>(i) + 0.5f) / static_cast<float>(k.moments) - 0.5f;
  k.smear2 = 1 / (12 * static_cast<float>(k.moments * k.moments));
  k.grey = grey_red * object_.x() + grey_green * object_.y() + grey_blue * object_.z();
  k.red = object_.x() - k.grey, k.green = object_.y() - k.grey, k.blue = object_.z() - k.grey;
  k.level = object_.maxCoeff();
  for (int i = 0; i < 9; ++i) k.shading[static_cast<std::size_t>(i)] = static_cast<float>(x_[shading_ + i]);
  for (int i = 0; i < 3; ++i) k.paleness[static_cast<std::size_t>(i)] = static_cast<float>(x_[paleness_ + i]);
  k.curve = is_edge_curved_ ? static_cast<float>(0.5 * std::exp(-x_[size_]) / band_.radius_px) : 0.f;
  k.lit = static_cast<float>(1 + x_[lit_]), k.lit_v = static_cast<float>(x_[lit_ + 1] / band_.radius_px);
  k.finish();
  return k;
}

EdgeModel OutlineFit::model_of_chroma(const EdgeModel& of_light) const {
  EdgeModel k = of_light;
  const float b = chroma_blue_ * by_blue * white, r = chroma_red_ * by_red * white;
  k.by_red = r - (b + r) * y_red, k.by_green = -(b + r) * y_green, k.by_blue = b - (b + r) * y_blue;
  k.sigma = noise_.chroma;
  k.counts_glints = 0;
  // Variance of the mean over so many pixels; one pixel's own width is in the blur.
  k.extra_u = static_cast<float>(grid_.columns * grid_.columns - 1) / 12;
  k.extra_v = static_cast<float>(grid_.rows * grid_.rows - 1) / 12;
  k.finish();
  return k;
}

template <typename Add>
void OutlineFit::add_up(Add&& add) {
  const EdgeModel of_light = model_of_light();
  add(of_light, light_);
  visible_ = sums_.edge > 0 ? sums_.seen_edge / sums_.edge : 0;
  if (has_chroma_) add(model_of_chroma(of_light), chroma_);
  sums_.gradient(gradient_);
  gradient_[lit_ + 1] /= band_.radius_px;  // lit_v is per radius
  misfit_ = sums_.trusted > 0 ? sums_.residual2 / sums_.trusted / usual_loss : 0;
}

HeldNormal OutlineFit::held_information() const {
  const HeldUnknowns information = information_.diagonal()(held_unknowns);
  return information.asDiagonal();
}

void OutlineFit::assemble() {
  sums_.begin_assembling(is_light_held_);
  add_up([&](const EdgeModel& model, EdgeSamples& samples) { sums_.assemble(model, samples); });
  assembled_weight_ = sums_.edge_weight;
  if (is_light_held_) {
    sums_.normal(held_normal_);
    held_normal_.row(held_count - 1) /= band_.radius_px, held_normal_.col(held_count - 1) /= band_.radius_px;
    held_equations_.eliminate(held_normal_, held_information());
    place_covariance_ = held_equations_.covariance();
  } else {
    sums_.normal(normal_);
    normal_.row(lit_ + 1) /= band_.radius_px, normal_.col(lit_ + 1) /= band_.radius_px;
    equations_.eliminate(normal_, information_);
    place_covariance_ = equations_.covariance().topLeftCorner<placed, placed>();
  }
}

// Covariance of place and size that is due to the held unknowns: added in the next pictures (Schmidt's consider
// filter).
Eigen::Matrix3d OutlineFit::left_open() const {
  NormalEquations<held_count, placed> held;
  held.eliminate(normal_(held_unknowns, held_unknowns), held_information());
  return held.is_sound() ? Eigen::Matrix3d(place_covariance_ - held.covariance()) : place_covariance_;
}

void OutlineFit::renew() {
  sums_.begin_renewing();
  add_up([&](const EdgeModel& model, EdgeSamples& samples) { sums_.renew_residuals(model, samples); });
}

void OutlineFit::lay_out(const Ellipse& start, const Movement& movement, const AppearanceModel& model) {
  start_ = start;
  movement_ = movement;
  // Rolling shutter: a row dv below the centre shows the object dv * row_s later.
  Eigen::Matrix2d still_from_seen = Eigen::Matrix2d::Identity();
  still_from_seen.col(1) -= movement.row_s * movement.velocity;
  band_.centre = start.centre;
  band_.disc_from_px = start.axes.inverse() * still_from_seen;
  band_.radius_px = std::sqrt(1 / std::abs(band_.disc_from_px.determinant()));
  band_.reach_px = outline_fit.reach_px +
                   0.5 * movement.velocity.norm() * std::max(0.0, model.exposure_s.value + model.exposure_s.sigma);
}

bool OutlineFit::have_weights_changed() const {
  return sums_.edge_weight > outline_step.other_weight * assembled_weight_ ||
         outline_step.other_weight * sums_.edge_weight < assembled_weight_;
}

// Not finite: the sums do not determine it.
Unknowns OutlineFit::next_step() const {
  // The prior of the light is correlated, all others are independent.
  const Unknowns off = expected_ - x_;
  if (is_light_held_) return next_held_step(off);
  Unknowns right = gradient_ + information_.diagonal().cwiseProduct(off);
  right.segment<lights>(shading_) =
      gradient_.segment<lights>(shading_) +
      information_.block<lights, lights>(shading_, shading_).lazyProduct(off.segment<lights>(shading_));
  Unknowns step;
  equations_.solve(right, step);
  return limited(step);
}

Unknowns OutlineFit::next_held_step(const Unknowns& off) const {
  const Unknowns all = gradient_ + information_.diagonal().cwiseProduct(off);
  HeldUnknowns solved;
  held_equations_.solve(all(held_unknowns), solved);
  Unknowns step = Unknowns::Zero();
  step(held_unknowns) = solved;
  return limited(step);
}

// Limited to where the linearisation holds.
Unknowns OutlineFit::limited(Unknowns step) const {
  if (!step.allFinite()) return step;
  const auto limit = [&](double length, double most) {
    if (length > most) step *= most / length;
  };
  limit(step.head<2>().norm(), outline_step.max_step * band_.radius_px);
  limit(std::abs(step[size_]), outline_step.max_step / 2);
  limit(step.segment<2>(blur_light_).cwiseAbs().maxCoeff(), outline_step.max_step);
  return step;
}

bool OutlineFit::is_lost() const {
  return x_.head<2>().norm() > outline_fit.max_shift_radii * band_.radius_px ||
         std::abs(x_[size_] - expected_[size_]) > outline_fit.max_growth;
}

// Scalar product of two steps of place and size, in their standard deviations.
double OutlineFit::product_of(const Unknowns& step, const Unknowns& other) const {
  return step.head<2>().dot(place_covariance_.topLeftCorner<2, 2>().inverse() * other.head<2>()) +
         step[size_] * other[size_] / place_covariance_(size_, size_);
}

// So far that the derivatives are different there.
bool OutlineFit::is_far(const Unknowns& step) const {
  const double smear_px = 0.5 * movement_.velocity.norm() * std::abs(step[exposure_]);
  return step.head<2>().norm() + band_.radius_px * std::abs(step[size_]) + smear_px > outline_step.far_px ||
         std::abs(step[blur_light_]) > outline_step.other_blur;
}

// One unknown by the pixels alone: its prior is taken out again; the variance due to held unknowns is added at the end.
// nullopt: the pixels do not determine it.
std::optional<Estimate> OutlineFit::without_prior(int i) const {
  const double variance = is_light_held_ ? place_covariance_(i, i) : equations_.covariance()(i, i);
  const double before = information_(i, i), of_pixels = 1 / variance - before;
  if (!(of_pixels > 0)) return std::nullopt;
  const double share = of_pixels * variance;  // of the pixels in x_
  const double open = is_light_held_ ? held_open_(i, i) / (share * share) : 0;
  return Estimate{(x_[i] / variance - before * expected_[i]) / of_pixels, std::sqrt(1 / of_pixels + open)};
}

// Standard deviation of the misfit's logarithm: it is a mean of many squares.
double OutlineFit::misfit_by_chance() const {
  return std::sqrt(2 / std::max(1.0, sums_.trusted));
}

void OutlineFit::report(const AppearanceModel& model, Fit& out) const {
  const double worse = std::max(1.0, misfit_);
  out.centre = start_.centre + x_.head<2>();
  out.covariance = worse * place_covariance_.topLeftCorner<2, 2>();
  if (is_light_held_) out.covariance += held_open_.topLeftCorner<2, 2>();
  const double usual = std::max(1.0, model.usual_misfit) * (1 + 2 * misfit_by_chance());  // 98 %
  out.model_error = std::max(0.0, misfit_ - usual) * outline_fit.alike_share * sums_.trusted *
                    place_covariance_.topLeftCorner<2, 2>();
  out.bound =
      (is_light_held_ ? held_normal_.topLeftCorner<2, 2>().eval() : normal_.topLeftCorner<2, 2>().eval()).inverse();
  if (const auto size = without_prior(size_)) {
    out.log_size = {size->value, std::sqrt(worse) * size->sigma};
    const double unexplained = std::max(0.0, misfit_ - 1 - 2 * misfit_by_chance());
    out.size_model_error = std::sqrt(unexplained * outline_fit.alike_share * sums_.trusted) * size->sigma;
  } else {
    out.log_size = {x_[size_], 1};
  }
  out.misfit = misfit_;
  out.visible = visible_;
  out.outcome = visible_ < outline_fit.min_visible ? FitOutcome::unknown
                : misfit_ > outline_fit.max_misfit ? FitOutcome::misfit
                : !out.covariance.allFinite()      ? FitOutcome::no_contrast
                                                   : FitOutcome::fits;
}

// Reads the samples and their background. false: too little, see out.outcome.
bool OutlineFit::sample(const Picture& picture, const Background& behind, const AppearanceModel& model, Fit& out) {
  select_samples(band_, grid_, 1, 1, light_);
  chroma_.n = 0;
  if (has_chroma_) select_samples(band_, grid_, grid_.columns, grid_.rows, chroma_);
  out.pixels = light_.n;
  read_samples(picture, behind, band_, grid_, noise_, light_, chroma_);
  if (!find_object_color(model)) return false;
  make_samples();
  outliers_.begin();
  if (contrast_ >= outline_fit.min_contrast) return true;
  out.outcome = FitOutcome::no_contrast;
  return false;
}

Fit OutlineFit::fit(const Picture& picture, const Background& behind, const Ellipse& start, const Movement& movement,
                    const AppearanceModel& model, const FitOptions& options) {
  Fit out;
  out.centre = start.centre;
  lay_out(start, movement, model);
  is_edge_curved_ = options.is_edge_curved;
  out.outcome = FitOutcome::too_small;
  if (!(band_.radius_px >= outline_fit.min_radius_px) || !start.centre.allFinite() || !band_.disc_from_px.allFinite())
    return out;
  noise_ = {behind.light_noise(), behind.chroma_noise()};
  if (!find_grid(picture)) return out;
  if (!sample(picture, behind, model, out)) return out;
  const double smear_sigma_px = 0.5 * movement.velocity.norm() * model.exposure_s.sigma;
  is_light_held_ = options.may_hold_light && model.light && model.promise && smear_sigma_px < outline_step.far_px;
  if (is_light_held_) {
    held_open_ = model.promise->open;
    Fit held = out;
    if (iterate(model, options, held) && is_as_promised(model)) {
      report(model, held);
      if (held.outcome == FitOutcome::fits) return held;
    }
    is_light_held_ = false;
    trust_all();
  }
  if (iterate(model, options, out)) report(model, out);
  return out;
}

// Gauss-Newton steps. false: they did not converge, see out.outcome.
bool OutlineFit::iterate(const AppearanceModel& model, const FitOptions& options, Fit& out) {
  begin(model, options);
  out.outcome = FitOutcome::no_contrast;
  out.is_light_held = is_light_held_;
  // Derivatives and their products hardly change over a fraction of a pixel: they are assembled once and reused with
  // new residuals until the step, the outliers or the weights have changed them.
  bool needs_assembly = true;
  Unknowns before = Unknowns::Zero();  // the last step before extrapolation
  for (out.steps = 1; out.steps <= options.most_steps; ++out.steps) {
    if (!needs_assembly) renew();
    if (needs_assembly || have_weights_changed()) assemble();
    if (!(is_light_held_ ? held_equations_.is_sound() : equations_.is_sound())) return false;
    const OutlierPixels::Change change = out.steps <= outline_step.outlier_steps
                                             ? outliers_.judge(sums_.outlier_candidates, grid_, light_, chroma_)
                                             : OutlierPixels::Change::none;
    Unknowns step = next_step();
    if (!step.allFinite()) return false;
    needs_assembly = is_far(step) || change == OutlierPixels::Change::at_the_edge;
    // Iteratively reweighted steps shrink by about the same share: the whole geometric series is taken at once, unless
    // samples or derivatives have changed.
    const double length = std::sqrt(product_of(step, step)), length_before = std::sqrt(product_of(before, before));
    const double share =
        length_before > 0 ? std::clamp(product_of(step, before) / (length_before * length_before), 0.0, 0.5) : 0.0;
    const double to_come = std::max(outline_step.min_share, share / (1 - share)) * length;
    x_ += step / (1 - share);
    const bool is_steady = change == OutlierPixels::Change::none && !needs_assembly;
    before = is_steady ? step : Unknowns(Unknowns::Zero());
    x_[exposure_] = std::clamp(x_[exposure_], 0.0, outline_fit.max_exposure_s);
    if (is_lost()) {
      out.outcome = FitOutcome::lost;
      return false;
    }
    if (out.steps >= 2 && change == OutlierPixels::Change::none && !needs_assembly &&
        to_come < outline_step.settled_sigmas)
      break;
  }
  return true;
}

// Little is hidden, and misfit and size are as the last full fit promised, within chance.
bool OutlineFit::is_as_promised(const AppearanceModel& model) const {
  const double by_chance = 1 + held_light.chance_sigmas * misfit_by_chance();
  return visible_ >= held_light.min_visible && misfit_ <= model.promise->misfit * by_chance && !has_other_size();
}

void OutlineFit::trust_all() {
  outliers_.begin();
  for (EdgeSamples* samples : {&light_, &chroma_})
    samples->for_each([](EdgeSamples::Block& of, int k) { of.trust[k] = 1; });
}

bool OutlineFit::has_other_size() const {
  const double off = x_[size_] - expected_[size_];
  return off * off * information_(size_, size_) > appearance_learning.size_sigmas * appearance_learning.size_sigmas;
}

// What touches the ball raises the misfit and is not learnt.
void OutlineFit::learn_usual_misfit(AppearanceModel& model) const {
  if (visible_ < held_light.min_visible || has_other_size()) return;
  if (model.usual_misfit == 0) model.usual_misfit = misfit_;
  if (misfit_ > model.usual_misfit * (1 + held_light.chance_sigmas * misfit_by_chance())) return;
  model.usual_misfit += (misfit_ - model.usual_misfit) / background_noise.max_count;  // as in the background
}

bool OutlineFit::learn(AppearanceModel& model) const {
  learn_usual_misfit(model);
  if (is_light_held_) return false;
  model.exposure_s = {x_[exposure_], std::max(appearance_learning.min_exposure_sigma_s,
                                              std::sqrt(std::max(0.0, equations_.covariance()(exposure_, exposure_))))};
  // Blur belongs to the camera: a mean over many pictures, each without its prior.
  const auto average = [&](Estimate& known, int i) {
    const auto one = without_prior(i);
    if (!one) return;
    const double sigma2 = known.sigma * known.sigma;
    const double of_light = appearance_learning.blur_of_light;
    const double gain = sigma2 / (sigma2 + one->sigma * one->sigma + of_light * of_light);
    known.value += gain * (one->value - known.value);
    known.sigma = std::max(appearance_learning.blur_sigma, std::sqrt((1 - gain) * sigma2));
  };
  average(model.log_blur_light, blur_light_);
  average(model.log_blur_chroma, blur_chroma_);
  model.object = object_;
  model.promise.reset();
  if (has_other_size()) return false;
  if (visible_ >= held_light.min_visible) model.promise = {std::max(1.0, misfit_) * left_open(), misfit_};
  model.light = {x_.segment<lights>(shading_), std::max(1.0, misfit_) * equations_.covariance_of_light()};
  return true;
}

}  // namespace huetrack::outline
