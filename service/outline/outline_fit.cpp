#include "outline/outline_fit.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "outline/camera_curve.h"

namespace huetrack::outline {
namespace {

constexpr double reach_px = 4;           // beyond the edge, and within it: as far as an edge's softness carries
constexpr double least_radius_px = 1.5;  // smaller discs are all edge
constexpr int least_pixels = 24;
constexpr float least_contrast = 4;  // of the object's colour to what is behind it, in standard deviations of a pixel
constexpr float model_light = 1.5f, model_chroma = 1.f;  // grey values by which the model itself is off
constexpr double usual_loss = 0.66;                      // what the robust loss makes of a normal residual's square
constexpr double worst_misfit = 9;
constexpr double least_visible = 0.25;  // of the edge
// Natural logarithms: by how much pictures of one camera differ in blur, and what light that the model does not know
// makes of a single one's; pictures that follow one another show much the same, so that ten count as one.
constexpr double blur_of_one = 0.05, blur_of_light = 0.6, least_blur_sigma = 0.05;
// So much smaller or larger, what is seen is not its light alone: something hides a part of it.
constexpr double other_size_sigmas = 2;
constexpr double furthest_radii = 0.8, largest_growth = 0.35;
constexpr double longest_exposure_s = 0.04;
// Steps that are to come would move it by less than such a share of its standard deviation; they are foreseen to a
// third.
constexpr double settled_sigmas = 0.4, least_share = 0.3;
// Half an edge's softness on, slopes are others; as they are for an edge so much softer. Residuals that are so much
// smaller weigh so much more.
constexpr double far_px = 0.35, other_blur = 0.2, other_weight = 1.1;
// Of the edge, so that what is held of the light does not pass for what hides a part: less, and one side is not seen.
constexpr double enough_visible = 0.75;
constexpr double lit_sigma = 0.1;       // by how much light on all of a picture changes from one to the next
constexpr double by_chance_sigmas = 4;  // of a misfit, which is a mean of so many squares
constexpr double most_promised = 2;     // twice what noise makes is no promise: the model is off

}  // namespace

// The pixels within reach. false: none, or too many.
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
    return count > 0 && count <= StrangePixels::largest_grid;
  };
  return bounds(0, picture.part_u, picture.end_u(), grid_.columns, grid_.u0, grid_.width) &&
         bounds(1, picture.part_v, picture.end_v(), grid_.rows, grid_.v0, grid_.height);
}

// Its colour: as it was, or the median inside.
bool OutlineFit::know_object(const Look& look) {
  const auto shrunk = static_cast<float>(std::max(0.3, 1 - 1.2 / band_.radius_px));
  if (look.object.maxCoeff() > 0) {
    object_ = look.object;
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

// What is measured, and what is behind it as linear light.
void OutlineFit::make_samples() {
  // Of chroma the direction in which the object differs most from what is around it.
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

void OutlineFit::begin(const Look& look, const FitOptions& options) {
  x_.setZero();
  information_.setZero();
  const auto know = [&](int i, double value, double sigma) {
    x_[i] = value;
    information_(i, i) = 1 / (sigma * sigma);
  };
  know(size_, options.log_size.value, options.log_size.sigma);
  know(blur_light_, look.log_blur_light.value, std::hypot(look.log_blur_light.sigma, blur_of_one));
  know(blur_chroma_, look.log_blur_chroma.value, std::hypot(look.log_blur_chroma.sigma, blur_of_one));
  know(exposure_, look.exposure_s.value, look.exposure_s.sigma);
  know(lit_, 0, lit_sigma), know(lit_ + 1, 0, 0.05);
  know(shading_, 1, 0.5);
  for (int i = 1; i < 3; ++i) know(shading_ + i, 0, 0.7);
  // Light from anywhere on a dull ball is a quadratic polynomial of its surface's direction (Ramamoorthi and Hanrahan
  // 2001). What darkens towards the edge, and more on one side, is hard to tell from an edge that is elsewhere: of a
  // small ball it is taken for the edge's place unless it must be light; a large one has pixels enough to tell.
  for (int i = 3; i < 6; ++i) know(shading_ + i, 0, 0.05);
  know(shading_ + 6, 0, 0.2);
  for (int i = 7; i < 9; ++i) know(shading_ + i, 0, 0.03);
  know(paleness_, 0, 0.2);
  for (int i = 1; i < 3; ++i) know(paleness_ + i, 0, 0.05);
  expected_ = x_;
  if (!look.light) return;
  if (is_light_held_) {
    x_.segment<lights>(shading_) = look.light->mean;
    expected_ = x_;
    information_(shading_, shading_) = 1 / (lit_sigma * lit_sigma);
    return;
  }
  // One picture hardly tells such light from an edge that is elsewhere; many of the same light do (a Kalman filter of a
  // first-order Gauss-Markov process).
  const double kept = options.light_correlation, kept2 = kept * kept;
  auto information = information_.block<lights, lights>(shading_, shading_);
  LightMatrix covariance = kept2 * look.light->covariance;
  covariance.diagonal() += (1 - kept2) * information.diagonal().cwiseInverse();
  const auto of_light = inverse_of(covariance);
  if (!of_light) return;
  information = *of_light;
  auto light = expected_.segment<lights>(shading_);
  light += kept * (look.light->mean - light);
  x_.segment<lights>(shading_) = look.light->mean;
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
  const double exposure = std::clamp(x_[exposure_], 0.0, longest_exposure_s);
  k.exposure = static_cast<float>(exposure);
  // A moment for each blur's width of the way.
  const double way = movement_.velocity.norm() * exposure;
  k.moments = std::clamp(static_cast<int>(std::ceil(way / (2 * static_cast<double>(blur)))), 1, 8);
  for (int i = 0; i < k.moments; ++i)
    k.moment[static_cast<std::size_t>(i)] = (static_cast<float>(i) + 0.5f) / static_cast<float>(k.moments) - 0.5f;
  k.smear2 = 1 / (12 * static_cast<float>(k.moments * k.moments));
  k.grey = grey_red * object_.x() + grey_green * object_.y() + grey_blue * object_.z();
  k.red = object_.x() - k.grey, k.green = object_.y() - k.grey, k.blue = object_.z() - k.grey;
  k.level = object_.maxCoeff();
  for (int i = 0; i < 9; ++i) k.shading[static_cast<std::size_t>(i)] = static_cast<float>(x_[shading_ + i]);
  for (int i = 0; i < 3; ++i) k.paleness[static_cast<std::size_t>(i)] = static_cast<float>(x_[paleness_ + i]);
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
  // The mean over so many pixels; one pixel's own width is in the blur.
  k.extra_u = static_cast<float>(grid_.columns * grid_.columns - 1) / 12;
  k.extra_v = static_cast<float>(grid_.rows * grid_.rows - 1) / 12;
  k.finish();
  return k;
}

// add(model, samples): to the sums.
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

// The inverse of all equations is that of those that are fitted while the light is held, and what the others leave open
// there: so much is added to their inverse in the next picture (Schmidt's Kalman filter that considers what it does not
// estimate).
Eigen::Matrix3d OutlineFit::left_open() const {
  NormalEquations<held_count, placed> held;
  held.eliminate(normal_(held_unknowns, held_unknowns), held_information());
  return held.is_sound() ? Eigen::Matrix3d(place_covariance_ - held.covariance()) : place_covariance_;
}

void OutlineFit::renew() {
  sums_.begin_renewing();
  add_up([&](const EdgeModel& model, EdgeSamples& samples) { sums_.renew_residuals(model, samples); });
}

void OutlineFit::lay_out(const Ellipse& start, const Movement& movement, const Look& look) {
  start_ = start;
  movement_ = movement;
  // A row that is dv below the centre's shows the object where it is dv row_s later.
  Eigen::Matrix2d still_from_seen = Eigen::Matrix2d::Identity();
  still_from_seen.col(1) -= movement.row_s * movement.velocity;
  band_.centre = start.centre;
  band_.disc_from_px = start.axes.inverse() * still_from_seen;
  band_.radius_px = std::sqrt(1 / std::abs(band_.disc_from_px.determinant()));
  band_.reach_px =
      reach_px + 0.5 * movement.velocity.norm() * std::max(0.0, look.exposure_s.value + look.exposure_s.sigma);
}

bool OutlineFit::are_weights_others() const {
  return sums_.edge_weight > other_weight * assembled_weight_ || other_weight * sums_.edge_weight < assembled_weight_;
}

// Not finite: the sums do not tell.
Unknowns OutlineFit::next_step() const {
  // What is known beforehand of the light hangs together, of all else each by itself.
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

// No further than the sums are right for where they were made.
Unknowns OutlineFit::limited(Unknowns step) const {
  if (!step.allFinite()) return step;
  const auto limit = [&](double length, double most) {
    if (length > most) step *= most / length;
  };
  limit(step.head<2>().norm(), 0.4 * band_.radius_px);
  limit(std::abs(step[size_]), 0.2);
  limit(step.segment<2>(blur_light_).cwiseAbs().maxCoeff(), 0.4);
  return step;
}

bool OutlineFit::is_lost() const {
  return x_.head<2>().norm() > furthest_radii * band_.radius_px ||
         std::abs(x_[size_] - expected_[size_]) > largest_growth;
}

// Of two steps of the place and the size, in their standard deviations.
double OutlineFit::product_of(const Unknowns& step, const Unknowns& other) const {
  return step.head<2>().dot(place_covariance_.topLeftCorner<2, 2>().inverse() * other.head<2>()) +
         step[size_] * other[size_] / place_covariance_(size_, size_);
}

// So that slopes are others there.
bool OutlineFit::is_far(const Unknowns& step) const {
  const double smear_px = 0.5 * movement_.velocity.norm() * std::abs(step[exposure_]);
  return step.head<2>().norm() + band_.radius_px * std::abs(step[size_]) + smear_px > far_px ||
         std::abs(step[blur_light_]) > other_blur;
}

// What the pixels say of one unknown by themselves, without what was expected of it. What is held moves what they say,
// and nothing else: it is added at the end. nullopt: nothing.
std::optional<Known> OutlineFit::told_by_itself(int i) const {
  const double variance = is_light_held_ ? place_covariance_(i, i) : equations_.covariance()(i, i);
  const double before = information_(i, i), told = 1 / variance - before;
  if (!(told > 0)) return std::nullopt;
  const double share = told * variance;  // of what the pixels say that is in x_
  const double open = is_light_held_ ? held_open_(i, i) / (share * share) : 0;
  return Known{(x_[i] / variance - before * expected_[i]) / told, std::sqrt(1 / told + open)};
}

void OutlineFit::tell(Fit& out) const {
  const double worse = std::max(1.0, misfit_);
  out.centre = start_.centre + x_.head<2>();
  out.covariance = worse * place_covariance_.topLeftCorner<2, 2>();
  if (is_light_held_) out.covariance += held_open_.topLeftCorner<2, 2>();
  out.bound =
      (is_light_held_ ? held_normal_.topLeftCorner<2, 2>().eval() : normal_.topLeftCorner<2, 2>().eval()).inverse();
  if (const auto size = told_by_itself(size_)) {
    out.log_size = {size->value, std::sqrt(worse) * size->sigma};
  } else {
    out.log_size = {x_[size_], 1};
  }
  out.misfit = misfit_;
  out.visible = visible_;
  out.outcome = visible_ < least_visible      ? FitOutcome::unknown
                : misfit_ > worst_misfit      ? FitOutcome::misfit
                : !out.covariance.allFinite() ? FitOutcome::no_contrast
                                              : FitOutcome::fits;
}

// What is seen around the edge, and what is behind it. false: too little, which `out` tells.
bool OutlineFit::sample(const Picture& picture, const Background& behind, const Look& look, Fit& out) {
  select_samples(band_, grid_, 1, 1, light_);
  chroma_.n = 0;
  if (has_chroma_) select_samples(band_, grid_, grid_.columns, grid_.rows, chroma_);
  out.pixels = light_.n;
  if (light_.n < least_pixels) return false;
  read_samples(picture, behind, band_, grid_, noise_, light_, chroma_);
  if (!know_object(look)) return false;
  make_samples();
  strange_pixels_.begin();
  if (contrast_ >= least_contrast) return true;
  out.outcome = FitOutcome::no_contrast;
  return false;
}

Fit OutlineFit::fit(const Picture& picture, const Background& behind, const Ellipse& start, const Movement& movement,
                    const Look& look, const FitOptions& options) {
  Fit out;
  out.centre = start.centre;
  lay_out(start, movement, look);
  out.outcome = FitOutcome::too_small;
  if (!(band_.radius_px >= least_radius_px) || !start.centre.allFinite() || !band_.disc_from_px.allFinite()) return out;
  noise_ = {std::hypot(behind.light_noise(), model_light), std::hypot(behind.chroma_noise(), model_chroma)};
  if (!find_grid(picture)) return out;
  if (!sample(picture, behind, look, out)) return out;
  const double smear_sigma_px = 0.5 * movement.velocity.norm() * look.exposure_s.sigma;
  is_light_held_ = options.may_hold_light && look.light && look.promise && smear_sigma_px < far_px;
  if (is_light_held_) {
    held_open_ = look.promise->open;
    Fit held = out;
    if (step_down(look, options, held) && is_as_promised(look)) {
      tell(held);
      if (held.outcome == FitOutcome::fits) return held;
    }
    is_light_held_ = false;
    trust_all();
  }
  if (step_down(look, options, out)) tell(out);
  return out;
}

// Gauss and Newton's steps. false: they ended nowhere, which `out` tells.
bool OutlineFit::step_down(const Look& look, const FitOptions& options, Fit& out) {
  begin(look, options);
  out.outcome = FitOutcome::no_contrast;
  out.is_light_held = is_light_held_;
  // Slopes and their products hardly change over a fraction of a pixel, and residuals alone say where they are least:
  // so slopes are made once, and again where they are others.
  bool are_slopes_others = true;
  Unknowns before = Unknowns::Zero();  // the last step, as the sums gave it
  for (out.steps = 1; out.steps <= options.most_steps; ++out.steps) {
    if (!are_slopes_others) renew();
    if (are_slopes_others || are_weights_others()) assemble();
    if (!(is_light_held_ ? held_equations_.is_sound() : equations_.is_sound())) return false;
    const StrangePixels::Count count =
        out.steps <= 3 ? strange_pixels_.judge(sums_.strange, grid_, light_, chroma_) : StrangePixels::Count::the_same;
    Unknowns step = next_step();
    if (!step.allFinite()) return false;
    are_slopes_others = is_far(step) || count == StrangePixels::Count::others_at_the_edge;
    // Weights that follow the residuals make each step about the same share of the one before: all that are to come are
    // taken at once. Of other samples, or of slopes elsewhere, there was none before.
    const double length = std::sqrt(product_of(step, step)), length_before = std::sqrt(product_of(before, before));
    const double share =
        length_before > 0 ? std::clamp(product_of(step, before) / (length_before * length_before), 0.0, 0.5) : 0.0;
    const double to_come = std::max(least_share, share / (1 - share)) * length;
    x_ += step / (1 - share);
    const bool is_steady = count == StrangePixels::Count::the_same && !are_slopes_others;
    before = is_steady ? step : Unknowns(Unknowns::Zero());
    x_[exposure_] = std::clamp(x_[exposure_], 0.0, longest_exposure_s);
    if (is_lost()) {
      out.outcome = FitOutcome::lost;
      return false;
    }
    if (out.steps >= 2 && count == StrangePixels::Count::the_same && !are_slopes_others && to_come < settled_sigmas)
      break;
  }
  return true;
}

// Hardly anything hides it; pixels and size are as they were to be, but for chance.
bool OutlineFit::is_as_promised(const Look& look) const {
  const double by_chance = 1 + by_chance_sigmas * std::sqrt(2 / std::max(1.0, sums_.trusted));
  return visible_ >= enough_visible && misfit_ <= std::min(most_promised, look.promise->misfit) * by_chance &&
         !has_other_size();
}

void OutlineFit::trust_all() {
  strange_pixels_.begin();
  for (EdgeSamples* samples : {&light_, &chroma_})
    samples->for_each([](EdgeSamples::Block& of, int k) { of.trust[k] = 1; });
}

bool OutlineFit::has_other_size() const {
  const double off = x_[size_] - expected_[size_];
  return off * off * information_(size_, size_) > other_size_sigmas * other_size_sigmas;
}

bool OutlineFit::learn(Look& look) const {
  if (is_light_held_) return false;
  // What a fit says of them is not independent of what the last one said.
  const auto keep = [&](Known& known, int i, double least_sigma) {
    known.value = x_[i];
    known.sigma = std::max(least_sigma, std::sqrt(std::max(0.0, equations_.covariance()(i, i))));
  };
  keep(look.exposure_s, exposure_, 0.0005);
  // Blur is the camera's: many pictures' mean, of what each says by itself.
  const auto average = [&](Known& known, int i) {
    const auto told = told_by_itself(i);
    if (!told) return;
    const double sigma2 = known.sigma * known.sigma;
    const double gain = sigma2 / (sigma2 + told->sigma * told->sigma + blur_of_light * blur_of_light);
    known.value += gain * (told->value - known.value);
    known.sigma = std::max(least_blur_sigma, std::sqrt((1 - gain) * sigma2));
  };
  average(look.log_blur_light, blur_light_);
  average(look.log_blur_chroma, blur_chroma_);
  look.object = object_;
  look.promise.reset();
  if (has_other_size()) return false;
  if (visible_ >= enough_visible) look.promise = {std::max(1.0, misfit_) * left_open(), misfit_};
  look.light = {x_.segment<lights>(shading_), std::max(1.0, misfit_) * equations_.covariance_of_light()};
  return true;
}

}  // namespace huetrack::outline
