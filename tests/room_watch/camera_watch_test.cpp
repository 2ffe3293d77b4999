#include "room_watch/camera_watch.h"

#include <gmock/gmock.h>

#include <set>

#include "room_watch/filmed_room.h"

namespace huetrack::room_watch {
namespace {

double degrees_of(const Eigen::Vector3d& rotation) {
  return rotation.norm() / degree;
}

const Eigen::Vector3d axis = Eigen::Vector3d(-0.5, 0.75, -0.4).normalized();

std::function<calib::Rigid3d(double)> knocked_at(double at_s, double deg) {
  return [=](double t) {
    const double share = std::clamp((t - at_s) / 0.1, 0.0, 1.0);
    return moved(camera_in_room().cam_from_world, share * deg * degree * axis);
  };
}

// All states that the watch was in, once it had learnt the room.
std::set<RoomState> states_of(Film film, double seconds) {
  FilmedRoom room(std::move(film));
  CameraWatch watch(room.camera());
  std::set<RoomState> states;
  room.show(watch, 0, seconds, [&](double) { states.insert(watch.condition().state); });
  states.erase(RoomState::learning);
  return states;
}

TEST(CameraWatch, AStillCameraIsStill) {
  EXPECT_THAT(states_of({}, 8), testing::ElementsAre(RoomState::still));
}

TEST(CameraWatch, FlickerAndSwitchedLightsAreNoKnock) {
  Film film;
  film.light = [](double t, double row) {
    const double flicker = 1 + 0.15 * std::cos(2 * std::numbers::pi * (100 * (t + 0.025 * row)));
    return flicker * (t > 4 ? 0.55 + 0.1 * row : 1.0);
  };
  EXPECT_THAT(states_of(film, 8), testing::ElementsAre(RoomState::still));
}

TEST(CameraWatch, APersonWalkingThroughIsNoKnock) {
  Film film;
  film.person = [](double t) {
    const double left = -0.45 + 0.25 * (t - 2);
    return std::pair(left, left + 0.4);
  };
  EXPECT_THAT(states_of(film, 9), testing::ElementsAre(RoomState::still));
}

// Before plain walls a person is all that has texture while the room is learnt, which takes 0.93 s at this rate.
// Nothing covers the camera when he is gone.
TEST(CameraWatch, WhatIsNotFoundOnceAfterLearningIsNoRoom) {
  Film film;
  film.texture = 0;
  film.person = [](double t) { return t < 0.97 ? std::pair(0.05, 0.95) : std::pair(0.0, 0.0); };
  const std::set<RoomState> states = states_of(film, 9);
  EXPECT_FALSE(states.contains(RoomState::blinded));
  EXPECT_FALSE(states.contains(RoomState::hidden));
  EXPECT_TRUE(states.contains(RoomState::plain));
}

struct Knock {
  double deg;
  capture::PixelFormat format;
};
class KnockOf : public testing::TestWithParam<Knock> {};

TEST_P(KnockOf, IsReportedWithinASecondWithItsAngle) {
  Film film;
  film.format = GetParam().format;
  film.pose = knocked_at(3, GetParam().deg);
  FilmedRoom room(film);
  CameraWatch watch(room.camera());
  std::optional<double> reported_at;
  room.show(watch, 0, 6, [&](double t) {
    if (!reported_at && watch.condition().state == RoomState::knocked) reported_at = t;
  });
  ASSERT_TRUE(reported_at) << name(watch.condition().state);
  // Small ones are observed longer, because sagging begins small.
  EXPECT_LT(*reported_at - 3, GetParam().deg < 0.25 ? 2.0 : 1.2);
  EXPECT_GE(*reported_at, 3);
  const RoomCondition& condition = watch.condition();
  EXPECT_EQ(condition.turns, 1);
  EXPECT_LT(degrees_of(condition.rotation - GetParam().deg * degree * axis), 0.03);
  ASSERT_TRUE(condition.turn);
  EXPECT_FALSE(condition.turn->is_slow);
  EXPECT_LE(capture::seconds(condition.turn->from), 3.2);
  EXPECT_GE(capture::seconds(condition.turn->until), 3);
}

INSTANTIATE_TEST_SUITE_P(Knocks, KnockOf,
                         testing::Values(Knock{0.15, capture::PixelFormat::grey},
                                         Knock{0.4, capture::PixelFormat::yuyv}, Knock{0.8, capture::PixelFormat::nv12},
                                         Knock{1.5, capture::PixelFormat::i420}, Knock{3, capture::PixelFormat::bgr}));

TEST(CameraWatch, AKnockIsReportedWhileAPersonWalksThrough) {
  Film film;
  film.pose = knocked_at(4, 0.8);
  film.person = [](double t) { return std::pair(0.15 * t - 0.4, 0.15 * t - 0.1); };
  FilmedRoom room(film);
  CameraWatch watch(room.camera());
  room.show(watch, 0, 6.5);
  EXPECT_EQ(watch.condition().state, RoomState::knocked);
  EXPECT_LT(degrees_of(watch.condition().rotation - 0.8 * degree * axis), 0.04);
}

TEST(CameraWatch, ACameraPutBackIsStill) {
  Film film;
  film.pose = [](double t) { return t > 3 && t < 6 ? knocked_at(0, 0.6)(t) : camera_in_room().cam_from_world; };
  FilmedRoom room(film);
  CameraWatch watch(room.camera());
  room.show(watch, 0, 5.5);
  EXPECT_EQ(watch.condition().state, RoomState::knocked);
  room.show(watch, 5.5, 10);
  EXPECT_EQ(watch.condition().state, RoomState::still);
  EXPECT_FALSE(watch.condition().turn);
  EXPECT_EQ(watch.condition().turns, 1) << "turning back is no turn of its own";
}

TEST(CameraWatch, SaggingIsReportedOnceAndEarly) {
  Film film;
  film.pose = [](double t) {
    const double share = std::clamp((t - 3) / 8, 0.0, 1.0);
    return moved(camera_in_room().cam_from_world, Eigen::Vector3d(-0.35 * degree * share, 0, 0));
  };
  FilmedRoom room(film);
  CameraWatch watch(room.camera());
  std::optional<double> reported_deg;
  room.show(watch, 0, 13, [&](double) {
    EXPECT_NE(watch.condition().state, RoomState::knocked);
    if (!reported_deg && watch.condition().state == RoomState::sagging)
      reported_deg = degrees_of(watch.condition().rotation);
  });
  ASSERT_TRUE(reported_deg);
  EXPECT_LT(*reported_deg, 0.18);
  EXPECT_EQ(watch.condition().turns, 1);
  EXPECT_NEAR(degrees_of(watch.condition().rotation), 0.35, 0.03);
}

TEST(CameraWatch, ZoomIsNoKnock) {
  Film film;
  film.zoom = [](double t) { return t < 3 ? 1.0 : 1.015; };
  FilmedRoom room(film);
  CameraWatch watch(room.camera());
  room.show(watch, 0, 6, [&](double) { EXPECT_NE(watch.condition().state, RoomState::knocked); });
  EXPECT_EQ(watch.condition().state, RoomState::zoomed);
  EXPECT_NEAR(watch.condition().zoom, 0.015, 0.003);
}

// Outer patches are then outside their search range.
TEST(CameraWatch, ALargerZoomIsNoTurnEither) {
  for (const double by : {0.02, 0.03, -0.03, 0.06}) {
    Film film;
    film.zoom = [by](double t) { return t < 3 ? 1.0 : 1 + by; };
    FilmedRoom room(film);
    CameraWatch watch(room.camera());
    std::optional<double> reported_at;
    room.show(watch, 0, 6, [&](double t) {
      EXPECT_THAT(watch.condition().state,
                  testing::AnyOf(RoomState::learning, RoomState::still, RoomState::moving, RoomState::zoomed))
          << by;
      if (!reported_at && watch.condition().state == RoomState::zoomed) reported_at = t;
    });
    ASSERT_TRUE(reported_at) << by;
    EXPECT_LT(*reported_at, 5);
    EXPECT_NEAR(watch.condition().zoom, by, 0.003);
  }
}

// Painted walls, out of focus by so many pixels from 3 s to 8 s, in this share of the columns. Spots are larger than
// the blur.
Film focused(double blur_px, double columns = 1) {
  Film film;
  film.spot_m = 0.05 * std::max(1.6, blur_px);
  film.blur = [=](double t, double column) {
    return t < 8 && column <= columns ? blur_px * std::clamp(t - 3, 0.0, 1.0) : 0.0;
  };
  return film;
}

TEST(CameraWatch, DefocusIsReportedWithItsBlurAndWithdrawn) {
  for (const double blur_px : {1.5, 3.0, 5.0}) {
    FilmedRoom room(focused(blur_px));
    CameraWatch watch(room.camera());
    std::optional<double> reported_at;
    std::set<RoomState> states;
    room.show(watch, 0, 7, [&](double t) {
      states.insert(watch.condition().state);
      if (!reported_at && watch.condition().state == RoomState::defocused) reported_at = t;
    });
    ASSERT_TRUE(reported_at) << blur_px;
    EXPECT_GT(*reported_at, 3);
    EXPECT_LT(*reported_at, 5.5) << blur_px;
    EXPECT_THAT(states, testing::ElementsAre(RoomState::learning, RoomState::still, RoomState::defocused));
    EXPECT_NEAR(watch.condition().blur_px, blur_px, 0.35 * blur_px);
    room.show(watch, 7, 11);
    EXPECT_EQ(watch.condition().state, RoomState::still) << blur_px;
    EXPECT_EQ(watch.condition().blur_px, 0);
  }
}

TEST(CameraWatch, ASmearOnOneSideIsNoDefocus) {
  EXPECT_THAT(states_of(focused(2, 0.5), 8), testing::Not(testing::Contains(RoomState::defocused)));
}

TEST(CameraWatch, DimmerLightIsNoDefocus) {
  Film film = focused(0);
  film.light = [](double t, double row) { return t < 3 ? 1.0 : 0.5 - 0.1 * row; };
  EXPECT_THAT(states_of(film, 7), testing::ElementsAre(RoomState::still));
}

// With the paint of Film::person, over a quarter of the picture.
TEST(CameraWatch, AStandingBoxIsAChangeUntilItIsLearnt) {
  Film film;
  film.fps = 8;
  film.person = [](double t) { return t < 3 ? std::pair(0.0, 0.0) : std::pair(0.7, 0.95); };
  FilmedRoom room(film);
  CameraWatch watch(room.camera());
  std::optional<double> reported_at;
  std::set<RoomState> states;
  room.show(watch, 0, 14, [&](double t) {
    states.insert(watch.condition().state);
    if (!reported_at && watch.condition().state == RoomState::changed) reported_at = t;
  });
  ASSERT_TRUE(reported_at);
  EXPECT_GT(*reported_at, 6);
  EXPECT_LT(*reported_at, 11);
  EXPECT_THAT(states, testing::ElementsAre(RoomState::learning, RoomState::still, RoomState::changed));
  const Change& change = watch.condition().change;
  EXPECT_NEAR(change.share, 0.25, 0.15);
  EXPECT_GT(change.middle.x(), 2.0 / 3);
  EXPECT_FALSE(change.is_plain);
  room.show(watch, 14, 60);
  EXPECT_EQ(watch.condition().state, RoomState::still);
}

TEST(CameraWatch, AStandingPersonIsNoChange) {
  Film film;
  film.person = [](double t) {
    const double sway = 1.5 / 240 * std::sin(2 * std::numbers::pi * 0.4 * t);
    return t < 3 ? std::pair(0.0, 0.0) : std::pair(0.4 + sway, 0.65 + sway);
  };
  EXPECT_THAT(states_of(film, 14), testing::ElementsAre(RoomState::still));
}

TEST(CameraWatch, ACoveredCameraIsBlinded) {
  Film film;
  film.light = [](double t, double) { return t > 3 && t < 7 ? 0.03 : 1.0; };
  FilmedRoom room(film);
  CameraWatch watch(room.camera());
  room.show(watch, 0, 6);
  EXPECT_EQ(watch.condition().state, RoomState::blinded);
  EXPECT_NEAR(capture::seconds(watch.condition().since), 3.3, 0.4) << "the moment of the event, not of the report";
  room.show(watch, 6, 12);
  EXPECT_EQ(watch.condition().state, RoomState::still);
}

TEST(CameraWatch, TurnedFarAwayIsHidden) {
  Film film;
  film.pose = knocked_at(3, 40);
  FilmedRoom room(film);
  CameraWatch watch(room.camera());
  room.show(watch, 0, 6);
  EXPECT_EQ(watch.condition().state, RoomState::hidden);
}

TEST(CameraWatch, PlainWallsArePlain) {
  Film film;
  film.texture = 0;
  EXPECT_THAT(states_of(film, 3), testing::ElementsAre(RoomState::plain));
}

TEST(CameraWatch, AKeptRoomRevealsTurnsInBetween) {
  FilmedRoom before;
  CameraWatch first(before.camera());
  before.show(first, 0, 2);
  const auto kept = first.room();
  ASSERT_GE(kept.size(), 10u);

  FilmedRoom same;
  CameraWatch again(same.camera(), kept);
  same.show(again, 10, 13);
  EXPECT_EQ(again.condition().state, RoomState::still);

  Film film;
  film.pose = knocked_at(0, 0.7);
  FilmedRoom turned_room(film);
  CameraWatch after(turned_room.camera(), kept);
  turned_room.show(after, 10, 13);
  EXPECT_THAT(after.condition().state, testing::AnyOf(RoomState::knocked, RoomState::sagging));
  EXPECT_NEAR(degrees_of(after.condition().rotation), 0.7, 0.03);
  EXPECT_FALSE(after.has_forgotten());

  FilmedRoom another(Film{.room = 2});
  CameraWatch elsewhere(another.camera(), kept);
  another.show(elsewhere, 10, 16);
  EXPECT_EQ(elsewhere.condition().state, RoomState::still);
  EXPECT_TRUE(elsewhere.has_forgotten());
}

TEST(CameraWatch, PatchesAvoidObjects) {
  FilmedRoom room;
  CameraWatch watch(room.camera());
  const Occluder object{.px = {120, 90}, .radius_px = 60};
  for (int k = 0; k < 30; ++k) watch.look(room.frame(k / 15.0), std::span(&object, 1));
  EXPECT_EQ(watch.condition().state, RoomState::still);
  for (const KeptPatch& patch : watch.room()) EXPECT_GT((patch.px - object.px).norm(), object.radius_px);
}

}  // namespace
}  // namespace huetrack::room_watch
