#include "outline/normal_equations.h"

#include "particle_filter/vector_clones.h"

namespace huetrack::outline {
namespace {

constexpr int lanes = 8;  // layout
constexpr int columns_for(int size) {
  return (size + lanes - 1) / lanes * lanes;
}

// rows: lower triangle of a symmetric matrix, padded to whole vectors. Row k of the factors holds the multiples of
// equation k that are subtracted from those before it. false: not positive definite.
template <int size, int width>
inline __attribute__((always_inline)) bool eliminate_rows(double (*__restrict rows)[width],
                                                          double (*__restrict factors)[width],
                                                          double* __restrict pivots) {
  for (int k = size - 1; k >= 0; --k) {
    const double pivot = rows[k][k];
    if (!(pivot > 0)) return false;
    pivots[k] = pivot;
    const double per = 1 / pivot;
    double* __restrict factor = factors[k];
    for (int c = 0; c < width; ++c) factor[c] = c < k ? rows[k][c] * per : 0;
    for (int i = 0; i < k; ++i) {
      const double of = rows[k][i];
      double* __restrict row = rows[i];
      for (int from = 0; from <= i; from += lanes)
        for (int c = from; c < from + lanes; ++c) row[c] -= of * factor[c];
    }
  }
  return true;
}

// After elimination the first equations are the inverse of their block of the inverse: the block of k + 1 follows from
// that of k by the factors of equation k.
template <int width>
inline __attribute__((always_inline)) void invert_rows(int count, const double (*__restrict factors)[width],
                                                       const double* __restrict pivots,
                                                       double (*__restrict inverse)[width]) {
  for (int k = 0; k < count; ++k) {
    const double* __restrict factor = factors[k];
    double* __restrict row = inverse[k];
    for (int c = 0; c < width; ++c) row[c] = 0;
    for (int i = 0; i < k; ++i) {
      const double of = factor[i];
      const double* __restrict before = inverse[i];
      for (int from = 0; from < k; from += lanes)
        for (int c = from; c < from + lanes; ++c) row[c] -= of * before[c];
    }
    double rest = 1 / pivots[k];
    for (int i = 0; i < k; ++i) rest -= factor[i] * row[i];
    for (int i = 0; i < k; ++i) inverse[i][k] = row[i];
    row[k] = rest;
    for (int c = k + 1; c < width; ++c) row[c] = 0;
  }
}

HUETRACK_CLONES bool eliminate_all(double (*rows)[columns_for(unknowns)], double (*factors)[columns_for(unknowns)],
                                   double* pivots) {
  return eliminate_rows<unknowns, columns_for(unknowns)>(rows, factors, pivots);
}

HUETRACK_CLONES void invert_first(int count, const double (*factors)[columns_for(unknowns)], const double* pivots,
                                  double (*inverse)[columns_for(unknowns)]) {
  invert_rows<columns_for(unknowns)>(count, factors, pivots, inverse);
}

HUETRACK_CLONES bool invert_light(double (*rows)[columns_for(lights)], double (*inverse)[columns_for(lights)]) {
  alignas(64) double factors[lights][columns_for(lights)];
  double pivots[lights];
  if (!eliminate_rows<lights, columns_for(lights)>(rows, factors, pivots)) return false;
  invert_rows<columns_for(lights)>(lights, factors, pivots, inverse);
  return true;
}

// For few equations, choosing an instruction set would take longer.
template <int width>
bool eliminate_all(double (*rows)[width], double (*factors)[width], double* pivots) {
  return eliminate_rows<held_count, width>(rows, factors, pivots);
}

template <int width>
void invert_first(int count, const double (*factors)[width], const double* pivots, double (*inverse)[width]) {
  invert_rows<width>(count, factors, pivots, inverse);
}

}  // namespace

template <int size, int reported>
void NormalEquations<size, reported>::eliminate(const Matrix& normal, const Matrix& information) {
  static_assert(width == columns_for(size));
  alignas(64) double rows[size][width];
  const double *from = normal.data(), *before = information.data();
  for (int r = 0; r < size; ++r) {
    for (int c = 0; c < size; ++c) rows[r][c] = from[r * size + c] + before[r * size + c];
    for (int c = size; c < width; ++c) rows[r][c] = 0;
  }
  is_sound_ = eliminate_all(rows, factors_, pivots_);
  if (!is_sound_) return;
  alignas(64) double inverse[reported][width];
  invert_first(reported, factors_, pivots_, inverse);
  for (int i = 0; i < reported; ++i)
    for (int k = 0; k < reported; ++k) covariance_(i, k) = inverse[i][k];
}

template <int size, int reported>
LightMatrix NormalEquations<size, reported>::covariance_of_light() const requires(size == unknowns) {
  alignas(64) double inverse[lit_][width];
  invert_first(lit_, factors_, pivots_, inverse);
  LightMatrix out;
  for (int i = 0; i < lights; ++i)
    for (int k = 0; k < lights; ++k) out(i, k) = inverse[shading_ + i][shading_ + k];
  return out;
}

template <int size, int reported>
void NormalEquations<size, reported>::solve(const Vector& right, Vector& out) const {
  alignas(64) double x[width] = {};
  for (int i = 0; i < size; ++i) x[i] = right.data()[i];
  for (int k = size - 1; k > 0; --k) {
    const double of = x[k];
    for (int c = 0; c < k; ++c) x[c] -= of * factors_[k][c];
  }
  for (int k = 0; k < size; ++k) {
    double even = x[k] / pivots_[k], odd = 0;
    for (int c = 0; c + 1 < k; c += 2) even -= factors_[k][c] * x[c], odd -= factors_[k][c + 1] * x[c + 1];
    if (k % 2 == 1) even -= factors_[k][k - 1] * x[k - 1];
    x[k] = even + odd;
  }
  for (int i = 0; i < size; ++i) out.data()[i] = x[i];
}

template class NormalEquations<unknowns, reported_unknowns>;
template class NormalEquations<held_count, placed>;

std::optional<LightMatrix> inverse_of(const LightMatrix& matrix) {
  alignas(64) double rows[lights][columns_for(lights)], inverse[lights][columns_for(lights)];
  for (int i = 0; i < lights; ++i) {
    for (int k = 0; k < lights; ++k) rows[i][k] = matrix(i, k);
    for (int k = lights; k < columns_for(lights); ++k) rows[i][k] = 0;
  }
  if (!invert_light(rows, inverse)) return std::nullopt;
  LightMatrix out;
  for (int i = 0; i < lights; ++i)
    for (int k = 0; k < lights; ++k) out(i, k) = inverse[i][k];
  return out;
}

}  // namespace huetrack::outline
