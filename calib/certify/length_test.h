// Measured lengths against known ones: of a bar with two balls that is carried through the volume, or between marked
// places on which one ball is put. After ISO 10360-2 and VDI/VDE 2634-1: lengths in many places and directions do not
// depend on the world frame. World frame, metres, seconds on one clock. Pure; safe from any thread, nothing throws.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "calib/model/camera_rig.h"

namespace huetrack::certify {

// A published position of a ball.
struct BallFix {
  std::uint64_t set = 0;  // frame set of the publication
  double t_s = 0;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();    // m/s
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  // of the position, as published, m^2
};
using BallTrack = std::vector<BallFix>;  // ascending in sets and time; `tracking` only

struct MeasuredLength {
  std::uint64_t set = 0;  // of a bar: the frame set
  double t_s = 0;
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  Eigen::Vector3d direction = Eigen::Vector3d::UnitX();  // unit
  double error_m = 0;                                    // measured less true
  double stated_sigma_m = 0;                             // of the error, by the positions' covariances
  double speed_m_s = 0;                                  // of the faster end
  // Lengths at about the same place and direction form one measurement: their errors are correlated.
  int measurement = 0;
};

// The ball rested: positions moved slower than rest_m_s for at least rest_s, with at most rest_scatter_m. Published
// velocities do not decide: a resting ball of a few pixels has 0.05 m/s.
struct Rest {
  static constexpr double rest_m_s = 0.03, rest_s = 0.5, rest_scatter_m = 0.01;
  double from_s = 0, to_s = 0;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();    // mean
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  // mean of the published ones
  double scatter_m = 0;                                  // rms distance from the mean: repeatability
};
std::vector<Rest> rests_of(const BallTrack& track);

// At the time of `a`; `b` is extrapolated to it. stated_sigma_m accounts for the correlation of both errors through the
// rig's uncertainty.
MeasuredLength length_between(const BallFix& a, const BallFix& b, double length_m, const calib::CameraRig& rig);

// Numbers the measurements from `first` on; returns the next free number. lengths: ascending in time.
int number_measurements(std::span<MeasuredLength> lengths, int first);

// Bar with balls of two colours: lengths of all frame sets in which both are tracked.
std::vector<MeasuredLength> bar_lengths(const BallTrack& a, const BallTrack& b, double length_m,
                                        const calib::CameraRig& rig);

struct MarkedPlace {
  std::string name;
  Eigen::Vector3d p_world = Eigen::Vector3d::Zero();
};
struct Visit {
  std::size_t place = 0;
  Rest rest;
};
// Nearest place of each rest, if the second nearest is at least three times as far.
std::vector<Visit> visits_of(const std::vector<Rest>& rests, const std::vector<MarkedPlace>& places);
// Between all pairs of visits of different places; each is a measurement.
std::vector<MeasuredLength> place_lengths(const std::vector<Visit>& visits, const std::vector<MarkedPlace>& places,
                                          const calib::CameraRig& rig);

}  // namespace huetrack::certify
