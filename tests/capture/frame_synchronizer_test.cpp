#include "capture/timing/frame_synchronizer.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <map>
#include <random>
#include <set>
#include <stdexcept>

namespace huetrack::capture {

// "0:10 1:12" is a set of camera 0's frame of 10 ms and camera 1's of 12 ms.
void PrintTo(const FrameSet& set, std::ostream* out) {
  for (const auto& frame : set.frames)
    if (frame) *out << frame->camera << ":" << seconds(frame->captured_at) * 1e3 << " ";
}

namespace {

using namespace std::chrono_literals;
using testing::ElementsAre;
using testing::IsEmpty;

Frame frame(int camera, Duration at, FrameStatus status = FrameStatus::ok) {
  Frame f;
  f.camera = camera;
  f.captured_at = Timestamp{at};
  f.status = status;
  return f;
}

using Views = std::map<int, int>;  // camera -> capture time, ms

Views views(const FrameSet& set) {
  Views result;
  for (const auto& f : set.frames)
    if (f) result[f->camera] = static_cast<int>(f->captured_at.time_since_epoch() / 1ms);
  return result;
}

// Milliseconds in, views out.
struct Sync : FrameSynchronizer {
  explicit Sync(int cameras, Duration tolerance = 17ms, bool ascending_input = false)
      : FrameSynchronizer({.camera_count = cameras, .tolerance = tolerance, .ascending_input = ascending_input}) {}
  std::vector<Views> push(int camera, int at_ms, FrameStatus status = FrameStatus::ok) {
    std::vector<Views> sets;
    for (const auto& set : FrameSynchronizer::push(frame(camera, at_ms * 1ms, status))) sets.push_back(views(set));
    return sets;
  }
  std::vector<Views> flush_all() {
    std::vector<Views> sets;
    while (const auto set = flush()) sets.push_back(views(*set));
    return sets;
  }
};

TEST(FrameSynchronizer, UnusedCameraLeavesSetsComplete) {
  FrameSynchronizer sync({.camera_count = 3, .cameras_in_use = 2});
  for (const int at_ms : {0, 33, 66})
    for (const int camera : {0, 2}) sync.push(frame(camera, at_ms * 1ms));
  while (sync.flush()) {
  }
  EXPECT_EQ(sync.counters().sets, 3u);
  EXPECT_EQ(sync.counters().incomplete_sets, 0u);
  EXPECT_THROW(FrameSynchronizer({.camera_count = 3, .cameras_in_use = 4}), std::invalid_argument);
}

TEST(FrameSynchronizer, OutputsACompleteSetAtOnce) {
  Sync sync(2);
  EXPECT_THAT(sync.push(0, 0), IsEmpty());
  EXPECT_THAT(sync.push(1, 5), ElementsAre(Views{{0, 0}, {1, 5}}));
  EXPECT_THAT(sync.push(1, 35), IsEmpty());
  EXPECT_THAT(sync.push(0, 33), ElementsAre(Views{{0, 33}, {1, 35}}));
  EXPECT_EQ(sync.counters().sets, 2u);
  EXPECT_EQ(sync.counters().incomplete_sets, 0u);
}

TEST(FrameSynchronizer, SetHasNumberAndNewestTime) {
  FrameSynchronizer sync({.camera_count = 2});
  sync.push(frame(0, 3ms));
  const auto sets = sync.push(frame(1, 1ms));
  ASSERT_EQ(sets.size(), 1u);
  EXPECT_EQ(sets[0].number, 0u);
  EXPECT_EQ(sets[0].at, Timestamp{3ms});
  EXPECT_EQ(sets[0].frames.size(), 2u);
}

TEST(FrameSynchronizer, SingleCameraNeedsNoWaiting) {
  Sync sync(1);
  EXPECT_THAT(sync.push(0, 0), ElementsAre(Views{{0, 0}}));
  EXPECT_THAT(sync.push(0, 33), ElementsAre(Views{{0, 33}}));
  EXPECT_EQ(sync.counters().incomplete_sets, 0u);
}

TEST(FrameSynchronizer, FrameBeyondTheSetProvesItIncomplete) {
  Sync sync(2);
  EXPECT_THAT(sync.push(0, 0), IsEmpty());
  EXPECT_THAT(sync.push(1, 33), ElementsAre(Views{{0, 0}}));
  EXPECT_THAT(sync.push(0, 33), ElementsAre(Views{{0, 33}, {1, 33}}));
  EXPECT_EQ(sync.counters().incomplete_sets, 1u);
}

TEST(FrameSynchronizer, OneFrameCanProveSeveralSets) {
  Sync sync(2);
  for (int t : {0, 33, 66}) {
    sync.push(0, t);
    sync.push(1, t);
  }
  sync.push(0, 100);  // camera 1 loses two frames
  EXPECT_THAT(sync.push(0, 133), ElementsAre(Views{{0, 100}}));
  EXPECT_THAT(sync.push(1, 166), ElementsAre(Views{{0, 133}}));
}

TEST(FrameSynchronizer, StoppedCameraDelaysAtMostOnePeriod) {
  Sync sync(3);
  for (int t = 0; t < 100; t += 33)
    for (int camera : {0, 1, 2}) sync.push(camera, t);
  sync.push(0, 132);
  EXPECT_THAT(sync.push(1, 132), IsEmpty());  // camera 2 may still come
  sync.push(0, 165);
  EXPECT_THAT(sync.push(1, 165), ElementsAre(Views{{0, 132}, {1, 132}}));
  for (int t = 198; t < 231; t += 33) sync.push(0, t), sync.push(1, t);
  sync.push(0, 231);
  sync.push(1, 231);
  sync.push(0, 264);
  sync.push(1, 264);
  sync.push(0, 297);
  EXPECT_THAT(sync.push(1, 297), ElementsAre(Views{{0, 297}, {1, 297}}));  // no longer waited for
}

TEST(FrameSynchronizer, ReturningCameraIsPairedAgain) {
  Sync sync(2);
  for (int t = 0; t < 100; t += 33) sync.push(0, t), sync.push(1, t);
  for (int t = 132; t < 600; t += 33) sync.push(0, t);
  sync.push(0, 627);
  sync.push(1, 629);
  sync.push(0, 660);
  EXPECT_THAT(sync.push(1, 662), ElementsAre(Views{{0, 660}, {1, 662}}));
}

TEST(FrameSynchronizer, CameraThatNeverDeliveredIsGivenUpAfterASecond) {
  Sync sync(2);
  EXPECT_THAT(sync.push(0, 0), IsEmpty());
  EXPECT_THAT(sync.push(0, 33), ElementsAre(Views{{0, 0}}));
  for (int t = 66; t < 1100; t += 33) sync.push(0, t);
  EXPECT_THAT(sync.push(0, 1122), ElementsAre(Views{{0, 1122}}));
}

TEST(FrameSynchronizer, EveryFrameOfTheFasterCameraGetsThrough) {
  const Duration periods[] = {Duration(1s) / 60, Duration(1s) / 30};
  Sync sync(2, suggested_tolerance(periods));
  std::vector<std::size_t> sizes;
  for (int k = 0; k < 60; ++k) {
    for (const auto& set : sync.push(0, k * 1000 / 60)) sizes.push_back(set.size());
    if (k % 2 == 0)
      for (const auto& set : sync.push(1, k * 1000 / 60 + 4)) sizes.push_back(set.size());
  }
  for (const auto& set : sync.flush_all()) sizes.push_back(set.size());
  EXPECT_EQ(sizes.size(), 60u);
  EXPECT_EQ(std::ranges::count(sizes, 2u), 30);
  EXPECT_EQ(sync.counters().late_frames + sync.counters().duplicate_frames, 0u);
}

TEST(FrameSynchronizer, FastCameraLeavesItsNearerFrameToTheOthers) {
  Sync sync(2);  // a tolerance that is wide for the fast camera
  sync.push(0, 0);
  sync.push(0, 8);
  EXPECT_THAT(sync.push(1, 10), ElementsAre(Views{{0, 0}}, Views{{0, 8}, {1, 10}}));
}

TEST(FrameSynchronizer, LateFramesAreCountedAndDropped) {
  Sync sync(2);
  sync.push(0, 0);
  sync.push(0, 33);  // gives {0:0} up
  EXPECT_THAT(sync.push(1, 0), IsEmpty());
  EXPECT_EQ(sync.counters().late_frames, 1u);
}

TEST(FrameSynchronizer, LearnsTheLagOfASlowerTransfer) {
  Sync sync(2);  // camera 1's frames arrive 50 ms later than camera 0's
  std::vector<Views> sets;
  for (int t = 0; t < 3300; t += 33) {
    for (auto& set : sync.push(0, t)) sets.push_back(set);
    if (t >= 66)
      for (auto& set : sync.push(1, t - 66)) sets.push_back(set);
  }
  EXPECT_LE(sync.counters().late_frames, 3u);
  EXPECT_EQ(sets.back().size(), 2u);
  EXPECT_GE(std::ranges::count(sets, 2u, &Views::size), 90);
}

TEST(FrameSynchronizer, ReorderedFramesAreSorted) {
  Sync sync(2);
  sync.push(0, 33);
  EXPECT_THAT(sync.push(0, 20), IsEmpty());
  EXPECT_THAT(sync.push(1, 21), ElementsAre(Views{{0, 20}, {1, 21}}));
  EXPECT_THAT(sync.push(1, 34), ElementsAre(Views{{0, 33}, {1, 34}}));
}

TEST(FrameSynchronizer, DuplicatesAreCountedAndTheFirstIsKept) {
  Sync sync(2);
  sync.push(0, 0);
  EXPECT_THAT(sync.push(0, 0), IsEmpty());
  EXPECT_THAT(sync.push(1, 0), ElementsAre(Views{{0, 0}, {1, 0}}));
  EXPECT_THAT(sync.push(1, 0), IsEmpty());
  EXPECT_EQ(sync.counters().duplicate_frames, 2u);
}

TEST(FrameSynchronizer, CorruptedFrameEndsTheWaitForItsCamera) {
  Sync sync(2);
  sync.push(0, 0);
  EXPECT_THAT(sync.push(1, 1, FrameStatus::corrupted), ElementsAre(Views{{0, 0}}));
  EXPECT_EQ(sync.counters().corrupted_frames, 1u);
  EXPECT_EQ(sync.counters().incomplete_sets, 1u);
}

TEST(FrameSynchronizer, CorruptedFramesAloneMakeNoSet) {
  Sync sync(2);
  sync.push(0, 0, FrameStatus::corrupted);
  EXPECT_THAT(sync.push(1, 1, FrameStatus::corrupted), IsEmpty());
  EXPECT_EQ(sync.counters().sets, 0u);
  EXPECT_EQ(sync.counters().corrupted_frames, 2u);
}

// Free-running cameras: the nearest neighbours pair up, and stay paired.
TEST(FrameSynchronizer, ConstantPhaseIsPairedStably) {
  for (int phase = 0; phase < 33; ++phase) {
    const Duration periods[] = {33ms, 33ms};
    Sync sync(2, suggested_tolerance(periods));
    std::set<int> spans;
    for (int t = 0; t < 3300; t += 33)
      for (const auto& [camera, at] : {std::pair{0, t}, std::pair{1, t + phase}})
        for (const auto& set : sync.push(camera, at))
          if (set.size() == 2) spans.insert(set.at(1) - set.at(0));
    EXPECT_EQ(spans.size(), 1u) << "phase " << phase;
    EXPECT_LE(sync.counters().incomplete_sets, 1u) << "phase " << phase;
    EXPECT_LE(std::abs(*spans.begin()), 18) << "phase " << phase;
  }
}

TEST(FrameSynchronizer, FreeRunningCamerasOfAnyPhaseGiveCompleteSets) {
  std::mt19937_64 rng(3);
  for (int trial = 0; trial < 200; ++trial) {
    const int cameras = 2 + trial % 4;
    const std::vector<Duration> periods(static_cast<std::size_t>(cameras), 33ms);
    Sync sync(cameras, suggested_tolerance(periods));
    std::vector<std::pair<int, int>> frames;  // capture time, camera
    for (int camera = 0; camera < cameras; ++camera) {
      const int phase = std::uniform_int_distribution(0, 32)(rng);
      for (int t = phase; t < 1000; t += 33) frames.emplace_back(t, camera);
    }
    std::ranges::sort(frames);
    for (const auto& [t, camera] : frames) sync.push(camera, t);
    EXPECT_LE(sync.counters().incomplete_sets, 4u) << cameras << " cameras";  // at the start only
    EXPECT_GE(sync.counters().sets, 28u);
  }
}

TEST(FrameSynchronizer, FollowsAClockThatGoesBack) {
  Sync sync(2);
  for (int t = 10'000; t < 10'100; t += 33) sync.push(0, t), sync.push(1, t);
  sync.push(0, 5000);
  EXPECT_THAT(sync.push(1, 5001), ElementsAre(Views{{0, 5000}, {1, 5001}}));
  EXPECT_EQ(sync.counters().clock_jumps, 1u);
}

TEST(FrameSynchronizer, FollowsAClockThatGoesForward) {
  Sync sync(2);
  for (int t = 0; t < 100; t += 33) sync.push(0, t), sync.push(1, t);
  sync.push(0, 50'000);
  EXPECT_THAT(sync.push(1, 50'001), ElementsAre(Views{{0, 50'000}, {1, 50'001}}));
  EXPECT_EQ(sync.counters().early_frames, 0u);
}

TEST(FrameSynchronizer, FollowsASingleCamerasClockFromItsSecondFrame) {
  Sync sync(1);
  sync.push(0, 10'000);
  EXPECT_THAT(sync.push(0, 100), IsEmpty());
  EXPECT_THAT(sync.push(0, 133), ElementsAre(Views{{0, 100}}, Views{{0, 133}}));
  EXPECT_EQ(sync.counters().clock_jumps, 1u);
}

TEST(FrameSynchronizer, OneWrongStampDoesNotStopTheOthers) {
  Sync sync(2);
  for (int t = 0; t < 100; t += 33) sync.push(0, t), sync.push(1, t);
  EXPECT_THAT(sync.push(0, 3'600'000), IsEmpty());
  sync.push(0, 165);
  EXPECT_THAT(sync.push(1, 165), ElementsAre(Views{{0, 165}, {1, 165}}));
  sync.push(0, -3'600'000);
  sync.push(0, 198);
  EXPECT_THAT(sync.push(1, 198), ElementsAre(Views{{0, 198}, {1, 198}}));
  EXPECT_EQ(sync.counters().early_frames, 1u);
  EXPECT_EQ(sync.counters().late_frames, 1u);
  EXPECT_EQ(sync.counters().clock_jumps, 0u);
}

TEST(FrameSynchronizer, SingleCameraContinuesAfterAPause) {
  Sync sync(2);
  for (int t = 0; t < 100; t += 33) sync.push(0, t), sync.push(1, t);
  std::vector<Views> sets;
  for (int t = 5000; t < 5600; t += 33)
    for (auto& set : sync.push(0, t)) sets.push_back(set);
  EXPECT_EQ(sets.size(), 19u);
  EXPECT_EQ(sync.counters().early_frames, 0u);
}

TEST(FrameSynchronizer, FlushReturnsOpenSets) {
  Sync sync(3, 5ms);
  sync.push(0, 0);
  sync.push(1, 3);
  sync.push(1, 7);
  EXPECT_THAT(sync.flush_all(), ElementsAre(Views{{0, 0}, {1, 3}}, Views{{1, 7}}));
  EXPECT_EQ(sync.counters().incomplete_sets, 2u);
}

TEST(FrameSynchronizer, RefusesBadOptions) {
  EXPECT_THROW(FrameSynchronizer({.camera_count = 0}), std::invalid_argument);
  EXPECT_THROW(FrameSynchronizer({.camera_count = 1, .tolerance = 0ns}), std::invalid_argument);
}

TEST(SuggestedTolerance, FollowsTheFastestCameraAndTheirNumber) {
  const auto suggested = [](std::vector<Duration> periods) { return suggested_tolerance(periods); };
  EXPECT_EQ(suggested({100ms, 100ms}), 55ms);
  EXPECT_EQ(suggested({100ms, 200ms}), 55ms);
  EXPECT_EQ(suggested({100ms}), 55ms);
  EXPECT_EQ(suggested({100ms, 0ms}), 55ms);  // one unknown
  EXPECT_NEAR(seconds(suggested({100ms, 100ms, 100ms})), 0.0717, 1e-4);
  EXPECT_EQ(suggested(std::vector<Duration>(8, 100ms)), 80ms);
  EXPECT_EQ(suggested({}), 17ms);
}

// Whatever comes, nothing is lost without being counted, and sets keep their promises.
TEST(FrameSynchronizer, KeepsItsInvariantsForRandomInput) {
  for (unsigned seed = 0; seed < 300; ++seed) {
    std::mt19937_64 rng(seed);
    const auto uniform = [&](double a, double b) { return std::uniform_real_distribution(a, b)(rng); };
    const int cameras = std::uniform_int_distribution(1, 5)(rng);
    struct Arrival {
      double at;
      Frame frame;
    };
    std::vector<Arrival> arrivals;
    for (int camera = 0; camera < cameras; ++camera) {
      const double period = uniform(0.008, 0.07);
      const double latency = uniform(0, 0.1);
      const double stops_at = uniform(0, 6);
      for (double t = uniform(0, 0.1); t < 4; t += period) {
        if (uniform(0, 1) < 0.1 || (t > stops_at && t < stops_at + 1)) continue;
        double stamp = t + uniform(-0.1, 0.1) * period;
        if (uniform(0, 1) < 0.005) stamp += uniform(-20, 20);
        const auto status = uniform(0, 1) < 0.05 ? FrameStatus::corrupted : FrameStatus::ok;
        const int copies = uniform(0, 1) < 0.03 ? 2 : 1;
        for (int i = 0; i < copies; ++i)
          arrivals.push_back({t + latency * uniform(0.5, 1), frame(camera, duration_of(stamp), status)});
      }
    }
    std::ranges::stable_sort(arrivals, {}, &Arrival::at);

    const Duration tolerance = duration_of(uniform(0.001, 0.05));
    FrameSynchronizer sync({.camera_count = cameras, .tolerance = tolerance});
    std::uint64_t in_sets = 0;
    std::uint64_t set_count = 0;
    std::optional<Timestamp> before;
    const auto take = [&](const FrameSet& set) {
      EXPECT_EQ(set.number, set_count++);
      ASSERT_EQ(set.frames.size(), static_cast<std::size_t>(cameras));
      Timestamp oldest = Timestamp::max();
      Timestamp newest = Timestamp::min();
      for (std::size_t i = 0; i < set.frames.size(); ++i) {
        if (!set.frames[i]) continue;
        ++in_sets;
        EXPECT_EQ(set.frames[i]->camera, static_cast<int>(i));
        EXPECT_EQ(set.frames[i]->status, FrameStatus::ok);
        oldest = std::min(oldest, set.frames[i]->captured_at);
        newest = std::max(newest, set.frames[i]->captured_at);
      }
      ASSERT_LE(oldest, newest) << "an empty set";
      EXPECT_EQ(set.at, newest);
      EXPECT_LE(newest - oldest, tolerance);
      EXPECT_TRUE(!before || set.at > *before) << "seed " << seed;
      before = set.at;
    };
    for (auto& arrival : arrivals) {
      const auto jumps = sync.counters().clock_jumps;
      const auto sets = sync.push(arrival.frame);
      const bool has_jumped = sync.counters().clock_jumps > jumps;  // time restarts somewhere in these sets, or after
      for (const auto& set : sets) {
        if (has_jumped) before.reset();
        take(set);
      }
      if (has_jumped) before.reset();
    }
    while (const auto set = sync.flush()) take(*set);
    const auto& c = sync.counters();
    EXPECT_EQ(c.sets, set_count);
    EXPECT_EQ(in_sets + c.late_frames + c.early_frames + c.duplicate_frames + c.corrupted_frames, arrivals.size())
        << "seed " << seed;
    EXPECT_GT(in_sets, arrivals.size() / 2) << "seed " << seed;
  }
}

// In the order of capture no frame is late as long as no camera stops, and no two frames have the same time.
TEST(FrameSynchronizer, FramesInTimeOrderAreNeverLate) {
  for (unsigned seed = 0; seed < 100; ++seed) {
    std::mt19937_64 rng(seed);
    std::vector<Frame> frames;
    for (int camera = 0; camera < 3; ++camera)
      for (int t = static_cast<int>(rng() % 40); t < 3000; t += 10 + static_cast<int>(rng() % 30))
        frames.push_back(frame(camera, t * 1ms + camera * 1us));  // a frame of the same time as a set would be
    std::ranges::stable_sort(frames, {}, &Frame::captured_at);
    FrameSynchronizer sync({.camera_count = 3, .tolerance = 12ms});
    std::uint64_t views = 0;
    const auto count = [&](const FrameSet& set) {
      views +=
          static_cast<std::uint64_t>(std::ranges::count_if(set.frames, [](const auto& f) { return f.has_value(); }));
    };
    for (const auto& f : frames)
      for (const auto& set : sync.push(f)) count(set);
    while (const auto set = sync.flush()) count(*set);
    EXPECT_EQ(views, frames.size());
    EXPECT_EQ(sync.counters().late_frames, 0u);
  }
}

TEST(FrameSynchronizer, AscendingReturningCameraIsNotLate) {
  Sync sync(2, 17ms, true);
  for (int t = 0; t < 100; t += 33) sync.push(0, t), sync.push(1, t);
  for (int t = 132; t < 462; t += 33) sync.push(0, t);  // camera 1 loses ten frames
  EXPECT_THAT(sync.push(0, 462), ElementsAre(Views{{0, 429}}));
  EXPECT_THAT(sync.push(1, 462), ElementsAre(Views{{0, 462}, {1, 462}}));
  EXPECT_EQ(sync.counters().incomplete_sets, 10u);
  EXPECT_EQ(sync.counters().late_frames, 0u);
}

TEST(FrameSynchronizer, AscendingSetStaysOpenWhileAFrameOfItsTimeMayCome) {
  Sync sync(2, 17ms, true);
  sync.push(1, 0);
  EXPECT_THAT(sync.push(0, 5), IsEmpty());
  EXPECT_THAT(sync.push(1, 5), ElementsAre(Views{{1, 0}}, Views{{0, 5}, {1, 5}}));
  sync.push(0, 38);
  EXPECT_THAT(sync.push(1, 50), IsEmpty());
  EXPECT_THAT(sync.push(0, 71), ElementsAre(Views{{0, 38}, {1, 50}}));
  EXPECT_EQ(sync.counters().late_frames, 0u);
}

TEST(FrameSynchronizer, AscendingPauseNeedsNoConfirmation) {
  Sync sync(2, 17ms, true);
  sync.push(0, 0);
  EXPECT_THAT(sync.push(1, 60'000), ElementsAre(Views{{0, 0}}));
  EXPECT_THAT(sync.push(0, 120'000), ElementsAre(Views{{1, 60'000}}));
  EXPECT_THAT(sync.flush_all(), ElementsAre(Views{{0, 120'000}}));
}

// Merged by capture time, as a replay gives them, every frame gets into one set, whatever is missing.
TEST(FrameSynchronizer, AscendingFramesAreNeverLate) {
  for (unsigned seed = 0; seed < 300; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 rng(seed);
    const auto integer = [&](int a, int b) { return std::uniform_int_distribution(a, b)(rng); };
    const int cameras = integer(1, 5);
    const bool same_rate = integer(0, 1) == 1;
    const bool same_phase = integer(0, 1) == 1;  // whole milliseconds: equal times are frequent
    const bool jitters = integer(0, 3) == 0;
    std::vector<Frame> frames;
    for (int camera = 0; camera < cameras; ++camera) {
      const int period = same_rate ? 20 : 10 * integer(1, 6);
      int gap_ends = -1;
      for (int t = same_phase ? 0 : integer(0, 40); t < 4000; t += jitters ? integer(1, 2 * period) : period) {
        if (integer(0, 40) == 0) gap_ends = t + integer(1, 1500);
        if (t >= gap_ends) frames.push_back(frame(camera, t * 1ms));
      }
    }
    std::ranges::stable_sort(frames, {}, &Frame::captured_at);

    const Duration tolerance = integer(1, 50) * 1ms;
    FrameSynchronizer sync({.camera_count = cameras, .tolerance = tolerance, .ascending_input = true});
    std::set<std::pair<int, Timestamp>> in_sets;
    std::optional<Timestamp> before;
    const auto take = [&](const FrameSet& set) {
      EXPECT_TRUE(!before || set.at > *before);
      before = set.at;
      for (const auto& f : set.frames) {
        if (!f) continue;
        EXPECT_LE(set.at - f->captured_at, tolerance);
        EXPECT_TRUE(in_sets.emplace(f->camera, f->captured_at).second) << "in two sets";
      }
    };
    for (const auto& f : frames)
      for (const auto& set : sync.push(f)) take(set);
    while (const auto set = sync.flush()) take(*set);
    EXPECT_EQ(in_sets.size(), frames.size());
    const auto& c = sync.counters();
    EXPECT_EQ(c.late_frames + c.early_frames + c.duplicate_frames + c.clock_jumps, 0u);
  }
}

}  // namespace
}  // namespace huetrack::capture
