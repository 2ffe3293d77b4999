#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "calib/model/index.h"
#include "calib/solver/adjustment_steps.h"

namespace huetrack::solver {
namespace {

using calib::index;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::VectorXd;

// Cameras have square pixels. A single lens with fx != fy shows a systematic error (few views, bent board, rolling
// shutter): its covariance is widened until square pixels are one standard deviation away. free: parameters of the
// rows.
void widen_where_pixels_are_not_square(const Adjustment& a, const std::vector<int>& free, MatrixXd& covariance) {
  // In a joint adjustment, poses may have absorbed it.
  if (a.cameras.size() != 1 || !a.cameras.front().lens_is_free || free.size() < 2 || free[0] != 0 || free[1] != 1)
    return;
  const double fx = a.cameras.front().parameters(0), fy = a.cameras.front().parameters(1);
  const double off = std::abs(fx / fy - 1);
  const double sigma = std::sqrt(
      std::max(0.0, covariance(0, 0) / (fx * fx) + covariance(1, 1) / (fy * fy) - 2 * covariance(0, 1) / (fx * fy)));
  constexpr double least = 0.01;  // relative; true deviation of some cameras
  if (off < least || off < sigma || sigma <= 0) return;
  covariance *= off / sigma * off / sigma;
}

// Layout of the covariance.
struct ParameterLayout {
  int size = 0;         // of all
  int camera_size = 0;  // of the cameras, first
  int warp_offset = -1;
  std::vector<int> free, held;  // estimated; held but not exact
};

// Sets lens_offset, pose_offset and time_offset, too.
ParameterLayout lay_out(Adjustment& a) {
  ParameterLayout layout;
  a.lens_offset.assign(a.cameras.size(), -1);
  a.pose_offset.assign(a.cameras.size(), -1);
  a.time_offset.assign(a.cameras.size(), -1);
  for (std::size_t c = 0; c < a.cameras.size(); ++c) {
    if (a.views_used(static_cast<int>(c)) == 0) continue;
    if (a.cameras[c].lens_is_free || a.cameras[c].lens_covariance.size() > 0) {
      a.lens_offset[c] = layout.size;
      const int count = parameter_count(a.cameras[c].lens);
      for (int i = 0; i < count; ++i)
        (a.cameras[c].lens_is_free ? layout.free : layout.held).push_back(layout.size + i);
      layout.size += count;
    }
    if (a.cameras[c].pose_is_free) {
      a.pose_offset[c] = layout.size;
      for (int i = 0; i < 6; ++i) layout.free.push_back(layout.size + i);
      layout.size += 6;
    }
  }
  for (std::size_t c = 0; c < a.cameras.size() && !a.motions.empty(); ++c) {
    if (a.views_used(static_cast<int>(c)) == 0) continue;
    a.time_offset[c] = layout.size;
    for (const AdjustedTime* time : {&a.cameras[c].latency, &a.cameras[c].readout}) {
      if (time->prior_sigma_s > 0) layout.free.push_back(layout.size);
      ++layout.size;
    }
  }
  layout.camera_size = layout.size;
  if (a.warp_is_free) {
    layout.warp_offset = layout.size;
    for (int i = 0; i < 3; ++i) layout.free.push_back(layout.size++);
  }
  return layout;
}

// view_in_set: index of a view in its set.
void add_view(const Adjustment& a, std::size_t v, int view_in_set, const BoardShape& shape,
              const ParameterLayout& layout, SetEquations& set) {
  const BoardView& view = a.views[v];
  const std::size_t c = index(view.camera);
  const AdjustedCamera& camera = a.cameras[c];
  const bool moves = a.moves(view.set), is_laid_out = layout.size > 0;
  const int lens_size = is_laid_out && a.lens_offset[c] >= 0 ? parameter_count(camera.lens) : 0;  // held ones, too
  const int pose_size = is_laid_out && a.pose_offset[c] >= 0 ? 6 : 0;
  const int time_size = is_laid_out && moves && a.time_offset[c] >= 0 ? 2 : 0;
  const int warp_size = layout.warp_offset >= 0 ? 3 : 0;
  const int local = lens_size + pose_size + time_size + warp_size, own = static_cast<int>(set.by_own.rows());
  std::vector<int> at;  // local to global index
  for (int i = 0; i < lens_size; ++i) at.push_back(a.lens_offset[c] + i);
  for (int i = 0; i < pose_size; ++i) at.push_back(a.pose_offset[c] + i);
  for (int i = 0; i < time_size; ++i) at.push_back(a.time_offset[c] + i);
  for (int i = 0; i < warp_size; ++i) at.push_back(layout.warp_offset + i);
  MatrixXd jtj = MatrixXd::Zero(local, local), jtb = MatrixXd::Zero(local, own), j(2, local),
           j_own = MatrixXd::Zero(2, own);
  VectorXd jtr = VectorXd::Zero(local);
  for (std::size_t k = 0; k < view.ids.size(); ++k) {
    if (!a.fits[v].used[k]) continue;
    Vector2d r;
    CornerDerivatives d;
    if (!corner_residual(a, shape, v, k, r, &d)) continue;
    set.residuals += 2;
    const double weight = 1 / camera.relative_noise;  // equal noise for all
    if (lens_size > 0) j.leftCols(lens_size) = d.by_lens.leftCols(lens_size);
    if (pose_size > 0) j.middleCols(lens_size, 6) = d.by_camera;
    if (time_size > 0) {
      j.col(lens_size + pose_size) = -d.by_time;
      j.col(lens_size + pose_size + 1) = corner_of(a, shape, v, k).below_middle * d.by_time;
    }
    if (warp_size > 0) j.rightCols(3) = d.by_warp;
    j_own.leftCols<6>() = d.by_board;
    if (moves) {
      j_own.middleCols<12>(own_course_at) = d.by_course;
      j_own.col(own_stamps_at + view_in_set) = d.by_time;
    }
    j *= weight;
    j_own *= weight;
    r *= weight;
    jtj.noalias() += j.transpose() * j;
    jtb.noalias() += j.transpose() * j_own;
    jtr.noalias() += j.transpose() * r;
    set.by_own.noalias() += j_own.transpose() * j_own;
    set.own_gradient.noalias() += j_own.transpose() * r;
    set.cost += r.squaredNorm();
  }
  for (int i = 0; i < local; ++i) {
    for (int k = 0; k < local; ++k) set.by_parameters(at[index(i)], at[index(k)]) += jtj(i, k);
    set.mixed.row(at[index(i)]) += jtb.row(i);
    set.gradient(at[index(i)]) += jtr(i);
  }
}

SetEquations set_equations(const Adjustment& a, const BoardShape& shape, const ParameterLayout& layout,
                           std::size_t first, std::size_t last) {
  const int number = a.views[first].set, views = static_cast<int>(last - first);
  SetEquations set(layout.size, a.moves(number) ? own_stamps_at + views : own_course_at);
  for (std::size_t v = first; v < last; ++v) add_view(a, v, static_cast<int>(v - first), shape, layout, set);
  if (!a.moves(number) || set.residuals == 0) return set;
  // Priors, in pixels.
  const BoardMotion& motion = a.motions[index(number)];
  const auto add_prior = [&](const std::vector<int>& at, const MatrixXd& j, const VectorXd& off,
                             const MatrixXd& information) {
    const MatrixXd weight = a.noise_px * a.noise_px * information, weighted = j.transpose() * weight;
    set.by_own(at, at) += MatrixXd(weighted * j);
    set.own_gradient(at) += VectorXd(weighted * off);
    set.cost += off.dot(weight * off);
    set.residuals += static_cast<int>(off.size());
  };
  const BoardMotion::Course off = motion.course - motion.expected;
  for (int i = 0; i < 6; ++i) {
    add_prior({own_course_at + i, own_course_at + 6 + i}, Eigen::Matrix2d::Identity(), off.row(i).transpose(),
              motion.information[index(i)]);
  }
  for (std::size_t v = first; v < last; ++v) {
    const double sigma_s = a.cameras[index(a.views[v].camera)].stamp_sigma_s;
    add_prior({own_stamps_at + static_cast<int>(v - first)}, MatrixXd::Identity(1, 1),
              VectorXd::Constant(1, a.stamp_error_s[v]), MatrixXd::Constant(1, 1, 1 / (sigma_s * sigma_s)));
  }
  return set;
}

// Normal equations of all views, with the sets' own parameters eliminated.
struct NormalEquations {
  struct OfSet {
    int set = 0;
    MatrixXd information;
    VectorXd gradient;
  };
  std::vector<OfSet> of_sets;
  MatrixXd information;  // of all
  double cost = 0;       // sum of squares
  int residuals = 0, own = 0;
};

NormalEquations normal_equations(const Adjustment& a, const BoardShape& shape, const ParameterLayout& layout) {
  NormalEquations equations;
  equations.information = MatrixXd::Zero(layout.size, layout.size);
  for (std::size_t v = 0; v < a.views.size();) {
    const std::size_t first = v;
    while (v < a.views.size() && a.views[v].set == a.views[first].set) ++v;
    const SetEquations set = set_equations(a, shape, layout, first, v);
    equations.cost += set.cost;
    if (set.residuals == 0) continue;
    equations.residuals += set.residuals;
    equations.own += static_cast<int>(set.by_own.rows());
    const Eigen::LDLT<MatrixXd> solver(set.by_own);
    const MatrixXd own_by_parameters = solver.solve(MatrixXd(set.mixed.transpose()));
    const VectorXd own = solver.solve(set.own_gradient);
    equations.of_sets.push_back(
        {a.views[first].set, set.by_parameters - set.mixed * own_by_parameters, set.gradient - set.mixed * own});
    equations.information += equations.of_sets.back().information;
  }
  for (std::size_t c = 0; c < a.cameras.size(); ++c) {
    if (a.lens_offset[c] < 0 || !a.cameras[c].lens_is_free) continue;
    const LensPrior prior = lens_prior(a.cameras[c]);
    const Eigen::Index at = a.lens_offset[c], count = prior.information.rows();
    const MatrixXd weight = a.noise_px * a.noise_px * prior.information;
    const VectorXd off = (a.cameras[c].parameters - prior.mean).head(count);
    equations.information.block(at, at, count, count) += weight;
    equations.cost += off.dot(weight * off);
    equations.residuals += static_cast<int>(count);
  }
  for (std::size_t c = 0; c < a.cameras.size(); ++c) {
    if (a.time_offset[c] < 0) continue;
    int at = a.time_offset[c];
    for (const AdjustedTime* time : {&a.cameras[c].latency, &a.cameras[c].readout}) {
      if (time->prior_sigma_s > 0) {
        const double weight = a.noise_px / time->prior_sigma_s, off = time->value_s - time->prior_s;
        equations.information(at, at) += weight * weight;
        equations.cost += weight * weight * off * off;
        ++equations.residuals;
      }
      ++at;
    }
  }
  return equations;
}

// Unobservable directions get a huge variance. scale: see find_covariance().
MatrixXd inverse_of(const MatrixXd& information, const VectorXd& scale) {
  const MatrixXd scaled = scale.asDiagonal() * information * scale.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(scaled);
  const VectorXd inverse_values = eigen.eigenvalues().cwiseMax(1e-13).cwiseInverse();
  return scale.asDiagonal() * eigen.eigenvectors() * inverse_values.asDiagonal() * eigen.eigenvectors().transpose() *
         scale.asDiagonal();
}

// Sets of a moving board that are close in time share its motion prior: their errors are correlated, and they count as
// one piece.
std::vector<NormalEquations::OfSet> pieces_of(const Adjustment& a, const NormalEquations& equations) {
  constexpr int most_sets = 4;  // splits long runs without a gap
  std::vector<NormalEquations::OfSet> pieces;
  const BoardMotion* before = nullptr;
  int sets = 0;  // in the last piece
  for (const NormalEquations::OfSet& of_set : equations.of_sets) {
    const BoardMotion* motion = a.moves(of_set.set) ? &a.motions[index(of_set.set)] : nullptr;
    const bool goes_on = before && motion && std::abs(motion->at_s - before->at_s) < longest_gap_s;
    before = motion;
    if (!goes_on || sets == most_sets) {
      pieces.push_back(of_set);
      sets = 1;
      continue;
    }
    pieces.back().information += of_set.information;
    pieces.back().gradient += of_set.gradient;
    ++sets;
  }
  return pieces;
}

// Jackknife over pieces: one column each; the sum of squares of a row is the parameter's variance.
MatrixXd jackknife_moves(const std::vector<NormalEquations::OfSet>& pieces, const MatrixXd& information,
                         const VectorXd& scale, const std::vector<int>& free) {
  const auto count = static_cast<double>(pieces.size());
  MatrixXd moves(information.rows(), static_cast<Eigen::Index>(pieces.size()));
  for (std::size_t k = 0; k < pieces.size(); ++k) {
    MatrixXd others =
        scale.asDiagonal() * (information - MatrixXd(pieces[k].information(free, free))) * scale.asDiagonal();
    others.diagonal().array() += 1e-12;
    const VectorXd gradient = scale.asDiagonal() * VectorXd(pieces[k].gradient(free));
    moves.col(static_cast<Eigen::Index>(k)) =
        std::sqrt((count - 1) / count) * scale.asDiagonal() * VectorXd(others.ldlt().solve(gradient));
  }
  return moves;
}

// Errors that are correlated within a moment (blur, bent board, stamps, synchronisation) make the scatter between
// pieces larger than the noise predicts. Widens bounds, never narrows them.
MatrixXd widened(const MatrixXd& covariance, const MatrixXd& moves) {
  const VectorXd widen = (moves.rowwise().squaredNorm().array() / covariance.diagonal().array()).cwiseMax(1).sqrt();
  return widen.asDiagonal() * covariance * widen.asDiagonal();
}

// Adds the effect of held but inexact parameters to the covariance of the free ones.
void add_held(const Adjustment& a, const ParameterLayout& layout, const MatrixXd& information,
              const MatrixXd& inverse_of_free, MatrixXd& covariance) {
  const auto &free = layout.free, &held = layout.held;
  MatrixXd of_held = MatrixXd::Zero(layout.size, layout.size);
  for (std::size_t c = 0; c < a.cameras.size(); ++c) {
    const MatrixXd& known = a.cameras[c].lens_covariance;
    if (a.lens_offset[c] < 0 || a.cameras[c].lens_is_free) continue;
    of_held.block(a.lens_offset[c], a.lens_offset[c], known.rows(), known.cols()) = known;
  }
  const MatrixXd moved = -inverse_of_free * information(free, held);
  const MatrixXd held_only = of_held(held, held);
  covariance(free, free) += moved * held_only * moved.transpose();
  covariance(free, held) = moved * held_only;
  covariance(held, free) = held_only * moved.transpose();
  covariance(held, held) = held_only;
}

}  // namespace

SetEquations own_equations(const Adjustment& a, const BoardShape& shape, std::size_t first, std::size_t last) {
  return set_equations(a, shape, {}, first, last);
}

void find_covariance(Adjustment& a, const BoardShape& shape) {
  const ParameterLayout layout = lay_out(a);
  const auto& free = layout.free;
  const NormalEquations equations = normal_equations(a, shape, layout);
  const int freedom = equations.residuals - static_cast<int>(free.size()) - equations.own;
  a.noise_px = std::sqrt(equations.cost / std::max(1, freedom));
  MatrixXd covariance = MatrixXd::Zero(layout.size, layout.size);
  if (!free.empty()) {
    const MatrixXd information = equations.information(free, free);
    // Scaled to a unit diagonal: focal lengths and radians differ by many powers of ten.
    const VectorXd scale = information.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
    const MatrixXd inverse = inverse_of(information, scale);
    MatrixXd of_free = a.noise_px * a.noise_px * inverse;
    if (const auto pieces = pieces_of(a, equations); pieces.size() > 2)
      of_free = widened(of_free, jackknife_moves(pieces, information, scale, free));
    widen_where_pixels_are_not_square(a, free, of_free);
    covariance(free, free) = of_free;
    if (!layout.held.empty()) add_held(a, layout, equations.information, inverse, covariance);
  }
  a.warp_sigma.setZero();
  if (layout.warp_offset >= 0) a.warp_sigma = covariance.diagonal().segment<3>(layout.warp_offset).cwiseSqrt();
  a.covariance = covariance.topLeftCorner(layout.camera_size, layout.camera_size);
  set_time_sigmas(a);
}

void set_time_sigmas(Adjustment& a) {
  for (std::size_t c = 0; c < a.cameras.size(); ++c) {
    if (a.time_offset[c] < 0) continue;
    const auto sigma = a.covariance.diagonal().segment<2>(a.time_offset[c]).cwiseSqrt();
    a.cameras[c].latency.sigma_s = sigma(0);
    a.cameras[c].readout.sigma_s = sigma(1);
  }
}

Eigen::VectorXd parameter_difference(const Adjustment& one, const Adjustment& other) {
  VectorXd d = VectorXd::Zero(one.covariance.rows());
  for (std::size_t c = 0; c < one.cameras.size(); ++c) {
    const AdjustedCamera &a = one.cameras[c], &b = other.cameras[c];
    const int count = parameter_count(a.lens);
    if (one.lens_offset[c] >= 0) d.segment(one.lens_offset[c], count) = (a.parameters - b.parameters).head(count);
    if (one.pose_offset[c] >= 0)
      d.segment<6>(one.pose_offset[c]) = calib::log(a.cam_from_world * calib::inverse(b.cam_from_world));
  }
  return d;
}

}  // namespace huetrack::solver
