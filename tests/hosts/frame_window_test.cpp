#include "hosts/frame_window.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <utility>

namespace huetrack::hosts {
namespace {

using namespace std::chrono_literals;
using Clock = FrameWindow::Clock;

// Frames at 30 a second through a network that carries one after the other and acknowledges them later, and a tracker
// that may be gone until its lease ends.
struct SimulatedNetwork {
  static constexpr int kept = 4;  // frames that wait; one more replaces the oldest
  FrameWindow window;
  Clock::time_point now{1000s}, busy_until{}, gone_until{};
  std::chrono::milliseconds per_frame{1}, acknowledged_after{21}, repair{40};
  int repaired_every = 0;  // of so many frames one is repaired; 0: none
  int written = 0;
  Clock::time_point all_came_at{}, repaired_until{};
  // How many of so many frames are sent.
  int send(int frames) {
    int sent = 0;
    for (int i = 0; i < frames; ++i, now += 33ms) {
      if (!window.may_send(now >= all_came_at && now >= gone_until, now)) continue;
      ++sent;
      busy_until = std::min(std::max(busy_until, now) + per_frame, now + kept * per_frame);
      const bool is_repaired = repaired_every > 0 && ++written % repaired_every == 0;
      repaired_until = is_repaired ? busy_until + repair : repaired_until;
      all_came_at = std::max(busy_until, repaired_until) + acknowledged_after;
    }
    return sent;
  }
};

TEST(FrameWindow, GoodNetworkCarriesAll) {
  SimulatedNetwork network;
  EXPECT_EQ(network.send(300), 300);
  network.per_frame = 11ms;
  EXPECT_EQ(network.send(300), 300);
}

TEST(FrameWindow, RetransmissionsSkipNoFrame) {
  SimulatedNetwork network;
  for (const int every : {25, 7, 3}) {  // 0.1 % of packets lost, and more than that
    network.repaired_every = every;
    EXPECT_EQ(network.send(300), 300) << every;
    EXPECT_EQ(network.window.window(), FrameWindow::most);
  }
  network.repaired_every = 25;
  network.repair = 80ms;  // retransmissions are lost, too
  EXPECT_EQ(network.send(300), 300);
}

TEST(FrameWindow, SlowNetworkIsFilledWithShortQueues) {
  for (const auto& [per_frame, least] : {std::pair{50ms, 13}, {66ms, 10}, {100ms, 6}}) {
    SimulatedNetwork network;
    network.per_frame = per_frame;
    network.send(30);
    for (int second = 0; second < 20; ++second) {
      EXPECT_GE(network.send(30), least) << second;
      EXPECT_LT(network.busy_until - network.now, 250ms) << second;
    }
  }
}

TEST(FrameWindow, SkipsNoFrameASecondAfterRecovery) {
  SimulatedNetwork network;
  network.per_frame = 100ms;
  network.send(300);
  network.per_frame = 1ms;
  network.send(30);
  EXPECT_EQ(network.send(300), 300);
  EXPECT_EQ(network.window.window(), FrameWindow::most);
}

// One frame takes longer than usual_patience: later it turns out that no tracker is gone.
TEST(FrameWindow, DistinguishesVerySlowFromGone) {
  SimulatedNetwork network;
  network.per_frame = 600ms;
  network.send(600);
  for (int times = 0; times < 10; ++times) {
    EXPECT_NEAR(network.send(60), 3, 2) << times;
    EXPECT_LT(network.busy_until - network.now, 2 * 600ms) << times;
  }
}

TEST(FrameWindow, LostTrackerDelaysOthersBriefly) {
  SimulatedNetwork network;
  for (int times = 0; times < 3; ++times) {
    network.send(100);
    network.gone_until = network.now + 3s;
    EXPECT_GE(network.send(91), 91 - 13) << times;
    EXPECT_EQ(network.send(100), 100) << times;
  }
}

// A fast camera always has a frame in flight, so "all acknowledged" is seldom observed.
TEST(FrameWindow, RetransmissionsSkipNoFrameOfAFastCamera) {
  constexpr auto heartbeat = 20ms, answered_after = 2ms, repaired_after = 35ms;
  constexpr int repaired_every = 20;  // 0.1 % of packets lost
  for (const int fps : {60, 90, 120}) {
    FrameWindow window;
    Clock::time_point acknowledged_at{}, sent_at{}, came_until{};  // of the last frame before a heartbeat
    int left_out = 0;
    for (int i = 0; i < 60 * fps; ++i) {
      const Clock::time_point now = Clock::time_point(1000s) + i * Clock::duration(1s) / fps;
      // The last answered heartbeat.
      const auto beat = Clock::time_point((now - answered_after).time_since_epoch() / heartbeat * heartbeat);
      if (beat >= came_until) acknowledged_at = std::max(acknowledged_at, beat);
      if (!window.may_send(acknowledged_at >= sent_at, now)) {
        ++left_out;
        continue;
      }
      sent_at = now;
      if (i % repaired_every == 0) came_until = now + repaired_after;
    }
    EXPECT_EQ(left_out, 0) << fps;
  }
}

TEST(FrameWindow, SlowNetworkKeepsFewFramesOfAFastCameraWaiting) {
  for (const int fps : {60, 120}) {
    FrameWindow window;
    Clock::time_point now{1000s}, busy_until{};
    int sent = 0;
    for (int i = 0; i < 20 * fps; ++i, now += Clock::duration(1s) / fps) {
      if (!window.may_send(now >= busy_until + 21ms, now)) continue;
      ++sent;
      busy_until = std::min(std::max(busy_until, now) + 50ms, now + SimulatedNetwork::kept * 50ms);
      if (i < fps) continue;  // until the window has adapted
      EXPECT_LT(busy_until - now, 250ms);
    }
    EXPECT_GE(sent, 20 * 12) << fps;
  }
}

}  // namespace
}  // namespace huetrack::hosts
