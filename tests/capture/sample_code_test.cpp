#include "capture/frames/sample_code.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

namespace huetrack::capture {
namespace {

using Samples = std::vector<std::uint8_t>;

Samples random_samples(std::size_t count, unsigned from, unsigned to, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_int_distribution<unsigned> one(from, to);
  Samples out(count);
  std::ranges::generate(out, [&] { return static_cast<std::uint8_t>(one(random)); });
  return out;
}

TEST(SampleCode, RoundTripsAndLeavesTheRest) {
  struct Case {
    std::size_t count, per_row;
    unsigned from, to;
  };
  for (const Case& c : {Case{1, 1, 7, 7}, Case{8, 8, 0, 255}, Case{16, 4, 0, 255}, Case{17, 17, 0, 1},
                        Case{38 * 38, 38, 90, 110}, Case{40 * 30, 40, 0, 255}, Case{20 * 3, 20, 128, 128}}) {
    const Samples given = random_samples(c.count, c.from, c.to, static_cast<unsigned>(c.count));
    Samples coded{99};
    put_samples(given, c.per_row, coded);
    EXPECT_EQ(coded.front(), 99) << "it appends";
    EXPECT_LE(coded.size() - 1, (c.count + 15) / 16 * 17);
    coded.push_back(42);
    std::span<const std::uint8_t> rest = std::span(coded).subspan(1);
    Samples back(c.count, 1);
    ASSERT_TRUE(take_samples(rest, c.per_row, back));
    EXPECT_EQ(back, given) << c.count;
    ASSERT_EQ(rest.size(), 1U);
    EXPECT_EQ(rest.front(), 42);
  }
}

TEST(SampleCode, CompressesSmoothPictures) {
  // A slope with noise of a few grey values, as cameras have.
  const Samples noise = random_samples(std::size_t{40} * 40, 0, 5, 1);
  Samples given(noise.size());
  for (std::size_t i = 0; i < given.size(); ++i) given[i] = static_cast<std::uint8_t>(60 + i / 40 + i % 40 + noise[i]);
  Samples coded;
  put_samples(given, 40, coded);
  EXPECT_LT(coded.size(), given.size() * 6 / 10);
  const Samples flat(1600, 128);
  coded.clear();
  put_samples(flat, 40, coded);
  EXPECT_EQ(coded.size(), flat.size() / most_samples_per_byte);
}

TEST(SampleCode, RefusesTooShortOrInvalidBytes) {
  const Samples given = random_samples(100, 0, 255, 3);
  Samples coded;
  put_samples(given, 10, coded);
  Samples back(given.size());
  for (std::size_t length = 0; length < coded.size(); ++length) {
    std::span<const std::uint8_t> rest = std::span(coded).first(length);
    EXPECT_FALSE(take_samples(rest, 10, back)) << length;
  }
  for (const std::uint8_t bits : {0x09, 0x90, 0xff}) {
    Samples wrong(64, 0);
    wrong[0] = bits;
    std::span<const std::uint8_t> rest = wrong;
    EXPECT_FALSE(take_samples(rest, 4, std::span(back).first(16)));
  }
}

}  // namespace
}  // namespace huetrack::capture
