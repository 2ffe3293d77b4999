#include "clients/live_view/events.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <nlohmann/json.hpp>

namespace huetrack::live_view {
namespace {

using namespace testing;
using Json = nlohmann::json;

TEST(Events, NanIsNull) {
  msg::ObjectPosition sample;
  sample.target("ball");
  sample.captured_at(1'700'000'000'250'000'000);
  sample.published_at(1'700'000'000'260'000'000);
  sample.received_at(1'700'000'000'258'000'000);
  sample.state(msg::TRACK_STATE_LOST);
  sample.position().fill(std::numeric_limits<double>::quiet_NaN());
  const Json json = Json::parse(to_json(sample));
  EXPECT_EQ(json["state"], "lost");
  EXPECT_TRUE(json["position"][0].is_null());
  EXPECT_DOUBLE_EQ(json["t"], 1'700'000'000.25);
  EXPECT_NEAR(json["latency"], 0.01, 1e-9);
  EXPECT_NEAR(json["tracking_latency"], 0.002, 1e-9);
}

TEST(Events, TrackedCameraHasPoseAndSigma) {
  msg::CameraPose pose;
  pose.camera("hand");
  pose.state(msg::CAMERA_STATE_COASTING);
  pose.position({1, 2, 3});
  pose.covariance()[14] = 0.25;
  pose.received_at(1'000'000'000);
  pose.published_at(1'003'000'000);
  pose.covariance()[0] = std::numeric_limits<double>::quiet_NaN();
  const Json json = Json::parse(to_json(pose));
  EXPECT_EQ(json["state"], "coasting");
  EXPECT_EQ(json["position"][2], 3);
  EXPECT_EQ(json["sigma"][2], 0.5);
  EXPECT_EQ(json["covariance"].size(), 36u);
  EXPECT_EQ(json["covariance"][14], 0.25);
  EXPECT_NEAR(json["tracking_latency"], 0.003, 1e-9);
  EXPECT_TRUE(json["sigma"][0].is_null());
}

TEST(Events, ListsTheMapsPoints) {
  msg::CameraMap map;
  map.camera("hand");
  map.captured_at(1'500'000'000);
  map.points().resize(1);
  map.points()[0].id(7);
  map.points()[0].position({1.00004f, 2, std::numeric_limits<float>::quiet_NaN()});
  map.points()[0].covariance({1e-6f, 0, 0, 4e-6f, 0, 9e-6f});
  map.points()[0].state(msg::CAMERA_MAP_POINT_MISSED);
  const Json json = Json::parse(to_json(map));
  EXPECT_EQ(json["camera"], "hand");
  EXPECT_EQ(json["t"], 1.5);
  const Json& point = json["points"].at(0);
  EXPECT_EQ(point["id"], 7);
  EXPECT_EQ(point["position"][0], 1.0);
  EXPECT_TRUE(point["position"][2].is_null());
  EXPECT_NEAR(point["covariance"][5], 9e-6, 1e-9);
  EXPECT_EQ(point["state"], "missed");
}

TEST(Events, PictureIsBase64) {
  msg::Preview preview;
  for (const auto& [bytes, text] :
       std::vector<std::pair<std::vector<std::uint8_t>, std::string>>{{{}, ""},
                                                                      {{'f'}, "Zg=="},
                                                                      {{'f', 'o'}, "Zm8="},
                                                                      {{'f', 'o', 'o'}, "Zm9v"},
                                                                      {{0xfb, 0xff, 0xfe, 0}, "+//+AA=="}}) {
    preview.jpeg(bytes);
    EXPECT_EQ(Json::parse(to_json(preview))["jpeg"], text);
  }
}

TEST(Events, ReplacesInvalidUtf8) {
  msg::ServiceStatus status;
  status.warnings({"\xff\xfe broken", "sound"});
  EXPECT_EQ(Json::parse(to_json(status, 0))["warnings"][1], "sound");
}

TEST(Events, ParsesRequestsStrictly) {
  const std::string good = R"({"client":"c","number":3,"host":"h","pid":7,"action":"look","target":"ball","wider":-1,
    "points":[{"camera":"cam0","pixel":[10,20.5]}],"ignored":[{"camera":"cam1","box":[1,2,3,4]}]})";
  const msg::TeachRequest request = teach_request_of(good);
  EXPECT_EQ(request.action(), msg::TEACH_ACTION_LOOK);
  EXPECT_EQ(request.wider(), -1);
  EXPECT_EQ(request.points().at(0).camera(), "cam0");
  EXPECT_EQ(request.points().at(0).pixel()[1], 20.5);
  EXPECT_EQ(request.ignored().at(0).box()[3], 4);
  for (const std::string bad :
       {"", "[]", "{", "null", R"({"client":1})", R"({"client":"c","number":1,"host":"h","pid":1,"action":"dance"})"})
    EXPECT_THROW(teach_request_of(bad), std::invalid_argument) << bad;
  std::string many = R"({"client":"c","number":1,"host":"h","pid":1,"action":"look","points":[)";
  for (int i = 0; i < 65; ++i) many += std::string(i > 0 ? "," : "") + R"({"camera":"a","pixel":[0,0]})";
  EXPECT_THROW(teach_request_of(many + "]}"), std::invalid_argument);
}

TEST(Events, ParsesWordsStrictlyAndRepliesInRows) {
  const msg::ControlRequest request =
      control_request_of(R"({"client":"c","number":3,"host":"h","pid":7,"words":["record","start"]})");
  EXPECT_EQ(request.pid(), 7u);
  EXPECT_THAT(request.words(), testing::ElementsAre("record", "start"));
  const msg::ControlRequest unaddressed = control_request_of(R"({"client":"c","number":3,"words":["replay","state"]})");
  EXPECT_EQ(unaddressed.host(), "");
  EXPECT_EQ(unaddressed.pid(), 0u);
  EXPECT_THROW(control_request_of(R"({"client":"c","number":3,"pid":7,"words":[]})"), std::invalid_argument);
  const auto with = [](const std::string& words) {
    return R"({"client":"c","number":1,"host":"h","pid":1,"words":)" + words + "}";
  };
  for (const std::string& bad : {std::string(), with("1"), with("[1]"), with("[[]]"), with("{}"),
                                 with(R"(["a\u0000b"])"), with("[\"" + std::string(201, 'x') + "\"]"),
                                 with("[\"\"" +
                                      [] {
                                        std::string more;
                                        for (int i = 0; i < 32; ++i) more += ",\"x\"";
                                        return more;
                                      }() +
                                      "]"),
                                 std::string(R"({"client":"c","number":1,"host":"h","words":[]})")})
    EXPECT_THROW(control_request_of(bad), std::invalid_argument) << bad;

  msg::ControlReply reply;
  reply.client("c");
  reply.granted(true);
  reply.rows().emplace_back().columns({"a", "\xff"});
  const Json json = Json::parse(to_json(reply));
  EXPECT_EQ(json["granted"], true);
  EXPECT_EQ(json["rows"][0][0], "a");
}

}  // namespace
}  // namespace huetrack::live_view
