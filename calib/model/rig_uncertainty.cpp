#include "calib/model/rig_uncertainty.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <charconv>
#include <cmath>
#include <optional>

#include "calib/model/camera_rig.h"
#include "calib/model/cross_matrix.h"
#include "calib/model/index.h"
#include "calib/model/lens_derivatives.h"

namespace huetrack::calib {
namespace {

// Six digits of a sigma, six decimals of the root: a relative error of 1e-6, and of 1e-4 where the parameters' errors
// cancel to a hundredth (a longer focal length and a camera further away).
constexpr double root_steps = 1e6;
constexpr double row_tolerance = 1e-3;  // of the length of a row of the root: files may be rounded

double rounded(double sigma) {
  const std::string text = fmt::format("{:.6g}", sigma);
  double value = 0;
  std::from_chars(text.data(), text.data() + text.size(), value);
  return value;
}

// A lower triangular root of a positive semidefinite matrix; Cholesky decomposition needs a definite one.
Eigen::MatrixXd root_of(const Eigen::MatrixXd& matrix) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(matrix);
  const Eigen::MatrixXd transposed =
      eigen.eigenvalues().cwiseMax(0).cwiseSqrt().asDiagonal() * eigen.eigenvectors().transpose();
  const Eigen::HouseholderQR<Eigen::MatrixXd> qr(transposed);
  Eigen::MatrixXd root = Eigen::MatrixXd(qr.matrixQR().triangularView<Eigen::Upper>()).transpose();
  for (Eigen::Index k = 0; k < root.cols(); ++k) {
    if (root(k, k) < 0) root.col(k) *= -1;
  }
  return root;
}

// Derivatives of a view's pixel and of the size there by the position and by its camera's parameters.
struct ViewTerm {
  Eigen::Matrix<double, 3, 3> by_place;    // rows: u, v, log of the size
  Eigen::Matrix<double, 3, 18> by_camera;  // lens (lens_count), then pose
};

std::optional<ViewTerm> view_term(const Camera& camera, const RigUncertainty::CameraParameters& of,
                                  const Eigen::Vector3d& p) {
  const Eigen::Vector3d p_cam = camera.cam_from_world * p;
  if (!camera.model.project(p_cam)) return std::nullopt;
  Eigen::Vector2d px;
  PixelByPoint by_point;
  PixelByLens by_lens;
  const LensParameters lens = parameters_of(camera.model);
  PixelByLens* wanted = of.lens_count > 0 ? &by_lens : nullptr;
  if (!project_like(camera.model, lens, p_cam, px, &by_point, wanted)) return std::nullopt;
  ViewTerm term;
  Eigen::Matrix3d by_cam_point;
  by_cam_point << by_point, -p_cam.transpose() / p_cam.squaredNorm();
  term.by_place = by_cam_point * camera.cam_from_world.rotation.toRotationMatrix();
  if (of.lens_count > 0) {
    term.by_camera.topLeftCorner(2, of.lens_count) = by_lens.leftCols(of.lens_count);
    term.by_camera.bottomLeftCorner(1, of.lens_count).setZero();
    term.by_camera.bottomLeftCorner<1, 2>() = 0.5 * lens.head<2>().cwiseInverse().transpose();
  }
  if (of.has_pose) {
    term.by_camera.middleCols<3>(of.lens_count) = -by_cam_point * cross_matrix(p_cam);
    term.by_camera.middleCols<3>(of.lens_count + 3) = by_cam_point;
  }
  return term;
}

std::string lens_counts(const CameraModel& model) {
  constexpr std::array counts{"8, 9 or 12", "8", "12"};  // beside CameraModel::Lens
  return counts[model.lens().index()];
}

}  // namespace

bool is_lens_count(const CameraModel& model, int count) {
  if (std::holds_alternative<Stereographic>(model.lens())) return count == 12;
  return count == 8 || (std::holds_alternative<PinholeRadtan>(model.lens()) && (count == 9 || count == 12));
}

RigUncertainty RigUncertainty::of(std::vector<CameraParameters> cameras, const Eigen::MatrixXd& covariance) {
  RigUncertainty out;
  int at = 0;
  for (CameraParameters& camera : cameras) {
    camera.at = at;
    at += camera.size();
  }
  out.cameras = std::move(cameras);
  out.sigma = covariance.diagonal().cwiseMax(0).cwiseSqrt().unaryExpr(&rounded);
  const Eigen::VectorXd inverse = out.sigma.unaryExpr([](double s) { return s > 0 ? 1 / s : 0.0; });
  out.root = root_of(inverse.asDiagonal() * covariance * inverse.asDiagonal());
  for (Eigen::Index k = 0; k < out.root.rows(); ++k) {
    if (const double length = out.root.row(k).norm(); length > 0) out.root.row(k) /= length;
  }
  out.root = out.root.unaryExpr([](double r) { return std::round(r * root_steps) / root_steps + 0.0; });
  return out;
}

Eigen::MatrixXd RigUncertainty::covariance() const {
  const Eigen::MatrixXd f = factor();
  return f * f.transpose();
}

std::vector<std::string> RigUncertainty::problems(const CameraRig& rig) const {
  if (cameras.size() != rig.cameras.size()) return {"it is not of this rig's cameras"};
  std::vector<std::string> out;
  int at = 0;
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    if (cameras[c].at != at) out.emplace_back("the parameters are not in the cameras' order");
    at += cameras[c].size();
    if (cameras[c].lens_count != 0 && !is_lens_count(rig.cameras[c].model, cameras[c].lens_count))
      out.push_back("camera " + rig.cameras[c].name + ": lens has " + lens_counts(rig.cameras[c].model) + " numbers");
  }
  if (sigma.size() != at || root.rows() != at || root.cols() != at) {
    out.emplace_back("sigma and root do not have as many rows as there are parameters");
    return out;
  }
  if (!sigma.allFinite() || (sigma.array() < 0).any()) out.emplace_back("a sigma must be >= 0");
  for (Eigen::Index k = 0; k < root.rows(); ++k) {
    if (sigma(k) > 0 && !(std::abs(root.row(k).norm() - 1) < row_tolerance)) {
      out.push_back(fmt::format("row {} of root has the length {:.4g} and not 1", k + 1, root.row(k).norm()));
      break;
    }
  }
  return out;
}

RigUncertainty with_pose_covariance(const CameraRig& rig, int camera, const Covariance6d& covariance) {
  const RigUncertainty before =
      rig.uncertainty ? *rig.uncertainty
                      : RigUncertainty{std::vector<RigUncertainty::CameraParameters>(rig.cameras.size()), {}, {}};
  std::vector<RigUncertainty::CameraParameters> cameras = before.cameras;
  cameras[index(camera)].has_pose = true;
  std::vector<int> kept, at;  // old and new indices of the kept parameters
  int size = 0, pose_at = 0;
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    const int count = c == index(camera) ? before.cameras[c].lens_count : before.cameras[c].size();
    for (int k = 0; k < count; ++k) {
      kept.push_back(before.cameras[c].at + k);
      at.push_back(size + k);
    }
    if (c == index(camera)) pose_at = size + before.cameras[c].lens_count;
    size += cameras[c].size();
  }
  Eigen::MatrixXd all = Eigen::MatrixXd::Zero(size, size);
  if (!kept.empty()) all(at, at) = before.covariance()(kept, kept);
  all.block<6, 6>(pose_at, pose_at) = covariance;
  return RigUncertainty::of(std::move(cameras), all);
}

Eigen::Matrix3Xd position_gain_of_cameras(const CameraRig& rig, const RigUncertainty& uncertainty,
                                          const Eigen::Vector3d& p, std::span<const PlaceView> views,
                                          const Eigen::Matrix3d& prior_information) {
  Eigen::Matrix3d normal = prior_information;
  Eigen::Matrix3Xd moment = Eigen::Matrix3Xd::Zero(3, uncertainty.size());
  for (const PlaceView& view : views) {
    const RigUncertainty::CameraParameters& of = uncertainty.cameras[index(view.camera)];
    const auto term = view_term(rig.cameras[index(view.camera)], of, p);
    if (!term) continue;
    Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
    information.topLeftCorner<2, 2>() = view.information;
    information(2, 2) = view.log_size_information;
    const Eigen::Matrix3d weighed = term->by_place.transpose() * information;
    normal += weighed * term->by_place;
    if (of.size() > 0) moment.middleCols(of.at, of.size()) += weighed * term->by_camera.leftCols(of.size());
  }
  const Eigen::LDLT<Eigen::Matrix3d> solver(normal);
  if (solver.info() != Eigen::Success || !(solver.vectorD().minCoeff() > 0)) return 0 * moment;
  return -solver.solve(moment);
}

Eigen::Matrix3d rig_covariance_at(const CameraRig& rig, const Eigen::Vector3d& p_world,
                                  std::span<const PlaceView> views, const Eigen::Matrix3d& prior_information) {
  if (!rig.uncertainty || rig.uncertainty->size() == 0) return Eigen::Matrix3d::Zero();
  const Eigen::Matrix3Xd moved =
      position_gain_of_cameras(rig, *rig.uncertainty, p_world, views, prior_information) * rig.uncertainty->factor();
  return moved * moved.transpose();
}

}  // namespace huetrack::calib
