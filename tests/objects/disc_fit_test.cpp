#include "object_tracking/objects/disc_fit.h"

#include <gtest/gtest.h>

#include <cmath>

#include "color/mask_image.h"

namespace huetrack::objects {
namespace {

using Eigen::Vector2d;

constexpr double radius_px = 11;

bool is_in(const Vector2d& centre, int u, int v) {
  return (Vector2d(u, v) - centre).norm() <= radius_px;
}

// One disc from every start near it.
template <typename Chosen>
std::vector<std::optional<FittedDisc>> fitted(const std::vector<Vector2d>& about, Chosen chosen) {
  const capture::Image image = color::mask_image(120, 90, chosen);
  color::MatchBits bits(120, 90);
  bits.look_at(image, color::mask_table());
  std::vector<ExpectedDisc> discs;
  for (const Vector2d& px : about) discs.push_back({px, radius_px, 2});
  return fit_discs(bits, discs);
}

TEST(DiscFit, FindsAPartlyHiddenDisc) {
  const Vector2d centre(60.3, 44.6);
  for (const double cut : {-12.0, -4.0, 0.0, 4.0}) {  // where the visible part begins, from the centre
    const auto all =
        fitted({centre + Vector2d(1.5, -2)}, [&](int u, int v) { return is_in(centre, u, v) && u > centre.x() + cut; });
    ASSERT_TRUE(all[0]) << cut;
    EXPECT_LT((all[0]->px - centre).norm(), 0.8) << cut;
    const Vector2d off = all[0]->px - centre;
    EXPECT_LT(off.dot(all[0]->covariance.inverse() * off), 16) << cut;
  }
}

TEST(DiscFit, SeparatesTwoDiscsInOneRegion) {
  const Vector2d a(50.2, 40.4);
  for (const double apart : {8.0, 12.0, 20.0}) {
    const Vector2d b = a + Vector2d(apart * 0.8, apart * 0.6);
    const auto all = fitted({a + Vector2d(-1.2, 1), b + Vector2d(1, -1.4)},
                            [&](int u, int v) { return is_in(a, u, v) || is_in(b, u, v); });
    ASSERT_TRUE(all[0] && all[1]) << apart;
    EXPECT_LT((all[0]->px - a).norm(), 1.2) << apart;
    EXPECT_LT((all[1]->px - b).norm(), 1.2) << apart;
  }
}

TEST(DiscFit, ReturnsNothingForADiscBehindOthers) {
  const Vector2d front(60, 45);
  const auto all = fitted({front, front + Vector2d(0.5, 0.3)}, [&](int u, int v) { return is_in(front, u, v); });
  EXPECT_FALSE(all[0]);
  EXPECT_FALSE(all[1]);
  const auto none = fitted({front}, [](int, int) { return false; });
  EXPECT_FALSE(none[0]);
}

}  // namespace
}  // namespace huetrack::objects
