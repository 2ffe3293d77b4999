#include "reports/object_report.h"

#include <gmock/gmock.h>

#include "scene/lime.h"

namespace huetrack::reports {
namespace {

// A frame set without pictures.
void show(ObjectReport& report, const std::vector<object_tracking::ObjectEstimate>& estimates,
          const std::vector<std::vector<view_watch::Mistake>>& mistakes) {
  const capture::FrameSet frames;
  report.on_set({.frames = frames,
                 .estimates = estimates,
                 .received_at = {},
                 .trackers = {},
                 .calibration = {},
                 .mistakes = mistakes});
}

using testing::AllOf;
using testing::HasSubstr;

TEST(ExtraObjectText, NamesPlaceAndRemedy) {
  object_tracking::TargetOptions target;
  target.name = "orange";
  EXPECT_THAT(extra_object_text(target, {0.31, 0.12, 1.1}),
              AllOf(HasSubstr("orange: something else has its colour and its size, at 0.31, 0.12, 1.10 m"),
                    HasSubstr("set count to the number of balls")));
  target.count = 3;
  EXPECT_THAT(extra_object_text(target, {0.31, 0.12, 1.1}),
              AllOf(HasSubstr("more objects than the 3 of its count"), HasSubstr("raise count")));
}

// As the summary of a replay does, the live status hints at a hue in OpenCV's units.
TEST(ObjectReport, WarnsOfATargetWhoseSigmaExceedsItsRadius) {
  config::ServiceConfig config;
  config.rig = scene::lime_that_flies().rig;
  config.targets = {scene::lime()};
  config.targets[0].color.hue_min_deg = 33, config.targets[0].color.hue_max_deg = 57;
  ObjectReport report(config);
  const auto see = [&](int sets, double sigma_m, std::vector<view_watch::Mistake> of_target = {}) {
    const std::vector<std::vector<view_watch::Mistake>> mistakes{std::move(of_target)};
    object_tracking::ObjectEstimate estimate;
    estimate.state = object_tracking::TrackState::tracking;
    estimate.covariance = sigma_m * sigma_m * Eigen::Matrix3d::Identity();
    for (int k = 0; k < sets; ++k) {
      const std::vector<object_tracking::ObjectEstimate> estimates{estimate};
      show(report, estimates, mistakes);
    }
  };
  see(150, 0.005);
  EXPECT_THAT(report.warnings(), testing::IsEmpty());
  see(301, 0.2);
  EXPECT_THAT(report.warnings(), testing::ElementsAre(AllOf(HasSubstr("lime: its sigma was above its radius"),
                                                            HasSubstr("from OpenCV"), HasSubstr("write [66, 114]"))));
  EXPECT_THAT(report.summary(), testing::IsEmpty());
  see(120, 0.005);  // what was long ago does not count
  EXPECT_THAT(report.warnings(), testing::IsEmpty());
  see(120, 0.2);
  EXPECT_THAT(report.warnings(), testing::SizeIs(1));
  see(1, 0.2, {{.kind = view_watch::MistakeKind::radius}});
  EXPECT_THAT(report.warnings(), testing::SizeIs(1));
  see(1, 0.2, {{.kind = view_watch::MistakeKind::late}});  // explains the sigma
  EXPECT_THAT(report.warnings(), testing::IsEmpty());
  see(120, 0.2);
  EXPECT_THAT(report.warnings(), testing::SizeIs(1));
  config.targets[0].color.hue_min_deg = 66, config.targets[0].color.hue_max_deg = 114;
  report.on_config(config);
  EXPECT_THAT(report.warnings(), testing::IsEmpty());
}

TEST(ObjectReport, NamesTwoTargetsOnOneObject) {
  config::ServiceConfig config;
  config.rig = scene::lime_that_flies().rig;
  config.targets = {scene::lime(), scene::lime()};
  config.targets[1].name = "green";
  ObjectReport report(config);
  const auto see = [&](int sets, double apart_m) {
    std::vector<object_tracking::ObjectEstimate> estimates(2);
    for (auto& estimate : estimates) estimate.state = object_tracking::TrackState::tracking;
    estimates[0].position = {0, 0, 1}, estimates[1].position = {apart_m, 0, 1};
    estimates[1].target = 1;
    for (int k = 0; k < sets; ++k) {
      show(report, estimates, {});
    }
  };
  const double radius_m = config.targets[0].radius_m;
  for (int k = 0; k < 5; ++k) see(30, 0.5 * radius_m), see(1, 2 * radius_m);  // they pass one another
  EXPECT_THAT(report.warnings(), testing::IsEmpty());
  see(100, 0.5 * radius_m);
  const auto is_named = testing::ElementsAre(HasSubstr("lime and green are tracked at the same place: one object"));
  EXPECT_THAT(report.warnings(), is_named);
  see(1, 2 * radius_m);
  EXPECT_THAT(report.warnings(), testing::IsEmpty());
  EXPECT_THAT(report.summary(), is_named);
}

}  // namespace
}  // namespace huetrack::reports
