// Bags of ROS as recordings: every container, compression and encoding, damage, names.
#include <gmock/gmock.h>

#include <algorithm>
#include <map>
#include <random>
#include <string>
#include <vector>

#include "calib/files/config_error.h"
#include "capture/frames/jpeg_encoder.h"
#include "recordings/bag_writer.h"
#include "recordings/recording.h"
#include "recordings/replay_source.h"

namespace huetrack::recordings {
namespace {

using namespace std::chrono_literals;
using testing::AllOf;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr std::int64_t first_ns = 1'700'000'000'000'000'000;
constexpr std::int64_t period_ns = 100'000'000;
constexpr std::int64_t transport_ns = 7'000'000;  // from a message's stamp to its recording
constexpr int bag_frames = 12;
constexpr int bag_width = 64, bag_height = 48;

std::string flat_jpeg(int k) {
  const auto flat = capture::make_image(capture::PixelFormat::grey, capture::ColorRange::full, bag_width, bag_height);
  std::fill_n(flat.data[0], bag_width * bag_height, static_cast<std::uint8_t>(capture::level_of_frame(k)));
  const auto bytes = capture::encode_picture(flat.image, {bag_width, bag_height}, 95);
  return {bytes.begin(), bytes.end()};
}

std::string flat_bgr(int k) {
  return std::string(3 * bag_width * bag_height, static_cast<char>(capture::level_of_frame(k)));
}

// left: JPEG, right: raw, 20 ms later; and a topic that is no camera.
std::vector<WrittenMessage> two_cameras(Wire wire, const std::string& msg = "/msg") {
  std::vector<WrittenMessage> messages;
  for (int k = 0; k < bag_frames; ++k) {
    const std::int64_t at = first_ns + k * period_ns;
    messages.push_back({"/rosout", "rcl_interfaces" + msg + "/Log", at, MessageBytes(wire).text("x").done()});
    messages.push_back({"/robot/left/image_raw/compressed", "sensor_msgs" + msg + "/CompressedImage", at + transport_ns,
                        compressed_image(wire, at, "bgr8; jpeg compressed bgr8", flat_jpeg(k))});
    messages.push_back({"/robot/right/image_raw", "sensor_msgs" + msg + "/Image", at + 20'000'000 + transport_ns,
                        raw_image(wire, at + 20'000'000, bag_width, bag_height, "bgr8", 3 * bag_width, flat_bgr(k))});
  }
  return messages;
}

class BagRecording : public testing::Test {
 protected:
  struct Played {
    std::map<int, std::vector<int>> shown;  // by camera; -1: corrupted
    std::map<int, std::vector<std::int64_t>> at_ns;
    std::vector<std::string> warnings;
  };
  Played play(const std::filesystem::path& bag, const std::vector<std::string>& names = {"left", "right"},
              const ReplayOptions& options = {}) {
    ReplaySource source(read_recording(bag), names, options);
    Played played;
    while (const auto frame = source.next({})) {
      const bool is_ok = frame->status == capture::FrameStatus::ok;
      played.shown[frame->camera].push_back(is_ok ? capture::frame_shown_by(frame->pixels) : -1);
      played.at_ns[frame->camera].push_back(frame->stamped_at.time_since_epoch().count());
    }
    played.warnings = source.take_warnings();
    return played;
  }
  void expect_all(const std::filesystem::path& bag) {
    const Played played = play(bag);
    std::vector<int> all;
    std::vector<std::int64_t> left, right;
    for (int k = 0; k < bag_frames; ++k) {
      all.push_back(k);
      left.push_back(first_ns + k * period_ns);
      right.push_back(left.back() + 20'000'000);
    }
    EXPECT_EQ(played.shown.at(0), all);
    EXPECT_EQ(played.shown.at(1), all);
    EXPECT_EQ(played.at_ns.at(0), left);
    EXPECT_EQ(played.at_ns.at(1), right);
    EXPECT_THAT(played.warnings, IsEmpty());
  }
  std::filesystem::path write(const std::string& name, const std::string& bytes) const {
    capture::write_text(folder / name, bytes);
    return folder / name;
  }
  static std::string error_of(const std::function<void()>& action) {
    try {
      action();
    } catch (const files::ConfigError& error) {
      return error.what();
    }
    return "(accepted)";
  }

  const capture::TemporaryFolder temporary;
  const std::filesystem::path folder = temporary.path();
};

TEST_F(BagRecording, PlaysMcapOfEveryStyle) {
  for (const std::string compression : {"", "lz4", "zstd"})
    for (const bool has_index : {true, false})
      for (const bool has_chunks : {true, false})
        for (const bool is_big_endian : {false, true}) {
          SCOPED_TRACE(compression + (has_index ? " indexed" : "") + (has_chunks ? " chunks" : "") +
                       (is_big_endian ? " big" : ""));
          const McapStyle style{.compression = compression,
                                .has_index = has_index,
                                .has_chunks = has_chunks,
                                .has_checksums = has_chunks != is_big_endian};
          expect_all(write("a.mcap", mcap_of(two_cameras({.is_big_endian = is_big_endian}), style)));
        }
}

TEST_F(BagRecording, ASimulatedClockBeginsAtZero) {
  std::vector<WrittenMessage> messages;
  std::vector<std::int64_t> expected;
  for (int k = 0; k < bag_frames; ++k) {
    expected.push_back(k * period_ns);
    messages.push_back({"/left", "sensor_msgs/msg/CompressedImage", first_ns + k * period_ns,
                        compressed_image({}, expected.back(), "bgr8; jpeg compressed bgr8", flat_jpeg(k))});
  }
  const Played played = play(write("a.mcap", mcap_of(messages, {})), {"left"});
  EXPECT_EQ(played.at_ns.at(0), expected);
  EXPECT_THAT(played.warnings, IsEmpty());
}

// Of a network, or a recorder with several threads: one picture comes up to eight later.
TEST_F(BagRecording, MessagesAreInTheOrderOfTheirTimes) {
  for (const auto& [from, to] : {std::pair{6, 8}, {3, 11}}) {
    auto messages = two_cameras({});
    std::rotate(messages.begin() + 3 * from, messages.begin() + 3 * from + 3, messages.begin() + 3 * to);
    expect_all(write("a.mcap", mcap_of(messages, {})));
  }
}

TEST_F(BagRecording, PlaysMcapOfRos1Messages) {
  expect_all(write("a.mcap", mcap_of(two_cameras({.is_ros1 = true}, ""), {.encoding = "ros1"})));
}

TEST_F(BagRecording, PlaysRos1BagsOfEveryCompression) {
  for (const std::string compression : {"none", "bz2", "lz4"})
    for (const bool has_index : {true, false}) {
      SCOPED_TRACE(compression + (has_index ? " indexed" : ""));
      const auto bag = write("a.bag", ros1_bag_of(two_cameras({.is_ros1 = true}, ""), compression, has_index));
      if (has_index) {
        expect_all(bag);
      } else {
        EXPECT_EQ(play(bag).shown.at(1).size(), std::size_t{bag_frames});
      }
    }
}

TEST_F(BagRecording, PlaysRosbag2FoldersWithSeveralFiles) {
  const auto messages = two_cameras({});
  for (const std::string ending : {"db3", "mcap"}) {
    const auto bag = folder / ("run_" + ending);
    std::filesystem::create_directory(bag);
    std::string paths;
    for (std::size_t part = 0; part < 12; ++part) {  // 10 comes after 9, not after 1
      const auto begin = messages.begin() + static_cast<std::ptrdiff_t>(3 * part);
      const std::vector<WrittenMessage> own(begin, begin + 3);
      const std::string name = "run_" + std::to_string(part) + "." + ending;
      if (ending == "db3")
        write_db3(bag / name, own);
      else
        capture::write_text(bag / name, mcap_of(own));
      paths += "    - " + name + "\n";
    }
    capture::write_text(
        bag / "metadata.yaml",
        "rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: x\n  relative_file_paths:\n" + paths);
    expect_all(bag);
    expect_all(bag / "metadata.yaml");
  }
}

TEST_F(BagRecording, NamesMissingFilesOfARosbag2) {
  const auto bag = folder / "run";
  std::filesystem::create_directory(bag);
  write_db3(bag / "run_0.db3", two_cameras({}));
  EXPECT_THAT(play(bag).warnings, ElementsAre(HasSubstr("no metadata.yaml, so its recorder was killed")));
  capture::write_text(bag / "metadata.yaml",
                      "rosbag2_bagfile_information:\n  relative_file_paths: [run_0.db3, run_1.db3]\n");
  EXPECT_THAT(play(bag).warnings,
              ElementsAre(AllOf(HasSubstr("run_1.db3"), HasSubstr("its part of the recording is missing"))));
}

TEST_F(BagRecording, ARecorderThatWasKilledLeavesAnEmptyFile) {
  const auto bag = folder / "run";
  std::filesystem::create_directory(bag);
  write_db3(bag / "run_0.db3", two_cameras({}));
  capture::write_text(bag / "run_1.db3", "");
  const Played played = play(bag);
  EXPECT_EQ(played.shown.at(1).size(), std::size_t{bag_frames});
  EXPECT_THAT(played.warnings, Contains(HasSubstr("run_1.db3: is empty")));
}

TEST_F(BagRecording, PlaysMessagesThatAreCompressedOneByOne) {
  auto messages = two_cameras({});
  for (WrittenMessage& message : messages) message.data = compressed_bytes("zstd", message.data);
  write_db3(folder / "a.db3", messages);
  expect_all(folder / "a.db3");
}

TEST_F(BagRecording, NamesFilesThatAreCompressedAsAWhole) {
  const auto bag = folder / "run";
  std::filesystem::create_directory(bag);
  capture::write_text(bag / "run_0.db3.zstd", "x");
  capture::write_text(bag / "metadata.yaml", "rosbag2_bagfile_information:\n  relative_file_paths: [run_0.db3.zstd]\n");
  EXPECT_THAT(error_of([&] { play(bag); }), AllOf(HasSubstr("run: "), HasSubstr("unzstd --rm")));
}

// Every encoding of sensor_msgs, with a flat colour.
TEST_F(BagRecording, ReadsEveryEncoding) {
  const auto repeated = [](const std::string& pixel, int count) {
    std::string out;
    for (int i = 0; i < count; ++i) out += pixel;
    return out;
  };
  const int pixels = bag_width * bag_height;
  struct Case {
    std::string encoding, data;
    std::uint32_t step;
    bool is_big_endian = false;
  };
  const std::uint32_t w = bag_width;
  const std::string b = "\x1e", g = "\xb4", r = "\x5a";  // 30, 180, 90
  const std::vector<Case> colours{
      {"bgr8", repeated(b + g + r, pixels), 3 * w},
      {"rgb8", repeated(r + g + b, pixels), 3 * w},
      {"8UC3", repeated(b + g + r, pixels), 3 * w},
      {"bgra8", repeated(b + g + r + "\xff", pixels), 4 * w},
      {"rgba8", repeated(r + g + b + "\xff", pixels), 4 * w},
      {"rgb16", repeated(std::string("\0", 1) + r + std::string("\0", 1) + g + std::string("\0", 1) + b, pixels),
       6 * w},
      {"bgr16", repeated(b + std::string("\0", 1) + g + std::string("\0", 1) + r + std::string("\0", 1), pixels), 6 * w,
       true},
      {"bayer_rggb8", repeated(repeated(r + g, bag_width / 2) + repeated(g + b, bag_width / 2), bag_height / 2), w},
      {"bayer_bggr8", repeated(repeated(b + g, bag_width / 2) + repeated(g + r, bag_width / 2), bag_height / 2), w},
      {"bayer_gbrg8", repeated(repeated(g + b, bag_width / 2) + repeated(r + g, bag_width / 2), bag_height / 2), w},
      {"bayer_grbg8", repeated(repeated(g + r, bag_width / 2) + repeated(b + g, bag_width / 2), bag_height / 2), w},
  };
  for (const Case& c : colours) {
    SCOPED_TRACE(c.encoding);
    const auto bag =
        write("a.mcap",
              mcap_of({{"/cam/image_raw", "sensor_msgs/msg/Image", first_ns,
                        raw_image({}, first_ns, bag_width, bag_height, c.encoding, c.step, c.data, c.is_big_endian)}}));
    ReplaySource source(read_recording(bag), std::vector<std::string>{"cam"});
    const auto frame = source.next({});
    ASSERT_TRUE(frame && frame->status == capture::FrameStatus::ok);
    ASSERT_EQ(frame->pixels.format, capture::PixelFormat::bgr);
    const capture::Bgr pixel = capture::bgr_at(frame->pixels, 31, 21);
    EXPECT_NEAR(pixel.b, 30, 1);
    EXPECT_NEAR(pixel.g, 180, 1);
    EXPECT_NEAR(pixel.r, 90, 1);
  }
  const std::string y = "\x64", u = "\x46", v = "\xbe";  // 100, 70, 190
  const std::vector<Case> others{{"mono8", repeated(y, pixels), w},
                                 {"8UC1", repeated(y, pixels), w},
                                 {"mono16", repeated(std::string("\0", 1) + y, pixels), 2 * w},
                                 {"mono16", repeated(y + std::string("\0", 1), pixels), 2 * w, true},
                                 {"yuv422", repeated(u + y + v + y, pixels / 2), 2 * w},
                                 {"uyvy", repeated(u + y + v + y, pixels / 2), 2 * w},
                                 {"yuv422_yuy2", repeated(y + u + y + v, pixels / 2), 2 * w},
                                 {"yuyv", repeated(y + u + y + v, pixels / 2), 2 * w},
                                 {"nv12", repeated(y, pixels) + repeated(u + v, pixels / 4), w},
                                 {"nv21", repeated(y, pixels) + repeated(v + u, pixels / 4), w},
                                 {"nv24", repeated(y, pixels) + repeated(u + v, pixels), w}};
  for (const Case& c : others) {
    SCOPED_TRACE(c.encoding + (c.is_big_endian ? " big endian" : ""));
    const auto bag =
        write("a.mcap",
              mcap_of({{"/cam/image_raw", "sensor_msgs/msg/Image", first_ns,
                        raw_image({}, first_ns, bag_width, bag_height, c.encoding, c.step, c.data, c.is_big_endian)}}));
    ReplaySource source(read_recording(bag), std::vector<std::string>{"cam"});
    const auto frame = source.next({});
    ASSERT_TRUE(frame && frame->status == capture::FrameStatus::ok);
    const capture::Yuv pixel = capture::yuv_at(frame->pixels, 31, 21);
    EXPECT_NEAR(pixel.y, 100, 1);
    const bool is_grey = c.encoding.starts_with("mono") || c.encoding == "8UC1";
    EXPECT_NEAR(pixel.u, is_grey ? 128 : 70, 1);
    EXPECT_NEAR(pixel.v, is_grey ? 128 : 190, 1);
  }
}

TEST_F(BagRecording, RawPicturesThatContradictThemselvesAreCorrupted) {
  const std::string data = flat_bgr(0);
  const auto corrupted = [&](int width, int height, const std::string& encoding, std::uint32_t step,
                             const std::string& bytes) {
    const auto bag = write(
        "a.mcap", mcap_of({{"/cam/image_raw", "sensor_msgs/msg/Image", first_ns,
                            raw_image({}, first_ns, width, height, encoding, step, bytes)},
                           {"/cam/image_raw", "sensor_msgs/msg/Image", first_ns + 1,
                            raw_image({}, first_ns + period_ns, bag_width, bag_height, "bgr8", 3 * bag_width, data)}}));
    const Played played = play(bag, {"cam"});
    EXPECT_THAT(played.shown.at(0), ElementsAre(-1, 0));
    return played.warnings.empty() ? std::string() : played.warnings.front();
  };
  EXPECT_THAT(corrupted(64, 48, "bgr8", 192, data.substr(1)), HasSubstr("it has 9215 bytes instead of 9216"));
  EXPECT_THAT(corrupted(64, 48, "bgr8", 100, data), HasSubstr("64x48 pixels and 100 bytes a row"));
  EXPECT_THAT(corrupted(0, 48, "bgr8", 192, data), HasSubstr("0x48"));
  EXPECT_THAT(corrupted(2'000'000'000, 2'000'000'000, "bgr8", 192, data), HasSubstr("2000000000x2000000000"));
  EXPECT_THAT(corrupted(64, 48, "32FC1", 256, data), HasSubstr("\"32FC1\", no picture of a camera"));
}

TEST_F(BagRecording, AMessageWithoutAStampHasTheTimeOfItsRecording) {
  auto messages = two_cameras({});
  for (WrittenMessage& message : messages)
    if (message.topic.find("left") != std::string::npos) message.data = compressed_image({}, 0, "jpeg", flat_jpeg(3));
  const Played played = play(write("a.mcap", mcap_of(messages)));
  EXPECT_EQ(played.at_ns.at(0).front(), first_ns + transport_ns);
  EXPECT_EQ(played.at_ns.at(1).front(), first_ns + 20'000'000);
  EXPECT_THAT(played.warnings,
              ElementsAre(AllOf(HasSubstr("/robot/left/image_raw/compressed"), HasSubstr("header.stamp is 0"),
                                HasSubstr("huetrack-calibrate time"))));
}

TEST_F(BagRecording, PlaysFoxglovesPicturesInProtobuf) {
  const auto field = [](int number, const std::string& bytes) {
    std::string out(1, static_cast<char>(number << 3 | 2));
    for (auto size = bytes.size();; size >>= 7) {
      out += static_cast<char>((size & 0x7f) | (size > 0x7f ? 0x80 : 0));
      if (size <= 0x7f) break;
    }
    return out + bytes;
  };
  const auto fixed = [](int number, std::uint32_t value) {
    std::string out(1, static_cast<char>(number << 3 | 5));
    put(out, value);
    return out;
  };
  std::vector<WrittenMessage> messages;
  for (int k = 0; k < bag_frames; ++k) {
    std::string stamp = "\x08\x80\xe2\xcf\xaa\x06\x10";  // 1700000000 s; nanoseconds follow
    std::uint64_t ns = static_cast<std::uint64_t>(k) * 1000;
    for (; ns > 0x7f; ns >>= 7) stamp += static_cast<char>((ns & 0x7f) | 0x80);
    stamp += static_cast<char>(ns);
    messages.push_back({"/left", "foxglove.CompressedImage", first_ns,
                        field(1, stamp) + field(4, "optical") + field(2, flat_jpeg(k)) + field(3, "jpeg")});
    messages.push_back({"/right", "foxglove.RawImage", first_ns,
                        field(1, stamp) + fixed(2, bag_width) + fixed(3, bag_height) + field(4, "bgr8") +
                            fixed(5, 3 * bag_width) + field(6, flat_bgr(k))});
  }
  const Played played = play(write("a.mcap", mcap_of(messages, {.encoding = "protobuf"})));
  EXPECT_EQ(played.shown.at(0).size(), std::size_t{bag_frames});
  EXPECT_EQ(played.shown.at(1).back(), bag_frames - 1);
  EXPECT_EQ(played.at_ns.at(0).back(), first_ns + (bag_frames - 1) * 1000);
}

TEST_F(BagRecording, NamesAFilmInMessagesOfPictures) {
  const auto bag_of = [&](const std::string& format, const std::string& picture) {
    std::vector<WrittenMessage> messages;
    for (int k = 0; k < bag_frames; ++k)
      messages.push_back({"/left", "sensor_msgs/msg/CompressedImage", first_ns + k * period_ns,
                          compressed_image({}, first_ns + k * period_ns, format, picture)});
    return write("a.mcap", mcap_of(messages));
  };
  const auto error_with = [&](const std::string& format, const std::string& picture) {
    return error_of([&] { play(bag_of(format, picture), {"left"}); });
  };
  const std::string key{"\0\0\0\1\x67", 5};
  for (const std::string format : {"h264", "h265", "av1"})
    EXPECT_THAT(error_with(format, format == "av1" ? "\x12" : key),
                AllOf(HasSubstr("no frame of it can be played"), HasSubstr("format \"" + format),
                      HasSubstr("convert these messages to a video")));
  EXPECT_THAT(error_with("jpeg", "none"), AllOf(HasSubstr("neither JPEG"), testing::Not(HasSubstr("video"))));
}

// ---- Damage: what is shown is right, and a message says what is missing.

TEST_F(BagRecording, PlaysACutOffBagUpToTheCut) {
  struct Kind {
    std::string name, bytes;
  };
  std::vector<Kind> kinds;
  for (const std::string compression : {"", "lz4", "zstd"})
    kinds.push_back({"mcap " + compression, mcap_of(two_cameras({}), {.compression = compression})});
  kinds.push_back({"mcap without chunks", mcap_of(two_cameras({}), {.has_chunks = false})});
  kinds.push_back({"bag", ros1_bag_of(two_cameras({.is_ros1 = true}, ""), "none")});
  kinds.push_back({"bag lz4", ros1_bag_of(two_cameras({.is_ros1 = true}, ""), "lz4")});
  for (const Kind& kind : kinds) {
    std::size_t most = 0;
    for (int percent = 40; percent < 100; percent += 6) {
      SCOPED_TRACE(kind.name + " " + std::to_string(percent) + " %");
      const auto bag = write("cut", kind.bytes.substr(0, kind.bytes.size() * static_cast<std::size_t>(percent) / 100));
      Played played;
      const std::string error = error_of([&] { played = play(bag); });
      if (error != "(accepted)") {  // the cut is before the first picture
        EXPECT_THAT(error, AllOf(HasSubstr("nothing of it is left"),
                                 testing::AnyOf(HasSubstr("cut off"), HasSubstr("is damaged"))));
        continue;
      }
      for (const auto& [camera, shown] : played.shown)
        for (std::size_t k = 0; k < shown.size(); ++k) {
          EXPECT_EQ(shown[k], static_cast<int>(k));
          EXPECT_EQ(played.at_ns.at(camera)[k], first_ns + std::int64_t(k) * period_ns + camera * 20'000'000);
        }
      most = std::max(most, played.shown.at(1).size());
      if (played.shown.at(0).size() + played.shown.at(1).size() < 2 * bag_frames) {  // else only its index is cut
        EXPECT_THAT(played.warnings,
                    Contains(testing::AnyOf(HasSubstr("cut off"), HasSubstr("no index"), HasSubstr("damaged"))));
      }
    }
    EXPECT_GE(most, std::size_t{10}) << kind.name;
  }
}

TEST_F(BagRecording, GoesOnBehindADamagedChunk) {
  std::string bytes = mcap_of(two_cameras({}), {.compression = "zstd"});
  const auto chunk = bytes.find("\x28\xb5\x2f\xfd", bytes.size() / 3);  // some chunk in the middle
  ASSERT_NE(chunk, std::string::npos);
  for (std::size_t i = 0; i < 40; ++i) bytes[chunk + i] = '\x55';
  const Played played = play(write("a.mcap", bytes));
  EXPECT_LT(played.shown.at(0).size(), std::size_t{bag_frames});
  EXPECT_EQ(played.shown.at(0).back(), bag_frames - 1);
  EXPECT_THAT(played.warnings, Contains(HasSubstr("a chunk does not decompress")));
  bytes = mcap_of(two_cameras({}));
  bytes[bytes.size() / 2 - 3000] ^= 1;  // in a picture
  EXPECT_THAT(play(write("b.mcap", bytes)).warnings, Contains(HasSubstr("wrong checksum")));
}

TEST_F(BagRecording, PlaysACutOffDatabaseUpToTheCut) {
  write_db3(folder / "a.db3", two_cameras({}));
  const std::string bytes = capture::read_bytes(folder / "a.db3");
  const auto bag = write("cut.db3", bytes.substr(0, bytes.size() / 2));
  const std::string error = error_of([&] {
    const Played played = play(bag);
    EXPECT_THAT(played.warnings, Contains(HasSubstr("cut off or damaged")));
    for (std::size_t k = 0; k < played.shown.at(1).size(); ++k) EXPECT_EQ(played.shown.at(1)[k], static_cast<int>(k));
  });
  EXPECT_THAT(error, testing::AnyOf("(accepted)", HasSubstr("cut.db3")));
}

TEST_F(BagRecording, NoDamageCrashes) {
  std::mt19937 random(7);
  for (const std::string& whole :
       {mcap_of(two_cameras({}), {.compression = "lz4"}), mcap_of(two_cameras({})),
        mcap_of(two_cameras({}), {.has_chunks = false}), ros1_bag_of(two_cameras({.is_ros1 = true}, ""), "bz2")})
    for (int round = 0; round < 60; ++round) {
      std::string bytes = whole;
      // Heads are where the lengths are.
      const std::size_t reach = round % 2 == 0 ? bytes.size() : std::min<std::size_t>(bytes.size(), 600);
      for (int i = 0; i < 6; ++i) bytes[random() % reach] = static_cast<char>(random());
      if (round % 3 == 0) bytes.resize(bytes.size() - random() % (bytes.size() / 2));
      try {
        play(write("damaged", bytes));
      } catch (const files::ConfigError& error) {
        EXPECT_THAT(error.what(), HasSubstr("damaged"));
      }
    }
}

// ---- Which topic is which camera

std::vector<std::string> names_of(const std::filesystem::path& folder,
                                  const std::vector<std::pair<std::string, std::string>>& topics) {
  std::vector<WrittenMessage> messages;
  for (const auto& [topic, type] : topics)
    messages.push_back({topic, type, first_ns,
                        type.ends_with("CompressedImage") ? compressed_image({}, first_ns, "jpeg", flat_jpeg(0))
                                                          : raw_image({}, first_ns, 64, 48, "bgr8", 192, flat_bgr(0))});
  capture::write_text(folder / "names.mcap", mcap_of(messages));
  std::vector<std::string> names;
  for (const RecordedCamera& camera : read_recording(folder / "names.mcap").cameras)
    names.push_back(camera.name + " " + camera.topic);
  return names;
}

TEST_F(BagRecording, CallsCamerasByTheirTopics) {
  const std::string raw = "sensor_msgs/msg/Image", jpeg = "sensor_msgs/msg/CompressedImage";
  EXPECT_THAT(names_of(folder, {{"/huetrack/left/image/compressed", jpeg}, {"/huetrack/right/image/compressed", jpeg}}),
              ElementsAre("left /huetrack/left/image/compressed", "right /huetrack/right/image/compressed"));
  EXPECT_THAT(names_of(folder, {{"/cam0/image_raw", raw}, {"/cam1/image_raw", raw}}),
              ElementsAre("cam0 /cam0/image_raw", "cam1 /cam1/image_raw"));
  EXPECT_THAT(names_of(folder, {{"/", raw}, {"", raw}}), ElementsAre("camera /", "camera_2 "));
  EXPECT_THAT(names_of(folder, {{"/image_raw", raw}}), ElementsAre("image_raw /image_raw"));
  EXPECT_THAT(names_of(folder, {{"/left/color/image_raw", raw}, {"/right/color/image_raw", raw}}),
              ElementsAre("left /left/color/image_raw", "right /right/color/image_raw"));
  // Raw and compressed, rectified: one camera. Depth is none.
  EXPECT_THAT(names_of(folder, {{"/cam/image_rect", raw},
                                {"/cam/image_raw/compressed", jpeg},
                                {"/cam/image_raw", raw},
                                {"/cam/depth/image_rect_raw", raw}}),
              ElementsAre("cam /cam/image_raw"));
  EXPECT_THAT(names_of(folder, {{"/a/cam/image_raw", raw}, {"/b/cam/x/image_raw", raw}, {"/c/cam/image_raw", raw}}),
              ElementsAre("a_cam /a/cam/image_raw", "b_cam_x /b/cam/x/image_raw", "c_cam /c/cam/image_raw"));
}

TEST_F(BagRecording, IsAVideoOfARecordingWithItsTopic) {
  write("run.mcap", mcap_of(two_cameras({})));
  const auto topic_in = [&](const std::string& camera) {
    capture::write_text(folder / "recording.yaml", "version: 1\ncameras:\n  " + camera + "\n");
    return read_recording(folder).cameras.front().topic;
  };
  EXPECT_EQ(topic_in("a: {frames: run.mcap, topic: /robot/right/image_raw}"), "/robot/right/image_raw");
  EXPECT_EQ(topic_in("left: {frames: run.mcap}"), "/robot/left/image_raw/compressed");
  EXPECT_THAT(error_of([&] { topic_in("a: {frames: run.mcap}"); }),
              AllOf(HasSubstr("several topics of pictures, and none is called a"),
                    HasSubstr("a=run.mcap:/robot/left/image_raw/compressed")));
  EXPECT_THAT(error_of([&] { topic_in("a: {frames: run.mcap, topic: /x}"); }),
              AllOf(HasSubstr("has no topic /x (frames of camera a)"),
                    HasSubstr("/robot/right/image_raw (sensor_msgs/Image)")));
  EXPECT_THAT(error_of([&] { topic_in("a: {frames: run.mcap, topic: /rosout}"); }),
              HasSubstr("/rosout is of type rcl_interfaces/Log, not of"));
  write("a.mp4", "x");
  EXPECT_THAT(error_of([&] { topic_in("a: {frames: a.mp4, topic: /x}"); }),
              AllOf(HasSubstr("topic"), HasSubstr("is for a bag of ROS")));
  const std::string bag = (folder / "run.mcap").string();
  const std::vector<std::string> words{"l=" + bag + ":/robot/left/image_raw/compressed", "right=" + bag};
  const Recording recording = read_recording(words);
  EXPECT_EQ(recording.cameras[0].topic, "/robot/left/image_raw/compressed");
  EXPECT_EQ(recording.cameras[0].frames, folder / "run.mcap");
  EXPECT_EQ(recording.cameras[1].topic, "/robot/right/image_raw");
}

TEST_F(BagRecording, NamesBagsWithoutCameras) {
  const auto bag = write("a.mcap", mcap_of({{"/scan", "sensor_msgs/msg/LaserScan", first_ns, "xxxx"}}));
  EXPECT_THAT(error_of([&] { read_recording(bag); }),
              AllOf(HasSubstr("a.mcap: has no topic of sensor_msgs/Image or CompressedImage"),
                    HasSubstr("/scan (sensor_msgs/LaserScan)")));
  EXPECT_THAT(error_of([&] { read_recording(write("b.mcap", "\x89MCAP0\r\n")); }), HasSubstr("nothing of it is left"));
}

TEST_F(BagRecording, KeepsTheJpegOfTheMessage) {
  ReplaySource source(read_recording(write("a.mcap", mcap_of(two_cameras({})))), std::vector<std::string>{"left"},
                      {.keeps_encoded = true});
  const auto frame = source.next({});
  ASSERT_TRUE(frame && frame->encoded);
  EXPECT_EQ(std::string(frame->encoded->begin(), frame->encoded->end()), flat_jpeg(0));
  EXPECT_EQ(source.cameras().front().expected_frames, bag_frames);
  EXPECT_EQ(source.cameras().front().frame_period, 100ms);
}

}  // namespace
}  // namespace huetrack::recordings
