#include "particle_filter/random.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <vector>

namespace huetrack::particle_filter {
namespace {

using testing::ElementsAre;

std::vector<float> normals(Rng rng, std::size_t n) {
  std::vector<float> out(n);
  rng.fill_normal(out);
  return out;
}

std::vector<float> uniforms(Rng rng, std::size_t n) {
  std::vector<float> out(n);
  rng.fill_uniform(out);
  return out;
}

double normal_cdf(double x) {
  return 0.5 * std::erfc(-x / std::sqrt(2.0));
}

// Kolmogorov's statistic times sqrt(n): below 1.95 with probability 0.999 when the sample has this distribution.
template <typename Cdf>
double kolmogorov(std::vector<float> sample, Cdf cdf) {
  std::ranges::sort(sample);
  const auto n = static_cast<double>(sample.size());
  double largest = 0;
  for (std::size_t i = 0; i < sample.size(); ++i) {
    const double f = cdf(static_cast<double>(sample[i]));
    largest = std::max({largest, f - static_cast<double>(i) / n, static_cast<double>(i + 1) / n - f});
  }
  return largest * std::sqrt(n);
}

double correlation(const std::vector<float>& a, const std::vector<float>& b) {
  double ab = 0, aa = 0, bb = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const auto x = static_cast<double>(a[i]), y = static_cast<double>(b[i]);
    ab += x * y, aa += x * x, bb += y * y;
  }
  return ab / std::sqrt(aa * bb);
}

// A recording repeats only while these numbers stay what they are: whoever changes the generator must mean to.
TEST(Rng, firstNumbersArePinned) {
  Rng rng(1);
  EXPECT_EQ(rng.uniform(), 0.76446257390122985);
  EXPECT_EQ(rng.uniform(), 0.25470378165912155);
  EXPECT_THAT(uniforms(Rng(1, 2), 4), ElementsAre(0.857577205f, 0.0251201391f, 0.240804911f, 0.225867391f));
  const std::vector<float> z = normals(Rng(42, 7), 300);
  EXPECT_THAT((std::vector{z[0], z[1], z[128], z[256], z[299]}),
              ElementsAre(0.110304728f, 0.196977735f, 0.175808102f, -0.470930129f, 0.216886893f));
}

TEST(Rng, normalsHaveTheMomentsOfTheStandardNormal) {
  const std::size_t n = 4'000'000;
  double m1 = 0, m2 = 0, m3 = 0, m4 = 0, m6 = 0;
  for (const float zf : normals(Rng(3), n)) {
    const auto z = static_cast<double>(zf);
    m1 += z, m2 += z * z, m3 += z * z * z, m4 += z * z * z * z, m6 += std::pow(z, 6);
  }
  const auto count = static_cast<double>(n);
  // Five standard deviations of each sample moment.
  EXPECT_NEAR(m1 / count, 0, 5 * std::sqrt(1 / count));
  EXPECT_NEAR(m2 / count, 1, 5 * std::sqrt(2 / count));
  EXPECT_NEAR(m3 / count, 0, 5 * std::sqrt(15 / count));
  EXPECT_NEAR(m4 / count, 3, 5 * std::sqrt(96 / count));
  EXPECT_NEAR(m6 / count, 15, 5 * std::sqrt(10170 / count));
}

TEST(Rng, normalsFollowTheNormalDistribution) {
  EXPECT_LT(kolmogorov(normals(Rng(4), 1'000'000), normal_cdf), 1.95);
}

TEST(Rng, normalTailsAreAsHeavyAsTheyShouldBe) {
  const std::size_t n = 8'000'000;
  const std::vector<float> z = normals(Rng(5), n);
  for (const double beyond : {2.0, 3.0, 4.0, 4.8}) {
    for (const double sign : {-1.0, 1.0}) {
      const double expected = static_cast<double>(n) * normal_cdf(-beyond);
      const auto count = std::ranges::count_if(z, [&](float x) { return sign * static_cast<double>(x) > beyond; });
      EXPECT_NEAR(static_cast<double>(count), expected, 4 * std::sqrt(expected)) << sign * beyond;
    }
  }
  EXPECT_LT(std::ranges::max(z), 6.7f);
  EXPECT_GT(std::ranges::min(z), -6.7f);
}

// A generator that makes normals in pairs or in lanes must not let the one say anything of the other: neither of its
// value (correlation) nor of its size (correlation of the squares).
TEST(Rng, normalsOfOneFillAreIndependent) {
  const std::size_t n = 1 << 20;
  const std::vector<float> z = normals(Rng(6), n);
  std::vector<float> squares(n);
  std::ranges::transform(z, squares.begin(), [](float x) { return x * x - 1; });
  for (const std::size_t lag : {1u, 2u, 8u, 15u, 16u, 17u, 32u, 64u, 128u, 256u, 512u}) {
    const auto correlation_at = [&](const std::vector<float>& s) {
      return correlation({s.begin(), s.end() - static_cast<std::ptrdiff_t>(lag)},
                         {s.begin() + static_cast<std::ptrdiff_t>(lag), s.end()});
    };
    EXPECT_NEAR(correlation_at(z), 0, 5e-3) << "lag " << lag;  // five standard deviations
    EXPECT_NEAR(correlation_at(squares), 0, 5e-3) << "lag " << lag;
  }
}

TEST(Rng, uniformsAreUniform) {
  const auto cdf = [](double x) { return x; };
  const std::vector<float> many = uniforms(Rng(7), 1'000'000);
  EXPECT_LT(kolmogorov(many, cdf), 1.95);
  EXPECT_GE(std::ranges::min(many), 0.0f);
  EXPECT_LT(std::ranges::max(many), 1.0f);
  Rng rng(8);
  std::vector<float> single(200'000);
  std::ranges::generate(single, [&] { return static_cast<float>(rng.uniform()); });
  EXPECT_LT(kolmogorov(single, cdf), 1.95);
}

TEST(Rng, sameSeedAndStreamSameNumbers) {
  EXPECT_EQ(normals(Rng(9, 1), 1000), normals(Rng(9, 1), 1000));
  EXPECT_EQ(uniforms(Rng(9, 1), 1000), uniforms(Rng(9, 1), 1000));
}

TEST(Rng, streamsAndSeedsAreIndependent) {
  const std::size_t n = 200'000;
  const std::vector<float> reference = normals(Rng(10, 0), n);
  for (const auto& [seed, stream] : {std::pair{10, 1}, {10, 2}, {11, 0}, {0, 10}, {0, 0}, {10, 1 << 20}}) {
    const auto other = normals(Rng(static_cast<std::uint64_t>(seed), static_cast<std::uint64_t>(stream)), n);
    EXPECT_NEAR(correlation(reference, other), 0, 5 / std::sqrt(static_cast<double>(n))) << seed << ", " << stream;
  }
}

TEST(Rng, fillsOfWholeBatchesGiveTheSameNumbersAsOneFill) {
  const std::vector<float> whole_normal = normals(Rng(11), 1024), whole_uniform = uniforms(Rng(11), 1024);
  std::vector<float> in_parts(1024);
  const std::span<float> parts(in_parts);
  Rng a(11);
  a.fill_normal(parts.first(256)), a.fill_normal(parts.subspan(256, 512)), a.fill_normal(parts.subspan(768));
  EXPECT_EQ(in_parts, whole_normal);
  Rng b(11);
  b.fill_uniform(parts.first(16)), b.fill_uniform(parts.subspan(16, 480)), b.fill_uniform(parts.subspan(496));
  EXPECT_EQ(in_parts, whole_uniform);
}

TEST(Rng, fillsOfAnySizeStayInside) {
  for (std::size_t n = 0; n < 600; ++n) {
    std::vector<float> guarded(n + 2, 77.0f);
    Rng rng(12);
    rng.fill_normal(std::span(guarded).subspan(1, n));
    ASSERT_EQ(guarded.front(), 77.0f) << n;
    ASSERT_EQ(guarded.back(), 77.0f) << n;
    ASSERT_EQ(std::ranges::count(guarded, 77.0f), 2) << n;  // every place was written
    std::ranges::fill(guarded, 77.0f);
    rng.fill_uniform(std::span(guarded).subspan(1, n));
    ASSERT_EQ(guarded.front(), 77.0f) << n;
    ASSERT_EQ(guarded.back(), 77.0f) << n;
    ASSERT_EQ(std::ranges::count(guarded, 77.0f), 2) << n;
  }
}

}  // namespace
}  // namespace huetrack::particle_filter
