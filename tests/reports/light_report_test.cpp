// Findings about pictures are warnings live, and only part of the summary in a replay.
#include "reports/light_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <spdlog/sinks/ostream_sink.h>
#include <spdlog/spdlog.h>

#include <cmath>
#include <memory>
#include <sstream>

#include "capture/frames/pixel_format.h"
#include "reports/light_words.h"

namespace huetrack::reports {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::EndsWith;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::StartsWith;

// A picture whose brightness swings slowly, as by an automatic exposure.
void show(LightReport& report, int camera = 0) {
  for (int k = 0; k < 300; ++k) {
    capture::WritableImage image = capture::make_image(capture::PixelFormat::grey, capture::ColorRange::full, 64, 48);
    const double seconds = k / 30.0;
    for (int i = 0; i < 64 * 48; ++i)
      image.data[0][i] = std::uint8_t(std::lround((80.0 + i % 50) * (1 + 0.2 * std::sin(2 * seconds))));
    capture::Frame frame;
    frame.camera = camera;
    frame.captured_at = capture::Timestamp(capture::duration_of(100 + seconds));
    frame.pixels = image.image;
    report.on_frame(frame, frame.captured_at);
  }
}

TEST(LightReport, WarnsOnlyWhereACameraCanBeAdjusted) {
  config::ServiceConfig config;
  config.rig.cameras.resize(1);
  config.rig.cameras[0].name = "left";
  LightReport live(config, false), recorded(config, true);
  show(live);
  show(recorded);
  EXPECT_THAT(live.warnings(), ElementsAre(HasSubstr("camera left: the whole picture becomes")));
  EXPECT_THAT(recorded.warnings(), IsEmpty());
  EXPECT_EQ(recorded.summary(), live.summary());
  EXPECT_THAT(recorded.summary(), ElementsAre(HasSubstr("automatic exposure or changing light in left")));
}

TEST(LightReport, EachKindIsLoggedForTheFirstCameraOnly) {
  config::ServiceConfig config;
  config.rig.cameras.resize(2);
  config.rig.cameras[0].name = "left", config.rig.cameras[1].name = "right";
  std::ostringstream log;
  const auto before = spdlog::default_logger();
  spdlog::set_default_logger(
      std::make_shared<spdlog::logger>("test", std::make_shared<spdlog::sinks::ostream_sink_st>(log)));
  LightReport report(config, false);
  for (const int camera : {0, 1}) show(report, camera);
  spdlog::set_default_logger(before);
  EXPECT_THAT(log.str(), AllOf(HasSubstr("camera left: the whole picture becomes"), Not(HasSubstr("camera right"))));
  EXPECT_THAT(report.warnings(), ElementsAre(HasSubstr("camera left:"), HasSubstr("camera right:")));
  EXPECT_THAT(report.summary(), ElementsAre(HasSubstr("in left, right")));
}

// The configuration refuses `controls` for a network camera.
TEST(LightReport, ANetworkCameraIsSetInItsOwnProgram) {
  config::ServiceConfig config;
  config.rig.cameras.resize(1);
  config.rig.cameras[0].name = "left";
  config.cameras.resize(1);
  config.cameras[0].name = "left";
  config.cameras[0].device = "/dev/video0";
  LightReport local(config, false);
  config.cameras[0].device = "http://127.0.0.1:8740/";
  LightReport network(config, false);
  show(local);
  show(network);
  EXPECT_THAT(local.warnings(), ElementsAre(HasSubstr("set controls: {auto_exposure: 1")));
  EXPECT_THAT(network.warnings(), ElementsAre(AllOf(HasSubstr("set exposure and gain to manual in the camera's own"),
                                                    Not(HasSubstr("controls:")))));
}

TEST(LightReport, EveryAdviceIsForTheKindOfCamera) {
  for (const double hz : {100.0, 120.0}) {
    capture::LightFindings findings;
    findings.flicker = {.light_hz = hz, .modulation = 0.1};
    findings.exposure_change = findings.balance_change = 0.2;
    const std::vector<Remark> local = light_remarks(findings), network = light_remarks(findings, false);
    ASSERT_EQ(local.size(), 3u);
    ASSERT_EQ(network.size(), 3u);
    for (std::size_t i = 0; i < 3; ++i) {
      EXPECT_THAT(local[i].advice, StartsWith("controls: {"));
      EXPECT_THAT(network[i].advice, EndsWith("in the camera's own program"));
      EXPECT_EQ(local[i].brief, network[i].brief);
    }
  }
}

}  // namespace
}  // namespace huetrack::reports
