// A client of another DDS vendor (Cyclone DDS, the one under rmw_cyclonedds), built from the same IDL files, must see
// every field of every topic.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <sstream>

#include "idl/topics.h"
#include "publish/child_process.h"
#include "publish/known_samples.h"

namespace huetrack::publish {
namespace {

using namespace testing;
using namespace std::chrono_literals;

using Fields = std::map<std::string, std::string>;  // path -> value, as cyclone_subscriber prints them

std::string text(double value) {
  return std::isnan(value) ? "nan" : fmt::format("{:.17g}", value);
}

template <typename Values>
void add(Fields& to, const std::string& path, const Values& values) {
  int i = 0;
  for (const double value : values) to[fmt::format("{}[{}]", path, i++)] = text(value);
}

Fields expected_position(object_tracking::TrackState state) {
  const object_tracking::ObjectEstimate e = known_estimate(state);
  const std::string path = fmt::format("position/{}/", static_cast<int>(state));
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto value = [&](double v) { return e.has_position() ? v : nan; };
  Fields f;
  f[path + "target"] = "ball";
  f[path + "captured_at"] = std::to_string(captured_at(state).time_since_epoch().count());
  f[path + "received_at"] = std::to_string(received_at(state).time_since_epoch().count());
  f[path + "set_number"] = std::to_string(e.set_number);
  f[path + "state"] = std::to_string(static_cast<int>(state));
  std::vector<double> covariance;
  for (int i = 0; i < 9; ++i) covariance.push_back(value(e.covariance(i / 3, i % 3)));
  for (const auto& [name, v] :
       {std::pair("position", e.position), {"velocity", e.velocity}, {"map_position", e.map_position}})
    add(f, path + name, std::array{value(v.x()), value(v.y()), value(v.z())});
  add(f, path + "covariance", covariance);
  f[path + "views"] = std::to_string(e.views);
  f[path + "confidence"] = text(e.confidence);
  f[path + "particle_count"] = std::to_string(e.particle_count);
  f[path + "effective_sample_size"] = text(e.effective_sample_size);
  f[path + "per_view"] = std::to_string(e.per_view.size());
  for (std::size_t i = 0; i < e.per_view.size(); ++i) {
    const object_tracking::ViewSupport& view = e.per_view[i];
    const std::string p = fmt::format("{}per_view[{}].", path, i);
    f[p + "camera"] = known_options(0).cameras[i];
    f[p + "delivered"] = std::to_string(view.delivered);
    f[p + "in_view"] = std::to_string(view.in_view);
    f[p + "seen"] = std::to_string(view.seen);
    add(f, p + "pixel", std::array{static_cast<double>(view.px.x()), static_cast<double>(view.px.y())});
    f[p + "radius_px"] = text(static_cast<double>(view.radius_px));
    f[p + "support"] = text(static_cast<double>(view.support));
    f[p + "residual_px"] = text(static_cast<double>(view.residual_px));
  }
  return f;
}

Fields expected_status(pid_t publisher) {
  const ServiceStatus s = known_status();
  Fields f;
  f["status/host"] = idl::PublisherIdentity::of_this_process({}).host;
  f["status/pid"] = std::to_string(publisher);
  f["status/at"] = std::to_string(s.at.time_since_epoch().count());
  f["status/program_version"] = s.program_version;
  f["status/mode"] = s.mode;
  f["status/frame_id"] = "world";
  f["status/config_file"] = s.config_file;
  f["status/config_identity"] = s.config_identity;
  f["status/rig_identity"] = s.rig_identity;
  f["status/rig_history"] = s.rig_history;
  f["status/clock_offset_s"] = text(s.clock_offset_s);
  f["status/set_rate_hz"] = text(s.set_rate_hz);
  f["status/sets"] = std::to_string(s.sets);
  f["status/incomplete_sets"] = std::to_string(s.incomplete_sets);
  f["status/late_frames"] = std::to_string(s.late_frames);
  f["status/dropped_sets"] = std::to_string(s.dropped_sets);
  f["status/publish_failures"] = "0";
  f["status/cameras"] = std::to_string(s.cameras.size());
  for (std::size_t i = 0; i < s.cameras.size(); ++i) {
    const CameraStatus& camera = s.cameras[i];
    const std::string p = fmt::format("status/cameras[{}].", i);
    f[p + "name"] = camera.name;
    f[p + "health"] = std::to_string(static_cast<int>(camera.health));
    f[p + "message"] = camera.message;
    f[p + "frames"] = std::to_string(camera.frames);
    f[p + "dropped"] = std::to_string(camera.dropped);
    f[p + "corrupted"] = std::to_string(camera.corrupted);
    f[p + "rate_hz"] = text(camera.rate_hz);
    f[p + "age_s"] = text(camera.age_s);
  }
  f["status/targets"] = std::to_string(s.targets.size());
  for (std::size_t i = 0; i < s.targets.size(); ++i) f[fmt::format("status/targets[{}]", i)] = s.targets[i];
  f["status/warnings"] = std::to_string(s.warnings.size());
  for (std::size_t i = 0; i < s.warnings.size(); ++i) f[fmt::format("status/warnings[{}]", i)] = s.warnings[i];
  return f;
}

Fields expected_times(pid_t publisher) {
  Fields f;
  f["times/host"] = idl::PublisherIdentity::of_this_process({}).host;
  f["times/pid"] = std::to_string(publisher);
  f["times/at"] = std::to_string(known_status().at.time_since_epoch().count());
  const auto times = known_times();
  f["times/cameras"] = std::to_string(times.size());
  for (std::size_t c = 0; c < times.size(); ++c) {
    const std::string p = fmt::format("times/cameras[{}].", c);
    f[p + "camera"] = known_options(0).cameras[c];
    f[p + "latency_s"] = text(times[c].latency_s);
    f[p + "latency_sigma_s"] = text(times[c].latency_sigma_s);
    f[p + "readout_s"] = text(times[c].readout_s);
    f[p + "readout_sigma_s"] = text(times[c].readout_sigma_s);
  }
  return f;
}

// Of a target of several objects: the native sample with all of them, and what RViz and rosbag read.
Fields expected_set() {
  constexpr auto state = object_tracking::TrackState::tracking;
  const auto objects = known_objects();
  const auto ns = captured_at(state).time_since_epoch().count();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  Fields f;
  f["set/target"] = "wand";
  f["set/captured_at"] = std::to_string(ns);
  f["set/received_at"] = std::to_string(received_at(state).time_since_epoch().count());
  f["set/set_number"] = "3000";
  f["set/most"] = std::to_string(known_count);
  f["set/objects"] = std::to_string(objects.size());
  for (std::size_t i = 0; i < objects.size(); ++i) {
    const object_tracking::ObjectEstimate& e = objects[i];
    const std::string p = fmt::format("set/objects[{}].", i);
    const auto value = [&](double v) { return e.has_position() ? v : nan; };
    f[p + "name"] = fmt::format("wand_{}", e.object);
    f[p + "number"] = std::to_string(e.object);
    f[p + "state"] = std::to_string(static_cast<int>(e.state));
    f[p + "is_birth"] = std::to_string(e.is_birth);
    f[p + "is_end"] = std::to_string(e.is_end);
    for (const auto& [name, v] : {std::pair("position", e.position), {"velocity", e.velocity}})
      add(f, p + name, std::array{value(v.x()), value(v.y()), value(v.z())});
    std::vector<double> covariance;
    for (int k = 0; k < 9; ++k) covariance.push_back(value(e.covariance(k / 3, k % 3)));
    add(f, p + "covariance", covariance);
    f[p + "views"] = std::to_string(e.views);
    f[p + "confidence"] = text(e.confidence);
  }
  const std::string poses = fmt::format("poses/{}.{:09}/", ns / 1'000'000'000, ns % 1'000'000'000);
  const Eigen::Vector3d& at = objects[1].position;
  f[poses + "frame_id"] = "world";
  f[poses + "poses"] = "1";
  add(f, poses + "poses[0].position", std::array{at.x(), at.y(), at.z()});
  add(f, poses + "poses[0].orientation", std::array<double, 4>{0, 0, 0, 1});
  return f;
}

Fields expected_camera(camera_tracking::PoseState state) {
  const camera_tracking::CameraEstimate e = known_pose(state);
  const std::string path = fmt::format("camera/{}/", static_cast<int>(state));
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto value = [&](double v) { return e.has_pose() ? v : nan; };
  const auto ns = e.at.time_since_epoch().count();
  Fields f;
  f[path + "camera"] = "hand";
  f[path + "captured_at"] = std::to_string(ns);
  f[path + "received_at"] = std::to_string(ns + 3'000'000);
  f[path + "frame_number"] = std::to_string(e.frame_number);
  f[path + "state"] = std::to_string(static_cast<int>(state));
  const auto& t = e.world_from_camera.translation;
  const auto& q = e.world_from_camera.rotation;
  add(f, path + "position", std::array{value(t.x()), value(t.y()), value(t.z())});
  add(f, path + "orientation", std::array{value(q.x()), value(q.y()), value(q.z()), value(q.w())});
  std::vector<double> covariance;
  for (int i = 0; i < 36; ++i) covariance.push_back(value(e.covariance(i / 6, i % 6)));
  add(f, path + "covariance", covariance);
  f[path + "features_in_view"] = std::to_string(e.features_in_view);
  f[path + "features_matched"] = std::to_string(e.features_matched);
  f[path + "map_points"] = std::to_string(e.map_points);
  f[path + "confidence"] = text(e.confidence);
  f[path + "particle_count"] = std::to_string(e.particle_count);
  f[path + "effective_sample_size"] = text(e.effective_sample_size);
  if (!e.has_pose()) return f;  // and no ROS message
  const std::string stamp = fmt::format("{}.{:09}/", ns / 1'000'000'000, ns % 1'000'000'000);
  for (const auto& [topic, position, orientation] :
       {std::tuple{"pose/", "position", "orientation"}, {"tf/", "translation", "rotation"}}) {
    f[topic + stamp + "frame_id"] = "world";
    add(f, topic + stamp + position, std::array{t.x(), t.y(), t.z()});
    add(f, topic + stamp + orientation, std::array{q.x(), q.y(), q.z(), q.w()});
  }
  add(f, "pose/" + stamp + "covariance", covariance);
  f["tf/" + stamp + "transforms"] = "1";
  f["tf/" + stamp + "child_frame_id"] = "hand";
  return f;
}

Fields expected_ros(object_tracking::TrackState state) {
  const object_tracking::ObjectEstimate e = known_estimate(state);
  const auto ns = captured_at(state).time_since_epoch().count();
  const std::string stamp = fmt::format("{}.{:09}/", ns / 1'000'000'000, ns % 1'000'000'000);
  const std::array position{e.position.x(), e.position.y(), e.position.z()};
  const std::array<double, 4> identity{0, 0, 0, 1};
  Fields f;
  const std::string pose = "pose/" + stamp;
  f[pose + "frame_id"] = "world";
  add(f, pose + "position", position);
  add(f, pose + "orientation", identity);
  std::array<double, 36> covariance{};
  for (int row = 0; row < 3; ++row)
    for (int col = 0; col < 3; ++col) covariance[static_cast<std::size_t>(6 * row + col)] = e.covariance(row, col);
  for (const std::size_t diagonal : {21U, 28U, 35U}) covariance[diagonal] = 1e6;
  add(f, pose + "covariance", covariance);
  const std::string tf = "tf/" + stamp;
  f[tf + "frame_id"] = "world";
  f[tf + "transforms"] = "1";
  f[tf + "child_frame_id"] = "ball";
  add(f, tf + "translation", position);
  add(f, tf + "rotation", identity);
  return f;
}

// clients/c/positions.c, as its first lines say that it is used.
TEST(SecondVendor, TheExampleForCyclonePrintsPositions) {
#ifndef HUETRACK_CYCLONE_EXAMPLE
  GTEST_SKIP() << "Cyclone DDS is not installed (Debian: cyclonedds-dev cyclonedds-tools)";
#else
  const std::string domain = std::to_string(test_domain());
  ChildProcess publisher({HUETRACK_TEST_PUBLISHER, domain});
  ::setenv("ROS_DOMAIN_ID", domain.c_str(), 1);
  const ChildProcess example({HUETRACK_CYCLONE_EXAMPLE});
  ::unsetenv("ROS_DOMAIN_ID");
  EXPECT_TRUE(ChildProcess::wait(
      [&] {
        return example.out().find("ball 1.1250 -1.5000 2.1000 m\nball 2.1250 -1.5000 2.1000 m\n") != std::string::npos;
      },
      60s))
      << example.out() << example.err();
#endif
}

TEST(SecondVendor, CycloneSeesEveryFieldOfEveryTopic) {
#ifndef HUETRACK_CYCLONE_SUBSCRIBER
  GTEST_SKIP() << "Cyclone DDS is not installed (Debian: cyclonedds-dev cyclonedds-tools)";
#else
  const std::string domain = std::to_string(test_domain());
  ChildProcess publisher({HUETRACK_TEST_PUBLISHER, domain});
  ChildProcess subscriber({HUETRACK_CYCLONE_SUBSCRIBER, domain, "ball"});
  ASSERT_EQ(subscriber.exit_status(70s), 0) << subscriber.err();

  Fields got;
  std::istringstream lines(subscriber.out());
  for (std::string line; std::getline(lines, line);) {
    const std::size_t space = line.find(' ');
    ASSERT_NE(space, std::string::npos) << line;
    got[line.substr(0, space)] = line.substr(space + 1);
  }

  Fields expected = expected_status(publisher.pid());
  expected.merge(expected_times(publisher.pid()));
  expected.merge(expected_set());
  ASSERT_FALSE(got.extract("set/published_at").empty());
  for (const object_tracking::TrackState state : states) {
    expected.merge(expected_position(state));
    if (known_estimate(state).has_position()) expected.merge(expected_ros(state));
    // The one field whose value is not known beforehand.
    const auto published = got.extract(fmt::format("position/{}/published_at", static_cast<int>(state)));
    ASSERT_FALSE(published.empty());
    const auto now = std::chrono::system_clock::now().time_since_epoch() / 1ns;
    EXPECT_NEAR(std::stod(published.mapped()), static_cast<double>(now), 30e9);
  }
  for (const camera_tracking::PoseState state : camera_states) {
    expected.merge(expected_camera(state));
    const auto published = got.extract(fmt::format("camera/{}/published_at", static_cast<int>(state)));
    ASSERT_FALSE(published.empty());
    EXPECT_NEAR(std::stod(published.mapped()),
                static_cast<double>(std::chrono::system_clock::now().time_since_epoch() / 1ns), 30e9);
  }
  const auto count = got.extract("status/published");
  ASSERT_FALSE(count.empty());
  EXPECT_LT(std::stoul(count.mapped()), 1000U);
  expected["position/type"] = "huetrack::msg::ObjectPosition";
  expected["status/type"] = "huetrack::msg::ServiceStatus";
  expected["times/type"] = "huetrack::msg::CameraTimes";
  expected["set/type"] = "huetrack::msg::ObjectSet";
  expected["poses/type"] = "geometry_msgs::msg::dds_::PoseArray_";
  expected["pose/type"] = "geometry_msgs::msg::dds_::PoseWithCovarianceStamped_";
  expected["camera/type"] = "huetrack::msg::CameraPose";
  expected["camera_ros/type"] = expected["pose/type"];
  expected["tf/type"] = "tf2_msgs::msg::dds_::TFMessage_";
  idl::PublisherIdentity identity = idl::PublisherIdentity::of_this_process({"ball", "wand"});
  identity.pid = static_cast<std::uint32_t>(publisher.pid());
  expected["position/user_data"] = expected["status/user_data"] = expected["times/user_data"] =
      expected["set/user_data"] = identity.user_data();
  identity.targets = {"hand"};
  expected["camera/user_data"] = identity.user_data();
  // REP-2011 hashes as published; topics.h is not asked.
  expected["pose/user_data"] = "typehash=RIHS01_26432f9803e43727d3c8f668d1fdb3c630f548af631e2f4e31382371bfea3b6e;";
  expected["camera_ros/user_data"] = expected["pose/user_data"];
  expected["poses/user_data"] = "typehash=RIHS01_af0cc36d190e104d546d168d6b39df04fa4b4ccecf59cb4c9ed328d3d5004aa0;";
  expected["tf/user_data"] = "typehash=RIHS01_e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087;";

  // Both ways: nothing missing or different, and nothing more, so no ROS pose of searching or lost.
  for (const auto& [path, value] : expected) EXPECT_EQ(got.contains(path) ? got[path] : "(missing)", value) << path;
  for (const auto& [path, value] : got) EXPECT_TRUE(expected.contains(path)) << path << " = " << value;
#endif
}

}  // namespace
}  // namespace huetrack::publish
