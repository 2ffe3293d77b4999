#include "object_tracking/objects/object_existence.h"

#include <gtest/gtest.h>

#include "scene/scene.h"

namespace huetrack::objects {

using namespace object_tracking;

namespace {

constexpr double radius_m = 0.04;

struct Room {
  scene::Scene scene = [] {
    scene::SceneBuilder builder;
    builder.cameras_on_ring({.count = 3});
    return builder.build();
  }();
  ClutterMap clutter{scene.rig};
  StaticClutterMask still{scene.rig.cameras.size(), 1};

  // So many regions per view, anywhere.
  explicit Room(int regions = 8) {
    std::vector<TargetView> views(scene.rig.cameras.size());
    for (std::size_t c = 0; c < views.size(); ++c) views[c].index = int(c);
    std::vector<color::ColorRegion> of_view(static_cast<std::size_t>(regions));
    for (color::ColorRegion& region : of_view) region.centre = {5, 5};
    clutter.add(views, std::vector(views.size(), of_view));
    clutter.add({}, {});
  }

  std::vector<Sighting> sightings(const Eigen::Vector3d& p, double off_px = 0) const {
    std::vector<Sighting> all;
    for (std::size_t c = 0; c < scene.rig.cameras.size(); ++c) {
      Sighting& s = all.emplace_back();
      s.row.camera = static_cast<int>(c);
      s.camera = &scene.rig.cameras[c];
      s.px = project_ball(*s.camera, p, radius_m)->px + Eigen::Vector2d(off_px, -off_px);
      s.covariance = 0.25 * Eigen::Matrix2d::Identity();
    }
    return all;
  }
  Birth birth(const Eigen::Vector3d& earlier, const Eigen::Vector3d& now) const {
    const Eigen::Matrix3d covariance = 1e-5 * Eigen::Matrix3d::Identity();
    return {{.position = earlier, .covariance = covariance, .sightings = sightings(earlier)},
            {.position = now, .covariance = covariance, .sightings = sightings(now)},
            0.033};
  }
  ObjectExistence begun(const Birth& birth) const {
    ObjectExistence existence;
    existence.begin({}, birth, {}, radius_m, ObjectTrackerOptions{}, MotionState(scene.rig, false), clutter, still);
    return existence;
  }
};

TEST(ClutterMap, DensityIsHighWhereRegionsAreUnassociated) {
  Room room;
  std::vector<TargetView> views(1);
  views[0].index = 1;
  std::vector<std::vector<color::ColorRegion>> regions(1);
  const double before = room.clutter.density(1, {100, 60}, 8);
  color::ColorRegion flickering;
  flickering.centre = {100, 60};
  for (int set = 0; set < 60; ++set) {
    regions[0].clear();
    if (set % 3 == 0) regions[0].push_back(flickering);
    room.clutter.add(views, regions);
  }
  EXPECT_GT(room.clutter.density(1, {100, 60}, 8), 4 * room.clutter.density(1, {200, 200}, 8));
  EXPECT_LT(room.clutter.density(1, {200, 200}, 8), before);  // fewer than at first
  EXPECT_EQ(room.clutter.density(0, {100, 60}, 8), before);   // of another camera: unchanged
}

// Regions become clutter with the next set, if no object has claimed them by then.
TEST(ClutterMap, AnObjectsRegionsAreNotClutter) {
  Room room(0), of_object(0);
  std::vector<TargetView> views(1);
  std::vector<std::vector<color::ColorRegion>> regions(1);
  regions[0].resize(1);
  regions[0][0].centre = {100, 60};
  const double before = room.clutter.density(0, {100, 60}, 8);
  Sighting sighting;
  sighting.px = {102, 60}, sighting.radius_px = 8;
  for (int set = 0; set < 5; ++set) {
    room.clutter.add(views, regions);
    of_object.clutter.add(views, regions);
    of_object.clutter.claim({&sighting, 1});
  }
  EXPECT_GT(room.clutter.density(0, {100, 60}, 8), 100 * before);
  EXPECT_LE(of_object.clutter.density(0, {100, 60}, 8), before);
}

// A candidate that is as likely as not leaves half of its regions to clutter.
TEST(ClutterMap, ARegionIsClutterAsFarAsItIsNoObject) {
  std::vector<TargetView> views(1);
  std::vector<std::vector<color::ColorRegion>> regions(1, std::vector<color::ColorRegion>(1));
  regions[0][0].centre = {100, 60};
  Sighting sighting;
  sighting.px = {102, 60}, sighting.radius_px = 8;
  const auto density_claimed = [&](double probability) {
    Room room(0);
    for (int set = 0; set < 5; ++set) {
      room.clutter.add(views, regions);
      room.clutter.claim({&sighting, 1}, probability);
    }
    return room.clutter.density(0, {100, 60}, 8);
  };
  EXPECT_NEAR(density_claimed(0.5), 0.5 * density_claimed(0), 0.01 * density_claimed(0));
}

TEST(ClutterMap, WhatStandsOutMoreThanTheClutterIsTheTargets) {
  Room room(0);
  EXPECT_EQ(room.clutter.log_ratio(0, {}), 0);
  std::vector<TargetView> views(1);
  std::vector<std::vector<color::ColorRegion>> regions(1);
  for (int i = 0; i < 20; ++i) {
    color::ColorRegion& region = regions[0].emplace_back();
    region.centre = {5, 5};
    region.evidence = {.odds = double(i % 10), .most = 100};
    regions[0].emplace_back().centre = {5, 5};  // does not stand out
  }
  room.clutter.look(views, regions);
  EXPECT_LT(room.clutter.log_ratio(0, {.odds = 5, .most = 100}), -1);
  EXPECT_GT(room.clutter.log_ratio(0, {.odds = 60, .most = 100}), 3);
  EXPECT_LT(room.clutter.log_ratio(0, {}), -1);
  EXPECT_GT(room.clutter.log_ratio(1, {.odds = 60, .most = 100}), 0);  // nothing is known of this view's clutter
}

// A search looks at the eight largest regions of a view.
TEST(ClutterMap, IsCrowdedByMoreRegionsThanASearchLooksAt) {
  Room room(0);
  std::vector<TargetView> views(2);
  views[0].index = 0, views[1].index = 2;
  std::vector<std::vector<color::ColorRegion>> regions(2);
  regions[0].resize(8), regions[1].resize(9);
  for (const std::size_t c : {0U, 2U}) room.clutter.forget(c);
  room.clutter.look(views, regions);
  EXPECT_FALSE(room.clutter.is_crowded(0));
  EXPECT_FALSE(room.clutter.is_crowded(1));
  EXPECT_TRUE(room.clutter.is_crowded(2));
}

// Along the innovation, the posterior's variance is that of probabilistic data association.
TEST(ObjectExistence, AnUncertainAssociationWidensThePosteriorAsPdaDoes) {
  const double prior = 30, noise = 4, spread = prior + noise, gain = prior / spread;
  for (const double b : {0.3, 0.8, 0.99}) {
    for (const double d : {0.0, 2.0, 5.0}) {
      const Eigen::Matrix2d added =
          association_px2(spread * Eigen::Matrix2d::Identity(), d * Eigen::Vector2d(0.6, 0.8), b);
      EXPECT_NEAR(prior - prior * prior / (spread + added(0, 0)),
                  prior - b * gain * prior + b * (1 - b) * gain * gain * d * d, 1e-4 * prior)
          << b << " " << d;
    }
  }
  EXPECT_GT(association_px2(Eigen::Matrix2d::Identity(), {4, 0}, 0.5)(0, 0), 1e6);  // tells nothing
  EXPECT_NEAR(association_px2(Eigen::Matrix2d::Identity(), {4, 0}, 1)(0, 0), 0, 1e-6);
}

TEST(ObjectExistence, IsConfirmedByThreeConsistentViewsTwice) {
  const Room room;
  EXPECT_TRUE(room.begun(room.birth({0, 0, 1}, {0.02, 0, 1})).is_sure());
}

TEST(ObjectExistence, IsNotConfirmedByTwoViewsAtOnce) {
  const Room room;
  Birth birth = room.birth({0, 0, 1}, {0.02, 0, 1});
  birth.earlier.sightings.pop_back();
  birth.now.sightings.pop_back();
  EXPECT_FALSE(room.begun(birth).is_sure());
  EXPECT_TRUE(Room(0).begun(birth).is_sure());  // nothing else has the colour
  birth.of_shape = 10;                          // discs of its size
  EXPECT_TRUE(room.begun(birth).is_sure());
}

TEST(ObjectExistence, SightingsFarFromThePredictionAreClutter) {
  const Room room;
  ObjectExistence existence = room.begun(room.birth({0, 0, 1}, {0.02, 0, 1}));
  MotionState state(room.scene.rig, false);
  state.begin({}, {0.02, 0, 1}, 1e-5, {0.6, 0, 0}, 0.1);
  existence.update({}, state, 1.0, room.sightings({0.02, 0, 1}), {}, radius_m, room.clutter, room.still);
  EXPECT_TRUE(existence.is_sure());
  EXPECT_FALSE(existence.is_chance(0));
  existence.update({}, state, 1.0, room.sightings({0.02, 0, 1}, 40), {}, radius_m, room.clutter, room.still);
  EXPECT_FALSE(existence.is_sure());
  EXPECT_TRUE(existence.is_chance(0) && existence.is_chance(1) && existence.is_chance(2));
  EXPECT_FALSE(existence.is_refuted());  // confirmed before
}

// An object near slow cameras may be anywhere in the next set, so that clutter explains it as well. If its motion then
// matches the prediction it is an object.
TEST(ObjectExistence, AnUnlikelyStartIsNotRefutedBySupport) {
  const Room room;
  Birth birth = room.birth({0, 0, 1}, {0.02, 0, 1});
  birth.earlier.sightings.pop_back(), birth.earlier.sightings.pop_back();
  birth.now.sightings.pop_back(), birth.now.sightings.pop_back();
  birth.dt = 0.5;
  ObjectExistence existence = room.begun(birth);
  ASSERT_FALSE(existence.is_sure());
  EXPECT_FALSE(existence.is_refuted());
  MotionState state(room.scene.rig, false);
  state.begin({}, {0.02, 0, 1}, 1e-5, {0.6, 0, 0}, 0.1);
  ObjectExistence contradicted = existence;
  contradicted.update({}, state, 1.0, room.sightings({0.02, 0, 1}, 40), {}, radius_m, room.clutter, room.still);
  EXPECT_TRUE(contradicted.is_refuted());
  existence.update({}, state, 1.0, room.sightings({0.02, 0, 1}), {}, radius_m, room.clutter, room.still);
  EXPECT_FALSE(existence.is_refuted());
  // But static clutter matches its prediction, too.
  const auto later = capture::Timestamp{} + capture::duration_of(0.6);
  ObjectExistence moving = existence;
  existence.update(later, state, 1.0, room.sightings({0.02, 0, 1}), {}, radius_m, room.clutter, room.still);
  EXPECT_FALSE(existence.is_sure());
  EXPECT_TRUE(existence.is_refuted());
  state.begin(later, {0.2, 0, 1}, 1e-5, {0.6, 0, 0}, 0.1);
  auto further = room.sightings({0.2, 0, 1});
  for (Sighting& s : further) s.row.at = later;
  moving.update(later, state, 1.0, further, {}, radius_m, room.clutter, room.still);
  EXPECT_TRUE(moving.is_sure());
  EXPECT_FALSE(moving.is_refuted());
}

// Free-running cameras see a moving object at other places: each is compared with the place at its own row's time.
TEST(ObjectExistence, EachSightingIsComparedAtItsOwnTime) {
  const Room room;
  MotionState state(room.scene.rig, false);
  state.begin({}, {0.02, 0, 1}, 1e-5, {4, 0, 0}, 0.1);
  std::vector<Sighting> apart;
  for (int c = 0; c < 3; ++c) {
    const double late_s = 0.012 * c;
    Sighting s = room.sightings(Eigen::Vector3d(0.02 + 4 * late_s, 0, 1))[std::size_t(c)];
    s.row.at = capture::Timestamp{} + capture::duration_of(late_s);
    apart.push_back(s);
  }
  Birth birth = room.birth({0, 0, 1}, {0.02, 0, 1});
  birth.earlier.sightings.pop_back(), birth.now.sightings.pop_back();
  ObjectExistence existence = room.begun(birth);
  const double before = existence.log_odds();
  existence.update({}, state, 1.0, apart, {}, radius_m, room.clutter, room.still);
  EXPECT_GT(existence.log_odds(), before);
  EXPECT_TRUE(existence.is_sure());
}

// A hand hides a part of it in one view: off by a part of its radius is no clutter.
TEST(ObjectExistence, ASightingOffByLessThanTheRadiusIsNoClutter) {
  const Room room;
  MotionState state(room.scene.rig, false);
  state.begin({}, {0.02, 0, 1}, 1e-7, {0, 0, 0}, 1e-6);
  const double radius_px = project_ball(room.scene.rig.cameras[0], {0.02, 0, 1}, radius_m)->radius_px;
  auto sightings = room.sightings({0.02, 0, 1});
  sightings[0].px.x() += 0.7 * radius_px;
  sightings[0].covariance *= 0.01;
  ObjectExistence existence = room.begun(room.birth({0, 0, 1}, {0.02, 0, 1}));
  existence.update({}, state, 0.01, sightings, {}, radius_m, room.clutter, room.still);
  EXPECT_FALSE(existence.is_chance(0));
  EXPECT_TRUE(existence.is_sure());
}

// Clutter explains the find: what moves in one view only may be a chance pair of a moving and a still thing.
TEST(ObjectExistence, AnUnlikelyFindMustMoveInTwoViews) {
  const Room room(2000);
  Birth birth = room.birth({0, 0, 1}, {0, 0, 1});
  birth.earlier.sightings.pop_back(), birth.now.sightings.pop_back();
  const auto is_sure_after = [&](const Eigen::Vector3d& way) {
    ObjectExistence existence = room.begun(birth);
    EXPECT_LT(existence.log_odds(), 0);
    for (int set = 0; set < 12; ++set) {
      const Eigen::Vector3d at = way * (set + 1) / 12 + Eigen::Vector3d(0, 0, 1);
      MotionState state(room.scene.rig, false);
      state.begin({}, at, 1e-6, {0, 0, 0}, 1e-6);
      auto sightings = room.sightings(at);
      sightings.pop_back();
      existence.update({}, state, 0.01, sightings, {}, radius_m, room.clutter, room.still);
    }
    EXPECT_GT(existence.log_odds(), 11.5);
    return existence.is_sure();
  };
  const Eigen::Vector3d along = (Eigen::Vector3d(0, 0, 1) - room.scene.rig.cameras[1].centre()).normalized();
  EXPECT_TRUE(is_sure_after(0.2 * along.unitOrthogonal() + 0.1 * along));
  EXPECT_FALSE(is_sure_after(0.2 * along));
  EXPECT_FALSE(is_sure_after({0.01, 0.01, 0}));
}

TEST(ObjectExistence, AnotherPlaceOfTheOneObjectIsEvidenceAgainstIt) {
  const Room room;
  ObjectExistence existence = room.begun(room.birth({0, 0, 1}, {0.02, 0, 1}));
  ASSERT_TRUE(existence.is_sure());
  const double before = existence.log_odds();
  existence.compete(40);
  EXPECT_DOUBLE_EQ(existence.log_odds(), before - 40);
  EXPECT_FALSE(existence.is_sure());
}

}  // namespace
}  // namespace huetrack::objects
