#include "huetrack/sample_format.h"

#include <gtest/gtest.h>
#include <stdlib.h>

#include <algorithm>
#include <array>
#include <limits>

#include "idl/names.h"

namespace huetrack::client {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

msg::ObjectPosition tracking() {
  msg::ObjectPosition s;
  s.target("ball");
  s.captured_at(1'700'000'000'000'000'042);
  s.received_at(1'700'000'000'010'000'000);
  s.published_at(1'700'000'000'012'300'042);
  s.set_number(18'000'000'000'000'000'000ULL);
  s.state(msg::TRACK_STATE_TRACKING);
  s.position({0.1, -1.25, 1e-7});
  s.velocity({1, 2.5, -3});
  s.covariance({1e-6, 0.5, 0.25, 0.5, 4e-6, 0.125, 0.25, 0.125, 9e-6});
  s.map_position({0.1, -1.3, 0});
  s.views(2);
  s.confidence(0.975);
  s.particle_count(200);
  s.effective_sample_size(99.5);
  msg::ViewSupport left;
  left.camera("le\"ft\n");
  left.delivered(true);
  left.in_view(true);
  left.seen(true);
  left.pixel({1.5F, 2.25F});
  left.radius_px(3);
  left.support(0.5F);
  left.residual_px(0.1F);
  s.per_view({left, msg::ViewSupport{}});
  return s;
}

msg::ObjectPosition lost() {
  msg::ObjectPosition s = tracking();
  s.state(msg::TRACK_STATE_LOST);
  s.position({nan, -nan, nan});  // whatever the sign bit
  s.velocity({nan, nan, nan});
  s.covariance({nan, nan, nan, nan, nan, nan, nan, nan, nan});
  s.map_position({nan, nan, nan});
  s.per_view({});
  return s;
}

constexpr std::int64_t received_at = 1'700'000'000'012'550'042;

TEST(SampleFormat, CsvMatchesTheReplays) {
  EXPECT_EQ(header(Format::csv), "target,t,x,y,z,vx,vy,vz,cxx,cxy,cxz,cyy,cyz,czz,state,views,confidence\n");
  EXPECT_EQ(line(Format::csv, tracking(), received_at, 0),
            "ball,1700000000.000000042,0.1,-1.25,1e-07,1,2.5,-3,1e-06,0.5,0.25,4e-06,0.125,9e-06,tracking,2,0.975\n");
  EXPECT_EQ(line(Format::csv, lost(), received_at, 0),
            "ball,1700000000.000000042,nan,nan,nan,nan,nan,nan,nan,nan,nan,nan,nan,nan,lost,2,0.975\n");
}

TEST(SampleFormat, TimesBefore1970) {
  msg::ObjectPosition s = tracking();
  s.captured_at(-1'500'000'000);
  EXPECT_EQ(line(Format::tum, s, 0, 0), "-1.500000000 0.1 -1.25 1e-07 0 0 0 1\n");
}

TEST(SampleFormat, TumSkipsSamplesWithoutAPosition) {
  EXPECT_EQ(header(Format::tum), "");
  EXPECT_EQ(line(Format::tum, tracking(), received_at, 0), "1700000000.000000042 0.1 -1.25 1e-07 0 0 0 1\n");
  EXPECT_EQ(line(Format::tum, lost(), received_at, 0), "");
}

TEST(SampleFormat, JsonHasAllFieldsAndNullForNan) {
  EXPECT_EQ(line(Format::json, tracking(), received_at, 0),
            R"({"target":"ball","t":1700000000.000000042,"captured_at":1700000000000000042,)"
            R"("received_at":1700000000010000000,"published_at":1700000000012300042,)"
            R"("set_number":18000000000000000000,"state":"tracking","position":[0.1,-1.25,1e-07],)"
            R"("velocity":[1,2.5,-3],"covariance":[1e-06,0.5,0.25,0.5,4e-06,0.125,0.25,0.125,9e-06],)"
            R"("map_position":[0.1,-1.3,0],"views":2,"confidence":0.975,"particle_count":200,)"
            R"("effective_sample_size":99.5,"per_view":[{"camera":"le\"ft\u000a","delivered":true,"in_view":true,)"
            R"("seen":true,"pixel":[1.5,2.25],"radius_px":3,"support":0.5,"residual_px":0.1},{"camera":"",)"
            R"("delivered":false,"in_view":false,"seen":false,"pixel":[0,0],"radius_px":0,"support":0,)"
            R"("residual_px":0}]})"
            "\n");
  const std::string without = line(Format::json, lost(), received_at, 0);
  EXPECT_NE(without.find(R"("position":[null,null,null],"velocity":[null,null,null])"), std::string::npos);
  EXPECT_EQ(without.find("nan"), std::string::npos);
}

TEST(SampleFormat, TextIsAlignedWithAndWithoutAPosition) {
  ::setenv("TZ", "UTC", 1);
  const std::string with = line(Format::text, tracking(), received_at, 6);
  EXPECT_EQ(with,
            "22:13:20.000  ball    tracking   x   0.1000  y  -1.2500  z   0.0000 m   sigma    1.0    2.0    3.0 mm   "
            "views 2/2   confidence 0.97   latency   12.3 + 0.25 ms\n");
  const std::string without = line(Format::text, lost(), received_at, 6);
  EXPECT_EQ(without,
            "22:13:20.000  ball    lost       x        -  y        -  z        - m   sigma      -      -      - mm   "
            "views 2/0   confidence 0.97   latency   12.3 + 0.25 ms\n");
  EXPECT_EQ(with.find("latency"), without.find("latency"));
}

msg::CameraPose pose(bool there) {
  msg::CameraPose s;
  s.camera("cam0");
  s.captured_at(1'700'000'000'000'000'042);
  s.published_at(1'700'000'000'012'300'042);
  s.frame_number(7);
  s.state(there ? msg::CAMERA_STATE_TRACKING : msg::CAMERA_STATE_SEARCHING);
  s.position(there ? std::array{0.5, -1.25, 2.0} : std::array{nan, nan, nan});
  s.orientation(there ? std::array{0.0, 0.5, -0.5, 0.25} : std::array{nan, nan, nan, nan});
  for (std::size_t i = 0; i < 36; ++i) s.covariance()[i] = there ? (i % 7 == 0 ? 3e-6 : 0.125) : nan;
  s.features_in_view(9);
  s.features_matched(8);
  s.confidence(0.875);
  return s;
}

TEST(SampleFormat, CameraPoses) {
  ::setenv("TZ", "UTC", 1);
  EXPECT_TRUE(camera_header(Format::csv).starts_with("camera,t,x,y,z,qx,qy,qz,qw,c11,c12,c13,c14,c15,c16,c22,"));
  EXPECT_TRUE(
      camera_header(Format::csv).ends_with(",c55,c56,c66,state,features_in_view,features_matched,confidence\n"));
  EXPECT_EQ(line(Format::tum, pose(true), 0, 0), "1700000000.000000042 0.5 -1.25 2 0 0.5 -0.5 0.25\n");
  EXPECT_EQ(line(Format::tum, pose(false), 0, 0), "");
  msg::CameraPose predicted = pose(true);
  predicted.state(msg::CAMERA_STATE_COASTING);
  EXPECT_EQ(line(Format::tum, predicted, 0, 0), "");
  EXPECT_NE(line(Format::csv, predicted, 0, 0).find(",coasting,"), std::string::npos);
  EXPECT_EQ(line(Format::csv, pose(true), 0, 0),
            "cam0,1700000000.000000042,0.5,-1.25,2,0,0.5,-0.5,0.25,3e-06,0.125,0.125,0.125,0.125,0.125,3e-06,0.125,0."
            "125,0.125,"
            "0.125,3e-06,0.125,0.125,0.125,3e-06,0.125,0.125,3e-06,0.125,3e-06,tracking,9,8,0.875\n");
  const std::string commas = camera_header(Format::csv), row = line(Format::csv, pose(true), 0, 0);
  EXPECT_EQ(std::ranges::count(commas, ','), std::ranges::count(row, ','));
  EXPECT_NE(line(Format::json, pose(false), 0, 0)
                .find(R"("state":"searching","position":[null,null,null],"orientation":[null,)"),
            std::string::npos);
  EXPECT_EQ(
      line(Format::text, pose(true), received_at, 5),
      "22:13:20.000  cam0   tracking   x   0.5000  y  -1.2500  z   2.0000 m   q  0.0000  0.5000 -0.5000  0.2500   "
      "sigma    3.0 mm  0.17 deg   features 8/9   latency   12.3 + 0.25 ms\n");
}

TEST(SampleFormat, TimesOfTwoClocksHaveNoLatency) {
  msg::CameraPose s = pose(true);
  s.captured_at(5'000'000'000);
  EXPECT_NE(line(Format::text, s, received_at, 5).find("latency      - + 0.25 ms"), std::string::npos);
}

TEST(SampleFormat, StatusOfATrackedCamera) {
  msg::ServiceStatus s;
  s.cameras().resize(1);
  s.cameras()[0].name("cam0");
  msg::CameraPose other = pose(true);
  other.camera("of_another_service");
  const std::vector<msg::CameraPose> poses{pose(false), other};
  const std::string out = text(s, 0, nullptr, poses);
  EXPECT_NE(out.find("  targets   none\n"), std::string::npos) << out;
  EXPECT_NE(out.find("  pose      cam0  searching   8 of 9 features, 0 map points\n"), std::string::npos) << out;
  EXPECT_EQ(out.find("of_another_service"), std::string::npos);
}

TEST(SampleFormat, StatusHasCameraTiming) {
  msg::ServiceStatus s;
  s.cameras().resize(2);
  s.cameras()[0].name("left"), s.cameras()[1].name("r");
  msg::CameraTimes times;
  times.cameras().resize(2);
  times.cameras()[0].camera("left"), times.cameras()[1].camera("r");
  times.cameras()[0].readout_s(0.0251), times.cameras()[0].readout_sigma_s(0.0012);
  times.cameras()[1].latency_s(-0.0117), times.cameras()[1].latency_sigma_s(0.0003);
  const std::string out = text(s, 0, &times);
  EXPECT_NE(out.find("  times     left  latency 0.0 ms (held), readout 25.1 ms +- 1.2\n"), std::string::npos) << out;
  EXPECT_NE(out.find("  times     r     latency -11.7 ms +- 0.3, readout 0.0 ms +- 0.0\n"), std::string::npos) << out;
}

TEST(SampleFormat, StatusHasHostClocks) {
  msg::HostClocks clocks;
  clocks.clocks().resize(4);
  for (msg::HostClock& clock : clocks.clocks()) clock.is_known(true), clock.kept_s(std::nan(""));
  msg::HostClock& ahead = clocks.clocks()[0];
  ahead.host("pi-3"), ahead.offset_s(0.0400132), ahead.offset_sigma_s(52e-6), ahead.drift(50.1e-6);
  ahead.round_trip_s(0.00021);
  msg::HostClock& kept = clocks.clocks()[1];
  kept.host("pi-4"), kept.offset_s(-0.0001), kept.kept_s(0.0003), kept.is_contradicted(true);
  clocks.clocks()[2].host("here"), clocks.clocks()[2].is_same_machine(true);
  clocks.clocks()[3].host("new"), clocks.clocks()[3].is_known(false);
  const std::string out = text(msg::ServiceStatus{}, 0, nullptr, {}, {}, &clocks);
  EXPECT_NE(
      out.find("  clock     pi-3: 40.013 ms ahead of ours +- 0.052, drifts by 50.1 ppm, answers within 0.21 ms; no "
               "NTP or PTP on both\n"),
      std::string::npos)
      << out;
  EXPECT_NE(out.find("pi-4: 0.100 ms behind ours"), std::string::npos) << out;
  EXPECT_NE(out.find("NTP or PTP: kept to 0.30 ms, which is not so\n"), std::string::npos) << out;
  EXPECT_NE(out.find("  clock     here: ours, it is this machine\n"), std::string::npos) << out;
  EXPECT_NE(out.find("  clock     new: not compared with ours yet\n"), std::string::npos) << out;
}

TEST(SampleFormat, CameraHost) {
  msg::CameraHost host;
  host.host("pi-3");
  host.program_version("0.1.0");
  msg::HostedCamera& left = host.cameras().emplace_back();
  left.name("left");
  left.state(msg::HOSTED_CAMERA_DELIVERING);
  left.width(640), left.height(480), left.fps(30), left.frames(123);
  msg::HostedCamera& right = host.cameras().emplace_back();
  right.name("right");
  right.state(msg::HOSTED_CAMERA_ABSENT);
  right.message("unplugged");
  EXPECT_EQ(text(host),
            "camera host pi-3, huetrackd 0.1.0\n"
            "  camera    left   delivering  640x480 at 30.0 Hz, 123 frames, 0 dropped, 0 corrupted\n"
            "  camera    right  absent      0 frames, 0 dropped, 0 corrupted: unplugged\n");
}

TEST(SampleFormat, StatusHasProblems) {
  msg::ServiceStatus s;
  s.host("lab");
  s.pid(42);
  s.at(1'700'000'000'000'000'000);
  s.program_version("0.1.0");
  s.mode("run");
  s.frame_id("world");
  s.config_file("a.yaml");
  s.config_identity("abc");
  s.rig_identity("def");
  s.rig_history("calibrated 6 days ago at 21.5 C; last checked 17 hours ago: usable");
  s.set_rate_hz(29.96);
  s.sets(100);
  s.dropped_sets(4);
  s.targets({"ball", "wand"});
  s.cameras().resize(1);
  s.cameras()[0].name("left");
  s.cameras()[0].health(msg::CAMERA_HEALTH_STALLED);
  s.cameras()[0].message("no frame for 3 s");
  s.cameras()[0].frames(7);
  s.cameras()[0].age_s(3);
  s.warnings({"too dark"});
  EXPECT_EQ(
      text(s, 1'700'000'000'500'000'000),
      "huetrackd 0.1.0 on lab, process 42, mode run, 0.5 s ago\n"
      "  config    a.yaml  identity abc\n"
      "  rig       identity def, world frame world; calibrated 6 days ago at 21.5 C; last checked 17 hours ago: "
      "usable\n"
      "  targets   ball, wand\n"
      "  tracking  30.0 frame sets per second; 100 sets, 0 of them incomplete, 4 dropped; 0 late frames\n"
      "  sent      0 samples, 0 failures\n"
      "  camera    left  stalled       0.0 Hz, 7 frames, 0 dropped, 0 corrupted, the last 3.00 s ago: no frame for "
      "3 s\n"
      "  warning   too dark\n");
  s.mode("held");
  EXPECT_NE(text(s, 1'700'000'000'500'000'000)
                .find("  camera    left  held          0.0 Hz, 7 frames, 0 dropped, 0 "
                      "corrupted, the last 3.00 s ago\n"),
            std::string::npos);
}

TEST(SampleFormat, StatusHasTheLatencyOfItsPositions) {
  msg::ServiceStatus s;
  s.targets({"ball"});
  std::vector<msg::ObjectPosition> positions(4);
  const std::string names[] = {"ball", "ball_2", "balloon", "ball"};
  for (std::size_t i = 0; i < positions.size(); ++i) {
    positions[i].target(names[i]);
    positions[i].received_at(1'700'000'000'000'000'000);
    positions[i].published_at(positions[i].received_at() +
                              std::int64_t{i == 2 ? 90 : static_cast<int>(i) + 2} * 1'000'000);
  }
  EXPECT_NE(text(s, 1, nullptr, {}, {}, nullptr, positions)
                .find("  latency   3.0 ms from the last byte of its pictures to a position, median of 3\n"),
            std::string::npos);
}

TEST(SampleFormat, UnknownStateNumbersHaveNoName) {
  EXPECT_EQ(idl::state_name(99), "unknown");
  EXPECT_EQ(idl::name(static_cast<msg::CameraHealth>(99)), "unknown");
}

}  // namespace
}  // namespace huetrack::client
