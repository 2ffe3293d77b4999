// Every line of the table "What is read" (service/recordings/README.md): the same twelve frames as each input, as a
// user gives them to replay and teach (a recording), and to intrinsics and extrinsics (pictures).
#include <gmock/gmock.h>

#include <functional>
#include <map>
#include <opencv2/imgcodecs.hpp>

#include "calib/gather/picture_source.h"
#include "capture/clips.h"
#include "recordings/bag_writer.h"
#include "recordings/recording.h"
#include "recordings/replay_source.h"

namespace huetrack::gather {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

constexpr int input_frames = 12;

class Inputs : public testing::Test {
 protected:
  static cv::Mat flat(int k) { return {48, 64, CV_8UC1, cv::Scalar(capture::level_of_frame(k))}; }
  static std::string jpeg(int k) {
    std::vector<std::uint8_t> bytes;
    cv::imencode(".jpg", flat(k), bytes, {cv::IMWRITE_JPEG_QUALITY, 95});
    return {bytes.begin(), bytes.end()};
  }
  std::string at(const std::string& name) const { return (folder / name).string(); }

  // The frames that a replay of these words shows; or its error.
  static std::string replayed(const std::vector<std::string>& words) {
    try {
      recordings::ReplaySource source(recordings::read_recording(words), std::vector<std::string>{"left"});
      return numbers([&]() -> std::optional<int> {
        const auto frame = source.next({});
        return frame ? std::optional(capture::frame_shown_by(frame->pixels)) : std::nullopt;
      });
    } catch (const std::exception& error) {
      return error.what();
    }
  }
  std::string replayed_with(const std::string& camera) const {
    capture::write_text(folder / "with.yaml", "version: 1\ncameras:\n  left: {" + camera + "}\n");
    return replayed({at("with.yaml")});
  }
  // The same for a calibration.
  static std::string gathered(const std::vector<std::string>& words) {
    try {
      const auto source = open_pictures(words, {.only = {"left"}, .tolerance_s = {}});
      std::string shown = numbers([&]() -> std::optional<int> {
        auto set = source->next({});
        while (set && !set->pictures.front()) set = source->next({});  // omitted, with a warning
        if (!set) return std::nullopt;
        return capture::frame_of_level(
            set->pictures.front()->grey.at<std::uint8_t>(24, set->pictures.front()->grey.cols / 2));
      });
      for (const auto& warning : source->take_warnings()) shown += " " + warning;
      return shown;
    } catch (const std::exception& error) {
      return error.what();
    }
  }
  static std::string numbers(const std::function<std::optional<int>()>& next) {
    std::string list;
    while (const auto number = next()) list += (list.empty() ? "" : " ") + std::to_string(*number);
    return list;
  }

  const capture::TemporaryFolder temporary;
  const fs::path folder = temporary.path();
  const std::string all = "0 1 2 3 4 5 6 7 8 9 10 11";
};

TEST_F(Inputs, RecordingAndVideo) {
  capture::write_clip(folder / "a.mkv", {});
  capture::write_text(folder / "recording.yaml", "version: 1\ncameras:\n  left: {frames: a.mkv}\n");
  for (const std::string& recording : {folder.string(), at("recording.yaml")}) {
    EXPECT_EQ(replayed({recording}), all);
    EXPECT_EQ(gathered({recording}), all);
  }
  for (const std::string name : {"a.mkv", "a.mp4", "a.avi", "a.mov"}) {
    capture::write_clip(folder / name, {.codec = name == "a.mkv" ? "ffv1" : "mjpeg",
                                        .format = name == "a.mkv" ? AV_PIX_FMT_YUV422P : AV_PIX_FMT_YUVJ422P});
    EXPECT_EQ(replayed({"left=" + at(name)}), all) << name;
    EXPECT_EQ(gathered({"left=" + at(name)}), all) << name;
  }
}

TEST_F(Inputs, FilmInSeveralFiles) {
  capture::write_clip(folder / "whole.ts", {.codec = "mpeg2video", .format = AV_PIX_FMT_YUV420P});
  const std::string bytes = capture::read_bytes(folder / "whole.ts");
  const std::size_t half = bytes.size() / 188 / 2 * 188;
  fs::create_directories(folder / "cards" / "left");
  capture::write_text(folder / "cards" / "left" / "00000.MTS", bytes.substr(0, half));
  capture::write_text(folder / "cards" / "left" / "00001.MTS", bytes.substr(half));
  EXPECT_EQ(replayed({"left=" + at("cards/left")}), all);
  EXPECT_EQ(gathered({"left=" + at("cards/left")}), all);
  EXPECT_EQ(gathered({at("cards")}), all);
}

TEST_F(Inputs, JpegsOneAfterTheOther) {
  std::string bytes;
  for (int k = 0; k < input_frames; ++k) bytes += jpeg(k);
  capture::write_text(folder / "a.mjpeg", bytes);
  EXPECT_EQ(replayed_with("frames: a.mjpeg, fps: 10"), all);
  EXPECT_EQ(gathered({at("with.yaml")}), all);
  EXPECT_THAT(replayed({"left=" + at("a.mjpeg")}), HasSubstr("give fps or timestamps in a recording.yaml"));
  EXPECT_THAT(gathered({"left=" + at("a.mjpeg")}), HasSubstr("give fps or timestamps in a recording.yaml"));
}

TEST_F(Inputs, Images) {
  fs::create_directory(folder / "imgs");
  for (int k = 0; k < input_frames; ++k)
    cv::imwrite(at("imgs/" + std::string(k < 10 ? "0" : "") + std::to_string(k) + ".png"), flat(k));
  for (const std::string frames : {"imgs/%02d.png", "imgs/*.png"}) {
    EXPECT_EQ(replayed_with("frames: '" + frames + "', fps: 10"), all);
    EXPECT_EQ(gathered({"left=" + at(frames)}), all);
  }
  EXPECT_THAT(replayed({"left=" + at("imgs/*.png")}), HasSubstr("give fps or timestamps in a recording.yaml"));
  EXPECT_EQ(gathered({"left=" + at("imgs")}), all);
  EXPECT_THAT(replayed({"left=" + at("imgs")}), HasSubstr("images as a pattern like %06d.png"));
}

// Of a camera of 12 bits: 0 to 4095 in samples of 16.
TEST_F(Inputs, ImagesOfTwelveBits) {
  fs::create_directory(folder / "deep");
  for (int k = 0; k < input_frames; ++k) {
    cv::Mat deep;
    flat(k).convertTo(deep, CV_16U, 16);
    deep.at<std::uint16_t>(0, 0) = 4095;
    cv::imwrite(at("deep/" + std::to_string(k) + ".png"), deep);
    cv::imwrite(at("deep/" + std::to_string(k) + ".tif"), deep);
  }
  for (const std::string frames : {"deep/%d.png", "deep/%d.tif"}) {
    EXPECT_EQ(gathered({"left=" + at(frames)}), all);
    EXPECT_EQ(replayed_with("frames: '" + frames + "', fps: 10, bits: 12"), all) << frames;
  }
}

TEST_F(Inputs, RosBag) {
  std::vector<recordings::WrittenMessage> messages, of_ros1;
  for (int k = 0; k < input_frames; ++k) {
    const std::int64_t stamp = 1'700'000'000'000'000'000 + k * 100'000'000;
    messages.push_back({"/left/image_raw/compressed", "sensor_msgs/msg/CompressedImage", stamp,
                        recordings::compressed_image({}, stamp, "jpeg", jpeg(k))});
    of_ros1.push_back({"/left/image_raw/compressed", "sensor_msgs/CompressedImage", stamp,
                       recordings::compressed_image({.is_ros1 = true}, stamp, "jpeg", jpeg(k))});
  }
  capture::write_text(folder / "a.mcap", recordings::mcap_of(messages, {.compression = "zstd"}));
  capture::write_text(folder / "a.bag", recordings::ros1_bag_of(of_ros1, "lz4"));
  recordings::write_db3(folder / "a.db3", messages);
  fs::create_directory(folder / "run");
  fs::copy(folder / "a.db3", folder / "run" / "run_0.db3");
  capture::write_text(folder / "run" / "metadata.yaml",
                      "rosbag2_bagfile_information:\n  relative_file_paths: [run_0.db3]\n");
  for (const std::string name : {"a.mcap", "a.bag", "a.db3", "run"})
    for (const std::string& word : {at(name), "left=" + at(name), "left=" + at(name) + ":/left/image_raw/compressed"}) {
      EXPECT_EQ(replayed({word}), all) << word;
      EXPECT_EQ(gathered({word}), all) << word;
    }
}

TEST_F(Inputs, PartOfAPicture) {
  fs::create_directory(folder / "pairs");
  for (int k = 0; k < input_frames; ++k) {
    cv::Mat pair;
    cv::hconcat(flat(0), flat(k), pair);
    cv::imwrite(at("pairs/" + std::to_string(k) + ".png"), pair);
  }
  const std::string part = "@64,0,64,48";
  EXPECT_EQ(gathered({"left=" + at("pairs") + part}), all);
  EXPECT_THAT(gathered({"left=" + at("pairs") + "@100,0,64,48"}), HasSubstr("no part of the picture, which is 128x48"));
  EXPECT_EQ(replayed_with("frames: 'pairs/%d.png', fps: 10, crop: [64, 0, 64, 48]"), all);
  EXPECT_EQ(gathered({at("with.yaml")}), all);
  capture::write_clip(folder / "a.mkv", {.width = 128});
  EXPECT_EQ(replayed({"left=" + at("a.mkv") + "@32,0,64,48"}), all);
  EXPECT_EQ(gathered({"left=" + at("a.mkv") + "@32,0,64,48"}), all);
}

TEST_F(Inputs, PicturesThatMustBeConverted) {
  fs::create_directory(folder / "phone");
  capture::write_text(folder / "phone" / "IMG_1.HEIC", std::string("\0\0\0\x18"
                                                                   "ftypheic\0\0\0\0mif1heic",
                                                                   24));
  EXPECT_THAT(replayed({"left=" + at("phone/IMG_1.HEIC")}), HasSubstr("heif-convert -q 98 IMG_1.HEIC IMG_1.jpg"));
  EXPECT_THAT(gathered({"left=" + at("phone/IMG_1.HEIC")}), HasSubstr("heif-convert"));
  fs::copy_file(at("phone/IMG_1.HEIC"), at("renamed.jpg"));
  EXPECT_THAT(replayed({"left=" + at("renamed.jpg")}),
              HasSubstr("heif-convert -q 98 renamed.jpg renamed_converted.jpg"));
  EXPECT_THAT(gathered({"left=" + at("phone")}), HasSubstr("holds no images; IMG_1.HEIC is a HEIC picture"));
}

TEST_F(Inputs, ChaptersThatMustBeJoined) {
  fs::create_directory(folder / "card");
  for (const std::string name : {"card/GX010001.MP4", "card/GX020001.MP4"})
    capture::write_clip(folder / name, {.codec = "libx264", .format = AV_PIX_FMT_YUV420P});
  EXPECT_THAT(replayed({"left=" + at("card")}), HasSubstr("ffmpeg -f concat"));
  EXPECT_THAT(gathered({"left=" + at("card")}), HasSubstr("holds no images; GX010001.MP4 is a film"));
}

// Each command says what they are.
TEST_F(Inputs, FilesThatAreCalledLikeBagsAndAreNone) {
  for (const std::string name : {"noise.mcap", "noise.bag", "noise.db3"}) {
    capture::write_text(folder / name, std::string("\xE1\x9F\x03\x80\x00\xFF", 6));
    const auto is_named = HasSubstr("does not begin like one");
    EXPECT_THAT(replayed({at(name)}), is_named);
    EXPECT_THAT(replayed({"left=" + at(name)}), is_named);
    EXPECT_THAT(gathered({at(name)}), is_named);
    EXPECT_THAT(gathered({"left=" + at(name)}), is_named);
  }
}

// What the table says and this file does not test: a live camera (tests/gather/live_test.cpp, end_to_end).
TEST_F(Inputs, AreTheLinesOfTheTable) {
  const std::string readme = capture::read_bytes(fs::path(HUETRACK_SOURCE_DIR) / "service/recordings/README.md");
  const auto table =
      readme.substr(readme.find("## What is read"), readme.find("\"with\":") - readme.find("## What is read"));
  std::vector<std::string> lines;
  for (auto at = table.find("\n| "); at != std::string::npos; at = table.find("\n| ", at + 1))
    lines.push_back(table.substr(at + 3, table.find_first_of(":|(,", at + 3) - at - 3));
  for (std::string& line : lines) line.erase(line.find_last_not_of(' ') + 1);
  EXPECT_THAT(lines, testing::ElementsAre("input", "recording", "video", "film in several files", "film in chapters",
                                          "JPEGs one after the other", "images", "folder of images", "ROS bag",
                                          "part of a picture", "live camera", "HEIC"));
}

}  // namespace
}  // namespace huetrack::gather
