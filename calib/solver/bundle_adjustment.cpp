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

#include "calib/model/cross_matrix.h"
#include "calib/model/index.h"
#include "calib/model/median.h"

namespace huetrack::solver {
namespace {

using calib::cross_matrix;
using calib::index;
using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;

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

// What Ceres moves. It orders parameter blocks by their addresses, and the order decides the last digits: so all of the
// cameras' lie in one piece of memory, and all of the boards' in another.
class ParameterBlocks {
 public:
  explicit ParameterBlocks(const Adjustment& a) : cameras_(a.cameras.size() + 1), boards_(a.world_from_board.size()) {
    std::copy_n(a.bend.data(), 2, bend());
    for (std::size_t c = 0; c < a.cameras.size(); ++c) {
      std::copy_n(a.cameras[c].parameters.data(), 12, cameras_[c].lens.begin());
      cameras_[c].pose = block_of(a.cameras[c].cam_from_world);
    }
    for (std::size_t s = 0; s < boards_.size(); ++s) boards_[s] = block_of(a.world_from_board[s]);
  }

  double* lens(std::size_t camera) { return cameras_[camera].lens.data(); }
  double* pose(std::size_t camera) { return cameras_[camera].pose.data(); }
  double* board(std::size_t set) { return boards_[set].data(); }
  double* bend() { return cameras_.back().lens.data(); }

  void put_into(Adjustment& a) {
    const auto normalized = [](const double* block) {
      calib::Rigid3d pose = pose_of(block);
      pose.rotation.normalize();
      return pose;
    };
    for (std::size_t c = 0; c < a.cameras.size(); ++c) {
      std::copy_n(lens(c), 12, a.cameras[c].parameters.data());
      a.cameras[c].cam_from_world = normalized(pose(c));
    }
    for (std::size_t s = 0; s < boards_.size(); ++s) a.world_from_board[s] = normalized(board(s));
    a.bend = {bend()[0], bend()[1]};
  }

 private:
  struct CameraBlocks {
    LensBlock lens;
    PoseBlock pose;
  };
  std::vector<CameraBlocks> cameras_;  // the last one's lens block holds the bend
  std::vector<PoseBlock> boards_;
};

// Which cameras and sets some corner speaks for.
struct UsedBlocks {
  std::vector<bool> cameras, boards;
};

// One residual per used corner. robust_px: see solve().
UsedBlocks add_corners(ceres::Problem& problem, const Adjustment& a, const BoardShape& shape, ParameterBlocks& blocks,
                       double robust_px) {
  UsedBlocks used{std::vector<bool>(a.cameras.size()), std::vector<bool>(a.world_from_board.size())};
  // One loss for all: it has no state.
  ceres::LossFunction* loss = robust_px > 0 ? new ceres::CauchyLoss(robust_px) : nullptr;
  for (std::size_t v = 0; v < a.views.size(); ++v) {
    const BoardView& view = a.views[v];
    const std::size_t c = index(view.camera), s = index(view.set);
    for (std::size_t k = 0; k < view.ids.size(); ++k) {
      if (!a.fits[v].used[k]) continue;
      const std::size_t id = index(view.ids[k]);
      problem.AddResidualBlock(new CornerCost(a.cameras[c].lens, shape.points[id], shape.profile[id], view.px[k]), loss,
                               blocks.lens(c), blocks.pose(c), blocks.board(s), blocks.bend());
      used.cameras[c] = used.boards[s] = true;
    }
  }
  return used;
}

// Which of a lens's parameters may move, and that it may not fold where that is asked for.
void free_lens(ceres::Problem& problem, const AdjustedCamera& camera, double* lens) {
  if (!camera.lens_is_free) {
    problem.SetParameterBlockConstant(lens);
    return;
  }
  std::vector<int> fixed;
  for (int i = parameter_count(camera.lens); i < 12; ++i) fixed.push_back(i);
  if (!fixed.empty()) problem.SetManifold(lens, new ceres::SubsetManifold(12, fixed));
  if (camera.unfold > 0) {
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<LensShapeCost, LensShapeCost::stations, 12>(
                                 new LensShapeCost(camera.lens, reach_of(camera), camera.unfold)),
                             nullptr, lens);
  }
}

// One least-squares solution for the used corners, from where `a` is. robust_px: of Cauchy's loss; 0: plain squares.
void solve(Adjustment& a, const BoardShape& shape, double robust_px, int max_iterations) {
  ParameterBlocks blocks(a);
  ceres::Problem problem;
  const UsedBlocks used = add_corners(problem, a, shape, blocks, robust_px);
  if (problem.NumResidualBlocks() == 0) throw CalibrationError("no view of the board is left to calibrate with");

  auto* ordering = new ceres::ParameterBlockOrdering;  // the boards' poses are eliminated first
  auto* camera_manifold = new PoseManifold<true>;
  auto* board_manifold = new PoseManifold<false>;
  for (std::size_t s = 0; s < used.boards.size(); ++s) {
    if (!used.boards[s]) continue;
    problem.SetManifold(blocks.board(s), board_manifold);
    ordering->AddElementToGroup(blocks.board(s), 0);
  }
  for (std::size_t c = 0; c < a.cameras.size(); ++c) {
    if (!used.cameras[c]) continue;
    free_lens(problem, a.cameras[c], blocks.lens(c));
    problem.SetManifold(blocks.pose(c), camera_manifold);
    if (!a.cameras[c].pose_is_free) problem.SetParameterBlockConstant(blocks.pose(c));
    ordering->AddElementToGroup(blocks.lens(c), 1);
    ordering->AddElementToGroup(blocks.pose(c), 1);
  }
  if (!a.bend_is_free) problem.SetParameterBlockConstant(blocks.bend());
  ordering->AddElementToGroup(blocks.bend(), 1);

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
  blocks.put_into(a);
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

// Half of the components of normal residuals are smaller than 0.6745 standard deviations, half of the lengths of two
// such components are smaller than 1.1774.
constexpr double sigma_of_median_component = 1.4826, median_length_of_sigma = 1.18;

// Of a view with fewer good corners than these nothing is used: it shows something else, or at another moment.
constexpr std::size_t least_good_tenths = 6, least_good_corners = 4;

// Decides anew which corners are used; views that hardly fit are dropped for good. True: something changed.
bool classify(Adjustment& a, const AdjustmentOptions& options) {
  std::vector<double> components;
  for (const ViewFit& fit : a.fits) {
    if (fit.dropped) continue;
    for (const Vector2d& r : fit.residuals) {
      components.push_back(std::abs(r.x()));
      components.push_back(std::abs(r.y()));
    }
  }
  const double sigma = sigma_of_median_component * calib::median(components);
  const double limit = std::max(options.outlier_sigmas * sigma, options.least_outlier_px);
  bool changed = false;
  for (std::size_t v = 0; v < a.views.size(); ++v) {
    ViewFit& fit = a.fits[v];
    if (fit.dropped) continue;
    std::vector<bool> used;
    for (const Vector2d& r : fit.residuals) used.push_back(r.norm() < limit);
    const auto good = static_cast<std::size_t>(std::ranges::count(used, true));
    if (10 * good < least_good_tenths * used.size() || good < least_good_corners) {
      std::vector<double> lengths;
      for (const Vector2d& r : fit.residuals) lengths.push_back(r.norm());
      fit.dropped = ViewMisfit{calib::median(lengths), sigma * median_length_of_sigma};
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

// Where the parameters are in the covariance.
struct ParameterLayout {
  int size = 0;         // of all
  int camera_size = 0;  // of the cameras', which come first
  int bend_offset = -1;
  std::vector<int> free, held;  // parameters that were adjusted; and those that were not, though they are not exact
};

// Sets lens_offset and pose_offset, too.
ParameterLayout lay_out(Adjustment& a) {
  ParameterLayout layout;
  a.lens_offset.assign(a.cameras.size(), -1);
  a.pose_offset.assign(a.cameras.size(), -1);
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
  layout.camera_size = layout.size;
  if (a.bend_is_free) {
    layout.bend_offset = layout.size;
    for (int i = 0; i < 2; ++i) layout.free.push_back(layout.size++);
  }
  return layout;
}

// The normal equations of the views of one set: by the parameters that are laid out, and by its board's pose.
struct SetEquations {
  MatrixXd by_parameters, mixed;
  Eigen::Matrix<double, 6, 6> by_board = Eigen::Matrix<double, 6, 6>::Zero();
  VectorXd gradient;
  calib::Tangent6d board_gradient = calib::Tangent6d::Zero();
  bool is_empty = true;

  explicit SetEquations(int size)
      : by_parameters(MatrixXd::Zero(size, size)), mixed(MatrixXd::Zero(size, 6)), gradient(VectorXd::Zero(size)) {}
};

// cost: the squares of its residuals are added.
void add_view(const Adjustment& a, std::size_t v, const BoardShape& shape, const ParameterLayout& layout,
              SetEquations& set, double& cost) {
  const BoardView& view = a.views[v];
  const std::size_t c = index(view.camera);
  const AdjustedCamera& camera = a.cameras[c];
  const int lens_size = a.lens_offset[c] >= 0 ? parameter_count(camera.lens) : 0;  // held ones too
  const int pose_size = a.pose_offset[c] >= 0 ? 6 : 0;
  const int bend_size = layout.bend_offset >= 0 ? 2 : 0;
  const int local = lens_size + pose_size + bend_size;
  std::vector<int> at;  // where the local parameters are in the global ones
  for (int i = 0; i < lens_size; ++i) at.push_back(a.lens_offset[c] + i);
  for (int i = 0; i < pose_size; ++i) at.push_back(a.pose_offset[c] + i);
  for (int i = 0; i < bend_size; ++i) at.push_back(layout.bend_offset + i);
  MatrixXd jtj = MatrixXd::Zero(local, local), jtb = MatrixXd::Zero(local, 6), j(2, local);
  VectorXd jtr = VectorXd::Zero(local);
  for (std::size_t k = 0; k < view.ids.size(); ++k) {
    if (!a.fits[v].used[k]) continue;
    const std::size_t id = index(view.ids[k]);
    Vector2d r;
    CornerDerivatives d;
    if (!corner_residual(camera.lens, camera.parameters, camera.cam_from_world, a.world_from_board[index(view.set)],
                         a.bend, shape.points[id], shape.profile[id], view.px[k], r, &d)) {
      continue;
    }
    set.is_empty = false;
    if (lens_size > 0) j.leftCols(lens_size) = d.by_lens.leftCols(lens_size);
    if (pose_size > 0) j.middleCols(lens_size, 6) = d.by_camera;
    if (bend_size > 0) j.rightCols(2) = d.by_bend;
    jtj.noalias() += j.transpose() * j;
    jtb.noalias() += j.transpose() * d.by_board;
    jtr.noalias() += j.transpose() * r;
    set.by_board += d.by_board.transpose() * d.by_board;
    set.board_gradient += d.by_board.transpose() * r;
    cost += r.squaredNorm();
  }
  for (int i = 0; i < local; ++i) {
    for (int k = 0; k < local; ++k) set.by_parameters(at[index(i)], at[index(k)]) += jtj(i, k);
    set.mixed.row(at[index(i)]) += jtb.row(i);
    set.gradient(at[index(i)]) += jtr(i);
  }
}

// The normal equations of all views, with the boards' poses eliminated.
struct NormalEquations {
  struct OfSet {
    MatrixXd information;
    VectorXd gradient;
  };
  std::vector<OfSet> of_sets;
  MatrixXd information;  // of all
  double cost = 0;       // the residuals' squares
};

NormalEquations normal_equations(const Adjustment& a, const BoardShape& shape, const ParameterLayout& layout) {
  NormalEquations equations;
  equations.information = MatrixXd::Zero(layout.size, layout.size);
  for (std::size_t v = 0; v < a.views.size();) {
    const int number = a.views[v].set;
    SetEquations set(layout.size);
    for (; v < a.views.size() && a.views[v].set == number; ++v) add_view(a, v, shape, layout, set, equations.cost);
    if (set.is_empty) continue;
    const Eigen::LDLT<Eigen::Matrix<double, 6, 6>> solver(set.by_board);
    equations.of_sets.push_back({set.by_parameters - set.mixed * solver.solve(set.mixed.transpose()),
                                 set.gradient - set.mixed * solver.solve(set.board_gradient)});
    equations.information += equations.of_sets.back().information;
  }
  return equations;
}

// Directions without information get a huge variance rather than a wrong one. scale: see find_covariance().
MatrixXd inverse_of(const MatrixXd& information, const VectorXd& scale) {
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(scale.asDiagonal() * information * scale.asDiagonal());
  const VectorXd inverse_values = eigen.eigenvalues().cwiseMax(1e-13).cwiseInverse();
  return scale.asDiagonal() * eigen.eigenvectors() * inverse_values.asDiagonal() * eigen.eigenvectors().transpose() *
         scale.asDiagonal();
}

// The parameters' variances by leaving out one set after another and looking how far that moves them (jackknife):
// larger than by the noise where the corners of one moment err together, as with blur, a bent board or cameras out of
// step.
VectorXd jackknife_variances(const NormalEquations& equations, const MatrixXd& information, const VectorXd& scale,
                             const std::vector<int>& free) {
  const int sets = static_cast<int>(equations.of_sets.size());
  VectorXd spread = VectorXd::Zero(information.rows());
  for (const NormalEquations::OfSet& set : equations.of_sets) {
    const MatrixXd others =
        scale.asDiagonal() * (information - MatrixXd(set.information(free, free))) * scale.asDiagonal();
    const VectorXd gradient = scale.asDiagonal() * VectorXd(set.gradient(free));
    const VectorXd move =
        scale.asDiagonal() *
        (others + 1e-12 * MatrixXd::Identity(information.rows(), information.cols())).ldlt().solve(gradient);
    spread += move.cwiseAbs2() * (sets - 1) / sets;
  }
  return spread;
}

// An error of what was held moves what was adjusted. covariance: of the free ones, to which that is added.
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

// What every free camera parameter is known to, from the normal equations with the board poses eliminated.
void find_covariance(Adjustment& a, const BoardShape& shape) {
  const ParameterLayout layout = lay_out(a);
  const auto& free = layout.free;
  const NormalEquations equations = normal_equations(a, shape, layout);
  const int sets = static_cast<int>(equations.of_sets.size());
  const int freedom = 2 * a.corners_used - static_cast<int>(free.size()) - 6 * sets;
  a.noise_px = std::sqrt(equations.cost / std::max(1, freedom));
  MatrixXd covariance = MatrixXd::Zero(layout.size, layout.size);
  if (!free.empty()) {
    const MatrixXd information = equations.information(free, free);
    // Scaled to a unit diagonal: focal lengths and radians differ by many powers of ten.
    const VectorXd scale = information.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
    const MatrixXd inverse = inverse_of(information, scale);
    MatrixXd of_free = a.noise_px * a.noise_px * inverse;
    // The jackknife widens the bounds but never narrows them: few sets tell little.
    if (sets > 2) {
      const VectorXd spread = jackknife_variances(equations, information, scale, free);
      const VectorXd widen = (spread.array() / of_free.diagonal().array()).cwiseMax(1).sqrt();
      of_free = widen.asDiagonal() * of_free * widen.asDiagonal();
    }
    widen_where_pixels_are_not_square(a, free, of_free);
    covariance(free, free) = of_free;
    if (!layout.held.empty()) add_held(a, layout, equations.information, inverse, covariance);
  }
  a.covariance = covariance.topLeftCorner(layout.camera_size, layout.camera_size);
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
    if (views[v].camera == camera && !fits[v].dropped) ++count;
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
    solve(a, shape, std::clamp(calib::median(lengths), 0.3, 10.0), options.max_iterations);
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
    if (adjustment.fits[v].dropped) continue;
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
