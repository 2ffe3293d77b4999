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

TEST(CameraWatch, SomebodyWhoWalksThroughIsNoKnock) {
  Film film;
  film.person = [](double t) {
    const double left = -0.45 + 0.25 * (t - 2);
    return std::pair(left, left + 0.4);
  };
  EXPECT_THAT(states_of(film, 9), testing::ElementsAre(RoomState::still));
}

struct Knock {
  double deg;
  capture::PixelFormat format;
};
class KnockOf : public testing::TestWithParam<Knock> {};

TEST_P(KnockOf, IsToldWithinASecondByItsAngle) {
  Film film;
  film.format = GetParam().format;
  film.pose = knocked_at(3, GetParam().deg);
  FilmedRoom room(film);
  CameraWatch watch(room.camera());
  std::optional<double> told_at;
  room.show(watch, 0, 6, [&](double t) {
    if (!told_at && watch.condition().state == RoomState::knocked) told_at = t;
  });
  ASSERT_TRUE(told_at) << name(watch.condition().state);
  // Small ones are watched for a while longer, as sagging begins small.
  EXPECT_LT(*told_at - 3, GetParam().deg < 0.25 ? 2.0 : 1.2);
  EXPECT_GE(*told_at, 3);
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

TEST(CameraWatch, AKnockIsToldWhileSomebodyWalksThrough) {
  Film film;
  film.pose = knocked_at(4, 0.8);
  film.person = [](double t) { return std::pair(0.15 * t - 0.4, 0.15 * t - 0.1); };
  FilmedRoom room(film);
  CameraWatch watch(room.camera());
  room.show(watch, 0, 6.5);
  EXPECT_EQ(watch.condition().state, RoomState::knocked);
  EXPECT_LT(degrees_of(watch.condition().rotation - 0.8 * degree * axis), 0.04);
}

TEST(CameraWatch, WhoPutsItBackHasAStillCamera) {
  Film film;
  film.pose = [](double t) { return t > 3 && t < 6 ? knocked_at(0, 0.6)(t) : camera_in_room().cam_from_world; };
  FilmedRoom room(film);
  CameraWatch watch(room.camera());
  room.show(watch, 0, 5.5);
  EXPECT_EQ(watch.condition().state, RoomState::knocked);
  room.show(watch, 5.5, 10);
  EXPECT_EQ(watch.condition().state, RoomState::still);
  EXPECT_FALSE(watch.condition().turn);
}

TEST(CameraWatch, SaggingIsToldOnceAndBeforeItIsLarge) {
  Film film;
  film.pose = [](double t) {
    const double share = std::clamp((t - 3) / 8, 0.0, 1.0);
    return moved(camera_in_room().cam_from_world, Eigen::Vector3d(-0.35 * degree * share, 0, 0));
  };
  FilmedRoom room(film);
  CameraWatch watch(room.camera());
  std::optional<double> told_deg;
  room.show(watch, 0, 13, [&](double) {
    EXPECT_NE(watch.condition().state, RoomState::knocked);
    if (!told_deg && watch.condition().state == RoomState::sagging) told_deg = degrees_of(watch.condition().rotation);
  });
  ASSERT_TRUE(told_deg);
  EXPECT_LT(*told_deg, 0.18);
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

TEST(CameraWatch, ACoveredCameraIsBlind) {
  Film film;
  film.light = [](double t, double) { return t > 3 && t < 7 ? 0.03 : 1.0; };
  FilmedRoom room(film);
  CameraWatch watch(room.camera());
  room.show(watch, 0, 6);
  EXPECT_EQ(watch.condition().state, RoomState::blinded);
  room.show(watch, 6, 12);
  EXPECT_EQ(watch.condition().state, RoomState::still);
}

TEST(CameraWatch, TurnedFarAwayItSeesNothingOfTheRoom) {
  Film film;
  film.pose = knocked_at(3, 40);
  FilmedRoom room(film);
  CameraWatch watch(room.camera());
  room.show(watch, 0, 6);
  EXPECT_EQ(watch.condition().state, RoomState::hidden);
}

TEST(CameraWatch, PlainWallsTellNothing) {
  Film film;
  film.texture = 0;
  EXPECT_THAT(states_of(film, 3), testing::ElementsAre(RoomState::plain));
}

TEST(CameraWatch, AKeptRoomTellsWhatHappenedInBetween) {
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

TEST(CameraWatch, ObjectsAreNoPartOfTheRoom) {
  FilmedRoom room;
  CameraWatch watch(room.camera());
  const Occluder object{.px = {120, 90}, .radius_px = 60};
  for (int k = 0; k < 30; ++k) watch.look(room.frame(k / 15.0), std::span(&object, 1));
  EXPECT_EQ(watch.condition().state, RoomState::still);
  for (const KeptPatch& patch : watch.room()) EXPECT_GT((patch.px - object.px).norm(), object.radius_px);
}

}  // namespace
}  // namespace huetrack::room_watch
