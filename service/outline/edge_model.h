// Model of a ball's edge in front of its background: per sample the predicted value and its derivatives by the
// unknowns, weighted, and the sums of their products from which a Gauss-Newton step follows. See design.md.
#pragma once

#include <Eigen/Core>
#include <array>

#include "outline/edge_samples.h"

namespace huetrack::outline {

// The unknowns of a fit. The first ones are reported; the others are nuisances.
enum Unknown : int {
  cu_,  // centre relative to the start, pixels
  cv_,
  size_,         // log of the scale over the start's ellipse
  blur_light_,   // log of the edge's standard deviation, pixels
  blur_chroma_,  // log of what colour adds to it
  exposure_,     // seconds
  reported_unknowns,
  shading_ = reported_unknowns,
  paleness_ = shading_ + 9,
  lit_ = paleness_ + 3,  // the background's gain less 1, and its slope over the rows, per radius
  unknowns = lit_ + 2
};
using Unknowns = Eigen::Matrix<double, unknowns, 1>;
using Normal = Eigen::Matrix<double, unknowns, unknowns>;
inline constexpr int lights = lit_ - shading_;  // shading and paleness
// Fitted while shading, blur and exposure are held: place, size, brightness of the ball, gain of the background.
inline constexpr std::array<int, 6> held_unknowns{cu_, cv_, size_, shading_, lit_, lit_ + 1};
inline constexpr int held_count = static_cast<int>(held_unknowns.size());
inline constexpr int placed = 3;  // layout: unknowns that come first in both: place and size
using HeldUnknowns = Eigen::Matrix<double, held_count, 1>;
using HeldNormal = Eigen::Matrix<double, held_count, held_count>;

// 1 / sqrt(x) between two bounds as a cubic, relative error some 1e-4.
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

// Parameters common to all samples of one kind, light or chroma.
struct EdgeModel {
  float by_red, by_green, by_blue;  // measured value per R', G', B'
  float sigma;                      // of a sample, grey values
  // px^2: variance of the edge in light; what colour adds; of the sample's own extent; and per (px/s)^2 and s^2.
  float blur2, more2, extra_u, extra_v, smear2;
  float curve = 0;  // 1/px, half the outline's curvature: its soft edge lies further in by this times its variance
  float cu, cv, m00, m01, m10, m11;                   // centre; disc_from_px
  InverseRoot per_slope, per_width, per_color_width;  // set by finish()
  float vx, vy, exposure;                             // px/s, s
  int moments;
  float counts_glints;            // 1: of light
  std::array<float, 8> moment;    // of the exposure, -0.5..0.5
  float red, green, blue, level;  // the object's colour: less its grey; and its largest
  float grey;
  std::array<float, 9> shading;
  std::array<float, 3> paleness;
  float lit, lit_v;

  // Sets what follows from the rest.
  void finish();
};

// When a single sample is an outlier, and the robust loss of all.
struct OutlierTuning {
  float outside = 0.02f;     // covered share up to which a sample shows the background only
  float inside = 0.8f;       // covered share from which the background seen there means an occluder
  float well_inside = 0.9f;  // covered share from which a bright sample is a glint
  float other_sigmas2 = 49;  // squared residual of another thing: 7 sigma
  float glint_sigmas2 = 16;  // squared residual of a glint: 4 sigma
  float loss2 = 4;           // Cauchy's loss, scale 2 sigma: 95 % efficiency is at 2.4
};
inline constexpr OutlierTuning outlier{};

// A squared residual after the robust loss.
constexpr float robust(float squared) {
  return squared / (1 + squared / outlier.loss2);
}

// Sums over samples.
class EdgeSums {
 public:
  // Adds these samples: products of all derivatives with one another and with the residuals. Sets the samples'
  // `covered` and `off`.
  void assemble(const EdgeModel& model, EdgeSamples& samples);
  // The same samples in the same order, some perhaps without trust now: products of the new residuals with the old
  // derivatives, for a model near the assembled one. A third of the work.
  void renew_residuals(const EdgeModel& model, EdgeSamples& samples);
  void begin_assembling(bool is_light_held);
  void begin_renewing();

  void normal(Normal& out) const;      // as assembled
  void normal(HeldNormal& out) const;  // with the light held
  void gradient(Unknowns& out) const;  // with the light held: 0 for what is not fitted

  double residual2 = 0, trusted = 0;  // sum of robust squared residuals in variances, and of trust
  double edge_weight = 0;             // edge length after trust and robust weights
  double edge = 0, seen_edge = 0;     // edge length, and the trusted part of it
  double outlier_candidates = 0;      // samples that may be another thing, an occluder or a glint

  using Lanes = float __attribute__((vector_size(32), may_alias));
  static constexpr int columns = unknowns + 1, threes = columns / 3, pairs = threes * (threes + 1) / 2;  // layout
  static constexpr int held_threes = held_count / 3, held_pairs = held_threes * (held_threes + 1) / 2;   // layout
  static_assert(columns % 3 == 0 && held_count % 3 == 0);

 private:
  struct Chunk;
  // Derivatives of one block of samples.
  struct alignas(64) Slopes {
    // Times the root of the weight; the last column is the residual. With the light held, of held_unknowns.
    float of[columns][EdgeSamples::block];
    float per_root[EdgeSamples::block];  // 1 / that root; 0: no weight
    float edge[EdgeSamples::block];      // edge length
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
  int blocks_ = 0;             // added so far
  Lanes of_threes_[pairs][9];  // products of three columns with three
  Lanes of_residuals_[columns];
  Slopes slopes_[2 * EdgeSamples::most / EdgeSamples::block];
};

}  // namespace huetrack::outline
