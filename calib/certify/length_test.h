// Lengths that are exactly known, as positions give them: of a bar with two balls that was carried through the volume,
// or between marked places on which one ball was put. After ISO 10360-2 and VDI/VDE 2634-1, which test a measuring
// machine by lengths, in many places and directions: a length has no origin and no axes, so that where the world lies
// is no part of it. World frame, metres, seconds on one clock. Pure; safe from any thread, nothing throws.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "calib/model/camera_rig.h"

namespace huetrack::certify {

// Where a ball was at one moment, as it was told.
struct BallFix {
  std::uint64_t set = 0;  // the frame set in which it was told, whatever the moment it is told of
  double t_s = 0;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();    // m/s
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  // of the position, as it was stated, m^2
};
using BallTrack = std::vector<BallFix>;  // ascending in sets and time; only what is `tracking`

// One length that was measured.
struct MeasuredLength {
  std::uint64_t set = 0;  // of a bar: the frame set
  double t_s = 0;
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  Eigen::Vector3d direction = Eigen::Vector3d::UnitX();  // unit
  double error_m = 0;                                    // measured less true
  double stated_sigma_m = 0;                             // what the positions' covariances say of the error
  double speed_m_s = 0;                                  // of the faster end
  // Which measurement it belongs to: those of one are of about the same place and direction, and err alike.
  int measurement = 0;
};

// The ball was put down: its positions went no faster than rest_m_s for rest_s at least, and scattered no further. What
// was told of its velocity is no measure of that: of a ball of a few pixels it is 0.05 m/s though it lies still.
struct Rest {
  static constexpr double rest_m_s = 0.03, rest_s = 0.5, rest_scatter_m = 0.01;
  double from_s = 0, to_s = 0;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();    // mean
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  // stated, mean
  double scatter_m = 0;                                  // rms distance from the mean: repeatability
};
std::vector<Rest> rests_of(const BallTrack& track);

// At the moment of `a`: `b` is taken along its velocity to it. The errors of two positions that a rig's uncertainty
// leaves open are much alike where they are near one another: as far as the rig file tells, that is in stated_sigma_m.
MeasuredLength length_between(const BallFix& a, const BallFix& b, double length_m, const calib::CameraRig& rig);

// Says which measurement each belongs to, from `first` on; returns the number that is free then. Ascending in time.
int number_measurements(std::span<MeasuredLength> lengths, int first);

// Of the two balls of a bar, of two colours, in every frame set in which both are tracked.
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
// Which rest was at which place: the nearest one, as long as it is nearer than a third of the way to the next place.
std::vector<Visit> visits_of(const std::vector<Rest>& rests, const std::vector<MarkedPlace>& places);
// Between every two visits of different places. Each is a measurement.
std::vector<MeasuredLength> place_lengths(const std::vector<Visit>& visits, const std::vector<MarkedPlace>& places,
                                          const calib::CameraRig& rig);

}  // namespace huetrack::certify
