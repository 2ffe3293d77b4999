// Damaged recordings: an error at the start that names the file, or the good part and a warning; never a crash, and
// never a frame at the wrong time.
#include <gmock/gmock.h>
#include <sys/stat.h>

#include <map>
#include <random>

#include "calib/files/config_error.h"
#include "capture/clips.h"
#include "recordings/replay_source.h"

namespace huetrack::recordings {
namespace {

using namespace std::chrono_literals;
using testing::AllOf;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

struct Played {
  std::map<int, std::uint64_t> hashes;  // of the frames with an image, by time * fps
  std::map<int, int> shown;             // which frame the image says it is
  std::vector<int> corrupted;           // time * fps
  std::vector<std::string> warnings;
  ReplayCamera camera;
};

constexpr int fps = 10;  // of all clips

// throws ConfigError
Played play(const std::filesystem::path& frames, int threads = 1) {
  Recording recording;
  recording.file = "recording.yaml";
  recording.cameras.resize(1);
  recording.cameras[0].name = "cam";
  recording.cameras[0].frames = frames;
  recording.cameras[0].fps = fps;
  const std::vector<std::string> names{"cam"};
  ReplaySource source(recording, names, {.decoder_threads = threads});
  Played played;
  std::optional<capture::Timestamp> before;
  std::optional<std::uint32_t> sequence;
  while (const auto frame = source.next({})) {
    EXPECT_TRUE(!before || frame->captured_at > *before);
    EXPECT_TRUE(!sequence || frame->sequence > *sequence);
    before = frame->captured_at;
    sequence = frame->sequence;
    const int k = static_cast<int>(std::lround(capture::seconds(frame->captured_at) * fps));
    EXPECT_EQ(frame->sequence, static_cast<unsigned>(k));
    if (frame->status == capture::FrameStatus::ok) {
      EXPECT_EQ(frame->pixels.width, source.cameras()[0].width);
      EXPECT_EQ(frame->pixels.height, source.cameras()[0].height);
      played.hashes[k] = capture::hash_of(frame->pixels);  // reads every byte
      played.shown[k] = capture::frame_shown_by(frame->pixels);
    } else {
      EXPECT_EQ(frame->pixels.width, 0);
      played.corrupted.push_back(k);
    }
  }
  played.warnings = source.take_warnings();
  played.camera = source.cameras()[0];
  EXPECT_EQ(played.camera.frames, static_cast<std::int64_t>(played.hashes.size()));
  EXPECT_EQ(played.camera.corrupted, static_cast<std::int64_t>(played.corrupted.size()));
  return played;
}

std::string error_of(const std::filesystem::path& frames) {
  try {
    play(frames);
  } catch (const files::ConfigError& error) {
    return error.what();
  }
  return "(accepted)";
}

void expect_right_numbers(const Played& played) {
  for (const auto& [k, shown] : played.shown) EXPECT_EQ(k, shown);
}

// The middle of the packet, where the picture is.
bool spoil(AVPacket& packet) {
  for (int i = packet.size / 3; i < packet.size / 2; ++i) packet.data[i] ^= 0x5A;
  return true;
}

capture::Clip ffv1() {
  return {};
}
capture::Clip mjpeg() {
  return {.codec = "mjpeg", .format = AV_PIX_FMT_YUVJ422P};
}
capture::Clip mpeg4() {
  return {.codec = "mpeg4", .format = AV_PIX_FMT_YUV420P, .frames = 20, .key_frame_every = 5, .b_frames = 2};
}

class Damaged : public testing::Test {
 protected:
  std::filesystem::path write(const std::string& name, const capture::Clip& clip) {
    capture::write_clip(folder / name, clip);
    return folder / name;
  }
  capture::TemporaryFolder folder;
};

TEST_F(Damaged, UndecodableFrameIsCorruptedAndNumbersStayRight) {
  for (const std::string file : {"a.mkv", "a.avi"}) {
    capture::Clip clip = ffv1();
    clip.tamper = [](int k, AVPacket& packet) { return k == 4 || k == 7 ? spoil(packet) : true; };
    const Played played = play(write(file, clip));
    EXPECT_THAT(played.corrupted, ElementsAre(4, 7)) << file;
    EXPECT_EQ(played.shown.size(), 10u);
    expect_right_numbers(played);
    EXPECT_THAT(played.warnings, ElementsAre(AllOf(HasSubstr(file), HasSubstr("frame 4 ")), HasSubstr("frame 7 ")));
  }
}

TEST_F(Damaged, FramesPredictedFromALostOneAreCorrupted) {
  capture::Clip clip = ffv1();
  clip.key_frame_every = 4;
  clip.tamper = [](int k, AVPacket& packet) { return k == 5 ? spoil(packet) : true; };
  const Played played = play(write("a.mkv", clip));
  EXPECT_THAT(played.corrupted, ElementsAre(5, 6, 7));
  expect_right_numbers(played);
}

TEST_F(Damaged, CutJpegFrameIsCorrupted) {  // what a webcam on a crowded USB bus gives
  for (const std::string file : {"a.mkv", "a.avi"}) {
    capture::Clip clip = mjpeg();
    clip.tamper = [](int k, AVPacket& packet) {
      if (k == 4) av_shrink_packet(&packet, packet.size / 2);
      return true;
    };
    const Played played = play(write(file, clip));
    EXPECT_THAT(played.corrupted, ElementsAre(4)) << file;
    EXPECT_EQ(played.shown.size(), 11u);
    expect_right_numbers(played);
    EXPECT_THAT(played.warnings, ElementsAre(HasSubstr("frame 4 ")));
  }
}

// Not damaged, but recorded with a dropped frame: fps counts stored frames, so the user must know.
TEST_F(Damaged, WarnsOfAFrameThatWasNeverWritten) {
  capture::Clip clip = mjpeg();
  clip.frames = 40;
  clip.tamper = [](int k, AVPacket&) { return k != 4; };
  const Played played = play(write("a.mkv", clip));
  EXPECT_THAT(played.corrupted, IsEmpty());
  EXPECT_THAT(played.warnings, ElementsAre(AllOf(HasSubstr("missing before frame 4"), HasSubstr("leave fps out"))));
}

TEST_F(Damaged, FramesOfAReorderingCodecKeepTheirNumbers) {
  for (const std::string file : {"a.mkv", "a.mp4"}) {
    capture::Clip clip = mpeg4();
    clip.tamper = [](int k, AVPacket& packet) { return k == 6 ? spoil(packet) : true; };
    const Played played = play(write(file, clip));
    EXPECT_GE(played.corrupted.size(), 1u) << file;
    EXPECT_LE(played.corrupted.size(), 7u);
    EXPECT_EQ(played.corrupted.size() + played.shown.size(), 20u);
    expect_right_numbers(played);
    EXPECT_THAT(played.warnings, Not(IsEmpty()));
  }
}

TEST_F(Damaged, ManyLostFramesAreSummedUp) {
  capture::Clip clip = ffv1();
  clip.frames = 20;
  clip.tamper = [](int k, AVPacket& packet) { return k >= 2 ? spoil(packet) : true; };
  const Played played = play(write("a.mkv", clip));
  EXPECT_EQ(played.corrupted.size(), 18u);
  ASSERT_EQ(played.warnings.size(), 6u);
  EXPECT_THAT(played.warnings.back(), HasSubstr("13 more frames that do not decode"));
}

TEST_F(Damaged, CorruptedStartIsCountedAndTheRestPlayed) {
  capture::Clip clip = mjpeg();
  clip.tamper = [](int k, AVPacket& packet) {
    if (k < 2) av_shrink_packet(&packet, packet.size / 2);
    return true;
  };
  const Played played = play(write("a.avi", clip));
  EXPECT_THAT(played.corrupted, ElementsAre(0, 1));
  expect_right_numbers(played);
  EXPECT_EQ(played.shown.size(), 10u);
}

TEST_F(Damaged, VideoWithoutGoodFramesIsAnError) {
  capture::Clip clip = ffv1();
  clip.tamper = [](int, AVPacket& packet) { return spoil(packet); };
  EXPECT_THAT(error_of(write("a.mkv", clip)), AllOf(HasSubstr("a.mkv"), HasSubstr("no frame")));
}

TEST_F(Damaged, TruncatedFileIsPlayedWithAWarning) {
  for (const auto& [file, clip] : {std::pair<std::string, capture::Clip>{"f.mkv", ffv1()},
                                   {"m.mkv", mjpeg()},
                                   {"m.avi", mjpeg()},
                                   {"b.mkv", mpeg4()}}) {
    const std::string bytes = capture::read_bytes(write(file, clip));
    capture::write_text(folder / ("cut_" + file), bytes.substr(0, bytes.size() * 6 / 10));
    const Played played = play(folder / ("cut_" + file));
    EXPECT_GE(played.shown.size(), 3u) << file;
    EXPECT_LT(played.shown.size(), static_cast<std::size_t>(clip.frames) * 3 / 4) << file;
    expect_right_numbers(played);
    EXPECT_THAT(played.warnings, Contains(AllOf(HasSubstr("cut_" + file), HasSubstr("cut off")))) << file;
  }
}

TEST_F(Damaged, TruncatedMp4IsAnError) {  // its index is at the end
  const std::string bytes = capture::read_bytes(write("a.mp4", mpeg4()));
  capture::write_text(folder / "cut.mp4", bytes.substr(0, bytes.size() / 2));
  EXPECT_THAT(error_of(folder / "cut.mp4"), HasSubstr("cut.mp4"));
}

TEST_F(Damaged, HoleInTheFileDoesNotShiftLaterFrames) {
  for (const auto& [file, clip] :
       {std::pair<std::string, capture::Clip>{"f.mkv", ffv1()}, {"m.mkv", mjpeg()}, {"m.avi", mjpeg()}}) {
    capture::Clip longer = clip;
    longer.width = 320;  // so that there are several clusters
    longer.height = 240;
    longer.frames = 24;
    longer.fps = fps;
    std::string bytes = capture::read_bytes(write(file, longer));
    // over two to three frames, their headers included
    const std::size_t from = bytes.size() * 4 / 10;
    bytes.replace(from, bytes.size() / 10, std::string(bytes.size() / 10, '\0'));
    capture::write_text(folder / ("hole_" + file), bytes);
    const Played played = play(folder / ("hole_" + file));
    expect_right_numbers(played);
    EXPECT_GE(played.shown.size(), 15u) << file;
    EXPECT_TRUE(played.shown.contains(23)) << file;
    EXPECT_GE(played.corrupted.size(), 2u) << file;
    EXPECT_THAT(played.warnings, Not(IsEmpty())) << file;
  }
}

TEST_F(Damaged, PipeAmongTheImagesIsNamedAndDoesNotBlock) {
  write("%d.png", {.codec = "png", .format = AV_PIX_FMT_RGB24, .frames = 6});
  std::filesystem::remove(folder / "3.png");
  ASSERT_EQ(::mkfifo((folder / "3.png").c_str(), 0600), 0);
  const Played played = play(folder / "%d.png");
  EXPECT_EQ(played.hashes.size(), 5u);
  EXPECT_THAT(played.corrupted, ElementsAre(2));
  EXPECT_THAT(played.warnings, ElementsAre(HasSubstr("3.png")));
}

TEST_F(Damaged, ImagesThatDoNotDecodeAreNamed) {
  write("%d.png", {.codec = "png", .format = AV_PIX_FMT_RGB24, .frames = 6});
  const std::string bytes = capture::read_bytes(folder / "3.png");
  capture::write_text(folder / "3.png", bytes.substr(0, bytes.size() / 2));
  capture::write_text(folder / "4.png", "");
  capture::write_text(folder / "5.png", "not an image");
  const Played played = play(folder / "%d.png");
  EXPECT_THAT(played.corrupted, ElementsAre(2, 3, 4));
  expect_right_numbers(played);
  EXPECT_THAT(played.warnings, ElementsAre(HasSubstr("3.png"), HasSubstr("4.png"), HasSubstr("5.png")));
}

// ---- Seeded mutations: flipped bytes, holes, cuts, doubled and left-out pieces

std::string mutate(std::string bytes, std::mt19937_64& rng) {
  const auto at = [&](std::size_t n) { return static_cast<std::size_t>(rng() % std::max<std::size_t>(n, 1)); };
  for (std::size_t i = 0, n = 1 + at(4); i < n && !bytes.empty(); ++i) {
    const std::size_t from = at(at(4) == 0 ? std::min<std::size_t>(bytes.size(), 600) : bytes.size());  // headers too
    const std::size_t length = std::min(1 + at(200), bytes.size() - from);
    switch (rng() % 7) {
      case 0:
      case 1:
      case 2:
        bytes[from] = static_cast<char>(rng());
        break;
      case 3:
        bytes[from] = static_cast<char>(bytes[from] ^ (1 << rng() % 8));
        break;
      case 4:
        bytes.replace(from, length, std::string(length, static_cast<char>(rng() % 2 == 0 ? 0 : 0xFF)));
        break;
      case 5:
        bytes.erase(from, length);
        break;
      default:
        if (rng() % 3 == 0)
          bytes.resize(from);
        else
          bytes.insert(from, bytes.substr(from, length));
    }
  }
  return bytes;
}

struct FuzzCase {
  const char* file;
  capture::Clip clip;
  int mutations;
  // FFV1 has checksums, so what is played must be true, and at its time. In AVI, where a frame's time is its number,
  // pieces that are cut out shift it; in Matroska that takes damaged time stamps as well.
  int most_wrong_percent = 100;
};
void PrintTo(const FuzzCase& c, std::ostream* out) {
  *out << c.clip.codec << " in " << c.file;
}

class Mutated : public testing::TestWithParam<FuzzCase> {};

TEST_P(Mutated, FilesNeverCrashTheReader) {
  const FuzzCase& c = GetParam();
  const capture::TemporaryFolder folder;
  capture::write_clip(folder / c.file, c.clip);
  const std::string original = capture::read_bytes(folder / c.file);
  const Played clean = play(folder / c.file);
  ASSERT_THAT(clean.warnings, IsEmpty());
  int errors = 0;
  int played_files = 0;
  int wrong_images = 0;
  int images = 0;
  for (int i = 0; i < c.mutations; ++i) {
    std::mt19937_64 rng(static_cast<std::uint64_t>(i));
    const auto file = folder / ("mutated_" + std::string(c.file));
    capture::write_text(file, mutate(original, rng));
    try {
      const Played played = play(file, 1 + i % 2);
      ++played_files;
      EXPECT_LE(played.hashes.size() + played.corrupted.size(), 4000u) << i;
      for (const auto& warning : played.warnings) EXPECT_THAT(warning, Not(HasSubstr("\n")));
      for (const auto& [k, hash] : played.hashes) {
        ++images;
        const auto truth = clean.hashes.find(k);
        wrong_images += truth == clean.hashes.end() || truth->second != hash ? 1 : 0;
      }
      if (i % 8 == 0) {
        const Played again = play(file, 3);
        EXPECT_EQ(again.hashes, played.hashes) << i;
        EXPECT_EQ(again.corrupted, played.corrupted) << i;
      }
    } catch (const files::ConfigError& error) {
      ++errors;
      EXPECT_THAT(error.what(), AllOf(HasSubstr(c.file), Not(HasSubstr("\n")))) << i;
    }
  }
  EXPECT_EQ(errors + played_files, c.mutations);
  EXPECT_GT(played_files, c.mutations / 20);
  RecordProperty("errors", errors);
  RecordProperty("images", images);
  RecordProperty("wrong_images", wrong_images);
  EXPECT_LE(wrong_images, images * c.most_wrong_percent / 100);
}

INSTANTIATE_TEST_SUITE_P(
    Files, Mutated,
    testing::Values(FuzzCase{"a.mkv", ffv1(), 300, 2}, FuzzCase{"a.avi", ffv1(), 100, 12},
                    FuzzCase{"a.mkv", mjpeg(), 200}, FuzzCase{"a.avi", mjpeg(), 200}, FuzzCase{"a.mp4", mpeg4(), 200},
                    FuzzCase{"a.mkv", mpeg4(), 100},
                    FuzzCase{"a.jpg", {.codec = "mjpeg", .format = AV_PIX_FMT_YUVJ420P, .frames = 1}, 200}));

}  // namespace
}  // namespace huetrack::recordings
