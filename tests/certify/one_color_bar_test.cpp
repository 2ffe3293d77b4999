#include "calib/certify/one_color_bar.h"

#include <gmock/gmock.h>

#include <algorithm>

#include "certify/carried_bar.h"

namespace huetrack::certify {
namespace {

using Eigen::Vector3d;

BallTrack part_of(const BallTrack& track, double from_s, double to_s) {
  BallTrack out;
  std::ranges::copy_if(track, std::back_inserter(out),
                       [&](const BallFix& fix) { return fix.t_s >= from_s && fix.t_s < to_s; });
  return out;
}

BallTrack standing_at(const Vector3d& at, double from_s, double to_s) {
  BallTrack out;
  for (const BallFix& fix : part_of(CarriedBar{}.tracks()[0], from_s, to_s))
    out.push_back({.set = fix.set, .t_s = fix.t_s, .position = at, .covariance = fix.covariance});
  return out;
}

std::set<std::uint64_t> sets_of(const BallTrack& track) {
  std::set<std::uint64_t> out;
  for (const BallFix& fix : track) out.insert(fix.set);
  return out;
}

double largest_error(const OneColorBar& bar) {
  double largest = 0;
  for (const MeasuredLength& length : bar.lengths) largest = std::max(largest, std::abs(length.error_m));
  return largest;
}

TEST(OneColorBar, EndsMayBeExchanged) {
  const CarriedBar carried;
  const auto both = carried.tracks();
  const auto of_two_colors = carried.lengths();
  std::array swapped = both;  // the tracker takes one for the other, now and then
  for (std::size_t k = 0; k < both[0].size(); ++k)
    if (k / 37 % 2 == 1) std::swap(swapped[0][k], swapped[1][k]);
  for (const auto& tracks : {both, swapped}) {
    const OneColorBar bar = one_color_bar(tracks, {}, carried_length_m, {});
    ASSERT_EQ(bar.lengths.size(), of_two_colors.size());
    EXPECT_EQ(bar.only_one + bar.with_third + bar.others.size(), 0u);
    for (std::size_t k = 0; k < bar.lengths.size(); k += 100) {
      EXPECT_NEAR(bar.lengths[k].error_m, of_two_colors[k].error_m, 1e-9);
      EXPECT_EQ(bar.lengths[k].measurement, of_two_colors[k].measurement);
    }
  }
}

TEST(OneColorBar, OneBallGivesNoLength) {
  auto both = CarriedBar{.noise_m = 0}.tracks();
  // Hidden from 10 to 12 s; another number afterwards.
  const std::array objects{both[0], part_of(both[1], 0, 10), part_of(both[1], 12, 90)};
  const OneColorBar bar = one_color_bar(objects, {}, carried_length_m, {});
  EXPECT_EQ(bar.only_one, 60u);
  EXPECT_EQ(bar.lengths.size(), 88u * 30);
  EXPECT_LT(largest_error(bar), 1e-9);
}

TEST(OneColorBar, ThirdObjectIsNeverAnEnd) {
  const auto both = CarriedBar{.noise_m = 0}.tracks();
  const Vector3d furniture(1.5, 1.5, 0.5);
  // It has its own number: while the second ball is hidden.
  const std::array hidden{both[0], part_of(both[1], 0, 40), standing_at(furniture, 40, 45), part_of(both[1], 45, 90)};
  const OneColorBar bar = one_color_bar(hidden, {}, carried_length_m, {});
  ASSERT_EQ(bar.others.size(), 1u);
  EXPECT_NEAR(bar.others[0].from_s, 40, 0.04);
  EXPECT_NEAR(bar.others[0].to_s, 45, 0.04);
  EXPECT_EQ(bar.others[0].sets, 150u);
  EXPECT_GT(bar.others[0].least_m, 1);
  EXPECT_LT(bar.others[0].most_m, 3.5);
  EXPECT_EQ(bar.lengths.size(), 85u * 30);
  EXPECT_LT(largest_error(bar), 1e-9);

  // The second ball's track went over to it and came back, without another number.
  std::array jumps = both;
  for (BallFix& fix : jumps[1])
    if (fix.t_s >= 40 && fix.t_s < 45) fix.position = furniture, fix.velocity.setZero();
  const OneColorBar jumped = one_color_bar(jumps, {}, carried_length_m, {});
  ASSERT_EQ(jumped.others.size(), 1u);
  EXPECT_LT(largest_error(jumped), OneColorBar::other_share * carried_length_m);

  // All three are published, or the tracker reports one too many.
  const std::array three{both[0], both[1], standing_at(furniture, 40, 45)};
  const OneColorBar with_three = one_color_bar(three, {}, carried_length_m, {});
  EXPECT_EQ(with_three.with_third, 150u);
  EXPECT_EQ(with_three.lengths.size(), 85u * 30);
  const OneColorBar is_said = one_color_bar(both, sets_of(three[2]), carried_length_m, {});
  EXPECT_EQ(is_said.with_third, 150u);
  EXPECT_EQ(is_said.lengths.size(), 85u * 30);
}

// What comes near to the bar's length by chance is not the bar, either, where it was not before and after.
TEST(OneColorBar, RunOfOtherDistancesIsRejected) {
  const auto both = CarriedBar{.noise_m = 0}.tracks();
  const std::array objects{both[0], standing_at({0, 0, 1}, 0, 90)};
  const OneColorBar bar = one_color_bar(objects, {}, carried_length_m, {});
  EXPECT_TRUE(bar.lengths.empty());
  EXPECT_FALSE(bar.others.empty());
}

// A rig that is wrong gives lengths that are wrong: these are errors, and no other objects.
TEST(OneColorBar, LengthErrorsAreKept) {
  const auto both = CarriedBar{.noise_m = 0.01, .scale = 1.1}.tracks();
  const OneColorBar bar = one_color_bar(both, {}, carried_length_m, {});
  EXPECT_EQ(bar.lengths.size(), both[0].size());
  EXPECT_TRUE(bar.others.empty());
}

}  // namespace
}  // namespace huetrack::certify
