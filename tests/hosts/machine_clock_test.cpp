#include "hosts/machine_clock.h"

#include <gtest/gtest.h>

#include <cmath>

#include "capture/timing/capture_clock.h"

namespace huetrack::hosts {
namespace {

using namespace std::chrono_literals;

TEST(MachineClock, IsItsOwn) {
  const MachineClock one = machine_clock(), two = machine_clock();
  EXPECT_NE(one.machine, 0);
  EXPECT_EQ(one.machine, two.machine);
  EXPECT_EQ(one.zero, two.zero);
  EXPECT_EQ(one.zero, capture::unix_time_of(0ns));
  EXPECT_EQ(clock_sync(one, two).sigma_s, 0);
  EXPECT_EQ(clock_sync(one, two).offset, 0ns);
}

TEST(MachineClock, TwoProgramsOfOneMachineDifferByTheirZero) {
  MachineClock ours{.machine = 7, .zero = capture::Timestamp(5s), .kept_s = std::nullopt}, theirs = ours;
  theirs.zero += 3us;
  EXPECT_EQ(clock_sync(ours, theirs).offset, 3us);
  theirs.machine = 8;
  EXPECT_TRUE(std::isinf(clock_sync(ours, theirs).sigma_s)) << "not synchronised";
  ours.kept_s = 3e-4;
  EXPECT_TRUE(std::isinf(clock_sync(ours, theirs).sigma_s)) << "one of them";
  theirs.kept_s = 4e-4;
  EXPECT_NEAR(clock_sync(ours, theirs).sigma_s, 5e-4, 1e-12);
  EXPECT_EQ(clock_sync(ours, theirs).offset, 0ns);
  ours.machine = theirs.machine = 0;
  EXPECT_NEAR(clock_sync(ours, theirs).sigma_s, 5e-4, 1e-12) << "which machines they are, is not known";
}

// Numbers as chronyc, timedatectl and phc2sys leave them in adjtimex(2).
TEST(MachineClock, ReadsTheErrorOfEachService) {
  EXPECT_EQ(kept_by(false, 16'000'000, 16'000'000, 0), std::nullopt);
  EXPECT_NEAR(*kept_by(true, 150, 2400, 0), 150e-6, 1e-9) << "chrony on a local network";
  EXPECT_NEAR(*kept_by(true, 16'000'000, 300, 0), 100e-6, 1e-9) << "phc2sys says its largest error only";
  EXPECT_NEAR(*kept_by(true, 0, 150'000, 0), 0.05, 1e-9) << "systemd-timesyncd, some minutes after it asked";
  EXPECT_NEAR(*kept_by(true, 0, 0, 0), 2e-3, 1e-9) << "and when it has just asked";
  EXPECT_GE(*kept_by(true, 1, 1, 0), 20e-6);
  EXPECT_NEAR(*kept_by(true, 150, 2400, -0.08), 0.08, 1e-5)
      << "set since this program was started, which goes on as it was";
}

}  // namespace
}  // namespace huetrack::hosts
