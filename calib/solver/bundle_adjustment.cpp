#include "calib/solver/bundle_adjustment.h"

#include <ceres/ceres.h>
#include <glog/logging.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numeric>
#include <opencv2/calib3d.hpp>
#include <tuple>

namespace huetrack::solver {
namespace {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;

Matrix3d cross_matrix(const Vector3d& v) {
  return (Matrix3d() << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0).finished();
}

// A pose as Ceres keeps it: quaternion x y z w, then translation.
using PoseBlock = std::array<double, 7>;

PoseBlock block_of(const calib::Rigid3d& pose) {
  const auto& q = pose.rotation;
  const auto& t = pose.translation;
  return {q.x(), q.y(), q.z(), q.w(), t.x(), t.y(), t.z()};
}

calib::Rigid3d pose_of(const double* block) {
  return {Eigen::Map<const Eigen::Quaterniond>(block), Eigen::Map<const Vector3d>(block + 4)};
}

// The cost function gives its derivatives by the six tangent directions, in the first six columns; so the derivative of
// Plus is the identity there.
template <bool left>  // left: exp(delta) * pose; otherwise pose * exp(delta)
class PoseManifold final : public ceres::Manifold {
 public:
  int AmbientSize() const override { return 7; }
  int TangentSize() const override { return 6; }
  bool Plus(const double* x, const double* delta, double* result) const override {
    const calib::Rigid3d step = calib::exp(Eigen::Map<const calib::Tangent6d>(delta)), pose = pose_of(x);
    const PoseBlock moved = block_of(left ? step * pose : pose * step);
    std::ranges::copy(moved, result);
    return true;
  }
  bool PlusJacobian(const double*, double* jacobian) const override {
    Eigen::Map<Eigen::Matrix<double, 7, 6, Eigen::RowMajor>> j(jacobian);
    j.setZero();
    j.topRows<6>().setIdentity();
    return true;
  }
  bool Minus(const double* y, const double* x, double* delta) const override {
    const calib::Rigid3d a = pose_of(y), b = pose_of(x);
    Eigen::Map<calib::Tangent6d>{delta} = calib::log(left ? a * calib::inverse(b) : calib::inverse(b) * a);
    return true;
  }
  bool MinusJacobian(const double*, double* jacobian) const override {
    Eigen::Map<Eigen::Matrix<double, 6, 7, Eigen::RowMajor>> j(jacobian);
    j.setZero();
    j.leftCols<6>().setIdentity();
    return true;
  }
};

// z of the board's surface over (x, y), per metre of bend: 1 in the middle, 0 at the edges.
Eigen::RowVector2d bend_profile(const Vector3d& point, const Vector3d& low, const Vector3d& high) {
  Eigen::RowVector2d profile;
  for (int axis = 0; axis < 2; ++axis) {
    const double size = high[axis] - low[axis];
    const double t = size > 0 ? 2 * (point[axis] - low[axis]) / size - 1 : 0;
    profile[axis] = 1 - t * t;
  }
  return profile;
}

struct BoardShape {
  std::vector<Vector3d> points;
  std::vector<Eigen::RowVector2d> profile;
  explicit BoardShape(const board::Board& board) {
    for (int id = 0; id < board.point_count(); ++id) points.push_back(board.point(id));
    Vector3d low = points.front(), high = points.front();
    for (const Vector3d& p : points) {
      low = low.cwiseMin(p);
      high = high.cwiseMax(p);
    }
    for (const Vector3d& p : points) profile.push_back(bend_profile(p, low, high));
  }
};

using LensBlock = std::array<double, 12>;
using PoseJacobian = Eigen::Matrix<double, 2, 6, Eigen::RowMajor>;

struct CornerDerivatives {
  PixelByLens by_lens;
  PoseJacobian by_camera;  // left tangent of cam_from_world
  PoseJacobian by_board;   // right tangent of world_from_board
  Eigen::Matrix<double, 2, 2, Eigen::RowMajor> by_bend;
};

// Projected minus measured. false: behind the camera.
bool corner_residual(LensModel lens, const LensParameters& parameters, const calib::Rigid3d& cam_from_world,
                     const calib::Rigid3d& world_from_board, const Vector2d& bend, const Vector3d& flat_point,
                     const Eigen::RowVector2d& profile, const Vector2d& measured, Vector2d& residual,
                     CornerDerivatives* d) {
  const Vector3d point = flat_point + Vector3d(0, 0, profile.dot(bend));
  const Vector3d p_cam = cam_from_world * (world_from_board * point);
  PixelByPoint by_point;
  Vector2d px;
  if (!project(lens, parameters, p_cam, px, d ? &by_point : nullptr, d ? &d->by_lens : nullptr)) return false;
  residual = px - measured;
  if (d) {
    d->by_camera.leftCols<3>() = -by_point * cross_matrix(p_cam);
    d->by_camera.rightCols<3>() = by_point;
    const PixelByPoint by_board_point =
        by_point * (cam_from_world.rotation * world_from_board.rotation).toRotationMatrix();
    d->by_board.leftCols<3>() = -by_board_point * cross_matrix(point);
    d->by_board.rightCols<3>() = by_board_point;
    d->by_bend = by_board_point.col(2) * profile;
  }
  return true;
}

class CornerCost final : public ceres::SizedCostFunction<2, 12, 7, 7, 2> {
 public:
  CornerCost(LensModel lens, const Vector3d& point, const Eigen::RowVector2d& profile, const Vector2d& measured)
      : lens_(lens), point_(point), profile_(profile), measured_(measured) {}

  bool Evaluate(const double* const* blocks, double* residuals, double** jacobians) const override {
    const Eigen::Map<const LensParameters> parameters(blocks[0]);
    const Eigen::Map<const Vector2d> bend(blocks[3]);
    Vector2d residual;
    CornerDerivatives d;
    if (!corner_residual(lens_, parameters, pose_of(blocks[1]), pose_of(blocks[2]), bend, point_, profile_, measured_,
                         residual, jacobians ? &d : nullptr)) {
      return false;
    }
    Eigen::Map<Vector2d>{residuals} = residual;
    if (!jacobians) return true;
    if (jacobians[0]) Eigen::Map<PixelByLens>{jacobians[0]} = d.by_lens;
    for (const int b : {1, 2}) {
      if (!jacobians[b]) continue;
      Eigen::Map<Eigen::Matrix<double, 2, 7, Eigen::RowMajor>> j(jacobians[b]);
      j.leftCols<6>() = b == 1 ? d.by_camera : d.by_board;
      j.col(6).setZero();
    }
    if (jacobians[3]) Eigen::Map<Eigen::Matrix<double, 2, 2, Eigen::RowMajor>>{jacobians[3]} = d.by_bend;
    return true;
  }

 private:
  LensModel lens_;
  Vector3d point_;
  Eigen::RowVector2d profile_;
  Vector2d measured_;
};

// See AdjustedCamera::unfold. Costs nothing where the slope is healthy.
class LensShapeCost {
 public:
  LensShapeCost(LensModel lens, double reach, double weight) : lens_(lens), reach_(reach), weight_(weight) {}

  template <typename T>
  bool operator()(const T* l, T* residuals) const {
    for (int i = 0; i < stations; ++i) {
      const double r = reach_ * (i + 1) / stations, s = r * r;
      T slope;
      if (lens_ == LensModel::fisheye) {
        slope = 1.0 + s * (3.0 * l[4] + s * (5.0 * l[5] + s * (7.0 * l[6] + s * 9.0 * l[7])));
      } else {
        const T n = 1.0 + s * (l[4] + s * (l[5] + s * l[8])), d = 1.0 + s * (l[9] + s * (l[10] + s * l[11]));
        const T dn = l[4] + s * (2.0 * l[5] + s * 3.0 * l[8]), dd = l[9] + s * (2.0 * l[10] + s * 3.0 * l[11]);
        slope = (n * d + 2.0 * s * (dn * d - n * dd)) / (d * d);
      }
      constexpr double least = 0.08;
      residuals[i] = slope < least ? weight_ * (least - slope) : T(0.0);
    }
    return true;
  }

  static constexpr int stations = 8;

 private:
  LensModel lens_;
  double reach_;  // pinhole: radius on the plane z = 1; fisheye: angle
  double weight_;
};

// How far a lens has to reach for its image's corners; a bit further than it does, when it folds before.
double reach_of(const AdjustedCamera& camera) {
  const calib::CameraModel model = camera.model();
  double reach = 0;
  const double right = camera.image_size.width - 1, bottom = camera.image_size.height - 1;
  for (const calib::RawPixel& corner : {calib::RawPixel{{0, 0}}, calib::RawPixel{{right, 0}},
                                        calib::RawPixel{{0, bottom}}, calib::RawPixel{{right, bottom}}}) {
    const auto ray = model.ray(corner);
    const bool pinhole = camera.lens != LensModel::fisheye;
    if (ray && (!pinhole || ray->z() > 0.05)) {
      const double rho = ray->head<2>().norm();
      reach = std::max(reach, pinhole ? rho / ray->z() : std::atan2(rho, ray->z()));
    } else {
      reach = std::max(reach, 1.15 * (pinhole ? std::sqrt(std::min(model.limit(), 400.0)) : model.limit()));
    }
  }
  return reach;
}

// Ceres tells of every step that it has to take back; the outcome is looked at here anyway. Once for all: adjustments
// may run on several threads.
void silence_ceres() {
  static const bool done = [] {
    FLAGS_minloglevel = google::GLOG_FATAL;
    return true;
  }();
  static_cast<void>(done);
}

double median(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

std::size_t index(int i) {
  return static_cast<std::size_t>(i);
}

void solve(Adjustment& a, const BoardShape& shape, double robust_px, int max_iterations) {
  // Ceres orders parameter blocks by their addresses, and the order decides the last digits: so all of the cameras' lie
  // in one piece of memory, and all of the boards' in another.
  struct CameraBlocks {
    LensBlock lens;
    PoseBlock pose;
  };
  std::vector<CameraBlocks> cameras(a.cameras.size() + 1);
  std::vector<PoseBlock> boards(a.world_from_board.size());
  double* const bend = cameras.back().lens.data();
  std::copy_n(a.bend.data(), 2, bend);
  for (std::size_t c = 0; c < a.cameras.size(); ++c) {
    std::copy_n(a.cameras[c].parameters.data(), 12, cameras[c].lens.begin());
    cameras[c].pose = block_of(a.cameras[c].cam_from_world);
  }
  for (std::size_t s = 0; s < boards.size(); ++s) boards[s] = block_of(a.world_from_board[s]);

  ceres::Problem problem;
  std::vector<bool> camera_used(a.cameras.size()), board_used(boards.size());
  // One loss for all: it has no state.
  ceres::LossFunction* loss = robust_px > 0 ? new ceres::CauchyLoss(robust_px) : nullptr;
  for (std::size_t v = 0; v < a.views.size(); ++v) {
    const BoardView& view = a.views[v];
    const std::size_t c = index(view.camera), s = index(view.set);
    for (std::size_t k = 0; k < view.ids.size(); ++k) {
      if (!a.fits[v].used[k]) continue;
      const std::size_t id = index(view.ids[k]);
      problem.AddResidualBlock(new CornerCost(a.cameras[c].lens, shape.points[id], shape.profile[id], view.px[k]), loss,
                               cameras[c].lens.data(), cameras[c].pose.data(), boards[s].data(), bend);
      camera_used[c] = board_used[s] = true;
    }
  }
  if (problem.NumResidualBlocks() == 0) throw CalibrationError("no view of the board is left to calibrate with");

  auto* ordering = new ceres::ParameterBlockOrdering;
  auto* camera_manifold = new PoseManifold<true>;
  auto* board_manifold = new PoseManifold<false>;
  for (std::size_t s = 0; s < boards.size(); ++s) {
    if (!board_used[s]) continue;
    problem.SetManifold(boards[s].data(), board_manifold);
    ordering->AddElementToGroup(boards[s].data(), 0);
  }
  for (std::size_t c = 0; c < a.cameras.size(); ++c) {
    if (!camera_used[c]) continue;
    const AdjustedCamera& camera = a.cameras[c];
    if (camera.lens_is_free) {
      std::vector<int> fixed;
      for (int i = parameter_count(camera.lens); i < 12; ++i) fixed.push_back(i);
      if (!fixed.empty()) problem.SetManifold(cameras[c].lens.data(), new ceres::SubsetManifold(12, fixed));
      if (camera.unfold > 0) {
        problem.AddResidualBlock(new ceres::AutoDiffCostFunction<LensShapeCost, LensShapeCost::stations, 12>(
                                     new LensShapeCost(camera.lens, reach_of(camera), camera.unfold)),
                                 nullptr, cameras[c].lens.data());
      }
    } else {
      problem.SetParameterBlockConstant(cameras[c].lens.data());
    }
    problem.SetManifold(cameras[c].pose.data(), camera_manifold);
    if (!camera.pose_is_free) problem.SetParameterBlockConstant(cameras[c].pose.data());
    ordering->AddElementToGroup(cameras[c].lens.data(), 1);
    ordering->AddElementToGroup(cameras[c].pose.data(), 1);
  }
  if (!a.bend_is_free) problem.SetParameterBlockConstant(bend);
  ordering->AddElementToGroup(bend, 1);

  ceres::Solver::Options options;
  options.num_threads = 1;  // the order of a sum decides its last digits
  options.linear_solver_type = ceres::DENSE_SCHUR;
  options.linear_solver_ordering.reset(ordering);
  options.max_num_iterations = max_iterations;
  options.function_tolerance = 1e-10;
  options.gradient_tolerance = 1e-12;
  options.parameter_tolerance = 1e-10;
  options.logging_type = ceres::SILENT;
  silence_ceres();
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  if (!summary.IsSolutionUsable()) throw CalibrationError("the adjustment does not converge: " + summary.message);

  for (std::size_t c = 0; c < a.cameras.size(); ++c) {
    std::copy_n(cameras[c].lens.begin(), 12, a.cameras[c].parameters.data());
    calib::Rigid3d pose = pose_of(cameras[c].pose.data());
    pose.rotation.normalize();
    a.cameras[c].cam_from_world = pose;
  }
  for (std::size_t s = 0; s < boards.size(); ++s) {
    calib::Rigid3d pose = pose_of(boards[s].data());
    pose.rotation.normalize();
    a.world_from_board[s] = pose;
  }
  a.bend = {bend[0], bend[1]};
}

// Renews the residuals, for all corners, used or not.
void measure(Adjustment& a, const BoardShape& shape) {
  for (std::size_t v = 0; v < a.views.size(); ++v) {
    const BoardView& view = a.views[v];
    const AdjustedCamera& camera = a.cameras[index(view.camera)];
    ViewFit& fit = a.fits[v];
    double sum = 0;
    for (std::size_t k = 0; k < view.ids.size(); ++k) {
      Vector2d residual;
      const std::size_t id = index(view.ids[k]);
      if (!corner_residual(camera.lens, camera.parameters, camera.cam_from_world, a.world_from_board[index(view.set)],
                           a.bend, shape.points[id], shape.profile[id], view.px[k], residual, nullptr)) {
        residual = Vector2d::Constant(-1e6);  // behind the camera
      }
      fit.residuals[k] = -residual;
      sum += residual.squaredNorm();
    }
    fit.rms_px = std::sqrt(sum / static_cast<double>(std::max<std::size_t>(1, view.ids.size())));
  }
}

std::string pixels(double px) {
  std::array<char, 32> text;
  std::snprintf(text.data(), text.size(), px < 10 ? "%.2f px" : "%.0f px", px);
  return text.data();
}

// Decides anew which corners are used; views that hardly fit are dropped for good. True: something changed.
bool classify(Adjustment& a, const AdjustmentOptions& options) {
  std::vector<double> components;
  for (const ViewFit& fit : a.fits) {
    if (!fit.dropped.empty()) continue;
    for (const Vector2d& r : fit.residuals) {
      components.push_back(std::abs(r.x()));
      components.push_back(std::abs(r.y()));
    }
  }
  const double sigma = 1.4826 * median(components);
  const double limit = std::max(options.outlier_sigmas * sigma, options.least_outlier_px);
  bool changed = false;
  for (std::size_t v = 0; v < a.views.size(); ++v) {
    ViewFit& fit = a.fits[v];
    if (!fit.dropped.empty()) continue;
    std::vector<bool> used;
    for (const Vector2d& r : fit.residuals) used.push_back(r.norm() < limit);
    const auto good = static_cast<std::size_t>(std::ranges::count(used, true));
    if (10 * good < 6 * used.size() || good < 4) {
      std::vector<double> lengths;
      for (const Vector2d& r : fit.residuals) lengths.push_back(r.norm());
      fit.dropped =
          "its corners are off by " + pixels(median(lengths)) + ", those of the other views by " + pixels(sigma * 1.18);
      used.assign(used.size(), false);
    }
    changed = changed || used != fit.used;
    fit.used = used;
  }
  return changed;
}

// Pixels of today's cameras are square. A lens by itself that comes out otherwise tells how wrong it is, in a way that
// its residuals cannot (few views, a board that is not flat, a rolling shutter): it is widened until square pixels are
// one standard deviation away. free: which parameters the rows of the covariance are.
void widen_where_pixels_are_not_square(const Adjustment& a, const std::vector<int>& free, MatrixXd& covariance) {
  // In a joint adjustment it is not known what else such a lens has bent.
  if (a.cameras.size() != 1 || !a.cameras.front().lens_is_free || free.size() < 2 || free[0] != 0 || free[1] != 1)
    return;
  const double fx = a.cameras.front().parameters(0), fy = a.cameras.front().parameters(1);
  const double off = std::abs(fx / fy - 1);
  const double sigma = std::sqrt(
      std::max(0.0, covariance(0, 0) / (fx * fx) + covariance(1, 1) / (fy * fy) - 2 * covariance(0, 1) / (fx * fy)));
  constexpr double least = 0.01;  // some cameras' are a little off in truth
  if (off < least || off < sigma || sigma <= 0) return;
  covariance *= off / sigma * off / sigma;
}

// What every free camera parameter is known to, from the normal equations with the board poses eliminated.
void find_covariance(Adjustment& a, const BoardShape& shape) {
  int size = 0;
  std::vector<int> free, held;  // parameters that were adjusted; and those that were not, though they are not exact
  a.lens_offset.assign(a.cameras.size(), -1);
  a.pose_offset.assign(a.cameras.size(), -1);
  for (std::size_t c = 0; c < a.cameras.size(); ++c) {
    if (a.views_used(static_cast<int>(c)) == 0) continue;
    if (a.cameras[c].lens_is_free || a.cameras[c].lens_covariance.size() > 0) {
      a.lens_offset[c] = size;
      const int count = parameter_count(a.cameras[c].lens);
      for (int i = 0; i < count; ++i) (a.cameras[c].lens_is_free ? free : held).push_back(size + i);
      size += count;
    }
    if (a.cameras[c].pose_is_free) {
      a.pose_offset[c] = size;
      for (int i = 0; i < 6; ++i) free.push_back(size + i);
      size += 6;
    }
  }
  const int camera_size = size;
  const int bend_offset = a.bend_is_free ? size : -1;
  for (int i = 0; i < (a.bend_is_free ? 2 : 0); ++i) free.push_back(size++);

  MatrixXd information = MatrixXd::Zero(size, size);
  struct OfSet {
    MatrixXd information;  // board pose eliminated
    VectorXd gradient;
  };
  std::vector<OfSet> of_sets;
  double cost = 0;
  int sets = 0;
  for (std::size_t v = 0; v < a.views.size();) {
    const int set = a.views[v].set;
    MatrixXd cc = MatrixXd::Zero(size, size), cb = MatrixXd::Zero(size, 6);
    Eigen::Matrix<double, 6, 6> bb = Eigen::Matrix<double, 6, 6>::Zero();
    VectorXd gc = VectorXd::Zero(size);
    calib::Tangent6d gb = calib::Tangent6d::Zero();
    bool any = false;
    for (; v < a.views.size() && a.views[v].set == set; ++v) {
      const BoardView& view = a.views[v];
      const std::size_t c = index(view.camera);
      const AdjustedCamera& camera = a.cameras[c];
      const int lens_size = a.lens_offset[c] >= 0 ? parameter_count(camera.lens) : 0;  // held ones too
      const int pose_size = a.pose_offset[c] >= 0 ? 6 : 0;
      const int bend_size = bend_offset >= 0 ? 2 : 0;
      const int local = lens_size + pose_size + bend_size;
      std::vector<int> at;  // where the local parameters are in the global ones
      for (int i = 0; i < lens_size; ++i) at.push_back(a.lens_offset[c] + i);
      for (int i = 0; i < pose_size; ++i) at.push_back(a.pose_offset[c] + i);
      for (int i = 0; i < bend_size; ++i) at.push_back(bend_offset + i);
      MatrixXd jtj = MatrixXd::Zero(local, local), jtb = MatrixXd::Zero(local, 6), j(2, local);
      VectorXd jtr = VectorXd::Zero(local);
      for (std::size_t k = 0; k < view.ids.size(); ++k) {
        if (!a.fits[v].used[k]) continue;
        const std::size_t id = index(view.ids[k]);
        Vector2d r;
        CornerDerivatives d;
        if (!corner_residual(camera.lens, camera.parameters, camera.cam_from_world, a.world_from_board[index(set)],
                             a.bend, shape.points[id], shape.profile[id], view.px[k], r, &d)) {
          continue;
        }
        any = true;
        if (lens_size > 0) j.leftCols(lens_size) = d.by_lens.leftCols(lens_size);
        if (pose_size > 0) j.middleCols(lens_size, 6) = d.by_camera;
        if (bend_size > 0) j.rightCols(2) = d.by_bend;
        jtj.noalias() += j.transpose() * j;
        jtb.noalias() += j.transpose() * d.by_board;
        jtr.noalias() += j.transpose() * r;
        bb += d.by_board.transpose() * d.by_board;
        gb += d.by_board.transpose() * r;
        cost += r.squaredNorm();
      }
      for (int i = 0; i < local; ++i) {
        for (int k = 0; k < local; ++k) cc(at[index(i)], at[index(k)]) += jtj(i, k);
        cb.row(at[index(i)]) += jtb.row(i);
        gc(at[index(i)]) += jtr(i);
      }
    }
    if (!any) continue;
    ++sets;
    const Eigen::LDLT<Eigen::Matrix<double, 6, 6>> solver(bb);
    of_sets.push_back({cc - cb * solver.solve(cb.transpose()), gc - cb * solver.solve(gb)});
    information += of_sets.back().information;
  }
  const int freedom = 2 * a.corners_used - static_cast<int>(free.size()) - 6 * sets;
  a.noise_px = std::sqrt(cost / std::max(1, freedom));
  MatrixXd covariance = MatrixXd::Zero(size, size);
  if (!free.empty()) {
    const MatrixXd own = information(free, free);
    // Scaled to a unit diagonal: focal lengths and radians differ by many powers of ten.
    const VectorXd scale = own.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
    const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(scale.asDiagonal() * own * scale.asDiagonal());
    // Directions without information get a huge variance rather than a wrong one.
    const VectorXd inverse_values = eigen.eigenvalues().cwiseMax(1e-13).cwiseInverse();
    const MatrixXd inverse_own = scale.asDiagonal() * eigen.eigenvectors() * inverse_values.asDiagonal() *
                                 eigen.eigenvectors().transpose() * scale.asDiagonal();
    MatrixXd of_free = a.noise_px * a.noise_px * inverse_own;
    // The same by leaving out one set after another and looking how far that moves the parameters (jackknife): larger
    // where the corners of one moment err together, as with blur, a bent board or cameras out of step. It widens the
    // bounds but never narrows them: few sets tell little.
    if (sets > 2) {
      VectorXd spread = VectorXd::Zero(own.rows());
      for (const OfSet& set : of_sets) {
        const MatrixXd others = scale.asDiagonal() * (own - MatrixXd(set.information(free, free))) * scale.asDiagonal();
        const VectorXd gradient = scale.asDiagonal() * VectorXd(set.gradient(free));
        const VectorXd move =
            scale.asDiagonal() * (others + 1e-12 * MatrixXd::Identity(own.rows(), own.cols())).ldlt().solve(gradient);
        spread += move.cwiseAbs2() * (sets - 1) / sets;
      }
      const VectorXd widen = (spread.array() / of_free.diagonal().array()).cwiseMax(1).sqrt();
      of_free = widen.asDiagonal() * of_free * widen.asDiagonal();
    }
    widen_where_pixels_are_not_square(a, free, of_free);
    covariance(free, free) = of_free;
    if (!held.empty()) {  // an error of what was held moves what was adjusted
      MatrixXd of_held = MatrixXd::Zero(size, size);
      for (std::size_t c = 0; c < a.cameras.size(); ++c) {
        const MatrixXd& known = a.cameras[c].lens_covariance;
        if (a.lens_offset[c] < 0 || a.cameras[c].lens_is_free) continue;
        of_held.block(a.lens_offset[c], a.lens_offset[c], known.rows(), known.cols()) = known;
      }
      const MatrixXd moved = -inverse_own * information(free, held);
      const MatrixXd held_only = of_held(held, held);
      covariance(free, free) += moved * held_only * moved.transpose();
      covariance(free, held) = moved * held_only;
      covariance(held, free) = held_only * moved.transpose();
      covariance(held, held) = held_only;
    }
  }
  a.covariance = covariance.topLeftCorner(camera_size, camera_size);
}

}  // namespace

Vector3d Adjustment::board_point(int id) const {
  const BoardShape shape(board);
  return shape.points[index(id)] + Vector3d(0, 0, shape.profile[index(id)].dot(bend));
}

Vector3d Adjustment::centre_sigma(int camera) const {
  const int at = pose_offset.empty() ? -1 : pose_offset[index(camera)];
  // Turned about its centre a camera stays: only the translation of the left tangent moves it.
  return at < 0 ? Vector3d(Vector3d::Zero()) : Vector3d(covariance.diagonal().segment<3>(at + 3).cwiseSqrt());
}

Vector3d Adjustment::rotation_sigma(int camera) const {
  const int at = pose_offset.empty() ? -1 : pose_offset[index(camera)];
  return at < 0 ? Vector3d(Vector3d::Zero()) : Vector3d(covariance.diagonal().segment<3>(at).cwiseSqrt());
}

LensParameters Adjustment::lens_sigma(int camera) const {
  LensParameters sigma = LensParameters::Zero();
  const int at = lens_offset.empty() ? -1 : lens_offset[index(camera)];
  if (at < 0) return sigma;
  const int count = parameter_count(cameras[index(camera)].lens);
  sigma.head(count) = covariance.diagonal().segment(at, count).cwiseSqrt();
  return sigma;
}

double Adjustment::rms_of_camera(int camera) const {
  double sum = 0;
  int count = 0;
  for (std::size_t v = 0; v < views.size(); ++v) {
    if (views[v].camera != camera) continue;
    for (std::size_t k = 0; k < fits[v].used.size(); ++k) {
      if (!fits[v].used[k]) continue;
      sum += fits[v].residuals[k].squaredNorm();
      ++count;
    }
  }
  return count > 0 ? std::sqrt(sum / count) : 0;
}

int Adjustment::views_used(int camera) const {
  int count = 0;
  for (std::size_t v = 0; v < views.size(); ++v) {
    if (views[v].camera == camera && fits[v].dropped.empty()) ++count;
  }
  return count;
}

Adjustment adjust(Adjustment a, const AdjustmentOptions& options) {
  std::ranges::sort(a.views, {}, [](const BoardView& v) { return std::tie(v.set, v.camera, v.image); });
  const BoardShape shape(a.board);
  a.fits.clear();
  for (const BoardView& view : a.views) {
    a.fits.push_back({std::vector<Vector2d>(view.ids.size()), std::vector<bool>(view.ids.size(), true), 0, {}});
  }
  if (options.find_outliers) {
    // First with a loss that outliers hardly pull, then plainly, on what is left.
    measure(a, shape);
    std::vector<double> lengths;
    for (const ViewFit& fit : a.fits) {
      for (const Vector2d& r : fit.residuals) lengths.push_back(r.norm());
    }
    solve(a, shape, std::clamp(median(lengths), 0.3, 10.0), options.max_iterations);
    measure(a, shape);
    solve(a, shape, 0.5, options.max_iterations);
    measure(a, shape);
    classify(a, options);
  }
  constexpr int max_rounds = 8;
  for (int round = 0; round < max_rounds; ++round) {
    solve(a, shape, 0, options.max_iterations);
    measure(a, shape);
    if (!options.find_outliers || !classify(a, options)) break;
  }
  double sum = 0;
  a.corners_used = 0;
  for (const ViewFit& fit : a.fits) {
    for (std::size_t k = 0; k < fit.used.size(); ++k) {
      if (!fit.used[k]) continue;
      sum += fit.residuals[k].squaredNorm();
      ++a.corners_used;
    }
  }
  a.rms_px = std::sqrt(sum / std::max(1, a.corners_used));
  if (options.with_covariance) find_covariance(a, shape);
  return a;
}

std::vector<BoardView> inliers(const Adjustment& adjustment) {
  std::vector<BoardView> views;
  for (std::size_t v = 0; v < adjustment.views.size(); ++v) {
    if (!adjustment.fits[v].dropped.empty()) continue;
    BoardView view = adjustment.views[v];
    view.ids.clear();
    view.px.clear();
    for (std::size_t k = 0; k < adjustment.views[v].ids.size(); ++k) {
      if (!adjustment.fits[v].used[k]) continue;
      view.ids.push_back(adjustment.views[v].ids[k]);
      view.px.push_back(adjustment.views[v].px[k]);
    }
    views.push_back(std::move(view));
  }
  return views;
}

std::vector<ViewFit> evaluate(const Adjustment& state) {
  Adjustment a = state;
  a.fits.clear();
  for (const BoardView& view : a.views) {
    a.fits.push_back({std::vector<Vector2d>(view.ids.size()), std::vector<bool>(view.ids.size(), true), 0, {}});
  }
  measure(a, BoardShape(a.board));
  return std::move(a.fits);
}

std::vector<BoardPose> board_poses(const board::Board& board, const BoardView& view, LensModel lens,
                                   const LensParameters& parameters) {
  const calib::CameraModel model = camera_model(lens, parameters);
  std::vector<cv::Point3d> points;
  std::vector<cv::Point2d> normalised;
  std::vector<std::size_t> used;
  for (std::size_t k = 0; k < view.ids.size(); ++k) {
    const auto ray = model.ray({view.px[k]});
    if (!ray || ray->z() < 0.1) continue;  // beyond 84 degrees off the axis the plane z = 1 is too far away
    const Vector3d p = board.point(view.ids[k]);
    points.emplace_back(p.x(), p.y(), 0);
    normalised.emplace_back(ray->x() / ray->z(), ray->y() / ray->z());
    used.push_back(k);
  }
  std::vector<BoardPose> poses;
  if (points.size() < 4) return poses;
  std::vector<cv::Mat> rotations, translations;
  try {
    cv::solvePnPGeneric(points, normalised, cv::Matx33d::eye(), cv::noArray(), rotations, translations, false,
                        cv::SOLVEPNP_IPPE);
  } catch (const cv::Exception&) {  // corners in a line
    return poses;
  }
  for (std::size_t s = 0; s < rotations.size(); ++s) {
    const Vector3d w(rotations[s].at<double>(0), rotations[s].at<double>(1), rotations[s].at<double>(2));
    BoardPose pose;
    pose.cam_from_board.rotation = calib::exp((calib::Tangent6d() << w, Vector3d::Zero()).finished()).rotation;
    pose.cam_from_board.translation = {translations[s].at<double>(0), translations[s].at<double>(1),
                                       translations[s].at<double>(2)};
    // A few steps to the least reprojection error.
    calib::Tangent6d step;
    for (int iteration = 0; iteration < 10; ++iteration) {
      Eigen::Matrix<double, 6, 6> h = Eigen::Matrix<double, 6, 6>::Identity() * 1e-9;
      calib::Tangent6d g = calib::Tangent6d::Zero();
      double sum = 0;
      for (const std::size_t k : used) {
        Vector2d r;
        CornerDerivatives d;
        if (!corner_residual(lens, parameters, {}, pose.cam_from_board, Vector2d::Zero(), board.point(view.ids[k]),
                             Eigen::RowVector2d::Zero(), view.px[k], r, &d)) {
          sum += 1e12;
          continue;
        }
        h += d.by_board.transpose() * d.by_board;
        g += d.by_board.transpose() * r;
        sum += r.squaredNorm();
      }
      pose.rms_px = std::sqrt(sum / static_cast<double>(used.size()));
      if (iteration == 9) break;
      step = -h.ldlt().solve(g);
      if (!step.allFinite() || step.norm() > 1) break;
      pose.cam_from_board = pose.cam_from_board * calib::exp(step);
    }
    if (pose.cam_from_board.translation.z() > 0 && std::isfinite(pose.rms_px)) poses.push_back(pose);
  }
  std::ranges::sort(poses, {}, &BoardPose::rms_px);
  return poses;
}

}  // namespace huetrack::solver
