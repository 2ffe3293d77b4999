#include "calib/certify/certificate.h"

#include <cmath>
#include <map>
#include <set>
#include <utility>

#include "calib/model/median.h"

namespace huetrack::certify {
namespace {

using Eigen::Vector3d;

constexpr double covered_share = 0.95;
constexpr double normal_95 = 1.96;
constexpr double slow_m_s = 0.3, fast_m_s = 1.0;

std::size_t direction_of(const Vector3d& along) {
  static const std::array<Vector3d, direction_count> directions{Vector3d(1, 0, 0),
                                                                Vector3d(0, 1, 0),
                                                                Vector3d(0, 0, 1),
                                                                Vector3d(1, 1, 1).normalized(),
                                                                Vector3d(1, 1, -1).normalized(),
                                                                Vector3d(1, -1, 1).normalized(),
                                                                Vector3d(-1, 1, 1).normalized()};
  std::size_t best = 0;
  for (std::size_t k = 1; k < direction_count; ++k) {
    if (std::abs(directions[k].dot(along)) > std::abs(directions[best].dot(along))) best = k;
  }
  return best;
}

// Means over lengths, each with its weight.
class PartSum {
 public:
  void add(const MeasuredLength& length, double weight) {
    ++part_.lengths;
    measurements_.insert(length.measurement);
    weight_ += weight;
    part_.mean_m += weight * length.error_m;
    part_.rms_m += weight * length.error_m * length.error_m;
  }
  Certificate::Part part() const {
    Certificate::Part out = part_;
    if (weight_ <= 0) return out;
    out.independent = measurements_.size();
    out.mean_m /= weight_;
    out.rms_m = std::sqrt(out.rms_m / weight_);
    return out;
  }

 private:
  Certificate::Part part_;
  std::set<int> measurements_;
  double weight_ = 0;
};

// See Certificate::expanded_m. weights: their sum is the number of measurements.
double conformal_95(const std::vector<MeasuredLength>& lengths, const std::vector<double>& weights,
                    std::size_t independent) {
  std::vector<std::pair<double, double>> errors;
  double all = 0;
  for (std::size_t k = 0; k < lengths.size(); ++k) {
    errors.emplace_back(std::abs(lengths[k].error_m), weights[k]);
    all += weights[k];
  }
  std::ranges::sort(errors);
  const auto n = static_cast<double>(independent);
  const double wanted = std::ceil(covered_share * (n + 1)) / n * all;
  double sum = 0;
  for (const auto& [error, weight] : errors) {
    sum += weight;
    if (sum >= wanted) return error;
  }
  return errors.back().first;  // too few for more
}

}  // namespace

std::string_view direction_name(std::size_t direction) {
  constexpr std::array<std::string_view, direction_count> names{
      "along x", "along y", "along z", "diagonal + + +", "diagonal + + -", "diagonal + - +", "diagonal - + +"};
  return names[direction];
}

Certificate certificate_of(const std::vector<MeasuredLength>& lengths, double true_length_sigma_m,
                           std::size_t most_independent) {
  Certificate c;
  c.true_length_sigma_m = true_length_sigma_m;
  c.cells.resize(static_cast<std::size_t>(c.steps[0] * c.steps[1] * c.steps[2]));
  if (lengths.empty()) return c;
  std::map<int, int> of_measurement;
  c.box = {lengths.front().middle, lengths.front().middle};
  for (const MeasuredLength& length : lengths) {
    ++of_measurement[length.measurement];
    c.box.low = c.box.low.cwiseMin(length.middle);
    c.box.high = c.box.high.cwiseMax(length.middle);
  }
  c.lengths = lengths.size();
  c.independent = std::min(of_measurement.size(), most_independent);
  std::array<PartSum, direction_count> directions;
  std::vector<PartSum> cells(c.cells.size());
  PartSum slow, fast, all;
  std::vector<double> weights, stated;
  double inside = 0, mean_nes = 0, judged = 0;
  for (const MeasuredLength& length : lengths) {
    const double weight = 1.0 / of_measurement[length.measurement];
    weights.push_back(weight);
    all.add(length, weight);
    directions[direction_of(length.direction)].add(length, weight);
    if (length.speed_m_s < slow_m_s) slow.add(length, weight);
    if (length.speed_m_s > fast_m_s) fast.add(length, weight);
    std::size_t cell = 0;
    for (const int axis : {2, 1, 0}) {
      const int steps = c.steps[static_cast<std::size_t>(axis)];
      const double extent = std::max(1e-9, c.box.high[axis] - c.box.low[axis]);
      const int at =
          std::clamp(static_cast<int>(steps * (length.middle[axis] - c.box.low[axis]) / extent), 0, steps - 1);
      cell = cell * static_cast<std::size_t>(steps) + static_cast<std::size_t>(at);
    }
    cells[cell].add(length, weight);
    c.largest_m = std::max(c.largest_m, std::abs(length.error_m));
    // Includes the reference length's own error.
    const double sigma = std::hypot(length.stated_sigma_m, true_length_sigma_m);
    stated.push_back(normal_95 * length.stated_sigma_m);
    if (!(sigma > 0)) continue;
    judged += weight;
    inside += std::abs(length.error_m) <= normal_95 * sigma ? weight : 0;
    mean_nes += weight * std::pow(length.error_m / sigma, 2);
  }
  const Certificate::Part whole = all.part();
  c.mean_m = whole.mean_m, c.rms_m = whole.rms_m;
  c.expanded_m = std::hypot(conformal_95(lengths, weights, c.independent), normal_95 * true_length_sigma_m);
  c.stated_expanded_m = calib::median(std::move(stated));
  c.inside_stated = judged > 0 ? inside / judged : 0;
  c.mean_nes = judged > 0 ? mean_nes / judged : 0;
  for (std::size_t k = 0; k < direction_count; ++k) c.by_direction[k] = directions[k].part();
  for (std::size_t k = 0; k < cells.size(); ++k) c.cells[k] = cells[k].part();
  c.slow = slow.part(), c.fast = fast.part();
  return c;
}

}  // namespace huetrack::certify
