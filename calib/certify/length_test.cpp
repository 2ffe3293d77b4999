#include "calib/certify/length_test.h"

#include <algorithm>
#include <cmath>

namespace huetrack::certify {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// Motion or rotation of a bar that begins a new measurement. A bar at rest is one measurement.
constexpr double other_place_m = 0.15, other_direction_cos = 0.94;

// Cut off at either end of a rest; least number of positions of a rest.
constexpr double rest_edge_s = Rest::rest_s / 5;
constexpr std::size_t least_in_rest = 5;

// Derivative of a position by the rig's whitened parameters, with equal weights for all cameras that contain it.
Eigen::MatrixXd by_rig(const calib::CameraRig& rig, const Vector3d& p) {
  std::vector<calib::PlaceView> views;
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    const auto px = rig.cameras[c].project_world(p);
    if (px && rig.cameras[c].contains(*px)) views.push_back({static_cast<int>(c), Eigen::Matrix2d::Identity()});
  }
  return calib::moved_by_cameras(rig, *rig.uncertainty, p, views) * rig.uncertainty->factor();
}

double stated_sigma(const Vector3d& a, const Matrix3d& covariance_a, const Vector3d& b, const Matrix3d& covariance_b,
                    const calib::CameraRig& rig) {
  const Vector3d along = (b - a).normalized();
  const double apart = along.dot((covariance_a + covariance_b) * along);  // for independent errors
  if (!rig.uncertainty || rig.uncertainty->size() == 0) return std::sqrt(std::max(0.0, apart));
  const Eigen::RowVectorXd ga = along.transpose() * by_rig(rig, a), gb = along.transpose() * by_rig(rig, b);
  const double by_frames = apart - ga.squaredNorm() - gb.squaredNorm();
  return std::sqrt(std::max({apart - 2 * ga.dot(gb), by_frames, 0.0}));
}

// Positions from..to - 1 of a track.
struct Window {
  std::size_t from = 0, to = 0;
};

Vector3d mean_position(const BallTrack& track, const Window& window) {
  Vector3d sum = Vector3d::Zero();
  for (std::size_t k = window.from; k < window.to; ++k) sum += track[k].position;
  return sum / static_cast<double>(window.to - window.from);
}

double scatter_about(const BallTrack& track, const Window& window, const Vector3d& mean) {
  double squares = 0;
  for (std::size_t k = window.from; k < window.to; ++k) squares += (track[k].position - mean).squaredNorm();
  return std::sqrt(squares / static_cast<double>(window.to - window.from));
}

// By the displacement between the means of both halves.
bool is_at_rest(const BallTrack& track, const Window& window) {
  const double span_s = track[window.to - 1].t_s - track[window.from].t_s;
  const std::size_t half = (window.from + window.to) / 2;
  if (window.to - window.from < least_in_rest || span_s > 2 * Rest::rest_s) return false;
  const Vector3d moved = mean_position(track, {half, window.to}) - mean_position(track, {window.from, half});
  return moved.norm() < Rest::rest_m_s * span_s / 2 &&
         scatter_about(track, window, mean_position(track, window)) < Rest::rest_scatter_m;
}

// Without putting down and picking up.
Window without_edges(const BallTrack& track, Window window) {
  const double from_s = track[window.from].t_s + rest_edge_s, to_s = track[window.to - 1].t_s - rest_edge_s;
  while (track[window.from].t_s < from_s) ++window.from;
  while (track[window.to - 1].t_s > to_s) --window.to;
  return window;
}

Rest rest_in(const BallTrack& track, const Window& window) {
  Rest rest{.from_s = track[window.from].t_s, .to_s = track[window.to - 1].t_s};
  rest.position = mean_position(track, window);
  for (std::size_t k = window.from; k < window.to; ++k)
    rest.covariance += track[k].covariance / static_cast<double>(window.to - window.from);
  rest.scatter_m = scatter_about(track, window, rest.position);
  return rest;
}

}  // namespace

std::vector<Rest> rests_of(const BallTrack& track) {
  std::vector<Rest> rests;
  Window resting{};  // union of overlapping windows at rest
  const auto end = [&] {
    if (resting.to > resting.from) rests.push_back(rest_in(track, without_edges(track, resting)));
    resting = {};
  };
  for (std::size_t from = 0, to = 0; from < track.size(); ++from) {
    while (to < track.size() && track[to].t_s - track[from].t_s < Rest::rest_s) ++to;
    if (to == track.size()) break;
    const Window window{from, to + 1};
    if (!is_at_rest(track, window)) continue;
    if (from >= resting.to) end();
    if (resting.to == 0) resting.from = from;
    resting.to = window.to;
  }
  end();
  return rests;
}

MeasuredLength length_between(const BallFix& a, const BallFix& b, double length_m, const calib::CameraRig& rig) {
  const Vector3d p = b.position + (a.t_s - b.t_s) * b.velocity, between = p - a.position;
  MeasuredLength m{.set = a.set, .t_s = a.t_s, .middle = (a.position + p) / 2, .direction = between.normalized()};
  m.error_m = between.norm() - length_m;
  m.stated_sigma_m = stated_sigma(a.position, a.covariance, p, b.covariance, rig);
  m.speed_m_s = std::max(a.velocity.norm(), b.velocity.norm());
  return m;
}

int number_measurements(std::span<MeasuredLength> lengths, int first) {
  const MeasuredLength* began = nullptr;
  for (MeasuredLength& m : lengths) {
    const bool is_other = began == nullptr || (m.middle - began->middle).norm() > other_place_m ||
                          std::abs(m.direction.dot(began->direction)) < other_direction_cos;
    m.measurement = is_other ? first++ : began->measurement;
    if (is_other) began = &m;
  }
  return first;
}

std::vector<MeasuredLength> bar_lengths(const BallTrack& a, const BallTrack& b, double length_m,
                                        const calib::CameraRig& rig) {
  std::vector<MeasuredLength> out;
  auto other = b.begin();
  for (const BallFix& fix : a) {
    while (other != b.end() && other->set < fix.set) ++other;
    if (other != b.end() && other->set == fix.set) out.push_back(length_between(fix, *other, length_m, rig));
  }
  number_measurements(out, 0);
  return out;
}

std::vector<Visit> visits_of(const std::vector<Rest>& rests, const std::vector<MarkedPlace>& places) {
  std::vector<Visit> visits;
  for (const Rest& rest : rests) {
    std::vector<std::pair<double, std::size_t>> away;
    for (std::size_t k = 0; k < places.size(); ++k) away.emplace_back((places[k].p_world - rest.position).norm(), k);
    std::ranges::sort(away);
    if (away.empty() || (away.size() > 1 && 3 * away[0].first > away[1].first)) continue;
    visits.push_back({away[0].second, rest});
  }
  return visits;
}

std::vector<MeasuredLength> place_lengths(const std::vector<Visit>& visits, const std::vector<MarkedPlace>& places,
                                          const calib::CameraRig& rig) {
  std::vector<MeasuredLength> out;
  for (std::size_t i = 0; i < visits.size(); ++i) {
    for (std::size_t k = i + 1; k < visits.size(); ++k) {
      if (visits[i].place == visits[k].place) continue;
      const Rest &a = visits[i].rest, &b = visits[k].rest;
      const Vector3d between = b.position - a.position;
      MeasuredLength m{.t_s = b.from_s, .middle = (a.position + b.position) / 2, .direction = between.normalized()};
      m.error_m = between.norm() - (places[visits[k].place].p_world - places[visits[i].place].p_world).norm();
      m.stated_sigma_m = stated_sigma(a.position, a.covariance, b.position, b.covariance, rig);
      m.measurement = static_cast<int>(out.size());
      out.push_back(m);
    }
  }
  return out;
}

}  // namespace huetrack::certify
