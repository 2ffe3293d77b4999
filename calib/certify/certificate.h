// What lengths that are known say of a measuring volume: figures; what they are worth is said in
// calib/report/certificate_report.h. Metres. Pure; nothing throws.
#pragma once

#include <array>
#include <string_view>
#include <vector>

#include "calib/certify/length_test.h"
#include "calib/solver/volume_accuracy.h"

namespace huetrack::certify {

// The axes of the world and the four diagonals of its space, as ISO 10360-2 has them.
inline constexpr std::size_t direction_count = 7;
std::string_view direction_name(std::size_t direction);  // "along x", ...

struct Certificate {
  std::size_t lengths = 0;      // that were measured
  std::size_t independent = 0;  // measurements of their own, of different places or directions
  double mean_m = 0;            // of the errors; each measurement counts alike, in what follows, too
  double rms_m = 0;
  double largest_m = 0;
  // 95 % of lengths that will be measured are off by less: the expanded uncertainty (k = 2 of a normal distribution).
  // By the errors themselves, without any assumption on how they are distributed (conformal prediction: Vovk, Gammerman
  // and Shafer 2005): of n measurements the ceil(0.95 (n + 1))-th smallest error. With what is not known of the true
  // length itself.
  double expanded_m = 0;
  double true_length_sigma_m = 0;

  // What the positions' covariances stated of the same errors.
  double stated_expanded_m = 0;  // 1.96 of their standard deviations, median
  double inside_stated = 0;      // share of the errors within 1.96 of their own; 0.95 when it is honest
  double surprise = 0;           // mean of (error / stated)^2; 1 when it is honest

  struct Part {
    std::size_t lengths = 0, independent = 0;
    double mean_m = 0, rms_m = 0;
  };
  std::array<Part, direction_count> by_direction;
  Part slow, fast;  // slower than 0.3 m/s, faster than 1 m/s
  // By where the middle was: cells; rms of what was measured in it.
  solver::WorldBox box;
  std::array<int, 3> steps{5, 5, 3};
  std::vector<Part> cells;  // x fastest, then y, then z
  std::size_t cells_measured() const;
  std::size_t directions_measured() const;
};

// true_length_sigma_m: >= 0, standard deviation of what is taken for true. Without lengths all is 0.
Certificate certificate_of(const std::vector<MeasuredLength>& lengths, double true_length_sigma_m,
                           std::size_t most_independent = 1'000'000);

}  // namespace huetrack::certify
