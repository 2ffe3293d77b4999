#include "calib/model/missing_links.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <utility>

namespace huetrack::calib {
namespace {

using namespace testing;

using Shared = std::map<std::pair<std::size_t, std::size_t>, int>;

auto link(std::size_t a, std::size_t b, int shared) {
  return AllOf(Field("a", &CameraLink::a, a), Field("b", &CameraLink::b, b),
               Field("shared", &CameraLink::shared, shared));
}

std::vector<CameraLink> missing(std::size_t cameras, const Shared& shared) {
  return missing_links(
      cameras,
      [&](std::size_t a, std::size_t b) {
        const auto known = shared.find({a, b});
        return known == shared.end() ? 0 : known->second;
      },
      10);
}

TEST(MissingLinks, NoneIfAllAreConnectedThroughOthers) {
  EXPECT_THAT(missing(0, {}), IsEmpty());
  EXPECT_THAT(missing(1, {}), IsEmpty());
  EXPECT_THAT(missing(4, {{{0, 1}, 10}, {{1, 2}, 12}, {{0, 3}, 11}}), IsEmpty());
}

TEST(MissingLinks, LinksEveryIsolatedCameraToItsBestPartner) {
  EXPECT_THAT(missing(3, {}), ElementsAre(link(0, 1, 0), link(0, 2, 0)));
  EXPECT_THAT(missing(3, {{{0, 1}, 30}, {{0, 2}, 4}, {{1, 2}, 9}}), ElementsAre(link(1, 2, 9)));
}

// Each camera has a partner, and yet the four are no rig.
TEST(MissingLinks, ConnectsTwoPairsByTheBestLink) {
  EXPECT_THAT(missing(4, {{{0, 1}, 30}, {{2, 3}, 30}, {{0, 3}, 2}, {{1, 2}, 5}}), ElementsAre(link(1, 2, 5)));
}

// The second and the third are each other's best, the first and the fourth likewise: that is not all.
TEST(MissingLinks, ConnectAllCameras) {
  EXPECT_THAT(missing(4, {{{1, 2}, 8}, {{0, 3}, 7}, {{0, 1}, 1}}),
              ElementsAre(link(0, 1, 1), link(0, 3, 7), link(1, 2, 8)));
}

}  // namespace
}  // namespace huetrack::calib
