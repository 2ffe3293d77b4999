// Weights and resampling of a particle set. Pure functions; safe from any thread on disjoint data.
#pragma once

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

// One coordinate of the resampled particles: out[i] = in[ancestor[i]]. out: (ancestor.size(),), apart from in. The
// ancestors never fall from one to the next, and are < in.size() < 2^31.
void take_ancestors(std::span<const std::uint32_t> ancestor, std::span<const float> in, std::span<float> out);

}  // namespace huetrack::particle_filter
