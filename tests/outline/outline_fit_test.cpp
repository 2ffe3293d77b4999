#include "outline/outline_fit.h"

#include <gtest/gtest.h>

#include <Eigen/LU>

#include <cmath>
#include <memory>
#include <random>
#include <set>
#include <utility>
#include <vector>

#include "outline/disc_picture.h"

namespace huetrack::outline {
namespace {

class OutlineFitTest : public testing::Test {
 protected:
  void learn(const DiscScene& scene) {
    DiscScene empty = scene;
    empty.has_disc = false;
    DiscPicture picture;
    for (unsigned i = 0; i < 60; ++i) background_.learn(picture.draw(empty, i), {{60, 45}, 10}, {0, 0}, nullptr, 0);
  }
  // Started beside the truth.
  Fit fit(const DiscScene& scene, unsigned seed, const Eigen::Vector2d& beside = {0.5, -0.4},
          const Eigen::Vector2d& px_per_s = {0, 0}) {
    DiscPicture picture;
    const Ellipse start{scene.centre + beside, scene.radius_px * Eigen::Matrix2d::Identity()};
    return fit_->fit(picture.draw(scene, 1000 + seed), background_, start, {px_per_s, 0}, {}, {.log_size = {0, 0.05}});
  }

  Background background_{DiscPicture::width, DiscPicture::height};
  std::unique_ptr<OutlineFit> fit_ = std::make_unique<OutlineFit>();
};

TEST_F(OutlineFitTest, FindsADiscToHundredthsOfAPixel) {
  learn({});
  double sum2 = 0;
  for (unsigned i = 0; i < 20; ++i) {
    DiscScene scene;
    scene.centre += Eigen::Vector2d(0.13 * i, 0.07 * i);
    const Fit f = fit(scene, i);
    ASSERT_EQ(f.outcome, FitOutcome::fits);
    sum2 += (f.centre - scene.centre).squaredNorm() / 2;
    EXPECT_NEAR(f.log_size.value, 0, 0.02);
    EXPECT_GT(f.visible, 0.9);
  }
  EXPECT_LT(std::sqrt(sum2 / 20), 0.05);
}

// The middle of its edge lies within it by half the variance over the radius.
TEST_F(OutlineFitTest, ASmallSoftDiscIsAsLargeAsItIsIfItsEdgeIsCurved) {
  learn({});
  DiscPicture picture;
  double straight = 0, curved = 0;
  for (unsigned i = 0; i < 10; ++i) {
    DiscScene scene{.radius_px = 4, .blur_px = 1, .is_blurred_disc = true};
    scene.centre += Eigen::Vector2d(0.13 * i, 0.07 * i);
    const Ellipse start{scene.centre, scene.radius_px * Eigen::Matrix2d::Identity()};
    const auto size = [&](bool is_edge_curved) {
      const Fit f = fit_->fit(picture.draw(scene, i), background_, start, {}, {},
                              {.log_size = {0, 0.1}, .is_edge_curved = is_edge_curved});
      EXPECT_EQ(f.outcome, FitOutcome::fits);
      return f.log_size.value / 10;
    };
    straight += size(false), curved += size(true);
  }
  EXPECT_LT(straight, -0.015);
  EXPECT_NEAR(curved, 0, 0.015);
}

TEST_F(OutlineFitTest, CovarianceIsThatOfTheErrors) {
  learn({.noise = 4});
  double nees = 0;
  for (unsigned i = 0; i < 40; ++i) {
    DiscScene scene{.noise = 4};
    scene.centre += Eigen::Vector2d(0.06 * i, 0.03 * i);
    const Fit f = fit(scene, i);
    ASSERT_EQ(f.outcome, FitOutcome::fits);
    const Eigen::Vector2d off = f.centre - scene.centre;
    nees += off.dot((f.covariance.inverse() * off)) / 40;
  }
  EXPECT_GT(nees, 0.7);
  EXPECT_LT(nees, 5);
}

TEST_F(OutlineFitTest, IgnoresTheHiddenPartOfTheEdge) {
  const DiscScene scene{.pillar_from = 63};
  learn(scene);
  for (unsigned i = 0; i < 5; ++i) {
    const Fit f = fit(scene, i, {0.2, 0.1});
    ASSERT_EQ(f.outcome, FitOutcome::fits);
    EXPECT_LT((f.centre - scene.centre).norm(), 0.25);
    EXPECT_LT(f.visible, 0.85);
  }
}

TEST_F(OutlineFitTest, ASmearedOutlineLiesInTheMiddleOfItsPath) {
  learn({});
  const DiscScene scene{.smear_px = 5};
  const Fit f = fit(scene, 1, {0.3, 0.2}, {800, 0});
  ASSERT_EQ(f.outcome, FitOutcome::fits);
  EXPECT_LT((f.centre - scene.centre).norm(), 0.12);
}

TEST_F(OutlineFitTest, AGlintDoesNotMoveTheOutline) {
  learn({});
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (unsigned i = 0; i < 10; ++i) {
    DiscScene scene{.glint = 0.3};
    scene.centre += Eigen::Vector2d(0.11 * i, 0.07 * i);
    const Fit f = fit(scene, i);
    ASSERT_EQ(f.outcome, FitOutcome::fits);
    mean += (f.centre - scene.centre) / 10;
  }
  EXPECT_LT(mean.norm(), 0.05) << mean.transpose();
}

// Shading of a small disc is mistaken for a shift of the edge, unless many pictures in the same light are filtered.
TEST_F(OutlineFitTest, CorrelatedLightSeparatesShadingFromTheEdge) {
  const auto mean_off = [&](double light_correlation) {
    AppearanceModel model;
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    for (unsigned i = 0; i < 80; ++i) {
      DiscScene scene{.radius_px = 4, .bent = 0.2};
      scene.centre += Eigen::Vector2d(0.13 * i, 0.07 * i);
      DiscPicture picture;
      const Ellipse start{scene.centre, scene.radius_px * Eigen::Matrix2d::Identity()};
      const Fit f = fit_->fit(picture.draw(scene, i), background_, start, {}, model,
                              {.log_size = {0, 0.02}, .light_correlation = light_correlation});
      EXPECT_EQ(f.outcome, FitOutcome::fits);
      fit_->learn(model);
      if (i >= 40) sum += f.centre - scene.centre;
    }
    return (sum / 40).norm();
  };
  learn({.radius_px = 4});
  const double alone = mean_off(0), together = mean_off(0.98);
  EXPECT_GT(alone, 0.05);
  EXPECT_LT(together, 0.5 * alone);
}

class HeldLightTest : public OutlineFitTest {
 protected:
  // One picture after the other; the first ones are fitted with all unknowns.
  Fit next(DiscScene scene, bool may_hold_light) {
    scene.centre += Eigen::Vector2d(0.13 * (count_ % 9), 0.07 * (count_ % 7));
    DiscPicture picture;
    const Ellipse start{scene.centre + Eigen::Vector2d(0.2, -0.1), scene.radius_px * Eigen::Matrix2d::Identity()};
    const Fit f = fit_->fit(picture.draw(scene, count_++), background_, start, {}, model_,
                            {.log_size = {0, 0.02}, .light_correlation = 0.98, .may_hold_light = may_hold_light});
    off_ = f.centre - scene.centre;
    has_learnt_ = f.outcome == FitOutcome::fits && fit_->learn(model_);
    return f;
  }
  void learn_appearance(const DiscScene& scene) {
    learn(scene);
    for (int i = 0; i < 20; ++i) ASSERT_EQ(next(scene, false).outcome, FitOutcome::fits);
  }

  AppearanceModel model_;
  Eigen::Vector2d off_;
  bool has_learnt_ = false;
  unsigned count_ = 0;
};

TEST_F(HeldLightTest, IsAsAccurateAsAFitOfAllUnknowns) {
  learn_appearance({.radius_px = 5, .noise = 3, .bent = 0.1});
  double held2 = 0, nees = 0, all2 = 0;
  int held = 0;
  for (int i = 0; i < 60; ++i) {
    const bool may_hold = i % 2 == 0;
    const AppearanceModel before = model_;
    const Fit f = next({.radius_px = 5, .noise = 3, .bent = 0.1}, may_hold);
    ASSERT_EQ(f.outcome, FitOutcome::fits);
    if (!may_hold) {
      EXPECT_FALSE(f.is_light_held);
      all2 += off_.squaredNorm();
    } else if (f.is_light_held) {
      ++held;
      held2 += off_.squaredNorm(), nees += off_.dot(f.covariance.inverse() * off_) / 30;
      EXPECT_FALSE(has_learnt_);
      EXPECT_EQ(model_.light->mean, before.light->mean);
    }
  }
  EXPECT_GT(held, 24);
  EXPECT_GT(nees, 0.7);
  EXPECT_LT(nees, 5);
  EXPECT_LT(std::sqrt(held2), 1.5 * std::sqrt(all2));
}

// A finger over the right half of the disc is neither the disc nor the background.
TEST_F(HeldLightTest, AFingerIsNotTheDisc) {
  learn_appearance({});
  for (int i = 0; i < 10; ++i) {
    const Fit f = next({.finger_from = 62}, true);
    ASSERT_EQ(f.outcome, FitOutcome::fits);
    EXPECT_LT(off_.norm(), 0.3) << off_.transpose();
    EXPECT_LT(f.visible, 0.75);
  }
}

// What the model does not explain adds to the error by the pixels' noise.
TEST_F(HeldLightTest, StatesWhatItDoesNotExplain) {
  learn_appearance({});
  double whole = 0, touched = 0;
  for (int i = 0; i < 10; ++i) whole += next({}, true).model_error.trace() / 10;
  for (int i = 0; i < 10; ++i) touched += next({.noise = 4}, true).model_error.trace() / 10;
  EXPECT_LT(whole, 1e-4);
  EXPECT_GT(touched, 10 * whole + 1e-3);
}

TEST_F(HeldLightTest, CovarianceContainsWhatIsHeld) {
  learn_appearance({.radius_px = 5, .noise = 3});
  const unsigned picture = count_;
  const Fit held = next({.radius_px = 5, .noise = 3}, true);
  ASSERT_TRUE(held.is_light_held);
  const Eigen::Matrix3d open = model_.promise->open;
  model_.promise->open.setZero();
  count_ = picture;
  const Fit alone = next({.radius_px = 5, .noise = 3}, true);
  ASSERT_TRUE(alone.is_light_held);
  const Eigen::Matrix2d by_it = held.covariance - alone.covariance;
  EXPECT_TRUE(by_it.isApprox(open.topLeftCorner<2, 2>(), 1e-6)) << by_it;
  EXPECT_GT((open.topLeftCorner<2, 2>().trace()), 0);
}

// A wrong prior of the size does not bias it.
TEST_F(HeldLightTest, ReportsTheSizeWithoutItsPrior) {
  const DiscScene scene{.radius_px = 4, .noise = 3};
  learn_appearance(scene);
  double held = 0, all = 0, held_sigma = 0;
  constexpr int pictures = 20;
  for (unsigned i = 0; i < pictures; ++i) {
    DiscPicture picture;
    const Ellipse start{scene.centre, scene.radius_px * Eigen::Matrix2d::Identity()};
    const Picture drawn = picture.draw(scene, 500 + i);
    const FitOptions expected{.log_size = {0.02, 0.02}, .light_correlation = 0.98};
    FitOptions may_hold = expected;
    may_hold.may_hold_light = true;
    const Fit of_held = fit_->fit(drawn, background_, start, {}, model_, may_hold);
    held += of_held.log_size.value / pictures, held_sigma += of_held.log_size.sigma / pictures;
    all += fit_->fit(drawn, background_, start, {}, model_, expected).log_size.value / pictures;
  }
  EXPECT_NEAR(held, 0, held_sigma);
  EXPECT_NEAR(held, all, held_sigma);
}

// A large disc is subsampled; a hidden part is detected nevertheless.
TEST_F(HeldLightTest, IsConsistentWhereAPartOfALargeDiscIsHidden) {
  learn_appearance({.radius_px = 20, .noise = 2});
  double nees = 0, all_nees = 0;
  for (int i = 0; i < 40; ++i) {
    const bool may_hold = i % 2 == 0;
    const Fit f = next({.radius_px = 20, .pillar_from = 74, .noise = 2}, may_hold);
    ASSERT_EQ(f.outcome, FitOutcome::fits);
    (may_hold ? nees : all_nees) += off_.dot(f.covariance.inverse() * off_) / 20;
  }
  EXPECT_LT(nees, 2 * all_nees + 1);
}

TEST_F(HeldLightTest, HoldsMovingDiscsIfTheExposureIsKnown) {
  learn_appearance({});
  DiscPicture picture;
  const DiscScene scene{.smear_px = 2};
  const Ellipse start{scene.centre, scene.radius_px * Eigen::Matrix2d::Identity()};
  const FitOptions options{.log_size = {0, 0.02}, .light_correlation = 0.98, .may_hold_light = true};
  model_.exposure_s = {0.01, 0.0005};
  const Fit known = fit_->fit(picture.draw(scene, 7), background_, start, {{200, 0}, 0}, model_, options);
  EXPECT_TRUE(known.is_light_held);
  EXPECT_LT((known.centre - scene.centre).norm(), 0.1);
  model_.exposure_s = {0.006, 0.005};
  EXPECT_FALSE(fit_->fit(picture.draw(scene, 7), background_, start, {{200, 0}, 0}, model_, options).is_light_held);
}

TEST_F(HeldLightTest, FallsBackWhereHalfIsHidden) {
  learn_appearance({});
  EXPECT_TRUE(next({}, true).is_light_held);
  EXPECT_FALSE(next({.pillar_from = 60}, true).is_light_held);
}

TEST_F(HeldLightTest, FallsBackInAnotherLight) {
  learn_appearance({.radius_px = 8});
  EXPECT_TRUE(next({.radius_px = 8}, true).is_light_held);
  EXPECT_FALSE(next({.radius_px = 8, .bent = 0.5}, true).is_light_held);
}

// An occluder makes the disc smaller, and its shade is not the disc's.
TEST_F(OutlineFitTest, LearnsNoLightFromAnotherSize) {
  learn({});
  AppearanceModel model;
  DiscPicture picture;
  const auto is_learnt = [&](double radius_px) {
    const DiscScene scene;
    const Ellipse start{scene.centre, radius_px * Eigen::Matrix2d::Identity()};
    const Fit f = fit_->fit(picture.draw(scene, 3), background_, start, {}, model, {.log_size = {0, 0.02}});
    return f.outcome == FitOutcome::fits && fit_->learn(model);
  };
  EXPECT_TRUE(is_learnt(DiscScene{}.radius_px));
  EXPECT_FALSE(is_learnt(1.15 * DiscScene{}.radius_px));
}

// One soft picture hardly changes the camera's blur; many do.
TEST_F(OutlineFitTest, LearnsTheCamerasBlurFromManyPictures) {
  learn({});
  AppearanceModel model;
  const double before = model.log_blur_light.value;
  for (unsigned i = 0; i < 200; ++i) {
    DiscScene scene{.blur_px = 1.3};
    scene.centre += Eigen::Vector2d(0.02 * i, 0.01 * i);
    DiscPicture picture;
    const Ellipse start{scene.centre, scene.radius_px * Eigen::Matrix2d::Identity()};
    const Fit f = fit_->fit(picture.draw(scene, i), background_, start, {}, model, {.log_size = {0, 0.02}});
    ASSERT_EQ(f.outcome, FitOutcome::fits);
    fit_->learn(model);
    if (i == 0) {
      EXPECT_LT(model.log_blur_light.value, before + 0.5 * (std::log(1.3) - before));
    }
  }
  EXPECT_NEAR(model.log_blur_light.value, std::log(1.3), 0.08);
  EXPECT_LT(model.log_blur_light.sigma, 0.1);
}

TEST_F(OutlineFitTest, RefusesAnEmptyPicture) {
  learn({});
  EXPECT_NE(fit({.has_disc = false}, 1).outcome, FitOutcome::fits);
}

TEST_F(OutlineFitTest, RefusesTooSmallOrOutside) {
  learn({});
  EXPECT_EQ(fit({.radius_px = 0.5}, 1).outcome, FitOutcome::too_small);
  EXPECT_EQ(fit({.centre = {-500, 40}}, 1).outcome, FitOutcome::too_small);
}

// ---- Properties over random scenes

double trace_ratio(const Eigen::Matrix2d& a, const Eigen::Matrix2d& b) {
  return (b.inverse() * a).trace() / 2;
}

struct NoiseCase {
  double radius_px, blur_px, noise;
};
class CovarianceOf : public OutlineFitTest, public testing::WithParamInterface<NoiseCase> {};

// The same scene in many draws of the pixels' noise: the scatter of the fits is what they report.
TEST_P(CovarianceOf, IsThatOfPixelNoise) {
  const auto [radius_px, blur_px, noise] = GetParam();
  const DiscScene scene{.radius_px = radius_px, .blur_px = blur_px, .noise = noise};
  learn(scene);
  constexpr unsigned draws = 150;
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  Eigen::Matrix2d scatter = Eigen::Matrix2d::Zero(), reported = Eigen::Matrix2d::Zero(), bound = reported;
  double log_size = 0, log_size2 = 0, log_size_variance = 0;
  std::vector<Eigen::Vector2d> found;
  for (unsigned i = 0; i < draws; ++i) {
    const Fit f = fit(scene, i, {0.1, -0.1});
    ASSERT_EQ(f.outcome, FitOutcome::fits) << i;
    found.push_back(f.centre);
    mean += f.centre / draws, reported += f.covariance / draws, bound += f.bound / draws;
    log_size += f.log_size.value / draws, log_size2 += f.log_size.value * f.log_size.value / draws;
    log_size_variance += f.log_size.sigma * f.log_size.sigma / draws;
  }
  for (const Eigen::Vector2d& centre : found) scatter += (centre - mean) * (centre - mean).transpose() / (draws - 1.0);
  // Reported covariances also contain the model's own error (1.5 grey values) and the nuisances' priors.
  EXPECT_GT(trace_ratio(reported, scatter), 0.8);
  EXPECT_LT(trace_ratio(reported, scatter), 3.5);
  EXPECT_LT(bound.trace(), reported.trace()) << "nuisances cost information";
  EXPECT_GT(log_size_variance, 0.5 * (log_size2 - log_size * log_size));
}

INSTANTIATE_TEST_SUITE_P(Noise, CovarianceOf,
                         testing::Values(NoiseCase{4, 0.6, 3}, NoiseCase{7, 0.7, 3}, NoiseCase{7, 1.0, 6},
                                         NoiseCase{12, 0.7, 4}));

// All tiles of a few pictures, so that every pixel has the same count wherever the disc is.
class Invariance : public OutlineFitTest {
 protected:
  struct Moved {
    int right = 0, down = 0;
    bool is_mirrored = false;
    Eigen::Vector2d at(Eigen::Vector2d px) const {
      if (is_mirrored) px.x() = DiscPicture::width - 1 - px.x();
      return px + Eigen::Vector2d(right, down);
    }
  };
  Fit fit_moved(const DiscScene& scene, const Moved& by, const Eigen::Vector2d& beside = {0.3, -0.2}) {
    DiscScene empty = scene;
    empty.has_disc = false;
    Background behind(DiscPicture::width, DiscPicture::height);
    DiscPicture picture;
    for (unsigned i = 0; i < 6; ++i) {
      picture.draw(empty, i);
      behind.learn_all(picture.moved(by.right, by.down, by.is_mirrored), nullptr, 0);
    }
    picture.draw(scene, 77);
    const Ellipse start{by.at(scene.centre + beside), scene.radius_px * Eigen::Matrix2d::Identity()};
    return fit_->fit(picture.moved(by.right, by.down, by.is_mirrored), behind, start, {}, {}, {.log_size = {0, 0.05}});
  }
};

TEST_F(Invariance, ToTranslation) {
  for (const double radius_px : {3.0, 6.0, 13.0}) {
    const DiscScene scene{.radius_px = radius_px, .noise = 2};
    const Fit reference = fit_moved(scene, {});
    ASSERT_EQ(reference.outcome, FitOutcome::fits);
    for (const Moved& by : {Moved{2, 0}, Moved{-20, 14}, Moved{34, -18}}) {
      const Fit moved = fit_moved(scene, by);
      ASSERT_EQ(moved.outcome, FitOutcome::fits);
      EXPECT_LT((moved.centre - by.at(reference.centre)).norm(), 1e-3) << by.right;
      EXPECT_TRUE(moved.covariance.isApprox(reference.covariance, 1e-2)) << by.right;
      EXPECT_NEAR(moved.log_size.value, reference.log_size.value, 1e-3);
    }
  }
}

// The samples are others, as they are staggered from row to row.
TEST_F(Invariance, ToMirroring) {
  for (const double radius_px : {3.0, 6.0, 13.0}) {
    const DiscScene scene{.radius_px = radius_px, .noise = 2};
    const Moved by{.is_mirrored = true};
    const Fit reference = fit_moved(scene, {}, {0, 0}), mirrored = fit_moved(scene, by, {0, 0});
    ASSERT_EQ(mirrored.outcome, FitOutcome::fits);
    const double sigma = std::sqrt(reference.covariance.trace() / 2);
    EXPECT_LT((mirrored.centre - by.at(reference.centre)).norm(), sigma) << radius_px;
    EXPECT_NEAR(mirrored.covariance.trace(), reference.covariance.trace(), 0.15 * reference.covariance.trace());
    EXPECT_NEAR(mirrored.covariance(0, 1) / (sigma * sigma), -reference.covariance(0, 1) / (sigma * sigma), 0.1);
  }
}

TEST_F(Invariance, ToTheExposuresGain) {
  for (const double gain : {0.5, 0.75, 1.25, 1.6}) {
    const DiscScene scene{.noise = 0.3, .gain = gain};
    const Fit f = fit_moved(scene, {});
    ASSERT_EQ(f.outcome, FitOutcome::fits) << gain;
    EXPECT_LT((f.centre - scene.centre).norm(), 0.05) << gain;
    EXPECT_NEAR(f.log_size.value, 0, 0.02) << gain;
  }
}

// The room's light changes after the background was learnt.
TEST_F(OutlineFitTest, FollowsTheBackgroundsGain) {
  learn({});
  for (const double light : {0.9, 1.0, 1.1}) {
    const DiscScene scene{.light = light};
    const Fit f = fit(scene, 5);
    ASSERT_EQ(f.outcome, FitOutcome::fits) << light;
    EXPECT_LT((f.centre - scene.centre).norm(), 0.1) << light;
    EXPECT_LT(f.misfit, 2.5) << light;
  }
}

TEST_F(OutlineFitTest, DoesNotDependOnTheStart) {
  learn({});
  const DiscScene scene;
  const Fit reference = fit(scene, 3, {0, 0});
  std::mt19937 rng(8);
  std::uniform_real_distribution<double> px(-1.5, 1.5);
  for (int i = 0; i < 12; ++i) {
    const Eigen::Vector2d beside(px(rng), px(rng));
    const Fit f = fit(scene, 3, beside);
    ASSERT_EQ(f.outcome, FitOutcome::fits) << beside.transpose();
    const Eigen::Vector2d off = f.centre - reference.centre;
    EXPECT_LT(off.dot(reference.covariance.inverse() * off), 2.25) << beside.transpose();
  }
}

// The centre is that of the row where it lies.
TEST_F(OutlineFitTest, UndoesTheShearOfARollingShutter) {
  learn({});
  for (const double shear_px : {-0.25, -0.1, 0.1, 0.25}) {
    const DiscScene scene{.shear_px = shear_px};
    DiscPicture picture;
    const Ellipse start{scene.centre + Eigen::Vector2d(0.4, 0.3), scene.radius_px * Eigen::Matrix2d::Identity()};
    AppearanceModel model;
    model.exposure_s = {0, 1e-4};
    const Fit f = fit_->fit(picture.draw(scene, 9), background_, start, {{1000, 0}, shear_px / 1000}, model,
                            {.log_size = {0, 0.05}});
    ASSERT_EQ(f.outcome, FitOutcome::fits) << shear_px;
    EXPECT_LT((f.centre - scene.centre).norm(), 0.1) << shear_px;
    EXPECT_NEAR(f.log_size.value, 0, 0.03) << shear_px;
  }
}

// ---- Samples and outliers

TEST(EdgeSamplesOf, LieInTheBandOnceEach) {
  std::mt19937 rng(2);
  std::uniform_real_distribution<double> share(0, 1);
  auto samples = std::make_unique<EdgeSamples>();
  for (int trial = 0; trial < 60; ++trial) {
    const double radius_px = 2 + 40 * share(rng), reach_px = 4;
    Eigen::Matrix2d axes = radius_px * Eigen::Matrix2d::Identity();
    axes(0, 1) = 0.2 * radius_px * share(rng);
    const PixelGrid grid{10, 20, 124, 124, 2, 2};
    EdgeBand band{{72 + share(rng), 82 + share(rng)}, axes.inverse(), std::sqrt(axes.determinant()), reach_px};
    const int columns = trial % 2 + 1;
    select_samples(band, grid, columns, columns, *samples);
    ASSERT_GT(samples->n, 8) << radius_px;
    EXPECT_LT(samples->n, 1100) << radius_px;
    std::set<std::pair<int, int>> places;
    int ahead = 0;
    samples->for_each([&](const EdgeSamples::Block& of, int k) {
      EXPECT_TRUE(places.insert({of.at_u[k], of.at_v[k]}).second);
      EXPECT_EQ(of.trust[k], 1);
      const Eigen::Vector2d px(columns * of.at_u[k] + 0.5 * (columns - 1), columns * of.at_v[k] + 0.5 * (columns - 1));
      EXPECT_NEAR(of.u[k], (px - band.centre).x(), 1e-3);
      EXPECT_NEAR(of.v[k], (px - band.centre).y(), 1e-3);
      EXPECT_LT((band.disc_from_px * (px - band.centre)).norm(), 1 + (reach_px + columns) / band.radius_px);
      ahead += of.u[k] > 0 ? 1 : 0;
    });
    EXPECT_NEAR(ahead, samples->n / 2.0, 0.1 * samples->n + 8) << "evenly around";
  }
}

// Samples of a flat patch, fully covered in the middle, with what find_outliers() is to see.
TEST(OutlierPixelsOf, AnOccluderAndItsNeighboursGetNoWeight) {
  const PixelGrid grid{0, 0, 40, 40, 1, 1};
  auto light = std::make_unique<EdgeSamples>(), chroma = std::make_unique<EdgeSamples>();
  for (int k = 0; k < 1600; ++k) {
    auto& of = light->blocks[light->n / EdgeSamples::block];
    const int i = light->n++ % EdgeSamples::block;
    of.at_u[i] = k % 40, of.at_v[i] = k / 40;
    of.covered[i] = k / 40 < 20 ? 1.f : 0.f, of.trust[i] = 1;
  }
  const auto at = [&](int u, int v) {
    return std::pair<EdgeSamples::Block&, int>(light->blocks[(40 * v + u) / 64], (40 * v + u) % 64);
  };
  const auto trust = [&](int u, int v) {
    const auto [of, i] = at(u, v);
    return of.trust[i];
  };
  OutlierPixels outliers;
  outliers.begin();
  EXPECT_EQ(outliers.judge(0, grid, *light, *chroma), OutlierPixels::Change::none);
  const auto [inside, i] = at(10, 10);
  inside.hidden[i] = 1;  // an occluder
  const auto [beside, k] = at(30, 30);
  beside.off[k] = 3.99f;  // another thing
  const auto [unknown, l] = at(5, 30);
  unknown.off[l] = 3.99f, unknown.unsure[l] = 4;  // on an unknown background: not judged
  EXPECT_EQ(outliers.judge(2, grid, *light, *chroma), OutlierPixels::Change::some);
  for (int v = 0; v < 40; ++v) {
    for (int u = 0; u < 40; ++u) {
      const bool is_near =
          (std::abs(u - 10) <= 2 && std::abs(v - 10) <= 2) || (std::abs(u - 30) <= 2 && std::abs(v - 30) <= 2);
      ASSERT_EQ(trust(u, v), is_near ? 0.f : 1.f) << u << " " << v;
    }
  }
  // Occluders stay marked, other things do not.
  inside.hidden[i] = 0, beside.off[k] = 0;
  EXPECT_EQ(outliers.judge(0, grid, *light, *chroma), OutlierPixels::Change::some);
  EXPECT_EQ(trust(10, 12), 0);
  EXPECT_EQ(trust(30, 30), 1);
  EXPECT_EQ(outliers.judge(0, grid, *light, *chroma), OutlierPixels::Change::none);
}

}  // namespace
}  // namespace huetrack::outline
