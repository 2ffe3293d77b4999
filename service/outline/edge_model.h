// What a camera shows of a ball before what is behind it, sample by sample, and by what that changes with each unknown:
// residuals and slopes, weighed, and the sums of their products, which a step of Gauss and Newton is made of.
#pragma once

#include <Eigen/Core>
#include <array>

#include "outline/edge_samples.h"

namespace huetrack::outline {

// The unknowns of a fit. The first ones are told; the others are fitted beside them.
enum Unknown : int {
  cu_,  // of the centre from where the fit began, pixels
  cv_,
  size_,         // logarithm, over the ellipse that the fit began with
  blur_light_,   // logarithms of standard deviations in pixels
  blur_chroma_,  // what color has on top of it
  exposure_,     // seconds
  told_unknowns,
  shading_ = told_unknowns,
  paleness_ = shading_ + 9,
  lit_ = paleness_ + 3,  // of what is behind: over 1, and its slope over the rows per radius
  unknowns = lit_ + 2
};
using Unknowns = Eigen::Matrix<double, unknowns, 1>;
using Normal = Eigen::Matrix<double, unknowns, unknowns>;
inline constexpr int lights = lit_ - shading_;  // the light over the ball: shading and paleness
// What is fitted while the light over the ball and what the camera makes of edges are held as they are known: the
// place, the size, and how bright the ball and what is behind it are.
inline constexpr std::array<int, 6> held_unknowns{cu_, cv_, size_, shading_, lit_, lit_ + 1};
inline constexpr int held_count = static_cast<int>(held_unknowns.size());
inline constexpr int placed = 3;  // unknowns that come first in both, the place and the size
using HeldUnknowns = Eigen::Matrix<double, held_count, 1>;
using HeldNormal = Eigen::Matrix<double, held_count, held_count>;

// 1 / sqrt(x) between two bounds, to some 1e-4 of it: a polynomial of the third degree.
class InverseRoot {
 public:
  InverseRoot() = default;
  InverseRoot(double least, double most);  // 0 < least <= most
  [[gnu::always_inline]] float operator()(float x) const {
    const float t = x * per_half_ - middle_;
    return c0_ + t * (c1_ + t * (c2_ + t * c3_));
  }

 private:
  float per_half_ = 0, middle_ = 0, c0_ = 1, c1_ = 0, c2_ = 0, c3_ = 0;
};

// What is the same for all samples of one kind.
struct EdgeModel {
  float by_red, by_green, by_blue;               // of a pixel's R', G', B', what is seen
  float sigma;                                   // of a sample, grey values
  float blur2, more2, extra_u, extra_v, smear2;  // px^2: of light; more of it of color; of the sample; per (px/s)^2
  float cu, cv, m00, m01, m10, m11;
  InverseRoot per_slope, per_width, per_color_width;  // of what finish() says
  float vx, vy, exposure;
  int moments;
  float counts_glints;            // 1: of light
  std::array<float, 8> moment;    // in exposures
  float red, green, blue, level;  // the object: what its color adds to its grey
  float grey;
  std::array<float, 9> shading;
  std::array<float, 3> paleness;
  float lit, lit_v;

  // What follows from the rest.
  void finish();
};

// What a sample must be off by (squared, in standard deviations), and covered, to be judged by itself: outside of the
// outline it is another thing; inside it may show what is behind, or a glint.
inline constexpr float outside = 0.02f, strange_sigmas2 = 49, inside = 0.8f;
inline constexpr float within = 0.9f, glint_sigmas2 = 16;  // over what light on a dull ball makes of it
// Cauchy's loss, beyond two standard deviations, and what it makes of a square.
inline constexpr float loss2 = 4;
constexpr float robust(float squared) {
  return squared / (1 + squared / loss2);
}

// Sums over samples.
class EdgeSums {
 public:
  // Adds what these samples give: products of all slopes with one another, and with the residuals. Sets what the
  // samples have covered, and how far they are off.
  void assemble(const EdgeModel& model, EdgeSamples& samples);
  // Of the same samples in the same order, of which some may count no more: products of the residuals that a model near
  // that one leaves with the slopes as they were. Of all unknowns a third of the work.
  void renew_residuals(const EdgeModel& model, EdgeSamples& samples);
  void begin_assembling(bool is_light_held);
  void begin_renewing();

  void normal(Normal& out) const;      // of what was assembled
  void normal(HeldNormal& out) const;  // with the light held
  void gradient(Unknowns& out) const;  // with the light held, 0 for what is not fitted

  double residual2 = 0, trusted = 0;  // of residuals in variances, robustly, and of trust
  double edge_weight = 0;             // of the edge's length, of what trust and the robust loss leave
  double edge = 0, seen_edge = 0;     // of the edge's length, and of what is trusted of it
  double strange = 0;                 // samples that may be of something else, be hidden, or shine

  // In eight lanes.
  using Lanes = float __attribute__((vector_size(32), may_alias));
  static constexpr int columns = unknowns + 1, threes = columns / 3, pairs = threes * (threes + 1) / 2;
  static constexpr int held_threes = held_count / 3, held_pairs = held_threes * (held_threes + 1) / 2;
  static_assert(columns % 3 == 0 && held_count % 3 == 0);

 private:
  struct Chunk;
  // Of one block of samples.
  struct alignas(64) Slopes {
    // Times the root of its weight; the last column: the residual. With the light held the first ones are of
    // held_unknowns.
    float of[columns][EdgeSamples::block];
    float per_root[EdgeSamples::block];  // 1 / that root; 0: it did not count
    float edge[EdgeSamples::block];      // the length of it
  };
  static void assemble_still(const EdgeModel& model, EdgeSamples& samples, EdgeSums& out);
  static void assemble_smeared(const EdgeModel& model, EdgeSamples& samples, EdgeSums& out);
  static void assemble_still_held(const EdgeModel& model, EdgeSamples& samples, EdgeSums& out);
  static void assemble_smeared_held(const EdgeModel& model, EdgeSamples& samples, EdgeSums& out);
  static void renew_blocks(const EdgeModel& model, EdgeSamples& samples, EdgeSums& out);
  void begin();
  template <int size>
  void normal_of(Eigen::Matrix<double, size, size>& out) const;
  bool is_assembled_ = true, is_light_held_ = false;
  int blocks_ = 0;             // that were added
  Lanes of_threes_[pairs][9];  // of columns by threes
  Lanes of_residuals_[columns];
  Slopes slopes_[2 * EdgeSamples::most / EdgeSamples::block];
};

}  // namespace huetrack::outline
