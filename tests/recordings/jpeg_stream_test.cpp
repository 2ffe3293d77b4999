// Files of JPEGs one after the other, films in several files, and pictures that must be converted.
#include <gmock/gmock.h>

#include <numeric>

#include "calib/files/config_error.h"
#include "capture/clips.h"
#include "capture/frames/jpeg_encoder.h"
#include "recordings/recording.h"
#include "recordings/replay_source.h"

namespace huetrack::recordings {
namespace {

using namespace std::chrono_literals;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

std::string grey_jpeg(int k) {
  const auto flat = capture::make_image(capture::PixelFormat::grey, capture::ColorRange::full, 64, 48);
  std::fill_n(flat.data[0], 64 * 48, static_cast<std::uint8_t>(capture::level_of_frame(k)));
  const auto bytes = capture::encode_picture(flat.image, {64, 48}, 95);
  return {bytes.begin(), bytes.end()};
}

class FilesOfCameras : public testing::Test {
 protected:
  struct Played {
    std::vector<int> shown;
    std::vector<std::string> warnings;
    std::vector<capture::Timestamp> at;
  };
  Played play(const std::string& camera) {
    capture::write_text(folder / "recording.yaml", "version: 1\ncameras:\n  cam: {" + camera + "}\n");
    ReplaySource source(read_recording(folder), std::vector<std::string>{"cam"});
    Played played;
    while (const auto frame = source.next({})) {
      const bool is_ok = frame->status == capture::FrameStatus::ok;
      played.shown.push_back(is_ok ? capture::frame_shown_by(frame->pixels) : -1);
      played.at.push_back(frame->captured_at);
    }
    played.warnings = source.take_warnings();
    return played;
  }
  std::string error_of(const std::string& camera) {
    try {
      play(camera);
    } catch (const files::ConfigError& error) {
      return error.what();
    }
    return "(accepted)";
  }

  const capture::TemporaryFolder temporary;
  const std::filesystem::path folder = temporary.path();
};

std::string with_orientation(const std::string& jpeg, char tag) {
  const std::string exif("Exif\0\0II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0", 24);
  const std::string data = exif + std::string(1, tag) + std::string(7, '\0');
  return jpeg.substr(0, 2) + "\xff\xe1" + std::string({'\0', char(data.size() + 2)}) + data + jpeg.substr(2);
}

// A phone's or webcam's, on its head: level 100 + 40 in the upper left quarter.
TEST_F(FilesOfCameras, JpegsOneAfterTheOtherAreTurnedAsTheirTagsSay) {
  const auto corner = capture::make_image(capture::PixelFormat::grey, capture::ColorRange::full, 64, 48);
  for (int v = 0; v < 48; ++v)
    for (int u = 0; u < 64; ++u) corner.data[0][v * 64 + u] = static_cast<std::uint8_t>(u < 32 && v < 24 ? 140 : 100);
  const auto bytes = capture::encode_picture(corner.image, {64, 48}, 95);
  const std::string tagged = with_orientation({bytes.begin(), bytes.end()}, 3);
  capture::write_text(folder / "a.mjpeg", tagged + tagged);
  capture::write_text(folder / "recording.yaml", "version: 1\ncameras:\n  cam: {frames: a.mjpeg, fps: 10}\n");
  ReplaySource source(read_recording(folder), std::vector<std::string>{"cam"});
  const auto frame = source.next({});
  ASSERT_TRUE(frame);
  EXPECT_NEAR(capture::yuv_at(frame->pixels, 50, 40).y, 140, 3);
  EXPECT_NEAR(capture::yuv_at(frame->pixels, 10, 10).y, 100, 3);
  EXPECT_TRUE(source.cameras()[0].is_turned);
  EXPECT_THAT(source.take_warnings(), ElementsAre(HasSubstr("turned by 180 degrees")));
}

TEST_F(FilesOfCameras, APictureWithoutItsBeginningKeepsItsNumber) {
  for (const std::string between : {"", "\r\n--b\r\nContent-Type: image/jpeg\r\n\r\n"}) {
    std::string bytes;
    for (int k = 0; k < 5; ++k) bytes += grey_jpeg(k) + between;
    capture::write_text(folder / "a.mjpeg", bytes.substr(grey_jpeg(0).size() / 2));
    const Played played = play("frames: a.mjpeg, fps: 10");
    EXPECT_THAT(played.shown, ElementsAre(-1, 1, 2, 3, 4));
    EXPECT_EQ(played.at.back(), capture::Timestamp(400ms));
    EXPECT_THAT(played.warnings, ElementsAre(HasSubstr("begins inside a picture, which counts as frame 0")));
  }
}

// Without a container FFmpeg takes 25 pictures a second.
TEST_F(FilesOfCameras, BytesBeforeTheFirstPictureAreLeftOut) {
  std::string jpegs;
  for (int k = 0; k < 5; ++k) jpegs += grey_jpeg(k);
  for (const std::size_t junk : {1U, 8U, 600U, 20'000U}) {
    std::string bytes;
    for (std::size_t i = 0; i < junk; ++i) bytes += static_cast<char>(0x80 + (i * i + i / 7) % 113);
    capture::write_text(folder / "a.mjpeg", bytes + jpegs);
    EXPECT_THAT(error_of("frames: a.mjpeg"), AllOf(HasSubstr("has no time stamps"), HasSubstr("give fps")));
    const Played played = play("frames: a.mjpeg, fps: 10");
    EXPECT_THAT(played.shown, ElementsAre(0, 1, 2, 3, 4)) << junk;
    EXPECT_EQ(played.at.back(), capture::Timestamp(400ms));
    EXPECT_THAT(played.warnings, ElementsAre(HasSubstr("before its first picture are left out")));
  }
}

TEST_F(FilesOfCameras, JpegsOneAfterTheOther) {
  std::string plain, saved;
  for (int k = 0; k < 5; ++k) {
    plain += grey_jpeg(k);
    saved += "--myboundary\r\nContent-Type: image/jpeg\r\nContent-Length: " + std::to_string(grey_jpeg(k).size()) +
             "\r\n\r\n" + grey_jpeg(k) + "\r\n";
  }
  capture::write_text(folder / "plain.mjpeg", plain);
  capture::write_text(folder / "saved.MJPG", saved);
  capture::write_text(folder / "cut.mjpeg", plain.substr(0, plain.size() - 100));
  for (const std::string name : {"plain.mjpeg", "saved.MJPG"}) {
    const Played played = play("frames: " + name + ", fps: 10");
    EXPECT_THAT(played.shown, ElementsAre(0, 1, 2, 3, 4));
    EXPECT_EQ(played.at.back(), capture::Timestamp(400ms));
    EXPECT_THAT(played.warnings, IsEmpty());
    // Such files have no times, and nothing invents them.
    EXPECT_THAT(error_of("frames: " + name),
                AllOf(HasSubstr("has no time stamps"), HasSubstr("give fps or timestamps")));
  }
  const Played cut = play("frames: cut.mjpeg, fps: 10");
  EXPECT_THAT(cut.shown, ElementsAre(0, 1, 2, 3, -1));
  EXPECT_THAT(cut.warnings, ElementsAre(HasSubstr("frame 4 and perhaps others do not decode")));
}

TEST_F(FilesOfCameras, OneJpegIsAPicture) {
  capture::write_text(folder / "one.jpg", grey_jpeg(3));
  EXPECT_THAT(play("frames: one.jpg, fps: 1").shown, ElementsAre(3));
  // A phone's second picture (a depth or a gain map) inside the file is not a film's.
  std::string jpeg = grey_jpeg(3);
  jpeg.insert(2, std::string("\xff\xe2\0\x08MPF\0ab", 10));
  capture::write_text(folder / "phone.jpg", jpeg + grey_jpeg(1));
  EXPECT_THAT(play("frames: phone.jpg, fps: 1").shown, ElementsAre(3));
}

// A transport stream of 24 frames in three files, cut where its packets end.
class CamcorderFolder : public FilesOfCameras {
 protected:
  void SetUp() override {
    capture::write_clip(folder / "whole.ts",
                        {.codec = "mpeg2video", .format = AV_PIX_FMT_YUV420P, .frames = 24, .key_frame_every = 12});
    bytes = capture::read_bytes(folder / "whole.ts");
    ASSERT_EQ(bytes.size() % 188, 0u);
    std::filesystem::create_directory(folder / "STREAM");
    const std::size_t third = bytes.size() / 188 / 3 * 188;
    capture::write_text(folder / "STREAM" / "00009.MTS", bytes.substr(0, third));
    capture::write_text(folder / "STREAM" / "00010.mts", bytes.substr(third, third));
    capture::write_text(folder / "STREAM" / "00011.MTS", bytes.substr(2 * third));
    capture::write_text(folder / "STREAM" / "INDEX.BDM", "x");
  }
  std::string bytes;
};

TEST_F(CamcorderFolder, IsOneFilm) {
  const Played whole = play("frames: whole.ts");
  ASSERT_EQ(whole.shown.size(), 24u);
  std::filesystem::create_directories(folder / "card/PRIVATE/AVCHD/BDMV/CLIPINF");
  std::filesystem::copy(folder / "STREAM", folder / "card/PRIVATE/AVCHD/BDMV/STREAM");
  for (const std::string frames : {"STREAM", "STREAM/*.[Mm][Tt][Ss]", "card", "card/PRIVATE", "card/PRIVATE/AVCHD"}) {
    const Played parts = play("frames: '" + frames + "'");
    EXPECT_EQ(parts.shown, whole.shown);
    EXPECT_EQ(parts.at, whole.at);
    EXPECT_EQ(parts.warnings, whole.warnings);
  }
}

// Every part has a muxer of its own, as `ffmpeg -f segment` and network recorders write them.
TEST_F(FilesOfCameras, PartsThatWereWrittenSeparatelyAreOneFilm) {
  for (const auto& [codec, b_frames, ending] :
       {std::tuple{"mpeg2video", 0, ".ts"}, {"libx264", 2, ".MTS"}, {"libx264", 2, ".m2ts"}}) {
    const std::filesystem::path name = std::string(codec) + ending;
    capture::Clip clip{.codec = codec, .format = AV_PIX_FMT_YUV420P, .fps = 25, .key_frame_every = 6};
    clip.frames = 18, clip.b_frames = b_frames;
    for (int part = 0; part < 3; ++part) {
      clip.tamper = [&](int k, AVPacket& packet) {
        packet.pts += 10, packet.dts += 10;  // not before 0, from which muxers move them
        return k / 6 == part;
      };
      capture::write_clip(folder / name / (std::to_string(part) + ending), clip);
    }
    const Played parts = play("frames: " + name.string());
    std::vector<int> expected(18);
    std::iota(expected.begin(), expected.end(), 0);
    EXPECT_EQ(parts.shown, expected) << name;
    EXPECT_THAT(parts.warnings, testing::IsEmpty()) << name;
  }
}

TEST_F(FilesOfCameras, AMissingPartIsNamedAndTheOthersKeepTheirTimes) {
  capture::Clip clip{.codec = "mpeg2video", .format = AV_PIX_FMT_YUV420P, .fps = 25, .key_frame_every = 6};
  clip.frames = 18;
  for (const int part : {0, 2}) {
    clip.tamper = [&](int k, AVPacket& packet) {
      packet.pts += 10, packet.dts += 10;
      return k / 6 == part;
    };
    capture::write_clip(folder / "film" / (std::to_string(part) + ".ts"), clip);
  }
  const Played played = play("frames: film");
  EXPECT_THAT(played.shown, ElementsAre(0, 1, 2, 3, 4, 5, 12, 13, 14, 15, 16, 17));
  EXPECT_NEAR(capture::seconds(played.at.back()), 17 / 25., 1e-4);
  EXPECT_THAT(played.warnings,
              ElementsAre(AllOf(HasSubstr("2.ts: begins 0.24 s after 0.ts ends"), HasSubstr("a part is missing"))));
}

// As action cameras write them.
TEST_F(FilesOfCameras, ChaptersInOtherContainersMustBeJoined) {
  for (int part = 0; part < 2; ++part)
    capture::write_clip(folder / "card" / ("GX0" + std::to_string(part) + "0001.MP4"),
                        {.codec = "libx264", .format = AV_PIX_FMT_YUV420P});
  EXPECT_THAT(error_of("frames: 'card/*.MP4', fps: 10"),
              AllOf(HasSubstr("GX000001.MP4: is a film (h264), not an image"), HasSubstr("ffmpeg -f concat")));
  EXPECT_THAT(error_of("frames: card, fps: 10"),
              AllOf(HasSubstr("card: is not a file"), HasSubstr("ffmpeg -f concat")));
}

TEST_F(CamcorderFolder, MayBeSplitAnywhere) {
  const Played whole = play("frames: whole.ts");
  std::filesystem::remove(folder / "STREAM" / "00010.mts");
  for (const std::size_t at : {bytes.size() / 2 / 188 * 188 + 188, bytes.size() / 2 / 188 * 188 + 77}) {
    capture::write_text(folder / "STREAM" / "00009.MTS", bytes.substr(0, at));
    capture::write_text(folder / "STREAM" / "00011.MTS", bytes.substr(at));
    const Played parts = play("frames: STREAM");
    EXPECT_EQ(parts.shown, whole.shown) << at;
    EXPECT_EQ(parts.warnings, whole.warnings) << at;
  }
}

TEST_F(CamcorderFolder, SeveralTakesAreNoFilm) {
  capture::write_text(folder / "STREAM" / "00010.mts", bytes);
  EXPECT_THAT(error_of("frames: STREAM"),
              AllOf(HasSubstr("00010.mts"), HasSubstr("several takes, not the parts of one")));
}

TEST_F(FilesOfCameras, NamesPicturesThatMustBeConverted) {
  capture::write_text(folder / "IMG_1.HEIC", std::string("\0\0\0\x18"
                                                         "ftypheic\0\0\0\0mif1heic",
                                                         24) +
                                                 std::string(500, 'x'));
  EXPECT_THAT(error_of("frames: IMG_1.HEIC"),
              AllOf(HasSubstr("IMG_1.HEIC: is a HEIC picture"), HasSubstr("`heif-convert -q 98 IMG_1.HEIC IMG_1.jpg`"),
                    HasSubstr("camera cam")));
  EXPECT_THAT(error_of("frames: '*.HEIC'"), HasSubstr("heif-convert"));
}

}  // namespace
}  // namespace huetrack::recordings
