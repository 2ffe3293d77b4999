#include "calib/wave/scale.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "calib/model/cross_matrix.h"
#include "calib/model/index.h"
#include "calib/wave/outline_cost.h"
#include "calib/wave/similarity.h"

namespace huetrack::wave {
namespace {

using calib::index;
using Eigen::Matrix3d;
using Eigen::Vector3d;
using Kind = ScaleSource::Kind;

// Mean positions of rests of 0.7 s or longer, the longest first.
std::vector<Vector3d> rests(const WaveSolution& wave) {
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
  std::vector<Vector3d> places;
  for (const Rest& rest : found) places.push_back(rest.place);
  return places;
}

// Distance of the two longest rests at different places. throws CalibrationError: there are no two.
double rest_distance(const WaveSolution& wave) {
  constexpr double least_m = 0.1;
  const std::vector<Vector3d> places = rests(wave);
  for (const Vector3d& place : places) {
    if ((place - places.front()).norm() > least_m) return (place - places.front()).norm();
  }
  throw solver::CalibrationError("the ball did not rest at two places (it rested " + std::to_string(places.size()) +
                                     " times for 0.7 s or longer), so the distance between them cannot set the scale",
                                 solver::Fault::no_rests);
}

// Estimated and given positions at the marks.
struct MarkedPath {
  std::vector<Vector3d> found, marked;
};

// throws CalibrationError: too few cameras saw the ball at a mark.
MarkedPath path_at_marks(const WaveSolution& wave, const std::vector<BallMark>& marks, std::size_t cameras) {
  const BallTracks tracks = wave.tracks();
  MarkedPath path;
  for (const BallMark& mark : marks) {
    int views = 0;
    for (std::size_t c = 0; c < cameras; ++c) views += tracks.at(c, mark.t_s) ? 1 : 0;
    if (views < 2) {
      throw solver::CalibrationError(fmt::format(
          "the mark at {:.3f} s: {} saw the ball then (it was seen from {:.3f} to {:.3f} s), and two are needed",
          mark.t_s, views == 0 ? "no camera" : "only one camera", wave.from_s(), wave.to_s()));
    }
    path.found.push_back(wave.state().path.at(mark.t_s));
    path.marked.push_back(mark.p_world);
  }
  return path;
}

// Scale from the solution to the marks. throws CalibrationError: they are all at one place.
double scale_of(const MarkedPath& path) {
  double spread_from = 0, spread_to = 0;
  for (std::size_t i = 0; i < path.found.size(); ++i) {
    for (std::size_t k = i + 1; k < path.found.size(); ++k) {
      spread_from += (path.found[i] - path.found[k]).squaredNorm();
      spread_to += (path.marked[i] - path.marked[k]).squaredNorm();
    }
  }
  constexpr double least_spread_m2 = 1e-4;  // a centimetre
  if (!(spread_to > least_spread_m2) || !(spread_from > 0))
    throw solver::CalibrationError("the marked points are all at one place");
  return std::sqrt(spread_to / spread_from);
}

double longest_distance(const std::vector<Vector3d>& points) {
  double longest = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    for (std::size_t k = i + 1; k < points.size(); ++k) longest = std::max(longest, (points[i] - points[k]).norm());
  }
  return longest;
}

Vector3d middle_of(const std::vector<BallMark>& marks) {
  Vector3d middle = Vector3d::Zero();
  for (const BallMark& mark : marks) middle += mark.p_world / static_cast<double>(marks.size());
  return middle;
}

// Aligns the solution with the marks. Returns the largest residual. throws CalibrationError: they are collinear.
double move_onto_marks(WaveState& state, const std::vector<BallMark>& marks) {
  std::vector<Vector3d> from, to;
  for (const BallMark& mark : marks) {
    from.push_back(state.path.at(mark.t_s));
    to.push_back(mark.p_world);
  }
  const Vector3d mean = middle_of(marks);
  Matrix3d scatter = Matrix3d::Zero();
  for (const Vector3d& p : to) scatter += (p - mean) * (p - mean).transpose();
  const Vector3d axes = Eigen::SelfAdjointEigenSolver<Matrix3d>(scatter).eigenvalues();
  constexpr double least_breadth2 = 1e-3;  // over the length, squared
  if (axes[1] < least_breadth2 * axes[2])
    throw solver::CalibrationError("the marked points lie on one line, which leaves the world free to turn around it");
  onto_points(from, to).apply(state);
  double worst = 0;
  for (std::size_t i = 0; i < to.size(); ++i) worst = std::max(worst, (state.path.at(marks[i].t_s) - to[i]).norm());
  return worst;
}

// One source: the log of its scale over the solution's, its own sigma, and its errors by WaveFit's.
struct Estimate {
  ScaleSource source;
  double log_scale;
  Eigen::RowVectorXd by_errors;
};

// 1 sigma of a measured distance, relative. So short a one that it would be worse is a slip of the unit.
double tape_sigma(double metres) {
  constexpr double tape_m = 0.005, worst = 0.02;
  return std::min(worst, tape_m / metres);
}

// The rig's own poses: as sure as its cameras kept their places.
Estimate of_rig(const WaveSolution& wave, const calib::CameraRig& rig, const Eigen::RowVectorXd& none) {
  const Similarity onto = onto_rig(rig, wave.state(), true);
  Vector3d middle = Vector3d::Zero();
  for (const calib::Camera& camera : rig.cameras) middle += camera.centre() / static_cast<double>(rig.cameras.size());
  double off2 = 0, spread2 = 0, turned = 0;
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    off2 += (onto * wave.centre(static_cast<int>(c)) - rig.cameras[c].centre()).squaredNorm();
    spread2 += (rig.cameras[c].centre() - middle).squaredNorm();
    const Matrix3d found = wave.state().cam_from_world[c].rotation * onto.rotation.transpose();
    turned = std::max(turned, Eigen::AngleAxisd(rig.cameras[c].cam_from_world.rotation.conjugate() * found).angle());
  }
  return {{.kind = Kind::rig_poses, .sigma = std::max(turned, std::sqrt(off2 / spread2))}, std::log(onto.scale), none};
}

Estimate of_cameras(const WaveSolution& wave, const CameraDistance& d, Eigen::RowVectorXd by_errors) {
  const Vector3d apart = wave.centre(d.a) - wave.centre(d.b);
  by_errors.segment<3>(6 * d.a) = -apart.transpose() / apart.squaredNorm();
  by_errors.segment<3>(6 * d.b) = apart.transpose() / apart.squaredNorm();
  return {{.kind = Kind::camera_distance, .a = d.a, .b = d.b, .measured_m = d.metres, .sigma = tape_sigma(d.metres)},
          std::log(d.metres / apart.norm()),
          by_errors};
}

Estimate of_rests(const WaveSolution& wave, double metres, const Eigen::RowVectorXd& none) {
  constexpr double rest_m = 0.005;  // 1 sigma of the distance of two rests
  return {{.kind = Kind::rest_distance, .measured_m = metres, .sigma = std::hypot(tape_sigma(metres), rest_m / metres)},
          std::log(metres / rest_distance(wave)),
          none};
}

Estimate of_marks(const WaveSolution& wave, const calib::CameraRig& rig, const std::vector<BallMark>& marks,
                  const Eigen::RowVectorXd& none) {
  const MarkedPath path = path_at_marks(wave, marks, rig.cameras.size());
  const Vector3d middle = middle_of(marks);
  double spread2 = 0;
  for (const BallMark& mark : marks) spread2 += (mark.p_world - middle).squaredNorm();
  return {{.kind = Kind::marks,
           .count = marks.size(),
           .measured_m = longest_distance(path.marked),
           .sigma = tape_sigma(std::sqrt(spread2))},
          std::log(scale_of(path)),
          none};
}

// Gravity, m/s^2, and its 1 sigma.
std::pair<double, double> gravity(const WaveOptions& options) {
  constexpr double anywhere = 0.015;   // rms over inhabited latitudes
  constexpr double of_height = 0.001;  // 300 m above the sea
  constexpr double middle_deg = 45;
  if (options.g_m_s2) return {*options.g_m_s2, 0};
  return {normal_gravity(options.latitude_deg.value_or(middle_deg)), options.latitude_deg ? of_height : anywhere};
}

Estimate of_throws(const Throws& throws, const WaveOptions& options) {
  const auto [g, g_sigma] = gravity(options);
  const double found = throws.gravity.acceleration.norm();
  const Vector3d along = -throws.up() / found;  // derivative of the log of its length
  const double sigma = std::hypot(std::sqrt(along.dot(throws.by_outlines * along)), g_sigma / g);
  return {{.kind = Kind::throws, .count = throws.gravity.flights.size(), .sigma = sigma},
          std::log(g / found),
          -along.transpose() * throws.by_errors};
}

std::vector<Estimate> estimates(const WaveSolution& wave, const calib::CameraRig& rig, const WaveOptions& options,
                                const std::optional<Throws>& throws) {
  // Relative: light, blur and chroma; of a guess a factor of two.
  const double of_ball_size = options.guessed_radius ? std::numbers::ln2 : 0.1;
  const Eigen::RowVectorXd none =
      Eigen::RowVectorXd::Zero((6 + lens_freedom) * static_cast<Eigen::Index>(rig.cameras.size()));
  std::vector<Estimate> out;
  if (options.camera_distance) out.push_back(of_cameras(wave, *options.camera_distance, none));
  if (options.rest_distance_m) out.push_back(of_rests(wave, *options.rest_distance_m, none));
  if (!options.marks.empty()) out.push_back(of_marks(wave, rig, options.marks, none));
  // Where the rig's own scale is from is not known: a measured distance replaces it.
  if (options.has_poses && out.empty()) out.push_back(of_rig(wave, rig, none));
  if (throws) out.push_back(of_throws(*throws, options));
  // Twice as large: half as far away.
  out.push_back({{.kind = Kind::ball_size, .sigma = of_ball_size}, -std::log(wave.size_ratio()), none});
  return out;
}

// Measured scale against that of the rig's own poses. factor: from the solution to metres
void compare_scale(WaveScale& scale, const WaveSolution& wave, const calib::CameraRig& rig, double factor) {
  const Estimate of = of_rig(wave, rig, {});
  scale.over_rig = factor / std::exp(of.log_scale);
  scale.rig_sigma = of.source.sigma;
}

}  // namespace

std::optional<Throws> find_throws(const WaveSolution& wave, const WaveOptions& options) {
  constexpr double expected_g = 9.81;
  const std::vector<LinearOutline> outlines = wave.linear_outlines();
  std::vector<PathMeasurement> measurements;
  std::vector<BallObservation> observations;
  for (const LinearOutline& o : outlines) measurements.push_back(o.in_path), observations.push_back(o.observation);
  const OutlineCorrelation correlation;
  FlightOptions o{.radius = options.radius_m * wave.size_ratio(),
                  .expected_g = expected_g * wave.size_ratio(),
                  .jerk = wave.jerk_m_s3()};
  o.frame_s = wave.longest_frame_s();
  o.frames_as_one = correlation.frames_as_one(o.frame_s);
  if (options.ball_kg) o.density_kg_m3 = *options.ball_kg / (4 * std::numbers::pi / 3 * std::pow(options.radius_m, 3));
  auto found = gravity_of(measurements, wave.state().path, o);
  if (!found) return std::nullopt;
  const auto cameras = static_cast<Eigen::Index>(wave.state().cam_from_world.size());
  Throws out{std::move(*found), {}, Eigen::MatrixXd::Zero(3, (6 + lens_freedom) * cameras)};
  // What an arc cannot explain (jitter of the stamps) is in its residuals: a path that bends takes some of it.
  out.by_outlines = out.gravity.by_priors +
                    std::max(1.0, out.gravity.misfit) * propagated(out.gravity.gain.transpose(), observations,
                                                                   index(static_cast<int>(cameras)), correlation);
  // With an error of the poses each outline lies elsewhere. (One of the times moves it along an arc, which stays one.)
  for (std::size_t i = 0; i < outlines.size(); ++i) {
    const auto gain = out.gravity.gain.middleCols<2>(2 * static_cast<Eigen::Index>(i));
    const Eigen::Index c = outlines[i].observation.camera;
    out.by_errors.middleCols<6>(6 * c) -= gain * outlines[i].by_errors.leftCols<6>();
    out.by_errors.middleCols<lens_freedom>(6 * cameras + lens_freedom * c) -=
        gain * outlines[i].by_errors.rightCols<lens_freedom>();
  }
  return out;
}

Eigen::MatrixXd WeighedScale::of_metres(const Eigen::MatrixXd& covariance, const WaveState& state) const {
  Eigen::VectorXd by_scale = Eigen::VectorXd::Zero(covariance.rows());
  for (std::size_t c = 0; c < state.cam_from_world.size(); ++c)
    by_scale.segment<3>(6 * static_cast<Eigen::Index>(c)) = calib::inverse(state.cam_from_world[c]).translation;
  const Eigen::MatrixXd change = Eigen::MatrixXd::Identity(covariance.rows(), covariance.cols()) + by_scale * by_errors;
  return change * covariance * change.transpose();
}

WeighedScale weigh_scale(const WaveSolution& wave, const calib::CameraRig& rig, const WaveOptions& options,
                         const std::optional<Throws>& throws, const Eigen::MatrixXd& covariance) {
  const std::vector<Estimate> all = estimates(wave, rig, options, throws);
  const auto n = static_cast<Eigen::Index>(all.size());
  Eigen::MatrixXd by_errors(n, covariance.cols());
  Eigen::VectorXd log_scale(n), own2(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const Estimate& of = all[static_cast<std::size_t>(i)];
    // A rig whose cameras did not move at all is still not exact.
    constexpr double surest = 1e-6;
    by_errors.row(i) = of.by_errors, log_scale[i] = of.log_scale,
    own2[i] = std::pow(std::max(surest, of.source.sigma), 2);
  }
  Eigen::MatrixXd together = by_errors * covariance * by_errors.transpose();
  together.diagonal() += own2;
  const Eigen::LDLT<Eigen::MatrixXd> solver(together);
  const Eigen::VectorXd ones = Eigen::VectorXd::Ones(n), information = solver.solve(ones);
  const Eigen::VectorXd weights = information / information.sum();
  const double mean = weights.dot(log_scale);
  const Eigen::VectorXd off = log_scale - mean * ones;
  WeighedScale out;
  out.factor = std::exp(mean);
  out.by_errors = weights.transpose() * by_errors;
  // Sources that contradict one another: Birge's ratio.
  const double widen =
      std::sqrt(std::max(1.0, off.dot(solver.solve(off)) / std::max<double>(1, static_cast<double>(n - 1))));
  out.scale.sigma = widen * std::sqrt(1 / information.sum());
  out.own_sigma = std::sqrt(
      std::max(0.0, std::pow(out.scale.sigma, 2) - out.by_errors.dot(covariance * out.by_errors.transpose())));
  for (Eigen::Index i = 0; i < n; ++i) {
    ScaleSource& source = out.scale.sources.emplace_back(all[static_cast<std::size_t>(i)].source);
    source.ratio = std::exp(off[i]);
    source.sigma = std::sqrt(together(i, i));
    source.weight = weights[i];
  }
  std::ranges::stable_sort(out.scale.sources, std::greater{}, &ScaleSource::weight);
  if (options.has_poses && out.scale.is_measured()) compare_scale(out.scale, wave, rig, out.factor);
  return out;
}

namespace {

// Normal of the plane through all places, on the cameras' side. throws CalibrationError: they are too few, or in a
// line.
Vector3d floor_normal(const std::vector<Vector3d>& places, const WaveSolution& wave) {
  Vector3d mean = Vector3d::Zero();
  for (const Vector3d& p : places) mean += p / static_cast<double>(places.size());
  Matrix3d scatter = Matrix3d::Zero();
  for (const Vector3d& p : places) scatter += (p - mean) * (p - mean).transpose();
  const Eigen::SelfAdjointEigenSolver<Matrix3d> axes(scatter);
  constexpr double least_breadth2 = 1e-2;  // over the length, squared
  if (places.size() < 3 || axes.eigenvalues()[1] < least_breadth2 * axes.eigenvalues()[2]) {
    throw solver::CalibrationError(
        fmt::format("the floor leaves the vertical open: the ball was not thrown, and it rested at {} places; lay it "
                    "down at three or more that are not in one line, or throw it five times",
                    places.size()),
        solver::Fault::no_rests);
  }
  return axes.eigenvectors().col(0) * ((wave.centre(0) - mean).dot(axes.eigenvectors().col(0)) < 0 ? -1 : 1);
}

// Origin at the first camera; y horizontal where it looks to. up: of the present world.
Similarity upright(const WaveSolution& wave, const Vector3d& up) {
  const Matrix3d axes = wave.state().cam_from_world[0].rotation.toRotationMatrix();  // rows: the camera's axes
  constexpr double least_level = 0.1;  // sine; a camera that looks straight down: its picture's top
  Vector3d ahead = axes.row(2).transpose();
  if (ahead.cross(up).norm() < least_level) ahead = -axes.row(1).transpose();
  const Vector3d x = ahead.cross(up).normalized();
  Similarity move;
  move.rotation << x.transpose(), up.cross(x).transpose(), up.transpose();
  move.translation = -(move.rotation * wave.centre(0));
  return move;
}

}  // namespace

void set_world(WaveResult& result, WaveSolution& wave, const calib::CameraRig& rig, const WaveOptions& options,
               const std::optional<Throws>& throws) {
  WaveState& state = wave.state();
  if (options.marks.size() >= 3) {
    result.marks_error_m = move_onto_marks(state, options.marks);
  } else if (options.has_poses) {
    const Similarity by_poses = onto_rig(rig, state, false);
    (result.rejected_rig_poses ? by_poses : onto_views(rig, state, wave.observations(), options.radius_m, by_poses))
        .apply(state);
  } else if (throws || options.floor) {
    upright(wave, throws ? throws->up() : floor_normal(rests(wave), wave)).apply(state);
  } else {
    upright(wave, -state.cam_from_world[0].rotation.toRotationMatrix().row(1).transpose()).apply(state);
  }
  if (!options.floor) return;
  const std::vector<Vector3d> places = rests(wave);
  if (places.empty())
    throw solver::CalibrationError("the ball rested nowhere for 0.7 s or longer, so the floor's height is not known",
                                   solver::Fault::no_rests);
  const double lowest = std::ranges::min(places, {}, [](const Vector3d& p) { return p.z(); }).z();
  Similarity{.translation = Vector3d(0, 0, options.radius_m - lowest)}.apply(state);
}

WaveVertical vertical_of(const Throws& throws, const Eigen::MatrixXd& aligned, const Eigen::MatrixXd& covariance) {
  const Vector3d up = throws.up();
  const double g = throws.gravity.acceleration.norm();
  const Matrix3d across = (Matrix3d::Identity() - up * up.transpose()) / g;
  // Up turns with gravity's error, less what the alignment of the world takes with it.
  const Eigen::MatrixXd by_errors = -across * throws.by_errors + calib::cross_matrix(up) * aligned;
  const Matrix3d found = across * throws.by_outlines * across + by_errors * covariance * by_errors.transpose();
  return {std::acos(std::clamp(up.z(), -1.0, 1.0)), std::sqrt(std::max(0.0, found.trace())),
          throws.gravity.flights.size()};
}

}  // namespace huetrack::wave
