#include "outline/outline_fit.h"

#include <gtest/gtest.h>

#include <Eigen/LU>

#include <cmath>
#include <memory>

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
  // Begun beside the truth.
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

TEST_F(OutlineFitTest, SaysHowSureItIs) {
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

TEST_F(OutlineFitTest, OnlyWhatIsVisibleOfTheEdgeCounts) {
  const DiscScene scene{.pillar_from = 63};
  learn(scene);
  for (unsigned i = 0; i < 5; ++i) {
    const Fit f = fit(scene, i, {0.2, 0.1});
    ASSERT_EQ(f.outcome, FitOutcome::fits);
    EXPECT_LT((f.centre - scene.centre).norm(), 0.25);
    EXPECT_LT(f.visible, 0.85);
  }
}

TEST_F(OutlineFitTest, ASmearedOutlineLiesInTheMiddleOfItsWay) {
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

// Light that bends over a small disc passes for an edge that is elsewhere, as long as each picture is alone.
TEST_F(OutlineFitTest, LightThatLastsIsToldFromTheEdgesPlace) {
  const auto mean_off = [&](double light_correlation) {
    Look look;
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    for (unsigned i = 0; i < 80; ++i) {
      DiscScene scene{.radius_px = 4, .bent = 0.2};
      scene.centre += Eigen::Vector2d(0.13 * i, 0.07 * i);
      DiscPicture picture;
      const Ellipse start{scene.centre, scene.radius_px * Eigen::Matrix2d::Identity()};
      const Fit f = fit_->fit(picture.draw(scene, i), background_, start, {}, look,
                              {.log_size = {0, 0.02}, .light_correlation = light_correlation});
      EXPECT_EQ(f.outcome, FitOutcome::fits);
      fit_->learn(look);
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
  // One picture after the other, of which the first ones are fitted with all unknowns.
  Fit next(DiscScene scene, bool may_hold_light) {
    scene.centre += Eigen::Vector2d(0.13 * (count_ % 9), 0.07 * (count_ % 7));
    DiscPicture picture;
    const Ellipse start{scene.centre + Eigen::Vector2d(0.2, -0.1), scene.radius_px * Eigen::Matrix2d::Identity()};
    const Fit f = fit_->fit(picture.draw(scene, count_++), background_, start, {}, look_,
                            {.log_size = {0, 0.02}, .light_correlation = 0.98, .may_hold_light = may_hold_light});
    off_ = f.centre - scene.centre;
    has_learnt_ = f.outcome == FitOutcome::fits && fit_->learn(look_);
    return f;
  }
  void look_at(const DiscScene& scene) {
    learn(scene);
    for (int i = 0; i < 20; ++i) ASSERT_EQ(next(scene, false).outcome, FitOutcome::fits);
  }

  Look look_;
  Eigen::Vector2d off_;
  bool has_learnt_ = false;
  unsigned count_ = 0;
};

TEST_F(HeldLightTest, TellsThePlaceAsAFitOfAllUnknownsDoes) {
  look_at({.radius_px = 5, .noise = 3, .bent = 0.1});
  double held2 = 0, nees = 0, all2 = 0;
  int held = 0;
  for (int i = 0; i < 60; ++i) {
    const bool may_hold = i % 2 == 0;
    const Look before = look_;
    const Fit f = next({.radius_px = 5, .noise = 3, .bent = 0.1}, may_hold);
    ASSERT_EQ(f.outcome, FitOutcome::fits);
    if (!may_hold) {
      EXPECT_FALSE(f.is_light_held);
      all2 += off_.squaredNorm();
    } else if (f.is_light_held) {
      ++held;
      held2 += off_.squaredNorm(), nees += off_.dot(f.covariance.inverse() * off_) / 30;
      EXPECT_FALSE(has_learnt_);
      EXPECT_EQ(look_.light->mean, before.light->mean);
    }
  }
  EXPECT_GT(held, 24);
  EXPECT_GT(nees, 0.7);
  EXPECT_LT(nees, 5);
  EXPECT_LT(std::sqrt(held2), 1.5 * std::sqrt(all2));
}

TEST_F(HeldLightTest, WhatIsHeldIsInTheCovariance) {
  look_at({.radius_px = 5, .noise = 3});
  const unsigned picture = count_;
  const Fit held = next({.radius_px = 5, .noise = 3}, true);
  ASSERT_TRUE(held.is_light_held);
  const Eigen::Matrix3d open = look_.left->open;
  look_.left->open.setZero();
  count_ = picture;
  const Fit alone = next({.radius_px = 5, .noise = 3}, true);
  ASSERT_TRUE(alone.is_light_held);
  const Eigen::Matrix2d by_it = held.covariance - alone.covariance;
  EXPECT_TRUE(by_it.isApprox(open.topLeftCorner<2, 2>(), 1e-6)) << by_it;
  EXPECT_GT((open.topLeftCorner<2, 2>().trace()), 0);
}

// Where a size was expected that is not so, the pixels by themselves tell it nearer.
TEST_F(HeldLightTest, TellsTheSizeWithoutWhatWasExpectedOfIt) {
  const DiscScene scene{.radius_px = 4, .noise = 3};
  look_at(scene);
  double held = 0, all = 0, held_sigma = 0;
  constexpr int pictures = 20;
  for (unsigned i = 0; i < pictures; ++i) {
    DiscPicture picture;
    const Ellipse start{scene.centre, scene.radius_px * Eigen::Matrix2d::Identity()};
    const Picture drawn = picture.draw(scene, 500 + i);
    const FitOptions expected{.log_size = {0.02, 0.02}, .light_correlation = 0.98};
    FitOptions may_hold = expected;
    may_hold.may_hold_light = true;
    const Fit of_held = fit_->fit(drawn, background_, start, {}, look_, may_hold);
    held += of_held.log_size.value / pictures, held_sigma += of_held.log_size.sigma / pictures;
    all += fit_->fit(drawn, background_, start, {}, look_, expected).log_size.value / pictures;
  }
  EXPECT_NEAR(held, 0, held_sigma);
  EXPECT_NEAR(held, all, held_sigma);
}

// Of a large disc only some pixels count, but a part that is hidden is seen all the same.
TEST_F(HeldLightTest, OfALargeDiscAsHonestWhereAPartIsHidden) {
  look_at({.radius_px = 20, .noise = 2});
  double nees = 0, all_nees = 0;
  for (int i = 0; i < 40; ++i) {
    const bool may_hold = i % 2 == 0;
    const Fit f = next({.radius_px = 20, .pillar_from = 74, .noise = 2}, may_hold);
    ASSERT_EQ(f.outcome, FitOutcome::fits);
    (may_hold ? nees : all_nees) += off_.dot(f.covariance.inverse() * off_) / 20;
  }
  EXPECT_LT(nees, 2 * all_nees + 1);
}

TEST_F(HeldLightTest, OfWhatMovesAsFarAsTheExposureIsKnown) {
  look_at({});
  DiscPicture picture;
  const DiscScene scene{.smear_px = 2};
  const Ellipse start{scene.centre, scene.radius_px * Eigen::Matrix2d::Identity()};
  const FitOptions options{.log_size = {0, 0.02}, .light_correlation = 0.98, .may_hold_light = true};
  look_.exposure_s = {0.01, 0.0005};
  const Fit known = fit_->fit(picture.draw(scene, 7), background_, start, {{200, 0}, 0}, look_, options);
  EXPECT_TRUE(known.is_light_held);
  EXPECT_LT((known.centre - scene.centre).norm(), 0.1);
  look_.exposure_s = {0.006, 0.005};
  EXPECT_FALSE(fit_->fit(picture.draw(scene, 7), background_, start, {{200, 0}, 0}, look_, options).is_light_held);
}

TEST_F(HeldLightTest, IsFittedAnewWhereSomethingHidesHalfOfIt) {
  look_at({});
  EXPECT_TRUE(next({}, true).is_light_held);
  EXPECT_FALSE(next({.pillar_from = 60}, true).is_light_held);
}

TEST_F(HeldLightTest, IsFittedAnewInAnotherLight) {
  look_at({.radius_px = 8});
  EXPECT_TRUE(next({.radius_px = 8}, true).is_light_held);
  EXPECT_FALSE(next({.radius_px = 8, .bent = 0.5}, true).is_light_held);
}

// What hides a part of the disc makes it smaller, and is not its light.
TEST_F(OutlineFitTest, LearnsNoLightFromWhatHasAnotherSize) {
  learn({});
  Look look;
  DiscPicture picture;
  const auto is_learnt = [&](double radius_px) {
    const DiscScene scene;
    const Ellipse start{scene.centre, radius_px * Eigen::Matrix2d::Identity()};
    const Fit f = fit_->fit(picture.draw(scene, 3), background_, start, {}, look, {.log_size = {0, 0.02}});
    return f.outcome == FitOutcome::fits && fit_->learn(look);
  };
  EXPECT_TRUE(is_learnt(DiscScene{}.radius_px));
  EXPECT_FALSE(is_learnt(1.15 * DiscScene{}.radius_px));
}

// One picture that looks softer than the camera is does not change what is believed of the camera; many do.
TEST_F(OutlineFitTest, LearnsTheCamerasBlurFromManyPictures) {
  learn({});
  Look look;
  const double before = look.log_blur_light.value;
  for (unsigned i = 0; i < 200; ++i) {
    DiscScene scene{.blur_px = 1.3};
    scene.centre += Eigen::Vector2d(0.02 * i, 0.01 * i);
    DiscPicture picture;
    const Ellipse start{scene.centre, scene.radius_px * Eigen::Matrix2d::Identity()};
    const Fit f = fit_->fit(picture.draw(scene, i), background_, start, {}, look, {.log_size = {0, 0.02}});
    ASSERT_EQ(f.outcome, FitOutcome::fits);
    fit_->learn(look);
    if (i == 0) {
      EXPECT_LT(look.log_blur_light.value, before + 0.5 * (std::log(1.3) - before));
    }
  }
  EXPECT_NEAR(look.log_blur_light.value, std::log(1.3), 0.08);
  EXPECT_LT(look.log_blur_light.sigma, 0.1);
}

TEST_F(OutlineFitTest, WhereNothingIsThereNothingFits) {
  learn({});
  EXPECT_NE(fit({.has_disc = false}, 1).outcome, FitOutcome::fits);
}

TEST_F(OutlineFitTest, RefusesWhatIsTooSmallOrOutside) {
  learn({});
  EXPECT_EQ(fit({.radius_px = 0.5}, 1).outcome, FitOutcome::too_small);
  EXPECT_EQ(fit({.centre = {-500, 40}}, 1).outcome, FitOutcome::too_small);
}

}  // namespace
}  // namespace huetrack::outline
