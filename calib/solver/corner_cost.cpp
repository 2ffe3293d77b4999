#include "calib/solver/corner_cost.h"

#include <ceres/sized_cost_function.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>

#include "calib/solver/adjustment_steps.h"

namespace huetrack::solver {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// The cost functions give their derivatives by the six tangent directions, in the first six columns; so the derivative
// of Plus is the identity there.
class PoseManifold final : public ceres::Manifold {
 public:
  PoseManifold(bool left, int more) : left_(left), more_(more) {}

  int AmbientSize() const override { return pose_block_size + more_; }
  int TangentSize() const override { return 6 + more_; }
  bool Plus(const double* x, const double* delta, double* result) const override {
    const calib::Rigid3d step = calib::exp(Eigen::Map<const calib::Tangent6d>(delta)), pose = read_pose(x);
    write_pose(left_ ? step * pose : pose * step, result);
    for (int i = 0; i < more_; ++i) result[pose_block_size + i] = x[pose_block_size + i] + delta[6 + i];
    return true;
  }
  bool PlusJacobian(const double*, double* jacobian) const override {
    return set_identity({jacobian, AmbientSize(), TangentSize()});
  }
  bool Minus(const double* y, const double* x, double* delta) const override {
    const calib::Rigid3d a = read_pose(y), b = read_pose(x);
    Eigen::Map<calib::Tangent6d>{delta} = calib::log(left_ ? a * calib::inverse(b) : calib::inverse(b) * a);
    for (int i = 0; i < more_; ++i) delta[6 + i] = y[pose_block_size + i] - x[pose_block_size + i];
    return true;
  }
  bool MinusJacobian(const double*, double* jacobian) const override {
    return set_identity({jacobian, TangentSize(), AmbientSize()});
  }

 private:
  using Matrix = Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>;
  bool set_identity(Matrix j) const {
    j.setZero();
    j.topLeftCorner<6, 6>().setIdentity();
    j.bottomRightCorner(more_, more_).setIdentity();
    return true;
  }
  bool left_;
  int more_;
};

using TwoRows = Eigen::Map<Eigen::Matrix<double, 2, Eigen::Dynamic, Eigen::RowMajor>>;

// What a board that rests and one that moves have in common.
void put_out(const CornerDerivatives& d, int board_size, double** jacobians) {
  if (jacobians[0]) Eigen::Map<PixelByLens>{jacobians[0]} = d.by_lens;
  for (const int b : {1, 2}) {
    if (!jacobians[b]) continue;
    TwoRows j(jacobians[b], 2, b == 1 ? pose_block_size : board_size);
    j.setZero();
    j.leftCols<6>() = b == 1 ? d.by_camera : d.by_board;
  }
  if (jacobians[3]) TwoRows(jacobians[3], 2, 3) = d.by_warp;
}

class CornerCost final : public ceres::SizedCostFunction<2, 12, pose_block_size, pose_block_size, 3> {
 public:
  CornerCost(LensModel lens, const BoardCorner& corner) : lens_(lens), corner_(corner) {}

  bool Evaluate(const double* const* blocks, double* residuals, double** jacobians) const override {
    const LensParameters parameters = Eigen::Map<const LensParameters>(blocks[0]);
    const calib::Rigid3d board = read_pose(blocks[2]);
    const BoardWarp warp(blocks[3][0], blocks[3][1], blocks[3][2]);
    Vector2d residual;
    CornerDerivatives d;
    if (!corner_residual(lens_, parameters, read_pose(blocks[1]), {board, warp}, corner_, residual,
                         jacobians ? &d : nullptr)) {
      return false;
    }
    Eigen::Map<Vector2d>{residuals} = residual;
    if (jacobians) put_out(d, pose_block_size, jacobians);
    return true;
  }

 private:
  LensModel lens_;
  BoardCorner corner_;
};

class MovingCornerCost final : public ceres::CostFunction {
 public:
  MovingCornerCost(LensModel lens, const BoardCorner& corner, double after_s, int view, int views)
      : lens_(lens), corner_(corner), after_s_(after_s), stamp_at_(stamps_at + view) {
    set_num_residuals(2);
    *mutable_parameter_block_sizes() = {12, pose_block_size, stamps_at + views, 3, 2};
  }

  bool Evaluate(const double* const* blocks, double* residuals, double** jacobians) const override {
    const LensParameters parameters = Eigen::Map<const LensParameters>(blocks[0]);
    const calib::Rigid3d pose = read_pose(blocks[2]);
    const BoardWarp warp(blocks[3][0], blocks[3][1], blocks[3][2]);
    BoardMotion motion;
    motion.course = Eigen::Map<const BoardMotion::Course>(blocks[2] + course_at);
    const double latency_s = blocks[4][0], readout_s = blocks[4][1];
    const double after_s = after_s_ + blocks[2][stamp_at_] - latency_s + corner_.below_middle * readout_s;
    Vector2d residual;
    CornerDerivatives d;
    if (!corner_residual(lens_, parameters, read_pose(blocks[1]), {pose, warp, &motion, after_s}, corner_, residual,
                         jacobians ? &d : nullptr)) {
      return false;
    }
    Eigen::Map<Vector2d>{residuals} = residual;
    if (!jacobians) return true;
    const int board_size = parameter_block_sizes()[2];
    put_out(d, board_size, jacobians);
    if (jacobians[2]) {
      TwoRows j(jacobians[2], 2, board_size);
      j.middleCols<12>(course_at) = d.by_course;
      j.col(stamp_at_) = d.by_time;
    }
    if (jacobians[4]) {
      TwoRows j(jacobians[4], 2, 2);
      j.col(0) = -d.by_time;
      j.col(1) = corner_.below_middle * d.by_time;
    }
    return true;
  }

 private:
  LensModel lens_;
  BoardCorner corner_;
  double after_s_;
  int stamp_at_;
};

class CourseCost final : public ceres::CostFunction {
 public:
  CourseCost(int block_size, const BoardMotion& motion, double noise_px) : expected_(motion.expected) {
    set_num_residuals(12);
    *mutable_parameter_block_sizes() = {block_size};
    for (std::size_t i = 0; i < whiten_.size(); ++i)
      whiten_[i] = noise_px * Eigen::Matrix2d(motion.information[i].llt().matrixU());
  }

  bool Evaluate(const double* const* blocks, double* residuals, double** jacobians) const override {
    const BoardMotion::Course off = Eigen::Map<const BoardMotion::Course>(blocks[0] + course_at) - expected_;
    const int size = parameter_block_sizes()[0];
    if (jacobians && jacobians[0]) std::fill_n(jacobians[0], 12 * size, 0.0);
    for (int i = 0; i < 6; ++i) {
      const Eigen::Matrix2d& whiten = whiten_[static_cast<std::size_t>(i)];
      Eigen::Map<Vector2d>{residuals + 2 * i} = whiten * off.row(i).transpose();
      if (!jacobians || !jacobians[0]) continue;
      TwoRows j(jacobians[0] + 2 * i * size, 2, size);
      j.col(course_at + i) = whiten.col(0);
      j.col(course_at + 6 + i) = whiten.col(1);
    }
    return true;
  }

 private:
  BoardMotion::Course expected_;
  std::array<Eigen::Matrix2d, 6> whiten_;
};

class PriorCost final : public ceres::CostFunction {
 public:
  PriorCost(int block_size, int from, std::vector<double> means, std::vector<double> weights)
      : from_(from), means_(std::move(means)), weights_(std::move(weights)) {
    set_num_residuals(static_cast<int>(means_.size()));
    *mutable_parameter_block_sizes() = {block_size};
  }

  bool Evaluate(const double* const* blocks, double* residuals, double** jacobians) const override {
    const int size = parameter_block_sizes()[0];
    if (jacobians && jacobians[0]) std::fill_n(jacobians[0], num_residuals() * size, 0.0);
    for (int i = 0; i < num_residuals(); ++i) {
      const double weight = weights_[static_cast<std::size_t>(i)];
      residuals[i] = weight * (blocks[0][from_ + i] - means_[static_cast<std::size_t>(i)]);
      if (jacobians && jacobians[0]) jacobians[0][i * size + from_ + i] = weight;
    }
    return true;
  }

 private:
  int from_;
  std::vector<double> means_, weights_;
};

class LensPriorCost final : public ceres::CostFunction {
 public:
  LensPriorCost(const LensPrior& prior, double noise_px)
      : mean_(prior.mean.head(prior.information.rows())),
        whiten_(noise_px * Eigen::MatrixXd(prior.information.llt().matrixU())) {
    set_num_residuals(static_cast<int>(mean_.size()));
    *mutable_parameter_block_sizes() = {12};
  }

  bool Evaluate(const double* const* blocks, double* residuals, double** jacobians) const override {
    const LensParameters lens = Eigen::Map<const LensParameters>(blocks[0]);
    Eigen::Map<Eigen::VectorXd>(residuals, mean_.size()) = whiten_ * (lens.head(mean_.size()) - mean_);
    if (!jacobians || !jacobians[0]) return true;
    Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, 12, Eigen::RowMajor>> j(jacobians[0], mean_.size(), 12);
    j.setZero();
    j.leftCols(mean_.size()) = whiten_;
    return true;
  }

 private:
  Eigen::VectorXd mean_;
  Eigen::MatrixXd whiten_;
};

// How a lens grows at stations out to its reach; and, of a rational one, that its denominator stays clear of zero,
// where it would hide a pole behind a zero of the numerator and fit noise with the ripple that the two leave.
class LensShapeCost final : public ceres::SizedCostFunction<16, 12> {
 public:
  LensShapeCost(LensModel lens, double reach, double weight) : lens_(lens), reach_(reach), weight_(weight) {}

  bool Evaluate(const double* const* blocks, double* residuals, double** jacobians) const override {
    const double* l = blocks[0];
    double* jacobian = jacobians ? jacobians[0] : nullptr;
    if (jacobian) std::fill_n(jacobian, 12 * num_residuals(), 0.0);
    const auto keep_above = [&](int row, double value, double least, const LensParameters& by_lens) {
      residuals[row] = value < least ? weight_ * (least - value) : 0;
      if (value < least && jacobian) Eigen::Map<LensParameters>{jacobian + 12 * row} = -weight_ * by_lens;
    };
    constexpr int stations = 8;
    constexpr double kept_slope = 0.08, kept_denominator = 1.5 * least_denominator;
    for (int i = 0; i < stations; ++i) {
      const double r = reach_ * (i + 1) / stations, s = r * r;
      LensParameters by_lens = LensParameters::Zero();
      const double slope = is_pinhole(lens_) ? pinhole_slope(l, s, by_lens) : polynomial_slope(l, s, by_lens);
      keep_above(i, slope, kept_slope, by_lens);
      LensParameters denominator_by_lens = LensParameters::Zero();
      denominator_by_lens.tail<3>() << s, s * s, s * s * s;
      const double denominator = 1 + s * (l[9] + s * (l[10] + s * l[11]));
      keep_above(stations + i, is_pinhole(lens_) ? denominator : 1, kept_denominator, denominator_by_lens);
    }
    return true;
  }

 private:
  // By how much the distorted radius grows, at the square s of the undistorted one (of the fisheye's angle).
  double polynomial_slope(const double* l, double s, LensParameters& by_lens) const {
    const std::array<int, 4> at = lens_ == LensModel::fisheye ? std::array{4, 5, 6, 7} : std::array{4, 5, 8, 9};
    double slope = 1, power = 1;
    for (std::size_t k = 0; k < at.size(); ++k) {
      power *= s;
      by_lens(at[k]) = (2.0 * static_cast<double>(k) + 3.0) * power;
      slope += by_lens(at[k]) * l[at[k]];
    }
    return slope;
  }

  static double pinhole_slope(const double* l, double s, LensParameters& by_lens) {
    const double n = 1.0 + s * (l[4] + s * (l[5] + s * l[8])), d = 1.0 + s * (l[9] + s * (l[10] + s * l[11]));
    const double dn = l[4] + s * (2.0 * l[5] + s * 3.0 * l[8]), dd = l[9] + s * (2.0 * l[10] + s * 3.0 * l[11]);
    const double top = n * d + 2.0 * s * (dn * d - n * dd), slope = top / (d * d);
    double power = s, by_s = 1;  // of a coefficient: in n (or d), and in dn (or dd)
    for (int k = 0; k < 3; ++k) {
      const int in_n = k < 2 ? 4 + k : 8, in_d = 9 + k;
      by_lens(in_n) = (power * d + 2.0 * s * (by_s * d - power * dd)) / (d * d);
      by_lens(in_d) = (n * power + 2.0 * s * (dn * power - n * by_s)) / (d * d) - 2.0 * slope * power / d;
      by_s = (k + 2) * power;
      power *= s;
    }
    return slope;
  }

  LensModel lens_;
  double reach_;
  double weight_;
};

}  // namespace

void write_pose(const calib::Rigid3d& pose, double* block) {
  Eigen::Map<Eigen::Vector4d>{block} = pose.rotation.coeffs();
  Eigen::Map<Vector3d>(block + 4) = pose.translation;
}

calib::Rigid3d read_pose(const double* block) {
  return {Eigen::Map<const Eigen::Quaterniond>(block), Eigen::Map<const Vector3d>(block + 4)};
}

std::unique_ptr<ceres::Manifold> pose_manifold(bool left, int more) {
  return std::make_unique<PoseManifold>(left, more);
}

std::unique_ptr<ceres::CostFunction> corner_cost(LensModel lens, const BoardCorner& corner) {
  return std::make_unique<CornerCost>(lens, corner);
}

std::unique_ptr<ceres::CostFunction> moving_corner_cost(LensModel lens, const BoardCorner& corner, double after_s,
                                                        int view, int views) {
  return std::make_unique<MovingCornerCost>(lens, corner, after_s, view, views);
}

std::unique_ptr<ceres::CostFunction> course_cost(int block_size, const BoardMotion& motion, double noise_px) {
  return std::make_unique<CourseCost>(block_size, motion, noise_px);
}

std::unique_ptr<ceres::CostFunction> prior_cost(int block_size, int from, std::vector<double> means,
                                                std::vector<double> weights) {
  return std::make_unique<PriorCost>(block_size, from, std::move(means), std::move(weights));
}

std::unique_ptr<ceres::CostFunction> lens_prior_cost(const LensPrior& prior, double noise_px) {
  return std::make_unique<LensPriorCost>(prior, noise_px);
}

std::unique_ptr<ceres::CostFunction> lens_shape_cost(LensModel lens, double reach, double weight) {
  return std::make_unique<LensShapeCost>(lens, reach, weight);
}

}  // namespace huetrack::solver
