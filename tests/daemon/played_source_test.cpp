// A replay is held, stepped through, slowed down and hurried; every frame comes, in its order, whatever is asked.
#include "daemon/played_source.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <thread>

namespace huetrack::daemon {
namespace {

using namespace testing;
using namespace std::chrono_literals;
using PlayClock = std::chrono::steady_clock;

// Two cameras, a frame of each every 20 ms, that of the second one so much later.
class TwoCameras final : public capture::FrameSource {
 public:
  explicit TwoCameras(capture::Duration later) : later_(later) {}
  std::optional<capture::Frame> next(std::stop_token) override {
    if (next_ == 200) return std::nullopt;
    capture::Frame frame;
    frame.camera = next_ % 2;
    frame.sequence = std::uint32_t(next_ / 2);
    frame.captured_at = capture::Timestamp(100s + (next_ / 2) * 20ms + (next_ % 2) * later_);
    ++next_;
    return frame;
  }
  bool ended(int) const override { return next_ == 200; }

 private:
  const capture::Duration later_;
  int next_ = 0;
};

class Played : public Test {
 protected:
  void play(const PlayedSourceOptions& options, std::optional<capture::Timestamp> held_beyond = {},
            capture::Duration later = 3ms) {
    const auto open = [later](capture::Timestamp) { return std::make_unique<TwoCameras>(later); };
    source.emplace(std::make_unique<LoopingSource>(
                       open({}), capture::Timestamp(100s),
                       LoopingSourceOptions{.cameras = 2, .loops = options.loops, .step = 20ms, .open = open}),
                   options);
    if (held_beyond) source->hold_beyond(*held_beyond);
    reader = std::jthread([this](const std::stop_token& stop) {
      while (const auto frame = source->next(stop)) {
        if (stop.stop_requested()) return;
        const std::scoped_lock lock(mutex);
        if (times.empty()) first_came = PlayClock::now();
        times.push_back(frame->captured_at);
        numbers.push_back(frame->sequence);
        jumps.push_back(source->jumps());
      }
      has_ended = true;
    });
  }
  ~Played() override {
    reader.request_stop();
    if (reader.joinable()) reader.join();
  }
  std::size_t count() {
    const std::scoped_lock lock(mutex);
    return times.size();
  }
  bool comes_to(std::size_t frames) {
    for (const auto end = PlayClock::now() + 10s; PlayClock::now() < end; std::this_thread::sleep_for(1ms))
      if (count() >= frames) return true;
    return false;
  }
  bool stays_at(std::size_t frames) {
    std::this_thread::sleep_for(100ms);
    return count() == frames;
  }
  std::optional<PlayedSource> source;
  std::mutex mutex;
  std::vector<capture::Timestamp> times;  // guarded by mutex, as the following
  std::vector<std::uint32_t> numbers;
  std::vector<std::uint64_t> jumps;  // up to each frame
  PlayClock::time_point first_came;
  std::atomic<bool> has_ended = false;
  std::jthread reader;
};

// The second camera's first frame is over.
constexpr capture::Timestamp first_set_until(100s + 10ms);

TEST_F(Played, IsPausedAndStepped) {
  play({.cameras = 2}, first_set_until);
  ASSERT_TRUE(comes_to(3));
  EXPECT_TRUE(stays_at(3));  // the first frame of each, and one that shows that their set is whole
  EXPECT_TRUE(source->state().is_paused);
  source->step(1);
  ASSERT_TRUE(comes_to(5));
  EXPECT_TRUE(stays_at(5));
  EXPECT_NEAR(source->state().position_s, 0.04, 1e-9);
  source->step(3);
  ASSERT_TRUE(comes_to(11));
  EXPECT_TRUE(stays_at(11));
  // As long as it was held, what is published is later.
  EXPECT_GT(source->lag(), 100ms);
  source->go_on();
  ASSERT_TRUE(comes_to(200));
  EXPECT_TRUE(std::ranges::is_sorted(times));
  while (!has_ended) std::this_thread::sleep_for(1ms);
  // What it took is not what was waited for.
  EXPECT_GT(source->paused(), 200ms);
  EXPECT_GE(source->waited(), source->paused());
  EXPECT_LT(source->waited() - source->paused(), 100ms);
}

TEST_F(Played, IsPacedPausedAndSpedUp) {
  const auto began = PlayClock::now();
  play({.cameras = 2, .speed = 1});
  ASSERT_TRUE(comes_to(20));  // 183 ms
  EXPECT_GT(PlayClock::now() - began, 150ms);
  EXPECT_EQ(source->lag(), 0ns);
  source->pause();
  std::this_thread::sleep_for(50ms);
  const std::size_t paused_at = count();
  EXPECT_LT(paused_at, 100u);
  EXPECT_TRUE(stays_at(paused_at));
  source->set_speed(0.1);
  source->go_on();
  std::this_thread::sleep_for(210ms);
  EXPECT_LT(count(), paused_at + 10);  // two frames of each, and some
  EXPECT_GT(source->lag(), 100ms);
  const capture::Duration lag = source->lag();
  source->set_speed(0);
  const auto hurried = PlayClock::now();
  ASSERT_TRUE(comes_to(200));
  EXPECT_LT(PlayClock::now() - hurried, 1s);  // of two seconds
  EXPECT_NEAR(capture::seconds(source->lag()), capture::seconds(lag),
              0.1);  // as fast as possible, times are the recording's
  EXPECT_TRUE(std::ranges::is_sorted(times));
}

// One camera may begin some frames after the other.
TEST_F(Played, PausesNotBeforeTheGivenTime) {
  play({.cameras = 2}, first_set_until + 40ms);
  ASSERT_TRUE(comes_to(7));
  EXPECT_TRUE(stays_at(7));
  source->go_on();
  ASSERT_TRUE(comes_to(200));
}

// Of cameras in step no further frame needs to show that their set is whole.
TEST_F(Played, PausesAtTheFirstFramesOfSynchronisedCameras) {
  play({.cameras = 2}, first_set_until, 0ms);
  ASSERT_TRUE(comes_to(2));
  EXPECT_TRUE(stays_at(2));
  EXPECT_EQ(source->state().position_s, 0);
  source->step(1);
  ASSERT_TRUE(comes_to(4));
  EXPECT_TRUE(stays_at(4));
  EXPECT_NEAR(source->state().position_s, 0.02, 1e-9);
}

TEST_F(Played, EndsWhilePaused) {
  play({.cameras = 2}, first_set_until);
  ASSERT_TRUE(comes_to(3));
  const auto asked = PlayClock::now();
  reader.request_stop();
  reader.join();
  EXPECT_LT(PlayClock::now() - asked, 1s);
}

TEST_F(Played, LoopsWithRisingTimesAndNumbers) {
  play({.cameras = 2, .loops = true});
  ASSERT_TRUE(comes_to(500));
  EXPECT_FALSE(has_ended);
  const std::scoped_lock lock(mutex);
  // The second camera's last frame is at 1.983 s; a step of 20 ms later the first one's first comes again.
  EXPECT_EQ(times[200] - times[199], 20ms);
  EXPECT_EQ(times[202] - times[200], 20ms);
  EXPECT_TRUE(std::ranges::is_sorted(times));
  for (std::size_t i = 0; i < 500; ++i) ASSERT_EQ(numbers[i], i / 2) << "a gap would count as lost frames";
  for (std::size_t i = 0; i < 500; ++i) ASSERT_EQ(jumps[i], i / 200);
}

// Frames are tracked some time after their release; published times must not go back by the speed-up meanwhile.
TEST_F(Played, RemembersTheLagOfEachFrame) {
  play({.cameras = 2, .speed = 10});
  ASSERT_TRUE(comes_to(100));
  const std::scoped_lock lock(mutex);
  for (std::size_t i = 2; i < 100; ++i) {
    const capture::Duration published =
        times[i] - times[i - 2] + source->lag_at(times[i]) - source->lag_at(times[i - 2]);
    EXPECT_NEAR(capture::seconds(published), 0.002, 1e-6) << i;
  }
}

// What is published must neither run ahead of the clock nor fall behind it, however often the speed is changed.
TEST_F(Played, ChangesOfTheSpeedDoNotAddUp) {
  play({.cameras = 2, .speed = 1});
  ASSERT_TRUE(comes_to(4));
  const auto ahead_s = [&] {
    const std::scoped_lock lock(mutex);
    const capture::Timestamp newest = times.back();
    return capture::seconds(newest - times.front() + source->lag_at(newest)) -
           std::chrono::duration<double>(PlayClock::now() - first_came).count();
  };
  for (int i = 0; i < 10; ++i) {
    source->set_speed(i % 2 == 0 ? 0.1 : 5);
    std::this_thread::sleep_for(30ms);
  }
  source->set_speed(1);
  std::this_thread::sleep_for(50ms);
  EXPECT_NEAR(ahead_s(), 0, 0.06);
}

TEST_F(Played, JumpsToAPositionWhilePlaying) {
  play({.cameras = 2, .speed = 1, .length_s = 1.98});
  ASSERT_TRUE(comes_to(4));
  source->seek(1.5);
  for (const auto end = PlayClock::now() + 5s; PlayClock::now() < end && source->state().position_s < 1.5;)
    std::this_thread::sleep_for(1ms);
  EXPECT_NEAR(source->state().position_s, 1.5, 0.1);
  source->seek(0);
  for (const auto end = PlayClock::now() + 5s; PlayClock::now() < end && source->state().position_s > 1;)
    std::this_thread::sleep_for(1ms);
  EXPECT_NEAR(source->state().position_s, 0, 0.1);
  source->set_speed(0);
  while (!has_ended) std::this_thread::sleep_for(1ms);
  EXPECT_NEAR(source->state().position_s, 1.983, 1e-9);
  EXPECT_TRUE(std::ranges::is_sorted(times));
}

TEST_F(Played, ShowsTheSetOfAPositionWhilePaused) {
  play({.cameras = 2, .set_span = 5ms}, first_set_until);
  ASSERT_TRUE(comes_to(3));
  EXPECT_TRUE(stays_at(3));
  source->seek(1);
  ASSERT_TRUE(comes_to(6));  // the frames of both at 1 s, and one that shows that their set is whole
  EXPECT_TRUE(stays_at(6));
  EXPECT_NEAR(source->state().position_s, 1.02, 1e-9);
  EXPECT_GT(source->lag(), 20ms) << "published times go on with the clock";
  EXPECT_TRUE(source->state().is_paused);
  source->go_on();
  while (!has_ended) std::this_thread::sleep_for(1ms);
  EXPECT_EQ(times.size(), 3u + 100u);
  EXPECT_EQ(jumps[2], 0u);
  EXPECT_EQ(jumps[3], 1u);
}

TEST(Looping, ASourceWithoutAStepIsRefused) {
  EXPECT_THROW(LoopingSource(nullptr, {}, LoopingSourceOptions{}), std::invalid_argument);
}

}  // namespace
}  // namespace huetrack::daemon
