#include "calib/wave/wave.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <memory>
#include <numbers>
#include <numeric>
#include <set>
#include <stdexcept>

#include "calib/solver/bundle_adjustment.h"
#include "calib/wave/wave_adjustment.h"
#include "calib/wave/wave_start.h"
#include "object_tracking/sighting.h"

namespace huetrack::wave {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double robust_sigmas = 3;      // beyond it an observation counts less and less
constexpr int least_shared = 20;         // frames that two cameras must share to be connected
constexpr double least_extent_m = 0.02;  // of the path, over the distance from the cameras
constexpr int passes = 21;               // for the progress: 2 rough ones, up to 16 of refine(), settle(), two halves

std::string text(const char* format, auto... values) {
  std::array<char, 512> buffer;
  std::snprintf(buffer.data(), buffer.size(), format, values...);
  return buffer.data();
}

double median(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::ranges::nth_element(values, middle);
  return *middle;
}

std::size_t index(int i) {
  return static_cast<std::size_t>(i);
}

Matrix3d cross_matrix(const Vector3d& v) {
  return (Matrix3d() << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0).finished();
}

// world_new = scale * rotation * world_old + translation
struct Similarity {
  double scale = 1;
  Matrix3d rotation = Matrix3d::Identity();
  Vector3d translation = Vector3d::Zero();

  Vector3d operator*(const Vector3d& p) const { return scale * (rotation * p) + translation; }
  void apply(WaveState& state) const {
    for (calib::Rigid3d& cam_from_world : state.cam_from_world) {
      const Vector3d centre = *this * calib::inverse(cam_from_world).translation;
      const Matrix3d r = cam_from_world.rotation.toRotationMatrix() * rotation.transpose();
      cam_from_world = {Eigen::Quaterniond(r).normalized(), -r * centre};
    }
    for (Vector3d& p : state.path.control) p = *this * p;
  }
};

// The frames of one recording, and what of them is used.
class Wave {
 public:
  Wave(const calib::CameraRig& rig, const std::vector<BallFrame>& frames, const WaveOptions& options)
      : rig_(rig), frames_(frames), options_(options), chosen_(frames.size(), -1) {
    double from = std::numeric_limits<double>::infinity(), to = -from;
    std::vector<std::vector<double>> times(rig.cameras.size());
    for (const BallFrame& f : frames_) {
      times[index(f.camera)].push_back(f.t_s);
      if (f.regions.empty()) continue;
      from = std::min(from, f.t_s);
      to = std::max(to, f.t_s);
    }
    from_s_ = from;
    to_s_ = to;
    step_s_ = std::numeric_limits<double>::infinity();
    for (const auto& of_camera : times) {
      std::vector<double> gaps;
      for (std::size_t i = 1; i < of_camera.size(); ++i) gaps.push_back(of_camera[i] - of_camera[i - 1]);
      if (const double gap = median(gaps); gap > 0)
        step_s_ = std::min(step_s_, gap), longest_s_ = std::max(longest_s_, gap);
    }
    // The largest region to begin with.
    for (std::size_t f = 0; f < frames_.size(); ++f) chosen_[f] = frames_[f].regions.empty() ? -1 : 0;
  }

  BallTracks tracks() const {
    BallTracks t;
    t.of_camera.resize(rig_.cameras.size());
    t.max_gap_s = 2.5 * longest_s_;
    for (std::size_t f = 0; f < frames_.size(); ++f) {
      if (chosen_[f] >= 0) t.of_camera[index(frames_[f].camera)].push_back({frames_[f].t_s, region(f).centre});
    }
    return t;
  }

  // Poses and path that suit the frames best, from these poses on. What does not agree is left out. `any_scale`: that
  // of the start means nothing; take the one at which the ball looks as large as it is.
  void solve(const std::vector<calib::Rigid3d>& start, bool any_scale) {
    state_.cam_from_world = start;
    std::size_t crossed = 0;
    state_.path = crossed_path(rig_, start, tracks(), from_s_, to_s_, step_s_, &crossed);
    if (crossed < index(least_shared)) {
      throw solver::CalibrationError(
          "the cameras' rays to the ball hardly ever meet with the poses that the rig has (" + std::to_string(crossed) +
          " times): the poses are far off, the cameras' names are swapped, or they see different things");
    }
    WaveAdjustmentOptions o = adjustment_options();
    // First everything may be wrong by much; then whatever agrees by its own covariance.
    rough_ = true;
    o.loss = 6;
    for (int round = 0; round < 2; ++round) {
      tell("the poses, roughly", round);
      fit_ = adjust_wave(rig_, observations(), state_, o);
      choose(round == 0 ? 20 : 8);
      o.loss = robust_sigmas;
      if (any_scale) Similarity{.scale = 1 / size_ratio()}.apply(state_);
    }
    learn_shapes();
    rough_ = false;
    choose(8);
    refine(2);
  }

  // Whatever agrees by its own covariance; what it is compared with is learnt anew in every round.
  void refine(int passes_before) {
    WaveAdjustmentOptions o = adjustment_options();
    for (int round = 0; round < 8; ++round) {
      tell("the poses and the ball's path", passes_before + round);
      learn_shapes();
      if (round == 1 || round == 3) learn_jerk();
      o.jerk_m_s3 = jerk_m_s3_;
      fit_ = adjust_wave(rig_, observations(), state_, o);
      const std::vector<int> before = chosen_;
      choose(4);
      if (round >= 3 && chosen_ == before) break;
    }
  }

  // Once more, for what is chosen, from where it is.
  void settle(bool with_covariance = false) {
    WaveAdjustmentOptions o = adjustment_options();
    o.with_covariance = with_covariance;
    o.max_iterations = 100;
    fit_ = adjust_wave(rig_, observations(), state_, o);
  }

  // What speaks against this solution: lower is better.
  double misfit() const {
    double sum = 0;
    for (std::size_t f = 0; f < frames_.size(); ++f) {
      if (frames_[f].regions.empty()) continue;
      sum += chosen_[f] < 0 ? 20 : std::min(20.0, cost_of(f, region(f)).value_or(20));
    }
    return sum;
  }
  double used_share() const {
    const auto used = std::ranges::count_if(chosen_, [](int c) { return c >= 0; });
    const auto seen = std::ranges::count_if(frames_, [](const BallFrame& f) { return !f.regions.empty(); });
    return seen == 0 ? 0 : static_cast<double>(used) / static_cast<double>(seen);
  }

  // Only every other piece of the recording, of a second or so.
  void keep_half(int half) {
    const double piece = std::max(1.0, (to_s_ - from_s_) / 20);
    for (std::size_t f = 0; f < frames_.size(); ++f) {
      if (static_cast<int>(std::floor((frames_[f].t_s - from_s_) / piece)) % 2 != half) chosen_[f] = -1;
    }
  }

  std::vector<BallObservation> observations() const {
    std::vector<BallObservation> out;
    for (std::size_t f = 0; f < frames_.size(); ++f) {
      if (chosen_[f] < 0) continue;
      const auto at = appearance(frames_[f]);
      const auto covariance = at ? covariance_of(f, region(f), *at) : std::nullopt;
      if (covariance) out.push_back({frames_[f].camera, frames_[f].t_s, region(f).centre, *covariance});
    }
    return out;
  }

  WaveState& state() { return state_; }
  const WaveState& state() const { return state_; }
  const WaveFit& fit() const { return fit_; }
  const std::vector<int>& chosen() const { return chosen_; }
  double from_s() const { return from_s_; }
  double to_s() const { return to_s_; }
  double step_s() const { return step_s_; }
  double jerk_m_s3() const { return jerk_m_s3_; }

  // How large the ball looks over how large it should, at the scale as it is.
  double size_ratio() const {
    std::vector<double> ratios;
    for (std::size_t f = 0; f < frames_.size(); ++f) {
      if (chosen_[f] < 0) continue;
      const auto at = appearance(frames_[f]);
      if (at && at->radius_px > 0) ratios.push_back(2 * std::pow(region(f).spread.determinant(), 0.25) / at->radius_px);
    }
    return ratios.empty() ? 1 : median(ratios);
  }

 private:
  void tell(const char* step, int done) const {
    if (options_.progress) options_.progress(step, done, passes);
  }

  const object_tracking::ColorRegion& region(std::size_t f) const { return frames_[f].regions[index(chosen_[f])]; }

  WaveAdjustmentOptions adjustment_options() const {
    WaveAdjustmentOptions o;
    o.radius_m = options_.radius_m;
    o.loss = robust_sigmas;
    o.jerk_m_s3 = jerk_m_s3_;
    // The scale is held by the two cameras that are furthest apart.
    double furthest = -1;
    for (std::size_t a = 0; a < rig_.cameras.size(); ++a) {
      for (std::size_t b = a + 1; b < rig_.cameras.size(); ++b) {
        const double d = (calib::inverse(state_.cam_from_world[a]).translation -
                          calib::inverse(state_.cam_from_world[b]).translation)
                             .norm();
        if (d <= furthest) continue;
        furthest = d;
        o.scale_a = static_cast<int>(a);
        o.scale_b = static_cast<int>(b);
      }
    }
    o.reference = o.scale_a;
    return o;
  }

  std::optional<object_tracking::Appearance> appearance(const BallFrame& frame) const {
    calib::Camera camera = rig_.cameras[index(frame.camera)];
    camera.cam_from_world = state_.cam_from_world[index(frame.camera)];
    const Vector3d p = state_.path.at(frame.t_s);
    auto at = object_tracking::appearance_of(camera, p, options_.radius_m);
    if (!at) return at;
    if (const auto px = outline_centre(camera.model, camera.cam_from_world * p, options_.radius_m)) at->px = *px;
    return at;
  }

  // How wide a region is along its axes, minor first, as the radius of a disc; and its axes.
  struct Shape {
    Eigen::Matrix2d axes;
    Vector2d width_px;
  };
  static Shape shape_of(const object_tracking::ColorRegion& region) {
    const auto solver = Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>().computeDirect(region.spread);
    return {solver.eigenvectors(), 2 * solver.eigenvalues().cwiseMax(0).cwiseSqrt()};
  }

  // How jerky the waving was: the smoother the path may be taken, the more it tells of the cameras. The most likely
  // one.
  void learn_jerk() {
    const std::vector<BallObservation> seen = observations();
    const auto evidence_for = [&](double jerk) {
      WaveState trial = state_;
      WaveAdjustmentOptions o = adjustment_options();
      o.jerk_m_s3 = jerk;
      o.max_iterations = 10;
      o.with_evidence = true;
      return adjust_wave(rig_, seen, trial, o).evidence;
    };
    constexpr double step = 1.8, least = 0.3, most = 1000;
    double best = evidence_for(jerk_m_s3_);
    for (const double factor : {1 / step, step}) {
      bool moved = false;
      for (double jerk = factor * jerk_m_s3_; jerk > least && jerk < most; jerk *= factor) {
        const double evidence = evidence_for(jerk);
        if (evidence <= best) break;
        best = evidence;
        jerk_m_s3_ = jerk;
        moved = true;
      }
      if (moved) break;
    }
  }

  // What whole balls look like to each camera: blur and shared chroma widen them, by a square that is the same at all
  // sizes. The upper half of what was seen, as hidden ones are narrow.
  void learn_shapes() {
    std::vector<std::array<std::vector<double>, 2>> excess(rig_.cameras.size());
    for (std::size_t f = 0; f < frames_.size(); ++f) {
      if (chosen_[f] < 0) continue;
      const auto at = appearance(frames_[f]);
      if (!at) continue;
      const Vector2d width = shape_of(region(f)).width_px;
      for (const std::size_t i : {0u, 1u}) {
        const double w = width[static_cast<int>(i)];
        excess[index(frames_[f].camera)][i].push_back(w * w - at->radius_px * at->radius_px);
      }
    }
    blur2_.assign(rig_.cameras.size(), Vector2d::Zero());
    for (std::size_t c = 0; c < excess.size(); ++c) {
      for (const std::size_t i : {0u, 1u}) {
        auto& values = excess[c][i];
        if (values.empty()) continue;
        const auto at = values.begin() + static_cast<std::ptrdiff_t>(0.6 * static_cast<double>(values.size()));
        std::ranges::nth_element(values, at);
        blur2_[c][static_cast<int>(i)] = *at;
      }
    }
  }

  // A region that is narrower than a whole ball is partly hidden, one that is wider has something else in it, and its
  // centre is off by as much: of little use here, where there are many others. nullopt: of none.
  std::optional<Eigen::Matrix2d> covariance_of(std::size_t f, const object_tracking::ColorRegion& region,
                                               const object_tracking::Appearance& at) const {
    if (rough_) return Eigen::Matrix2d(Eigen::Matrix2d::Identity());
    const Shape shape = shape_of(region);
    const double r2 = at.radius_px * at.radius_px;
    Vector2d variance;
    for (const int i : {0, 1}) {
      const double whole = std::sqrt(std::max(r2 / 2, r2 + blur2_[index(frames_[f].camera)][i]));
      const double ratio = shape.width_px[i] / whole;
      if (ratio < 0.75 || ratio > 1.6) return std::nullopt;
      const double misfit_px = 4 * std::max(0.0, std::abs(ratio - 1) - 0.04) * at.radius_px;
      variance[i] = options_.pixel_noise_px * options_.pixel_noise_px + 4e-4 * r2 + misfit_px * misfit_px;
    }
    return Eigen::Matrix2d(shape.axes * variance.asDiagonal() * shape.axes.transpose());
  }

  // How badly a region suits the path; nullopt: not at all.
  std::optional<double> cost_of(std::size_t f, const object_tracking::ColorRegion& region) const {
    const auto at = appearance(frames_[f]);
    if (!at) return std::nullopt;
    const Vector2d d = region.centre - at->px;
    const auto covariance = covariance_of(f, region, *at);
    if (!covariance) return std::nullopt;
    return d.dot(covariance->inverse() * d);
  }

  // Of every frame the region that suits the path best, if any does to `sigmas`.
  void choose(double sigmas) {
    for (std::size_t f = 0; f < frames_.size(); ++f) {
      chosen_[f] = -1;
      double best = sigmas * sigmas;
      for (std::size_t r = 0; r < frames_[f].regions.size(); ++r) {
        const auto cost = cost_of(f, frames_[f].regions[r]);
        if (!cost || *cost >= best) continue;
        best = *cost;
        chosen_[f] = static_cast<int>(r);
      }
    }
  }

  const calib::CameraRig& rig_;
  const std::vector<BallFrame>& frames_;
  const WaveOptions& options_;
  std::vector<int> chosen_;  // beside the frames: the region that is taken for the ball; -1: none
  double from_s_ = 0, to_s_ = 0, step_s_ = 0, longest_s_ = 0;
  bool rough_ = true;
  double jerk_m_s3_ = 60;        // see learn_jerk()
  std::vector<Vector2d> blur2_;  // per camera: see learn_shapes()
  WaveState state_;
  WaveFit fit_;
};

// The frame and scale of the rig that it started from; `scale_too`: nothing else sets it. Cameras that moved count
// little where most did not.
Similarity onto_rig(const calib::CameraRig& rig, const WaveState& state, bool scale_too) {
  const std::size_t n = rig.cameras.size();
  std::vector<double> weight(n, 1);
  Similarity s;
  for (int round = 0; round < 20; ++round) {
    Matrix3d sum = Matrix3d::Zero();
    Vector3d mean_from = Vector3d::Zero(), mean_to = Vector3d::Zero();
    const double total = std::accumulate(weight.begin(), weight.end(), 0.0);
    for (std::size_t c = 0; c < n; ++c) {
      mean_from += weight[c] / total * calib::inverse(state.cam_from_world[c]).translation;
      mean_to += weight[c] / total * rig.cameras[c].centre();
    }
    double spread_from = 0, spread_to = 0;
    for (std::size_t c = 0; c < n; ++c) {
      const Vector3d from = calib::inverse(state.cam_from_world[c]).translation - mean_from,
                     to = rig.cameras[c].centre() - mean_to;
      spread_from += weight[c] * from.squaredNorm();
      spread_to += weight[c] * to.squaredNorm();
    }
    if (scale_too && spread_from > 0) s.scale = std::sqrt(spread_to / spread_from);
    // Both what the cameras' axes and what their centres say about the rotation; a camera's own orientation counts like
    // a lever of a metre.
    for (std::size_t c = 0; c < n; ++c) {
      const Matrix3d guess = rig.cameras[c].cam_from_world.rotation.toRotationMatrix();
      const Matrix3d found = state.cam_from_world[c].rotation.toRotationMatrix();
      const Vector3d from = calib::inverse(state.cam_from_world[c]).translation - mean_from,
                     to = rig.cameras[c].centre() - mean_to;
      sum += weight[c] * (guess.transpose() * found + s.scale * to * from.transpose());
    }
    const Eigen::JacobiSVD<Matrix3d> svd(sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
    Vector3d sign(1, 1, (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1);
    s.rotation = svd.matrixU() * sign.asDiagonal() * svd.matrixV().transpose();
    s.translation = mean_to - s.scale * (s.rotation * mean_from);
    for (std::size_t c = 0; c < n; ++c) {
      const calib::Rigid3d& pose = state.cam_from_world[c];
      const double off = (s * calib::inverse(pose).translation - rig.cameras[c].centre()).norm();
      const Matrix3d turned = pose.rotation.toRotationMatrix() * s.rotation.transpose();
      const double angle =
          Eigen::AngleAxisd(turned * rig.cameras[c].cam_from_world.rotation.toRotationMatrix().transpose()).angle();
      weight[c] = 1 / std::max(0.002, std::hypot(off, angle));
    }
  }
  return s;
}

// Points to points (Umeyama 1991, by Eigen); with_scale: a similarity.
Similarity onto_points(const std::vector<Vector3d>& from, const std::vector<Vector3d>& to, bool with_scale) {
  Eigen::Matrix3Xd a(3, from.size()), b(3, to.size());
  for (std::size_t i = 0; i < from.size(); ++i) {
    a.col(static_cast<Eigen::Index>(i)) = from[i];
    b.col(static_cast<Eigen::Index>(i)) = to[i];
  }
  const Eigen::Matrix4d t = Eigen::umeyama(a, b, with_scale);
  Similarity s;
  s.scale = std::cbrt(t.topLeftCorner<3, 3>().determinant());
  s.rotation = t.topLeftCorner<3, 3>() / s.scale;
  s.translation = t.topRightCorner<3, 1>();
  return s;
}

// Where the ball rested: the mean places of the two longest rests. throws CalibrationError: there are no two.
std::array<Vector3d, 2> rests(const Wave& wave) {
  constexpr double still_m_s = 0.06, least_s = 0.7, window_s = 0.2;
  struct Rest {
    double from, to;
    Vector3d place;
  };
  std::vector<Rest> found;
  const BallPath& path = wave.state().path;
  std::optional<double> since;
  const double step = wave.step_s();
  for (double t = wave.from_s(); t <= wave.to_s() + step; t += step) {
    const double a = std::max(wave.from_s(), t - window_s / 2), b = std::min(wave.to_s(), t + window_s / 2);
    const bool still = t <= wave.to_s() && (path.at(b) - path.at(a)).norm() < still_m_s * (b - a);
    if (still && !since) since = t;
    if (still || !since) continue;
    if (t - step - *since >= least_s) {
      Vector3d sum = Vector3d::Zero();
      int n = 0;
      for (double u = *since; u < t; u += step, ++n) sum += path.at(u);
      found.push_back({*since, t - step, sum / n});
    }
    since.reset();
  }
  std::ranges::stable_sort(found, [](const Rest& x, const Rest& y) { return x.to - x.from > y.to - y.from; });
  for (std::size_t i = 1; i < found.size(); ++i) {
    if ((found[i].place - found[0].place).norm() > 0.1) return {found[0].place, found[i].place};
  }
  throw solver::CalibrationError(
      "the ball did not rest at two places (it rested " + std::to_string(found.size()) +
      " times for 0.7 s or longer), so the distance between them cannot set the scale: hold it still for "
      "two seconds at each of the two marks, in sight of two cameras");
}

// What errors of the camera poses (centre, rotation; world axes) do to positions, triangulated by all cameras that see
// them for exact pixels; but for a motion of the whole world, which is taken away as well as it can be.
struct ShapeErrors {
  Eigen::MatrixXd by_poses;   // three rows per place
  Eigen::MatrixXd alignment;  // the motion that is taken away (translation, rotation about the origin): six rows
  double places = 0;
  double reach_m = 0;  // rms distance of the places from their mean

  double rms(const Eigen::MatrixXd& covariance) const {
    return places > 0 ? std::sqrt(std::max(0.0, (by_poses * covariance * by_poses.transpose()).trace() / places)) : 0;
  }
  // Of a camera's pose, in the world that is aligned with the places.
  Eigen::MatrixXd of_camera(Eigen::Index c, const Vector3d& centre) const {
    Eigen::MatrixXd error = Eigen::MatrixXd::Zero(6, by_poses.cols());
    error.block<6, 6>(0, 6 * c).setIdentity();
    if (places == 0) return error;
    error.topRows<3>() -= alignment.topRows<3>() - cross_matrix(centre) * alignment.bottomRows<3>();
    error.bottomRows<3>() -= alignment.bottomRows<3>();
    return error;
  }
};

ShapeErrors shape_errors(const calib::CameraRig& rig, const WaveState& state, const std::vector<Vector3d>& wanted) {
  const auto n = static_cast<Eigen::Index>(rig.cameras.size());
  std::vector<Eigen::MatrixXd> moved;
  std::vector<Vector3d> places;
  Vector3d mean = Vector3d::Zero();
  for (const Vector3d& p : wanted) {
    Matrix3d information = Matrix3d::Zero();
    Eigen::MatrixXd by_pose = Eigen::MatrixXd::Zero(3, 6 * n);
    int views = 0;
    for (Eigen::Index c = 0; c < n; ++c) {
      const calib::Camera& camera = rig.cameras[static_cast<std::size_t>(c)];
      const calib::Rigid3d& pose = state.cam_from_world[static_cast<std::size_t>(c)];
      calib::CameraModel::Jacobian by_cam;
      const auto px = camera.model.project(pose * p, by_cam);
      if (!px || !camera.contains(*px)) continue;
      ++views;
      const Eigen::Matrix<double, 2, 3> j = by_cam * pose.rotation.toRotationMatrix();
      const Vector3d lever = p - calib::inverse(pose).translation;
      Eigen::Matrix<double, 2, 6> by_camera;
      by_camera.leftCols<3>() = -j;
      by_camera.rightCols<3>() = -j * cross_matrix(lever);
      information += j.transpose() * j;
      by_pose.middleCols<6>(6 * c) -= j.transpose() * by_camera;
    }
    if (views < 2) continue;
    moved.push_back(information.ldlt().solve(by_pose));
    places.push_back(p);
    mean += p;
  }
  ShapeErrors shape;
  shape.places = static_cast<double>(places.size());
  const auto rows = 3 * static_cast<Eigen::Index>(places.size());
  Eigen::MatrixXd all(rows, 6 * n), world(rows, 6);
  for (std::size_t k = 0; k < places.size(); ++k) {
    const auto row = 3 * static_cast<Eigen::Index>(k);
    all.middleRows<3>(row) = moved[k];
    world.block<3, 3>(row, 0).setIdentity();
    world.block<3, 3>(row, 3) = -cross_matrix(places[k]);
    shape.reach_m += (places[k] - mean / shape.places).squaredNorm() / shape.places;
  }
  shape.reach_m = std::sqrt(shape.reach_m);
  shape.alignment = (world.transpose() * world).ldlt().solve(world.transpose() * all);
  shape.by_poses = all - world * shape.alignment;
  return shape;
}

std::vector<Vector3d> places_along(const BallPath& path) {
  constexpr int samples = 60;
  std::vector<Vector3d> places;
  for (int i = 0; i <= samples; ++i)
    places.push_back(path.at(path.start_s + (path.end_s() - path.start_s) * i / samples));
  return places;
}

std::vector<Vector3d> places_in(const solver::WorldBox& box) {
  constexpr int steps = 6;
  std::vector<Vector3d> places;
  for (int i = 0; i <= steps; ++i) {
    for (int j = 0; j <= steps; ++j) {
      for (int k = 0; k <= steps; ++k)
        places.push_back(box.low + Vector3d(i, j, k).cwiseProduct(box.high - box.low) / steps);
    }
  }
  return places;
}

// Names the cameras that are not connected, and which pair lacks what.
void require_connected(const calib::CameraRig& rig, const std::vector<WavePair>& pairs) {
  std::vector<std::size_t> group(rig.cameras.size());
  std::iota(group.begin(), group.end(), std::size_t{0});
  for (const WavePair& p : pairs) {
    if (p.shared < least_shared) continue;
    const std::size_t from = std::max(group[index(p.a)], group[index(p.b)]),
                      to = std::min(group[index(p.a)], group[index(p.b)]);
    std::ranges::replace(group, from, to);
  }
  if (std::ranges::all_of(group, [](std::size_t g) { return g == 0; })) return;
  std::string alone, most;
  int shared = -1;
  for (std::size_t c = 0; c < group.size(); ++c) {
    if (group[c] != 0) alone += (alone.empty() ? "" : ", ") + rig.cameras[c].name;
  }
  for (const WavePair& p : pairs) {
    if ((group[index(p.a)] == 0) == (group[index(p.b)] == 0) || p.shared <= shared) continue;
    shared = p.shared;
    most = rig.cameras[index(p.a)].name + " and " + rig.cameras[index(p.b)].name;
  }
  throw solver::CalibrationError("the cameras are not connected: " + alone +
                                 " and the others hardly saw the ball at the same time; " + most + " share " +
                                 std::to_string(shared) + " frames, " + std::to_string(least_shared) +
                                 " are needed. Wave it where both see it");
}

std::vector<WavePair> pairs_of(const calib::CameraRig& rig, const BallTracks& tracks) {
  std::vector<WavePair> pairs;
  for (std::size_t a = 0; a < rig.cameras.size(); ++a) {
    for (std::size_t b = a + 1; b < rig.cameras.size(); ++b)
      pairs.push_back({static_cast<int>(a), static_cast<int>(b), static_cast<int>(tracks.shared(a, b).size())});
  }
  return pairs;
}

}  // namespace

std::vector<std::string> WaveOptions::problems(const calib::CameraRig& rig) const {
  std::vector<std::string> out;
  const auto is_camera = [&](int c) { return c >= 0 && index(c) < rig.cameras.size(); };
  if (!(radius_m > 0)) out.emplace_back("radius_m must be > 0");
  if (!(pixel_noise_px > 0)) out.emplace_back("pixel_noise_px must be > 0");
  if (rig.cameras.size() < 2) out.emplace_back("two or more cameras are needed");
  if (camera_distance) {
    if (!is_camera(camera_distance->a) || !is_camera(camera_distance->b) || camera_distance->a == camera_distance->b)
      out.emplace_back("camera_distance must name two different cameras of the rig");
    if (!(camera_distance->metres > 0)) out.emplace_back("camera_distance must be > 0 metres");
  }
  if (rest_distance_m && !(*rest_distance_m > 0)) out.emplace_back("rest_distance_m must be > 0");
  if (marks.size() == 1) out.emplace_back("one marked point sets no scale: give two, or three for the world's frame");
  if ((camera_distance ? 1 : 0) + (rest_distance_m ? 1 : 0) + (marks.empty() ? 0 : 1) > 1)
    out.emplace_back("the scale is given more than once: give one of camera distance, rest distance and marks");
  return out;
}

WaveResult calibrate_wave(const calib::CameraRig& rig, std::vector<BallFrame> frames, const WaveOptions& options) {
  for (const auto& problem : options.problems(rig)) throw std::invalid_argument(problem);
  const std::size_t n = rig.cameras.size();
  std::ranges::sort(frames, [](const BallFrame& a, const BallFrame& b) {
    return std::pair(a.t_s, a.camera) < std::pair(b.t_s, b.camera);
  });
  const auto tell = [&](const std::string& step, int done) {
    if (options.progress) options.progress(step, done, passes);
  };
  WaveResult result;
  result.rig = rig;
  result.cameras.resize(n);

  std::vector<int> seen_anything(n, 0);
  for (const BallFrame& f : frames) {
    ++result.cameras[index(f.camera)].frames;
    seen_anything[index(f.camera)] += f.regions.empty() ? 0 : 1;
  }
  const std::vector<int> still = remove_still_regions(frames, n);
  for (const BallFrame& f : frames) result.cameras[index(f.camera)].seen += f.regions.empty() ? 0 : 1;
  for (std::size_t c = 0; c < n; ++c) {
    const WaveCamera& camera = result.cameras[c];
    const std::string& name = rig.cameras[c].name;
    if (camera.frames == 0) throw solver::CalibrationError(name + " gave no frame");
    if (seen_anything[c] == 0) {
      throw solver::CalibrationError(
          name + " never saw the target: none of its " + std::to_string(camera.frames) +
          " frames has a region of the colour. Check the target's colour (hue, saturation, intensity) in "
          "this camera, or wave it in front of it");
    }
    if (camera.seen < least_shared) {
      throw solver::CalibrationError(name +
                                     (still[c] > 0
                                          ? " saw the target's colour only where it never moves: too little motion, or "
                                            "something else of that colour"
                                          : " saw the target in only " + std::to_string(camera.seen) + " frames, " +
                                                std::to_string(least_shared) + " are needed") +
                                     ". Wave it through the whole volume");
    }
    if (still[c] > 0) {
      result.notes.push_back(name + ": something of the target's colour stands still in its view; it is left out");
    }
  }

  auto whole = std::make_unique<Wave>(rig, frames, options);
  require_connected(rig, pairs_of(rig, whole->tracks()));
  const bool from_nothing = !options.has_poses;
  bool found_anew = from_nothing;
  if (options.has_poses) {
    std::vector<calib::Rigid3d> start;
    for (const calib::Camera& camera : rig.cameras) start.push_back(camera.cam_from_world);
    std::string why;
    try {
      whole->solve(start, false);
    } catch (const solver::CalibrationError& e) {
      why = e.what();
    }
    if (!why.empty() || whole->used_share() < 0.7) {
      // The poses may be so far off that they lead nowhere.
      auto fresh = std::make_unique<Wave>(rig, frames, options);
      try {
        fresh->solve(poses_from_nothing(rig, fresh->tracks()), true);
        if (!why.empty() || fresh->misfit() < whole->misfit()) {
          whole = std::move(fresh);
          found_anew = true;
        }
      } catch (const solver::CalibrationError&) {
        if (!why.empty()) throw solver::CalibrationError(why);
      }
    }
  } else {
    whole->solve(poses_from_nothing(rig, whole->tracks()), true);
  }
  Wave& wave = *whole;
  result.pairs = pairs_of(rig, wave.tracks());
  require_connected(rig, result.pairs);

  // Scale and frame.
  WaveState& state = wave.state();
  const auto centre = [&](int c) { return calib::inverse(state.cam_from_world[index(c)]).translation; };
  constexpr double tape_m = 0.005;  // how well a distance is measured
  double over_m = 0;                // which one; 0: none
  const auto set_scale = [&] {
    Similarity scale;
    if (options.camera_distance) {
      const auto [a, b, metres] = *options.camera_distance;
      scale.scale = metres / (centre(a) - centre(b)).norm();
      over_m = metres;
      result.scale_from = text("the distance between %s and %s, %.3f m", rig.cameras[index(a)].name.c_str(),
                               rig.cameras[index(b)].name.c_str(), metres);
    } else if (options.rest_distance_m) {
      const auto places = rests(wave);
      scale.scale = *options.rest_distance_m / (places[0] - places[1]).norm();
      over_m = *options.rest_distance_m;
      result.scale_from = text("the distance between the two places where the ball rested, %.3f m", over_m);
    } else if (!options.marks.empty()) {
      const BallTracks tracks = wave.tracks();
      std::vector<Vector3d> from, to;
      for (const BallMark& mark : options.marks) {
        int views = 0;
        for (std::size_t c = 0; c < n; ++c) views += tracks.at(c, mark.t_s) ? 1 : 0;
        if (views < 2) {
          throw solver::CalibrationError(
              text("the mark at %.3f s: %s saw the ball then (it was seen from %.3f to %.3f s), and two are needed",
                   mark.t_s, views == 0 ? "no camera" : "only one camera", wave.from_s(), wave.to_s()));
        }
        from.push_back(state.path.at(mark.t_s));
        to.push_back(mark.p_world);
      }
      double spread_from = 0, spread_to = 0;
      for (std::size_t i = 0; i < from.size(); ++i) {
        for (std::size_t k = i + 1; k < from.size(); ++k) {
          spread_from += (from[i] - from[k]).squaredNorm();
          spread_to += (to[i] - to[k]).squaredNorm();
          over_m = std::max(over_m, (to[i] - to[k]).norm());
        }
      }
      if (!(spread_to > 1e-4) || !(spread_from > 0))
        throw solver::CalibrationError("the marked points are all at one place");
      scale.scale = std::sqrt(spread_to / spread_from);
      result.scale_from = std::to_string(from.size()) + " marked points";
    } else if (!from_nothing) {
      scale.scale = onto_rig(rig, state, true).scale;
      result.scale_from = "the rig's own poses";
    } else {
      scale.scale = 1 / wave.size_ratio();  // a ball that looks twice as large as it should is half as far away
      result.scale_from = "the ball's radius, roughly";
    }
    scale.apply(state);
  };
  set_scale();
  wave.refine(10);  // how large the ball should look, and how smooth its path is, depend on the scale
  if (over_m > 0) set_scale();

  if (options.marks.size() >= 3) {
    std::vector<Vector3d> from, to;
    Vector3d mean = Vector3d::Zero();
    for (const BallMark& mark : options.marks) {
      from.push_back(state.path.at(mark.t_s));
      to.push_back(mark.p_world);
      mean += mark.p_world / static_cast<double>(options.marks.size());
    }
    Matrix3d scatter = Matrix3d::Zero();
    for (const Vector3d& p : to) scatter += (p - mean) * (p - mean).transpose();
    const Vector3d axes = Eigen::SelfAdjointEigenSolver<Matrix3d>(scatter).eigenvalues();
    if (axes[1] < 1e-3 * axes[2])
      throw solver::CalibrationError(
          "the marked points lie on one line, which leaves the world free to turn around it");
    const Similarity move = onto_points(from, to, false);
    move.apply(state);
    double worst = 0;
    for (std::size_t i = 0; i < to.size(); ++i)
      worst = std::max(worst, (state.path.at(options.marks[i].t_s) - to[i]).norm());
    result.notes.push_back(text("the marked points fit to %.1f mm", 1e3 * worst));
    if (worst > 0.03)
      result.doubts.push_back(
          text("a marked point is off by %.0f mm: measure them again, and check the times", 1e3 * worst));
  } else if (!from_nothing) {
    onto_rig(rig, state, false).apply(state);
  } else {
    // The first camera's place is the origin, and up is what its image shows as up.
    Similarity move;
    const Matrix3d world_from_cam = (Matrix3d() << 1, 0, 0, 0, 0, 1, 0, -1, 0).finished();
    move.rotation = world_from_cam * state.cam_from_world[0].rotation.toRotationMatrix();
    move.translation = -(move.rotation * centre(0));
    move.apply(state);
    result.notes.push_back("the world's origin is " + rig.cameras[0].name +
                           ", with z up in its image; set it with huetrack-calibrate world");
  }

  tell("the uncertainties", 18);
  wave.settle(true);

  // What came out.
  for (std::size_t c = 0; c < n; ++c) result.rig.cameras[c].cam_from_world = state.cam_from_world[c];
  result.size_ratio = wave.size_ratio();
  result.jerk_m_s3 = wave.jerk_m_s3();
  result.duration_s = wave.to_s() - wave.from_s();
  const auto observations = wave.observations();
  double sum = 0;
  std::vector<double> sums(n, 0);
  std::vector<std::set<int>> cells(n);
  for (std::size_t i = 0; i < observations.size(); ++i) {
    const std::size_t c = index(observations[i].camera);
    sums[c] += wave.fit().residuals[i].squaredNorm();
    sum += wave.fit().residuals[i].squaredNorm();
    ++result.cameras[c].used;
    const calib::ImageSize size = rig.cameras[c].image_size;
    const Vector2d& px = observations[i].px;
    cells[c].insert(static_cast<int>(8 * (px.x() + 0.5) / size.width) +
                    8 * static_cast<int>(6 * (px.y() + 0.5) / size.height));
  }
  result.rms_px = std::sqrt(sum / static_cast<double>(std::max<std::size_t>(1, observations.size())));

  Vector3d mean = Vector3d::Zero();
  Matrix3d scatter = Matrix3d::Zero();
  const auto count = static_cast<double>(observations.size());
  for (const BallObservation& o : observations) mean += state.path.at(o.t_s) / count;
  for (const BallObservation& o : observations) {
    const Vector3d d = state.path.at(o.t_s) - mean;
    scatter += d * d.transpose() / count;
  }
  const Vector3d variance = Eigen::SelfAdjointEigenSolver<Matrix3d>(scatter).eigenvalues();
  for (int i = 0; i < 3; ++i) result.extent_m[i] = std::sqrt(12 * std::max(0.0, variance[2 - i]));  // of an even spread
  double away = 0;
  for (std::size_t c = 0; c < n; ++c) away += (centre(static_cast<int>(c)) - mean).norm() / static_cast<double>(n);
  if (result.extent_m[0] < 5 * least_extent_m * away) {
    throw solver::CalibrationError(
        text("too little motion: the ball moved within %.0f cm, at %.1f m from the cameras. Wave it through the "
             "whole volume",
             1e2 * result.extent_m[0], away));
  }
  if (result.extent_m[1] < least_extent_m * away) {
    throw solver::CalibrationError(
        text("the ball moved along one line (%.2f m long, %.0f mm wide), which leaves the cameras free to turn "
             "around it. Wave it through the whole volume",
             result.extent_m[0], 1e3 * result.extent_m[1]));
  }
  if (result.extent_m[2] < least_extent_m * away) {
    const std::string what = text(
        "the ball moved in one plane (%.2f x %.2f m, %.0f mm thick): wave it through the whole volume, "
        "up and down and towards the cameras too",
        result.extent_m[0], result.extent_m[1], 1e3 * result.extent_m[2]);
    if (from_nothing) throw solver::CalibrationError(what);
    result.doubts.push_back(what);
  }

  const ShapeErrors along_path = shape_errors(result.rig, state, places_along(state.path));
  std::optional<ShapeErrors> in_volume;
  if (options.volume) in_volume = shape_errors(result.rig, state, places_in(*options.volume));
  // The two halves of the recording, on their own.
  std::array<WaveState, 2> halves{state, state};
  Eigen::MatrixXd of_halves = Eigen::MatrixXd::Zero(6 * static_cast<Eigen::Index>(n), 6 * static_cast<Eigen::Index>(n));
  for (const int half : {0, 1}) {
    tell("one half of it", 19 + half);
    Wave part = wave;
    part.keep_half(half);
    part.settle(true);
    halves[index(half)] = part.state();
    of_halves += part.fit().covariance;
  }
  Eigen::VectorXd apart(6 * static_cast<Eigen::Index>(n));
  for (std::size_t c = 0; c < n; ++c) {
    const calib::Rigid3d &a = halves[0].cam_from_world[c], &b = halves[1].cam_from_world[c];
    const Eigen::AngleAxisd turn(a.rotation.conjugate() * b.rotation);
    apart.segment<3>(6 * static_cast<Eigen::Index>(c)) = calib::inverse(b).translation - calib::inverse(a).translation;
    apart.segment<3>(6 * static_cast<Eigen::Index>(c) + 3) = turn.angle() * turn.axis();
  }
  result.halves_m = along_path.rms(apart * apart.transpose());
  result.halves_sigma_m = along_path.rms(of_halves);
  // Where they differ by more than the noise explains, they are believed.
  const double widen = result.halves_sigma_m > 0 ? std::max(1.0, result.halves_m / result.halves_sigma_m) : 1;
  const Eigen::MatrixXd covariance = widen * widen * wave.fit().covariance;
  for (std::size_t c = 0; c < n; ++c) {
    WaveCamera& camera = result.cameras[c];
    camera.rms_px = std::sqrt(sums[c] / std::max(1, camera.used));
    camera.coverage = static_cast<double>(cells[c].size()) / 48;
    const Eigen::MatrixXd by_poses = (in_volume && in_volume->places > 0 ? *in_volume : along_path)
                                         .of_camera(static_cast<Eigen::Index>(c), centre(static_cast<int>(c)));
    const Eigen::VectorXd own_variance = (by_poses * covariance * by_poses.transpose()).diagonal().cwiseMax(0);
    camera.centre_sigma_m = own_variance.head<3>().cwiseSqrt();
    camera.rotation_sigma_rad = own_variance.tail<3>().cwiseSqrt();
    if (!options.has_poses) continue;
    camera.moved_m = (result.rig.cameras[c].centre() - rig.cameras[c].centre()).norm();
    camera.turned_rad =
        result.rig.cameras[c].cam_from_world.rotation.angularDistance(rig.cameras[c].cam_from_world.rotation);
  }
  result.expected_m = along_path.rms(covariance);
  if (in_volume && in_volume->places > 0) result.expected_in_volume_m = in_volume->rms(covariance);

  // The scale's uncertainty; and the verdict.
  if (over_m > 0) {
    result.scale_sigma = tape_m / over_m;
    if (options.rest_distance_m) result.scale_sigma = std::hypot(tape_m, 0.005) / over_m;  // the ball's own places too
    if (!options.marks.empty()) {
      Vector3d middle = Vector3d::Zero();
      for (const BallMark& mark : options.marks) middle += mark.p_world / static_cast<double>(options.marks.size());
      double spread2 = 0;
      for (const BallMark& mark : options.marks) spread2 += (mark.p_world - middle).squaredNorm();
      result.scale_sigma = tape_m / std::sqrt(spread2);
    }
  } else if (!from_nothing) {
    double off2 = 0, spread2 = 0;
    Vector3d middle = Vector3d::Zero();
    for (std::size_t c = 0; c < n; ++c) middle += centre(static_cast<int>(c)) / static_cast<double>(n);
    for (std::size_t c = 0; c < n; ++c) {
      spread2 += (centre(static_cast<int>(c)) - middle).squaredNorm();
      off2 += result.cameras[c].moved_m * result.cameras[c].moved_m;
      result.scale_sigma = std::max(result.scale_sigma, result.cameras[c].turned_rad);
    }
    result.scale_sigma = std::max(result.scale_sigma, std::sqrt(off2 / spread2));
  } else {
    result.scale_sigma = 0.1;
  }
  result.by_scale_m = result.scale_sigma * along_path.reach_m;
  if (in_volume) result.by_scale_in_volume_m = result.scale_sigma * in_volume->reach_m;
  if (result.scale_sigma > 0.01) {
    result.doubts.push_back(text("the scale is from %s, which is good to %.1f %% only: %s", result.scale_from.c_str(),
                                 1e2 * result.scale_sigma,
                                 over_m > 0 ? "measure a longer distance, or places further apart"
                                            : "give --camera-distance, --rest-distance or two marked points"));
  }
  if (over_m > 0 && (result.size_ratio < 0.65 || result.size_ratio > 1.5)) {
    result.doubts.push_back(
        text("at this scale the ball looks %.2f times as large as its radius of %.1f mm says: is the radius, "
             "or the measured distance, wrong?",
             result.size_ratio, 1e3 * options.radius_m));
  }
  for (std::size_t c = 0; c < n; ++c) {
    const WaveCamera& camera = result.cameras[c];
    const char* name = rig.cameras[c].name.c_str();
    if (camera.used < 0.6 * camera.seen) {
      result.doubts.push_back(
          text("%s: only %d of the %d frames with the target's colour agree with the other cameras: other "
               "things of that colour, wrong times, or the wrong lens",
               name, camera.used, camera.seen));
    }
    if (camera.used < least_shared) {
      throw solver::CalibrationError(
          text("%s: only %d of its %d frames with the target's colour agree with the other cameras; %d are "
               "needed",
               name, camera.used, camera.seen, least_shared));
    }
    if (options.has_poses && (camera.moved_m > 0.3 * away || camera.turned_rad > 0.35)) {
      result.doubts.push_back(
          text("%s is %.2f m and %.0f degrees from where the rig had it: are the cameras' names swapped, or is it the "
               "wrong rig?",
               name, camera.moved_m, camera.turned_rad * 180 / std::numbers::pi));
    }
    if (camera.coverage < 0.15) {
      result.doubts.push_back(text("%s saw the ball in %.0f %% of its image only: wave it where the rest looks", name,
                                   1e2 * camera.coverage));
    }
  }
  if (result.rms_px > 1.5) {
    result.doubts.push_back(
        text("the ball is %.1f px off on average: the lenses, the cameras' times or the colour are not right",
             result.rms_px));
  }
  const double expected_m = result.expected_in_volume_m.value_or(result.expected_m);
  if (expected_m > 0.003 * away) {
    result.doubts.push_back(
        text("positions would be off by %.0f mm: wave for longer, and through more of the volume", 1e3 * expected_m));
  }
  if (result.halves_m > 0.006 * away && result.halves_m > 2 * result.halves_sigma_m) {
    result.doubts.push_back(
        text("the two halves of the recording disagree by %.0f mm: did a camera move meanwhile? Otherwise wave "
             "for longer",
             1e3 * result.halves_m));
  }
  if (found_anew && !from_nothing) {
    result.doubts.emplace_back("the rig's poses were no use as a start: check that its cameras' names are not swapped");
  }
  return result;
}

}  // namespace huetrack::wave
