// Joint estimate of free flights: acceleration and air common to all of them; per flight its position and velocity, and
// an acceleration by lift. Model: design.md. Private to flights.cpp.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "calib/wave/flights.h"

namespace huetrack::wave {

using Vector9d = Eigen::Matrix<double, 9, 1>;

// maths: twice as many numbers as an arc has (position, velocity, acceleration)
inline constexpr std::size_t least_in_flight = 9;

// Air acts by its density over the ball's: it carries the ball, goes along (half the ball's volume), and resists.
struct Air {
  double over_ball = 0;
  double radius = 1;

  double weight() const { return (1 - over_ball) / (1 + over_ball / 2); }  // of gravity, what is left
  double drag() const;                                                     // acceleration over speed^2: per length
  static Air before(const FlightOptions& options);                         // as far as it is known before any flight
};

class FlightFit {
 public:
  // Fits with Cauchy's loss (Gauss-Newton), from about this acceleration. measurements must outlive it. flights: not
  // empty, each with least_in_flight measurements or more.
  FlightFit(const std::vector<PathMeasurement>& measurements, std::vector<Flight> flights,
            const Eigen::Vector3d& acceleration, const FlightOptions& options);

  Eigen::Vector3d acceleration() const { return common_.head<3>(); }  // in vacuum
  Air air() const { return {common_[3], before_.radius}; }
  // The flight that fits least, and its squares beyond those expected, in standard deviations.
  std::pair<std::size_t, double> worst() const;
  Gravity gravity() const;

 private:
  using Common = Eigen::Vector4d;  // acceleration, air over ball
  struct OneFlight {
    Flight flight;
    Vector9d own = Vector9d::Zero();     // position and velocity at its begin, acceleration by lift
    double squares = 0;                  // of whitened residuals
    std::vector<double> root_weights{};  // per measurement, by the loss
    // Whitened: two rows per measurement, and three for the lift's prior. by_common: with `own` eliminated, at last.
    Eigen::MatrixXd by_common{}, by_own{};
    Eigen::VectorXd residual{};
  };

  void start(OneFlight& of) const;
  std::vector<Eigen::Vector3d> positions(const OneFlight& of, const Common& common, const Vector9d& own) const;
  void linearise(OneFlight& of) const;
  void step();

  const std::vector<PathMeasurement>* measurements_;
  Air before_;
  double air_sigma_, frames_as_one_;
  std::vector<OneFlight> flights_;
  Common common_;
  Eigen::Matrix4d covariance_;
};

}  // namespace huetrack::wave
