#include "outline/normal_equations.h"

#include "particle_filter/vector_clones.h"

namespace huetrack::outline {
namespace {

// Row by row, each of so many columns that no loop has a rest. false: not positive definite.
template <int size, int width>
inline __attribute__((always_inline)) bool eliminate_rows(double (*__restrict rows)[width],
                                                          double (*__restrict factors)[width],
                                                          double* __restrict pivots) {
  constexpr int lanes = 8;
  for (int k = size - 1; k >= 0; --k) {
    const double pivot = rows[k][k];
    if (!(pivot > 0)) return false;
    pivots[k] = pivot;
    const double per = 1 / pivot;
    double* __restrict factor = factors[k];
    for (int c = 0; c < width; ++c) factor[c] = c < k ? rows[k][c] * per : 0;
    const int groups = (k + lanes - 1) / lanes;
    for (int i = 0; i < k; ++i) {
      const double of = rows[i][k];
      double* __restrict row = rows[i];
      for (int c = 0; c < lanes * groups; ++c) row[c] -= of * factor[c];
    }
  }
  return true;
}

HUETRACK_CLONES bool eliminate_all(double (*rows)[24], double (*factors)[24], double* pivots) {
  return eliminate_rows<unknowns, 24>(rows, factors, pivots);
}

}  // namespace

void NormalEquations::eliminate(const Normal& normal, const Normal& information) {
  static_assert(width == 24);
  alignas(64) double rows[unknowns][width];
  const double *from = normal.data(), *before = information.data();
  for (int r = 0; r < unknowns; ++r) {
    for (int c = 0; c < unknowns; ++c) rows[r][c] = from[r * unknowns + c] + before[r * unknowns + c];
    for (int c = unknowns; c < width; ++c) rows[r][c] = 0;
  }
  is_sound_ = eliminate_all(rows, factors_, pivots_);
  if (is_sound_) find_covariance();
}

void NormalEquations::solve(const Unknowns& right, Unknowns& out) const {
  alignas(64) double x[width] = {};
  for (int i = 0; i < unknowns; ++i) x[i] = right.data()[i];
  for (int k = unknowns - 1; k > 0; --k) {
    const double of = x[k];
    for (int c = 0; c < k; ++c) x[c] -= of * factors_[k][c];
  }
  for (int k = 0; k < unknowns; ++k) {
    double even = x[k] / pivots_[k], odd = 0;
    for (int c = 0; c + 1 < k; c += 2) even -= factors_[k][c] * x[c], odd -= factors_[k][c + 1] * x[c + 1];
    if (k % 2 == 1) even -= factors_[k][k - 1] * x[k - 1];
    x[k] = even + odd;
  }
  for (int i = 0; i < unknowns; ++i) out.data()[i] = x[i];
}

// What is left of the first equations is the inverse of theirs; so are their own factors and pivots.
void NormalEquations::find_covariance() {
  double* const to = covariance_.data();
  for (int column = 0; column < told_unknowns; ++column) {
    double x[told_unknowns] = {};
    x[column] = 1;
    for (int k = column; k > 0; --k)
      for (int c = 0; c < k; ++c) x[c] -= x[k] * factors_[k][c];
    for (int k = 0; k < told_unknowns; ++k) {
      x[k] /= pivots_[k];
      for (int c = 0; c < k; ++c) x[k] -= factors_[k][c] * x[c];
    }
    for (int i = 0; i < told_unknowns; ++i) to[column * told_unknowns + i] = x[i];
  }
}

}  // namespace huetrack::outline
