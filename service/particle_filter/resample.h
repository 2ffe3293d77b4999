// Weights and resampling of a particle set. Pure functions; safe from any thread on disjoint data.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace huetrack::particle_filter {

// Log weights to weights that sum to 1 (log-sum-exp, so that no product of small likelihoods underflows).
// All -infinity: uniform weights, false. Otherwise true.
bool normalize_log_weights(std::span<const float> log_weight, std::span<float> weight);

// Weights >= 0 to weights that sum to 1. All zero: uniform, false.
bool normalize_weights(std::span<float> weight);

// 1 / sum(w^2) for weights that sum to 1: how many equally weighted particles would say as much. In [1, N].
double effective_sample_size(std::span<const float> weight);

// Systematic resampling (Kitagawa 1996): ancestor[i] is the particle with the cumulative weight (offset + i) / n, where
// n is ancestor.size(), which may differ from weight.size(). offset: [0, 1), drawn by the caller. Each particle is
// taken floor(n w) or ceil(n w) times: less noise than drawing n times independently, as CONDENSATION does.
//   systematic_ancestors({0.1, 0.0, 0.9}, 0.2, out of 2) == {0, 2}
void systematic_ancestors(std::span<const float> weight, double offset, std::span<std::uint32_t> ancestor);

// The particles that those ancestors are, count of them: out[c][i] == in[c][ancestor[i]] for the three coordinates c.
//   in   (weight.size(),) each, below 2^31;  out   (count + spread_beyond,) each, apart from in and from each other;
//        what lies beyond count is undefined
constexpr std::size_t spread_beyond = 15;
void systematic_resample(std::span<const float> weight, double offset, std::size_t count,
                         const std::array<const float*, 3>& in, const std::array<float*, 3>& out);

}  // namespace huetrack::particle_filter
