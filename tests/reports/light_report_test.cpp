// Findings about pictures are warnings live, and only part of the summary in a replay.
#include "reports/light_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "capture/frames/pixel_format.h"

namespace huetrack::reports {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

// A picture whose brightness swings slowly, as by an automatic exposure.
void show(LightReport& report) {
  for (int k = 0; k < 300; ++k) {
    capture::WritableImage image = capture::make_image(capture::PixelFormat::grey, capture::ColorRange::full, 64, 48);
    const double seconds = k / 30.0;
    for (int i = 0; i < 64 * 48; ++i)
      image.data[0][i] = std::uint8_t(std::lround((80.0 + i % 50) * (1 + 0.2 * std::sin(2 * seconds))));
    capture::Frame frame;
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

}  // namespace
}  // namespace huetrack::reports
