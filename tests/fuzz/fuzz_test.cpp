// The corpus through every fuzz target, without a fuzzer: seeds that are made here, of what our own writers write, and
// the files of corpus/TARGET, which fuzzing found to reach more, or to end the program once.
// HUETRACK_WRITE_SEEDS=FOLDER writes the seeds, for run.sh.
#include <gtest/gtest.h>

#include <cstdlib>
#include <span>
#include <sstream>
#include <stdexcept>
#include <vector>

#include "calib/board/board_yaml.h"
#include "calib/exchange/exchange.h"
#include "calib/model/rig_yaml.h"
#include "camera_tracking/scene_map.h"
#include "capture/frames/jpeg_encoder.h"
#include "capture/frames/matches.h"
#include "config/room_file.h"
#include "config/service_config.h"
#include "fuzz/fuzz_target.h"
#include "idl/camera_hostPubSubTypes.h"
#include "idl/camera_timesPubSubTypes.h"
#include "idl/huetrackPubSubTypes.h"
#include "idl/huetrack_viewPubSubTypes.h"
#include "idl/object_setPubSubTypes.h"
#include "recordings/bag_writer.h"
#include "tracks/track_csv.h"

namespace huetrack::fuzz {
namespace {

namespace fs = std::filesystem;
const fs::path source = HUETRACK_SOURCE_DIR;

std::string contents(const fs::path& file) {
  std::ostringstream text;
  text << std::ifstream(file, std::ios::binary).rdbuf();
  return text.str();
}

template <typename PubSubType>
std::string serialized(char choice, typename PubSubType::type sample) {
  PubSubType type;
  eprosima::fastrtps::rtps::SerializedPayload_t payload(type.getSerializedSizeProvider(&sample)());
  type.serialize(&sample, &payload);
  return choice + std::string(reinterpret_cast<const char*>(payload.data), payload.length);
}

std::string picture(int width, int height);

std::vector<std::string> samples() {
  msg::ObjectPosition position;
  position.target("ball");
  position.per_view().resize(2);
  position.per_view()[0].camera("left");
  msg::CameraPose pose;
  pose.camera("hand");
  msg::ServiceStatus status;
  status.host("lab");
  status.cameras().resize(2);
  status.cameras()[0].name("left");
  status.warnings({"one", "two"});
  msg::Scene scene;
  scene.cameras().resize(1);
  scene.cameras()[0].distortion({1, 2, 3, 4});
  scene.targets().resize(1);
  scene.targets()[0].colors().resize(2);
  scene.ignored().resize(1);
  msg::Preview preview;
  preview.camera("left");
  preview.jpeg({1, 2, 3});
  preview.targets().resize(1);
  preview.targets()[0].particles({1, 2});
  msg::CameraMap map;
  map.points().resize(3);
  msg::TeachReply reply;
  reply.cameras().resize(1);
  reply.cameras()[0].mask({1, 2});
  msg::TeachRequest request;
  request.client("page");
  request.points().resize(1);
  request.ignored().resize(1);
  msg::ControlReply answer;
  answer.rows().resize(2);
  answer.rows()[1].columns({"recording", "12"});
  answer.bytes({1, 2, 3});
  msg::ControlRequest asked;
  asked.client("page");
  asked.words({"record", "read", "recording", "0"});
  msg::CameraTimes times;
  times.cameras().resize(1);
  msg::HostClocks clocks;
  clocks.clocks().resize(1);
  clocks.clocks()[0].cameras({"left"});
  msg::ObjectSet set;
  set.target("ball");
  set.objects().resize(2);
  set.objects()[0].name("ball_1");
  msg::CameraHost host;
  host.host("pi");
  host.cameras().resize(1);
  host.cameras()[0].message("no frame yet");
  msg::CameraFrame grey, jpeg;
  grey.format(7);
  grey.width(4);
  grey.height(2);
  grey.bytes(std::vector<std::uint8_t>(8, 77));
  const std::string encoded = picture(16, 8);
  jpeg.width(16);
  jpeg.height(8);
  jpeg.bytes(std::vector<std::uint8_t>(encoded.begin(), encoded.end()));
  const capture::Image looked_at{
      .format = capture::PixelFormat::i422, .width = 16, .height = 8, .planes = {}, .owner = {}};
  const std::vector<capture::Matches::OfColor> found{
      {.color = {65, 115, 0.3, 1, 0.1, 0.95}, .tiles = {0x00183c7e7e3c1800, 0}}, {.color = {}, .tiles = {~0u, 5}}};
  msg::CameraMatches matches;
  capture::encode_matches(looked_at, found, jpeg.bytes(), matches.bytes());
  capture::WritableImage seen = capture::make_image(looked_at.format, looked_at.range, 16, 8);
  msg::CameraMatches with_patches;
  constexpr capture::PatchPlace patches[] = {{2, 2, 6, 4}, {8, 0, 8, 8}};
  capture::encode_matches(seen.image, found, {}, with_patches.bytes(), patches);
  msg::ExpectedOutlines outlines;
  outlines.cameras().emplace_back().outlines().emplace_back().radius_px(7);
  msg::LookedForColors looked_for;
  looked_for.host("pi");
  looked_for.camera("left");
  looked_for.colors().emplace_back().hue_max_deg(60);
  msg::ClockEcho echo;
  echo.host("pi");
  return {serialized<msg::ObjectPositionPubSubType>(0, position),
          serialized<msg::CameraPosePubSubType>(1, pose),
          serialized<msg::ServiceStatusPubSubType>(2, status),
          serialized<msg::ScenePubSubType>(3, scene),
          serialized<msg::PreviewPubSubType>(4, preview),
          serialized<msg::CameraMapPubSubType>(5, map),
          serialized<msg::TeachReplyPubSubType>(6, reply),
          serialized<msg::TeachRequestPubSubType>(7, request),
          serialized<msg::CameraTimesPubSubType>(8, times),
          serialized<msg::ControlReplyPubSubType>(9, answer),
          serialized<msg::ControlRequestPubSubType>(10, asked),
          serialized<msg::HostClocksPubSubType>(11, clocks),
          "\x0chost=lab;pid=12;targets=red,green;",
          serialized<msg::ObjectSetPubSubType>(13, set),
          serialized<msg::CameraHostPubSubType>(14, host),
          serialized<msg::CameraFramePubSubType>(15, grey),
          serialized<msg::CameraFramePubSubType>(15, jpeg),
          serialized<msg::CameraMatchesPubSubType>(16, matches),
          serialized<msg::LookedForColorsPubSubType>(17, looked_for),
          serialized<msg::CameraMatchesPubSubType>(16, with_patches),
          serialized<msg::ExpectedOutlinesPubSubType>(18, outlines),
          serialized<msg::ClockEchoPubSubType>(19, echo)};
}

std::string picture(int width, int height) {
  const std::vector<std::uint8_t> grey(std::size_t(width) * std::size_t(height), 77);
  capture::Image image{
      .format = capture::PixelFormat::grey, .width = width, .height = height, .planes = {}, .owner = {}};
  image.planes[0] = {grey.data(), width};
  const auto jpeg = capture::encode_picture(image, {width, height}, 80);
  return {jpeg.begin(), jpeg.end()};
}

std::string map() {
  camera_tracking::StoredMap stored;
  stored.image_size = {32, 24};
  camera_tracking::Keyframe keyframe;
  std::uint8_t* pixels = nullptr;
  camera_tracking::GreyImage image = camera_tracking::make_grey(32, 24, pixels);
  std::fill_n(pixels, 32 * 24, std::uint8_t{9});
  keyframe.pyramid = std::make_shared<const camera_tracking::Pyramid>(camera_tracking::make_pyramid(std::move(image)));
  stored.map.keyframes.push_back(keyframe);
  camera_tracking::MapPoint point;
  point.view_count = 1;
  point.views[0].keyframe = 0;
  stored.map.points.push_back(point);
  stored.sightings.push_back({.keyframe = 0, .point = 0, .px = {1, 2}, .sigma_px = 1});
  camera_tracking::write_map(folder() / "seed.map", stored);
  return contents(folder() / "seed.map");
}

std::vector<std::string> exchanged(const calib::CameraRig& rig) {
  using exchange::ExchangeFormat;
  std::vector<std::string> seeds;
  // The first byte as targets/exchange.cpp reads it: 4 extensions to a format.
  const auto add = [&](exchange::ExportOptions options, int choice) {
    for (const auto& [name, text] : exchange::export_rig(rig, options).files) seeds.push_back(char(choice) + text);
  };
  add({.format = ExchangeFormat::ros}, 0);
  add({.format = ExchangeFormat::opencv}, 4);
  add({.format = ExchangeFormat::opencv, .extension = "json", .stereo = true}, 5);
  add({.format = ExchangeFormat::opencv, .extension = "xml"}, 6);
  add({.format = ExchangeFormat::kalibr}, 8);
  add({.format = ExchangeFormat::aniposelib}, 15);
  add({.format = ExchangeFormat::caliscope}, 19);
  add({.format = ExchangeFormat::caliscope}, 23);  // by its looks
  seeds.push_back(std::string(1, '\0') +
                  "[image]\nwidth\n640\nheight\n480\n[left]\ncamera matrix\n500 0 320\n0 500 240\n0 0 1\n"
                  "distortion\n0.1 -0.2 0.001 0.002 0\n");
  return seeds;
}

// A client's frame on a WebSocket, masked by "abcd".
std::string masked(unsigned first_byte, const std::string& payload) {
  std::string out{static_cast<char>(first_byte)};
  if (payload.size() < 126) {
    out += static_cast<char>(0x80U | payload.size());
  } else {
    out += {'\xfe', static_cast<char>(payload.size() >> 8U), static_cast<char>(payload.size())};
  }
  out += "abcd";
  for (std::size_t i = 0; i < payload.size(); ++i) out += static_cast<char>(payload[i] ^ "abcd"[i % 4]);
  return out;
}

// Of one frame; and two of them as a file of a recording has them.
std::vector<std::string> matches() {
  const capture::WritableImage seen = capture::make_image(capture::PixelFormat::i422, capture::ColorRange::full, 16, 8);
  const std::vector<capture::Matches::OfColor> found{
      {.color = {65, 115, 0.3, 1, 0.1, 0.95}, .tiles = {0x00183c7e7e3c1800, 0}}, {.color = {}, .tiles = {~0u, 5}}};
  const std::string encoded = picture(16, 8);
  const std::vector<std::uint8_t> jpeg(encoded.begin(), encoded.end());
  constexpr capture::PatchPlace patches[] = {{2, 2, 6, 4}, {8, 0, 8, 8}};
  std::vector<std::string> seeds;
  std::string file = "\1";
  const auto add = [&](std::span<const std::uint8_t> with_jpeg, std::span<const capture::PatchPlace> with_patches) {
    std::vector<std::uint8_t> bytes;
    capture::encode_matches(seen.image, found, with_jpeg, bytes, with_patches);
    const std::string frame(bytes.begin(), bytes.end());
    seeds.push_back(std::string(1, '\0') + frame);
    for (unsigned shift = 0; shift < 32; shift += 8) file += static_cast<char>(frame.size() >> shift);
    file += frame;
  };
  add(jpeg, {});
  add({}, patches);
  seeds.push_back(file);
  return seeds;
}

// Pictures, a lens' and a room's messages in each container; the first byte as targets/bag.cpp reads it.
std::vector<std::string> bag_files() {
  using namespace recordings;
  const std::string jpeg = picture(16, 8);
  const auto messages = [&](Wire wire, const std::string& msg) {
    std::vector<WrittenMessage> all;
    for (std::int64_t at = 1'000'000'000; at < 1'300'000'000; at += 100'000'000) {
      all.push_back({"/left/image/compressed", "sensor_msgs" + msg + "/CompressedImage", at,
                     compressed_image(wire, at, "jpeg", jpeg)});
      all.push_back({"/right/image", "sensor_msgs" + msg + "/Image", at,
                     raw_image(wire, at, 16, 8, "bgr8", 48, std::string(384, 'x'))});
    }
    all.push_back({"/left/camera_info", "sensor_msgs" + msg + "/CameraInfo", 1'000'000'000,
                   MessageBytes(wire).header(1'000'000'000, "left").numbers(std::vector<std::uint32_t>{8, 16}).done()});
    all.push_back({"/tf_static", "tf2_msgs" + msg + "/TFMessage", 1'000'000'000,
                   MessageBytes(wire).number(std::uint32_t{1}).header(1'000'000'000, "world").text("left").done()});
    return all;
  };
  std::vector<std::string> seeds;
  for (const std::string compression : {"", "lz4", "zstd"})
    seeds.push_back(std::string(1, '\0') + mcap_of(messages({}, "/msg"), {.compression = compression}));
  seeds.push_back(std::string(1, '\0') +
                  mcap_of(messages({.is_big_endian = true}, "/msg"), {.has_index = false, .has_chunks = false}));
  for (const std::string compression : {"none", "bz2", "lz4"})
    seeds.push_back("\1" + ros1_bag_of(messages({.is_ros1 = true}, ""), compression));
  write_db3(folder() / "seed.db3", messages({}, "/msg"));
  seeds.push_back("\2" + contents(folder() / "seed.db3"));
  return seeds;
}

std::vector<std::string> requests() {
  const std::string words = std::string(1, '\0') +
                            "target\tset\tball\tradius_m=0.05\thue_deg=340,20\tcamera=a\n"
                            "target\tadd\tsecond\tsaturation=0.2,1\tintensity=0.1,0.9\n"
                            "target\trename\tsecond\twand\ntarget\tremove\twand\ntarget\tlist\nundo\nredo\nhistory",
                    more = std::string(1, '\0') +
                           "camera\tsave\ta\tgain=9\ncamera\tcontrols\ta\nrecord\tread\tone\t0\nrecord\tlist\n"
                           "replay\tspeed\t0.5\nreplay\tstep\t3\nreplay\topen\tone\nreplay\tstate",
                    board = std::string(1, '\0') +
                            "calibrate\tprint\ttype=charuco\tcolumns=7\tpaper=A4\t0\ncalibrate\tstate\n"
                            "calibrate\tagain\tcamera_distance=a,b,1.5\ncalibrate\taccept\tdoubtful\n"
                            "calibrate\treport\t0\nrecord\tstate\ncalibrate\tboard\tsquare_mm=30";
  msg::TeachRequest pointing;
  pointing.client("page");
  pointing.target("ball");
  pointing.points().resize(2);
  pointing.points()[0].camera("a");
  pointing.points()[1].camera("b");
  for (msg::TeachPoint& point : pointing.points()) point.pixel({32, 24});
  pointing.ignored().resize(1);
  pointing.ignored()[0].camera("b");
  pointing.ignored()[0].box({1, 2, 10, 12});
  pointing.wider(2);
  std::vector<std::string> seeds{words, more, board};
  for (const auto action : {msg::TEACH_ACTION_LOOK, msg::TEACH_ACTION_APPLY, msg::TEACH_ACTION_IGNORE,
                            msg::TEACH_ACTION_UNDO, msg::TEACH_ACTION_RESUME}) {
    pointing.action(action);
    seeds.push_back(serialized<msg::TeachRequestPubSubType>(1, pointing));
  }
  return seeds;
}

// What is kept of the room, which is of the rig that the target has.
std::string room() {
  config::KeptRoom kept{.camera = "left \"one\"", .patches = {{.px = {12.25, 7}, .cell = 3, .seen = {}}}};
  kept.patches[0].seen.fill(171);
  return config::room_to_yaml({kept, {.camera = "right", .patches = {}}}, "0123456789abcdef");
}

// A tracked camera, and what it starts from in rows.csv.
std::vector<std::string> tracked_cameras() {
  const auto config = [](const std::string& start, const std::string& rows) {
    return "version: 1\nrig: rig.yaml\ncamera_tracking:\n  camera: cam0\n  start: {" + start +
           "}\n%%\nversion: 1\n%%\n" + rows;
  };
  return {
      config("points: rows.csv", "X,Y,Z,u,v\n0,0,0,10,10\n1,0,0,200,10\n0,1,0,10,200\n1,1,0,200,200\n"),
      config("rectangle: rows.csv", "x,y,z\n0,0,0\n1,0,0\n1,1,0\n0,1,0\n"),
      config("leds: rows.csv", "x,y,z\n0,0,2\n1,0,2\n0,1,2\n1,1,2\n0.5,0.4,2.3\n"),
      config("leds: [[0, 0, 2], [1, 0, 2], [0, 1, 2], [1, 1, 2]], led_schedule: rows.csv", "led\n0\n1\n2\n-1\n3\n")};
}

std::map<std::string, std::vector<std::string>> seeds() {
  const fs::path demo = source / "configs/demo";
  const calib::CameraRig rig = calib::read_rig(demo / "recording/rig.yaml");
  board::Board board;
  board.type = board::BoardType::charuco;
  board.columns = 7, board.rows = 5;
  board.pitch.setConstant(0.03);
  board.marker = 0.02;
  board.dictionary = "DICT_4X4_50";
  object_tracking::ObjectEstimate estimate;
  const std::string track = std::string(tracks::track_csv_header) + "\n" + tracks::to_csv_row("lime", estimate) + "\n";
  std::string film = contents(demo / "recording/cam0.mkv");
  film.resize(std::min<std::size_t>(film.size(), 20'000));
  const std::string ask =
      "{\"client\":\"c\",\"number\":1,\"host\":\"h\",\"pid\":2,\"action\":\"look\",\"points\":"
      "[{\"camera\":\"left\",\"pixel\":[1,2]}],\"ignored\":[{\"camera\":\"left\",\"box\":[1,2,3,4]}]}";
  const std::string host = " HTTP/1.1\r\nHost: localhost\r\n";
  std::vector<std::string> configs = tracked_cameras();
  configs.insert(configs.begin(),
                 {contents(source / "configs/huetrackd.yaml"), contents(demo / "huetrackd.yaml"),
                  "version: 1\nrig: rig.yaml\ntargets: {a: {radius_m: 0.03, color: {hue_deg: [1, 2]}}}\n%%\n"
                  "version: 1\ntargets: {a: {color: {hue_deg: [3, 4]}}}\nignore: null\n"});
  return {
      {"rig", {calib::to_yaml(rig)}},
      {"board", {board::to_yaml(board), "type: chessboard\ncolumns: 9\nrows: 6\nsquare: 0.025\n"}},
      {"exchange", exchanged(rig)},
      {"tables",
       {std::string(1, '\0') + track, "\x02" + track,
        "\x01"
        "ball,t,x,y,z\nred,0.5,1,2,3\n",
        "\x03"
        "t_s,change,config\n1.5,left_out,\n"}},
      {"recording",
       {contents(demo / "recording/recording.yaml"),
        "version: 1\ncameras: {a: {frames: a.mkv, timestamps: times.csv}}\n%%\nframe,t_s,sequence,arrival,stamp_s\n"
        "0,0.5,0,1,0.6\n,0.7,1,2,0.7\n"}},
      {"config", configs},
      {"map", {map()}},
      {"jpeg", {picture(32, 24), picture(8, 8)}},
      {"video", {film, picture(32, 24)}},
      {"bag", bag_files()},
      {"dds", samples()},
      {"matches", matches()},
      {"measured",
       {std::string(1, '\0') +
            "version: 1\npoints:\n  corner: {world: [0, 0, 0], pixels: {cam0: [160, 120], cam1: [160, 120]}}\n"
            "  door: {world: [2.4, 0, 0], position: [0.3, -0.2, 0.9]}\n  desk: {world: [0, 1, 0], position: [0, 1, "
            "1]}\n",
        "\1places: {a: [0.3, 0.45, 0.02], b: [1, 0, 0], c: [0, 1, 0]}\n"}},
      {"requests", requests()},
      {"room", {room()}},
      {"web_socket",
       {"\2" + masked(0x81, "hello") + masked(0x89, "are you there") + masked(0x88, "\x03\xe8 bye"),
        "\x40" + masked(0x82, std::string(300, 'x')), "\5" + masked(0x01, "in ") + masked(0x80, "pieces")}},
      {"http",
       {"GET /" + host + "\r\n", "GET /api/events?client=a" + host + "\r\n",
        "POST /api/teach" + host + "Content-Type: application/json\r\nContent-Length: " + std::to_string(ask.size()) +
            "\r\n\r\n" + ask,
        "POST /api/teach" + host + "Transfer-Encoding: chunked\r\n\r\n2\r\n{}\r\n0\r\n\r\n",
        "HEAD /page.js" + host + "Cookie: huetrack_token_1=x\r\nOrigin: http://localhost\r\n\r\n"}},
  };
}

TEST(Fuzz, EveryTargetHasSeedsAndTakesThem) {
  const auto made = seeds();
  ASSERT_EQ(made.size(), targets().size());
  for (const auto& [name, target] : targets()) {
    ASSERT_TRUE(made.contains(name)) << name;
    for (const std::string& seed : made.at(name)) {
      target(seed);
      target(std::string_view(seed).substr(0, seed.size() / 2));
    }
    target("");
  }
  if (const char* folder = std::getenv("HUETRACK_WRITE_SEEDS")) {
    for (const auto& [name, inputs] : made) {
      fs::create_directories(fs::path(folder) / name);
      for (std::size_t i = 0; i < inputs.size(); ++i)
        std::ofstream(fs::path(folder) / name / ("seed" + std::to_string(i)), std::ios::binary) << inputs[i];
    }
  }
}

TEST(Fuzz, TheCorpusIsHarmless) {
  const fs::path corpus = source / "tests/fuzz/corpus";
  for (const auto& [name, target] : targets()) {
    if (!fs::exists(corpus / name)) continue;
    for (const auto& entry : fs::directory_iterator(corpus / name)) {
      SCOPED_TRACE(entry.path().string());
      target(contents(entry.path()));
    }
  }
}

}  // namespace
}  // namespace huetrack::fuzz
