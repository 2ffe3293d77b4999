#include "particle_filter/resample.h"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>
#include <numeric>
#include <vector>

#include "particle_filter/random.h"

namespace huetrack::particle_filter {
namespace {

using testing::Each;
using testing::ElementsAre;
using testing::FloatEq;
using testing::Pointwise;
using Ancestors = std::vector<std::uint32_t>;
using Weights = std::vector<float>;

Ancestors ancestors(const Weights& weight, double offset, std::size_t count) {
  Ancestors out(count + 1, 123456);  // one too many, which must stay as it is
  systematic_ancestors(weight, offset, std::span(out).first(count));
  EXPECT_EQ(out.back(), 123456u);
  out.pop_back();
  std::vector<float> values[3], taken[3];
  for (std::size_t c = 0; c < 3; ++c) {
    values[c].resize(weight.size());
    std::iota(values[c].begin(), values[c].end(), 0.25f + 1e5f * static_cast<float>(c));
    taken[c].assign(count + spread_beyond + 1, 77.0f);
  }
  systematic_resample(weight, offset, count, {values[0].data(), values[1].data(), values[2].data()},
                      {taken[0].data(), taken[1].data(), taken[2].data()});
  for (std::size_t c = 0; c < 3; ++c) {
    for (std::size_t i = 0; i < count; ++i) EXPECT_EQ(taken[c][i], values[c][out[i]]);
    EXPECT_EQ(taken[c].back(), 77.0f);
  }
  return out;
}

// The definition: the first particle whose cumulative weight is above the tooth.
Ancestors reference(const Weights& weight, double offset, std::size_t count) {
  Ancestors out;
  for (std::size_t i = 0; i < count; ++i) {
    double cumulative = 0;
    std::size_t j = 0;
    for (; j < weight.size(); ++j) {
      cumulative += static_cast<double>(weight[j]);
      if (cumulative * static_cast<double>(count) - offset > static_cast<double>(i)) break;
    }
    if (j == weight.size()) {
      while (j > 1 && !(weight[j - 1] > 0)) --j;
      --j;
    }
    out.push_back(static_cast<std::uint32_t>(j));
  }
  return out;
}

Weights random_weights(std::size_t n, std::uint64_t seed, double zeros, double sharpness) {
  Rng rng(seed);
  Weights w(n);
  for (float& x : w) x = rng.uniform() < zeros ? 0.0f : static_cast<float>(std::pow(rng.uniform(), sharpness));
  normalize_weights(w);
  return w;
}

TEST(SystematicAncestors, exactResults) {
  EXPECT_EQ(ancestors({0.1f, 0.0f, 0.9f}, 0.2, 3), (Ancestors{0, 2, 2}));
  EXPECT_EQ(ancestors({0.1f, 0.0f, 0.9f}, 0.2, 2), (Ancestors{0, 2}));
  EXPECT_EQ(ancestors({0.25f, 0.25f, 0.25f, 0.25f}, 0.0, 4), (Ancestors{0, 1, 2, 3}));
  EXPECT_EQ(ancestors({0.25f, 0.25f, 0.25f, 0.25f}, 0.999, 4), (Ancestors{0, 1, 2, 3}));
  EXPECT_EQ(ancestors({0.5f, 0.5f}, 0.0, 5), (Ancestors{0, 0, 0, 1, 1}));
  EXPECT_EQ(ancestors({0.5f, 0.5f}, 0.5, 5),
            (Ancestors{0, 0, 1, 1, 1}));  // a tooth on the edge belongs to what follows
  EXPECT_EQ(ancestors({1.0f}, 0.3, 3), (Ancestors{0, 0, 0}));
  EXPECT_EQ(ancestors({0.0f, 1.0f, 0.0f}, 0.3, 9), (Ancestors{1, 1, 1, 1, 1, 1, 1, 1, 1}));
  EXPECT_EQ(ancestors({0.75f, 0.25f}, 0.9, 1), (Ancestors{1}));
  EXPECT_EQ(ancestors({0.75f, 0.25f}, 0.2, 0), Ancestors{});
}

TEST(SystematicAncestors, agreesWithTheDefinition) {
  std::uint64_t seed = 0;
  for (const std::size_t n : {1u, 2u, 3u, 7u, 100u, 255u, 256u, 257u, 600u}) {
    for (const std::size_t count : {1u, 2u, 5u, 63u, 256u, 700u}) {
      for (const double zeros : {0.0, 0.5, 0.99}) {
        for (const double sharpness : {0.1, 1.0, 30.0}) {
          const Weights w = random_weights(n, ++seed, zeros, sharpness);
          const double offset = Rng(seed, 1).uniform();
          ASSERT_EQ(ancestors(w, offset, count), reference(w, offset, count))
              << n << " to " << count << ", seed " << seed;
        }
      }
    }
  }
}

TEST(SystematicAncestors, takesEachFloorOrCeilOfItsShare) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const Weights w = random_weights(300, seed, 0.3, 3);
    const Ancestors a = ancestors(w, Rng(seed, 1).uniform(), 1000);
    EXPECT_TRUE(std::ranges::is_sorted(a));
    std::vector<int> taken(w.size(), 0);
    for (const std::uint32_t i : a) ++taken.at(i);
    for (std::size_t i = 0; i < w.size(); ++i) {
      const double share = 1000 * static_cast<double>(w[i]);
      EXPECT_GE(taken[i], std::floor(share - 1e-3)) << i;
      EXPECT_LE(taken[i], std::ceil(share + 1e-3)) << i;
      if (w[i] == 0) {
        EXPECT_EQ(taken[i], 0) << i;
      }
    }
  }
}

// Averaged over the offset each particle is taken n w times: resampling moves no mean.
TEST(SystematicAncestors, isUnbiased) {
  const Weights w{0.05f, 0.4f, 0.0f, 0.22f, 0.33f};
  std::vector<double> taken(w.size(), 0);
  const int offsets = 1000;
  for (int i = 0; i < offsets; ++i) {
    for (const std::uint32_t a : ancestors(w, (i + 0.5) / offsets, 7)) taken[a] += 1.0 / offsets;
  }
  for (std::size_t i = 0; i < w.size(); ++i) EXPECT_NEAR(taken[i], 7 * static_cast<double>(w[i]), 2e-3);
}

// Rounding leaves sums of 0.999: the last teeth belong to the last particle that weighs anything, never to one of no
// weight.
TEST(SystematicAncestors, lastToothBeyondTheSum) {
  EXPECT_EQ(ancestors({0.5f, 0.499f, 0.0f, 0.0f}, 0.9999, 2), (Ancestors{0, 1}));
  EXPECT_EQ(ancestors({0.4f, 0.4f, 0.0f}, 0.5, 4), (Ancestors{0, 0, 1, 1}));
  EXPECT_EQ(ancestors({0.6f, 0.6f}, 0.5, 4), (Ancestors{0, 0, 1, 1}));  // and a sum above 1 writes nothing beyond
}

TEST(NormalizeWeights, sumsToOneAndKeepsRatios) {
  Weights w{1, 3, 0, 4};
  EXPECT_TRUE(normalize_weights(w));
  EXPECT_THAT(w, ElementsAre(FloatEq(0.125f), FloatEq(0.375f), FloatEq(0), FloatEq(0.5f)));
  Weights many(1000, 7e30f);
  EXPECT_TRUE(normalize_weights(many));
  EXPECT_THAT(many, Each(FloatEq(0.001f)));
}

TEST(NormalizeWeights, smallestNumbersDoNotBecomeInfinite) {
  Weights w(2, std::numeric_limits<float>::denorm_min());
  EXPECT_TRUE(normalize_weights(w));
  EXPECT_THAT(w, Each(FloatEq(0.5f)));
}

TEST(NormalizeWeights, allZeroIsUniformAndSaysSo) {
  Weights w(5, 0.0f);
  EXPECT_FALSE(normalize_weights(w));
  EXPECT_THAT(w, Each(FloatEq(0.2f)));
  Weights nan{1, std::numeric_limits<float>::quiet_NaN(), 1, 1};
  EXPECT_FALSE(normalize_weights(nan));
  EXPECT_THAT(nan, Each(FloatEq(0.25f)));
}

TEST(NormalizeLogWeights, agreesWithTheWeightsThemselves) {
  const Weights log_weight{std::log(0.1f), std::log(0.2f), std::log(0.7f), -std::numeric_limits<float>::infinity()};
  Weights w(4);
  EXPECT_TRUE(normalize_log_weights(log_weight, w));
  EXPECT_THAT(w, ElementsAre(FloatEq(0.1f), FloatEq(0.2f), FloatEq(0.7f), FloatEq(0)));
}

TEST(NormalizeLogWeights, neitherUnderflowsNorOverflows) {
  for (const float shift : {-1e5f, -200.0f, 0.0f, 200.0f, 1e5f}) {
    Weights w(2);
    EXPECT_TRUE(normalize_log_weights(Weights{shift, shift + 1}, w));
    EXPECT_NEAR(w[1] / w[0], std::exp(1.0f), 0.03) << shift;  // a float near 1e5 is a multiple of 1/128
    EXPECT_FLOAT_EQ(w[0] + w[1], 1) << shift;
  }
}

TEST(NormalizeLogWeights, isTheExponentialFunctionToThreeOfTenMillion) {
  Weights log_weight, w(8001);  // of a sum of a hundred, so that none is denormal
  for (int i = 0; i < 8001; ++i) log_weight.push_back(-0.01f * static_cast<float>(i));
  EXPECT_TRUE(normalize_log_weights(log_weight, w));
  for (std::size_t i = 0; i < w.size(); ++i) {
    const double exact = std::exp(static_cast<double>(log_weight[i]));
    EXPECT_NEAR(static_cast<double>(w[i]) / static_cast<double>(w[0]), exact, 6e-7 * exact) << log_weight[i];
  }
  Weights far(2);
  EXPECT_TRUE(normalize_log_weights(Weights{0, -88}, far));
  EXPECT_EQ(far[1], 0);
}

TEST(NormalizeLogWeights, nothingPossibleIsUniformAndSaysSo) {
  Weights w(4);
  EXPECT_FALSE(normalize_log_weights(Weights(4, -std::numeric_limits<float>::infinity()), w));
  EXPECT_THAT(w, Each(FloatEq(0.25f)));
}

TEST(EffectiveSampleSize, knownCases) {
  EXPECT_DOUBLE_EQ(effective_sample_size(Weights(64, 1.0f / 64)), 64);
  EXPECT_DOUBLE_EQ(effective_sample_size(Weights{0, 0, 1, 0}), 1);
  EXPECT_DOUBLE_EQ(effective_sample_size(Weights{0.5f, 0, 0.5f, 0, 0, 0, 0, 0, 0, 0}), 2);
  EXPECT_NEAR(effective_sample_size(Weights{0.1f, 0.2f, 0.3f, 0.4f}), 1 / 0.3, 1e-6);
}

}  // namespace
}  // namespace huetrack::particle_filter
