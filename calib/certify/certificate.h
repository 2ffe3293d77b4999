// Accuracy figures of a measuring volume from known lengths. calib/report/certificate_report.h judges them. Metres.
// Pure; nothing throws.
#pragma once

#include <algorithm>
#include <array>
#include <string_view>
#include <vector>

#include "calib/certify/length_test.h"
#include "calib/solver/volume_accuracy.h"

namespace huetrack::certify {

// World axes and the four space diagonals, as in ISO 10360-2.
inline constexpr std::size_t direction_count = 7;
std::string_view direction_name(std::size_t direction);  // "along x", ...

struct Certificate {
  std::size_t lengths = 0;
  std::size_t independent = 0;  // measurements, at different places or directions
  double mean_m = 0;            // of the errors; here and below each measurement has the same weight
  double rms_m = 0;
  double largest_m = 0;
  // Expanded uncertainty: 95 % of future lengths have a smaller error (k = 2 of a normal distribution).
  // Distribution-free by conformal prediction (Vovk, Gammerman and Shafer 2005): the ceil(0.95 (n + 1))-th smallest of
  // n errors, plus the uncertainty of the true length.
  double expanded_m = 0;
  double true_length_sigma_m = 0;

  // Prediction of the same errors by the positions' covariances.
  double stated_expanded_m = 0;  // 1.96 of their standard deviations, median
  double inside_stated = 0;      // share of the errors within 1.96 standard deviations; 0.95 when consistent
  double mean_nes = 0;           // mean normalised error squared, (error / stated)^2; 1 when consistent

  struct Part {
    std::size_t lengths = 0, independent = 0;
    double mean_m = 0, rms_m = 0;
  };
  std::array<Part, direction_count> by_direction;
  Part slow, fast;  // slower than 0.3 m/s, faster than 1 m/s
  // By cell of the middle.
  solver::WorldBox box;
  std::array<int, 3> steps{5, 5, 3};
  std::vector<Part> cells;  // x fastest, then y, then z
  std::size_t cells_measured() const {
    return static_cast<std::size_t>(std::ranges::count_if(cells, [](const Part& p) { return p.lengths > 0; }));
  }
  std::size_t directions_measured() const {
    return static_cast<std::size_t>(std::ranges::count_if(by_direction, [](const Part& p) { return p.lengths > 0; }));
  }
};

// true_length_sigma_m: >= 0, standard deviation of the reference length. Without lengths all is 0.
Certificate certificate_of(const std::vector<MeasuredLength>& lengths, double true_length_sigma_m,
                           std::size_t most_independent = 1'000'000);

}  // namespace huetrack::certify
