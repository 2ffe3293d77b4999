#include "capture/jpeg/jpeg_index.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <random>
#include <thread>

#include "capture/clips.h"
#include "capture/jpeg/inverse_transform.h"
#include "capture/jpeg_compare.h"
#include "capture/jpeg_maker.h"

namespace huetrack::capture {
namespace {

using Bytes = std::vector<std::uint8_t>;

std::shared_ptr<const JpegIndex> index_of(const Bytes& jpeg, JpegIndexPool* pool = nullptr) {
  return JpegIndex::build(std::make_shared<const Bytes>(jpeg), 0, 0, pool);
}

void expect_same(const Bytes& jpeg, JpegIndexPool* pool = nullptr) {
  JpegDecoder decoder;
  std::string difference;
  EXPECT_EQ(compare_with_decoder(decoder, jpeg, pool, difference), Indexed::same) << difference;
}

struct Sampling {
  int luma_h, luma_v, chroma_h, chroma_v;
};
constexpr Sampling samplings[] = {{1, 1, 1, 1}, {2, 1, 1, 1}, {2, 2, 1, 1}, {2, 2, 1, 2},
                                  {2, 1, 2, 1}, {1, 2, 1, 2}, {4, 1, 2, 1}, {1, 3, 1, 3}};

MadeJpeg sampled(MadeJpeg made, const Sampling& s) {
  made.luma_h = s.luma_h, made.luma_v = s.luma_v, made.chroma_h = s.chroma_h, made.chroma_v = s.chroma_v;
  return made;
}

TEST(JpegIndex, HasTheDecodersPixelsOfAllSubsamplingsAndSizes) {
  JpegIndexPool pool;
  for (const Sampling& s : samplings)
    for (const auto& [width, height] : {std::pair{2, 2}, std::pair{64, 48}, std::pair{50, 34}, std::pair{178, 94}}) {
      SCOPED_TRACE(testing::Message() << s.luma_h << s.luma_v << s.chroma_h << s.chroma_v << " " << width << "x"
                                      << height);
      expect_same(make_jpeg(sampled({.width = width, .height = height}, s)), &pool);
    }
  for (const auto& [width, height] : {std::pair{1, 1}, std::pair{51, 33}, std::pair{177, 95}}) {
    SCOPED_TRACE(testing::Message() << width << "x" << height);
    expect_same(make_jpeg({.width = width, .height = height, .luma_h = 1, .luma_v = 1}), &pool);
    expect_same(make_jpeg({.width = width, .height = height, .components = 1, .luma_h = 1, .luma_v = 1}), &pool);
    expect_same(make_jpeg({.width = width, .height = height, .components = 1, .luma_h = 2, .luma_v = 2}), &pool);
  }
}

TEST(JpegIndex, HasTheDecodersPixelsOfAllQualities) {
  JpegIndexPool pool;
  for (int quality = 1; quality <= 100; ++quality) {
    SCOPED_TRACE(quality);
    const auto seed = static_cast<unsigned>(quality);
    expect_same(make_jpeg({.width = 80, .height = 64, .quality = quality, .noise = 0.6 * quality, .seed = seed}),
                &pool);
    expect_same(make_jpeg({.width = 80, .height = 64, .quality = quality, .optimised = true, .seed = seed}), &pool);
  }
}

// So long that several lanes take turns, with parts that are quicker than others.
TEST(JpegIndex, HasTheDecodersPixelsOfLongScans) {
  JpegIndexPool pool;
  for (unsigned seed = 1; seed <= 6; ++seed)
    for (const Sampling& s : {samplings[0], samplings[1], samplings[2]}) {
      SCOPED_TRACE(testing::Message() << seed << " " << s.luma_h << s.luma_v);
      const MadeJpeg made = sampled({.width = 480,
                                     .height = 320,
                                     .quality = seed == 6 ? 100 : 92,
                                     .optimised = seed % 2 == 0,
                                     .one_code_for_all = seed == 3,
                                     .noise = 4.0 * seed,
                                     .is_flat = seed == 4,
                                     .seed = seed},
                                    s);
      expect_same(make_jpeg(made), &pool);
    }
  expect_same(make_jpeg({.width = 480, .height = 320, .components = 1, .luma_h = 1, .luma_v = 1, .noise = 20}), &pool);
}

TEST(JpegIndex, TakesRestartMarkers) {
  JpegIndexPool pool;
  for (const int interval : {1, 2, 3, 5, 7, 11, 59, 60, 61, 1000}) {
    SCOPED_TRACE(interval);
    expect_same(make_jpeg({.width = 320, .height = 200, .restart_interval = interval, .noise = 20}), &pool);
  }
  Bytes wrong = make_jpeg({.width = 320, .height = 200, .restart_interval = 7});
  for (std::size_t i = 0; i + 1 < wrong.size(); ++i)
    if (wrong[i] == 0xFF && wrong[i + 1] == 0xD3) {
      wrong[i + 1] = 0xD4;
      break;
    }
  EXPECT_EQ(index_of(wrong), nullptr);
}

// By a second pass, and, for the third frame that is searched on, by the index pass.
TEST(JpegIndex, BoundsDoNotDependOnThePassThatComputesThem) {
  const auto numbers = [](const std::vector<PixelBounds>& bounds) {
    std::vector<int> out;
    for (const auto& [y, u, v] : bounds) out.insert(out.end(), {y.min, y.max, u.min, u.max, v.min, v.max});
    return out;
  };
  for (const int interval : {0, 7})
    for (const double noise : {3.0, 60.0}) {
      SCOPED_TRACE(testing::Message() << interval << " " << noise);
      JpegIndexPool pool;
      const Bytes jpeg = make_jpeg({.width = 480, .height = 320, .restart_interval = interval, .noise = noise});
      const std::vector<int> expected = numbers(index_of(jpeg)->bounds());
      for (int frame = 0; frame < 4; ++frame) EXPECT_EQ(numbers(index_of(jpeg, &pool)->bounds()), expected) << frame;
    }
}

Bytes with_segment(Bytes jpeg, std::uint8_t marker, std::string_view text) {
  Bytes segment{0xFF, marker, 0, static_cast<std::uint8_t>(text.size() + 2)};
  segment.insert(segment.end(), text.begin(), text.end());
  jpeg.insert(jpeg.begin() + 2, segment.begin(), segment.end());
  return jpeg;
}

std::size_t segment_at(const Bytes& jpeg, std::uint8_t marker) {
  for (std::size_t i = 2; i + 4 < jpeg.size() && jpeg[i] == 0xFF;) {
    if (jpeg[i + 1] == marker) return i;
    i += 2 + (std::size_t{jpeg[i + 2]} << 8 | jpeg[i + 3]);
  }
  return 0;
}

TEST(JpegIndex, ReadsHeadersAsTheDecoderDoes) {
  const Bytes jpeg = make_jpeg({});
  expect_same(with_segment(jpeg, 0xFE, "a comment"));
  expect_same(with_segment(jpeg, 0xE5, "anything"));
  const Bytes limited = with_segment(jpeg, 0xFE, "CS=ITU601");
  expect_same(limited);
  ASSERT_TRUE(index_of(limited));
  EXPECT_EQ(index_of(limited)->range(), ColorRange::limited);

  Bytes without_codes = jpeg;  // as webcams send it
  int cut = 0;
  for (std::size_t at = segment_at(without_codes, 0xC4); at > 0; at = segment_at(without_codes, 0xC4), ++cut) {
    const auto from = without_codes.begin() + static_cast<std::ptrdiff_t>(at);
    without_codes.erase(from, from + 2 + (from[2] << 8 | from[3]));
  }
  EXPECT_EQ(cut, 4);
  expect_same(without_codes);

  Bytes without_jfif = jpeg;
  without_jfif.erase(without_jfif.begin() + 2, without_jfif.begin() + 20);
  expect_same(without_jfif);
  expect_same(with_segment(without_jfif, 0xEE, std::string_view("Adobe\0d\0\0\0\0\1", 12)));
  EXPECT_EQ(index_of(with_segment(without_jfif, 0xEE, std::string_view("Adobe\0d\0\0\0\0\0", 12))), nullptr);  // RGB
}

TEST(JpegIndex, TakesFillBytesAndPadding) {
  const Bytes jpeg = make_jpeg({});
  const auto with = [&](std::ptrdiff_t from_end, const Bytes& bytes) {
    Bytes changed = jpeg;
    changed.insert(changed.end() - from_end, bytes.begin(), bytes.end());
    return changed;
  };
  expect_same(with(2, {0xFF, 0xFF}));
  expect_same(with(2, {0, 0}));
  expect_same(with(2, {0xFF, 0, 0x12}));
  expect_same(with(2, {0xFF, 0xD0}));   // a restart marker behind the last MCU
  expect_same(with(0, Bytes(500, 0)));  // the rest of a buffer
  EXPECT_EQ(index_of(with(2, Bytes(100, 0x11))), nullptr);
  EXPECT_EQ(index_of(with(2, {0xFF, 0xFE, 0, 2})), nullptr);  // left to the decoder
}

// libjpeg-turbo then mixes coefficients of two attempts.
TEST(JpegIndex, LeavesFillBytesWithinTheScanToTheDecoder) {
  Bytes jpeg = make_jpeg({.width = 320, .height = 240, .quality = 97, .noise = 30});
  const auto scan = jpeg.begin() + static_cast<std::ptrdiff_t>(segment_at(jpeg, 0xDA)) + 14;
  constexpr std::array<std::uint8_t, 2> stuffed{0xFF, 0};
  const auto at = std::search(scan, jpeg.end(), stuffed.begin(), stuffed.end());
  ASSERT_NE(at, jpeg.end());
  EXPECT_NE(index_of(jpeg), nullptr);
  jpeg.insert(at, 0xFF);
  EXPECT_EQ(index_of(jpeg), nullptr);
}

TEST(JpegIndex, LeavesOtherKindsToTheDecoder) {
  EXPECT_EQ(index_of({}), nullptr);
  EXPECT_EQ(index_of(make_jpeg({.progressive = true})), nullptr);
  EXPECT_EQ(index_of(make_jpeg({.luma_h = 1, .luma_v = 1, .rgb = true})), nullptr);
  EXPECT_EQ(index_of(make_jpeg({.luma_h = 4, .luma_v = 1})), nullptr);  // 4:1:1
  EXPECT_EQ(index_of(make_jpeg({.luma_h = 1, .luma_v = 2})), nullptr);  // 4:4:0
  EXPECT_EQ(index_of(make_jpeg({.width = 51})), nullptr);
  const auto bytes = std::make_shared<const Bytes>(make_jpeg({}));
  EXPECT_NE(JpegIndex::build(bytes, 64, 48), nullptr);
  EXPECT_EQ(JpegIndex::build(bytes, 64, 32), nullptr);
}

TEST(JpegIndex, DecodesOnlyTheMcusThatItIsAskedFor) {
  const auto index = index_of(make_jpeg({.width = 96, .height = 64}));
  ASSERT_TRUE(index);
  const IndexedImage whole = decode_all(*index);
  std::array<Bytes, 3> planes{Bytes(96 * 64, 77), Bytes(48 * 32, 77), Bytes(48 * 32, 77)};
  index->decode(2, 1, 3, {planes[0].data(), planes[1].data(), planes[2].data()}, {96, 48, 48});
  for (std::size_t p = 0; p < 3; ++p) {
    const int size = p == 0 ? 16 : 8, width = p == 0 ? 96 : 48;
    for (int i = 0; i < static_cast<int>(planes[p].size()); ++i) {
      const bool is_inside = i / width / size == 2 && i % width >= size && i % width < 3 * size;
      const auto at = static_cast<std::size_t>(i);
      ASSERT_EQ(planes[p][at], is_inside ? whole.planes[p][at] : 77) << "plane " << p << ", " << i;
    }
  }
  index->decode(0, 3, 3, {}, {});  // none
}

TEST(JpegIndex, EighthIsWhatLibjpegDecodesAtThatSize) {
  for (const Sampling& s : {samplings[0], samplings[1], samplings[2], samplings[3]})
    for (const int quality : {30, 90, 100}) {
      const Bytes jpeg = make_jpeg(sampled({.width = 120, .height = 88, .quality = quality, .noise = 30}, s));
      const auto index = index_of(jpeg);
      ASSERT_TRUE(index);
      const Eighth expected = eighth_of(jpeg);
      const Image eighth = index->eighth();
      ASSERT_GE(eighth.width, expected.width);
      ASSERT_GE(eighth.height, expected.height);
      EXPECT_EQ(eighth.format, index->format());
      for (int v = 0; v < expected.height; ++v)
        for (int u = 0; u < expected.width; ++u)
          ASSERT_EQ(eighth.planes[0].data[v * eighth.planes[0].stride + u],
                    expected.pixels[static_cast<std::size_t>(v * expected.width + u)])
              << u << "," << v;
      // Chroma: the mean of what is decoded there.
      const IndexedImage whole = decode_all(*index);
      const Plane &small = eighth.planes[2], &large = whole.image.planes[2];
      for (int v = 0; v < 5; ++v)
        for (int u = 0; u < 5; ++u) {
          double sum = 0;
          for (int i = 0; i < 64; ++i) sum += large.data[(8 * v + i / 8) * large.stride + 8 * u + i % 8];
          ASSERT_NEAR(small.data[v * small.stride + u], sum / 64, 4) << u << "," << v;  // clipped pixels, rounding
        }
    }
}

TEST(JpegIndex, ImageKeepsTheIndex) {
  auto index = index_of(make_jpeg({}));
  ASSERT_TRUE(index);
  const std::weak_ptr<const JpegIndex> watched = index;
  Image eighth = index->eighth();
  index = nullptr;
  EXPECT_FALSE(watched.expired());
  eighth = {};
  EXPECT_TRUE(watched.expired());
}

TEST(JpegIndex, MemoryComesBackToThePool) {
  auto pool = std::make_unique<JpegIndexPool>(2);
  auto first = index_of(make_jpeg({.width = 320, .height = 240}), pool.get());
  const JpegIndex* const address = first.get();
  const auto second = index_of(make_jpeg({.seed = 2}), pool.get());
  EXPECT_NE(second.get(), address);
  first = nullptr;
  const Bytes other = make_jpeg({.width = 160, .height = 96, .quality = 70, .optimised = true, .seed = 3});
  auto third = index_of(other, pool.get());
  EXPECT_EQ(third.get(), address);
  expect_same(other, pool.get());
  pool = nullptr;  // before the indices
  EXPECT_EQ(decode_all(*third).image.width, 160);
}

TEST(JpegIndex, ManyThreadsDecodeOneImage) {
  const Bytes jpeg = make_jpeg({.width = 320, .height = 240});
  const auto index = index_of(jpeg);
  ASSERT_TRUE(index);
  const IndexedImage expected = decode_all(*index);
  std::array<Bytes, 3> planes{Bytes(320 * 240), Bytes(160 * 120), Bytes(160 * 120)};
  std::vector<std::jthread> threads;
  for (int k = 0; k < 3; ++k)
    threads.emplace_back([&, k] {
      for (int v = k; v < index->mcu_rows(); v += 3)
        index->decode(v, 0, index->mcu_columns(), {planes[0].data(), planes[1].data(), planes[2].data()},
                      {320, 160, 160});
      EXPECT_EQ(index->eighth().width, 40);
    });
  threads.clear();
  EXPECT_EQ(planes, expected.planes);
}

TEST(JpegIndex, TruncatedIsNeverAccepted) {
  const Bytes jpeg = make_jpeg({.restart_interval = 2});
  for (std::size_t length = 0; length < jpeg.size(); ++length)
    ASSERT_EQ(index_of(Bytes(jpeg.begin(), jpeg.begin() + static_cast<std::ptrdiff_t>(length))), nullptr) << length;
}

// Damage in any place: the index never accepts what the decoder refuses, and what both accept has the same pixels,
// however far its coefficients are beyond what an encoder writes (on x86-64, whose arithmetic inverse_transform()
// follows).
TEST(JpegIndex, DamagedBytesHaveTheDecodersVerdict) {
  std::mt19937 random(20);
  std::vector<Bytes> sound;
  for (const Sampling& s : {samplings[0], samplings[1], samplings[2], samplings[3]})
    for (const int restart : {0, 2})
      for (const int quality : {25, 97})
        sound.push_back(
            make_jpeg(sampled({.width = 48, .height = 32, .quality = quality, .restart_interval = restart}, s)));
  sound.push_back(make_jpeg({.width = 320, .height = 240, .quality = 92, .noise = 15}));  // lanes
  JpegDecoder decoder;
  JpegIndexPool pool;
  std::array<int, 4> count{};
  for (int round = 0; round < 20000; ++round) {
    const auto below = [&](std::size_t n) { return random() % n; };
    Bytes jpeg = sound[round % 50 == 0 ? sound.size() - 1 : below(sound.size() - 1)];
    const std::size_t header = segment_at(jpeg, 0xDA) + 14, scan = jpeg.size() - header;
    for (std::size_t k = 1 + below(3); k > 0; --k) {
      const std::size_t at = (round % 3 == 0 ? below(header) : header + below(scan)) % jpeg.size();
      switch (below(5)) {
        case 0:
          jpeg[at] = static_cast<std::uint8_t>(random());
          break;
        case 1:
          jpeg[at] = static_cast<std::uint8_t>(jpeg[at] ^ 1U << below(8));
          break;
        case 2:
          jpeg[at] = 0xFF;
          break;
        case 3:
          jpeg.erase(jpeg.begin() + static_cast<std::ptrdiff_t>(at));
          break;
        default:
          jpeg.insert(jpeg.begin() + static_cast<std::ptrdiff_t>(at), static_cast<std::uint8_t>(random()));
      }
    }
    std::string difference;
    const Indexed verdict = compare_with_decoder(decoder, jpeg, &pool, difference);
    ++count[static_cast<std::size_t>(verdict)];
#if !defined(__x86_64__)
    if (difference.starts_with("other pixels")) continue;
#endif
    ASSERT_NE(verdict, Indexed::otherwise) << difference << ", round " << round;
  }
  const auto of = [&](Indexed verdict) { return count[static_cast<std::size_t>(verdict)]; };
  EXPECT_GT(of(Indexed::refused_by_both), 5000);
  EXPECT_GT(of(Indexed::same), 3000);
  EXPECT_LT(of(Indexed::left_to_decoder), of(Indexed::same) / 4);
}

// Any coefficients: the vector instructions, for one block and for two, and the plain code.
TEST(InverseTransform, IsThePlainOne) {
  std::mt19937 random(5);
  std::array<JpegBlock, 2> two;
  for (int round = 0; round < 20000; ++round) {
    JpegBlock& block = two[static_cast<std::size_t>(round % 2)] = {};
    const int most = round % 3 == 0 ? 32767 : 1200, used = round % 7 == 0 ? 8 : 64;
    for (int i = 0; i < used; ++i)
      if (random() % 4 <= static_cast<unsigned>(round / 2 % 4))
        block.coefficients[static_cast<std::size_t>(i)] =
            static_cast<std::int16_t>(static_cast<int>(random() % static_cast<unsigned>(2 * most + 1)) - most);
    std::array<std::array<std::uint8_t, 64>, 2> fast{}, plain{};
    inverse_transform(block, used == 8, fast[0].data(), 8);
    plain_inverse_transform(block, used == 8, plain[0].data(), 8);
    ASSERT_EQ(fast[0], plain[0]) << round;
    inverse_transform_two(two, {BlockPixels{fast[0].data(), 8}, BlockPixels{fast[1].data(), 8}});
    for (std::size_t i = 0; i < 2; ++i) plain_inverse_transform(two[i], false, plain[i].data(), 8);
    ASSERT_EQ(fast, plain) << round;
    JpegBlock mean;
    mean.coefficients[0] = block.coefficients[0];
    plain_inverse_transform(mean, true, plain[0].data(), 8);
    ASSERT_THAT(plain[0], testing::Each(jpeg_mean(mean.coefficients[0])));
  }
}

// Frames of recordings in MJPEG, of which those of `webcams` are as a webcam sends them.
TEST(JpegIndex, HasTheDecodersPixelsOfRecordings) {
  const std::filesystem::path rendered = std::filesystem::path(HUETRACK_SHARED_DATA) / "rendered";
  if (!std::filesystem::exists(rendered)) GTEST_SKIP() << "no " << rendered;
  JpegIndexPool pool;
  for (const char* name : {"webcams/cam0.mkv", "juggling/cam0.mkv", "fast_60fps/cam0.mkv", "bumped/cam1.mkv"}) {
    SCOPED_TRACE(name);
    AVFormatContext* input = nullptr;
    ASSERT_EQ(avformat_open_input(&input, (rendered / name).c_str(), nullptr, nullptr), 0);
    const std::unique_ptr<AVPacket, void (*)(AVPacket*)> packet(av_packet_alloc(),
                                                                [](AVPacket* p) { av_packet_free(&p); });
    int frames = 0;
    for (; frames < 12 && av_read_frame(input, packet.get()) == 0; ++frames) {
      expect_same(Bytes(packet->data, packet->data + packet->size), &pool);
      av_packet_unref(packet.get());
    }
    avformat_close_input(&input);
    EXPECT_EQ(frames, 12);
  }
}

// Files that cameras and other programs than libjpeg-turbo's and ours wrote; large and small, grey and of each chroma.
TEST(JpegIndex, HasTheDecodersPixelsOfPhotographs) {
  const std::filesystem::path data = HUETRACK_SHARED_DATA;
  if (!std::filesystem::exists(data)) GTEST_SKIP() << "no " << data;
  JpegIndexPool pool;
  for (const char* folder : {"opencv_chessboard_stereo", "caliscope_charuco_4cam/aruco_extrinsic",
                             "hand_held_7scenes/cam0", "field_cases/glob_order/cam0", "rendered/chessboard/cam0"}) {
    std::vector<std::filesystem::path> files;
    for (const auto& entry : std::filesystem::directory_iterator(data / folder))
      if (entry.path().extension() == ".jpg") files.push_back(entry.path());
    ASSERT_GE(files.size(), 8U) << folder;
    std::ranges::sort(files);
    for (std::size_t i = 0; i < files.size(); i += files.size() / 8) {
      SCOPED_TRACE(files[i]);
      std::ifstream in(files[i], std::ios::binary);
      expect_same(Bytes(std::istreambuf_iterator<char>(in), {}), &pool);
    }
  }
}

}  // namespace
}  // namespace huetrack::capture
