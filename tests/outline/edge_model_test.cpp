// Properties of the edge model over random balls, lenses and colours: its derivatives against finite differences, its
// sums against plain ones.
#include "outline/edge_model.h"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <random>
#include <vector>

#include "outline/camera_curve.h"

namespace huetrack::outline {
namespace {

// One ball in front of one background, and the values measured there.
struct Ball {
  double radius_px = 6, axis_ratio = 1, blur_px = 0.7, more_px = 0.6, exposure_s = 0, sigma = 10;
  Eigen::Vector2d velocity = Eigen::Vector2d::Zero();
  Eigen::Vector3f color{0.1f, 0.45f, 0.03f};
  bool is_chroma = false;
};

Ball random_ball(std::mt19937& rng, bool is_moving) {
  std::uniform_real_distribution<double> share(0, 1);
  Ball ball;
  ball.radius_px = 3 + 9 * share(rng), ball.axis_ratio = 1 + 0.2 * share(rng);
  ball.blur_px = 0.5 + 0.6 * share(rng), ball.more_px = 0.4 + 0.5 * share(rng);
  ball.is_chroma = share(rng) < 0.5;
  for (int c = 0; c < 3; ++c) ball.color[c] = static_cast<float>(0.05 + 0.6 * share(rng));
  if (is_moving) {
    const double angle = 2 * std::numbers::pi * share(rng);
    ball.velocity = 500 * Eigen::Vector2d(std::cos(angle), std::sin(angle));
    ball.exposure_s = 0.004 + 0.004 * share(rng);
  }
  return ball;
}

// The model at these unknowns, as outline/design.md defines them; lit_v is per pixel.
EdgeModel model_at(const Ball& ball, const Unknowns& x, int moments) {
  EdgeModel m{};
  m.by_red = y_red * white, m.by_green = y_green * white, m.by_blue = y_blue * white;
  if (ball.is_chroma) m.by_red = 0.5f * by_red * white, m.by_green = -0.3f * white, m.by_blue = -0.1f * white;
  m.sigma = static_cast<float>(ball.sigma);
  m.blur2 = static_cast<float>(std::exp(2 * x[blur_light_]));
  m.more2 = static_cast<float>(std::exp(2 * x[blur_chroma_]));
  m.cu = static_cast<float>(x[cu_]), m.cv = static_cast<float>(x[cv_]);
  const double scale = std::exp(-x[size_]) / ball.radius_px;
  m.m00 = static_cast<float>(scale), m.m01 = static_cast<float>(0.1 * scale), m.m10 = 0;
  m.m11 = static_cast<float>(scale * ball.axis_ratio);
  m.vx = static_cast<float>(ball.velocity.x()), m.vy = static_cast<float>(ball.velocity.y());
  m.exposure = static_cast<float>(x[exposure_]);
  m.moments = moments;
  for (int i = 0; i < moments; ++i)
    m.moment[static_cast<std::size_t>(i)] = (static_cast<float>(i) + 0.5f) / static_cast<float>(moments) - 0.5f;
  m.smear2 = 1 / (12 * static_cast<float>(moments * moments));
  m.grey = grey_red * ball.color.x() + grey_green * ball.color.y() + grey_blue * ball.color.z();
  m.red = ball.color.x() - m.grey, m.green = ball.color.y() - m.grey, m.blue = ball.color.z() - m.grey;
  m.level = ball.color.maxCoeff();
  for (int i = 0; i < 9; ++i) m.shading[static_cast<std::size_t>(i)] = static_cast<float>(x[shading_ + i]);
  for (int i = 0; i < 3; ++i) m.paleness[static_cast<std::size_t>(i)] = static_cast<float>(x[paleness_ + i]);
  m.lit = static_cast<float>(1 + x[lit_]), m.lit_v = static_cast<float>(x[lit_ + 1]);
  m.finish();
  return m;
}

Unknowns unknowns_of(const Ball& ball) {
  Unknowns x = Unknowns::Zero();
  x[blur_light_] = std::log(ball.blur_px), x[blur_chroma_] = std::log(ball.more_px);
  x[exposure_] = ball.exposure_s;
  // Uniform light: the derivatives by place and size neglect that shading moves with the ball.
  x[shading_] = 1, x[paleness_] = 0.05;
  x[lit_] = 0.04, x[lit_ + 1] = 0.002;
  return x;
}

// Every pixel around the ball over a random background; some are not trusted.
void fill(EdgeSamples& samples, const Ball& ball, std::mt19937& rng) {
  std::uniform_real_distribution<float> share(0, 1);
  samples = {};
  const int reach = static_cast<int>(ball.radius_px) + 6;
  for (int v = -reach; v <= reach; ++v) {
    for (int u = -reach; u <= reach; ++u) {
      auto& of = samples.blocks[samples.n / EdgeSamples::block];
      const int k = samples.n++ % EdgeSamples::block;
      of.u[k] = static_cast<float>(u) + 0.3f, of.v[k] = static_cast<float>(v) - 0.2f;
      const float room = 0.15f + 0.1f * share(rng);
      of.red[k] = 1.1f * room, of.green[k] = room, of.blue[k] = 0.9f * room;
      of.trust[k] = share(rng) < 0.05f ? 0.f : 1.f;
      of.offset[k] = 2 * share(rng) - 1;
      of.measured[k] = 20 + 160 * share(rng);  // far from the model: the loss is at work
    }
  }
  auto& last = samples.blocks[samples.block_count() - 1];
  for (int k = samples.count_in(samples.block_count() - 1); k < EdgeSamples::block; ++k) last.u[k] = last.v[k] = 1e3f;
}

// Residuals in standard deviations, recovered from what the assembly leaves in the samples.
Eigen::VectorXd residuals(EdgeSums& sums, const EdgeModel& model, EdgeSamples& samples) {
  sums.begin_assembling(false);
  sums.assemble(model, samples);
  Eigen::VectorXd out(samples.n);
  int n = 0;
  samples.for_each([&](const EdgeSamples::Block& of, int k) {
    const double r2 = std::abs(static_cast<double>(of.off[k]));
    out[n++] = std::copysign(std::sqrt(r2 / (1 - r2 / static_cast<double>(outlier.loss2))), of.off[k]);
  });
  return out;
}

// Trust times Cauchy's weight.
Eigen::VectorXd weights(const Eigen::VectorXd& residual, EdgeSamples& samples) {
  Eigen::VectorXd out(samples.n);
  int n = 0;
  samples.for_each([&](const EdgeSamples::Block& of, int k) {
    const double r2 = residual[n] * residual[n];
    out[n++] = static_cast<double>(of.trust[k]) / (1 + r2 / static_cast<double>(outlier.loss2));
  });
  return out;
}

class EdgeModelProperty : public testing::TestWithParam<bool> {
 protected:
  static constexpr int moments_if_moving = 3;

  // Derivatives of the predicted values, in standard deviations, by central differences.
  Eigen::MatrixXd differences(const Ball& ball, const Unknowns& at, int moments) {
    Unknowns step = Unknowns::Constant(2e-3);
    step[cu_] = step[cv_] = 0.02, step[size_] = 0.02 / ball.radius_px, step[exposure_] = 2e-4;
    step[blur_light_] = step[blur_chroma_] = 0.02;
    Eigen::MatrixXd out(samples_->n, static_cast<int>(unknowns));
    for (int i = 0; i < unknowns; ++i) {
      Unknowns more = at, less = at;
      more[i] += step[i], less[i] -= step[i];
      const Eigen::VectorXd r_more = residuals(*sums_, model_at(ball, more, moments), *samples_);
      const Eigen::VectorXd r_less = residuals(*sums_, model_at(ball, less, moments), *samples_);
      out.col(i) = (r_less - r_more) / (2 * step[i]);
    }
    return out;
  }

  std::mt19937 rng_{11};
  std::unique_ptr<EdgeSamples> samples_ = std::make_unique<EdgeSamples>();
  std::unique_ptr<EdgeSums> sums_ = std::make_unique<EdgeSums>();
};

// Compares J' W J and J' W r, column by column in units of their own sizes. The derivative by size is that at the edge
// itself: off it, it has an error of the distance from the edge in radii. 4 %: what the model neglects (design.md), as
// seen.
TEST_P(EdgeModelProperty, DerivativesAreThoseOfFiniteDifferences) {
  for (int trial = 0; trial < 12; ++trial) {
    const Ball ball = random_ball(rng_, GetParam());
    const int moments = GetParam() ? moments_if_moving : 1;
    fill(*samples_, ball, rng_);
    const Unknowns x = unknowns_of(ball);
    const Eigen::MatrixXd j = differences(ball, x, moments);
    const Eigen::VectorXd r = residuals(*sums_, model_at(ball, x, moments), *samples_);
    const Eigen::VectorXd w = weights(r, *samples_);
    Normal normal;
    Unknowns gradient;
    sums_->normal(normal), sums_->gradient(gradient);
    const Normal expected = j.transpose() * w.asDiagonal() * j;
    const Unknowns expected_gradient = j.transpose() * w.cwiseProduct(r);
    const double r_size = std::sqrt(w.dot(r.cwiseAbs2()));
    const double edge_radii = std::hypot(ball.blur_px, ball.more_px) / ball.radius_px;
    const auto tolerance = [&](int a) { return 0.04 + edge_radii * (a == size_ ? 1 : a <= cv_ ? 0.2 : 0); };
    for (int a = 0; a < unknowns; ++a) {
      const double size_a = std::sqrt(expected(a, a));
      if (size_a < 1e-6) continue;  // exposure of a ball at rest
      EXPECT_NEAR(gradient[a] / (size_a * r_size), expected_gradient[a] / (size_a * r_size), tolerance(a))
          << trial << " " << a;
      for (int b = 0; b <= a; ++b) {
        const double size_b = std::sqrt(expected(b, b));
        if (size_b < 1e-6) continue;
        EXPECT_NEAR(normal(a, b) / (size_a * size_b), expected(a, b) / (size_a * size_b),
                    (1 + tolerance(a)) * (1 + tolerance(b)) - 1)
            << "trial " << trial << ", unknowns " << a << " and " << b;
      }
    }
  }
}

TEST_P(EdgeModelProperty, HeldSumsAreAPartOfAllSums) {
  for (int trial = 0; trial < 6; ++trial) {
    const Ball ball = random_ball(rng_, GetParam());
    fill(*samples_, ball, rng_);
    const EdgeModel model = model_at(ball, unknowns_of(ball), GetParam() ? moments_if_moving : 1);
    residuals(*sums_, model, *samples_);
    Normal normal;
    Unknowns gradient, held_gradient;
    sums_->normal(normal), sums_->gradient(gradient);
    const double edge = sums_->edge, residual2 = sums_->residual2;
    sums_->begin_assembling(true);
    sums_->assemble(model, *samples_);
    HeldNormal held;
    sums_->normal(held), sums_->gradient(held_gradient);
    EXPECT_TRUE(held.isApprox(normal(held_unknowns, held_unknowns), 1e-4)) << trial;
    EXPECT_TRUE(held_gradient(held_unknowns).isApprox(gradient(held_unknowns), 1e-4)) << trial;
    EXPECT_EQ(held_gradient[blur_light_], 0);
    EXPECT_NEAR(sums_->edge, edge, 1e-4 * edge);
    EXPECT_NEAR(sums_->residual2, residual2, 1e-4 * residual2);
  }
}

// Old derivatives, new residuals and weights.
TEST_P(EdgeModelProperty, RenewedGradientHasTheOldDerivatives) {
  const int moments = GetParam() ? moments_if_moving : 1;
  for (int trial = 0; trial < 4; ++trial) {
    const Ball ball = random_ball(rng_, GetParam());
    fill(*samples_, ball, rng_);
    const Unknowns x = unknowns_of(ball);
    Unknowns there = x;
    there[cu_] += 0.4, there[size_] -= 0.05, there[shading_] += 0.1;
    const Eigen::MatrixXd j = differences(ball, x, moments);
    const Eigen::VectorXd r = residuals(*sums_, model_at(ball, there, moments), *samples_);
    const Eigen::VectorXd w = weights(r, *samples_);
    residuals(*sums_, model_at(ball, x, moments), *samples_);
    sums_->begin_renewing();
    sums_->renew_residuals(model_at(ball, there, moments), *samples_);
    Unknowns gradient;
    sums_->gradient(gradient);
    const double r_size = std::sqrt(w.dot(r.cwiseAbs2()));
    for (int a = 0; a < unknowns; ++a) {
      const double size = std::sqrt((w.array() * j.col(a).array().square()).sum()) * r_size;
      if (size < 1e-6) continue;
      EXPECT_NEAR(gradient[a] / size, j.col(a).dot(w.cwiseProduct(r)) / size, a == size_ ? 0.2 : 0.04)
          << trial << " " << a;
    }
  }
}

TEST_P(EdgeModelProperty, SamplesWithoutTrustDoNotCount) {
  const Ball ball = random_ball(rng_, GetParam());
  fill(*samples_, ball, rng_);
  samples_->for_each([](EdgeSamples::Block& of, int k) { of.trust[k] = of.u[k] > 0 ? 0.f : 1.f; });
  const EdgeModel model = model_at(ball, unknowns_of(ball), GetParam() ? moments_if_moving : 1);
  Normal before, after;
  residuals(*sums_, model, *samples_);
  sums_->normal(before);
  samples_->for_each([](EdgeSamples::Block& of, int k) {
    if (of.u[k] > 0) of.measured[k] += 100, of.green[k] *= 0.5f;
  });
  residuals(*sums_, model, *samples_);
  sums_->normal(after);
  EXPECT_TRUE(after.isApprox(before, 1e-6));
  EXPECT_LT(sums_->seen_edge, 0.7 * sums_->edge);
}

INSTANTIATE_TEST_SUITE_P(Balls, EdgeModelProperty, testing::Bool(),
                         [](const auto& param) { return param.param ? "moving" : "still"; });

// The covered share is the integral of the edge's density over the outside of the outline.
TEST(EdgeModel, CoversTheIntegralOfItsEdge) {
  const Ball ball{.radius_px = 40, .blur_px = 1.0};
  auto samples = std::make_unique<EdgeSamples>();
  auto sums = std::make_unique<EdgeSums>();
  std::mt19937 rng(1);
  fill(*samples, {.radius_px = 6}, rng);
  int n = 0;
  samples->for_each(
      [&](EdgeSamples::Block& of, int k) { of.u[k] = 35 + 10.f * static_cast<float>(n++) / 300, of.v[k] = 0; });
  Unknowns x = unknowns_of(ball);
  x[blur_chroma_] = -20;  // colour is as sharp as light
  residuals(*sums, model_at(ball, x, 1), *samples);
  samples->for_each([&](const EdgeSamples::Block& of, int k) {
    const double off = (static_cast<double>(of.u[k]) - ball.radius_px) / ball.blur_px;
    EXPECT_NEAR(static_cast<double>(of.covered[k]), 0.5 * std::erfc(off / std::numbers::sqrt2), 0.025) << off;
  });
}

TEST(InverseRoot, IsRightBetweenItsBounds) {
  std::mt19937 rng(3);
  std::uniform_real_distribution<double> exponent(-4, 4), ratio(1, 2);
  for (int trial = 0; trial < 200; ++trial) {
    const double least = std::exp(exponent(rng)), most = least * ratio(rng);
    const InverseRoot root(least, most);
    for (int k = 0; k <= 20; ++k) {
      const double x = least + k / 20.0 * (most - least);
      ASSERT_NEAR(static_cast<double>(root(static_cast<float>(x))) * std::sqrt(x), 1, 7e-4) << least << " " << most;
    }
  }
}

TEST(CameraCurve, IsSrgbAndItsInverse) {
  for (double grey = 0.03; grey <= 1; grey += 0.01) {
    const double srgb = grey <= 0.04045 ? grey / 12.92 : std::pow((grey + 0.055) / 1.055, 2.4);
    EXPECT_NEAR(static_cast<double>(light_of(static_cast<float>(grey))), srgb, 0.003) << grey;
    EXPECT_NEAR(static_cast<double>(grey_of(light_of(static_cast<float>(grey)))), grey, 0.004) << grey;
  }
}

TEST(CameraCurve, LinearLightUndoesLumaAndChroma) {
  std::mt19937 rng(5);
  std::uniform_real_distribution<float> value(30, 225);
  for (int trial = 0; trial < 200; ++trial) {
    const float r = value(rng), g = value(rng), b = value(rng);
    const LightChroma seen = ycc(r, g, b);
    const LinearLight light = linear_light(seen.light, seen.blue, seen.red);
    EXPECT_NEAR(light.red, light_of(r / white), 1e-4f);
    EXPECT_NEAR(light.green, light_of(g / white), 1e-4f);
    EXPECT_NEAR(light.blue, light_of(b / white), 1e-4f);
  }
}

}  // namespace
}  // namespace huetrack::outline
