#include "calib/wave/flights.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "calib/wave/flight_fit.h"

namespace huetrack::wave {
namespace {

using Eigen::Matrix2d;
using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Matrix9d = Eigen::Matrix<double, 9, 9>;

struct FlightTuning {
  double events_per_s = 1;       // the ball leaves a hand, is caught, or bounces
  double outlier = 12;           // less log likelihood: one in 100 outlines lies anywhere within 60 sigma
  std::size_t young = 9;         // measurements: three frames of three cameras show how it goes on
  double most_behind = 25;       // of the log likelihood
  double window_s = 0.25;        // in which a first acceleration is looked for: shorter than a throw
  int most_tried = 8;            // first accelerations, those first with which most windows agree
  double log_scale_sigma = 0.2;  // of the expected gravity: of the ball's apparent size and its measured diameter
  double acceleration = 0.03;    // 1 sigma over gravity; of a first one, by noise and drag
  double sure = 4;               // standard deviations of a sum of squares: beyond, a flight does not fit
};
constexpr FlightTuning flight_tuning;

// A Kalman filter's estimate of position, velocity and acceleration.
struct Motion {
  Vector9d mean = Vector9d::Zero();
  Matrix9d covariance = Matrix9d::Identity();
  double log_likelihood = 0;

  // spectral: of a white jerk. drag: Air::drag()
  void predict(double dt, double spectral, double drag) {
    Matrix9d f = Matrix9d::Identity();
    f.block<3, 3>(0, 3).diagonal().setConstant(dt);
    f.block<3, 3>(3, 6).diagonal().setConstant(dt);
    f.block<3, 3>(0, 6).diagonal().setConstant(dt * dt / 2);
    const Vector3d resisted = -drag * mean.segment<3>(3).norm() * mean.segment<3>(3);
    mean = f * mean;
    mean.head<3>() += dt * dt / 2 * resisted;
    mean.segment<3>(3) += dt * resisted;
    covariance = f * covariance * f.transpose();
    if (spectral <= 0) return;
    const double d2 = dt * dt, d3 = d2 * dt;
    const Matrix3d q =
        spectral *
        (Matrix3d() << d3 * d2 / 20, d2 * d2 / 8, d3 / 6, d2 * d2 / 8, d3 / 3, d2 / 2, d3 / 6, d2 / 2, dt).finished();
    for (int i = 0; i < 3; ++i) {
      for (int k = 0; k < 3; ++k) covariance.block<3, 3>(3 * i, 3 * k).diagonal().array() += q(i, k);
    }
  }

  void update(const PathMeasurement& m) {
    const Eigen::Matrix<double, 9, 2> cross = covariance.leftCols<3>() * m.by_position.transpose();
    const Matrix2d s = m.by_position * cross.topRows<3>() + Matrix2d::Identity();
    const Matrix2d inverse = s.inverse();
    const Vector2d innovation = m.value - m.by_position * mean.head<3>();
    const double distance2 = innovation.dot(inverse * innovation);
    constexpr double most = 2 * flight_tuning.outlier;
    log_likelihood -= (std::min(distance2, most) + std::log(s.determinant())) / 2;
    if (distance2 > most) return;
    const Eigen::Matrix<double, 9, 2> gain = cross * inverse;
    mean += gain * innovation;
    covariance -= gain * cross.transpose();
    covariance = (covariance + covariance.transpose()).eval() / 2;
  }

  // Another acceleration from now on, and changes of the velocity and the position (1 sigma).
  void change(const Vector3d& acceleration, double sigma, double hit_speed, double hit_distance) {
    covariance.bottomRows<3>().setZero(), covariance.rightCols<3>().setZero();
    covariance.bottomRightCorner<3, 3>().diagonal().setConstant(sigma * sigma);
    covariance.block<3, 3>(3, 3).diagonal().array() += hit_speed * hit_speed;
    covariance.topLeftCorner<3, 3>().diagonal().array() += hit_distance * hit_distance;
    mean.tail<3>() = acceleration;
  }
};

// What the ball does in the whole recording: in a hand (white jerk), or flying with a known acceleration.
struct Regime {
  double spectral = 0;                          // of the hand's jerk
  double hand_acceleration = 0, hit_speed = 0;  // rms
  Vector3d acceleration = Vector3d::Zero();     // in flight, less what the air carries
  double drag = 0;
  double frame_s = 0;  // so long a hand may take to stop the ball
  bool can_fly = true;
};

struct Explanation {
  double log_likelihood = 0;
  std::vector<Flight> flights;
};

// The most likely sequence of hand and flight: several Kalman filters, each with its own past. What begins anew is kept
// for some measurements, until it shows whether it explains them; after that one for each mode.
class Explainer {
 public:
  Explainer(const std::vector<PathMeasurement>& measurements, const Regime& regime)
      : measurements_(measurements), regime_(regime) {}

  Explanation explain() {
    constexpr double anywhere = 10;  // sigma of the first position, velocity and acceleration
    Hypothesis first{.motion = {}, .flies = false, .part = begin(0, false, no_part)};
    first.motion.covariance *= anywhere * anywhere;
    hypotheses_ = {first};
    for (std::size_t i = 0; i < measurements_.size(); ++i) {
      const double dt = i == 0 ? 0 : measurements_[i].t_s - measurements_[i - 1].t_s;
      if (i > 0) branch(i, dt);
      for (Hypothesis& h : hypotheses_) {
        h.motion.predict(dt, h.flies ? 0 : regime_.spectral, h.flies ? regime_.drag : 0);
        h.motion.update(measurements_[i]);
      }
      prune(i);
    }
    return explanation(best());
  }

 private:
  struct Part {
    std::size_t from;  // measurement
    bool flies;
    std::size_t before;  // part
  };
  struct Hypothesis {
    Motion motion;
    bool flies;
    std::size_t part;  // the last one
  };
  static constexpr std::size_t no_part = std::numeric_limits<std::size_t>::max();

  std::size_t begin(std::size_t i, bool flies, std::size_t before) {
    parts_.push_back({i, flies, before});
    return parts_.size() - 1;
  }
  const Hypothesis& best() const {
    return *std::ranges::max_element(hypotheses_, {}, [](const Hypothesis& h) { return h.motion.log_likelihood; });
  }

  // What may begin: the ball is let go or caught, with a hit (a bounce) or without.
  void branch(std::size_t i, double dt) {
    constexpr double least_s = 1e-3;  // two frames at one time
    const Hypothesis from = best();
    for (const bool flies : {false, true}) {
      for (const double hit_speed : {0.0, regime_.hit_speed}) {
        if ((flies && !regime_.can_fly) || (flies && from.flies && hit_speed == 0)) continue;
        Hypothesis h{from.motion, flies, begin(i, flies, from.part)};
        const double drag = regime_.drag * h.motion.mean.segment<3>(3).squaredNorm();
        h.motion.log_likelihood += std::log(flight_tuning.events_per_s * std::max(least_s, dt));
        h.motion.change(flies ? regime_.acceleration : Vector3d::Zero(),
                        flies ? std::hypot(drag, flight_tuning.acceleration * regime_.acceleration.norm())
                              : regime_.hand_acceleration,
                        hit_speed, flies ? 0 : regime_.frame_s * hit_speed);
        hypotheses_.push_back(h);
      }
    }
  }

  void prune(std::size_t i) {
    const double least = best().motion.log_likelihood - flight_tuning.most_behind;
    std::array<double, 2> settled;  // best of the old ones, by mode
    settled.fill(least);
    const auto is_young = [&](const Hypothesis& h) { return parts_[h.part].from + flight_tuning.young > i; };
    for (const Hypothesis& h : hypotheses_)
      if (!is_young(h)) settled[h.flies] = std::max(settled[h.flies], h.motion.log_likelihood);
    std::erase_if(hypotheses_, [&](const Hypothesis& h) {
      return h.motion.log_likelihood < (is_young(h) ? least : settled[h.flies]);
    });
  }

  Explanation explanation(const Hypothesis& of) const {
    Explanation out{of.motion.log_likelihood, {}};
    std::size_t to = measurements_.size();
    for (std::size_t part = of.part; part != no_part; to = parts_[part].from, part = parts_[part].before) {
      if (!parts_[part].flies || parts_[part].from == to) continue;
      Flight flight{measurements_[parts_[part].from].t_s, measurements_[to - 1].t_s, {}};
      for (std::size_t i = parts_[part].from; i < to; ++i) flight.measurements.push_back(i);
      out.flights.push_back(flight);
    }
    std::ranges::reverse(out.flights);
    return out;
  }

  const std::vector<PathMeasurement>& measurements_;
  const Regime& regime_;
  std::vector<Part> parts_;
  std::vector<Hypothesis> hypotheses_;
};

// A window's acceleration, without drag.
struct Arc {
  Vector3d acceleration;
  Matrix3d covariance;
  double misfit = 0;  // squares per degree of freedom
};

std::optional<Arc> arc_of(const std::vector<PathMeasurement>& measurements, std::size_t from, std::size_t to) {
  if (to - from < least_in_flight) return std::nullopt;
  const double middle = (measurements[from].t_s + measurements[to - 1].t_s) / 2;
  Matrix9d information = Matrix9d::Zero();
  Vector9d right = Vector9d::Zero();
  double squares = 0;
  for (std::size_t i = from; i < to; ++i) {
    const PathMeasurement& m = measurements[i];
    const double t = m.t_s - middle;
    Eigen::Matrix<double, 2, 9> j;
    j << m.by_position, t * m.by_position, t * t / 2 * m.by_position;
    information += j.transpose() * j;
    right += j.transpose() * m.value;
    squares += m.value.squaredNorm();
  }
  const Eigen::LDLT<Matrix9d> solver(information);
  const Matrix9d covariance = solver.solve(Matrix9d(Matrix9d::Identity()));
  if (!covariance.allFinite() || (covariance.diagonal().array() <= 0).any()) return std::nullopt;
  const Vector9d found = solver.solve(right);
  return Arc{found.tail<3>(), covariance.bottomRightCorner<3, 3>(),
             std::max(0.0, squares - right.dot(found)) / static_cast<double>(2 * (to - from) - 9)};
}

// First accelerations to try: those first with which most other windows agree.
std::vector<Vector3d> first_accelerations(const std::vector<PathMeasurement>& measurements, double expected_g) {
  std::vector<Arc> arcs;
  constexpr double plausible_misfit = 3, least = 1.0 / 3, most = 3;
  double next_s = -std::numeric_limits<double>::infinity();
  for (std::size_t from = 0, to = 0; from < measurements.size(); ++from) {
    if (measurements[from].t_s < next_s) continue;
    next_s = measurements[from].t_s + flight_tuning.window_s / 4;
    while (to < measurements.size() && measurements[to].t_s < measurements[from].t_s + flight_tuning.window_s) ++to;
    const auto arc = arc_of(measurements, from, to);
    if (!arc || arc->misfit > plausible_misfit) continue;
    const double ratio = arc->acceleration.norm() / expected_g;
    if (ratio > least && ratio < most && std::sqrt(arc->covariance.trace()) < ratio * expected_g / 4)
      arcs.push_back(*arc);
  }
  const auto agree = [&](const Arc& a, const Arc& b) {
    constexpr double most_distance2 = 11.3;  // chi-square, 3 dof, 99 %
    const double model = 2 * flight_tuning.acceleration * a.acceleration.norm();
    const Vector3d d = a.acceleration - b.acceleration;
    return d.dot((a.covariance + b.covariance + model * model * Matrix3d::Identity()).inverse() * d) < most_distance2;
  };
  std::vector<std::pair<double, std::size_t>> votes;
  for (std::size_t i = 0; i < arcs.size(); ++i)
    votes.emplace_back(-std::ranges::count_if(arcs, [&](const Arc& other) { return agree(arcs[i], other); }) +
                           1e-6 * std::sqrt(arcs[i].covariance.trace()),
                       i);
  std::ranges::sort(votes);
  std::vector<Vector3d> tried;
  for (const auto& [vote, i] : votes) {
    const Vector3d& a = arcs[i].acceleration;
    const auto is_near = [&](const Vector3d& b) { return (a - b).norm() < 2 * flight_tuning.acceleration * a.norm(); };
    if (std::ranges::none_of(tried, is_near)) tried.push_back(a);
    if (static_cast<int>(tried.size()) == flight_tuning.most_tried) break;
  }
  return tried;
}

// Without what may still be in a hand, or already on the floor.
std::vector<Flight> shortened(const std::vector<Flight>& flights, const std::vector<PathMeasurement>& measurements,
                              double by_s) {
  std::vector<Flight> out;
  for (const Flight& f : flights) {
    Flight kept{f.from_s + by_s, f.to_s - by_s, {}};
    for (const std::size_t i : f.measurements)
      if (measurements[i].t_s >= kept.from_s && measurements[i].t_s <= kept.to_s) kept.measurements.push_back(i);
    if (kept.measurements.size() >= least_in_flight) out.push_back(kept);
  }
  return out;
}

// All flights that fit: without the worst one, one after the other.
std::optional<FlightFit> fitted(const std::vector<PathMeasurement>& measurements, std::vector<Flight> flights,
                                const Vector3d& acceleration, const FlightOptions& options) {
  while (!flights.empty()) {
    FlightFit fit(measurements, flights, acceleration, options);
    const auto [worst, excess] = fit.worst();
    if (excess <= flight_tuning.sure) return fit;
    flights.erase(flights.begin() + static_cast<std::ptrdiff_t>(worst));
  }
  return std::nullopt;
}

Regime regime_of(const std::vector<PathMeasurement>& measurements, const BallPath& path, const FlightOptions& options) {
  Regime regime;
  regime.frame_s = options.frame_s;
  regime.spectral =
      options.jerk * options.jerk / 30;  // maths: WaveAdjustmentOptions::jerk_m_s3 is at 30 knots per second
  double speed2 = 0, acceleration2 = 0;
  for (const PathMeasurement& m : measurements) {
    const Vector3d before = path.velocity(m.t_s - path.step_s / 2), after = path.velocity(m.t_s + path.step_s / 2);
    speed2 += path.velocity(m.t_s).squaredNorm();
    acceleration2 += ((after - before) / path.step_s).squaredNorm();
  }
  const auto n = static_cast<double>(measurements.size());
  regime.hand_acceleration = std::sqrt(acceleration2 / n / 3);
  regime.hit_speed = 2 * std::sqrt(speed2 / n / 3);  // a bounce turns a velocity round
  return regime;
}

}  // namespace

std::optional<Gravity> gravity_of(const std::vector<PathMeasurement>& measurements, const BallPath& path,
                                  const FlightOptions& options) {
  if (measurements.size() < least_in_flight) return std::nullopt;
  Regime regime = regime_of(measurements, path, options);
  regime.can_fly = false;
  const double without = Explainer(measurements, regime).explain().log_likelihood;
  regime.can_fly = true;
  regime.drag = Air::before(options).drag();
  Explanation best{-std::numeric_limits<double>::infinity(), {}};
  const auto less_likely = [&](const Vector3d& a) {
    return std::pow(std::log(a.norm() / options.expected_g) / flight_tuning.log_scale_sigma, 2) / 2;
  };
  Vector3d acceleration = Vector3d::Zero();
  for (const Vector3d& a : first_accelerations(measurements, options.expected_g)) {
    regime.acceleration = a;
    Explanation tried = Explainer(measurements, regime).explain();
    tried.log_likelihood -= less_likely(a);
    if (tried.log_likelihood > best.log_likelihood) best = std::move(tried), acceleration = a;
  }
  std::optional<FlightFit> fit;
  constexpr int rounds = 3;
  for (int round = 0; round < rounds; ++round) {
    fit = fitted(measurements, shortened(best.flights, measurements, options.frame_s), acceleration, options);
    if (!fit) return std::nullopt;
    acceleration = fit->acceleration();
    regime.acceleration = fit->air().weight() * acceleration;
    regime.drag = fit->air().drag();
    best = Explainer(measurements, regime).explain();
  }
  // Laplace: the evidence for three numbers more.
  const double by_chance = options.frames_as_one * 1.5 * std::log(static_cast<double>(measurements.size()));
  if (best.log_likelihood - less_likely(acceleration) - without < by_chance) return std::nullopt;
  return fit->gravity();
}

double normal_gravity(double latitude_deg) {
  const double s = std::sin(latitude_deg * std::numbers::pi / 180);
  // maths: WGS 84: gravity at the equator, k and the first eccentricity squared
  constexpr double equator = 9.7803253359, k = 0.00193185265241, e2 = 0.00669437999014;
  return equator * (1 + k * s * s) / std::sqrt(1 - e2 * s * s);
}

}  // namespace huetrack::wave
