#include "capture/frames/matches.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cstring>
#include <fstream>
#include <random>

#include "capture/frames/jpeg_encoder.h"
#include "capture/temporary_folder.h"
#include "recordings/recording.h"
#include "recordings/recording_writer.h"
#include "recordings/replay_source.h"

namespace huetrack::capture {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;

struct Extent {
  int width, height;
};
// Multiples of the tile and not, and narrower than one.
const std::vector<Extent> extents{{64, 48}, {66, 50}, {70, 46}, {8, 8}, {4, 2}, {3, 5}, {130, 18}, {57, 11}};

constexpr MatchedColor lime{65, 115, 0.3, 1, 0.1, 0.95}, red{340, 20, 0.25, 1, 0.1, 0.9};

Image looked_at(Extent size, PixelFormat format = PixelFormat::i422) {
  return {.format = format,
          .range = ColorRange::full,
          .width = size.width,
          .height = size.height,
          .planes = {},
          .owner = {}};
}

void set(Matches::OfColor& of, Extent size, int u, int v) {
  of.tiles[static_cast<std::size_t>(v / 8) * tiles_across(size.width) + static_cast<std::size_t>(u / 8)] |=
      std::uint64_t{1} << (8 * (v % 8) + u % 8);
}

Matches::OfColor none(Extent size, MatchedColor color = lime) {
  return {.color = color, .tiles = std::vector<std::uint64_t>(tiles_of(size.width, size.height), 0)};
}

// So many of a thousand pixels, in patches of a few.
Matches::OfColor strewn(Extent size, int per_mille, std::uint64_t seed, MatchedColor color = lime) {
  Matches::OfColor of = none(size, color);
  std::mt19937_64 rng(seed);
  bool is_on = false;
  for (int v = 0; v < size.height; ++v)
    for (int u = 0; u < size.width; ++u) {
      if (rng() % 3 != 0) is_on = static_cast<int>(rng() % 1000) < per_mille;
      if (is_on) set(of, size, u, v);
    }
  return of;
}

Matches::OfColor disc(Extent size, double radius) {
  Matches::OfColor of = none(size);
  for (int v = 0; v < size.height; ++v)
    for (int u = 0; u < size.width; ++u)
      if (std::hypot(u - size.width / 2, v - size.height / 2) < radius) set(of, size, u, v);
  return of;
}

std::vector<std::uint8_t> coded(Extent size, const std::vector<Matches::OfColor>& colors,
                                const std::vector<std::uint8_t>& jpeg = {}) {
  std::vector<std::uint8_t> out{1, 2, 3};  // of the frame before
  encode_matches(looked_at(size), colors, jpeg, out);
  return out;
}

std::optional<DecodedMatches> decoded(const std::vector<std::uint8_t>& bytes) {
  JpegDecoder decoder;
  Image latest;
  return decode_matches(bytes, decoder, latest);
}

std::vector<std::uint8_t> jpeg_of(Extent size) {
  auto [image, data] = make_image(PixelFormat::i422, ColorRange::full, size.width, size.height);
  std::fill_n(data[0], size.width * size.height, std::uint8_t{90});
  return encode_picture(image, {.width = size.width, .height = size.height}, 90);
}

TEST(Matches, RoundTripBitForBit) {
  for (const Extent size : extents)
    for (const int per_mille : {0, 5, 100, 500, 1000})
      for (std::uint64_t seed = 1; seed <= 5; ++seed) {
        const std::vector<Matches::OfColor> colors{strewn(size, per_mille, seed), strewn(size, 30, seed + 100, red)};
        const auto back = decoded(coded(size, colors));
        ASSERT_TRUE(back) << size.width << "x" << size.height;
        EXPECT_EQ(back->source.format, PixelFormat::i422);
        EXPECT_EQ(back->source.range, ColorRange::full);
        EXPECT_EQ(back->source.width, size.width);
        EXPECT_EQ(back->source.height, size.height);
        EXPECT_FALSE(has_pixels(back->source));
        ASSERT_EQ(back->matches->colors.size(), 2U);
        EXPECT_EQ(back->matches->of(lime)->tiles, colors[0].tiles);
        EXPECT_EQ(back->matches->of(red)->tiles, colors[1].tiles);
        EXPECT_EQ(back->matches->of({65, 116, 0.3, 1, 0.1, 0.95}), nullptr);
      }
}

TEST(Matches, TakeHundredsOfBytesForABallAndAtMostABitPerPixel) {
  const Extent vga{640, 480};
  const std::size_t ball = coded(vga, {disc(vga, 20)}).size();
  EXPECT_LT(ball, 200U);
  EXPECT_GT(ball, 100U);
  EXPECT_LE(coded(vga, {strewn(vga, 500, 1)}).size(), 640 * 480 / 8 + 100U);
}

TEST(Matches, CarryTheLatestPicture) {
  const Extent size{64, 48};
  JpegDecoder decoder;
  Image latest;
  const auto without = decode_matches(coded(size, {none(size)}), decoder, latest);
  ASSERT_TRUE(without);
  EXPECT_FALSE(has_pixels(without->matches->picture));
  const auto with = decode_matches(coded(size, {none(size)}, jpeg_of(size)), decoder, latest);
  ASSERT_TRUE(with);
  EXPECT_TRUE(with->matches->has_own_picture);
  EXPECT_EQ(yuv_at(with->matches->picture, 30, 20).y, 90);
  const auto later = decode_matches(coded(size, {none(size)}), decoder, latest);
  ASSERT_TRUE(later);
  EXPECT_FALSE(later->matches->has_own_picture);
  EXPECT_TRUE(has_pixels(later->matches->picture));
  const Extent other{32, 24};
  // Of a size that is not the camera's nothing is decoded, and the picture stays.
  EXPECT_FALSE(decode_matches(coded(other, {none(other)}, jpeg_of(other)), decoder, latest, size.width, size.height));
  EXPECT_EQ(latest.width, size.width);
  EXPECT_TRUE(decode_matches(coded(size, {none(size)}), decoder, latest, size.width, size.height));
  const auto smaller = decode_matches(coded(other, {none(other)}), decoder, latest);
  ASSERT_TRUE(smaller);
  EXPECT_FALSE(has_pixels(smaller->matches->picture)) << "a picture of another size is not this camera's";
  EXPECT_FALSE(decoded(coded(size, {none(size)}, jpeg_of(other)))) << "nor one that is sent so";
}

// Whatever the format, a patch has the bytes that lie there in the image.
TEST(Matches, PatchesHaveTheSourcePixels) {
  const Extent size{70, 46};
  for (const auto format : {PixelFormat::yuyv, PixelFormat::nv12, PixelFormat::i420, PixelFormat::i422,
                            PixelFormat::i444, PixelFormat::bgr, PixelFormat::grey}) {
    WritableImage seen = make_image(format, ColorRange::full, size.width, size.height);
    std::mt19937 rng(7);
    for (int p = 0; p < 3; ++p)
      for (std::size_t i = 0;
           i < plane_row_bytes(format, p, size.width) * static_cast<std::size_t>(plane_rows(format, p, size.height));
           ++i)
        seen.data[static_cast<std::size_t>(p)][i] = static_cast<std::uint8_t>(rng());
    const std::vector<PatchPlace> places{{0, 0, 10, 6}, {12, 20, 30, 8}, {60, 40, 10, 6}};
    std::vector<std::uint8_t> bytes;
    encode_matches(seen.image, std::vector{disc(size, 9)}, {}, bytes, places);
    const auto back = decoded(bytes);
    ASSERT_TRUE(back) << name(format);
    ASSERT_EQ(back->matches->patches.size(), places.size());
    for (std::size_t i = 0; i < places.size(); ++i) {
      const Matches::Patch& patch = back->matches->patches[i];
      ASSERT_EQ(patch.at.u, places[i].u);
      ASSERT_EQ(patch.at.v, places[i].v);
      ASSERT_EQ(patch.image.width, places[i].width);
      ASSERT_EQ(patch.image.height, places[i].height);
      for (int v = 0; v < patch.image.height; ++v)
        for (int u = 0; u < patch.image.width; ++u) {
          if (format == PixelFormat::bgr) {
            const Bgr a = bgr_at(patch.image, u, v), b = bgr_at(seen.image, patch.at.u + u, patch.at.v + v);
            ASSERT_TRUE(a.b == b.b && a.g == b.g && a.r == b.r);
          } else {
            const Yuv a = yuv_at(patch.image, u, v), b = yuv_at(seen.image, patch.at.u + u, patch.at.v + v);
            ASSERT_TRUE(a.y == b.y && a.u == b.u && a.v == b.v) << name(format) << " " << u << ", " << v;
          }
        }
    }
    for (std::size_t length = 0; length < bytes.size(); ++length)
      ASSERT_FALSE(decoded({bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(length)})) << length;
    // Beyond the image, of no size, or where chroma would be cut.
    for (const PatchPlace bad : {PatchPlace{62, 0, 10, 6}, PatchPlace{0, 42, 10, 6}, PatchPlace{0, 0, 0, 6},
                                 PatchPlace{1, 0, 10, 6}, PatchPlace{0, 0, 9, 6}}) {
      std::vector<std::uint8_t> changed = bytes;
      const std::size_t at = coded(size, {disc(size, 9)}).size() + 1;
      const int numbers[] = {bad.u, bad.v, bad.width, bad.height};
      for (std::size_t n = 0; n < 4; ++n) changed[at + 2 * n] = static_cast<std::uint8_t>(numbers[n]);
      EXPECT_FALSE(decoded(changed));
    }
  }
}

TEST(Matches, RejectsTruncatedOrExtendedBytes) {
  const Extent size{70, 46};
  for (const auto& bytes : {coded(size, {strewn(size, 30, 1), disc(size, 9)}), coded(size, {strewn(size, 500, 2)}),
                            coded(Extent{64, 48}, {disc({64, 48}, 9)}, jpeg_of({64, 48}))}) {
    ASSERT_TRUE(decoded(bytes));
    for (std::size_t length = 0; length < bytes.size(); ++length) {
      const std::vector<std::uint8_t> cut(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(length));
      ASSERT_FALSE(decoded(cut)) << length << " of " << bytes.size();
    }
    std::vector<std::uint8_t> longer = bytes;
    longer.push_back(0);
    EXPECT_FALSE(decoded(longer));
  }
}

// Whatever comes of it, its bits lie within the image.
TEST(Matches, SurviveRandomMutations) {
  const Extent size{70, 46};
  std::mt19937_64 rng(1);
  for (const auto& bytes : {coded(size, {strewn(size, 30, 1), disc(size, 9)}), coded(size, {strewn(size, 500, 2)})}) {
    int taken = 0;
    for (std::size_t at = 0; at < bytes.size(); ++at)
      for (int i = 0; i < 8; ++i) {
        std::vector<std::uint8_t> changed = bytes;
        changed[at] = static_cast<std::uint8_t>(rng());
        const auto back = decoded(changed);
        if (!back) continue;
        ++taken;
        for (const auto& of : back->matches->colors)
          ASSERT_EQ(of.tiles.size(), tiles_of(back->source.width, back->source.height));
        if (back->source.width != size.width || back->source.height != size.height) continue;
        for (const auto& of : back->matches->colors) {
          std::uint64_t beyond = 0;
          for (std::size_t t = tiles_across(size.width) - 1; t < of.tiles.size(); t += tiles_across(size.width))
            beyond |= of.tiles[t] & ~(0x0101010101010101u * ((1u << size.width % 8) - 1));
          EXPECT_EQ(beyond, 0U);
        }
      }
    EXPECT_GT(taken, 0);
  }
}

TEST(Matches, HostileNumbersCostNoMemoryOrTime) {
  const auto head = [](int width, int height, int colors) {
    std::vector<std::uint8_t> out{1, 0, 0};
    for (const int n : {width, height}) out.push_back(static_cast<std::uint8_t>(n)), out.push_back(n >> 8);
    out.push_back(static_cast<std::uint8_t>(colors));
    return out;
  };
  const auto with = [](std::vector<std::uint8_t> out, std::uint32_t length, const std::vector<std::uint8_t>& runs) {
    out.resize(out.size() + 48, 0);
    for (int i = 0; i < 4; ++i) out.push_back(static_cast<std::uint8_t>(length >> (8 * i)));
    out.insert(out.end(), runs.begin(), runs.end());
    out.resize(out.size() + 4, 0);
    return out;
  };
  EXPECT_TRUE(decoded(with(head(64, 48, 1), 3, {0, 5, 7})));
  EXPECT_FALSE(decoded(with(head(64, 48, 1), 3, {0, 5, 0}))) << "a run of no pixels";
  EXPECT_FALSE(decoded(with(head(64, 48, 1), 2, {0, 5}))) << "half of a pair";
  EXPECT_FALSE(decoded(with(head(64, 48, 1), 4, {0, 5, 0xff, 0x7f}))) << "beyond the image";
  EXPECT_FALSE(decoded(with(head(64, 48, 1), 8, {0, 0xff, 0xff, 0xff, 0xff, 0xff, 0x7f, 1}))) << "a number too long";
  EXPECT_FALSE(decoded(with(head(64, 48, 1), 0xffffffff, {0, 5, 7})));
  EXPECT_FALSE(decoded(with(head(64, 48, 1), 3, {2, 5, 7}))) << "of an unknown kind";
  EXPECT_FALSE(decoded(with(head(64, 48, 1), 3, {1, 5, 7}))) << "too few bits";
  EXPECT_FALSE(decoded(with(head(0, 48, 1), 3, {0, 5, 7})));
  EXPECT_FALSE(decoded(head(65535, 65535, 32)));
  EXPECT_FALSE(decoded(head(64, 48, 255)));
}

// ---- Recordings

Frame frame_of(Extent size, int number, bool has_picture) {
  Frame frame;
  frame.sequence = static_cast<std::uint32_t>(number);
  frame.captured_at = frame.stamped_at = Timestamp(Duration(1'700'000'000'000'000'000 + 33'333'333 * number));
  frame.arrival = static_cast<std::uint64_t>(number + 1);
  auto bytes = std::make_shared<const std::vector<std::uint8_t>>(
      coded(size, {strewn(size, 20, static_cast<std::uint64_t>(number))},
            has_picture ? jpeg_of(size) : std::vector<std::uint8_t>()));
  const auto back = decoded(*bytes);
  frame.pixels = back->source;
  frame.matches = back->matches;
  frame.encoded = bytes;
  return frame;
}

recordings::RecordingOptions of_left(const std::filesystem::path& folder, bool is_of_matches) {
  return {.folder = folder, .cameras = {"left"}, .are_matches = {is_of_matches}, .rig_yaml = {}, .config_yaml = {}};
}

std::vector<Frame> replayed(const std::filesystem::path& folder, std::vector<std::string>& warnings) {
  const std::vector<std::string> names{"left"};
  recordings::ReplaySource source(recordings::read_recording(folder), names,
                                  {.timing = {}, .keeps_encoded = true, .takes_matches = true});
  std::vector<Frame> frames;
  while (auto frame = source.next({})) frames.push_back(std::move(*frame));
  warnings = source.take_warnings();
  return frames;
}

TEST(Matches, ReplayAsRecorded) {
  const TemporaryFolder folder;
  const Extent size{70, 46};
  std::vector<Frame> given;
  for (int i = 0; i < 20; ++i) given.push_back(frame_of(size, i, i % 8 == 3));
  given[7].status = FrameStatus::corrupted;
  {
    recordings::PreRoll pre_roll({.length = std::chrono::seconds(10)});
    for (int i = 0; i < 5; ++i) pre_roll.push(given[std::size_t(i)]);
    recordings::RecordingWriter writer(of_left(folder.path() / "r", true));
    for (const Frame& frame : pre_roll.take()) EXPECT_TRUE(writer.write(frame));
    for (std::size_t i = 5; i < given.size(); ++i) EXPECT_TRUE(writer.write(given[i]));
    EXPECT_EQ(writer.figures()[0].frames, 20U);
    EXPECT_EQ(writer.figures()[0].left_out, 0U);
  }
  std::vector<std::string> warnings;
  const auto frames = replayed(folder.path() / "r", warnings);
  EXPECT_THAT(warnings, IsEmpty());
  ASSERT_EQ(frames.size(), given.size());
  for (std::size_t i = 0; i < frames.size(); ++i) {
    EXPECT_EQ(frames[i].status, given[i].status);
    EXPECT_EQ(frames[i].captured_at, given[i].captured_at);
    EXPECT_EQ(frames[i].sequence, given[i].sequence);
    if (i == 7) continue;
    ASSERT_TRUE(frames[i].matches);
    EXPECT_EQ(*frames[i].encoded, *given[i].encoded);
    EXPECT_EQ(frames[i].matches->of(lime)->tiles, given[i].matches->of(lime)->tiles);
    EXPECT_EQ(frames[i].matches->has_own_picture, i % 8 == 3);
    EXPECT_EQ(picture_of(frames[i]) != nullptr, i >= 3) << i;
    EXPECT_EQ(frames[i].pixels.format, PixelFormat::i422);
    EXPECT_FALSE(has_pixels(frames[i].pixels));
  }
}

TEST(Matches, TruncatedRecordingReplaysUpToThere) {
  const TemporaryFolder folder;
  const Extent size{70, 46};
  {
    recordings::RecordingWriter writer(of_left(folder.path() / "r", true));
    for (int i = 0; i < 10; ++i) EXPECT_TRUE(writer.write(frame_of(size, i, false)));
  }
  const auto file = folder.path() / "r" / "left.matches";
  std::filesystem::resize_file(file, std::filesystem::file_size(file) - 20);
  std::vector<std::string> warnings;
  EXPECT_EQ(replayed(folder.path() / "r", warnings).size(), 9U);
  ASSERT_FALSE(warnings.empty());
  EXPECT_THAT(warnings.front(), HasSubstr("left.matches: is cut off or damaged: 9 frames"));
}

TEST(Matches, AreNotRecordedTogetherWithPictures) {
  const TemporaryFolder folder;
  recordings::RecordingWriter writer(of_left(folder.path() / "r", false));
  EXPECT_TRUE(writer.write(frame_of({70, 46}, 1, false)));
  EXPECT_EQ(writer.figures()[0].left_out, 1U);
}

}  // namespace
}  // namespace huetrack::capture
