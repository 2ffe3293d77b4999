#include "capture/timing/capture_clock.h"

#include <gtest/gtest.h>
#include <time.h>

namespace huetrack::capture {
namespace {

Duration now_of(clockid_t id) {
  timespec t{};
  ::clock_gettime(id, &t);
  return std::chrono::seconds(t.tv_sec) + Duration(t.tv_nsec);
}

TEST(CaptureClock, ConvertsMonotonicToUnixTime) {
  for (int i = 0; i < 100; ++i) {
    const Duration before = now_of(CLOCK_REALTIME);
    const Timestamp converted = unix_time_of(now_of(CLOCK_MONOTONIC));
    const Duration after = now_of(CLOCK_REALTIME);
    EXPECT_GE(converted.time_since_epoch(), before - std::chrono::microseconds(200));
    EXPECT_LE(converted.time_since_epoch(), after + std::chrono::microseconds(200));
  }
}

TEST(CaptureClock, OffsetIsConstant) {
  const Duration boot = std::chrono::hours(5);
  const Timestamp once = unix_time_of(boot);
  for (int i = 0; i < 1000; ++i) ASSERT_EQ(unix_time_of(boot), once);
  EXPECT_EQ(unix_time_of(boot + Duration(1)) - once, Duration(1)) << "to the nanosecond";
}

TEST(CaptureClock, UnixNowAgreesWithTheSystemClock) {
  EXPECT_NEAR(seconds(unix_now() - std::chrono::system_clock::now()), 0, 1e-3);
  EXPECT_NEAR(seconds(wall_clock_step()), 0, 1e-3) << "the clock was not set meanwhile";
}

}  // namespace
}  // namespace huetrack::capture
