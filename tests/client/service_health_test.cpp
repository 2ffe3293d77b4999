#include "huetrack/service_health.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

namespace huetrack::client {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr std::int64_t now = 1'700'000'000'000'000'000;

msg::ServiceStatus status(const std::string& mode, std::vector<msg::CameraHealth> healths) {
  msg::ServiceStatus s;
  s.host("pi");
  s.mode(mode);
  s.at(now - 900'000'000);
  for (const msg::CameraHealth health : healths) {
    msg::CameraStatus camera;
    camera.name("cam" + std::to_string(s.cameras().size()));
    camera.health(health);
    s.cameras().push_back(camera);
  }
  return s;
}

TEST(ServiceHealth, CameraHealthDependsOnTheMode) {
  EXPECT_THAT(problems_of(status("run", {msg::CAMERA_HEALTH_DELIVERING, msg::CAMERA_HEALTH_DELIVERING}), now),
              IsEmpty());
  EXPECT_THAT(problems_of(status("run", {msg::CAMERA_HEALTH_DELIVERING, msg::CAMERA_HEALTH_STALLED}), now),
              ElementsAre("camera cam1: stalled"));
  EXPECT_THAT(problems_of(status("run", {msg::CAMERA_HEALTH_ENDED}), now), ElementsAre("camera cam0: ended"));
  EXPECT_THAT(problems_of(status("replay", {msg::CAMERA_HEALTH_ENDED}), now), IsEmpty());
  for (const auto health : {msg::CAMERA_HEALTH_WAITING, msg::CAMERA_HEALTH_STALLED})
    EXPECT_THAT(problems_of(status("held", {health}), now), IsEmpty());
  EXPECT_THAT(problems_of(status("replay", {msg::CAMERA_HEALTH_WAITING}), now), ElementsAre("camera cam0: waiting"));
}

TEST(ServiceHealth, WarningsAndAnOldStatusAreProblems) {
  msg::ServiceStatus s = status("run", {});
  s.warnings({"the light is \"low\""});
  s.at(now - 11'000'000'000);
  EXPECT_THAT(problems_of(s, now), ElementsAre("the light is \"low\"", HasSubstr("11 s old")));
}

TEST(ServiceHealth, ClocksOfHostsAsJson) {
  msg::HostClocks clocks;
  clocks.clocks().resize(1);
  clocks.clocks()[0].host("pi-3"), clocks.clocks()[0].cameras({"left", "right"});
  clocks.clocks()[0].is_known(true), clocks.clocks()[0].offset_sigma_s(52e-6), clocks.clocks()[0].drift(5e-5);
  clocks.clocks()[0].kept_s(std::nan(""));
  const auto json = nlohmann::json::parse(status_json(status("run", {}), now, nullptr, {}, &clocks));
  const auto& clock = json.at("clocks").at("clocks").at(0);
  EXPECT_EQ(clock.at("host"), "pi-3");
  EXPECT_EQ(clock.at("cameras").at(1), "right");
  EXPECT_EQ(clock.at("sigma_s"), 52e-6);
  EXPECT_NEAR(clock.at("drift_ppm"), 50, 1e-9);
  EXPECT_TRUE(clock.at("kept_s").is_null());
  EXPECT_TRUE(nlohmann::json::parse(status_json(status("run", {}), now, nullptr, {})).at("clocks").is_null());
  EXPECT_TRUE(nlohmann::json::parse(no_status_json("nobody")).at("clocks").is_null());
}

TEST(ServiceHealth, AsJson) {
  msg::ServiceStatus s = status("run", {msg::CAMERA_HEALTH_ABSENT});
  s.cameras()[0].message("unplugged: \\ plug it in");
  msg::CameraPose mine, other;
  mine.camera("cam0");
  other.camera("cam7");
  const std::string line = status_json(s, now, nullptr, std::vector{mine, other});
  EXPECT_EQ(line.back(), '\n');
  EXPECT_EQ(line.find('\n'), line.size() - 1);
  const auto json = nlohmann::json::parse(line);
  EXPECT_EQ(json.at("version"), 1);
  EXPECT_EQ(json.at("healthy"), false);
  EXPECT_EQ(json.at("problems").at(0), "camera cam0: absent: unplugged: \\ plug it in");
  EXPECT_EQ(json.at("status").at("cameras").at(0).at("health"), "absent");
  EXPECT_TRUE(json.at("times").is_null());
  EXPECT_EQ(json.at("poses").size(), 1U);
  EXPECT_EQ(nlohmann::json::parse(status_json(status("run", {}), now, nullptr, {})).at("healthy"), true);
  EXPECT_EQ(nlohmann::json::parse(no_status_json("nobody")).at("problems").at(0), "nobody");
}

}  // namespace
}  // namespace huetrack::client
