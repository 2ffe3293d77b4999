// Files as cameras, phones and other programs make them: every picture at its own time, turned as players show it.
#include <gmock/gmock.h>

#include <cstring>
#include <map>
#include <opencv2/imgcodecs.hpp>

#include "calib/files/config_error.h"
#include "capture/clips.h"
#include "capture/ffmpeg/ffmpeg_objects.h"
#include "recordings/replay_source.h"

namespace huetrack::recordings {
namespace {

using namespace std::chrono_literals;
using capture::Clip;
using testing::AllOf;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

struct FieldPlay {
  std::vector<int> shown;         // by the picture; -1: corrupted
  std::vector<double> at_frames;  // times * fps
  std::vector<capture::Image> images;
  std::vector<std::string> warnings;
};

constexpr int field_fps = 10;  // of all clips

FieldPlay play_field(const std::filesystem::path& frames, double given_fps = 0) {
  Recording recording;
  recording.file = "recording.yaml";
  recording.cameras.resize(1);
  recording.cameras[0].name = "cam";
  recording.cameras[0].frames = frames;
  recording.cameras[0].fps = given_fps;
  const std::vector<std::string> names{"cam"};
  ReplaySource source(recording, names, {});
  FieldPlay played;
  while (const auto frame = source.next({})) {
    const bool is_whole = frame->status == capture::FrameStatus::ok;
    played.shown.push_back(is_whole ? capture::frame_shown_by(frame->pixels) : -1);
    played.at_frames.push_back(capture::seconds(frame->stamped_at) * field_fps);
    if (is_whole) played.images.push_back(frame->pixels);
  }
  played.warnings = source.take_warnings();
  return played;
}

std::vector<int> numbers_to(int count) {
  std::vector<int> numbers;
  for (int k = 0; k < count; ++k) numbers.push_back(k);
  return numbers;
}

// At even times, from whenever on.
void expect_even_times(const FieldPlay& played) {
  for (std::size_t k = 0; k < played.at_frames.size(); ++k)
    EXPECT_NEAR(played.at_frames[k] - played.at_frames[0], double(k), 0.03) << k;
}

class FieldFile : public testing::Test {
 protected:
  std::filesystem::path write(const std::string& name, const Clip& clip) {
    capture::write_clip(folder / name, clip);
    return folder / name;
  }
  capture::TemporaryFolder folder;
};

Clip with_b_frames(const std::string& codec = "mpeg4") {
  return {.codec = codec, .format = AV_PIX_FMT_YUV420P, .frames = 18, .key_frame_every = 6, .b_frames = 2};
}

// ---- Times and order

TEST_F(FieldFile, BFramesInAviHaveTheTimesOfTheirPlace) {
  for (const std::string codec : {"mpeg4", "libx264"})
    for (const double given : {0., 10.}) {
      const FieldPlay played = play_field(write("a.avi", with_b_frames(codec)), given);
      EXPECT_THAT(played.shown, numbers_to(18)) << codec;
      expect_even_times(played);
      EXPECT_THAT(played.warnings, IsEmpty()) << codec;
    }
}

// `ffmpeg -c copy -t`: a B frame before the last picture is not in the file, and not in its index.
TEST_F(FieldFile, AFilmThatWasCutWhileItWasCopiedIsWhole) {
  Clip clip = with_b_frames("libx264");
  clip.tamper = [](int k, AVPacket&) { return k < 17; };
  const FieldPlay played = play_field(write("a.mp4", clip));
  EXPECT_EQ(played.shown.size(), 17u);
  EXPECT_THAT(played.shown, testing::Not(testing::Contains(-1)));
  EXPECT_THAT(played.warnings, IsEmpty());
}

// Its header's length counts the delay of decoding.
TEST_F(FieldFile, AnAsfOfBFramesIsNotCutOff) {
  const FieldPlay played = play_field(write("a.asf", with_b_frames("libx264")));
  EXPECT_THAT(played.shown, numbers_to(18));
  EXPECT_THAT(played.warnings, IsEmpty());
}

// DivX and XviD: every B frame is in the packet of the picture that it needs, and an empty picture follows.
TEST_F(FieldFile, PackedBFramesArePicturesOfTheirOwn) {
  std::vector<std::string> coded;
  Clip clip = with_b_frames();
  clip.b_frames = 1;
  clip.tamper = [&](int, AVPacket& packet) {
    coded.emplace_back(reinterpret_cast<const char*>(packet.data), std::size_t(packet.size));
    return true;
  };
  write("plain.avi", clip);
  const std::string empty("\0\0\1\xB6\x50\x9F", 6);
  const auto kind_of = [](const std::string& picture) {  // ISO 14496-2: 2 bits behind the start code; 2: a B frame
    return static_cast<unsigned char>(picture[picture.find(std::string("\0\0\1\xB6", 4)) + 4]) >> 6;
  };
  clip.tamper = [&](int k, AVPacket& packet) {
    const auto is_b = [&](std::size_t at) { return at < coded.size() && kind_of(coded[at]) == 2; };
    const auto at = std::size_t(k);
    const std::string bytes = is_b(at) ? empty : is_b(at + 1) ? coded[at] + coded[at + 1] : coded[at];
    if (int(bytes.size()) > packet.size) capture::check(av_grow_packet(&packet, int(bytes.size()) - packet.size), "");
    av_shrink_packet(&packet, int(bytes.size()));
    std::memcpy(packet.data, bytes.data(), bytes.size());
    return true;
  };
  for (const double given : {0., 10.}) {
    const FieldPlay played = play_field(write("packed.avi", clip), given);
    EXPECT_EQ(played.shown, numbers_to(18));
    expect_even_times(played);
    EXPECT_THAT(played.warnings, IsEmpty());
  }
}

// XviD leaves out the empty picture at the end.
TEST_F(FieldFile, TheLastPackedBFrameIsShown) {
  std::vector<std::string> coded;
  Clip clip = with_b_frames();
  clip.b_frames = 1, clip.frames = 17;
  clip.tamper = [&](int, AVPacket& packet) {
    coded.emplace_back(reinterpret_cast<const char*>(packet.data), std::size_t(packet.size));
    return true;
  };
  write("plain.avi", clip);
  ASSERT_EQ(coded.size(), 17u);
  clip.tamper = [&](int k, AVPacket& packet) {
    if (k < 15) return true;
    const std::string bytes = coded[15] + coded[16];  // P16 B15
    capture::check(av_grow_packet(&packet, int(bytes.size())), "");
    av_shrink_packet(&packet, int(bytes.size()));
    std::memcpy(packet.data, bytes.data(), bytes.size());
    return k == 15;
  };
  const FieldPlay played = play_field(write("packed.avi", clip));
  EXPECT_EQ(played.shown, numbers_to(17));
  expect_even_times(played);
  EXPECT_THAT(played.warnings, IsEmpty());
}

// An encoder of B frames waits for the next picture: no frame was dropped there.
TEST_F(FieldFile, EmptyChunksOfAnAviAreFramesThatWereDropped) {
  for (const int dropped : {1, 7}) {
    Clip clip = with_b_frames();
    clip.tamper = [&](int k, AVPacket& packet) {
      if (k >= dropped) packet.pts += 1, packet.dts += 1;
      return true;
    };
    const FieldPlay played = play_field(write("a.avi", clip));
    EXPECT_EQ(played.shown, numbers_to(18)) << dropped;
    if (dropped == 1) {
      expect_even_times(played);
      EXPECT_THAT(played.warnings, IsEmpty());
    } else {
      EXPECT_NEAR(played.at_frames.back() - played.at_frames.front(), 18, 0.03);
      EXPECT_THAT(played.warnings, ElementsAre(AllOf(HasSubstr("has empty chunks at 1 place, first after picture 5"),
                                                     HasSubstr("give fps"))));
    }
  }
}

// FFmpeg writes H.264 of other containers so, at twice the rate.
TEST_F(FieldFile, AnAviMayHaveAnEmptyChunkAfterEveryPicture) {
  Clip clip = with_b_frames();
  clip.fps = 2 * field_fps;
  clip.tamper = [](int, AVPacket& packet) {
    packet.pts *= 2, packet.dts *= 2;
    return true;
  };
  for (const double given : {0., 10.}) {
    const FieldPlay played = play_field(write("a.avi", clip), given);
    EXPECT_EQ(played.shown, numbers_to(18)) << given;
    expect_even_times(played);
    EXPECT_THAT(played.warnings, IsEmpty()) << given;
  }
}

// FLV stores times of decoding from 0 on, and MP4 without an edit list.
TEST_F(FieldFile, TheDelayOfDecodingIsNoTime) {
  for (const std::string file : {"a.flv", "a.mp4", "a.mkv", "a.ts", "a.avi", "a.wmv"}) {
    const FieldPlay played = play_field(write(file, with_b_frames("libx264")));
    EXPECT_EQ(played.shown, numbers_to(18)) << file;
    expect_even_times(played);
    EXPECT_NEAR(played.at_frames.front(), 0, 0.03) << file;
  }
  Clip later = with_b_frames("libx264");  // one of another clock
  later.tamper = [](int, AVPacket& packet) {
    packet.pts += 5, packet.dts += 5;
    return true;
  };
  EXPECT_NEAR(play_field(write("later.flv", later)).at_frames.front(), 5, 0.03);
}

// Copied from an AVI, whose stamps of decoding begin at 0; Matroska has only those of showing.
TEST_F(FieldFile, TheDelayOfACopiedFilmIsNoTime) {
  for (const std::string codec : {"mpeg4", "libx264"})
    for (const std::string file : {"a.mp4", "a.mov", "a.mkv", "a.nut"}) {
      Clip clip = with_b_frames(codec);
      const int delay = codec == "mpeg4" ? 1 : 2;
      clip.tamper = [&](int, AVPacket& packet) {
        packet.pts += delay, packet.dts += delay;
        return true;
      };
      const FieldPlay played = play_field(write(file, clip));
      EXPECT_THAT(played.shown, numbers_to(18)) << file << codec;
      EXPECT_NEAR(played.at_frames.front(), 0, 0.03) << file << codec;
      expect_even_times(played);
      const bool has_times_of_decoding = file == "a.mp4" || file == "a.mov";
      if (has_times_of_decoding)
        EXPECT_THAT(played.warnings, IsEmpty()) << file << codec;
      else
        EXPECT_THAT(played.warnings, ElementsAre(AllOf(HasSubstr("played from 0"), HasSubstr("give offset_s: 0."))))
            << file << codec;
    }
  Clip later = with_b_frames("libx264");  // one of another clock
  later.tamper = [](int, AVPacket& packet) {
    packet.pts += 3, packet.dts += 3;
    return true;
  };
  const FieldPlay played = play_field(write("later.mkv", later));
  EXPECT_NEAR(played.at_frames.front(), 3, 0.03);
  EXPECT_THAT(played.warnings, IsEmpty());
}

// XviD's own stamps: its encoder waits for more pictures before the first B frames, and before longer runs of them.
TEST_F(FieldFile, GapsOfAnEncoderThatWaitsAreTakenOut) {
  for (const std::string file : {"a.mkv", "a.mp4", "a.avi"})
    for (const double given : {0., 10.}) {
      Clip clip = with_b_frames();
      clip.tamper = [](int k, AVPacket& packet) {
        packet.pts = packet.dts = k + (k >= 1 ? 2 : 0);
        return true;
      };
      const FieldPlay played = play_field(write(file, clip), given);
      EXPECT_THAT(played.shown, numbers_to(18)) << file;
      EXPECT_NEAR(played.at_frames.front(), 0, 0.03) << file;
      expect_even_times(played);
      EXPECT_THAT(played.warnings, SizeIs(file == "a.avi" || given > 0 ? 0 : 1)) << file << given;
    }
}

// Every part as XviD codes it: it waits for two pictures, and keeps the last two for itself.
TEST_F(FieldFile, AnEncoderWaitsAnewWhereFilmsWereJoined) {
  std::vector<capture::PacketPtr> packets;
  for (const int first : {0, 9}) {
    Clip part = with_b_frames();
    part.frames = 9;
    part.paint = [&](AVFrame& frame, int k) { capture::paint(frame, first + k); };
    part.tamper = [&](int, AVPacket& packet) {
      packets.emplace_back(av_packet_clone(&packet));
      return true;
    };
    write("part.avi", part);
  }
  ASSERT_EQ(packets.size(), 18u);
  for (const std::string file : {"a.mp4", "a.avi"}) {
    Clip joined = with_b_frames();
    joined.tamper = [&](int k, AVPacket& packet) {
      av_packet_unref(&packet), av_packet_ref(&packet, packets[std::size_t(k)].get());
      packet.pts = packet.dts = k / 9 * 11 + k % 9 + (k % 9 > 0 ? 2 : 0);
      return true;
    };
    const FieldPlay played = play_field(write(file, joined));
    EXPECT_EQ(played.shown, numbers_to(18)) << file;
    ASSERT_EQ(played.at_frames.size(), 18u);
    for (int k = 0; k < 18; ++k) EXPECT_NEAR(played.at_frames[std::size_t(k)], k < 9 ? k : k + 2, 0.03) << file << k;
    EXPECT_THAT(played.warnings, SizeIs(file == "a.avi" ? 0 : 1)) << file;  // stamps in the order of decoding
  }
}

// FLV, and the first one of `-f segment`, begin at the delay, which FFmpeg's concatenation counts into their length.
TEST_F(FieldFile, GapsWhereFilmsWereJoinedAreNoTime) {
  struct Case {
    int gap;
    std::string said;
  };
  for (const std::string file : {"a.mp4", "a.mkv", "a.ts"})
    for (const Case& c : {Case{0, ""}, Case{2, "before 1 key picture after picture 5 of the file"},
                          Case{20, "its times jump by up to 2.000 s before 1 key picture after picture 5"}}) {
      Clip clip = with_b_frames("libx264");
      clip.tamper = [&](int k, AVPacket& packet) {
        if (k >= 6) packet.pts += c.gap, packet.dts += c.gap;
        return true;
      };
      const FieldPlay played = play_field(write(file, clip));
      EXPECT_EQ(played.shown, numbers_to(18)) << file;
      EXPECT_NEAR(played.at_frames.back(), c.gap == 20 ? 37 : 17, 0.03) << file << c.gap;
      if (c.gap == 0)
        EXPECT_THAT(played.warnings, IsEmpty()) << file;
      else
        EXPECT_THAT(played.warnings, ElementsAre(HasSubstr(c.said))) << file << c.gap;
    }
}

// Packets as `-ss` copies them, from the key frame before the cut on.
TEST_F(FieldFile, PicturesThatAreThereTwiceAreNamed) {
  const auto packets = [&] {
    std::vector<capture::PacketPtr> all;
    Clip clip = with_b_frames("libx264");
    clip.tamper = [&](int, AVPacket& packet) {
      all.emplace_back(av_packet_clone(&packet));
      return true;
    };
    write("whole.mp4", clip);
    return all;
  }();
  Clip joined = with_b_frames("libx264");
  joined.tamper = [&](int k, AVPacket& packet) {
    const auto& from = *packets[std::size_t(k < 9 ? k : k - 3)];
    const std::int64_t dts = packet.dts;
    av_packet_unref(&packet), av_packet_ref(&packet, &from);
    packet.pts = from.pts + (k < 9 ? 0 : 3), packet.dts = dts;
    return true;
  };
  EXPECT_THAT(
      play_field(write("a.mp4", joined)).warnings,
      AllOf(Contains(AllOf(HasSubstr("1 of its key pictures are there twice"), HasSubstr("picture 9 of the file"))),
            testing::Not(Contains(HasSubstr("give fps")))));
}

TEST_F(FieldFile, GreyFilmsAreKnown) {
  for (const bool is_grey : {true, false}) {
    const Clip clip{.codec = "ffv1", .format = is_grey ? AV_PIX_FMT_GRAY8 : AV_PIX_FMT_YUV422P};
    Recording recording;
    recording.cameras.resize(1);
    recording.cameras[0].name = "cam";
    recording.cameras[0].frames = write("a.mkv", clip);
    const std::vector<std::string> names{"cam"};
    ReplaySource source(recording, names, {});
    while (source.next({})) {
    }
    EXPECT_EQ(source.cameras()[0].is_grey, is_grey);
  }
}

TEST_F(FieldFile, StampsInTheOrderOfDecodingAreNamedAndPutInOrder) {
  for (const std::string file : {"a.mkv", "a.mp4", "a.mov", "a.ts"})
    for (const std::string codec : {"mpeg4", "libx264"}) {
      Clip clip = with_b_frames(codec);
      clip.tamper = [](int, AVPacket& packet) {
        packet.pts = packet.dts;  // before 0 at first, so that an MP4 trims them
        return true;
      };
      const FieldPlay played = play_field(write(file, clip));
      EXPECT_THAT(played.shown, numbers_to(18)) << file << codec;
      expect_even_times(played);
      EXPECT_THAT(played.warnings, ElementsAre(AllOf(HasSubstr(file), HasSubstr("in the order in which"),
                                                     HasSubstr("give timestamps"))));
      const FieldPlay given = play_field(folder / file, field_fps);
      EXPECT_THAT(given.shown, numbers_to(18)) << file << codec;
      EXPECT_THAT(given.warnings, IsEmpty()) << file << codec;
    }
}

TEST_F(FieldFile, ElementaryStreamsHaveNoTimeStamps) {
  for (const auto& [file, codec] : {std::pair{"a.m2v", "mpeg2video"}, {"a.h264", "libx264"}, {"a.hevc", "libx265"}}) {
    Clip clip = with_b_frames(codec);
    clip.fps = 25;
    if (codec != std::string("libx264")) clip.b_frames = 0;
    if (codec == std::string("libx265")) clip.height = clip.width;
    const auto path = write(file, clip);
    const FieldPlay given = play_field(path, 25);
    EXPECT_THAT(given.shown, numbers_to(18)) << file;
    EXPECT_NEAR(given.at_frames.back(), 17. / 25 * field_fps, 0.03) << file;
    EXPECT_THAT(given.warnings, IsEmpty()) << file;
    const FieldPlay contradicted = play_field(path, 10);
    expect_even_times(contradicted);
    EXPECT_THAT(contradicted.warnings, ElementsAre(HasSubstr("fps says 10, but the file itself 25 frames a second: if "
                                                             "the file is right, correct fps; if fps is right")))
        << file;
    try {
      play_field(path);
      ADD_FAILURE() << file;
    } catch (const files::ConfigError& error) {
      EXPECT_THAT(error.what(), AllOf(HasSubstr("has no time stamps: give fps"), HasSubstr("header says 25 frames")))
          << file;
    }
  }
}

// Its clock begins anywhere, and no header has it.
TEST_F(FieldFile, TransportAndProgramStreamsBeginAtZero) {
  for (const std::string file : {"a.ts", "a.m2ts", "a.mpg", "a.vob"})
    for (const int later : {0, 1000}) {
      Clip clip = with_b_frames("mpeg2video");
      clip.fps = 25, clip.b_frames = 0;
      clip.tamper = [&](int, AVPacket& packet) {
        packet.pts += later, packet.dts += later;
        return true;
      };
      const FieldPlay played = play_field(write(file, clip));
      ASSERT_THAT(played.shown, numbers_to(18)) << file;
      EXPECT_NEAR(played.at_frames[0], 0, 0.01) << file;
      EXPECT_NEAR(played.at_frames[17], 17. * field_fps / clip.fps, 0.01) << file;
      EXPECT_THAT(played.warnings, IsEmpty()) << file;
    }
}

TEST_F(FieldFile, ClocksThatDoNotBeginTogetherAreNamed) {
  Recording recording;
  recording.file = "recording.yaml";
  for (const std::string name : {"a", "b"}) {
    Clip clip = with_b_frames("libx264");
    clip.b_frames = 0;
    clip.tamper = [&](int, AVPacket& packet) {
      packet.pts += name == "b" ? 7 : 0, packet.dts += name == "b" ? 7 : 0;
      return true;
    };
    auto& camera = recording.cameras.emplace_back();
    camera.name = name;
    camera.frames = write(name + ".ts", clip);
  }
  const std::vector<std::string> names{"a", "b"};
  EXPECT_THAT(ReplaySource(recording, names, {}).take_warnings(),
              ElementsAre(AllOf(HasSubstr("b.ts"), HasSubstr("begins 0.700 s later"), HasSubstr("offset_s: 0.700"))));
  recording.cameras[1].offset = 700ms;
  EXPECT_THAT(ReplaySource(recording, names, {}).take_warnings(), IsEmpty());
}

// Durations in these headers are counted from 0, not from the first picture.
TEST_F(FieldFile, FilmsThatBeginLateAreNotCutOff) {
  for (const std::string file : {"a.mkv", "a.flv", "a.asf", "a.nut", "a.mp4"}) {
    Clip clip = with_b_frames(file == "a.asf" ? "msmpeg4" : "libx264");
    if (file == "a.asf") clip.b_frames = 0;
    clip.tamper = [&](int, AVPacket& packet) {
      packet.pts += 30, packet.dts += 30;
      return true;
    };
    const FieldPlay played = play_field(write(file, clip));
    EXPECT_THAT(played.shown, numbers_to(18)) << file;
    EXPECT_NEAR(played.at_frames[0], 30, 0.05) << file;
    EXPECT_THAT(played.warnings, IsEmpty()) << file;
  }
}

// An edit list trims the first frames, of which others are predicted.
TEST_F(FieldFile, TrimmedFilesBeginAtTheirFirstFrameAndAreWhole) {
  for (const auto& [codec, b_frames] : {std::pair<std::string, int>{"mpeg4", 0}, {"mpeg4", 2}, {"libx264", 2}})
    for (const std::string file : {"a.mp4", "a.mov"}) {
      Clip clip = with_b_frames(codec);
      clip.b_frames = b_frames;
      clip.tamper = [](int, AVPacket& packet) {
        packet.pts -= 4, packet.dts -= 4;
        return true;
      };
      const FieldPlay played = play_field(write(file, clip));
      EXPECT_THAT(played.warnings, IsEmpty()) << file << codec;
      ASSERT_THAT(played.shown, SizeIs(14)) << file << codec;
      for (int k = 0; k < 14; ++k) EXPECT_EQ(played.shown[std::size_t(k)], k + 4) << file << codec;
      EXPECT_NEAR(played.at_frames[0], 0, 0.01);
      expect_even_times(played);
    }
}

// As ffmpeg -t cuts it: the last picture comes before those that are shown before it.
TEST_F(FieldFile, TheLastPictureOfACutFilmHasItsTime) {
  Clip clip = with_b_frames("libx264");
  clip.tamper = [](int k, AVPacket&) { return k <= 13; };
  for (const std::string file : {"a.mp4", "a.mov", "a.mkv"}) {
    const FieldPlay played = play_field(write(file, clip));
    ASSERT_GE(played.shown.size(), 14u) << file;
    for (std::size_t k = 0; k < played.shown.size(); ++k) {
      if (played.shown[k] < 0) continue;
      EXPECT_NEAR(played.at_frames[k] - played.at_frames[0], played.shown[k], 0.03) << file;
    }
    EXPECT_THAT(played.warnings, testing::Not(Contains(HasSubstr("no time stamp")))) << file;
  }
}

// FFmpeg's muxer makes all times of a Matroska file later by the samples that prime AAC's decoder.
TEST_F(FieldFile, SoundDoesNotDelayThePictures) {
  for (Clip clip : {Clip{}, with_b_frames("libx264")}) {
    clip.fps = field_fps, clip.has_sound = true;
    const FieldPlay played = play_field(write("a.mkv", clip));
    ASSERT_EQ(played.at_frames.size(), std::size_t(clip.frames));
    for (std::size_t k = 0; k < played.at_frames.size(); ++k) EXPECT_NEAR(played.at_frames[k], double(k), 0.011);
  }
}

TEST_F(FieldFile, StampsThatGoBackAreCounted) {  // two files as one
  std::string bytes;
  for (const int first : {0, 1}) {
    Clip clip{.codec = "mpeg2video", .format = AV_PIX_FMT_YUV420P, .fps = 25};
    clip.paint = [&](AVFrame& frame, int k) { capture::paint(frame, k + 12 * first); };
    bytes += capture::read_bytes(write("a.ts", clip));
  }
  capture::write_text(folder / "twice.ts", bytes);
  const FieldPlay played = play_field(folder / "twice.ts");
  EXPECT_GE(played.shown.size(), 11u);
  EXPECT_THAT(played.warnings, Contains(AllOf(HasSubstr("begin again at frame 1"), HasSubstr("frames are left out"),
                                              HasSubstr("give fps or timestamps"))));
  EXPECT_GE(play_field(folder / "twice.ts", 25).images.size(), 22u);
}

// ---- Remarks

// A message whose size says more than there is, as some drones write into every picture.
TEST_F(FieldFile, DamagedSupplementalMessagesAreNoLostPictures) {
  for (const auto& [codec, type] :
       {std::pair<std::string, std::string>{"libx264", "\x06"}, {"libx265", std::string("\x4E\x01", 2)}})
    for (const std::string file : {"a.mp4", "a.mkv", "a.ts"}) {
      Clip clip = with_b_frames(codec);
      clip.width = clip.height = 64;
      clip.tamper = [&, message = std::string("\0\0\0\1", 4) + type + "\x01\xFF\xFF\xFF\x8B" + std::string(64, 'U') +
                                  "\x80"](int, AVPacket& packet) {
        const int size = packet.size;
        capture::check(av_grow_packet(&packet, int(message.size())), "packet");
        std::memmove(packet.data + message.size(), packet.data, std::size_t(size));
        std::memcpy(packet.data, message.data(), message.size());
        return true;
      };
      const FieldPlay played = play_field(write(file, clip));
      EXPECT_THAT(played.shown, numbers_to(18)) << file << codec;
      EXPECT_THAT(played.warnings, IsEmpty()) << file << codec;
    }
}

// ---- What a stream says of its pictures

TEST_F(FieldFile, OnlyTheFirstFieldOfInterlacedFramesIsShown) {
  struct Kind {
    std::string file, codec;
    AVPixelFormat format;
  };
  for (const Kind& kind : {Kind{"a.mkv", "ffv1", AV_PIX_FMT_YUV422P}, Kind{"a.ts", "mpeg2video", AV_PIX_FMT_YUV420P},
                           Kind{"a.mp4", "libx264", AV_PIX_FMT_YUV420P}, Kind{"a.mov", "mpeg4", AV_PIX_FMT_YUV420P}})
    for (const auto fields : {Clip::Fields::top_first, Clip::Fields::bottom_first}) {
      const Clip clip{.codec = kind.codec, .format = kind.format, .height = 64, .fps = 25, .fields = fields};
      const FieldPlay played = play_field(write(kind.file, clip));
      EXPECT_THAT(played.shown, numbers_to(12)) << kind.codec << int(fields);
      for (const capture::Image& image : played.images)
        for (int v = image.height / 2 - 2; v <= image.height / 2 + 2; ++v)
          EXPECT_NEAR(capture::yuv_at(image, 32, v).y, capture::yuv_at(image, 32, 32).y, 3) << kind.codec;
      EXPECT_THAT(played.warnings, ElementsAre(AllOf(HasSubstr(kind.file), HasSubstr("is interlaced")))) << kind.codec;
    }
}

// Of a program that lost the tag: the second field shows another level.
TEST_F(FieldFile, FieldsThatTheRecordingStatesArePlayed) {
  for (const bool is_top_first : {true, false}) {
    Clip clip{.codec = "ffv1", .fields = is_top_first ? Clip::Fields::top_first : Clip::Fields::bottom_first};
    const auto film = write("combs.mkv", clip);
    Recording recording;
    recording.file = "recording.yaml";
    recording.cameras.resize(1);
    recording.cameras[0].name = "cam";
    recording.cameras[0].frames = film;
    recording.cameras[0].first_field = is_top_first ? capture::FirstField::top : capture::FirstField::bottom;
    const std::vector<std::string> names{"cam"};
    ReplaySource source(recording, names, {});
    for (int k = 0; const auto frame = source.next({}); ++k)
      for (int v = 20; v < 28; ++v)
        EXPECT_EQ(capture::yuv_at(frame->pixels, 40, v).y, capture::level_of_frame(k)) << is_top_first << k << v;
    EXPECT_THAT(source.take_warnings(), IsEmpty());
    recording.cameras[0].first_field = is_top_first ? capture::FirstField::bottom : capture::FirstField::top;
    ReplaySource other(recording, names, {});
    EXPECT_EQ(capture::yuv_at(other.next({})->pixels, 40, 24).y, capture::level_of_frame(0) + capture::second_field);
  }
}

TEST_F(FieldFile, PicturesAreTurnedAsTheirTagSays) {
  for (const double degrees : {90., 180., 270.}) {
    Clip clip{.codec = "mpeg4", .format = AV_PIX_FMT_YUV420P, .frames = 2};
    const FieldPlay stored = play_field(write("a.mp4", clip));
    clip.turned_deg = degrees;
    const FieldPlay played = play_field(write("a.mov", clip));
    const capture::Image &from = stored.images[0], &to = played.images[0];
    const bool swaps = degrees != 180;
    ASSERT_EQ(to.width, swaps ? from.height : from.width);
    ASSERT_EQ(to.height, swaps ? from.width : from.height);
    for (int v = 0; v < from.height; ++v)
      for (int u = 0; u < from.width; ++u) {
        const auto stored_pixel = capture::yuv_at(from, u, v);
        const auto turned_pixel = degrees == 90    ? capture::yuv_at(to, from.height - 1 - v, u)
                                  : degrees == 180 ? capture::yuv_at(to, from.width - 1 - u, from.height - 1 - v)
                                                   : capture::yuv_at(to, v, from.width - 1 - u);
        ASSERT_EQ(turned_pixel.y, stored_pixel.y) << degrees << " at " << u << "," << v;
        ASSERT_EQ(turned_pixel.u, stored_pixel.u);
      }
    EXPECT_THAT(played.warnings, ElementsAre(HasSubstr("turned by")));
    EXPECT_THAT(stored.warnings, IsEmpty());
  }
}

TEST_F(FieldFile, PixelsThatAreNotSquareAreNamed) {
  const Clip clip{.codec = "mpeg4", .format = AV_PIX_FMT_YUV420P, .pixel_shape = {4, 3}};
  const FieldPlay played = play_field(write("a.mkv", clip));
  EXPECT_THAT(played.shown, numbers_to(12));
  EXPECT_THAT(played.warnings, ElementsAre(HasSubstr("has pixels of 1.333 : 1")));
}

// ---- Every format that is allowed

struct Format {
  std::string file, codec;
  AVPixelFormat format;
  int width = 64, height = 48;
};
void PrintTo(const Format& format, std::ostream* out) {
  *out << format.codec << " in " << format.file;
}

class EveryAllowedFormat : public testing::TestWithParam<Format> {};

TEST_P(EveryAllowedFormat, ShowsEveryPicture) {
  const Format& kind = GetParam();
  const capture::TemporaryFolder folder;
  Clip clip{.codec = kind.codec, .format = kind.format, .width = kind.width, .height = kind.height, .fps = 25};
  capture::write_clip(folder / kind.file, clip);
  const FieldPlay played = play_field(folder / kind.file, 25);
  EXPECT_THAT(played.shown, numbers_to(12));
  EXPECT_THAT(played.warnings,
              testing::Each(testing::AnyOf(HasSubstr("is interlaced"), HasSubstr("has pixels of"))));  // DV always is
}

constexpr auto yuv420 = AV_PIX_FMT_YUV420P;
INSTANTIATE_TEST_SUITE_P(
    Containers, EveryAllowedFormat,
    testing::Values(Format{"a.mkv", "libx264", yuv420}, Format{"a.webm", "libvpx", yuv420},
                    Format{"a.mov", "mpeg4", yuv420}, Format{"a.mp4", "libx265", yuv420, 64, 64},
                    Format{"a.avi", "mpeg4", yuv420}, Format{"a.mjpeg", "mjpeg", AV_PIX_FMT_YUVJ420P},
                    Format{"a.ts", "mpeg2video", yuv420}, Format{"a.mpg", "mpeg2video", yuv420},
                    Format{"a.m2v", "mpeg2video", yuv420}, Format{"a.m4v", "mpeg4", yuv420},
                    Format{"a.h264", "libx264", yuv420}, Format{"a.hevc", "libx265", yuv420, 64, 64},
                    Format{"a.obu", "libaom-av1", yuv420}, Format{"a.ivf", "libvpx-vp9", yuv420},
                    Format{"a.ogv", "libtheora", yuv420}, Format{"a.asf", "wmv2", yuv420},
                    Format{"a.flv", "flv", yuv420}, Format{"a.nut", "ffv1", yuv420},
                    Format{"a.dv", "dvvideo", yuv420, 720, 576}, Format{"a.gif", "gif", AV_PIX_FMT_GRAY8},
                    Format{"a.apng", "apng", AV_PIX_FMT_RGB24}, Format{"a.y4m", "wrapped_avframe", yuv420},
                    Format{"a.rm", "rv10", yuv420, 176, 144}, Format{"a.wtv", "mpeg2video", yuv420},
                    Format{"a.mxf", "mpeg2video", yuv420}));
INSTANTIATE_TEST_SUITE_P(
    Images, EveryAllowedFormat,
    testing::Values(Format{"%d.png", "png", AV_PIX_FMT_RGB24}, Format{"%d.jpg", "mjpeg", AV_PIX_FMT_YUVJ420P},
                    Format{"%d.bmp", "bmp", AV_PIX_FMT_BGR24}, Format{"%d.tiff", "tiff", AV_PIX_FMT_RGB24},
                    Format{"%d.tif", "tiff", AV_PIX_FMT_GRAY8}, Format{"%d.webp", "libwebp", yuv420},
                    Format{"%d.jls", "jpegls", AV_PIX_FMT_GRAY8}, Format{"%d.jp2", "jpeg2000", AV_PIX_FMT_RGB24},
                    Format{"%d.pgm", "pgm", AV_PIX_FMT_GRAY8}, Format{"%d.ppm", "ppm", AV_PIX_FMT_RGB24},
                    Format{"%d.pam", "pam", AV_PIX_FMT_RGB24}, Format{"%d.qoi", "qoi", AV_PIX_FMT_RGB24},
                    Format{"%d.dpx", "dpx", AV_PIX_FMT_RGB24}, Format{"%d.sgi", "sgi", AV_PIX_FMT_RGB24},
                    Format{"%d.ras", "sunrast", AV_PIX_FMT_GRAY8}));

// ---- Files of field_cases, made from our own rendering

const std::filesystem::path cases = std::filesystem::path(HUETRACK_SHARED_DATA) / "field_cases";

TEST(FieldCases, ArePlayedWhole) {
  if (!std::filesystem::exists(cases)) GTEST_SKIP() << "no " << cases;
  for (const auto& [file, count] : std::map<std::string, std::size_t>{{"paff/paff0.mts", 20},
                                                                      {"paff/paff1.mts", 20},
                                                                      {"xvid_bframes_avi/avi_xvid_b0.avi", 150},
                                                                      {"rawmux_bframes/rawmux0.mp4", 150},
                                                                      {"badsei/badsei1.mp4", 150},
                                                                      {"rot180/rot180_0.mp4", 150},
                                                                      {"tiff/none.tif", 1},
                                                                      {"tiff/lzw.tif", 1},
                                                                      {"tiff/ff0001.tif", 1},
                                                                      {"glob_order/cam0/*.jpg", 120}}) {
    const bool is_still = file.find(".mp4") == std::string::npos && file.find(".avi") == std::string::npos;
    const FieldPlay played = play_field(cases / file, is_still ? 30 : 0);
    EXPECT_THAT(played.shown, SizeIs(count)) << file;
    EXPECT_THAT(played.images, SizeIs(count)) << file;
    for (const auto& warning : played.warnings) EXPECT_THAT(warning, testing::Not(HasSubstr("decode"))) << file;
  }
}

// FFmpeg decodes it as black.
TEST_F(FieldFile, JpegInTiffIsRead) {
  for (const int type : {CV_8UC3, CV_8UC1})
    for (int k = 0; k < 3; ++k) {
      // strips of a multiple of 16 rows, as JPEG needs
      const cv::Mat picture(48, 170, type, cv::Scalar::all(capture::level_of_frame(k)));
      constexpr int as_jpeg = 7;
      ASSERT_TRUE(cv::imwrite(folder / (std::to_string(type) + "_" + std::to_string(k) + ".tif"), picture,
                              {cv::IMWRITE_TIFF_COMPRESSION, as_jpeg}));
    }
  for (const int type : {CV_8UC3, CV_8UC1}) {
    const FieldPlay played = play_field(folder / (std::to_string(type) + "_%d.tif"), 30);
    EXPECT_EQ(played.shown, numbers_to(3)) << type;
    EXPECT_THAT(played.warnings, IsEmpty());
  }
}

// ---- What picture files say of themselves

// Before the last chunk of a PNG.
std::string with_chunk(const std::string& png, const std::string& name, const std::string& data, bool is_sound) {
  const auto big = [](std::size_t number) {
    std::string text;
    for (int shift = 24; shift >= 0; shift -= 8) text += char(number >> shift & 0xff);
    return text;
  };
  std::uint32_t crc = ~0u;  // ISO 3309, as PNG has it
  for (const char c : name + data) {
    crc ^= static_cast<std::uint8_t>(c);
    for (int bit = 0; bit < 8; ++bit) crc = crc >> 1 ^ (crc % 2 != 0 ? 0xEDB88320u : 0u);
  }
  const std::size_t end = png.rfind("IEND") - 4;
  return png.substr(0, end) + big(data.size()) + name + data + big(is_sound ? ~crc : crc) + png.substr(end);
}

// The first directory of a TIFF, as EXIF data have it.
std::string exif_with(char orientation) {
  return std::string("II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0", 18) + orientation + std::string(7, '\0');
}

// In place of an entry that says where strips end, which a TIFF of one strip does not need.
std::string tiff_with(std::string tiff, char orientation) {
  const std::string rows_in_strip("\x16\x01\x03\0\x01\0\0\0", 8);
  const std::size_t at = tiff.find(rows_in_strip);
  if (at == std::string::npos) throw std::runtime_error("no TIFF as expected");
  return tiff.replace(at, 10, std::string("\x12\x01\x03\0\x01\0\0\0", 8) + orientation + '\0');
}

std::string encoded(const cv::Mat& picture, const std::string& extension) {
  std::vector<std::uint8_t> bytes;
  const int how = extension == ".webp" ? cv::IMWRITE_WEBP_QUALITY : cv::IMWRITE_TIFF_COMPRESSION;
  const int lossless = extension == ".webp" ? 101 : 1;
  if (!cv::imencode(extension, picture, bytes, extension == ".png" ? std::vector<int>{} : std::vector{how, lossless}))
    throw std::runtime_error("no " + extension);
  return {bytes.begin(), bytes.end()};
}

std::string tagged(const cv::Mat& picture, const std::string& extension, char orientation) {
  std::string bytes = encoded(picture, extension);
  if (extension == ".tif") return tiff_with(bytes, orientation);
  if (extension == ".png") return with_chunk(bytes, "eXIf", exif_with(orientation), true);
  const std::string exif = exif_with(orientation);
  bytes += std::string("EXIF") + char(exif.size()) + std::string(3, '\0') + exif;
  const auto size = static_cast<std::uint32_t>(bytes.size() - 8);
  std::memcpy(bytes.data() + 4, &size, sizeof(size));
  return bytes;
}

TEST_F(FieldFile, PicturesOfEveryKindAreTurnedAsTheirTagSays) {
  for (const int type : {CV_8UC3, CV_8UC1, CV_16UC3}) {
    cv::Mat picture(32, 48, type, cv::Scalar::all(type == CV_16UC3 ? 20'000 : 90));
    picture(cv::Rect(0, 0, 24, 16)) = cv::Scalar::all(type == CV_16UC3 ? 60'000 : 200);  // upper left
    for (const std::string extension : {".png", ".webp", ".tif"}) {
      if (extension == ".webp" && type != CV_8UC3) continue;
      for (char orientation = 1; orientation <= 8; ++orientation) {
        capture::write_text(folder / ("0" + extension), tagged(picture, extension, orientation));
        const FieldPlay played = play_field(folder / ("%d" + extension), 10);
        ASSERT_THAT(played.images, SizeIs(1)) << extension << int(orientation);
        const capture::Image& image = played.images[0];
        ASSERT_EQ(image.width, orientation < 5 ? 48 : 32) << extension << int(orientation);
        const bool is_left = orientation == 1 || orientation == 4 || orientation == 5 || orientation == 8;
        const bool is_upper = orientation == 1 || orientation == 2 || orientation == 5 || orientation == 6;
        for (const bool left : {true, false})
          for (const bool upper : {true, false}) {
            const int u = image.width * (left ? 1 : 3) / 4, v = image.height * (upper ? 1 : 3) / 4;
            const int level = image.format == capture::PixelFormat::bgr ? capture::bgr_at(image, u, v).g
                                                                        : capture::yuv_at(image, u, v).y;
            EXPECT_EQ(level > 140, left == is_left && upper == is_upper) << extension << type << int(orientation);
          }
        EXPECT_THAT(played.warnings, SizeIs(orientation == 1 ? 0 : 1)) << extension << type << int(orientation);
      }
    }
  }
}

// After one that is turned, too.
TEST_F(FieldFile, APictureWithoutATagIsNotTurned) {
  cv::Mat picture(32, 48, CV_8UC1, cv::Scalar(capture::level_of_frame(3)));
  picture(cv::Rect(0, 0, 4, 4)) = 255;
  capture::write_text(folder / "0.png", tagged(picture, ".png", 3));
  capture::write_text(folder / "1.png", encoded(picture, ".png"));
  const FieldPlay played = play_field(folder / "%d.png", 10);
  ASSERT_THAT(played.images, SizeIs(2));
  EXPECT_EQ(capture::yuv_at(played.images[0], 47, 31).y, 255);
  EXPECT_EQ(capture::yuv_at(played.images[1], 0, 0).y, 255);
}

TEST_F(FieldFile, DamagedTextsInAPngAreNoLostPicture) {
  const std::string picture = encoded(cv::Mat(48, 64, CV_8UC3, cv::Scalar::all(capture::level_of_frame(0))), ".png");
  const auto played_with = [&](const std::string& png) {
    capture::write_text(folder / "0.png", png);
    capture::write_text(folder / "1.png", picture);  // the first one must be whole
    return play_field(folder / "%d.png", 10);
  };
  for (const std::string name : {"tEXt", "iCCP", "eXIf", "zTXt", "gAMA", "tRNS"}) {
    const FieldPlay played = played_with(with_chunk(picture, name, "a text", false));
    EXPECT_THAT(played.shown, ElementsAre(0, 0)) << name;
    EXPECT_THAT(played.warnings, IsEmpty()) << name;
  }
  std::string damaged = picture;
  damaged[picture.find("IDAT") + 9] ^= 1;
  EXPECT_THAT(played_with(damaged).shown, ElementsAre(-1, 0));
}

// By numbers the last pictures would come first.
TEST(FieldCases, ACameraThatBeginsToCountAgainIsNamed) {
  if (!std::filesystem::exists(cases)) GTEST_SKIP() << "no " << cases;
  const auto folder = std::filesystem::path(testing::TempDir()) / "counts_again";
  std::filesystem::create_directories(folder);
  const auto play_named = [&](std::initializer_list<const char*> names) {
    std::filesystem::remove_all(folder);
    std::filesystem::create_directories(folder);
    const auto any = *std::filesystem::directory_iterator(cases / "glob_order/cam0");
    for (const char* name : names) std::filesystem::copy_file(any.path(), folder / name);
    return play_field(folder / "IMG_*.jpg", 30).shown.size();
  };
  try {
    play_named({"IMG_9998.jpg", "IMG_9999.jpg", "IMG_0000.jpg", "IMG_0001.jpg", "IMG_0002.jpg", "IMG_0003.jpg"});
    ADD_FAILURE() << "it was played";
  } catch (const std::exception& error) {
    EXPECT_THAT(error.what(), HasSubstr("begin again after IMG_9999.jpg"));
  }
  EXPECT_EQ(play_named({"IMG_9997.jpg", "IMG_9998.jpg", "IMG_9999.jpg"}), 3u);
  EXPECT_EQ(play_named({"IMG_0001.jpg", "IMG_0002.jpg", "IMG_0004.jpg"}), 3u);
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace huetrack::recordings
