#include "pipeline/session.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <stdexcept>

namespace huetrack::pipeline {
namespace {

using namespace std::chrono_literals;
using testing::ElementsAre;

constexpr int sets = 5;
constexpr capture::Duration period = 33ms;

// Grey frames of both cameras of the demo's rig.
class TwoGreyCameras final : public capture::FrameSource {
 public:
  std::optional<capture::Frame> next(std::stop_token stop) override {
    if (stop.stop_requested() || made_ == 2 * sets) return std::nullopt;
    capture::Frame frame;
    frame.camera = made_ % 2;
    frame.sequence = std::uint32_t(made_ / 2);
    frame.captured_at = capture::Timestamp(made_ / 2 * period);
    frame.pixels = capture::make_image(capture::PixelFormat::grey, capture::ColorRange::full, 320, 240).image;
    ++made_;
    return frame;
  }

 private:
  int made_ = 0;
};

struct NotingOutput final : Output {
  void on_set(const TrackedSet& set) override {
    reloaded.push_back(set.reloaded.size());
    if (fails) throw std::runtime_error("the disk is full");
  }
  void on_config(const config::ServiceConfig& config) noexcept override { radius_m = config.targets.at(1).radius_m; }
  void flush() override {
    is_flushed = true;
    if (fails) throw std::runtime_error("and full it stays");
  }

  bool fails = false, is_flushed = false;
  double radius_m = 0;
  std::vector<std::size_t> reloaded;  // per set
};

class SessionOfTheDemo : public testing::Test {
 protected:
  SessionOfTheDemo() {
    config_.targets.push_back(config_.targets.at(0));
    config_.targets.back().name = "other";
    config_.set_tolerance_s.reset();
  }
  Session session(SessionOptions options = {}) const {
    SessionSources sources;
    sources.sources.push_back(std::make_unique<TwoGreyCameras>());
    sources.is_ascending = true;
    sources.cameras = [] {
      return std::vector<SessionCamera>{{.camera = 0, .period = period}, {.camera = 1, .period = period}};
    };
    return Session(config_, std::move(sources), std::move(options));
  }
  config::ServiceConfig config_ =
      config::load_service_config(std::filesystem::path(HUETRACK_SOURCE_DIR) / "configs/demo/huetrackd.yaml");
};

TEST_F(SessionOfTheDemo, TheToleranceIsThatOfTheCameras) {
  const std::vector<capture::Duration> periods{period, period};
  EXPECT_EQ(session().config().set_tolerance_s, capture::seconds(capture::suggested_tolerance(periods)));
  config_.set_tolerance_s = 0.02;
  EXPECT_EQ(session().config().set_tolerance_s, 0.02);
}

TEST_F(SessionOfTheDemo, AReloadReplacesTrackersOfChangedTargetsAndListsWaitingKeys) {
  Session session = this->session();
  NotingOutput output;
  session.add(output);
  config::ServiceConfig fresh = config_;
  fresh.targets[1].radius_m = 0.05;
  fresh.threads = 7;
  const Session::TakenOver result = session.take_over(fresh);
  EXPECT_THAT(result.searched_anew, ElementsAre("other"));
  EXPECT_THAT(result.waiting, ElementsAre("threads"));
  EXPECT_EQ(output.radius_m, 0.05);
  EXPECT_EQ(session.config().threads, config_.threads);
  EXPECT_THAT(session.take_over(fresh).searched_anew, testing::IsEmpty());
  session.run({});
  EXPECT_THAT(output.reloaded, ElementsAre(1, 0, 0, 0, 0));
}

// A replay repeats recorded reloads; back to the first configuration is then a change.
TEST_F(SessionOfTheDemo, AReloadIsComparedWithRecordedReloads) {
  const std::filesystem::path folder = testing::TempDir() + "session_test.repeats";
  std::filesystem::create_directories(folder);
  config::ServiceConfig recorded = config_;
  recorded.targets[1].radius_m = 0.05;
  std::ofstream(folder / "reload.yaml") << config::to_yaml(recorded);
  SessionOptions options;
  options.repeats.reloads.push_back({capture::Timestamp(period), folder / "reload.yaml"});
  Session session = this->session(std::move(options));
  EXPECT_THAT(session.take_over(config_).searched_anew, ElementsAre("other"));
  std::filesystem::remove_all(folder);
}

TEST_F(SessionOfTheDemo, OtherTargetsAreRefused) {
  Session session = this->session();
  config::ServiceConfig fresh = config_;
  fresh.targets.pop_back();
  fresh.targets[0].radius_m = 0.05;
  EXPECT_THROW(session.take_over(fresh), std::runtime_error);
  EXPECT_EQ(session.config().targets.size(), 2u);
  EXPECT_EQ(session.config().targets[0].radius_m, config_.targets[0].radius_m);
}

TEST_F(SessionOfTheDemo, AnotherCountIsRefused) {
  Session session = this->session();
  config::ServiceConfig fresh = config_;
  fresh.targets[0].count = 3;
  EXPECT_THROW(session.take_over(fresh), std::runtime_error);
  EXPECT_EQ(session.config().targets[0].count, 1);
}

TEST_F(SessionOfTheDemo, EveryOutputIsFlushedAndTheFirstErrorIsThrown) {
  Session session = this->session();
  NotingOutput failing, other;
  failing.fails = true;
  session.add(failing);
  session.add(other);
  EXPECT_THAT([&] { session.run({}); }, testing::ThrowsMessage<std::runtime_error>("the disk is full"));
  EXPECT_TRUE(failing.is_flushed && other.is_flushed);
}

}  // namespace
}  // namespace huetrack::pipeline
